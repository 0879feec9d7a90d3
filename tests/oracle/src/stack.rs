//! The deepest that an image's stack can become, from its code: how deep each function has it at each of its
//! calls, and who calls whom.
//!
//! A call by an address in a register is followed by a list of what can be meant. What ends the image is not
//! gone into. An interrupt comes on top of all, each handler once, as none interrupts itself; that is more than
//! priorities allow. Recursion is an error.

use crate::image::{Function, Image};
use crate::thumb::{Effect, decode};
use std::collections::{BTreeMap, BTreeSet};

/// What an exception pushes: 26 words with those of floating point, and 4 bytes to align.
const EXCEPTION: u32 = 26 * 4 + 4;
/// The instruction that does nothing.
const NOP: [u8; 2] = 0xBF00u16.to_le_bytes();
/// Deeper is no function: the analysis runs in circles.
const LIMIT: i32 = 1 << 24;

/// What calls by registers can mean, by their callers' names; and names of functions that end the image.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// Callees of each.
    pub callees: BTreeMap<String, Vec<String>>,
    /// What does not come back.
    pub ends: BTreeSet<String>,
}

impl Known {
    /// Read a list: lines `caller -> callee; callee`, `name ends`, and comments behind `#`.
    ///
    /// # Panics
    /// When a line is neither.
    pub fn read(text: &str) -> Self {
        let mut known = Self::default();
        for line in text.lines().filter(|line| !line.starts_with('#') && !line.trim().is_empty()) {
            if let Some((caller, callees)) = line.split_once(" -> ") {
                let callees = callees.split("; ").map(str::to_owned);
                known.callees.entry(caller.to_owned()).or_default().extend(callees);
            } else {
                let name = line.strip_suffix(" ends").unwrap_or_else(|| panic!("what is {line:?}?"));
                known.ends.insert(name.to_owned());
            }
        }
        known
    }
}

/// A function's own use of the stack.
#[derive(Clone, Debug, Default)]
struct Frame {
    deepest: u32,
    /// Depth at each call, and where it goes; nowhere in particular for those by registers.
    calls: BTreeSet<(u32, Option<u32>)>,
}

fn frame(image: &Image, function: &Function) -> Result<Frame, String> {
    let is_code = |at: u32| (function.start..function.end).contains(&at) && image.is_code(at);
    let mut frame = Frame::default();
    let mut depths = BTreeMap::<u32, i32>::new();
    // Address, depth, and how many instructions still depend on a condition.
    let mut paths = vec![(function.start, 0, 0)];
    while let Some((at, depth, mut depends)) = paths.pop() {
        if !is_code(at) {
            return Err(format!("{} goes on at {at:#x}, where it has no code", function.name));
        }
        if depths.get(&at).is_some_and(|known| *known >= depth) {
            continue;
        }
        if depth > LIMIT {
            return Err(format!("{} uses ever more stack at {at:#x}", function.name));
        }
        depths.insert(at, depth);
        let here = depth.max(0).cast_unsigned();
        frame.deepest = frame.deepest.max(here);
        let (effect, length) = decode(at, image.at(at).ok_or("no code")?);
        let next = at + length;
        let goes_on = depends > 0;
        depends = u32::saturating_sub(depends, 1);
        let mut go = |to: u32, depth: i32, depends: u32| paths.push((to, depth, depends));
        match effect {
            // What does not come back has nothing behind its call, but for what fills the function up.
            Effect::Call(_) | Effect::CallRegister => {
                let to = if let Effect::Call(to) = effect { Some(to) } else { None };
                frame.calls.insert((here, to));
                let fills = |at: &u32| image.at(*at).is_some_and(|code| code.starts_with(&NOP));
                let behind = (next..).step_by(NOP.len()).find(|at| !fills(at)).unwrap_or(next);
                if is_code(behind) {
                    go(behind, depth, depends);
                }
            }
            Effect::None => go(next, depth, depends),
            Effect::If(count) => go(next, depth, count),
            Effect::Stack(bytes) => {
                go(next, depth + bytes, depends);
                if goes_on {
                    go(next, depth, depends);
                }
            }
            Effect::Jump(to, is_conditional) => {
                if (function.start..function.end).contains(&to) && to != function.start {
                    go(to, depth, 0);
                } else {
                    frame.calls.insert((here, Some(to)));
                }
                if is_conditional || goes_on {
                    go(next, depth, depends);
                }
            }
            Effect::JumpRegister => {
                frame.calls.insert((here, None));
                if goes_on {
                    go(next, depth, depends);
                }
            }
            Effect::Table(bytes) => {
                let table = image.at(next).unwrap_or_default();
                let end = image.code_behind(next).min(function.end);
                let entries = table[..(end - next) as usize].chunks_exact(bytes);
                for entry in entries {
                    let distance = entry.iter().rev().fold(0, |sum, byte| sum << 8 | u32::from(*byte));
                    // What fills a table up to whole instructions leads anywhere.
                    if is_code(next + 2 * distance) {
                        go(next + 2 * distance, depth, 0);
                    }
                }
            }
            Effect::End => {
                if goes_on {
                    go(next, depth, depends);
                }
            }
            Effect::Unknown => return Err(format!("{} moves its stack at {at:#x}", function.name)),
        }
    }
    Ok(frame)
}

