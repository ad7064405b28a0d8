//! Densities against quadrature, closed forms and published numbers.

use std::f64::consts::PI;

use super::*;
use crate::math::{cos, integrate, ln, sin};
use crate::sampling::stream::{Purpose, StreamKey};

const GS: [f64; 6] = [-0.5, 0.0, 0.3, 0.8, 0.95, 0.999];

fn at(cosine: f64, azimuth: f64) -> DVec3 {
    let sine = (1.0 - cosine * cosine).sqrt();
    DVec3::new(sine * cos(azimuth), sine * sin(azimuth), cosine)
}

/// The density integrates to 1: over directions about the arrival, in which the phase function is 1 - mu = (1-g)^2
/// (e^y - 1), and over azimuths.
#[test]
fn turns_are_normalised() {
    for g in GS {
        for albedo in [0.3, 0.9, 0.9999] {
            let phase = HenyeyGreenstein { g };
            let turns = GuidedTurns::new(phase, albedo);
            for level in [1, 60, 150, LEVELS - 1] {
                for mu in [-1.0, -0.6, 0.0, 0.7, 1.0] {
                    let pull = Pull { axis: at(mu, 0.0), level };
                    let from = DVec3::Z;
                    let side = if g < 0.0 { -1.0 } else { 1.0 };
                    let scale = (1.0 - g.abs()) * (1.0 - g.abs());
                    let ring = |y: f64| {
                        let below = scale * exp_m1(y);
                        let cosine = (side * (1.0 - below)).clamp(-1.0, 1.0);
                        // Periodic in the azimuth: the trapezoid rule converges geometrically.
                        let mean = (0..128)
                            .map(|k| turns.ratio(&pull, from, at(cosine, PI * f64::from(k) / 64.0)))
                            .sum::<f64>()
                            / 128.0;
                        2.0 * PI * phase.pdf(cosine) * mean * (below + scale)
                    };
                    let mass = integrate(ring, 0.0, ln_1p(2.0 / scale), 1e-11).value;
                    assert!((mass - 1.0).abs() < 1e-9, "{g} {albedo} {level} {mu}: {mass}");
                }
            }
        }
    }
}

/// For isotropic scattering the density of Dwivedi, and the mean cosine of its closed form, 1/s - 2/L.
#[test]
fn isotropic_turns_are_dwivedis() {
    let turns = GuidedTurns::new(HenyeyGreenstein { g: 0.0 }, 0.9);
    let mut stream = StreamKey::named("isotropic_turns_are_dwivedis").pass(0).stream(0, Purpose::Walk);
    for level in [30, 120, LEVELS - 1] {
        let pull = Pull { axis: at(0.3, 1.0), level };
        let s = pull.strength();
        let spread = ln((1.0 + s) / (1.0 - s));
        for m in [-1.0, -0.2, 0.5, 1.0] {
            let to = Frame::about(pull.axis).to_world(at(m, 2.0));
            let expected = 2.0 * s / (spread * (1.0 - s * m));
            assert!((turns.ratio(&pull, DVec3::X, to) / expected - 1.0).abs() < 1e-12);
        }
        let count = 200_000.0;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..200_000 {
            let dir = turns.sample(&pull, DVec3::X, || stream.draw());
            assert!((dir.length() - 1.0).abs() < 1e-14);
            sum += dir.dot(pull.axis);
            squares += dir.dot(pull.axis) * dir.dot(pull.axis);
        }
        let mean = sum / count;
        let error = ((squares / count - mean * mean) / count).sqrt();
        let expected = 1.0 / s - 2.0 / spread;
        assert!((mean - expected).abs() < 5.0 * error, "{level}: {mean} +- {error}, {expected}");
    }
}

fn legendre(l: usize, x: f64) -> f64 {
    let (mut before, mut here) = (0.0, 1.0);
    for l in 1..=l {
        let l = l as f64;
        (before, here) = (here, ((2.0 * l - 1.0) * x * here - (l - 1.0) * before) / l);
    }
    here
}

/// A sum of Legendre polynomials by its powers.
#[test]
fn polynomials_are_sums_of_legendre_polynomials() {
    let coefficients = [0.7, 1.3, 0.9, 0.5, 0.3, 0.1, 0.05, 0.02];
    let polynomial = Polynomial::of_legendre(&coefficients);
    for i in -20..=20 {
        let x = f64::from(i) / 20.0;
        let sum: f64 = coefficients.iter().enumerate().map(|(l, c)| c * legendre(l, x)).sum();
        assert!((polynomial.at(x) - sum).abs() < 1e-14, "{x}");
    }
}

