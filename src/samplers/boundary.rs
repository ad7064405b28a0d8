//! The refractive surface as a whole: the rough dielectric in charts of its half vectors, the smooth one
//! by its masses and directions.

use schemars::JsonSchema;
use serde::Deserialize;

use super::facets::{SlopeChart, Slopes, view};
use super::kind::{SamplerKind, sampler_kind};
use super::sampler::{Contrast, Coordinate, Discrete, Draw, Null, Piece, Sampler};
use crate::error::{Error, Result};
use crate::math::{DVec3, acos, asin, atan2, integrate, sin, tan};
use crate::optics::boundary::{Boundary, BoundarySample, Event};
use crate::optics::fresnel::fresnel;
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::sampling::stream::Stream;

/// `rough_dielectric` in experiment files.
pub const ROUGH: SamplerKind = sampler_kind!(
    "rough_dielectric",
    "the rough dielectric as a whole: reflection, refraction, total reflection",
    RoughOptions => |o| o.sampler(RoughSampler::new)
);

/// `rough_refraction` in experiment files.
pub const ROUGH_REFRACTION: SamplerKind = sampler_kind!(
    "rough_refraction",
    "refraction through a rough dielectric, without a choice of lobe",
    RoughOptions => |o| o.sampler(RoughSampler::refraction)
);

/// `smooth_dielectric` in experiment files.
pub const SMOOTH: SamplerKind = sampler_kind!(
    "smooth_dielectric",
    "which lobe of the smooth dielectric, with exact directions",
    SmoothOptions => |o| Ok(SmoothSampler::smooth(o.eta, o.view.signed(o.cos)))
);

/// `matched_boundary` in experiment files.
pub const MATCHED: SamplerKind = sampler_kind!(
    "matched_boundary",
    "the boundary that is none: straight through",
    MatchedOptions => |o| Ok(SmoothSampler::matched(o.view.signed(o.cos)))
);

/// Options of `rough_dielectric` and `rough_refraction`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct RoughOptions {
    /// Shape of the distribution.
    distribution: MicrofacetKind,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    alpha: f64,
    /// Index inside over outside, not 1.
    #[schemars(range(min = 0.25, max = 4.0))]
    eta: f64,
    /// From where it is seen.
    view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    cos: f64,
}

impl RoughOptions {
    fn sampler(&self, new: fn(f64, Microfacets, f64) -> RoughSampler) -> Result<RoughSampler> {
        if self.eta == 1.0 {
            return Err(Error::input(
                "sampler options: eta = 1 is no rough dielectric; use matched_boundary",
            ));
        }
        let facets = Microfacets { kind: self.distribution, alpha: self.alpha };
        Ok(new(self.eta, facets, self.view.signed(self.cos)))
    }
}

/// Options of `smooth_dielectric`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct SmoothOptions {
    /// Index inside over outside.
    #[schemars(range(min = 0.25, max = 4.0))]
    eta: f64,
    /// From where it is seen.
    view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    cos: f64,
}

/// Options of `matched_boundary`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct MatchedOptions {
    /// From where it is seen.
    view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    cos: f64,
}

/// From where a boundary is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
enum ViewSide {
    /// From the vacuum.
    Outside,
    /// From the medium.
    Inside,
}

impl ViewSide {
    fn signed(self, cos: f64) -> f64 {
        if self == ViewSide::Outside { cos } else { -cos }
    }
}

