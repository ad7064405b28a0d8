//! Single scattering by segments of the camera ray: each triangle is tested on its own part of the ray.
//!
//! Along a flight x(t) = o + t d inside, before the first medium vertex, the light of direction w_L that a
//! triangle refracts onto the ray arrives on parts of it only (Holzschuch 2015, "Accurate computation of
//! single scattering in participating media with refractive boundaries"). In that paper the ends of a part are
//! found by Newton's method on the triangle's edges and the middle represents the whole part, which loses parts
//! and is biased. Here the hierarchy of `cones` divides the ray, conservatively, into parts (triangle, [t_0,
//! t_1]) that contain every root. Each part is sampled at one point of density e^(-sigma_t t), truncated,
//!   p(t) = sigma_t e^(-sigma_t (t - t_0)) / (1 - e^(-sigma_t (t_1 - t_0))),
//! where all roots of the triangle are solved for. No root is lost, and the method is unbiased however wide
//! the parts are. All other shapes are one part.
//!
//! Far parts are searched by roulette, up to a random horizon h with P(h > t) = e^(-sigma_t t / 2); scores are
//! divided by this probability. A sample then scores with
//!   sigma_t e^(-sigma_t t) / (p(t) P(h > t)) = e^(sigma_t (t / 2 - t_0)) (1 - e^(-sigma_t (t_1 - t_0)))
//! instead of the distance t that the walk draws.
//!
//! Later vertices are connected by the complete solver. The density of a root of a segment is not known, so
//! that MIS is not possible: for paths of one medium vertex, only segments sample the lights that are connected
//! to.

use super::facet::{self, SolverWork};
use super::method::WeightedRoot;
use super::throughput::Query;
use super::vertex::{self, Connected, Departure, Drawn};
use crate::estimators::bands::WalkBands;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::CameraWalk;
use crate::estimators::{Anomaly, Cost, TransportClass};
use crate::geometry::Ray;
use crate::math::{exp, exp_m1};
use crate::sampling::distance::{sample_exponential, sample_truncated_exponential};

/// How fast the chance of a part falls with its depth, per mean free path.
const DECAY: f64 = 0.5;

/// Scores single scattering along the walk's next flight, if it has not been scattered before.
pub(super) fn score<B: WalkBands>(walk: &mut CameraWalk<'_, Connected<'_>, B>) {
    let sigma_t = walk.medium.sigma_t;
    if walk.history.class() != TransportClass::Surface || sigma_t == 0.0 {
        return;
    }
    let Some(reach) = walk.reach() else { return };
    let Some((drawn, w_l)) = vertex::draw_light(walk) else { return };
    let drawn = Drawn { is_shared: false, ..drawn };
    let horizon = sample_exponential(DECAY * sigma_t, walk.rivals.stream.draw());
    let range = [0.0, reach.min(horizon)];
    let Ray { origin, dir } = walk.ray;
    let query = Query::new(origin, w_l, walk.boundary.eta());
    let setup = walk.rivals.setup;
    let solver = setup.solver.conic();
    let mut work = SolverWork::default();
    let mut found = std::mem::take(&mut walk.rivals.found);
    let mut along = Vec::new();
    let sample = |walk: &mut CameraWalk<'_, Connected<'_>, B>, [from, to]: [f64; 2]| {
        let length = to - from;
        let t = from + sample_truncated_exponential(sigma_t, length, walk.rivals.stream.draw());
        let weight = exp(sigma_t * (DECAY * t - from)) * -exp_m1(-sigma_t * length);
        (Query { x: origin + dir * t, ..query }, t, weight)
    };
    match solver.tree().filter(|_| query.eta != 1.0) {
        Some(tree) => {
            let nodes = tree.visit_line(&query, dir, range, |facet, part| {
                let (query, t, weight) = sample(walk, part);
                found.clear();
                facet::roots(&query, facet, &mut work, &mut |root| {
                    found.push(WeightedRoot { root, weight });
                });
                along.extend(found.drain(..).map(|root| (t, root)));
            });
            work.nodes += nodes;
        }
        None => {
            let (query, t, weight) = sample(walk, range);
            solver.roots(&walk.scene.shape, &query, &mut work, &mut |root| {
                along.push((t, WeightedRoot { root, weight }));
            });
        }
    }
    walk.rivals.found = found;
    (0..work.wrong_side).for_each(|_| walk.scores.note(Anomaly::WrongSide));
    walk.scores.count_many(Cost::Rays, work.rays);
    let mut history = walk.history;
    history.scatter();
    for (t, root) in along {
        let mut bands = walk.bands.clone();
        bands.flight(&walk.scene.medium, t, true);
        let walks = bands.density();
        let vertex = WalkVertex { point: origin + dir * t, arrival: dir, walks };
        let weight = root.weight * bands.survival(&walk.medium);
        let departure = Departure { vertex, bands, history };
        vertex::score(walk, &departure, &drawn, &WeightedRoot { weight, ..root }, w_l);
    }
}

#[cfg(test)]
mod tests {
    use crate::estimators::connection::conic::Conic;
    use crate::estimators::connection::facet::SolverWork;
    use crate::estimators::connection::testing::{direction, entering, meshes, stream};
    use crate::estimators::connection::throughput::Query;

    /// On random chords: a root of any of their points is in exactly one part of its triangle.
    #[test]
    fn every_root_is_in_one_part() {
        let mut stream = stream("every_root_is_in_one_part");
        for eta in [1.4, 0.8] {
            for (name, shape) in meshes(3) {
                let conic = Conic::new(&shape);
                let tree = conic.tree().expect("a mesh");
                let (mut roots, mut parts_in_all, mut chords) = (0, 0, 0);
                while chords < 60 {
                    let Some((hit, toward, length)) =
                        entering(&shape, direction(&mut stream), 1.0, stream.draw2())
                    else {
                        continue;
                    };
                    chords += 1;
                    let (dir, w_l) = (-toward, direction(&mut stream));
                    let query = Query::new(hit.point, w_l, eta);
                    let mut parts = Vec::new();
                    tree.visit_line(&query, dir, [0.0, length], |facet, part| {
                        parts.push((facet.index, part));
                    });
                    parts_in_all += parts.len();
                    for _ in 0..40 {
                        let t = length * stream.draw();
                        let at = Query { x: hit.point + dir * t, ..query };
                        conic.roots(&shape, &at, &mut SolverWork::default(), &mut |root| {
                            let holds = |(face, [from, to]): &&(u32, [f64; 2])| {
                                *face == root.face.0 && (*from..*to).contains(&t)
                            };
                            assert_eq!(parts.iter().filter(holds).count(), 1, "{name} {at:?} {root:?}");
                            roots += 1;
                        });
                    }
                }
                println!("{name}, eta {eta}: {roots} roots, {} parts a chord", parts_in_all / chords);
                assert!(roots > 500, "{name}: {roots}");
            }
        }
    }
}
