//! From a skeleton of pixels to a graph of nodes and edges (paper 2.2: end, junction and curve points).
//!
//! **In**: a bitmap, thinned to one pixel. **Out**: nodes (ends, junctions, isolated pixels, loops),
//! edges between them with their pixels in order, and the pixels of the nodes, all in raster order of
//! their first pixel. Positions in 1/256 px.
//!
//! Two set pixels are *linked* when they touch by a side, or by a corner with no set pixel beside it
//! (mixed adjacency); of a full 2x2 block the upper side does not count:
//!
//! ```text
//!   #--#      #  .      #  .      #  #
//!   .  .      |          \        |  |
//!   .  .      #--#      .  #      #--#
//! ```
//!
//! Triangles and squares of links thus cannot exist, the links have as many rings as the picture has
//! holes, and `nodes - edges = components - holes` holds on every bitmap, thin or not.
//!
//! A pixel with no link is isolated, with one an end, with two a curve pixel, with more a junction
//! pixel; linked junction pixels are one node. A ring that no junction touches gets a `Loop` node at its
//! first pixel. Every set pixel belongs to one node or lies inside exactly one edge.
//!
//! **Bounds**: at most 65535 node pixels and nodes; otherwise what the lent lists hold. **Cost**: linear
//! in words and set pixels, a binary search among the node pixels at each end of an edge.
//! **Deviations**: the paper does not say how pixels are linked. **Not promised**: on a bitmap that is
//! not thin, edges run somewhere within the blob.

use crate::bitmap::{Bitmap, Word};
use crate::fixed::{PX, div_round};
use crate::limits::{CapacityError, push};
use crate::point::{Pixel, PixelPoint};
use heapless::VecView;

/// Largest number of nodes and of node pixels: their indices are 16 bits wide.
const MAX_NODES: usize = u16::MAX as usize;

/// What a node is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeKind {
    /// A pixel with one link: the tip of a branch.
    End,
    /// Linked pixels with three or more links each.
    Junction,
    /// A pixel by itself: one ball.
    Isolated,
    /// The arbitrary first pixel of a ring without junction; also in the path of its edge.
    Loop,
}

/// A node of the skeleton.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Node {
    /// What it is.
    pub kind: NodeKind,
    /// Mean of its pixels.
    pub position: PixelPoint,
    /// Edge ends that meet here; an edge from the node to itself counts twice.
    pub degree: u16,
    /// Number of its pixels.
    pub pixels: u16,
}

/// An edge of the skeleton: a stretch of [`Graph::path`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Edge {
    /// The nodes at its ends, as indices; equal for an edge from a node to itself.
    pub nodes: [u16; 2],
    /// Index of its first pixel in the path.
    pub start: u32,
    /// Number of its pixels. They run from the first node to the second, the node pixels that they
    /// are linked to included; a closed edge names each pixel once and ends beside its first.
    pub len: u32,
    /// Whether it is a ring without junction, smooth all round.
    pub closed: bool,
}

/// A pixel of a node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Member {
    /// The pixel.
    pub pixel: Pixel,
    /// Index of its node.
    pub node: u16,
}

/// A skeleton graph in lent lists.
pub struct Graph<'a> {
    /// Nodes; loops last.
    pub nodes: &'a mut VecView<Node>,
    /// Edges; loops last.
    pub edges: &'a mut VecView<Edge>,
    /// The pixels of all edges.
    pub path: &'a mut VecView<Pixel>,
    /// The pixels of the nodes other than loops, in raster order.
    pub members: &'a mut VecView<Member>,
}