/// Every direction to which a rough dielectric sends one `wo`.
///
/// For one `wo` (cosine c, sine s) reflection and refraction each map half vectors to directions one to
/// one, so each is charted by its half vector's slopes (X, Y); r is the index of the far side over that
/// of the side of `wo`. With A = c - X s, q = 1 + X^2 + Y^2, m = wo.h = A / sqrt(q), h.z = 1 / sqrt(q):
///   wi above the surface      2 m h.z > c                    q < q_r = 2 A / c          (a disc)
///   total reflection (r < 1)  m^2 < m_c^2 = 1 - r^2          q > q_c = A^2 / m_c^2      (a cone)
///   refracted wi below        m h.z - h.z sqrt(m^2 - m_c^2) < c, from wi = (m/r - cos_t) h - wo/r; for
///     r > 1 always; else squaring sqrt(A^2 - m_c^2 q) > A - c q gives, beside q < q_c,
///                             q < q_w = (2 A c - m_c^2) / c^2   where A c < m_c^2, else nothing more.
/// At each X the pieces are ranges of Y, and the density has neither jump nor kink inside them:
///   partial reflection  q < min(q_r, q_c);   refraction  q < q_c or q_w;
///   total reflection    between q_c and q_r: beside the cone at both sides of it in Y, and before and
///                       beyond it in X, where the cone is not met.
/// In the plane of view a facet turned by angle xi has m = cos(theta + xi): the ends in X are the
/// tangents of -(pi/4 + theta/2) and pi/4 - theta/2 for q_r, of -theta - gamma and -theta + gamma for
/// q_c (cos gamma = m_c), and (r - s) / c for q_w, the root of q_w = 1 + X^2.
///
/// Jacobians: about wo, h is at the polar angle g, wi at b(g) and the same azimuth, so that
/// d omega_i / d omega_h = |sin b b'| / sin g. Reflection: b = 2g, 4 cos g. Refraction: b = pi + g -
/// g_t, sin g_t = sin g / r: (cos g_t - cos g / r)^2 / cos g_t.
///
/// Forced refraction is the piece of refraction alone; it fails beyond the end of the piece, by a wrong side
/// or by total reflection, whatever the reflectance: where q > q_w or else q > q_c.
pub struct RoughSampler {
    boundary: Boundary,
    is_forced: bool,
    /// Towards the sensor; below the surface for light from inside.
    wo: DVec3,
    region: SlopeRegion,
    parts: Vec<SlopePiece>,
    null: f64,
}

/// The curves of the slope plane.
#[derive(Clone, Copy)]
struct SlopeRegion {
    slopes: Slopes,
    /// Relative refractive index r.
    relative: f64,
    /// m_c^2; 0 where nothing is reflected totally.
    critical2: f64,
}

/// One piece of the chart of slopes.
#[derive(Clone, Copy)]
struct SlopePiece {
    name: &'static str,
    event: Event,
    chart: SlopeChart,
    reach: Reach,
    /// X where its range of Y has a kink.
    kink: f64,
}

/// Which Y belong to a piece.
#[derive(Clone, Copy, PartialEq)]
enum Reach {
    Refraction,
    PartialReflection,
    /// The whole disc at this X, before the cone begins in X.
    TotalBefore,
    /// The whole disc at this X, beyond the end of the cone in X.
    TotalBeyond,
    /// The disc without the cone, at the side of Y with this sign.
    TotalBeside(f64),
}

impl SlopeRegion {
    fn along(&self, x: f64) -> f64 {
        self.slopes.cos - x * self.slopes.sin
    }

    fn q_reflected(&self, x: f64) -> f64 {
        2.0 * self.along(x) / self.slopes.cos
    }

    fn q_critical(&self, x: f64) -> f64 {
        if self.critical2 > 0.0 { self.along(x) * self.along(x) / self.critical2 } else { f64::INFINITY }
    }

    /// Where refraction below the surface ends before total reflection begins.
    fn q_wrong_side(&self, x: f64) -> Option<f64> {
        let product = self.along(x) * self.slopes.cos;
        (product < self.critical2)
            .then(|| (2.0 * product - self.critical2) / (self.slopes.cos * self.slopes.cos))
    }

    fn range(&self, reach: Reach, x: f64) -> [f64; 2] {
        let y = |q: f64| (q - 1.0 - x * x).max(0.0).sqrt();
        let (reflected, critical) = (self.q_reflected(x), self.q_critical(x));
        match reach {
            Reach::Refraction => {
                let top = y(self.q_wrong_side(x).unwrap_or(critical));
                [-top, top]
            }
            Reach::PartialReflection => [-y(reflected.min(critical)), y(reflected.min(critical))],
            Reach::TotalBefore | Reach::TotalBeyond => [-y(reflected), y(reflected)],
            Reach::TotalBeside(sign) if sign > 0.0 => [y(critical), y(reflected)],
            Reach::TotalBeside(_) => [-y(reflected), -y(critical)],
        }
    }

