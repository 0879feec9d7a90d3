//! The displacement of the visible side: Gauss-Newton on lattices, from coarse to fine.
//!
//! * **In**: the ball model in both views, and their images. **Out**: a displacement kappa at each node of a lattice of
//!   2 px: ln z = ln z_front + kappa sqrt(h^2 + 1.5^2) / z_front, h half the model's thickness along the ray, mm. 0 is
//!   the ball model, a constant an elliptical cross-section.
//! * **Least**: the sum of three kinds of terms. *Stereo*: grey levels of both eyes, within the noise (Cauchy, so that
//!   what only one eye sees does not pull). *Bending*: second differences of kappa, Cauchy, so that an edge may be
//!   sharp. *Prior*: the ball model, firmly at the outline, where it is measured, and weakly elsewhere.
//! * **Coarse to fine**: nodes 8, 4 and 2 px apart, each in images blurred to suit; terms are weighed by what they say
//!   of a square pixel, so that all lattices mean the same.
//! * **Gates**, if they are asked for: highlights are not looked at (`light.rs`), and where the grey levels around a
//!   node do not speak for a displacement the ball model is held to, in a last round.
//! * **Cost**: some 20 systems of equations (`system.rs`), most of them on the finest lattice.

use super::lattice::{Lattice, RIM, Stencil};
use super::picture::Picture;
use super::pool::{Lent, Pool, Shelf};
use super::stereo::{Response, Seen, View, look, respond, spread, visible};
use super::system::System;
use crate::mesh::Mesh;
use crate::stage::rectify::RectifiedCamera;

/// Steps of a lattice, px, blur of the images there, px, and rounds.
const LEVELS: [(usize, f64, usize); 4] = [(8, 3.0, 4), (4, 2.0, 4), (2, 1.3, 3), (2, 0.8, 6)];
/// Rounds after the gates.
const GATED: usize = 5;
/// Blur that noise asks for, px a grey level, and its most.
const NOISY: (f64, f64) = (0.15, 3.0);
/// Least standard deviation of what stereo compares, grey levels: rounding, and what interpolation leaves.
const SIGMA: f64 = 0.4;
/// Residuals of so many standard deviations count half.
const ROBUST: f64 = 2.5;
/// Standard deviation of a second difference on the finest lattice, and the change of slope that counts half.
const BEND: f64 = 0.04;
const CREASE: f64 = 0.08;
/// How far the ball model's depth may be off: so many mm, and so much of its half thickness.
const OFF: [f64; 2] = [1.0, 0.5];
/// What that prior weighs off the outline.
const WEAK: f64 = 0.02;
/// Farthest that a node moves, in half thicknesses: towards the eye, and away from it.
const REACH: [f64; 2] = [-2.5, 0.95];
/// Least half thickness for that, mm.
const THIN: f64 = 3.0;

/// Nodes around one, on each side, whose evidence counts.
const AROUND: usize = 7;
/// What the displacement must gain in log-likelihood around a node, as a score: neighbours in blurred images are not
/// independent, and noise alone gains too.
const EVIDENCE: f64 = 14.0;
/// Least standard deviation of a residual for that, grey levels: rounding, after a blur.
const ROUNDED: f64 = 0.1;

/// What was found.
#[derive(Debug)]
pub(super) struct Field<'p> {
    pub(super) lattice: Lattice<'p>,
    /// Displacement of each node.
    pub(super) moved: Lent<'p, f64>,
    /// What stereo says of each node, though it be held: the inverse square of its displacement's standard deviation.
    pub(super) known: Lent<'p, f64>,
    /// Nodes at which the ball model is held to.
    pub(super) held: Lent<'p, bool>,
    pub(super) response: Response,
    /// Standard deviations of the residuals, grey levels: of the ball model, and of what was measured.
    pub(super) spreads: [f64; 2],
}

/// What a displacement is found from.
pub(super) struct Scene<'a, 'p> {
    /// Where lists come from.
    pub(super) pool: &'p Pool,
    pub(super) mesh: &'a Mesh,
    pub(super) views: &'a [View<'p>; 2],
    pub(super) camera: &'a RectifiedCamera,
    /// Pixels that the model and the mask of the left view both hold.
    pub(super) object: &'a [bool],
    /// Standard deviation of a grey level.
    pub(super) noise: f64,
    /// Right less left row that is known already, px.
    pub(super) rows: f64,
    /// Whether grey levels must speak for a displacement.
    pub(super) gated: bool,
}

