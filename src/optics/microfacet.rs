//! Distributions of microfacet normals, isotropic roughness, with separable Smith masking and
//! sampling of the visible normals. Local frame: +z is the macroscopic normal on the side of `v`.

use std::f64::consts::FRAC_1_PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::math::{DVec3, erf_inv, erfc, exp, increasing_root, ln_1p, sin_cos_turns};

/// Shape of the distribution.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum MicrofacetKind {
    /// Trowbridge & Reitz 1975; Walter et al. 2007, eq. 33.
    Ggx,
    /// Gaussian slopes; Walter et al. 2007, eq. 25.
    Beckmann,
}

/// A distribution of microfacet normals.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Microfacets {
    /// Shape of the distribution.
    #[serde(rename = "distribution")]
    pub kind: MicrofacetKind,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub alpha: f64,
}

const SQRT_PI: f64 = 1.772_453_850_905_516;

impl Microfacets {
    /// Area of microfacets with normal `h` per macroscopic area and solid angle, 1/sr; 0 for h.z <= 0.
    #[inline]
    pub fn d(&self, h: DVec3) -> f64 {
        if h.z <= 0.0 {
            return 0.0;
        }
        let a2 = self.alpha * self.alpha;
        let (r2, z2) = (h.x * h.x + h.y * h.y, h.z * h.z);
        match self.kind {
            MicrofacetKind::Ggx => {
                let q = r2 / a2 + z2;
                FRAC_1_PI / (a2 * q * q)
            }
            MicrofacetKind::Beckmann => exp(-r2 / (z2 * a2)) * FRAC_1_PI / (a2 * z2 * z2),
        }
    }

    /// Smith's masking for direction `v`, |v.z| > 0: the visible fraction of the facets that face it,
    /// 1 / (1 + Lambda). Even in v.z.
    #[inline]
    pub fn g1(&self, v: DVec3) -> f64 {
        match self.kind {
            MicrofacetKind::Ggx => self.ggx_g1(v),
            MicrofacetKind::Beckmann => {
                let slope2 = self.slope2(v);
                if slope2 == 0.0 {
                    return 1.0;
                }
                // Lambda(a) = (exp(-a^2) / (a sqrt pi) - erfc(a)) / 2, a = 1 / (alpha tan theta).
                let a = 1.0 / slope2.sqrt();
                1.0 / (1.0 + 0.5 * (exp(-a * a) / (a * SQRT_PI) - erfc(a)))
            }
        }
    }

    /// [`Self::g1`] of a GGX surface, without a branch.
    #[inline(always)]
    pub(super) fn ggx_g1(&self, v: DVec3) -> f64 {
        1.0 / (1.0 + 0.5 * ((1.0 + self.slope2(v)).sqrt() - 1.0))
    }

    /// (alpha tan theta)^2.
    #[inline(always)]
    fn slope2(&self, v: DVec3) -> f64 {
        self.alpha * self.alpha * ((v.x * v.x + v.y * v.y) / (v.z * v.z))
    }

    /// Density of [`Self::sample_normal`] per solid angle: D(h) h.z.
    #[inline]
    pub fn pdf_normal(&self, h: DVec3) -> f64 {
        self.d(h) * h.z
    }

    /// A normal in proportion to the projected area of its facets, without a view (Walter et al. 2007,
    /// eq. 28, 35): the slope s = tan(theta) / alpha has the distribution function 1 - e^(-s^2)
    /// (Beckmann), s^2 / (1 + s^2) (GGX).
    #[inline]
    pub fn sample_normal(&self, u: [f64; 2]) -> DVec3 {
        let slope2 = match self.kind {
            MicrofacetKind::Ggx => u[0] / (1.0 - u[0]),
            MicrofacetKind::Beckmann => -ln_1p(-u[0]),
        };
        let tan = self.alpha * slope2.sqrt();
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        DVec3::new(tan * cos_phi, tan * sin_phi, 1.0).normalize()
    }

    /// Density of normals as seen from `v` (v.z > 0), per solid angle:
    /// G1(v) D(h) max(0, v.h) / v.z (Heitz & d'Eon 2014, eq. 2).
    #[inline]
    pub fn pdf_visible(&self, v: DVec3, h: DVec3) -> f64 {
        self.g1(v) * self.d(h) * v.dot(h).max(0.0) / v.z
    }