    /// Where the curves begin and end in X.
    fn edges(&self) -> SlopeEdges {
        let Slopes { cos, sin: s, .. } = self.slopes;
        let theta = atan2(s, cos);
        let quarter = 0.25 * std::f64::consts::PI;
        let gamma = asin(self.relative.min(1.0));
        let over =
            |numerator: f64| if s > 0.0 { numerator / (cos * s) } else { numerator * f64::INFINITY };
        SlopeEdges {
            disc: [-tan(quarter + 0.5 * theta), tan(quarter - 0.5 * theta)],
            cone: [Slopes::turned(-theta - gamma), Slopes::turned(gamma - theta)],
            wrong_side: (self.relative - s) / cos,
            corner: over(cos * cos - 2.0 * self.critical2),
            touch: over(cos * cos - self.critical2),
            horizon: cos / s,
        }
    }
}

struct SlopeEdges {
    disc: [f64; 2],
    cone: [f64; 2],
    wrong_side: f64,
    /// Parameter where q_r = q_c.
    corner: f64,
    /// Parameter where q_w = q_c.
    touch: f64,
    horizon: f64,
}

impl RoughSampler {
    /// `eta` inside over outside, not 1; `cos` of `wo`, negative from inside.
    pub fn new(eta: f64, facets: Microfacets, cos: f64) -> RoughSampler {
        RoughSampler::with(eta, facets, cos, false)
    }

    /// The same surface with refraction forced.
    pub fn refraction(eta: f64, facets: Microfacets, cos: f64) -> RoughSampler {
        RoughSampler::with(eta, facets, cos, true)
    }

    fn with(eta: f64, facets: Microfacets, cos: f64, is_forced: bool) -> RoughSampler {
        let up = view(cos.abs());
        let sign = 1f64.copysign(cos);
        let relative = if cos > 0.0 { eta } else { 1.0 / eta };
        let critical2 = if relative < 1.0 { (1.0 - relative) * (1.0 + relative) } else { 0.0 };
        let region = SlopeRegion { slopes: Slopes::about(up), relative, critical2 };
        let mut parts = parts(&region, facets.alpha);
        parts.retain(|part| !is_forced || part.event == Event::Refract);
        let wo = DVec3::new(up.x, up.y, up.z * sign);
        let null = null(&region, &facets, up, is_forced);
        RoughSampler { boundary: Boundary::Rough { eta, facets }, is_forced, wo, region, parts, null }
    }

    /// Mirrors between the side of `wo` and the upper side.
    fn upper(&self, w: DVec3) -> DVec3 {
        DVec3::new(w.x, w.y, w.z * 1f64.copysign(self.wo.z))
    }

    /// Direction and d omega_i / d omega_h of a half vector on the upper side.
    fn direction(&self, event: Event, h: DVec3) -> (DVec3, f64) {
        let (wo, r) = (self.upper(self.wo), self.region.relative);
        let m = wo.dot(h);
        match event {
            Event::Reflect => (self.upper(2.0 * m * h - wo), self.jacobian(event, m, m)),
            Event::Refract => {
                let cos_t = ((r * r - 1.0 + m * m).max(0.0)).sqrt() / r;
                (self.upper((m / r - cos_t) * h - wo / r), self.jacobian(event, m, cos_t))
            }
        }
    }

    /// d omega_i / d omega_h for the cosines of both directions to h.
    fn jacobian(&self, event: Event, m: f64, cos: f64) -> f64 {
        let shift = cos - m / self.region.relative;
        match event {
            Event::Reflect => 4.0 * m,
            // At the critical angle the share that is refracted vanishes with the cosine, the density
            // with it.
            Event::Refract if cos == 0.0 => 0.0,
            Event::Refract => shift * shift / cos,
        }
    }

