//! The actions of a walk with connections at its vertices and exits; the head of `vertex` states the densities.

use super::facet::SolverWork;
use super::method::ConnectionMethod;
use super::patch::SurfacePatch;
use super::segments;
use super::throughput::Query;
use super::vertex::{Connected, Departure, density_of_slopes, draw_light, draw_slopes, score};
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::{WalkExit, WalkVertex};
use crate::estimators::walk::{CameraWalk, Rivals};
use crate::estimators::{Anomaly, Cost};
use crate::geometry::Ray;
use crate::math::DVec3;
use crate::optics::boundary::Boundary;
use crate::sampling::distance::transmittance;

impl Rivals for Connected<'_> {
    fn call<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        let Ray { origin: point, dir: arrival } = walk.ray;
        let vertex = WalkVertex { point, arrival, walks: walk.bands.density() };
        walk.rivals.departure = Some(vertex);
        if walk.rivals.is_left_to_segments(walk.history) {
            return;
        }
        let Some((mut drawn, w_l)) = draw_light(walk) else { return };
        let Connected { setup, stream, found, .. } = &mut walk.rivals;
        let (slopes, density) = draw_slopes(&walk.boundary, stream);
        drawn.density *= density;
        let query = Query { slopes, ..Query::new(point, w_l, walk.boundary.eta()) };
        let mut work = SolverWork::default();
        let mut roots = std::mem::take(found);
        roots.clear();
        setup.solver.roots(&walk.scene.shape, &query, stream, &mut work, &mut roots);
        (0..work.wrong_side).for_each(|_| walk.scores.note(Anomaly::WrongSide));
        walk.scores.count_many(Cost::Rays, work.rays);
        let departure = Departure { vertex, bands: walk.bands.clone(), history: walk.history };
        for found in &roots {
            score(walk, &departure, &drawn, found, w_l);
        }
        walk.rivals.found = roots;
    }

    fn depart<B: WalkBands>(walk: &mut CameraWalk<'_, Self, B>) {
        walk.rivals.departure = None;
        if walk.rivals.setup.solver.method() == (ConnectionMethod::Segments {}) {
            segments::score(walk);
        }
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
        let (source, x, point) = (&walk.scene.lights[light], departure.point, exit.hit.point);
        let pdf = if source.is_directional() { 1.0 } else { source.eval(walk.band, wi).1 };
        if share == 0.0 || pdf == 0.0 {
            return 0.0;
        }
        if walk.rivals.is_left_to_segments(walk.history) {
            return f64::INFINITY;
        }
        let shape = &*walk.scene.shape;
        let eta = walk.boundary.eta();
        let (query, of_slopes) = match &walk.boundary {
            Boundary::Rough { facets, .. } => {
                let query = Query::through(x, wi, eta, point, exit.hit.shading_normal);
                let m = DVec3::new(query.slopes.x, query.slopes.y, 1.0).normalize();
                (query, density_of_slopes(facets, m))
            }
            _ => (Query::new(x, wi, eta), 1.0),
        };
        let mut work = SolverWork::default();
        let is_found = setup.solver.finds(shape, &query, (exit.hit.face, point), &mut work);
        walk.scores.count_many(Cost::Rays, work.rays);
        match is_found {
            None => return f64::INFINITY,
            Some(false) => return 0.0,
            Some(true) => {}
        }
        let patch = SurfacePatch::at(shape, exit.hit.face, point, exit.hit.normal);
        let leg = point - x;
        let distance = leg.length();
        let ratio = query.ratio(&patch, &query.constraint(&patch));
        let phase = walk.medium.phase.pdf(departure.arrival.dot(leg / distance));
        let walked = phase * transmittance(walk.medium.sigma_t, distance);
        share * pdf * of_slopes * ratio * departure.walks / walked
    }
}
