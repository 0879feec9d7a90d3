//! A USB driver that is asked about no endpoint but those it gave out.
//!
//! A request of the host may name any endpoint, there or not, and drivers end the program when asked for one
//! that their controller lacks. Here, halting such an endpoint does nothing, and it is never halted: the device
//! in between has no way to refuse these requests (USB 2.0, 9.4.5 and 9.4.9).

use embassy_usb_driver::{
    Bus, Direction, Driver, Endpoint, EndpointAddress, EndpointAllocError, EndpointType, Event, Unsupported,
};

/// Endpoints of both directions.
#[derive(Clone, Copy, Debug, Default)]
struct Endpoints {
    /// A bit each, from the host.
    out: u16,
    /// A bit each, to the host.
    to_host: u16,
}

impl Endpoints {
    fn direction(&mut self, address: EndpointAddress) -> &mut u16 {
        match address.direction() {
            Direction::Out => &mut self.out,
            Direction::In => &mut self.to_host,
        }
    }

    fn add(&mut self, address: EndpointAddress) {
        *self.direction(address) |= bit(address);
    }

    fn has(mut self, address: EndpointAddress) -> bool {
        *self.direction(address) & bit(address) != 0
    }
}

/// None for a number beyond those of USB, which end at 15.
fn bit(address: EndpointAddress) -> u16 {
    u32::try_from(address.index()).ok().and_then(|index| 1_u16.checked_shl(index)).unwrap_or_default()
}

/// The driver, and what it gave out.
#[derive(Debug)]
pub struct Known<D> {
    inner: D,
    endpoints: Endpoints,
}

impl<D> Known<D> {
    /// A driver that has given out nothing yet. Endpoint 0 is always there.
    pub fn new(inner: D) -> Self {
        Self { inner, endpoints: Endpoints { out: 1, to_host: 1 } }
    }
}

impl<'d, D: Driver<'d>> Driver<'d> for Known<D> {
    type EndpointOut = D::EndpointOut;
    type EndpointIn = D::EndpointIn;
    type ControlPipe = D::ControlPipe;
    type Bus = Known<D::Bus>;

    fn alloc_endpoint_out(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointOut, EndpointAllocError> {
        let endpoint = self.inner.alloc_endpoint_out(kind, address, max_packet_size, interval_ms)?;
        self.endpoints.add(endpoint.info().addr);
        Ok(endpoint)
    }

    fn alloc_endpoint_in(
        &mut self,
        kind: EndpointType,
        address: Option<EndpointAddress>,
        max_packet_size: u16,
        interval_ms: u8,
    ) -> Result<Self::EndpointIn, EndpointAllocError> {
        let endpoint = self.inner.alloc_endpoint_in(kind, address, max_packet_size, interval_ms)?;
        self.endpoints.add(endpoint.info().addr);
        Ok(endpoint)
    }

    fn start(self, control_max_packet_size: u16) -> (Self::Bus, Self::ControlPipe) {
        let (inner, control) = self.inner.start(control_max_packet_size);
        (Known { inner, endpoints: self.endpoints }, control)
    }
}

impl<B: Bus> Bus for Known<B> {
    // Futures are handed on as they are: one of our own could panic when it is asked again after its end.

    fn enable(&mut self) -> impl Future<Output = ()> {
        self.inner.enable()
    }

    fn disable(&mut self) -> impl Future<Output = ()> {
        self.inner.disable()
    }

    fn poll(&mut self) -> impl Future<Output = Event> {
        self.inner.poll()
    }

    fn endpoint_set_enabled(&mut self, address: EndpointAddress, enabled: bool) {
        if self.endpoints.has(address) {
            self.inner.endpoint_set_enabled(address, enabled);
        }
    }

    fn endpoint_set_stalled(&mut self, address: EndpointAddress, stalled: bool) {
        if self.endpoints.has(address) {
            self.inner.endpoint_set_stalled(address, stalled);
        }
    }

    fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
        self.endpoints.has(address) && self.inner.endpoint_is_stalled(address)
    }

    fn force_reset(&mut self) -> Result<(), Unsupported> {
        self.inner.force_reset()
    }

    fn remote_wakeup(&mut self) -> impl Future<Output = Result<(), Unsupported>> {
        self.inner.remote_wakeup()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_usb_driver::{ControlPipe, EndpointError, EndpointIn, EndpointInfo, EndpointOut};

    /// A controller with endpoints 0 to 3, which panics when it is asked for another, as real drivers do.
    struct Controller {
        next: usize,
        halted: [[bool; 4]; 2],
    }

    struct Given(EndpointInfo);

    struct Silent;

    impl Controller {
        fn give(&mut self, direction: Direction, max_packet_size: u16) -> Result<Given, EndpointAllocError> {
            self.next += 1;
            let addr = EndpointAddress::from_parts(self.next, direction);
            Ok(Given(EndpointInfo { addr, ep_type: EndpointType::Bulk, max_packet_size, interval_ms: 0 }))
        }

        fn halted(&mut self, address: EndpointAddress) -> &mut bool {
            &mut self.halted[usize::from(address.is_in())][address.index()]
        }
    }

    impl Driver<'static> for Controller {
        type EndpointOut = Given;
        type EndpointIn = Given;
        type ControlPipe = Silent;
        type Bus = Self;

        fn alloc_endpoint_out(
            &mut self,
            _: EndpointType,
            _: Option<EndpointAddress>,
            max_packet_size: u16,
            _: u8,
        ) -> Result<Given, EndpointAllocError> {
            self.give(Direction::Out, max_packet_size)
        }

        fn alloc_endpoint_in(
            &mut self,
            _: EndpointType,
            _: Option<EndpointAddress>,
            max_packet_size: u16,
            _: u8,
        ) -> Result<Given, EndpointAllocError> {
            self.give(Direction::In, max_packet_size)
        }

        fn start(self, _: u16) -> (Self, Silent) {
            (self, Silent)
        }
    }

    impl Bus for Controller {
        async fn enable(&mut self) {}

        async fn disable(&mut self) {}

        async fn poll(&mut self) -> Event {
            Event::Reset
        }

        fn endpoint_set_enabled(&mut self, address: EndpointAddress, _: bool) {
            self.halted(address);
        }

        fn endpoint_set_stalled(&mut self, address: EndpointAddress, stalled: bool) {
            *self.halted(address) = stalled;
        }

        fn endpoint_is_stalled(&mut self, address: EndpointAddress) -> bool {
            *self.halted(address)
        }

        async fn remote_wakeup(&mut self) -> Result<(), Unsupported> {
            Err(Unsupported)
        }
    }

    impl Endpoint for Given {
        fn info(&self) -> &EndpointInfo {
            &self.0
        }

        async fn wait_enabled(&mut self) {}
    }

    impl EndpointOut for Given {
        async fn read(&mut self, _: &mut [u8]) -> Result<usize, EndpointError> {
            Err(EndpointError::Disabled)
        }
    }

    impl EndpointIn for Given {
        async fn write(&mut self, _: &[u8]) -> Result<(), EndpointError> {
            Err(EndpointError::Disabled)
        }
    }

    impl ControlPipe for Silent {
        fn max_packet_size(&self) -> usize {
            64
        }

        async fn setup(&mut self) -> [u8; 8] {
            [0; 8]
        }

        async fn data_out(&mut self, _: &mut [u8], _: bool, _: bool) -> Result<usize, EndpointError> {
            Err(EndpointError::Disabled)
        }

        async fn data_in(&mut self, _: &[u8], _: bool, _: bool) -> Result<(), EndpointError> {
            Err(EndpointError::Disabled)
        }

        async fn accept(&mut self) {}

        async fn reject(&mut self) {}

        async fn accept_set_address(&mut self, _: u8) {}
    }

    #[test]
    fn a_host_that_names_what_is_not_there_ends_nothing() {
        let mut driver = Known::new(Controller { next: 0, halted: [[false; 4]; 2] });
        let given = [
            driver.alloc_endpoint_in(EndpointType::Interrupt, None, 8, 255).unwrap().0.addr,
            driver.alloc_endpoint_out(EndpointType::Bulk, None, 64, 0).unwrap().0.addr,
            driver.alloc_endpoint_in(EndpointType::Bulk, None, 64, 0).unwrap().0.addr,
        ];
        let (mut bus, _) = driver.start(64);
        // Whatever byte a request may have.
        for address in (0..=u8::MAX).map(EndpointAddress::from) {
            let there = address.index() == 0 || given.contains(&address);
            bus.endpoint_set_enabled(address, true);
            bus.endpoint_set_stalled(address, true);
            assert_eq!(bus.endpoint_is_stalled(address), there, "{address:?}");
            bus.endpoint_set_stalled(address, false);
            assert!(!bus.endpoint_is_stalled(address), "{address:?}");
        }
    }
}