    /// The piece of slopes, by where they lie.
    fn part_of(&self, event: Event, [x, y]: [f64; 2]) -> Option<usize> {
        let is_total = 1.0 + x * x + y * y > self.region.q_critical(x);
        let edges = self.region.edges();
        let reach = match event {
            Event::Refract => Reach::Refraction,
            Event::Reflect if !is_total => Reach::PartialReflection,
            Event::Reflect if x > edges.cone[0] && x < edges.cone[1] => {
                Reach::TotalBeside(1f64.copysign(y))
            }
            Event::Reflect if x < edges.cone[1] => Reach::TotalBefore,
            Event::Reflect => Reach::TotalBeyond,
        };
        self.parts.iter().position(|part| part.reach == reach)
    }

    /// A direction with its event and the density that the code claims.
    fn drawn(&self, stream: &mut Stream) -> Option<(Event, DVec3, f64)> {
        if self.is_forced {
            let wi = self.boundary.sample_refraction(self.wo, stream.draw2())?;
            return Some((Event::Refract, wi, self.boundary.pdf_refraction(self.wo, wi)));
        }
        let BoundarySample { wi, event, .. } = self.boundary.sample(self.wo, stream.draw3())?;
        Some((event, wi, self.boundary.eval(self.wo, wi).1))
    }

    fn point(&self, event: Event, wi: DVec3, pdf: f64) -> Option<Draw> {
        let (wo, wi) = (self.upper(self.wo), self.upper(wi));
        let sum = match event {
            Event::Reflect => wo + wi,
            Event::Refract => wo + self.region.relative * wi,
        };
        let h = if sum.z < 0.0 { -sum.normalize() } else { sum.normalize() };
        let slopes = self.region.slopes.of(h);
        let piece = self.part_of(event, slopes)?;
        let SlopePiece { chart, reach, .. } = self.parts[piece];
        let at = chart.coordinates(slopes, self.region.range(reach, slopes[0]));
        let (_, solid_angle) = chart.at(at, |x| self.region.range(reach, x));
        // The cosine of wi itself: by Snell from that of wo it loses its digits at the critical angle.
        let jacobian = self.jacobian(event, wo.dot(h), wi.dot(h).abs());
        Some(Draw::Point { piece, at, density: pdf * jacobian * solid_angle })
    }
}

fn parts(region: &SlopeRegion, alpha: f64) -> Vec<SlopePiece> {
    let edges = region.edges();
    let mut parts = Vec::new();
    let mut add = |name, event, reach, [from, to]: [f64; 2], kink: f64| {
        if from < to {
            let chart = SlopeChart::new(region.slopes, alpha, [from, to]);
            parts.push(SlopePiece { name, event, chart, reach, kink });
        }
    };
    let never = f64::NAN;
    let [disc, cone] = [edges.disc, edges.cone];
    if region.critical2 == 0.0 {
        add("reflection", Event::Reflect, Reach::PartialReflection, disc, never);
        let below = [f64::NEG_INFINITY, edges.horizon];
        add("refraction", Event::Refract, Reach::Refraction, below, never);
        return parts;
    }
    let both = [disc[0].max(cone[0]), disc[1].min(cone[1])];
    add("reflection", Event::Reflect, Reach::PartialReflection, both, edges.corner);
    // Past the critical angle the wrong side ends refraction before the cone does.
    let top = if region.slopes.cos * region.slopes.cos > region.critical2 {
        cone[1]
    } else {
        edges.wrong_side
    };
    add("refraction", Event::Refract, Reach::Refraction, [cone[0], top], edges.touch);
    let beside = [both[0].max(edges.corner), both[1]];
    for sign in [-1.0, 1.0] {
        let name = if sign < 0.0 { "total reflection, left" } else { "total reflection, right" };
        add(name, Event::Reflect, Reach::TotalBeside(sign), beside, never);
    }
    add("total reflection, before", Event::Reflect, Reach::TotalBefore, [disc[0], cone[0]], never);
    add(
        "total reflection, beyond",
        Event::Reflect,
        Reach::TotalBeyond,
        [cone[1].max(disc[0]), disc[1]],
        never,
    );
    parts
}

