//! What can be timed, by name: each algorithm of the core and of the host, set up on an image, run as often
//! as wanted, and asked for what it made. Benches, the comparison with other programs and the growth of cost
//! go through this one list.

mod outline;
mod raster;
mod thinning;
mod whole;

pub use whole::balls;

use crate::images::Image;

/// An algorithm set up on an image.
pub trait Kernel {
    /// Do it once; the same every time, and without an allocation where the algorithm has none.
    fn run(&mut self);

    /// What the last run made.
    fn made(&self) -> Vec<u8>;
}

/// What a kernel belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// One algorithm.
    Kernel,
    /// A chain of them.
    Pipeline,
    /// What asks for no image, whichever it is set up on.
    Alone,
}

/// How a kernel is set up.
type Setup = Box<dyn Fn(&Image) -> Box<dyn Kernel>>;

/// A kernel by its name.
pub struct Entry {
    /// Its name: `algorithm`, or `algorithm/variant`.
    pub name: String,
    /// What it belongs to.
    pub scope: Scope,
    setup: Setup,
}

impl Entry {
    fn new(name: &str, scope: Scope, setup: impl Fn(&Image) -> Box<dyn Kernel> + 'static) -> Self {
        Self { name: name.to_owned(), scope, setup: Box::new(setup) }
    }

    /// Set it up on an image.
    pub fn on(&self, image: &Image) -> Box<dyn Kernel> {
        (self.setup)(image)
    }
}

/// Every kernel, in the order of the data.
pub fn all() -> Vec<Entry> {
    let mut all = raster::entries();
    all.extend(thinning::entries());
    all.extend(outline::entries());
    all.extend(whole::entries());
    all
}

/// A kernel of its memory, of what is done there and of what it is asked for.
struct Step<S, R, M> {
    state: S,
    run: R,
    made: M,
}

impl<S, R: FnMut(&mut S), M: Fn(&S) -> Vec<u8>> Kernel for Step<S, R, M> {
    fn run(&mut self) {
        (self.run)(&mut self.state);
    }

    fn made(&self) -> Vec<u8> {
        (self.made)(&self.state)
    }
}

fn step<S: 'static>(
    state: S,
    run: impl FnMut(&mut S) + 'static,
    made: impl Fn(&S) -> Vec<u8> + 'static,
) -> Box<dyn Kernel> {
    Box::new(Step { state, run, made })
}

/// What a list shows of itself.
fn shown(list: impl std::fmt::Debug) -> Vec<u8> {
    format!("{list:?}").into_bytes()
}
