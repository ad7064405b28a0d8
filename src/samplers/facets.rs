//! Microfacet normals, plain and visible, in charts of the slope plane.

use std::f64::consts::{FRAC_PI_2, PI};

use schemars::JsonSchema;
use serde::Deserialize;

use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Draw, Piece, Sampler};
use crate::math::{DVec3, atan, atan2, sin, sin_cos_turns, tan};
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::sampling::stream::Stream;

/// `facet_normals` in experiment files.
pub const NORMALS: SamplerKind = sampler_kind!(
    "facet_normals",
    "microfacet normals in proportion to their projected area",
    Microfacets => |facets| Ok(NormalSampler::plain(facets))
);

/// `visible_normals` in experiment files.
pub const VISIBLE_NORMALS: SamplerKind = sampler_kind!(
    "visible_normals",
    "microfacet normals as seen from a direction",
    VisibleOptions => |VisibleOptions { distribution: kind, alpha, cos }| {
        Ok(NormalSampler::visible(Microfacets { kind, alpha }, cos))
    }
);

/// Options of `visible_normals`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct VisibleOptions {
    /// Shape of the distribution.
    distribution: MicrofacetKind,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    alpha: f64,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    cos: f64,
}

/// A direction at this cosine to +z, at an azimuth that is aligned with nothing.
pub fn view(cos: f64) -> DVec3 {
    let sin = ((1.0 - cos) * (1.0 + cos)).sqrt();
    let (s, c) = sin_cos_turns(0.137);
    DVec3::new(sin * c, sin * s, cos)
}

/// Slopes of a normal h = (-X, -Y, 1) / sqrt(1 + X^2 + Y^2), X along a direction of view, so that a view
/// of cosine c and sine s has v.h = (c - X s) / sqrt(1 + X^2 + Y^2) and sees the half-plane X < c/s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Slopes {
    /// Unit tangent of the view, its projection onto the surface.
    along: DVec3,
    /// Unit vector perpendicular to it.
    across: DVec3,
    /// Cosine of the view.
    pub cos: f64,
    /// Sine of the view.
    pub sin: f64,
}

impl Slopes {
    /// For a unit view direction with v.z > 0.
    pub fn about(v: DVec3) -> Slopes {
        let sin = (v.x * v.x + v.y * v.y).sqrt();
        let along = if sin > 0.0 { DVec3::new(v.x / sin, v.y / sin, 0.0) } else { DVec3::X };
        Slopes { along, across: DVec3::Z.cross(along), cos: v.z, sin }
    }

    /// The slopes of a normal.
    pub fn of(&self, h: DVec3) -> [f64; 2] {
        [-h.dot(self.along) / h.z, -h.dot(self.across) / h.z]
    }

    /// The normal of slopes.
    pub fn normal(&self, [x, y]: [f64; 2]) -> DVec3 {
        (DVec3::Z - self.along * x - self.across * y).normalize()
    }

    /// Slope X of a facet in the plane of view, turned by `angle` from +z away from the view.
    pub fn turned(angle: f64) -> f64 {
        if angle >= FRAC_PI_2 {
            f64::INFINITY
        } else if angle <= -FRAC_PI_2 {
            f64::NEG_INFINITY
        } else {
            tan(angle)
        }
    }
}

/// A chart of the part of the slope plane over [from, to] in X and, at each X, over a range of
/// q = 1 + X^2 + Y^2, for a distribution of slopes of width `alpha`.
///
/// X = alpha tan(a), a = (a0 + a1)/2 - (a1 - a0)/2 cos(pi p): tan makes the tail of any distribution of
/// slopes finite, the cosine makes what goes as a square root to an end (the rim of a disc) smooth.
/// Y = alpha sqrt(1 + X^2/alpha^2) tan(b), b from b0 to b1 by the same cosine in p': GGX has exactly the
/// width sqrt(alpha^2 + X^2) in Y. With dX = alpha (1 + tan^2 a) da and so on,
///   d omega_h = h.z^3 dX dY,   h.z^-2 = 1 + X^2 + Y^2,
/// because the plane z = 1 is seen at distance 1/h.z under the cosine h.z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlopeChart {
    /// The slopes that it is a chart of.
    pub slopes: Slopes,
    alpha: f64,
    a: [f64; 2],
}

impl SlopeChart {
    /// X from `x[0]` to `x[1]` (either may be infinite).
    pub fn new(slopes: Slopes, alpha: f64, x: [f64; 2]) -> SlopeChart {
        SlopeChart { slopes, alpha, a: x.map(|x| atan(x / alpha)) }
    }

    /// The coordinate of X.
    pub fn along(&self, x: f64) -> f64 {
        unbend(self.a, atan(x / self.alpha))
    }

    /// X at a coordinate.
    pub fn x(&self, p: f64) -> f64 {
        self.alpha * tan(bend(self.a, p).0)
    }

    /// The range of b of a range of |Y|.
    fn across(&self, x: f64, y: [f64; 2]) -> [f64; 2] {
        let width = self.width(x);
        y.map(|y| atan(y / width))
    }