/// Q_l against the closed forms of the first three, and their recurrence far out against quadrature of
/// Q_l = 1/2 int P_l(t) / (nu - t) dt.
#[test]
fn legendre_functions_of_the_second_kind() {
    for nu in [1.05, 1.5, 8.0, 60.0] {
        let q_0 = 0.5 * ln((nu + 1.0) / (nu - 1.0));
        let q = second_kind(nu, q_0);
        for l in [0usize, 1, 2, 5, 11] {
            let integral = integrate(|t| 0.5 * legendre(l, t) / (nu - t), -1.0, 1.0, 1e-15).value;
            // The integral cancels to rounding, of which Q_l keeps no digit where it is small.
            assert!(
                (q[l] - integral).abs() < 1e-12 * q_0 && q[l] > 0.0,
                "{nu} {l}: {} {integral}",
                q[l]
            );
        }
        assert!((q[1] - (nu * q_0 - 1.0)).abs() < 1e-13 * nu * q_0);
    }
}

/// The growth of diffuse light: the published values of 1 / nu_0, and the equation itself.
#[test]
fn growth_solves_its_equation() {
    // Case & Zweifel 1967, table of nu_0: c = 0.8 has 1 / nu_0 = 0.710412, c = 0.99 has 0.172512 (6 digits).
    for (albedo, expected) in [(0.8, 0.710_412), (0.99, 0.172_512)] {
        let s = diffuse_growth(albedo, 0.0);
        assert!((s - expected).abs() < 1e-6, "{albedo}: {s}");
    }
    for albedo in [0.3, 0.5, 0.8, 0.95, 0.999, 0.999_999] {
        let s = diffuse_growth(albedo, 0.0);
        let back = 2.0 * s / ln((1.0 + s) / (1.0 - s));
        assert!((back / albedo - 1.0).abs() < 1e-9, "{albedo}: {s} {back}");
    }
    assert_eq!(diffuse_growth(1.0, 0.5), 0.0);
    // With anisotropy it tends to classical diffusion, sqrt(3 (1 - a) (1 - a g)).
    let (a, g) = (0.9999, 0.8);
    let s = diffuse_growth(a, g);
    let classical = (3.0 * (1.0 - a) * (1.0 - a * g)).sqrt();
    assert!((s / classical - 1.0).abs() < 1e-3, "{s} {classical}");
}

/// Flights: densities over all distances sum to 1, with what reaches the boundary.
#[test]
fn flights_are_normalised() {
    let sigma_t = 3.0;
    let given = |share: f64, pull: f64, bend: f64, carry: f64| {
        Heading::given(share, Growth::new(pull, bend, carry, MOST_FALL))
    };
    let steep = Heading { escape: 0.3, ..given(0.9, 0.7, 0.0, 0.0) };
    let shallow = |depth| Heading::given(0.9, Growth::straight(-0.8, fall(depth)));
    let straight =
        [given(0.9, 0.7, 0.0, 0.0), given(0.5, -0.8, 0.0, 0.0), steep, shallow(3.0), shallow(1.0)];
    assert_eq!(
        [shallow(1.0), shallow(3.0), shallow(20.0)].map(|h| h.growth.fall),
        [0.0, 0.5, MOST_FALL]
    );
    let mut bent = Vec::new();
    for (pull, bend) in [(0.0, 0.1), (0.0, 0.7), (0.3, 0.4), (-0.2, 0.25), (-0.3, 0.25), (0.8, 0.14)] {
        for carry in [0.0, 3.3, 50.0, -0.4] {
            let heading = given(0.9, pull, bend, carry);
            assert_eq!(heading.growth.bend > 0.0, pull >= -bend);
            bent.push(heading);
        }
    }
    for heading in straight.into_iter().chain(bent) {
        let reach = 2.0;
        let density = |t: f64| sigma_t * exp(-sigma_t * t) * heading.flight_ratio(sigma_t, t);
        let ended = integrate(density, 0.0, reach, 1e-13).value;
        let passed = exp(-sigma_t * reach) * heading.passage_ratio(sigma_t, reach);
        assert!((ended + passed - heading.turned()).abs() < 1e-12, "{heading:?}");
        // The share of drawn flights that end before is that of the density: with numbers in the middles of equal steps, each of
        // the two rates is off by one step at most, and rounding adds little.
        let draws = 10_000;
        let guided = |i: u32| {
            heading.sample_distance(sigma_t, StepDraw::Guided, (f64::from(i) + 0.5) / f64::from(draws))
        };
        let of_guided = Heading { plain: 0.0, guided: 1.0, escape: 0.0, ..heading };
        let beyond = exp(-sigma_t * reach) * of_guided.passage_ratio(sigma_t, reach);
        let drawn =
            f64::from((0..draws).filter(|&i| guided(i) > reach).count() as u32) / f64::from(draws);
        assert!((drawn - beyond).abs() < 2.1 / f64::from(draws), "{heading:?}: {drawn} and {beyond}");
    }
    // A depth that no double holds has a finite ratio.
    assert!(given(0.9, 0.9, 0.0, 0.0).passage_ratio(1e6, 1.0).is_finite());
}
