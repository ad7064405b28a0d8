//! Identities of the rough dielectric that hold to rounding, asked of the surface with its defect: what
//! `optics::boundary` asks of the library's own.

use scatterproof::math::{DVec3, sin_cos_turns};
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::microfacet::{MicrofacetKind, Microfacets};

use super::defects::Defect;
use super::surface::Surface;

/// An identity: whether it holds.
type Identity = fn(&Surface) -> bool;

/// Every identity, and whether it is broken.
pub fn all(defect: Defect) -> Vec<(String, bool)> {
    let facets = Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 };
    let surface = Surface { eta: 1.4, facets, defect };
    let checks: [(&str, Identity); 4] = [
        ("identity reciprocity", reciprocity),
        ("identity sample-weight", sample_weight),
        ("identity sample-density", sample_density),
        ("identity fresnel", snell_partners),
    ];
    checks.map(|(name, holds)| (name.to_string(), !holds(&surface))).into()
}

fn direction(cos: f64, turns: f64) -> DVec3 {
    let sin = (1.0 - cos * cos).sqrt();
    let (s, c) = sin_cos_turns(turns);
    DVec3::new(sin * c, sin * s, cos)
}

fn grid(n: u32) -> impl Iterator<Item = f64> + Clone {
    (0..n).map(move |i| (f64::from(i) + 0.43) / f64::from(n))
}

fn close(a: f64, b: f64, tolerance: f64) -> bool {
    (a - b).abs() <= tolerance * a.abs().max(b.abs())
}

/// f(a -> b) / n_b^2 = f(b -> a) / n_a^2 for radiance (Walter et al. 2007, section 2.1), f without the
/// cosine of the source.
fn reciprocity(surface: &Surface) -> bool {
    let index2 = |w: DVec3| if w.z > 0.0 { 1.0 } else { surface.eta * surface.eta };
    let mut joined = 0;
    for a in [0.9, 0.3, -0.3, -0.8] {
        for b in grid(20) {
            for turns in grid(6) {
                let (wo, wi) = (direction(a, 0.1), direction(2.0 * b - 1.0, turns));
                let forward = surface.eval(wo, wi).0 / (wi.z.abs() * index2(wo));
                let backward = surface.eval(wi, wo).0 / (wo.z.abs() * index2(wi));
                if !close(forward, backward, 1e-9) && forward.max(backward) > 1e-12 {
                    return false;
                }
                joined += u32::from(forward > 0.0);
            }
        }
    }
    joined > 50
}

/// Weight times density of a sample is the value, and its density asked again is the one reported.
fn sample_weight(surface: &Surface) -> bool {
    samples(surface).all(|(wo, _, drawn)| {
        let (value, pdf) = surface.eval(wo, drawn.wi);
        close(drawn.pdf, pdf, 1e-9) && close(drawn.weight * drawn.pdf, value, 1e-9)
    })
}

/// The density is the inverse Jacobian of the map from (u1, u2) to directions times the probability of
/// the lobe, which u0 alone decides.
fn sample_density(surface: &Surface) -> bool {
    samples(surface).all(|(wo, u, drawn)| {
        let e = 1e-5;
        let at = |a: f64, b: f64| surface.sample(wo, [u[0], u[1] + a, u[2] + b]).map(|d| d.wi);
        let [Some(r), Some(l), Some(t), Some(b)] = [at(e, 0.0), at(-e, 0.0), at(0.0, e), at(0.0, -e)]
        else {
            return true; // at the rim of the lobe
        };
        let same = [r, l, t, b].iter().all(|w| w.dot(drawn.wi) > 0.99);
        let area = ((r - l) / (2.0 * e)).cross((t - b) / (2.0 * e)).length();
        // Half vectors are found again from the directions by Snell's law itself.
        let reflects = wo.z * drawn.wi.z > 0.0;
        let index = |w: DVec3| if w.z > 0.0 { 1.0 } else { surface.eta };
        let h = match reflects {
            true => (wo + drawn.wi).normalize(),
            false => (index(wo) * wo + index(drawn.wi) * drawn.wi).normalize(),
        };
        let reflectance = fresnel(wo.dot(h).abs(), index(-wo) / index(wo)).reflectance;
        let lobe = if reflects { reflectance } else { 1.0 - reflectance };
        !same || close(area * drawn.pdf, lobe, 1e-3)
    })
}

fn samples(
    surface: &Surface,
) -> impl Iterator<Item = (DVec3, [f64; 3], super::surface::Drawn)> + use<'_> {
    let cosines = [0.95, 0.5, -0.5, -0.95];
    let cube = grid(6).flat_map(|a| grid(6).flat_map(move |b| grid(6).map(move |c| [a, b, c])));
    cosines.into_iter().flat_map(move |cos| {
        let wo = direction(cos, 0.21);
        cube.clone().filter_map(move |u| surface.sample(wo, u).map(|drawn| (wo, u, drawn)))
    })
}

/// The reflectance is the same from both sides at directions that Snell's law joins.
fn snell_partners(surface: &Surface) -> bool {
    grid(50).all(|cos| {
        let inside = (1.0 - (1.0 - cos * cos) / (surface.eta * surface.eta)).sqrt();
        let from_outside = surface.reflectance(DVec3::Z, cos);
        let from_inside = surface.reflectance(-DVec3::Z, inside);
        close(from_outside, from_inside, 1e-9)
    })
}
