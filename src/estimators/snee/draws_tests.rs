//! A technique samples the density that it states.
//!
//! A draw is a function of its uniform numbers. Where it is smooth, its density is the inverse Jacobian
//! determinant by these numbers, summed over the numbers that give the same result, times the
//! probability of the choices before it, which are intervals of one number each. All of that is measured
//! here on the draw itself, by differences and bisection, and compared with the stated density. Lobes are
//! tested one at a time; mixtures of them are linear.

use super::end::{End, Middle};
use super::last_vertex;
use super::state::Slot;
use super::subdivision;
use super::testing::*;
use super::*;
use crate::estimators::Layout;
use crate::estimators::vertices::WalkExit;
use crate::estimators::vertices::WalkVertex;
use crate::math::{DVec3, Frame};
use crate::sampling::distance::transmittance;
use crate::sampling::stream::{Stream, StreamKey};
use crate::sampling::warp::square_to_cap;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Technique {
    TopToBottom,
    BottomToTop,
    GuidedVertex,
}
use Technique::{BottomToTop, GuidedVertex, TopToBottom};

/// What a technique has drawn.
#[derive(Clone, Copy)]
struct Drawn {
    light: usize,
    /// None of the last vertex, which starts there.
    x_j: Option<DVec3>,
    exit: WalkExit,
    w_l: DVec3,
    radiance: Option<f64>,
}

type Walk<'a> = CameraWalk<'a, Connections<'a>, OneBand>;

/// One technique at one vertex of one body, as a function of its numbers.
struct Draw<'a> {
    snee: &'a Snee,
    technique: Technique,
    at: WalkVertex,
}

impl Draw<'_> {
    /// With a walk that stands at the vertex.
    fn with<T>(&self, numbers: &[f64], go: impl FnOnce(&mut Walk<'_>) -> T) -> T {
        let key = StreamKey::named("draws").pass(0);
        let mut scores = Scores::new(Layout::new(&self.snee.walks.field().scene));
        let on = Path { field: self.snee.walks.field(), band: 0, index: 0, key: &key };
        let connections = Connections::new(&self.snee.setups[0], Stream::scripted(numbers));
        let mut walk = CameraWalk::led(on, &mut scores, connections, OneBand, self.at.point);
        walk.ray.dir = self.at.arrival;
        walk.rivals.arrive(self.at);
        go(&mut walk)
    }

    fn of(&self, numbers: &[f64]) -> Option<Drawn> {
        self.with(numbers, |walk| {
            if self.technique == GuidedVertex {
                let options = walk.rivals.setup.options.last_vertex.expect("takes part");
                let found = last_vertex::draw(walk, &options)?;
                let last_vertex::GuidedEnd { guide, exit, w_l, radiance, .. } = found;
                return Some(Drawn { light: guide.light, x_j: None, exit, w_l, radiance });
            }
            let edge = subdivision::draw_edge(walk)?;
            let found = match self.technique {
                TopToBottom => subdivision::top_to_bottom(walk, &edge)?,
                _ => subdivision::bottom_to_top(walk, &edge)?,
            };
            let subdivision::Subdivided { guide, x_j, exit, w_l, radiance, .. } = found;
            Some(Drawn { light: guide.light, x_j: Some(x_j), exit, w_l, radiance })
        })
    }

    /// The stated density: per volume of x_j (but of the last vertex), area of x_k, solid angle of w_L,
    /// without Dirac factors.
    fn stated(&self, drawn: &Drawn) -> f64 {
        let Drawn { light, x_j, exit, w_l, radiance } = *drawn;
        self.with(&[], |walk| {
            let guides = &walk.rivals.setup.guides;
            let guide = guides.iter().find(|guide| guide.light == light).expect("a guide");
            let end = End::new(walk, guide, &exit, w_l, [1.0; 2], radiance);
            let medium = walk.medium;
            let step = |mu: f64, length: f64| {
                medium.phase.pdf(mu) * transmittance(medium.sigma_t, length) / (length * length)
            };
            let Some(x_j) = x_j else {
                let from = Middle::new(self.at.point - self.at.arrival, self.at.point, &exit.hit);
                let Middle { to_k, cos_k, .. } = from.expect("x_k is met from inside");
                let walks = step(self.at.arrival.dot(to_k.dir), to_k.length) * cos_k;
                return walks * last_vertex::density(walk, Slot::Latest, &to_k, &end);
            };
            let middle = Middle::new(self.at.point, x_j, &exit.hit).expect("x_k is met from inside");
            let Middle { to_j, to_k, cos_k } = middle;
            let walks = step(self.at.arrival.dot(to_j.dir), to_j.length)
                * medium.sigma_t
                * step(to_j.dir.dot(to_k.dir), to_k.length)
                * cos_k;
            walks * subdivision::density(walk, Slot::Latest, &middle, &exit, &end)
        })
    }

    /// Coordinates of a draw near another one, in which densities are taken: x_k, and what is free of
    /// x_j and w_L.
    fn coordinates(&self, drawn: &Drawn, about: &Drawn, freedom: Freedom) -> Vec<f64> {
        let on_plane = |n: DVec3, v: DVec3| {
            let frame = Frame::about(n);
            [v.dot(frame.s), v.dot(frame.t)]
        };
        let hit = about.exit.hit;
        let mut all = on_plane(hit.normal, drawn.exit.hit.point - hit.point).to_vec();
        if let (Some(x_j), Some(first)) = (drawn.x_j, about.x_j) {
            match freedom {
                Freedom::Distance => all.push((x_j - drawn.exit.hit.point).length()),
                _ => all.extend((x_j - first).to_array()),
            }
        }
        if freedom == Freedom::Light {
            all.extend(on_plane(about.w_l, drawn.w_l - about.w_l));
        }
        all
    }

    /// 1 over the Jacobian determinant by the numbers at these places: central differences of two
    /// widths, extrapolated.
    fn inverse_jacobian(&self, numbers: &[f64], free: &[usize], freedom: Freedom) -> Option<f64> {
        let about = self.of(numbers)?;
        let mut columns = Vec::new();
        for &place in free {
            let difference = |h: f64| -> Option<Vec<f64>> {
                let at = |x: f64| {
                    let mut moved = numbers.to_vec();
                    moved[place] = x;
                    let drawn = self.of(&moved)?;
                    Some(self.coordinates(&drawn, &about, freedom))
                };
                let (above, below) = (at(numbers[place] + h)?, at(numbers[place] - h)?);
                Some(above.iter().zip(&below).map(|(a, b)| (a - b) / (2.0 * h)).collect())
            };
            let (wide, narrow) = (difference(2e-5)?, difference(1e-5)?);
            columns.push(wide.iter().zip(&narrow).map(|(w, n)| (4.0 * n - w) / 3.0).collect());
        }
        Some(1.0 / determinant(columns).abs())
    }
}

