//! Removal of branches that do not matter (paper 2.2: "short skeletal branches which are not significant
//! are removed").
//!
//! **In**: a skeleton, the distance to the background (1/16 px), a rule. **Out**: the skeleton without
//! the branches, and its graph.
//!
//! A branch runs from an end to the first junction pixel; the pixels before the junction go. They go one
//! branch at a time, the one with the smallest score first (of equals the first in raster order), and a
//! branch is scored again when its junction has become a curve pixel and it has grown by that. Removing
//! a branch takes off end pixels only, so components, holes and rings stay, and so does an edge between
//! two ends.
//!
//! | rule | score, 1/256 px | goes while |
//! |---|---|---|
//! | `Protrusion` | by how far the tip's ball sticks out of the junction's: distance of the two centres + radius at the tip - radius at the junction | score < px |
//! | `Length` | length of the branch, diagonal steps sqrt 2 | score < px |
//! | `Branches` | area that the branch's balls sweep outside the junction's ball: the sum of 2 radius x step over the pixels farther from the junction than its radius, px^2 | edges > n |
//!
//! **Bounds**: as many branches as the scratch holds. **Cost**: n tips take n^2 comparisons and a walk along
//! each branch; `Branches` traces the graph about log2(excess) times more.
//! **Deviations**: the paper prunes by length alone, with no threshold given; `Length` is that rule.
//! **Not promised**: `Branches(n)` ends one below n when a junction vanishes with the last branch, and
//! above n when only rings and edges between junctions are left. The swept area leaves out the half disc
//! at the tip and counts overlaps on the inside of bends twice.

use crate::arena::{Arena, List};
use crate::bitmap::{Bitmap, Plane};
use crate::fixed::PX;
use crate::limits::CapacityError;
use crate::point::Pixel;
use crate::stage::graph::{Graph, Linked, NodeKind, link_count, links, trace};
use bytemuck::{Pod, Zeroable};

/// Which branches to remove.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Pruning {
    /// None.
    None,
    /// Those whose tip ball sticks out of the junction's ball by less than `px`.
    Protrusion {
        /// 1/256 px.
        px: i32,
    },
    /// Those shorter than `px`.
    Length {
        /// 1/256 px.
        px: i32,
    },
    /// The least in swept area until this many edges are left.
    Branches(u16),
}

impl Default for Pruning {
    /// A protrusion of 1.5 px; results are flat up to 3 px.
    fn default() -> Self {
        Self::Protrusion { px: 3 * PX / 2 }
    }
}

/// The free end of a branch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Tip {
    pixel: Pixel,
    junction: Pixel,
    score: i64,
}

/// What pruning did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Report {
    /// Edges of the graph before.
    pub edges_before: usize,
    /// Edges of the graph after.
    pub edges_after: usize,
    /// Branches removed; a junction that vanishes takes one more edge with it.
    pub branches_removed: usize,
    /// Pixels cleared.
    pub pixels_removed: usize,
}

/// Prune `skeleton` by `rule` and make `graph` the graph of what is left. The scratch holds as many words as
/// the skeleton has, and every end.
///
/// # Errors
/// A [`CapacityError`] when the scratch or a list of the graph is too short.
pub fn prune(
    skeleton: &mut Bitmap<'_>,
    distance: &Plane<'_, u16>,
    rule: Pruning,
    mut scratch: Arena<'_>,
    graph: &mut Graph<'_>,
) -> Result<Report, CapacityError> {
    let seen = scratch.take(skeleton.size().words(), "words of scratch")?;
    trace(skeleton, seen, graph)?;
    let edges = graph.edges.len();
    let mut report = Report { edges_before: edges, edges_after: edges, ..Report::default() };
    if rule == Pruning::None {
        return Ok(report);
    }
    let mut tips = scratch.list("tips");
    for node in graph.nodes.iter().filter(|n| n.kind == NodeKind::End) {
        if let Some(tip) = node.position.pixel().and_then(|p| score(skeleton, distance, rule, p)) {
            tips.push(tip)?;
        }
    }
    loop {
        let (threshold, quota) = match rule {
            Pruning::None => (i64::MIN, 0),
            Pruning::Protrusion { px } | Pruning::Length { px } => (px as i64, usize::MAX),
            // A branch takes at most two edges with it: half the excess can go unseen.
            Pruning::Branches(n) => (i64::MAX, report.edges_after.saturating_sub(n as usize).div_ceil(2)),
        };
        let before = report.branches_removed;
        while report.branches_removed - before < quota {
            let least = least(&tips).filter(|(_, score)| *score < threshold);
            let Some(tip) = least.and_then(|(i, _)| tips.swap_remove(i)) else { break };
            report.pixels_removed += erase(skeleton, tip);
            report.branches_removed += 1;
            if link_count(skeleton, tip.junction) == 2 {
                rescore(skeleton, distance, rule, tip.junction, &mut tips);
            }
        }
        if report.branches_removed == before {
            return Ok(report);
        }
        trace(skeleton, seen, graph)?;
        report.edges_after = graph.edges.len();
    }
}