/// The probability that the chosen facet sends the light to the wrong side, from the facets' density and
/// Fresnel's reflectance F over the rest of the half-plane of visible slopes: reflection (F) where
/// q > q_r, refraction (1 - F) where q_w < q < q_c. Of forced refraction all of what lies beyond its
/// piece.
fn null(region: &SlopeRegion, facets: &Microfacets, wo: DVec3, is_forced: bool) -> f64 {
    let edges = region.edges();
    let mut ends = vec![f64::NEG_INFINITY, edges.horizon];
    ends.extend(edges.disc);
    if region.critical2 > 0.0 {
        ends.extend(edges.cone);
        ends.extend([edges.wrong_side, edges.corner, edges.touch]);
    }
    ends.retain(|x| *x <= edges.horizon);
    ends.sort_by(f64::total_cmp);
    // The part of the facets at X with Y > 0 and q in a range, weighted.
    let strip = |chart: &SlopeChart, p: f64, [from, to]: [f64; 2], weight: &dyn Fn(f64) -> f64| {
        let x = chart.x(p);
        let y = |q: f64| (q - 1.0 - x * x).max(0.0).sqrt();
        let range = [y(from), y(to)];
        if range[0] >= range[1] {
            return 0.0;
        }
        let density = |q: f64| {
            let (slopes, solid_angle) = chart.at([p, q], |_| range);
            let h = region.slopes.normal(slopes);
            facets.pdf_visible(wo, h)
                * weight(fresnel(wo.dot(h), region.relative).reflectance)
                * solid_angle
        };
        integrate(density, 0.0, 1.0, 1e-10).value
    };
    let failed = |chart: &SlopeChart, p: f64| {
        let x = chart.x(p);
        let (reflected, critical) = (region.q_reflected(x), region.q_critical(x));
        if is_forced {
            let end = region.q_wrong_side(x).unwrap_or(critical);
            return 2.0 * strip(chart, p, [end, f64::INFINITY], &|_| 1.0);
        }
        let split = critical.max(reflected);
        let mut sum = strip(chart, p, [reflected, split], &|f| f);
        sum += strip(chart, p, [split, f64::INFINITY], &|f| f);
        if let Some(wrong) = region.q_wrong_side(x) {
            sum += strip(chart, p, [wrong, critical], &|f| 1.0 - f);
        }
        2.0 * sum
    };
    let segment = |ends: &[f64]| {
        let chart = SlopeChart::new(region.slopes, facets.alpha, [ends[0], ends[1]]);
        integrate(|p| failed(&chart, p), 0.0, 1.0, 1e-9).value
    };
    ends.windows(2).filter(|ends| ends[0] < ends[1]).map(segment).sum()
}

impl Sampler for RoughSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let Some((event, wi, pdf)) = self.drawn(stream) else { return Draw::Null };
        // A sample of no piece is outside of all of them.
        let outside = Draw::Point { piece: 0, at: [f64::NAN; 2], density: 0.0 };
        self.point(event, wi, pdf).unwrap_or(outside)
    }

    fn pieces(&self) -> Vec<Piece> {
        let piece = |part: &SlopePiece| {
            let kink = part.chart.along(part.kink);
            let mut along = Coordinate::over(0.0, 1.0);
            along.kinks.extend((kink > 0.0 && kink < 1.0).then_some(kink));
            Piece::plane(part.name, [along, Coordinate::over(0.0, 1.0)])
        };
        self.parts.iter().map(piece).collect()
    }

    fn density(&self, piece: usize, at: [f64; 2]) -> f64 {
        let SlopePiece { event, chart, reach, .. } = self.parts[piece];
        let (slopes, solid_angle) = chart.at(at, |x| self.region.range(reach, x));
        let (wi, jacobian) = self.direction(event, self.region.slopes.normal(slopes));
        let pdf = if self.is_forced {
            self.boundary.pdf_refraction(self.wo, wi)
        } else {
            self.boundary.eval(self.wo, wi).1
        };
        pdf * jacobian * solid_angle
    }

    fn null(&self) -> Null {
        Null::Stated(self.null)
    }

    fn contrasts(&self) -> Vec<Contrast> {
        let events: Vec<Event> = self.parts.iter().map(|part| part.event).collect();
        let (parts, region) = (self.parts.clone(), self.region);
        let slope = move |piece: usize, at: [f64; 2], axis: usize| {
            let SlopePiece { chart, reach, .. } = parts[piece];
            let (slopes, _) = chart.at(at, |x| region.range(reach, x));
            chart.bounded(slopes)[axis]
        };
        let across = slope.clone();
        let is_reflected = move |piece: usize, _| f64::from(u8::from(events[piece] == Event::Reflect));
        let reflected = Contrast::by_piece("reflected", None, is_reflected);
        let along_and_across = [
            Contrast::by_piece("slope along the view", None, move |k, at| slope(k, at, 0)),
            Contrast::by_piece("slope across the view", Some(0.0), move |k, at| across(k, at, 1)),
        ];
        let reflected = (!self.is_forced).then_some(reflected);
        reflected.into_iter().chain(along_and_across).collect()
    }
}