/// What of a draw is free once x_k is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Freedom {
    /// x_j and w_L.
    Light,
    /// x_j; w_L is fixed or follows.
    Vertex,
    /// The distance of x_j from x_k, on a line.
    Distance,
}

fn determinant(mut m: Vec<Vec<f64>>) -> f64 {
    let n = m.len();
    let mut product = 1.0;
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| m[a][k].abs().total_cmp(&m[b][k].abs())).expect("rows");
        m.swap(k, pivot);
        product *= m[k][k];
        for i in k + 1..n {
            let factor = m[i][k] / m[k][k];
            let (above, below) = m.split_at_mut(i);
            for (entry, pivot) in below[0][k..].iter_mut().zip(&above[k][k..]) {
                *entry -= factor * pivot;
            }
        }
    }
    product
}

/// Where a predicate that holds at `inner` and not at `outer` changes.
fn border(mut inner: f64, mut outer: f64, holds: impl Fn(f64) -> bool) -> f64 {
    if holds(outer) {
        return outer;
    }
    for _ in 0..60 {
        let middle = 0.5 * (inner + outer);
        *(if holds(middle) { &mut inner } else { &mut outer }) = middle;
    }
    inner
}

/// Sky, disc and sun, all of them guides.
const LAMPS: [Lamp; 3] = [Lamp::WideDisc, Lamp::Sky, Lamp::Sun];

/// Numbers of a technique by place: its call, its guide, what is continuous, and the number of the
/// distance from the light's end, half of which is exponential and half equiangular.
struct Places {
    guide: usize,
    call: usize,
    free: Vec<usize>,
    mixed: Option<usize>,
    count: usize,
    freedom: Freedom,
}

