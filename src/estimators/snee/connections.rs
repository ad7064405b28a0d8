//! What a walk carries for connections through the boundary, and the density of a path's end under all of them.
//!
//! The end of a path: x_i -> x_j -> x_k in the order of the walk, x_i and x_j in the medium, x_k on the
//! boundary, then w_L towards a light. Every density is taken per volume of x_j, area of x_k and solid angle
//! of w_L, and divided by
//!   U = phase(x_i) sigma_t T(d_ij) / d_ij^2 * phase(x_j) T(d_jk) cos_k / d_jk^2,
//! the density with which the walk itself draws x_j and x_k (the flight to the boundary has the probability T,
//! no sigma_t). Delta lobes and parallel light leave Dirac factors in w_L, of which only the
//! coefficients are kept: a technique takes part for a pair (lobe, light) exactly if its Dirac factors are the
//! pair's. Refraction by a smooth surface, drawn from the light's side, is a delta in w_kj; written in w_L it
//! gains J = dw_L / dw_kj = eta^2 |n.w_kj| / |n.w_L|.
//!
//!   lobe x light          BSDF   light   top to bottom   bottom to top   last vertex
//!   rough x finite        yes    yes     yes             yes             yes
//!   rough x parallel      -      yes     yes             -               yes
//!   smooth x finite       yes    -       yes             yes             yes
//!   smooth x parallel     -      -       yes             -               -
//!
//! Since value / density = f U / (U sum) for each technique, every sample scores
//!   throughput * albedo * f_k L / (p_B + p_L + sum of rivals / U),
//! whichever technique it comes from.

use schemars::JsonSchema;
use serde::Deserialize;

use super::guess::Guess;
use super::guide::Guide;
use super::{BandSetup, last_vertex, subdivision};
use crate::estimators::Cost;
use crate::estimators::bands::Bands;
use crate::estimators::walk::{Exit, Rivals, Walk};
use crate::geometry::{Hit, Ray, Side};
use crate::math::{DVec3, exp, ln};
use crate::optics::boundary::Boundary;
use crate::sampling::discrete::choose_share;
use crate::sampling::stream::Stream;

/// A medium vertex that connections start from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Vertex {
    pub point: DVec3,
    /// Direction of travel on arrival.
    pub arrival: DVec3,
    /// Density of the walk up to here under any hero, over that under its own.
    pub walks: f64,
    /// The specular guess for the last guide that was asked for.
    guess: Option<(usize, Option<Guess>)>,
}

impl Vertex {
    pub fn new(point: DVec3, arrival: DVec3, walks: f64) -> Vertex {
        Vertex { point, arrival, walks, guess: None }
    }

    /// The specular guess for a guide.
    pub fn guess<R, B>(&mut self, walk: &mut Walk<'_, R, B>, guide: &Guide) -> Option<Guess> {
        match self.guess {
            Some((light, guess)) if light == guide.light => guess,
            _ => {
                let guess = Guess::new(walk, self.point, guide.axis);
                self.guess = Some((guide.light, guess));
                guess
            }
        }
    }
}

/// With which probability a technique is called at a vertex: `most` e^(-decay sigma d), d being the distance to
/// the boundary along the specular guess. It depends on the vertex alone, so that every density can name it.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Call {
    /// Probability at the boundary.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub most: f64,
    /// How fast it falls per mean free path that light has to go.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub decay: f64,
}

impl Call {
    /// The probability, from the distance of the guess.
    pub(super) fn probability(&self, sigma: f64, guess: Option<&Guess>) -> f64 {
        match guess {
            _ if self.decay == 0.0 => self.most,
            Some(guess) => self.most * exp(-self.decay * sigma * guess.distance),
            None => 0.0,
        }
    }

    /// The distance up to which the call is made, for one uniform number; `None` if it is not made at all. P(reach
    /// > d) is [`Self::probability`], and a lower bound of d may decide before d is known.
    pub(super) fn reach(&self, sigma: f64, u: f64) -> Option<f64> {
        if u >= self.most {
            None
        } else if self.decay == 0.0 {
            Some(f64::INFINITY)
        } else {
            Some(-ln(u / self.most) / (self.decay * sigma))
        }
    }
}

/// What a walk carries.
pub(super) struct Connections<'a> {
    pub setup: &'a BandSetup,
    pub stream: Stream,
    /// The last two medium vertices, the latest last.
    pub vertices: [Vertex; 2],
    /// Medium vertices since the boundary was last met.
    pub count: u32,
    /// Only the first edge is subdivided, and only the second vertex is a last one.
    pub is_edge_alone: bool,
    /// Whether x_i saw the exit that was last asked for.
    seen: Option<(DVec3, bool)>,
}

