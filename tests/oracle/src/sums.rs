//! What is made of a case on each of the ways that must give the same bits.

use crate::core::Core;
use crate::emulated::Case;
use firmware::memory::{Qvga, Small, Storage as _, Vga};
use firmware::stages::Stages;
use host::calibration::StereoCamera;
use host::memory::Storage;
use host::mesh::Mesh;
use host::reconstruct::{Options, Workspace};
use image::GrayImage;
use rayon::{ThreadPool, ThreadPoolBuilder};
use shared::bitmap::{Grey, Size};
use shared::fixed::PX;
use shared::pipeline::{Finding, Memory, run, scratch_words};
use shared::stage::sequential_thinning::scratch_order;

/// FNV-1a, 64 bits.
pub fn checksum(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes.into_iter().fold(0xcbf2_9ce4_8422_2325, |h, b| (h ^ u64::from(b)).wrapping_mul(0x100_0000_01b3))
}

/// Of every bit of a mesh.
pub fn mesh_checksum(mesh: &Mesh) -> u64 {
    let vertices = mesh.vertices.iter().flat_map(|p| [p.x, p.y, p.z]).flat_map(|x| x.to_bits().to_le_bytes());
    checksum(vertices.chain(mesh.faces.iter().flatten().flat_map(|i| i.to_le_bytes())))
}

/// What the PC makes of a case in memory without bounds: a line a stage.
pub fn on_the_pc(core: &mut Core, case: &Case) -> Vec<String> {
    let size = grey(&case.pair[0]).size();
    stages(&mut core.lend(size, ""), case).0
}

/// A run of a case in this memory: a line a stage, and whether the memory is too short.
fn stages(memory: &mut Memory<'_>, case: &Case) -> (Vec<String>, bool) {
    let [left, right] = case.pair.each_ref().map(grey);
    let mut lines = Vec::new();
    let mut stages = Stages::new((), |record| lines.push(record.to_string()));
    let outcome = run(memory, left, right, &case.settings(), &mut stages);
    stages.ended(&outcome, memory.eyes[0].samples);
    (lines, matches!(outcome, Err(Finding::Capacity(_))))
}

fn grey(image: &GrayImage) -> Grey<'_> {
    let size = Size::new(image.width() as usize, image.height() as usize).expect("a size that is allowed");
    Grey::new(size, size.width, image.as_raw()).expect("as many bytes as pixels")
}

/// All ways of a PC, with the memory that each goes in, used again and again as it was left.
pub struct Bench {
    core: Core,
    small: Box<Small>,
    qvga: Box<Qvga>,
    scratch: Vec<u64>,
    storage: Storage,
    workspace: Workspace,
    pools: [ThreadPool; 2],
    /// Cases that gave a surface.
    pub models: u64,
    /// Cases for which a board's memory is too short.
    pub short: u64,
}

impl Default for Bench {
    fn default() -> Self {
        let c = Vga::CAPACITIES;
        let order = scratch_order(c.size.pixels() * 6 / 10, u16::MAX >> 2);
        Self {
            core: Core::default(),
            small: Box::new(Small::new()),
            qvga: Box::new(Qvga::new()),
            scratch: vec![0; scratch_words(c.size, c.points, c.controls, order)],
            storage: Storage::default(),
            workspace: Workspace::default(),
            pools: [1, 5]
                .map(|threads| ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")),
            models: 0,
            short: 0,
        }
    }
}

impl Bench {
    /// What a board has to say of a case: a line a stage in its memory; and whether that is too short, of which the last
    /// line tells by how much: that depends on the width of a word.
    pub fn as_a_board(&mut self, case: &Case) -> (Vec<String>, bool) {
        let size = grey(&case.pair[0]).size();
        let fits = |c: Size| size.width <= c.width && size.height <= c.height;
        let mut memory = if fits(Small::CAPACITIES.size) { self.small.lend() } else { self.qvga.lend() };
        assert!(fits(Qvga::CAPACITIES.size), "no case is larger");
        if !case.as_device {
            memory.scratch = &mut self.scratch;
        }
        stages(&mut memory, case)
    }

    /// What the host's kernels make of a case.
    fn by_wide_kernels(&mut self, case: &Case) -> Vec<String> {
        let Size { width, height } = grey(&case.pair[0]).size();
        self.storage.fit(width, height).expect("a small picture");
        stages(&mut self.storage.lend(), case).0
    }

    /// The sum of a surface, or of the reason why there is none, on a number of threads.
    fn surface(&mut self, case: &Case, pool: usize) -> Result<u64, String> {
        let (width, height) = case.pair[0].dimensions();
        let camera =
            StereoCamera::rectified(width, height, f64::from(case.optics.focal) / f64::from(PX), 60.0);
        let options = Options { draft: true, ..Options::default() };
        let Self { workspace, pools, .. } = self;
        let made =
            pools[pool].install(|| workspace.reconstruct(case.pair.each_ref(), &camera, &options, &mut ()));
        let made = made.map_err(|refusal| refusal.to_string())?;
        let sum = mesh_checksum(&made.mesh);
        self.workspace.recycle(made);
        Ok(sum)
    }

    /// Goes all ways with a case; sums of what the core made in large and in small memory, and of the surface.
    ///
    /// # Panics
    /// When two ways differ.
    pub fn sums(&mut self, case: &Case) -> String {
        let name = &case.name;
        let (large, wide) = (on_the_pc(&mut self.core, case), self.by_wide_kernels(case));
        let (board, short) = self.as_a_board(case);
        assert!(large == wide, "{name}: wide kernels make {wide:?}, portable ones {large:?}");
        self.short += u64::from(short);
        if short {
            // Up to where its memory ends a board makes the same.
            for line in &board[..board.len() - 1] {
                assert!(large.contains(line), "{name}: {line} is not in {large:?}");
            }
        } else {
            assert!(board == large, "{name}: {board:?} is not {large:?}");
        }
        let [one, many] = [0, 1].map(|pool| self.surface(case, pool));
        assert!(one == many, "{name}: {one:?} on one thread, {many:?} on many");
        self.models += u64::from(one.is_ok());
        let [large, board] = [large, board].map(|lines| checksum(lines.concat().into_bytes()));
        let surface = one.unwrap_or_else(|refusal| checksum(refusal.into_bytes()));
        format!("{large:016x} {board:016x} {surface:016x}")
    }
}
