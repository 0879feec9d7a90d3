//! The shape: what a run of the core leaves that describes the object, all that the host needs to grow
//! the solid.
//!
//! * **In**: the lists of a run and its outcome. **Out**: the same, to the resolutions below.
//! * **Sent**: positions and radii to [`POSITION_STEP`], disparities to [`DISPARITY_STEP`], the turn from the
//!   left to the right normal to [`TURN_STEP`]; figures and the plane exactly.
//! * **Not sent**, since it follows: left normals, from the positions as in the contour stage; weights, from
//!   the right normals as in row matching; disparities where nothing was matched, from the plane. Samples of
//!   branches are points of their curves. Disparities beyond +-2^20 come back as that.
//! * **Same bits everywhere**: a shape that was read is written to the same bytes again.
//! * **Not promised**: that a hull is still convex to the last unit.

use super::WireError;
use super::bytes::Reader;
use super::curves::{read_branches, write_branches};
use super::figures::{bounded_plane, read_figures, write_figures};
use super::frame::Writer;
use super::outline::{read_contour, read_points, write_contour, write_points};
use super::rice::{BitReader, BitWriter};
use crate::limits::CapacityError;
use crate::pipeline::{Branch, Memory, Outcome};
use crate::point::PixelPoint;
use crate::stage::contour::{ContourLoop, ContourPoint};
use crate::stage::correspond::{CUT_VERTICES, CutMatch};
use crate::stage::nurbs::Control;
use crate::stage::rows::ContourMatch;
use heapless::VecView;

/// Resolution of positions and radii: 1/32 px, in 1/256 px.
pub const POSITION_STEP: i32 = 8;
/// Resolution of disparities: 1/64 px, in 1/256 px.
pub const DISPARITY_STEP: i32 = 4;
/// Resolution of the turn between the normals of both views, as its sine in 1/16384: 0.9 degrees.
pub const TURN_STEP: i32 = 256;

/// Largest magnitude of a coordinate, 1/256 px.
pub(super) const RANGE: i32 = 1 << 20;

/// What a run leaves that describes the object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape<'a> {
    /// The left contour.
    pub contour: &'a [ContourPoint],
    /// Its loops, one after the other.
    pub loops: &'a [ContourLoop],
    /// What the right view says of each contour point.
    pub matches: &'a [ContourMatch],
    /// Vertices of both convex hulls.
    pub hulls: [&'a [PixelPoint]; 2],
    /// Branches of the left skeleton; their samples are not sent.
    pub branches: &'a [Branch],
    /// Control points of the branches' curves.
    pub controls: &'a [Control],
    /// What the run says beside; the paper's match of the vertices is not sent.
    pub outcome: &'a Outcome,
}

impl<'a> Shape<'a> {
    /// What a run of the default method left in its memory.
    pub fn of(memory: &'a Memory<'_>, outcome: &'a Outcome) -> Self {
        let [left, right] = &memory.eyes;
        Self {
            contour: left.contour,
            loops: left.loops,
            matches: memory.matches,
            hulls: [left.hull, right.hull],
            branches: left.branches,
            controls: left.controls,
            outcome,
        }
    }

    /// Append the shape to a frame.
    ///
    /// # Errors
    /// A [`CapacityError`] when there is more than can be counted, or a loop or a branch asks for points that
    /// are not there.
    pub(super) fn write(&self, writer: &mut Writer<'_>) -> Result<(), CapacityError> {
        let plane = bounded_plane(&self.outcome.plane);
        write_figures(self.outcome, writer);
        for (count, what) in [
            (self.loops.len(), "contour loops"),
            (self.hulls[0].len(), "hull vertices"),
            (self.hulls[1].len(), "hull vertices"),
            (self.branches.len(), "branches"),
        ] {
            let limit = usize::from(u16::MAX);
            writer.u16(u16::try_from(count).map_err(|_| CapacityError { what, limit })?);
        }
        let mut bits = BitWriter::new(writer);
        write_contour(self, &plane, &mut bits)?;
        for hull in self.hulls {
            write_points(hull, &mut bits);
        }
        if let Some(cuts) = &self.outcome.cuts {
            write_points(&cuts.left, &mut bits);
            write_points(&cuts.right, &mut bits);
        }
        write_branches(self, &plane, &mut bits)?;
        bits.finish();
        Ok(())
    }
}

