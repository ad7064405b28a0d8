//! The actions of a walk at its medium vertices, and the density of the end of a path under the connection.
//!
//! x is a medium vertex of the walk, p the boundary point after it, w the direction from x to p, w_L
//! that from p to a light. The walk draws w with the density U = phase(w) e^(-sigma_t d) per solid angle
//! and is refracted with the probability T. The connection draws a light with probability P and w_L with
//! the light's density p_L (1 for parallel light), and finds all w that it refracts to, so per solid
//! angle of w it has P p_L J, J = |d w_L / d w|. Relative to U, as walks have it, that is P p_L J /
//! (phase e^(-sigma_t d)), and both techniques score
//!   throughput * T eta^2 L / (T + P p_L J / (phase e^(-sigma_t d))),
//! the walk only where it can, which excludes parallel light. A method whose probability of finding a root is
//! not known (`Solver::finds`) replaces the walk for its lights: hits of the walk on these lights score 0.
//!
//! At a rough boundary the connection also draws the slopes of the facet that refracts, from the distribution
//! of facets, with the density D(m) m_z^4 of slopes, and finds the w at which it does; J becomes the area of
//! slopes per solid angle of w. The walk finds the same by interface and by light sampling, with the
//! densities p_B and P' p_L of w_L at p, so that both score, for all lights,
//!   throughput * f |cos| L / (p_B + P' p_L + P p_L D m_z^4 J / (phase e^(-sigma_t d))).

use super::ConnectionSetup;
use super::method::{ConnectionMethod, WeightedRoot};
use super::throughput::Root;
use crate::estimators::bands::WalkBands;
use crate::estimators::choice::choose_light;
use crate::estimators::vertices::WalkVertex;
use crate::estimators::walk::CameraWalk;
use crate::estimators::{History, TransportClass};
use crate::math::{DVec2, DVec3, Frame};
use crate::optics::boundary::Boundary;
use crate::optics::microfacet::Microfacets;
use crate::sampling::distance::transmittance;
use crate::sampling::stream::Stream;

/// State that a walk carries.
pub(super) struct Connected<'a> {
    pub setup: &'a ConnectionSetup,
    pub stream: Stream,
    /// The vertex that the walk came from, if it has not met the boundary since.
    pub departure: Option<WalkVertex>,
    /// Memory for roots.
    pub found: Vec<WeightedRoot>,
}

/// A light as it is drawn.
#[derive(Clone, Copy, Debug)]
pub(super) struct Drawn {
    /// Index of the light.
    pub light: usize,
    /// Radiance, or irradiance of parallel light.
    pub radiance: f64,
    /// Probability of the light times the density of the direction (of parallel light the probability
    /// alone), times that of the slopes at a rough boundary.
    pub density: f64,
    /// Whether the walk may find it, too.
    pub is_shared: bool,
}

/// Slopes of a facet of a rough boundary, and their density; none at a smooth one.
pub(super) fn draw_slopes(boundary: &Boundary, stream: &mut Stream) -> (DVec2, f64) {
    match boundary {
        Boundary::Rough { facets, .. } => {
            let m = facets.sample_normal(stream.draw2());
            (DVec2::new(m.x, m.y) / m.z, density_of_slopes(facets, m))
        }
        _ => (DVec2::ZERO, 1.0),
    }
}

/// Of facets with the unit normal m, per area of slopes: D m_z per solid angle of m, which is m_z^3 times that area.
pub(super) fn density_of_slopes(facets: &Microfacets, m: DVec3) -> f64 {
    facets.pdf_normal(m) * (m.z * m.z * m.z)
}

/// Where light that is connected to is scattered.
#[derive(Clone, Debug)]
pub(super) struct Departure<B> {
    pub vertex: WalkVertex,
    /// What the bands have made of the path up to the vertex.
    pub bands: B,
    pub history: History,
}

impl<'a> Connected<'a> {
    pub(super) fn new(setup: &'a ConnectionSetup, stream: Stream) -> Connected<'a> {
        Connected { setup, stream, departure: None, found: Vec::new() }
    }

    /// Whether the path's one medium vertex is the segments' to draw.
    pub(super) fn is_left_to_segments(&self, history: History) -> bool {
        let is_single =
            matches!(history.class(), TransportClass::Single | TransportClass::SingleInternal);
        is_single && self.setup.solver.method() == (ConnectionMethod::Segments {})
    }
}

/// Draws a light that is connected to, and a direction to it.
pub(super) fn draw_light<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connected<'_>, B>,
) -> Option<(Drawn, DVec3)> {
    let Connected { setup, stream, .. } = &mut walk.rivals;
    let (light, choice) = choose_light(&setup.shares[walk.band], stream.draw())?;
    let sample = walk.scene.lights[light].sample(walk.band, stream.draw2());
    let is_found_by_walk = sample.pdf.is_some() || !walk.boundary.is_delta();
    let is_shared = is_found_by_walk && setup.is_density_known;
    let density = choice * sample.pdf.unwrap_or(1.0);
    Some((Drawn { light, radiance: sample.radiance, density, is_shared }, sample.wi))
}

/// Scores one root, where nothing hides it from x or from the light.
pub(super) fn score<B: WalkBands>(
    walk: &mut CameraWalk<'_, Connected<'_>, B>,
    departure: &Departure<B>,
    drawn: &Drawn,
    found: &WeightedRoot,
    w_l: DVec3,
) {
    let WeightedRoot { root, weight } = *found;
    let Root { dir, distance, .. } = root;
    let Departure { vertex, mut bands, history } = departure.clone();
    bands.turn(&walk.scene.medium, vertex.point, vertex.arrival, dir);
    bands.flight(&walk.scene.medium, distance, false);
    let phase = walk.medium.phase.pdf(vertex.arrival.dot(dir));
    let walked = phase * transmittance(walk.medium.sigma_t, distance);
    let (of_surface, of_walk) = surface(walk, drawn, &root, w_l);
    let own = if drawn.is_shared { bands.density() * of_walk * walked } else { 0.0 };
    let density = drawn.density * root.ratio * vertex.walks + own;
    // A root at grazing light has T = 0 and an infinite J.
    let value = weight * of_surface * drawn.radiance * walked;
    if value == 0.0 || density == f64::INFINITY {
        return;
    }
    if !walk.sees_point(vertex.point, root.point) || walk.is_shadowed(root.point, root.face, w_l) {
        return;
    }
    let score = walk.throughput * value / density;
    walk.score_with(&bands, history.class(), drawn.light, score);
}

/// What the boundary makes of radiance at a root, without a Dirac factor, and the density with which the walk itself
/// would go on towards the light there, or refract at a smooth boundary.
fn surface<B: WalkBands>(
    walk: &CameraWalk<'_, Connected<'_>, B>,
    drawn: &Drawn,
    root: &Root,
    w_l: DVec3,
) -> (f64, f64) {
    if walk.boundary.is_delta() {
        let eta = walk.boundary.eta();
        return (root.transmittance * (eta * eta), root.transmittance);
    }
    let frame = Frame::about(root.shading);
    let (value, by_interface) = walk.boundary.eval(frame.to_local(-root.dir), frame.to_local(w_l));
    let light = &walk.scene.lights[drawn.light];
    let choice = walk.choice(drawn.light);
    let by_walk = if light.is_directional() {
        choice
    } else {
        by_interface + choice * light.eval(walk.band, w_l).1
    };
    (value, by_walk)
}
