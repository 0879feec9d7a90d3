//! Many pairs on many machines: what waits in a queue ([`job`]), the queue ([`queue`]) on a NATS server with
//! JetStream ([`server`]), and what is kept of what was done ([`record`]; docs/batch.md,
//! docs/decisions/0027-batches.md).
//!
//! Only paths go through the queue. A pair is known by its name and a sum over everything that its model depends on, so
//! that it is done once, whoever submits it how often, and however many workers are killed over it.

pub mod job;
pub mod queue;
pub mod record;
pub mod server;