impl Graph<'_> {
    /// Forget everything.
    pub fn clear(&mut self) {
        self.nodes.clear();
        self.edges.clear();
        self.path.clear();
        self.members.clear();
    }

    /// The pixels of an edge of this graph, from its first node to its second.
    pub fn pixels(&self, edge: &Edge) -> &[Pixel] {
        let start = edge.start as usize;
        self.path.get(start..start.saturating_add(edge.len as usize)).unwrap_or(&[])
    }

    /// The node that owns a pixel.
    pub fn node_at(&self, pixel: Pixel) -> Option<u16> {
        self.member_at(pixel).and_then(|i| self.node_of(i))
    }

    /// The node of a member.
    fn node_of(&self, i: usize) -> Option<u16> {
        self.members.get(i).map(|member| member.node)
    }

    fn set_node(&mut self, i: usize, node: u16) {
        if let Some(member) = self.members.get_mut(i) {
            member.node = node;
        }
    }

    fn member_at(&self, pixel: Pixel) -> Option<usize> {
        self.members.binary_search_by_key(&(pixel.v, pixel.u), |m| (m.pixel.v, m.pixel.u)).ok()
    }

    fn push_node(&mut self, kind: NodeKind, position: PixelPoint) -> Result<u16, CapacityError> {
        let index = index(self.nodes.len(), "nodes")?;
        push(self.nodes, Node { kind, position, degree: 0, pixels: 1 }, "nodes")?;
        Ok(index)
    }

    /// Append an edge that has the path from `start` to its end.
    fn push_edge(&mut self, nodes: [u16; 2], start: usize, closed: bool) -> Result<(), CapacityError> {
        let edge = Edge { nodes, start: start as u32, len: (self.path.len() - start) as u32, closed };
        push(self.edges, edge, "edges")
    }

    /// List all pixels that are not curve pixels, each naming itself as its representative.
    fn collect_members(&mut self, skeleton: &Bitmap<'_>) -> Result<(), CapacityError> {
        for pixel in skeleton.pixels() {
            if link_count(skeleton, pixel) != 2 {
                let node = index(self.members.len(), "node pixels")?;
                push(self.members, Member { pixel, node }, "node pixels")?;
            }
        }
        Ok(())
    }

    /// Join linked junction pixels (union-find, the earlier representative wins). A link between
    /// pixels already joined goes round a hole inside the node and is an edge of its own.
    fn join_junctions(&mut self, skeleton: &Bitmap<'_>) -> Result<(), CapacityError> {
        for i in 0..self.members.len() {
            let Some(&Member { pixel, .. }) = self.members.get(i) else { break };
            let links = links(skeleton, pixel);
            if links.count_ones() < 3 {
                continue;
            }
            for later in Linked(pixel, links & FORWARD) {
                if link_count(skeleton, later) < 3 {
                    continue;
                }
                let Some(j) = self.member_at(later) else { continue };
                let (a, b) = (self.representative(i), self.representative(j));
                self.set_node(a.max(b), a.min(b) as u16);
                if a == b {
                    let start = self.path.len();
                    push(self.path, pixel, "path pixels")?;
                    push(self.path, later, "path pixels")?;
                    self.push_edge([i as u16; 2], start, false)?;
                }
            }
        }
        Ok(())
    }

    fn representative(&mut self, mut i: usize) -> usize {
        while let Some(parent) = self.node_of(i).map(usize::from)
            && parent != i
            && let Some(grandparent) = self.node_of(parent)
        {
            self.set_node(i, grandparent);
            i = grandparent.into();
        }
        i
    }

    /// Make a node of each representative, and let members and edges name nodes instead of members.
    fn number_nodes(&mut self, skeleton: &Bitmap<'_>) -> Result<(), CapacityError> {
        for i in 0..self.members.len() {
            let Some(&Member { pixel, node: parent }) = self.members.get(i) else { break };
            // A representative comes before all that it represents, so its node is known by now.
            let node = if parent as usize == i {
                let kind = match link_count(skeleton, pixel) {
                    0 => NodeKind::Isolated,
                    1 => NodeKind::End,
                    _ => NodeKind::Junction,
                };
                let sum = PixelPoint { u: pixel.u as i32, v: pixel.v as i32 };
                self.push_node(kind, sum)?
            } else {
                let node = self.node_of(parent.into()).unwrap_or_default();
                if let Some(owner) = self.nodes.get_mut(usize::from(node)) {
                    // At most 65535 pixels below column and row 4096: the sums stay below 2^28.
                    owner.position.u += pixel.u as i32;
                    owner.position.v += pixel.v as i32;
                    owner.pixels += 1;
                }
                node
            };
            self.set_node(i, node);
        }
        for node in self.nodes.iter_mut() {
            // Below 2^28 x 2^8.
            let mean = |sum: i32| div_round(sum as i64 * PX as i64, node.pixels as i64) as i32;
            node.position = PixelPoint { u: mean(node.position.u), v: mean(node.position.v) };
        }
        for edge in self.edges.iter_mut() {
            edge.nodes = edge.nodes.map(|i| self.members.get(usize::from(i)).map_or(i, |member| member.node));
        }
        Ok(())
    }

    /// Walk from every node along every link that no walk has come back on.
    fn follow_edges(&mut self, skeleton: &Bitmap<'_>, seen: &mut Bitmap<'_>) -> Result<(), CapacityError> {
        for i in 0..self.members.len() {
            let Some(&Member { pixel, node }) = self.members.get(i) else { break };
            for next in Linked(pixel, links(skeleton, pixel)) {
                let fresh = match self.node_at(next) {
                    Some(other) => other != node && (pixel.v, pixel.u) < (next.v, next.u),
                    None => !seen.get(next.u as i32, next.v as i32),
                };
                if fresh {
                    let start = self.path.len();
                    push(self.path, pixel, "path pixels")?;
                    let last = self.walk(skeleton, seen, pixel, next)?;
                    push(self.path, last, "path pixels")?;
                    let end = self.node_at(last).unwrap_or(node);
                    self.push_edge([node, end], start, false)?;
                }
            }
        }
        Ok(())
    }

    /// Give each ring that is left a node at its first pixel.
    fn follow_loops(&mut self, skeleton: &Bitmap<'_>, seen: &mut Bitmap<'_>) -> Result<(), CapacityError> {
        for pixel in skeleton.pixels() {
            let links = links(skeleton, pixel);
            if links.count_ones() == 2 && !seen.get(pixel.u as i32, pixel.v as i32) {
                let node = self.push_node(NodeKind::Loop, pixel.centre())?;
                let start = self.path.len();
                push(self.path, pixel, "path pixels")?;
                seen.put(pixel.u as usize, pixel.v as usize, true);
                if let Some(next) = Linked(pixel, links).next() {
                    self.walk(skeleton, seen, pixel, next)?;
                }
                self.push_edge([node; 2], start, true)?;
            }
        }
        Ok(())
    }

    /// Append the curve pixels from `at` on, coming from `from`, and return the pixel that stops the
    /// walk: a node pixel, or one seen before.
    fn walk(
        &mut self,
        skeleton: &Bitmap<'_>,
        seen: &mut Bitmap<'_>,
        mut from: Pixel,
        mut at: Pixel,
    ) -> Result<Pixel, CapacityError> {
        loop {
            let links = links(skeleton, at);
            if links.count_ones() != 2 || seen.get(at.u as i32, at.v as i32) {
                return Ok(at);
            }
            push(self.path, at, "path pixels")?;
            seen.put(at.u as usize, at.v as usize, true);
            let Some(next) = Linked(at, links).find(|&p| p != from) else { return Ok(at) };
            (from, at) = (at, next);
        }
    }
}