fn places(technique: Technique, boundary: Boundary, is_parallel: bool) -> Places {
    let is_rough = matches!(boundary, Boundary::Rough { .. });
    let freedom = match (is_rough, is_parallel) {
        (true, false) => Freedom::Light,
        (false, true) => Freedom::Distance,
        _ => Freedom::Vertex,
    };
    let places = |guide, call, free: &[usize], mixed, count| Places {
        guide,
        call,
        free: free.to_vec(),
        mixed,
        count,
        freedom,
    };
    // Guide, call, probe 2, light 2, facet 2, distance; ... probe 2, direction 2, distance, facet 2.
    match (technique, is_rough, is_parallel) {
        (TopToBottom, true, false) => places(0, 1, &[2, 3, 4, 5, 6, 7, 8], Some(8), 9),
        (TopToBottom, true, true) => places(0, 1, &[2, 3, 6, 7, 8], Some(8), 9),
        (TopToBottom, false, false) => places(0, 1, &[2, 3, 4, 5, 8], Some(8), 9),
        (TopToBottom, false, true) => places(0, 1, &[2, 3, 8], Some(8), 9),
        (BottomToTop, true, _) => places(0, 1, &[2, 3, 4, 5, 6, 7, 8], None, 9),
        (BottomToTop, false, _) => places(0, 1, &[2, 3, 4, 5, 6], None, 9),
        // Call, guide, light 2 (at a rough boundary), lobe 2.
        (GuidedVertex, true, false) => places(1, 0, &[2, 3, 4, 5], None, 6),
        (GuidedVertex, true, true) => places(1, 0, &[4, 5], None, 6),
        (GuidedVertex, false, _) => places(1, 0, &[2, 3], None, 4),
    }
}

fn options(technique: Technique, probe: ProbeShares, truncated: bool, wide_share: f64) -> SneeOptions {
    SneeOptions {
        strategies: Strategies {
            bsdf: true,
            light: true,
            top_to_bottom: technique == TopToBottom,
            bottom_to_top: technique == BottomToTop,
        },
        call: Call { most: 0.9, decay: 0.2 },
        call_alone: Call { most: 0.8, decay: 0.1 },
        truncated,
        probe,
        last_vertex: (technique == GuidedVertex).then_some(LastVertex {
            most: 0.7,
            decay: 0.1,
            wide_share,
            wide: 0.3,
        }),
        least_concentration: 1.0,
        ..SneePreset::Paper.options()
    }
}

const UNIFORM: ProbeShares = ProbeShares { uniform: 1.0, plane: 0.0, guided: 0.0 };
const PLANE: ProbeShares = ProbeShares { uniform: 0.0, plane: 1.0, guided: 0.0 };
const GUIDED: ProbeShares = ProbeShares { uniform: 0.0, plane: 0.0, guided: 1.0 };

/// Every technique, light, boundary and lobe; distances that end at the boundary and that do not.
#[test]
fn densities_are_those_of_the_draws() {
    let mut stream =
        StreamKey::named("densities_are_those_of_the_draws").pass(0).stream(0, Purpose::Sensor);
    let mut lobes = Vec::new();
    for technique in [TopToBottom, BottomToTop] {
        for truncated in [false, true] {
            lobes.extend([UNIFORM, PLANE, GUIDED].map(|probe| (technique, probe, truncated, 0.0)));
        }
    }
    lobes.extend([0.0, 1.0].map(|wide_share| (GuidedVertex, UNIFORM, false, wide_share)));
    let mut done = 0;
    for boundary in [ROUGH, SMOOTH] {
        let scene = body(&sphere(), boundary, &[medium(3.0, 0.9, 0.3)], &LAMPS);
        for &(technique, probe, truncated, wide_share) in &lobes {
            let options = options(technique, probe, truncated, wide_share);
            let snee = Snee::new(scene.clone(), options).expect("a scene for it");
            for (light, lamp) in LAMPS.iter().enumerate() {
                let is_parallel = *lamp == Lamp::Sun;
                let is_rough = boundary == ROUGH;
                if is_parallel && (technique == BottomToTop || technique == GuidedVertex && !is_rough) {
                    continue; // it has no such paths
                }
                let places = places(technique, boundary, is_parallel);
                for _ in 0..2 {
                    let (measured, stated) = loop {
                        let at = WalkVertex {
                            point: square_to_cap(2.0, stream.draw2()) * (0.5 + 0.4 * stream.draw()),
                            arrival: square_to_cap(2.0, stream.draw2()),
                            walks: 1.0,
                        };
                        let draw = Draw { snee: &snee, technique, at };
                        let numbers: Vec<f64> =
                            (0..places.count).map(|_| 0.02 + 0.96 * stream.draw()).collect();
                        if let Some(both) = measure(&draw, &places, &numbers, light) {
                            break both;
                        }
                    };
                    assert!(
                        (measured / stated - 1.0).abs() < 1e-6,
                        "{technique:?}, {boundary:?}, {lamp:?}, {probe:?}, truncated {truncated}, \
                         wide {wide_share}: draws with density {measured}, states {stated}, ratio {}",
                        measured / stated
                    );
                    done += 1;
                }
            }
        }
    }
    assert_eq!(done, 2 * (2 * 14 * 2 + 8 + 6), "techniques with two finite lights, and with the sun");
}

