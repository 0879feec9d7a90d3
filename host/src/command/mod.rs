//! What the user asks for: one file a subcommand.

pub mod inspect;