impl<'a> Connections<'a> {
    pub fn new(setup: &'a BandSetup, stream: Stream) -> Connections<'a> {
        let nowhere = Vertex::new(DVec3::NAN, DVec3::Z, 1.0);
        Connections { setup, stream, vertices: [nowhere; 2], count: 0, is_edge_alone: false, seen: None }
    }

    /// A guide by its probability; without a draw where there is one alone.
    pub fn choose_guide(&mut self) -> Option<&'a Guide> {
        let guides = &self.setup.guides;
        match &guides[..] {
            [only] => Some(only),
            _ => {
                let shares = guides.iter().map(|guide| guide.choice);
                choose_share(shares, self.stream.draw()).map(|(index, _)| &guides[index])
            }
        }
    }

    /// Which of BSDF and light sampling take part at the end of a path with this many medium vertices since
    /// the boundary.
    pub fn takes_part(&self, count: u32) -> [f64; 2] {
        let strategies = &self.setup.options.strategies;
        let share = |takes_part: bool| if takes_part { 1.0 } else { 0.0 };
        if count >= 2 { [share(strategies.bsdf), share(strategies.light)] } else { [1.0, 1.0] }
    }
}

/// A direction from a boundary point to a light, as all techniques see it.
#[derive(Clone, Copy, Debug)]
pub(super) struct End {
    /// f |cos| times radiance (irradiance for parallel light).
    pub value: f64,
    /// Density by BSDF and light sampling.
    pub unidirectional: f64,
    /// Density of w_L given w_kj, refraction forced.
    pub forward: f64,
    /// Density of w_kj given w_L.
    pub reverse: f64,
    /// Density of w_L by the guide, its choice included; 0 where no guide takes part.
    pub guide: f64,
}

impl End {
    /// At an exit, towards `wi`, which lies outside; for a smooth boundary `wi` is the refracted direction. `keep`
    /// says which of BSDF and light sampling take part.
    pub fn new<R: Rivals, B: Bands>(
        walk: &Walk<'_, R, B>,
        guide: &Guide,
        exit: &Exit,
        wi: DVec3,
        keep: [f64; 2],
        radiance: Option<f64>,
    ) -> End {
        let light = &walk.scene.lights[guide.light];
        let local = exit.frame.to_local(wi);
        let parallel = light.is_directional();
        let (radiance, pdf_light) = match radiance {
            Some(radiance) if parallel => (radiance, 1.0),
            _ if parallel => (0.0, 1.0),
            _ => light.eval(walk.band, wi),
        };
        let of_guide = guide.density(light, walk.band, wi);
        let choice = walk.choice(guide.light);
        match walk.boundary {
            Boundary::Rough { .. } => {
                let (f_cos, pdf) = walk.boundary.eval(exit.wo, local);
                let reverse = walk.boundary.pdf_refraction(local, exit.wo);
                let (forward, bsdf) = if parallel {
                    (0.0, 0.0)
                } else {
                    (walk.boundary.pdf_refraction(exit.wo, local), pdf)
                };
                let unidirectional = keep[0] * bsdf + keep[1] * (choice * pdf_light);
                End { value: f_cos * radiance, unidirectional, forward, reverse, guide: of_guide }
            }
            Boundary::Smooth { eta } => {
                let through = walk.boundary.transmittance_smooth(exit.wo);
                let reverse = eta * eta * (exit.wo.z / local.z).abs();
                let (forward, bsdf) = if parallel { (0.0, 0.0) } else { (1.0, through) };
                End {
                    value: through * eta * eta * radiance,
                    unidirectional: keep[0] * bsdf,
                    forward,
                    reverse,
                    guide: of_guide,
                }
            }
            Boundary::Matched => {
                End { value: 0.0, unidirectional: 1.0, forward: 0.0, reverse: 0.0, guide: 0.0 }
            }
        }
    }
}

/// x_i -> x_j -> x_k, seen from x_j.
#[derive(Clone, Copy, Debug)]
pub(super) struct Middle {
    pub to_j: DVec3,
    pub d_ij: f64,
    pub to_k: DVec3,
    pub d_jk: f64,
    /// Cosine at x_k between the walk and the geometric normal.
    pub cos_k: f64,
}

impl Middle {
    /// `None` where points fall together or x_k is met from behind.
    pub fn new(x_i: DVec3, x_j: DVec3, x_k: DVec3, normal: DVec3) -> Option<Middle> {
        let (ij, jk) = (x_j - x_i, x_k - x_j);
        let (d_ij, d_jk) = (ij.length(), jk.length());
        let (to_j, to_k) = (ij / d_ij, jk / d_jk);
        let cos_k = to_k.dot(normal);
        (d_ij > 0.0 && d_jk > 0.0 && cos_k > 0.0).then_some(Middle { to_j, d_ij, to_k, d_jk, cos_k })
    }
}

