//! Samplers for connections through a boundary, with places for defects: refraction alone, directions to
//! a plane, and a table of a single bounce.

use std::f64::consts::{PI, TAU};

use scatterproof::math::{DVec3, atan2, cos, sin, sin_cos_turns};
use scatterproof::optics::microfacet::{MicrofacetKind, Microfacets};
use scatterproof::optics::phase::HenyeyGreenstein;
use scatterproof::samplers::{Coordinate, Draw, Piece, Sampler};
use scatterproof::sampling::discrete::Cumulative;
use scatterproof::sampling::stream::Stream;

use super::defects::Defect;

/// Refraction into the body through GGX facets, by visible normals; chart (-wi.z, turns).
pub struct Refraction {
    pub defect: Defect,
}

/// Index inside, and the direction from which the facets are seen.
const ETA: f64 = 1.4;
const SEEN: DVec3 = DVec3::new(0.6, 0.0, 0.8);
const FACETS: Microfacets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };

impl Sampler for Refraction {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let h = FACETS.sample_visible(SEEN, stream.draw2());
        let cos = SEEN.dot(h);
        let cos_t = (1.0 - (1.0 - cos * cos) / (ETA * ETA)).sqrt();
        let wi = (cos / ETA - cos_t) * h - SEEN / ETA;
        let at = [-wi.z, (atan2(wi.y, wi.x) / TAU).rem_euclid(1.0)];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    /// G1 D |wo.h| / |wo.z|, and dh / dwi = n_i^2 |wi.h| / (n_o wo.h + n_i wi.h)^2 (Walter et al. 2007,
    /// eq. 17).
    fn density(&self, _: usize, [down, turns]: [f64; 2]) -> f64 {
        let (s, c) = sin_cos_turns(turns);
        let r = (1.0 - down * down).sqrt();
        let wi = DVec3::new(r * c, r * s, -down);
        let h = -(SEEN + ETA * wi).normalize();
        let (oh, ih) = (SEEN.dot(h), wi.dot(h));
        if oh <= 0.0 || ih >= 0.0 {
            return 0.0;
        }
        let projected = match self.defect {
            Defect::RefractionOtherCosine => wi.z.abs(),
            _ => SEEN.z,
        };
        let index2 = match self.defect {
            Defect::RefractionOtherIndex => 1.0,
            _ => ETA * ETA,
        };
        let sum = oh + ETA * ih;
        TAU * FACETS.g1(SEEN) * FACETS.d(h) * oh / projected * index2 * -ih / (sum * sum)
    }
}

/// Directions to a plane at height [`HEIGHT`] whose points are spread about the foot by [`SPREAD`];
/// chart (cosine to the normal, turns).
pub struct Plane {
    pub defect: Defect,
}

const HEIGHT: f64 = 0.5;
const SPREAD: f64 = 1.2;

impl Sampler for Plane {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let [u, turns] = stream.draw2();
        let r2 = SPREAD * SPREAD * u / (1.0 - u);
        let at = [HEIGHT / (r2 + HEIGHT * HEIGHT).sqrt(), turns];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        vec![Piece::plane("directions", [Coordinate::over(0.0, 1.0), Coordinate::turns()])]
    }

    /// s^2 / (pi (r^2 + s^2)^2) per area, times d^2 / cos.
    fn density(&self, _: usize, [cos, _]: [f64; 2]) -> f64 {
        let d2 = HEIGHT * HEIGHT / (cos * cos);
        let s2 = SPREAD * SPREAD;
        let sum = d2 - HEIGHT * HEIGHT + s2;
        let per_area = s2 / (PI * sum * sum);
        TAU * per_area * if self.defect == Defect::PlaneCosineMissing { d2 } else { d2 / cos }
    }
}

/// Rows of theta, columns of half a turn.
const ROWS: usize = 8;
const COLUMNS: usize = 8;

/// A single bounce towards a point: Henyey-Greenstein about an arrival at one radian to it, tabulated
/// over the isotropic joint density 2 (pi - theta) / pi^2; chart (theta / pi, turns from the plane of
/// arrival).
pub struct Bounce {
    defect: Defect,
    rows: Cumulative,
    columns: Vec<Cumulative>,
}

/// The isotropic distribution function of theta.
fn below(row: usize) -> f64 {
    let t = row as f64 / ROWS as f64;
    t * (2.0 - t)
}

impl Bounce {
    pub fn new(defect: Defect) -> Bounce {
        let (sin_a, cos_a) = (sin(1.0), cos(1.0));
        let phase = |row: usize, column: usize| {
            let theta = PI * (row as f64 + 0.5) / ROWS as f64;
            let azimuth = PI * (column as f64 + 0.5) / COLUMNS as f64;
            let mu = cos_a * cos(theta) + sin_a * sin(theta) * cos(azimuth);
            HenyeyGreenstein { g: 0.5 }.pdf(mu)
        };
        let weights = |row: usize| -> Vec<f64> { (0..COLUMNS).map(|k| phase(row, k)).collect() };
        let row_weight = |row: usize| weights(row).iter().sum::<f64>() * (below(row + 1) - below(row));
        let table = |weights: &[f64]| Cumulative::new(weights).expect("all are positive");
        let rows = table(&(0..ROWS).map(row_weight).collect::<Vec<_>>());
        Bounce { defect, rows, columns: (0..ROWS).map(|row| table(&weights(row))).collect() }
    }
}

impl Sampler for Bounce {
    fn draw(&self, stream: &mut Stream) -> Draw {
        let [u, v] = stream.draw2();
        let (row, x) = self.rows.sample(u);
        let side = 1f64.copysign(v - 0.5);
        let (column, y) = self.columns[row].sample((2.0 * v - 1.0).abs());
        let below = below(row) + x * (below(row + 1) - below(row));
        let mut half_turns = (column as f64 + y) / COLUMNS as f64;
        if self.defect == Defect::BounceAzimuthMirrored {
            half_turns = 1.0 - half_turns;
        }
        let at = [1.0 - (1.0 - below).sqrt(), (0.5 * side * half_turns).rem_euclid(1.0)];
        Draw::Point { piece: 0, at, density: self.density(0, at) }
    }

    fn pieces(&self) -> Vec<Piece> {
        let (mut theta, mut azimuth) = (Coordinate::over(0.0, 1.0), Coordinate::turns());
        theta.kinks.extend((1..ROWS).map(|k| k as f64 / ROWS as f64));
        azimuth.kinks.extend((0..2 * COLUMNS).map(|k| k as f64 / (2 * COLUMNS) as f64));
        vec![Piece::plane("directions", [theta, azimuth])]
    }

    fn density(&self, _: usize, [x, turns]: [f64; 2]) -> f64 {
        let row = ((x * ROWS as f64) as usize).min(ROWS - 1);
        let half_turns = 2.0 * turns.min(1.0 - turns);
        let column = ((half_turns * COLUMNS as f64) as usize).min(COLUMNS - 1);
        let isotropic = match self.defect {
            Defect::BounceThetaOff => 2.02 * (1.0 - x),
            _ => 2.0 * (1.0 - x),
        };
        let of_row = self.rows.probability(row) / (below(row + 1) - below(row));
        isotropic * of_row * self.columns[row].probability(column) * COLUMNS as f64
    }
}