/// The density of a draw as measured and as stated; `None` where the numbers draw nothing, or another
/// light.
fn measure(draw: &Draw<'_>, places: &Places, numbers: &[f64], light: usize) -> Option<(f64, f64)> {
    let drawn = draw.of(numbers).filter(|drawn| drawn.light == light)?;
    let emitter = &draw.snee.walks.field().scene.lights[light];
    if !emitter.is_directional() && emitter.eval(0, drawn.w_l).1 == 0.0 {
        return None; // refracted past the light
    }
    let with = |place: usize, x: f64| {
        let mut moved = numbers.to_vec();
        moved[place] = x;
        draw.of(&moved)
    };
    let is_called = |u| with(places.call, u).is_some();
    let call = border(numbers[places.call], 1.0 - f64::EPSILON, is_called);
    let is_chosen = |u| with(places.guide, u).is_some_and(|drawn| drawn.light == light);
    let ends = [0.0, 1.0 - f64::EPSILON].map(|end| border(numbers[places.guide], end, is_chosen));
    let choice = ends[1] - ends[0];
    let mut sum = draw.inverse_jacobian(numbers, &places.free, places.freedom)?;
    if let Some(place) = places.mixed {
        let length = |drawn: &Drawn| (drawn.x_j.expect("subdivided") - drawn.exit.hit.point).length();
        // The other half of the number that gives the same distance, if it reaches so far.
        let half = if numbers[place] < 0.5 { [0.5, 1.0] } else { [0.0, 0.5] };
        let is_shorter = |u| with(place, u).is_some_and(|other| length(&other) < length(&drawn));
        let twin = border(half[0], half[1] - f64::EPSILON, is_shorter);
        let mut moved = numbers.to_vec();
        moved[place] = twin;
        sum += draw.inverse_jacobian(&moved, &places.free, places.freedom)?;
    }
    if places.freedom == Freedom::Distance {
        // A delta in w_kj, written in w_L; and the distance, per volume.
        let eta = draw.snee.walks.field().scene.boundary[0].eta();
        let cos = drawn.exit.frame.to_local(drawn.w_l).z;
        let length = (drawn.x_j.expect("subdivided") - drawn.exit.hit.point).length();
        sum *= eta * eta * (drawn.exit.wo.z / cos).abs() / (length * length);
    }
    Some((call * choice * sum, draw.stated(&drawn)))
}

/// A mixture of lobes states the mixture of their densities.
#[test]
fn mixtures_are_linear() {
    let key = StreamKey::named("mixtures_are_linear");
    let mut stream = key.pass(0).stream(0, Purpose::Sensor);
    let scene = body(&sphere(), ROUGH, &[medium(3.0, 0.9, 0.3)], &LAMPS);
    let snee = |technique, probe, wide_share| {
        let options = options(technique, probe, false, wide_share);
        Snee::new(scene.clone(), options).expect("a scene for it")
    };
    for technique in [TopToBottom, BottomToTop] {
        let shares = ProbeShares { uniform: 0.2, plane: 0.5, guided: 0.3 };
        let mixed = snee(technique, shares, 0.0);
        let lobes = [UNIFORM, PLANE, GUIDED].map(|probe| snee(technique, probe, 0.0));
        linear(&mixed, &lobes, &[0.2, 0.5, 0.3], technique, &mut stream);
    }
    let lobes = [snee(GuidedVertex, UNIFORM, 0.0), snee(GuidedVertex, UNIFORM, 1.0)];
    linear(&snee(GuidedVertex, UNIFORM, 0.25), &lobes, &[0.75, 0.25], GuidedVertex, &mut stream);
}

fn linear(mixed: &Snee, lobes: &[Snee], shares: &[f64], technique: Technique, stream: &mut Stream) {
    let mut done = 0;
    while done < 20 {
        let Some(path) = FixedPath::draw(&mixed.walks.field().scene, 1, stream, false) else { continue };
        let (from, point) =
            if technique == GuidedVertex { (path.x_i, path.x_j) } else { (path.start, path.x_i) };
        let at = WalkVertex { point, arrival: (point - from).normalize(), walks: 1.0 };
        let x_j = (technique != GuidedVertex).then_some(path.x_j);
        let drawn = Drawn { light: 1, x_j, exit: path.exit, w_l: path.w_l, radiance: None };
        let stated = |snee: &Snee| Draw { snee, technique, at }.stated(&drawn);
        let sum: f64 = lobes.iter().zip(shares).map(|(lobe, share)| share * stated(lobe)).sum();
        assert!((stated(mixed) - sum).abs() <= 1e-12 * sum, "{technique:?}: {} {sum}", stated(mixed));
        done += u32::from(sum > 0.0);
    }
}