    /// Both coordinates of slopes, given the range of Y at this X.
    pub fn coordinates(&self, [x, y]: [f64; 2], range: [f64; 2]) -> [f64; 2] {
        [self.along(x), unbend(self.across(x, range), atan(y / self.width(x)))]
    }

    /// The slopes at coordinates, and d omega_h per unit of the chart, given the range of Y by X.
    pub fn at(&self, [p, q]: [f64; 2], range: impl Fn(f64) -> [f64; 2]) -> ([f64; 2], f64) {
        let (a, da) = bend(self.a, p);
        let tan_a = tan(a);
        let x = self.alpha * tan_a;
        let dx = self.alpha * (1.0 + tan_a * tan_a) * da;
        let (b, db) = bend(self.across(x, range(x)), q);
        let tan_b = tan(b);
        let width = self.width(x);
        let (y, dy) = (width * tan_b, width * (1.0 + tan_b * tan_b) * db);
        let q = 1.0 + x * x + y * y;
        ([x, y], dx * dy / (q * q.sqrt()))
    }

    /// Slopes brought into [-1, 1].
    pub fn bounded(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let size = (self.alpha * self.alpha + x * x + y * y).sqrt();
        [x / size, y / size]
    }

    fn width(&self, x: f64) -> f64 {
        (self.alpha * self.alpha + x * x).sqrt()
    }
}

/// The angle at a coordinate in [0, 1] of a range, and its slope there.
fn bend([from, to]: [f64; 2], p: f64) -> (f64, f64) {
    let half = 0.5 * (to - from);
    let s = sin(0.5 * PI * p);
    // 1 - cos(pi p) = 2 sin^2(pi p / 2), exact near the lower end.
    (from + half * 2.0 * s * s, half * PI * sin(PI * p))
}

/// The coordinate of an angle. What rounding has put beyond an end is put back; what is farther out
/// stays outside [0, 1], where no sample may be.
fn unbend([from, to]: [f64; 2], angle: f64) -> f64 {
    let share = (angle - from) / (to - from);
    if !(-1e-9..=1.0 + 1e-9).contains(&share) {
        return share;
    }
    let share = share.clamp(0.0, 1.0);
    // sin^2(pi p / 2) = share.
    2.0 / PI * atan2(share.sqrt(), (1.0 - share).sqrt())
}

/// Normals of a distribution of microfacets, all of them or those seen from a direction.
pub struct NormalSampler {
    facets: Microfacets,
    /// The direction of view; the plain normals by default.
    view: Option<DVec3>,
    chart: SlopeChart,
}

/// The whole range of the slope Y.
pub const EVERYWHERE: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

impl NormalSampler {
    /// Sampler of the plain distribution of facet normals.
    pub fn plain(facets: Microfacets) -> NormalSampler {
        let chart = SlopeChart::new(Slopes::about(view(0.5)), facets.alpha, EVERYWHERE);
        NormalSampler { facets, view: None, chart }
    }

    /// The normals seen at a cosine.
    pub fn visible(facets: Microfacets, cos: f64) -> NormalSampler {
        let slopes = Slopes::about(view(cos));
        let chart = SlopeChart::new(slopes, facets.alpha, [f64::NEG_INFINITY, slopes.cos / slopes.sin]);
        NormalSampler { facets, view: Some(view(cos)), chart }
    }

    fn pdf(&self, h: DVec3) -> f64 {
        match self.view {
            Some(v) => self.facets.pdf_visible(v, h),
            None => self.facets.pdf_normal(h),
        }
    }
}

impl Sampler for NormalSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let h = match self.view {
            Some(v) => self.facets.sample_visible(v, stream.draw2()),
            None => self.facets.sample_normal(stream.draw2()),
        };
        let slopes = self.chart.slopes.of(h);
        let at = self.chart.coordinates(slopes, EVERYWHERE);
        let (_, solid_angle) = self.chart.at(at, |_| EVERYWHERE);
        Draw::Point { piece: 0, at, density: self.pdf(h) * solid_angle }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("normals", [Coordinate::over(0.0, 1.0), Coordinate::over(0.0, 1.0)])]
    }

    fn density(&self, _piece: usize, at: [f64; 2]) -> f64 {
        let (slopes, solid_angle) = self.chart.at(at, |_| EVERYWHERE);
        self.pdf(self.chart.slopes.normal(slopes)) * solid_angle
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let chart = self.chart;
        let slope = move |at: [f64; 2], axis: usize| {
            let (slopes, _) = chart.at(at, |_| EVERYWHERE);
            chart.bounded(slopes)[axis]
        };
        // Everything is even across the view; without a view the normals lean nowhere.
        let expected = self.view.is_none().then_some(0.0);
        vec![
            Contrast::of("slope along the view", expected, move |at| slope(at, 0)),
            Contrast::of("slope across the view", Some(0.0), move |at| slope(at, 1)),
        ]
    }
}