/// Find the displacements.
pub(super) fn measure<'p>(scene: &Scene<'_, 'p>) -> Field<'p> {
    let least = (NOISY.0 * scene.noise).min(NOISY.1);
    let pictures = |blur: f64| {
        // What noise asks for comes on top of the sharpest.
        let blur = blur.max(LEVELS[3].1 + least).min(NOISY.1);
        scene.views.each_ref().map(|view| view.picture.blurred(&view.core, blur))
    };
    let mut field = Field::new(scene, LEVELS[0].0);
    for (step, blur, rounds) in LEVELS {
        if field.lattice.step != step {
            field = field.finer(scene, step);
        }
        field.refine(scene, &pictures(blur), rounds);
    }
    let sharpest = pictures(LEVELS[3].1);
    let mut residuals = field.residuals(scene, &sharpest);
    if scene.gated {
        field.gate(&residuals);
        field.refine(scene, &sharpest, GATED);
        residuals = field.residuals(scene, &sharpest);
    }
    field.spreads = spreads(&scene.pool.numbers, &residuals);
    field
}

impl<'p> Field<'p> {
    /// The ball model on a lattice.
    fn new(scene: &Scene<'_, 'p>, step: usize) -> Self {
        let left = &scene.views[0];
        let (pool, rim) = (scene.pool, &left.rim.levels);
        let lattice = Lattice::new(pool, step, &left.depths, (scene.object, rim), scene.camera.f);
        let held = |node: usize| {
            let [u, v] = lattice.at[node];
            lattice.on[node] && left.shines.at(u, v) > 0.1
        };
        Self {
            moved: pool.numbers.filled(0.0, lattice.on.len()),
            known: pool.numbers.filled(0.0, lattice.on.len()),
            held: pool.flags.of((0..lattice.on.len()).map(held)),
            response: Response { gain: 1.0, offset: 0.0, rows: scene.rows },
            spreads: [0.0; 2],
            lattice,
        }
    }

    /// The same displacements on a finer lattice.
    fn finer(self, scene: &Scene<'_, 'p>, step: usize) -> Self {
        let mut finer = Self { response: self.response, ..Self::new(scene, step) };
        for node in finer.lattice.nodes() {
            let moved = self.lattice.look_up(&self.moved, finer.lattice.at[node]);
            finer.moved[node] = moved.unwrap_or(0.0);
        }
        finer
    }

