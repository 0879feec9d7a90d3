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

impl Link {
    /// Says how to get a program that can.
    ///
    /// # Errors
    /// [`FleetError::Absent`], always.
    pub fn open(_: &Meeting) -> Result<Self, FleetError> {
        Err(FleetError::Absent)
    }

    /// There is no link to publish through.
    ///
    /// # Errors
    /// None.
    pub fn publish(&self, _: &Board, _: Pressure, _: Arc<Control>) -> Result<Publisher, FleetError> {
        match self.0 {}
    }

    /// There is no link to hear through.
    ///
    /// # Errors
    /// None.
    pub fn subscribe(&self, _: &Board, _: Pressure) -> Result<Subscriber, FleetError> {
        match self.0 {}
    }

    /// There is no link to ask through.
    ///
    /// # Errors
    /// None.
    pub fn last(&self, _: &Board, _: Leaf) -> Result<Vec<Result<Message, String>>, FleetError> {
        match self.0 {}
    }

    /// There is no link to order through.
    ///
    /// # Errors
    /// None.
    pub fn order(&self, _: &Board, _: &str, _: &str) -> Result<Vec<Obeyed>, FleetError> {
        match self.0 {}
    }
}

impl Publisher {
    /// There is nobody to send.
    ///
    /// # Errors
    /// None.
    pub fn put(&mut self, _: Leaf, _: u64, _: Vec<u8>) -> Result<(), FleetError> {
        match self.0 {}
    }

    /// There is nobody to send.
    ///
    /// # Errors
    /// None.
    pub fn status(&mut self, _: u64, _: Map<String, Value>) -> Result<(), FleetError> {
        match self.0 {}
    }
}

impl Subscriber {
    /// There is nobody to hear.
    ///
    /// # Errors
    /// None.
    pub fn next(&self, _: Duration) -> Result<Option<Result<Message, String>>, FleetError> {
        match self.0 {}
    }
}