/// The smooth dielectric or the matched boundary: which lobe, with its direction and weight checked.
///
/// The masses are Fresnel's formulas by angles (Born & Wolf, 1.5.2): with i and t the angles on both
/// sides, R = (sin^2(i - t) / sin^2(i + t) + tan^2(i - t) / tan^2(i + t)) / 2, and ((r - 1) / (r + 1))^2
/// along the normal.
pub struct SmoothSampler {
    boundary: Boundary,
    wo: DVec3,
    relative: f64,
    reflectance: f64,
}

impl SmoothSampler {
    /// `eta` inside over outside, `cos` of `wo`, negative from inside.
    pub fn smooth(eta: f64, cos: f64) -> SmoothSampler {
        let relative = if cos > 0.0 { eta } else { 1.0 / eta };
        SmoothSampler::new(Boundary::Smooth { eta }, relative, cos)
    }

    /// No surface at all.
    pub fn matched(cos: f64) -> SmoothSampler {
        SmoothSampler::new(Boundary::Matched, 1.0, cos)
    }

    fn new(boundary: Boundary, relative: f64, cos: f64) -> SmoothSampler {
        let up = view(cos.abs());
        let wo = DVec3::new(up.x, up.y, up.z * 1f64.copysign(cos));
        SmoothSampler { boundary, wo, relative, reflectance: reflectance_by_angles(cos.abs(), relative) }
    }
}

fn reflectance_by_angles(cos: f64, relative: f64) -> f64 {
    let i = acos(cos);
    let sin_t = sin(i) / relative;
    if relative == 1.0 {
        return 0.0;
    } else if sin_t >= 1.0 {
        return 1.0;
    } else if cos == 1.0 {
        let r = (relative - 1.0) / (relative + 1.0);
        return r * r;
    }
    let t = asin(sin_t);
    let [s, p] = [sin(i - t) / sin(i + t), tan(i - t) / tan(i + t)];
    0.5 * (s * s + p * p)
}

impl Sampler for SmoothSampler {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let Some(sample) = self.boundary.sample(self.wo, stream.draw3()) else { return Draw::Null };
        let (wo, r) = (self.wo, self.relative);
        // Snell's law: what lies along the surface is divided by r and reversed.
        let (wi, weight, index) = match sample.event {
            Event::Reflect => (DVec3::new(-wo.x, -wo.y, wo.z), 1.0, 0),
            Event::Refract => {
                let (x, y) = (-wo.x / r, -wo.y / r);
                let z = -(1.0 - x * x - y * y).max(0.0).sqrt().copysign(wo.z);
                (DVec3::new(x, y, z), 1.0 / (r * r), 1)
            }
        };
        let is_right = (sample.wi - wi).length() < 1e-12 && (sample.weight / weight - 1.0).abs() < 1e-12;
        let has_no_density =
            self.boundary.is_delta() && self.boundary.eval(self.wo, sample.wi) == (0.0, 0.0);
        Draw::Delta { index, exact: is_right && has_no_density }
    }

    fn pieces(&self) -> Vec<Piece> {
        Vec::new()
    }

    fn density(&self, _piece: usize, _at: [f64; 2]) -> f64 {
        0.0
    }

    fn deltas(&self) -> Vec<Discrete> {
        let masses = [("reflection", self.reflectance), ("refraction", 1.0 - self.reflectance)];
        masses.map(|(name, mass)| Discrete { name: name.into(), mass }).into()
    }
}