/// A chain of calls, each function with the depth at which it calls the next, and the sum of these.
#[derive(Clone, Debug, Default)]
pub struct Chain {
    /// Bytes.
    pub depth: u32,
    /// Names, from the outermost on, and bytes.
    pub calls: Vec<(String, u32)>,
}

/// Follows all calls of an image.
struct Walk<'i> {
    image: &'i Image,
    known: &'i Known,
    done: BTreeMap<u32, Chain>,
    open: Vec<&'i Function>,
    /// What of the list was asked for.
    used: BTreeSet<String>,
}

impl<'i> Walk<'i> {
    fn deepest(&mut self, function: &'i Function) -> Result<Chain, String> {
        if let Some(chain) = self.done.get(&function.start) {
            return Ok(chain.clone());
        }
        if let Some(from) = self.open.iter().position(|open| open.start == function.start) {
            let circle: Vec<_> = self.open[from..].iter().map(|open| &*open.name).collect();
            return Err(format!("recursion: {} -> {}", circle.join(" -> "), function.name));
        }
        self.open.push(function);
        let frame = frame(self.image, function)?;
        let mut worst = Chain { depth: frame.deepest, calls: vec![(function.name.clone(), frame.deepest)] };
        for (depth, to) in frame.calls {
            for callee in self.callees(function, to)? {
                let inner = self.deepest(callee)?;
                if depth + inner.depth > worst.depth {
                    let calls = [vec![(function.name.clone(), depth)], inner.calls].concat();
                    worst = Chain { depth: depth + inner.depth, calls };
                }
            }
        }
        self.open.pop();
        self.done.insert(function.start, worst.clone());
        Ok(worst)
    }

    /// What a call can mean, without what ends the image.
    fn callees(&mut self, caller: &Function, to: Option<u32>) -> Result<Vec<&'i Function>, String> {
        let image = self.image;
        let all = match to {
            Some(to) => vec![image.function_at(to).ok_or(format!("{} calls {to:#x}", caller.name))?],
            None => {
                let names = self.known.callees.get(&caller.name);
                let names = names.ok_or(format!("what does {} call by a register?", caller.name))?;
                self.used.insert(caller.name.clone());
                let found: Vec<_> =
                    image.functions().filter(|function| names.contains(&function.name)).collect();
                if found.is_empty() {
                    return Err(format!("{} has nothing that {} may call", image.name, caller.name));
                }
                self.used.extend(found.iter().map(|function| function.name.clone()));
                found
            }
        };
        let (ends, goes_on): (Vec<_>, _) = all.into_iter().partition(|f| self.known.ends.contains(&f.name));
        self.used.extend(ends.into_iter().map(|function| function.name.clone()));
        Ok(goes_on)
    }
}

/// The deepest chain from the reset, then that of each handler, and what of the list it took.
///
/// # Errors
/// Recursion, and what cannot be followed, by the functions' names.
pub fn deepest(image: &Image, known: &Known) -> Result<(Vec<Chain>, BTreeSet<String>), String> {
    let mut walk = Walk { image, known, done: BTreeMap::new(), open: Vec::new(), used: BTreeSet::new() };
    let (ends, entries): (Vec<_>, Vec<_>) =
        image.entries().into_iter().partition(|entry| known.ends.contains(&entry.name));
    let chains: Result<_, _> = entries.into_iter().map(|entry| walk.deepest(entry)).collect();
    walk.used.extend(ends.into_iter().map(|entry| entry.name.clone()));
    Ok((chains?, walk.used))
}

/// What chains take together, each handler on top of all others.
pub fn sum(chains: &[Chain]) -> u32 {
    let handlers = chains.len().saturating_sub(1) as u32;
    chains.iter().map(|chain| chain.depth).sum::<u32>() + handlers * EXCEPTION
}
