//! What a walk does at its medium vertices, and the density of a path's end under the connection.
//!
//! x is a medium vertex of the walk, p the boundary point after it, w the direction from x to p, w_L
//! that from p to a light. The walk draws w with the density U = phase(w) e^(-sigma_t d) per solid angle
//! and is refracted with the probability T. The connection draws a light with probability P and w_L with
//! the light's density p_L (1 for parallel light), and finds all w that it refracts to, so per solid
//! angle of w it has P p_L J, J = |d w_L / d w|. Relative to U, as walks have it, that is P p_L J /
//! (phase e^(-sigma_t d)), and both techniques score
//!   throughput * T eta^2 L / (T + P p_L J / (phase e^(-sigma_t d))),
//! the walk only where it can: not parallel light. A method that does not know whether it finds a root
//! (`Solver::finds`) has its lights to itself: the walk's hits score 0 there.

use super::ConnectionSetup;
use super::facet::SolverWork;
use super::method::WeightedRoot;
use super::patch::SurfacePatch;
use super::throughput::{Query, Root, solid_angle_ratio};
use crate::estimators::bands::WalkBands;
use crate::estimators::choice::choose_light;
use crate::estimators::walk::{CameraWalk, Rivals, WalkExit, WalkVertex};
use crate::estimators::{Anomaly, Cost};
use crate::geometry::Ray;
use crate::math::DVec3;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::Stream;

/// State that a walk carries.
pub(super) struct Connected<'a> {
    setup: &'a ConnectionSetup,
    stream: Stream,
    /// The vertex that the walk came from, if it has not met the boundary since.
    departure: Option<WalkVertex>,
    found: Vec<WeightedRoot>,
}

/// A light as it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    /// Index of the light.
    pub light: usize,
    /// Radiance, or irradiance of parallel light.
    pub radiance: f64,
    /// Probability of the light times the density of the direction; of parallel light the probability
    /// alone.
    pub density: f64,
    /// Whether the walk may find it, too.
    pub is_shared: bool,
}

impl<'a> Connected<'a> {
    pub(super) fn new(setup: &'a ConnectionSetup, stream: Stream) -> Connected<'a> {
        Connected { setup, stream, departure: None, found: Vec::new() }
    }
}

impl Rivals for Connected<'_> {
    fn call<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        let Ray { origin: point, dir: arrival } = walk.ray;
        let departure = WalkVertex { point, arrival, walks: walk.bands.density() };
        let Connected { setup, stream, departure: latest, found } = &mut walk.rivals;
        *latest = Some(departure);
        let Some((light, choice)) = choose_light(&setup.shares[walk.band], stream.draw()) else {
            return;
        };
        let sample = walk.scene.lights[light].sample(walk.band, stream.draw2());
        let shape = &*walk.scene.shape;
        let query = Query { x: point, w_l: sample.wi, eta: walk.boundary.eta() };
        let mut work = SolverWork::default();
        let mut roots = std::mem::take(found);
        roots.clear();
        setup.solver.roots(shape, &query, stream, &mut work, &mut roots);
        (0..work.wrong_side).for_each(|_| walk.scores.note(Anomaly::WrongSide));
        walk.scores.count_many(Cost::Rays, work.rays);
        let is_shared = sample.pdf.is_some() && setup.is_density_known;
        let density = choice * sample.pdf.unwrap_or(1.0);
        let drawn = Drawn { light, radiance: sample.radiance, density, is_shared };
        for found in &roots {
            score(walk, &departure, &drawn, found, sample.wi);
        }
        walk.rivals.found = roots;
    }

    fn meet_surface(&mut self) {
        self.departure = None;
    }

    fn densities<B: WalkBands>(
        walk: &mut CameraWalk<'_, Self, B>,
        exit: &WalkExit,
        light: usize,
        wi: DVec3,
    ) -> f64 {
        let Some(departure) = walk.rivals.departure else { return 0.0 };
        let setup = walk.rivals.setup;
        let share = setup.shares[walk.band][light];
        let pdf = walk.scene.lights[light].eval(walk.band, wi).1;
        if share == 0.0 || pdf == 0.0 {
            return 0.0;
        }
        let shape = &*walk.scene.shape;
        let query = Query { x: departure.point, w_l: wi, eta: walk.boundary.eta() };
        let mut work = SolverWork::default();
        let is_found = setup.solver.finds(shape, &query, exit.hit.point, &mut work);
        walk.scores.count_many(Cost::Rays, work.rays);
        match is_found {
            None => return f64::INFINITY,
            Some(false) => return 0.0,
            Some(true) => {}
        }
        let leg = exit.hit.point - departure.point;
        let distance = leg.length();
        let patch = SurfacePatch::at(shape, exit.hit.face, exit.hit.point, exit.hit.normal);
        let ratio = solid_angle_ratio(&patch, leg / distance, distance, wi, query.eta);
        let phase = walk.medium.phase.pdf(departure.arrival.dot(leg / distance));
        let walked = phase * transmittance(walk.medium.sigma_t, distance);
        share * pdf * ratio * departure.walks / walked
    }
}

/// Scores one root, where nothing hides it from x or from the light.
pub(super) fn score<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connected<'_>, B>,
    departure: &WalkVertex,
    drawn: &Drawn,
    found: &WeightedRoot,
    w_l: DVec3,
) {
    let WeightedRoot { root, weight } = *found;
    let Root { dir, distance, .. } = root;
    let mut bands = walk.bands.clone();
    bands.turn(&walk.scene.medium, departure.arrival.dot(dir));
    bands.flight(&walk.scene.medium, distance, false);
    let phase = walk.medium.phase.pdf(departure.arrival.dot(dir));
    let walked = phase * transmittance(walk.medium.sigma_t, distance);
    let own = if drawn.is_shared { bands.density() * root.transmittance * walked } else { 0.0 };
    let density = drawn.density * root.ratio * departure.walks + own;
    let eta = walk.boundary.eta();
    // A root at grazing light has T = 0 and an infinite J.
    let value = weight * root.transmittance * (eta * eta * drawn.radiance) * walked;
    if value == 0.0 || density == f64::INFINITY {
        return;
    }
    if !walk.sees_point(departure.point, root.point) || walk.is_shadowed(root.point, root.face, w_l) {
        return;
    }
    let score = walk.throughput * value / density;
    walk.score_with(&bands, walk.history.class(), drawn.light, score);
}