    /// Rounds of Gauss-Newton.
    fn refine(&mut self, scene: &Scene<'_, 'p>, pictures: &[Picture<'p>; 2], rounds: usize) {
        let lattice = &self.lattice;
        let visible = visible(lattice, scene);
        let mut system = System::new(&scene.pool.numbers, lattice.width, lattice.on.len());
        let mut step = scene.pool.numbers.filled(0.0, lattice.on.len());
        let sigma = scene.noise.max(SIGMA);
        for _ in 0..rounds {
            system.clear();
            trust_balls(lattice, &self.moved, &self.held, &mut system);
            bend(lattice, &self.moved, &mut system);
            let seen = look(lattice, &visible, pictures, scene, (&self.moved, &self.response));
            self.response = respond(&scene.pool.numbers, &seen, self.response, scene.rows);
            self.known.fill(0.0);
            for seen in seen.iter().filter(|seen| seen.counts) {
                let residual = seen.residual(&self.response);
                let slope = seen.slope(&self.response, lattice.unit[seen.node]);
                let doubt = 1.0 + (residual / (ROBUST * sigma)).powi(2);
                let weight = lattice.area() / (sigma * sigma * doubt);
                self.known[seen.node] = weight * slope * slope;
                if !self.held[seen.node] {
                    system.add(seen.node, weight, residual, slope);
                }
            }
            system.solve(&mut step);
            for node in lattice.nodes() {
                let half = lattice.half[node] / lattice.depth[node];
                let most = (0.3 * half).clamp(0.004, 0.02) / lattice.unit[node];
                let reach = half.max(THIN / lattice.depth[node]) / lattice.unit[node];
                let moved = self.moved[node] + step[node].clamp(-most, most);
                self.moved[node] = moved.clamp(REACH[0] * reach, REACH[1] * reach);
            }
        }
    }

    /// What the ball model and the displacements leave unexplained, grey levels, at the nodes where both can be told.
    fn residuals(&self, scene: &Scene<'_, 'p>, pictures: &[Picture<'p>; 2]) -> Lent<'p, (usize, [f64; 2])> {
        let lattice = &self.lattice;
        let visible = visible(lattice, scene);
        let see = |moved: &[f64]| {
            // Each has the response that suits it best.
            let seen = look(lattice, &visible, pictures, scene, (moved, &self.response));
            let response = respond(&scene.pool.numbers, &seen, self.response, scene.rows);
            let seen = look(lattice, &visible, pictures, scene, (moved, &response));
            let residual = |seen: &Seen| seen.counts.then(|| seen.residual(&response));
            scene.pool.residuals.of(seen.iter().map(residual))
        };
        let still = scene.pool.numbers.filled(0.0, self.moved.len());
        let [balls, measured] = [see(&still), see(&self.moved)];
        let both = |((&node, &balls), &measured): ((&usize, &Option<f64>), &Option<f64>)| {
            Option::zip(balls, measured).map(|(b, m)| (node, [b, m]))
        };
        scene.pool.both.of(visible.iter().zip(balls.iter()).zip(measured.iter()).filter_map(both))
    }

    /// Put the nodes back on the ball model where the residuals do not speak against it, and hold them to it.
    fn gate(&mut self, residuals: &[(usize, [f64; 2])]) {
        let shelf = self.moved.shelf();
        let sigma = ROBUST * spreads(shelf, residuals)[1].max(ROUNDED);
        let unlikely = |residual: f64| ROBUST * ROBUST / 2.0 * libm::log1p((residual / sigma).powi(2));
        let mut evidence = shelf.filled(0.0, self.moved.len());
        for &(node, [balls, measured]) in residuals {
            evidence[node] = unlikely(balls) - unlikely(measured);
        }
        let evidence = self.lattice.sums_around(&evidence, AROUND);
        for node in self.lattice.nodes() {
            self.held[node] |= evidence[node] < EVIDENCE;
            if self.held[node] {
                self.moved[node] = 0.0;
            }
        }
    }

    /// Whether stereo says more of a node than the ball model does.
    pub(super) fn is_measured(&self, node: usize) -> bool {
        !self.held[node] && self.known[node] > prior(&self.lattice, node, WEAK)
    }
}

/// Standard deviations of both residuals.
fn spreads(shelf: &Shelf<f64>, residuals: &[(usize, [f64; 2])]) -> [f64; 2] {
    [0, 1].map(|of| spread(shelf, residuals.iter().map(|(_, both)| both[of])))
}

/// What the ball model weighs at a node, if it is trusted so `firm`ly.
fn prior(lattice: &Lattice<'_>, node: usize, firm: f64) -> f64 {
    let off = libm::hypot(OFF[0], OFF[1] * lattice.half[node]) / lattice.depth[node];
    lattice.area() * firm * (lattice.unit[node] / off).powi(2)
}

/// The ball model, held to at the outline and where nothing speaks against it, and preferred elsewhere.
fn trust_balls(lattice: &Lattice<'_>, moved: &[f64], held: &[bool], system: &mut System<'_>) {
    for node in lattice.nodes() {
        let firm = if lattice.rim[node] < RIM || held[node] { 1.0 } else { WEAK };
        system.add(node, prior(lattice, node, firm), moved[node], 1.0);
    }
}

/// Second differences of displacements.
fn bend(lattice: &Lattice<'_>, moved: &[f64], system: &mut System<'_>) {
    // A second difference grows with the square of the step, a change of slope with the step.
    let scale = lattice.area().sqrt();
    let (sigma, crease) = (BEND * scale * scale, CREASE * scale);
    let weight = |value: f64| lattice.area() / (sigma * sigma) / (1.0 + (value / crease).powi(2));
    let root = std::f64::consts::SQRT_2;
    for stencil in lattice.stencils.iter() {
        let along = |by: usize, node: usize| [node - by, node, node + by];
        let line = match *stencil {
            Stencil::Along(node) => along(1, node),
            Stencil::Down(node) => along(lattice.width, node),
            Stencil::Twist(node) => {
                let below = node + lattice.width;
                let value = root * (moved[node] - moved[node + 1] - moved[below] + moved[below + 1]);
                let (places, slopes) = ([node, node + 1, below, below + 1], [root, -root, -root, root]);
                system.couple(places, slopes, weight(value), value);
                continue;
            }
        };
        let value = moved[line[0]] - 2.0 * moved[line[1]] + moved[line[2]];
        system.couple(line, [1.0, -2.0, 1.0], weight(value), value);
    }
}