impl Rivals for Connections<'_> {
    fn call<B: Bands>(walk: &mut Walk<'_, Self, B>) {
        let vertex = Vertex::new(walk.ray.origin, walk.ray.dir, walk.bands.density());
        let state = &mut walk.rivals;
        state.vertices = [state.vertices[1], vertex];
        state.count += 1;
        let setup = state.setup;
        let (is_first, is_free) = (state.count == 1, !state.is_edge_alone);
        if let Some(technique) = &setup.options.last_vertex
            && (is_free || !is_first)
        {
            last_vertex::call(walk, technique);
        }
        if setup.options.strategies.subdivides() && (is_free || is_first) {
            subdivision::call(walk);
        }
    }

    fn meet_surface(&mut self) {
        self.count = 0;
    }

    fn reflect<B: Bands>(walk: &mut Walk<'_, Self, B>, hit: &Hit, reflected: DVec3, reflectance: f64) {
        let setup = walk.rivals.setup;
        for guide in &setup.guides {
            if !Self::has_scored_reflection(walk, guide.light, reflected)
                || reflected.dot(hit.normal) <= 0.0
            {
                continue;
            }
            walk.scores.count(Cost::ShadowRays);
            let shadow = Ray { origin: hit.point, dir: reflected };
            if !walk.scene.shape.occluded(&shadow, Some(hit.face)) {
                let (radiance, _) = walk.scene.lights[guide.light].eval(walk.band, reflected);
                let value = walk.throughput * reflectance * radiance / walk.bands.density();
                let bands = walk.bands.clone();
                walk.score_with(&bands, walk.history.class(), guide.light, value);
            }
        }
    }

    fn has_scored_reflection<B: Bands>(walk: &Walk<'_, Self, B>, light: usize, wi: DVec3) -> bool {
        let setup = walk.rivals.setup;
        let guide = setup.guides.iter().find(|guide| guide.light == light);
        let light = &walk.scene.lights[light];
        setup.options.expected_reflection
            && !light.is_directional()
            && guide.is_some_and(|guide| guide.density(light, walk.band, wi) > 0.0)
    }

    fn unidirectional(&self) -> [f64; 2] {
        self.takes_part(self.count)
    }

    fn densities<B: Bands>(walk: &mut Walk<'_, Self, B>, exit: &Exit, light: usize, wi: DVec3) -> f64 {
        if walk.rivals.count == 0 {
            return 0.0;
        }
        let setup = walk.rivals.setup;
        let Some(guide) = setup.guides.iter().find(|guide| guide.light == light) else { return 0.0 };
        let end = End::new(walk, guide, exit, wi, walk.rivals.unidirectional(), None);
        if end.guide == 0.0 {
            return 0.0;
        }
        let [mut x_i, mut x_j] = walk.rivals.vertices;
        let to_k = -exit.frame.to_world(exit.wo);
        let d_jk = (exit.hit.point - x_j.point).length();
        let mut sum = last_vertex::density(walk, &mut x_j, guide, (to_k, d_jk), wi, &end);
        if walk.rivals.count >= 2 && setup.options.strategies.subdivides() && walk.sees(&x_i, exit) {
            let middle = Middle::new(x_i.point, x_j.point, exit.hit.point, exit.hit.normal);
            if let Some(middle) = middle {
                sum += subdivision::density(walk, &mut x_i, guide, &middle, exit, &end);
            }
        }
        walk.rivals.vertices = [x_i, x_j];
        sum
    }
}

/// Part of a leg's length within which two ways of meeting the same point of the boundary may differ.
const LEG: f64 = 1e-7;

impl<R: Rivals, B: Bands> Walk<'_, R, B> {
    /// Whether nothing lies between two points of the body; the second may be on the boundary.
    pub(super) fn sees_point(&mut self, from: DVec3, to: DVec3) -> bool {
        if self.scene.shape.is_convex() {
            return true;
        }
        let leg = to - from;
        let length = leg.length();
        self.scores.count(Cost::ShadowRays);
        let ray = Ray { origin: from, dir: leg / length };
        self.scene.shape.intersect(&ray, Side::Inside, None, length * (1.0 - LEG)).is_none()
    }
}

impl<B: Bands> Walk<'_, Connections<'_>, B> {
    /// Whether x_i sees an exit: a probe in its direction would have met it first.
    fn sees(&mut self, x_i: &Vertex, exit: &Exit) -> bool {
        match self.rivals.seen {
            Some((point, sees)) if point == exit.hit.point => sees,
            _ => {
                let sees = self.sees_point(x_i.point, exit.hit.point);
                self.rivals.seen = Some((exit.hit.point, sees));
                sees
            }
        }
    }
}
