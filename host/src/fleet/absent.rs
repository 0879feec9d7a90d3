//! A program without Zenoh: nothing can be opened, so there is nothing that could be used.

use std::convert::Infallible;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Map, Value};

use super::key::{Board, Leaf};
use super::{FleetError, Meeting, Message, Obeyed, Pressure};
use crate::live::control::Control;

/// A part of the network.
#[derive(Clone, Debug)]
pub struct Link(Infallible);

/// A board, as others see it.
#[derive(Debug)]
pub struct Publisher(Infallible);

/// Where messages arrive.
#[derive(Debug)]
pub struct Subscriber(Infallible);

#[expect(clippy::missing_errors_doc, reason = "there is one error, that of `open`")]
#[expect(missing_docs, reason = "they are those of the program with Zenoh")]
impl Link {
    pub fn open(_: &Meeting) -> Result<Self, FleetError> {
        Err(FleetError::Absent)
    }

    pub fn publish(&self, _: &Board, _: Pressure, _: Arc<Control>) -> Result<Publisher, FleetError> {
        match self.0 {}
    }

    pub fn subscribe(&self, _: &Board, _: Pressure) -> Result<Subscriber, FleetError> {
        match self.0 {}
    }

    pub fn last(&self, _: &Board, _: Leaf) -> Result<Vec<Message>, FleetError> {
        match self.0 {}
    }

    pub fn order(&self, _: &Board, _: &str, _: &str) -> Result<Vec<Obeyed>, FleetError> {
        match self.0 {}
    }
}

#[expect(missing_docs, reason = "they are those of the program with Zenoh")]
impl Publisher {
    pub fn put(&mut self, _: Leaf, _: u64, _: Vec<u8>) -> Result<(), FleetError> {
        match self.0 {}
    }

    pub fn status(&mut self, _: u64, _: Map<String, Value>) -> Result<(), FleetError> {
        match self.0 {}
    }
}

#[expect(missing_docs, reason = "they are those of the program with Zenoh")]
impl Subscriber {
    pub fn next(&self, _: Duration) -> Result<Option<Result<Message, String>>, FleetError> {
        match self.0 {}
    }
}