/// Make `graph` the graph of `skeleton`. `seen` lends as many words as the skeleton has.
///
/// # Errors
/// A [`CapacityError`] when a list of the graph, or `seen`, is too short.
pub fn trace(skeleton: &Bitmap<'_>, seen: &mut [Word], graph: &mut Graph<'_>) -> Result<(), CapacityError> {
    let mut seen = Bitmap::new(skeleton.size(), seen)?;
    graph.nodes.clear();
    graph.edges.clear();
    graph.path.clear();
    graph.members.clear();
    graph.collect_members(skeleton)?;
    graph.join_junctions(skeleton)?;
    graph.number_nodes(skeleton)?;
    graph.follow_edges(skeleton, &mut seen)?;
    graph.follow_loops(skeleton, &mut seen)?;
    for edge in graph.edges.iter() {
        for node in edge.nodes {
            if let Some(node) = graph.nodes.get_mut(usize::from(node)) {
                node.degree = node.degree.saturating_add(1);
            }
        }
    }
    Ok(())
}

fn index(len: usize, what: &'static str) -> Result<u16, CapacityError> {
    if len < MAX_NODES { Ok(len as u16) } else { Err(CapacityError { what, limit: MAX_NODES }) }
}

/// Links to pixels later in raster order: E SE S SW.
const FORWARD: u8 = 0b0011_1100;

/// The links of a pixel, in the order of [`Bitmap::neighbours`].
pub(crate) fn links(skeleton: &Bitmap<'_>, pixel: Pixel) -> u8 {
    /// N, E, S, W.
    const SIDES: u8 = 0b0101_0101;
    let set = skeleton.neighbours(pixel.u as i32, pixel.v as i32);
    let sides = set & SIDES;
    let corners = set & !SIDES & !sides.rotate_left(1) & !sides.rotate_right(1);
    let upper = |below: u8, side: u8| if set & below == below { side } else { 0 };
    corners | sides & !upper(0b0001_1000, 0b0000_0100) & !upper(0b0011_0000, 0b0100_0000)
}

/// The number of links of a pixel: 0 isolated, 1 an end, 2 a curve pixel, more a junction pixel.
pub(crate) fn link_count(skeleton: &Bitmap<'_>, pixel: Pixel) -> u32 {
    links(skeleton, pixel).count_ones()
}

/// The pixels that the links of a pixel lead to, from north clockwise.
pub(crate) struct Linked(pub(crate) Pixel, pub(crate) u8);

impl Iterator for Linked {
    type Item = Pixel;

    fn next(&mut self) -> Option<Pixel> {
        const STEP: [(i16, i16); 8] = [(0, -1), (1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1)];
        if self.1 == 0 {
            return None;
        }
        let (du, dv) = STEP[self.1.trailing_zeros() as usize];
        self.1 &= self.1 - 1;
        Some(Pixel { u: self.0.u.wrapping_add_signed(du), v: self.0.v.wrapping_add_signed(dv) })
    }
}