    /// A normal with density [`Self::pdf_visible`], v.z > 0. Both shapes are stretched to roughness 1,
    /// sampled there and stretched back (Heitz & d'Eon 2014, section 4).
    #[inline]
    pub fn sample_visible(&self, v: DVec3, u: [f64; 2]) -> DVec3 {
        let stretched = self.stretched(v);
        match self.kind {
            MicrofacetKind::Ggx => self.ggx_visible(stretched, u),
            MicrofacetKind::Beckmann => self.stretched(beckmann_visible(stretched, u)),
        }
    }

    /// From roughness alpha to roughness 1 for directions, and back for normals, not normalised before.
    #[inline(always)]
    pub(super) fn stretched(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.alpha * v.x, self.alpha * v.y, v.z).normalize()
    }

    /// [`Self::sample_visible`] of a GGX surface seen from a stretched direction, without a branch. Roughness 1 GGX is the
    /// upper unit hemisphere: the directions that `v` reflects to, off its visible part, fill the cap z > -v.z evenly (Dupuy &
    /// Benyoub 2023). So draw c from that cap; h ~ c + v.
    #[inline(always)]
    pub(super) fn ggx_visible(&self, v: DVec3, u: [f64; 2]) -> DVec3 {
        let below = (1.0 + v.z) * u[0];
        let (sin_phi, cos_phi) = sin_cos_turns(u[1]);
        let r = (below * (2.0 - below)).sqrt();
        self.stretched(DVec3::new(r * cos_phi, r * sin_phi, 1.0 - below) + v)
    }
}

