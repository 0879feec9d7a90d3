//! Pairs one after the other, in their order, on a live page.

use std::sync::atomic::Ordering;

use super::super::options::SceneArgs;
use super::super::view::{self, Pace};
use super::super::{Failure, interruption, note};
use super::{Args, Done, one};
use crate::live::View;
use crate::live::control::Limits;
use crate::reconstruct::{Options, Workspace};
use crate::source::find::Found;
use crate::source::scene::Scene;

/// Makes and shows every pair, and the last one again whenever something is set, until Ctrl-C. Results in the order
/// of the pairs, as far as they were made.
pub(super) fn all<'a>(
    args: &Args,
    (mut options, mut scene): (Options, Scene),
    found: &'a Found,
    mut view: View,
) -> Result<Vec<Done<'a>>, Failure> {
    let stop = interruption()?;
    let first = view::settings(&options);
    let (mut workspace, mut pace) = (Workspace::default(), Pace::new(args.rate));
    let mut make = |pair: &'a _, view: &mut View| {
        let (settings, version) = view.control().settings();
        view::obey(&settings, &mut options, &mut scene);
        (one(args, (&options, &scene), (found.single, pair), &mut workspace, Some(view)), version)
    };
    let (mut done, mut obeyed) = (Vec::new(), 0);
    for pair in &found.pairs {
        pace.wait(&stop);
        if stop.load(Ordering::Relaxed) {
            break;
        }
        let (pair, version) = make(pair, &mut view);
        done.push(pair);
        obeyed = version;
    }
    if !stop.load(Ordering::Relaxed) {
        note("that was the last pair, which follows what is set on the page until Ctrl-C");
    }
    while view::wait(&view, obeyed, &stop) {
        let Some(last) = done.last_mut() else { break };
        (*last, obeyed) = make(last.pair, &mut view);
    }
    view::tell_flags(&view, &first);
    Ok(done)
}

/// What can be set for pictures in files.
pub(super) fn limits(scene: &SceneArgs) -> Limits {
    Limits {
        threshold: Ok(()),
        polarity: view::polarity(scene),
        region: Ok(()),
        exposure: Err("these pictures were taken before".into()),
        pairs: Err("these pictures were taken before"),
    }
}

/// What can be set for a device's recording.
pub(super) fn limits_of_recording() -> Limits {
    let found = "a recording holds what the device has found in its pictures";
    Limits {
        threshold: Err(found),
        polarity: Err(found),
        region: Err(found),
        exposure: Err(found.into()),
        pairs: Err(found),
    }
}