/// The place and the score of the tip that goes first.
fn least(tips: &[Tip]) -> Option<(usize, i64)> {
    let least = tips.iter().enumerate().min_by_key(|(_, tip)| (tip.score, tip.pixel.v, tip.pixel.u));
    least.map(|(i, tip)| (i, tip.score))
}

/// Clear a branch but for its junction pixel; the number of pixels cleared.
fn erase(skeleton: &mut Bitmap<'_>, tip: Tip) -> usize {
    let mut cleared = 0;
    let mut at = tip.pixel;
    while at != tip.junction {
        let next = Linked(at, links(skeleton, at)).next();
        skeleton.put(at.u as usize, at.v as usize, false);
        cleared += 1;
        let Some(next) = next else { break };
        at = next;
    }
    cleared
}

/// Follow the branches that ended at `former`, no longer a junction, to their next junction; one that
/// comes to another end is no branch any more.
fn rescore(
    skeleton: &Bitmap<'_>,
    distance: &Plane<'_, u16>,
    rule: Pruning,
    former: Pixel,
    tips: &mut List<'_, Tip>,
) {
    let mut i = 0;
    while let Some(tip) = tips.get_mut(i) {
        if tip.junction == former {
            let Some(scored) = score(skeleton, distance, rule, tip.pixel) else {
                tips.swap_remove(i);
                continue;
            };
            *tip = scored;
        }
        i += 1;
    }
}

/// The branch at an end; none if it leads to another end.
fn score(skeleton: &Bitmap<'_>, distance: &Plane<'_, u16>, rule: Pruning, end: Pixel) -> Option<Tip> {
    let walk = || Walk { skeleton, from: end, at: Some(end) };
    let junction = walk().last().filter(|&p| link_count(skeleton, p) > 2)?;
    let radius = |p: Pixel| distance.get(p.u as i32, p.v as i32) as i64 * (PX as i64 / 16);
    let far = |p: Pixel| junction.centre().distance(p.centre()) as i64;
    // Radii and distances are below 2^21, steps below 2^9: 2^31 a pixel, 2^55 a branch of 2^24.
    let score = match rule {
        Pruning::None => 0,
        Pruning::Protrusion { .. } => far(end) + radius(end) - radius(junction),
        Pruning::Length { .. } => steps(walk()).map(|(_, step)| step).sum(),
        Pruning::Branches(_) => {
            let swept = |(p, step)| if far(p) > radius(junction) { 2 * radius(p) * step } else { 0 };
            steps(walk()).map(swept).sum()
        }
    };
    Some(Tip { pixel: end, junction, score })
}

/// The pixels of a branch before its junction, each with the length of the step to the next, 1/256 px.
fn steps(walk: Walk<'_, '_>) -> impl Iterator<Item = (Pixel, i64)> {
    let mut ahead = walk;
    ahead.next();
    walk.zip(ahead).map(|(a, b)| (a, a.centre().distance(b.centre()) as i64))
}

/// The pixels of a branch from its end to the junction or the other end, both included.
#[derive(Clone, Copy)]
struct Walk<'a, 'b> {
    skeleton: &'a Bitmap<'b>,
    from: Pixel,
    at: Option<Pixel>,
}

impl Iterator for Walk<'_, '_> {
    type Item = Pixel;

    fn next(&mut self) -> Option<Pixel> {
        let at = self.at?;
        let links = links(self.skeleton, at);
        let inner = links.count_ones() == 2 || at == self.from;
        self.at = if inner { Linked(at, links).find(|&p| p != self.from) } else { None };
        self.from = at;
        Some(at)
    }
}