/// Roughness 1 Beckmann has slopes (x, y) of density exp(-x^2 - y^2) / pi. Seen from
/// v = (sin, 0, cos) a facet counts by max(0, cos - x sin): y stays Gaussian, and with c = cot theta
/// x has the distribution function C(x) / C(c) on x < c,
///   C(x) = int_{-inf}^x (1 - t/c) exp(-t^2) dt = sqrt(pi)/2 erfc(-x) + exp(-x^2) / (2c),
/// which increases with slope (1 - x/c) exp(-x^2). |x| > 8.5 has no mass in f64.
fn beckmann_visible(v: DVec3, u: [f64; 2]) -> DVec3 {
    let sin = (v.x * v.x + v.y * v.y).sqrt();
    let y = erf_inv(2.0 * u[1] - 1.0).clamp(-8.5, 8.5);
    if sin == 0.0 {
        return DVec3::new(-erf_inv(2.0 * u[0] - 1.0).clamp(-8.5, 8.5), -y, 1.0);
    }
    let c = v.z / sin;
    let distribution = |x: f64| 0.5 * SQRT_PI * erfc(-x) + exp(-x * x) / (2.0 * c);
    let top = c.min(8.5);
    let target = u[0] * distribution(top);
    // Without the factor 1 - t/c the root is Gaussian; it moves towards -v by about half its slope.
    let start = erf_inv(2.0 * u[0] - 1.0).clamp(-8.5, 8.5) - 0.5 / (c + 1.0);
    let root = |x: f64| (distribution(x) - target, (1.0 - x / c) * exp(-x * x));
    let x = increasing_root(root, -8.5, top, start);
    let (cos_phi, sin_phi) = (v.x / sin, v.y / sin);
    DVec3::new(-(x * cos_phi - y * sin_phi), -(x * sin_phi + y * cos_phi), 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Integral, integrate};
    use std::f64::consts::PI;

    /// Mean projected area, `int D(h) h.z dh`: 1 for a valid distribution.
    fn projected_area(facets: &Microfacets) -> Integral {
        // tan theta = alpha s: d omega = 2 pi sin dtheta, dtheta = alpha ds cos^2.
        integrate(
            |x| {
                let s = x / (1.0 - x);
                let tan = facets.alpha * s;
                let cos2 = 1.0 / (1.0 + tan * tan);
                let (sin, cos) = ((tan * tan * cos2).sqrt(), cos2.sqrt());
                let dtheta = facets.alpha * cos2 / ((1.0 - x) * (1.0 - x));
                2.0 * PI * sin * dtheta * cos * facets.d(DVec3::new(sin, 0.0, cos))
            },
            0.0,
            1.0,
            1e-10,
        )
    }

    fn all() -> impl Iterator<Item = Microfacets> {
        [MicrofacetKind::Ggx, MicrofacetKind::Beckmann]
            .into_iter()
            .flat_map(|kind| [0.01, 0.04, 0.2, 0.5, 1.0].map(|alpha| Microfacets { kind, alpha }))
    }

    fn view(cos: f64, phi: f64) -> DVec3 {
        let sin = (1.0 - cos * cos).sqrt();
        let (s, c) = sin_cos_turns(phi);
        DVec3::new(sin * c, sin * s, cos)
    }

    /// D7: the facets' projected areas add up to the surface.
    #[test]
    fn projected_area_is_one() {
        for facets in all() {
            let area = projected_area(&facets);
            assert!((area.value - 1.0).abs() < 1e-8, "{facets:?} {area:?}");
        }
    }

    /// D7: the visible normals are normalised from every direction, grazing ones included; this is
    /// what ties the masking function to the distribution.
    #[test]
    fn visible_normals_are_normalised() {
        for facets in all() {
            for cos in [1.0, 0.7, 0.2, 0.01] {
                let v = view(cos, 0.0);
                // Slopes: h = (-x, -y, 1)/sqrt(1 + x^2 + y^2), d omega = h.z^3 dx dy; y by symmetry
                // twice.
                let norm = integrate(
                    |p| {
                        let s = p / (1.0 - p * p);
                        let ds = (1.0 + p * p) / ((1.0 - p * p) * (1.0 - p * p));
                        let inner = integrate(
                            |q| {
                                let t = q / (1.0 - q);
                                let dt = 1.0 / ((1.0 - q) * (1.0 - q));
                                let h =
                                    DVec3::new(-facets.alpha * s, -facets.alpha * t, 1.0).normalize();
                                facets.pdf_visible(v, h) * h.z * h.z * h.z * dt
                            },
                            0.0,
                            1.0,
                            1e-11,
                        );
                        2.0 * inner.value * facets.alpha * facets.alpha * ds
                    },
                    -1.0,
                    1.0,
                    1e-9,
                );
                assert!((norm.value - 1.0).abs() < 1e-8, "{facets:?} cos {cos}: {norm:?}");
            }
        }
    }

    /// D2: the density is the inverse Jacobian of the map, and no sample has density 0.
    #[test]
    fn density_is_the_inverse_jacobian() {
        for facets in all() {
            for cos in [1.0, 0.6, 0.1] {
                let v = view(cos, 0.13);
                for i in 0..20 {
                    for j in 0..20 {
                        let u = [(f64::from(i) + 0.5) / 20.0, (f64::from(j) + 0.37) / 20.0];
                        let e = 1e-6;
                        let at = |a: f64, b: f64| facets.sample_visible(v, [u[0] + a, u[1] + b]);
                        let du = (at(e, 0.0) - at(-e, 0.0)) / (2.0 * e);
                        let dv = (at(0.0, e) - at(0.0, -e)) / (2.0 * e);
                        let h = at(0.0, 0.0);
                        assert!(h.z > 0.0 && v.dot(h) > 0.0);
                        let product = du.cross(dv).length() * facets.pdf_visible(v, h);
                        assert!((product - 1.0).abs() < 2e-5, "{facets:?} cos {cos} u {u:?}: {product}");
                    }
                }
            }
        }
    }

    /// D1 for the normals without a view: the slope's distribution function, ends included.
    #[test]
    fn plain_normals_invert() {
        for facets in all() {
            let end = 1.0 / f64::from(1 << 24);
            for u in (0..4096).map(|i| (f64::from(i) + 0.5) / 4096.0).chain([end, 1.0 - end]) {
                let h = facets.sample_normal([u, 0.3]);
                let slope2 = (h.x * h.x + h.y * h.y) / (h.z * h.z * facets.alpha * facets.alpha);
                let back = match facets.kind {
                    MicrofacetKind::Ggx => slope2 / (1.0 + slope2),
                    MicrofacetKind::Beckmann => -crate::math::exp_m1(-slope2),
                };
                assert!((back - u).abs() < 1e-12, "{facets:?} {u}: {back}");
            }
        }
    }

    /// D2 for the normals without a view. D7 is `projected_area_is_one`.
    #[test]
    fn plain_density_is_the_inverse_jacobian() {
        for facets in all() {
            for i in 0..20 {
                for j in 0..20 {
                    let u = [(f64::from(i) + 0.5) / 20.0, (f64::from(j) + 0.37) / 20.0];
                    let e = 1e-6;
                    let at = |a: f64, b: f64| facets.sample_normal([u[0] + a, u[1] + b]);
                    let du = (at(e, 0.0) - at(-e, 0.0)) / (2.0 * e);
                    let dv = (at(0.0, e) - at(0.0, -e)) / (2.0 * e);
                    let product = du.cross(dv).length() * facets.pdf_normal(at(0.0, 0.0));
                    assert!((product - 1.0).abs() < 2e-5, "{facets:?} u {u:?}: {product}");
                }
            }
        }
    }
}