/// The lists and figures that a shape is read into.
pub struct ShapeLists<'a> {
    /// For [`Shape::contour`].
    pub contour: &'a mut VecView<ContourPoint>,
    /// For [`Shape::loops`].
    pub loops: &'a mut VecView<ContourLoop>,
    /// For [`Shape::matches`].
    pub matches: &'a mut VecView<ContourMatch>,
    /// For [`Shape::hulls`].
    pub hulls: [&'a mut VecView<PixelPoint>; 2],
    /// For [`Shape::branches`].
    pub branches: &'a mut VecView<Branch>,
    /// For [`Shape::controls`].
    pub controls: &'a mut VecView<Control>,
    /// For [`Shape::outcome`].
    pub outcome: &'a mut Outcome,
}

impl<'a> ShapeLists<'a> {
    /// The memory of a run, to be taken up with [`resume`](crate::pipeline::resume).
    pub fn of(memory: &'a mut Memory<'_>, outcome: &'a mut Outcome) -> Self {
        let [left, right] = &mut memory.eyes;
        Self {
            contour: left.contour,
            loops: left.loops,
            matches: memory.matches,
            hulls: [left.hull, right.hull],
            branches: left.branches,
            controls: left.controls,
            outcome,
        }
    }
}

impl ShapeLists<'_> {
    /// What the lists hold.
    pub fn shape(&self) -> Shape<'_> {
        Shape {
            contour: self.contour,
            loops: self.loops,
            matches: self.matches,
            hulls: [self.hulls[0], self.hulls[1]],
            branches: self.branches,
            controls: self.controls,
            outcome: self.outcome,
        }
    }

    /// Read a shape; replaces what the lists held.
    ///
    /// # Errors
    /// A [`WireError`]; the lists are then empty.
    pub(super) fn read(&mut self, reader: &mut Reader<'_>) -> Result<(), WireError> {
        self.clear();
        let read = self.fill(reader);
        if read.is_err() {
            self.clear();
        }
        read
    }

    fn clear(&mut self) {
        self.contour.clear();
        self.loops.clear();
        self.matches.clear();
        for hull in &mut self.hulls {
            hull.clear();
        }
        self.branches.clear();
        self.controls.clear();
        *self.outcome = Outcome::default();
    }

    fn fill(&mut self, reader: &mut Reader<'_>) -> Result<(), WireError> {
        let cut = read_figures(self.outcome, reader)?;
        let plane = self.outcome.plane;
        let loops = reader.u16()?;
        let hulls = [reader.u16()?, reader.u16()?];
        let branches = reader.u16()?;
        let mut bits = BitReader::new(reader);
        read_contour(self, loops, &plane, &mut bits)?;
        for (hull, count) in self.hulls.iter_mut().zip(hulls) {
            read_points(count, &mut bits, |p| crate::limits::push(hull, p, "hull vertices"))?;
        }
        if let Some(cut) = cut {
            let mut cuts = CutMatch {
                left: Default::default(),
                right: Default::default(),
                errors: cut.errors,
                least: cut.least,
                shift: cut.shift,
            };
            for side in [&mut cuts.left, &mut cuts.right] {
                let mut slots = side.iter_mut();
                read_points(CUT_VERTICES as u16, &mut bits, |p| {
                    slots.next().map_or(Ok(()), |slot| {
                        *slot = p;
                        Ok(())
                    })
                })?;
            }
            self.outcome.cuts = Some(cuts);
        }
        read_branches(self, branches, &plane, &mut bits)
    }
}
