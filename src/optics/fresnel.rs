//! Exact reflectance of a smooth dielectric for unpolarised light.

/// Reflectance of a smooth dielectric and refracted cosine at one angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fresnel {
    /// Reflected fraction; 1 under total internal reflection.
    pub reflectance: f64,
    /// Cosine on the far side; 0 under total internal reflection.
    pub cos_t: f64,
}

/// Reflectance at cosine `cos_i` in [0, 1] for relative index `eta` = far side over near side.
///
/// Snell: sin_t = sin_i / eta, so cos_t^2 = (eta^2 - 1 + cos_i^2) / eta^2, written so that eta = 1
/// gives cos_t = cos_i to the last bit. Fresnel (Born & Wolf, 1.5.2):
/// r_s = (cos_i - eta cos_t) / (cos_i + eta cos_t), r_p = (eta cos_i - cos_t) / (eta cos_i + cos_t),
/// R = (r_s^2 + r_p^2) / 2.
#[inline(always)]
pub fn fresnel(cos_i: f64, eta: f64) -> Fresnel {
    let eta2_cos_t2 = (eta * eta - 1.0) + cos_i * cos_i;
    if eta2_cos_t2 <= 0.0 || cos_i <= 0.0 {
        return Fresnel { reflectance: 1.0, cos_t: 0.0 };
    }
    let cos_t = eta2_cos_t2.sqrt() / eta;
    let r_s = (cos_i - eta * cos_t) / (cos_i + eta * cos_t);
    let r_p = (eta * cos_i - cos_t) / (eta * cos_i + cos_t);
    Fresnel { reflectance: 0.5 * (r_s * r_s + r_p * r_p), cos_t }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_incidence_and_matched_index() {
        for eta in [1.1, 1.3, 1.5, 1.0 / 1.5] {
            let expected = ((eta - 1.0) / (eta + 1.0)) * ((eta - 1.0) / (eta + 1.0));
            assert!((fresnel(1.0, eta).reflectance - expected).abs() < 1e-16);
        }
        for i in 1..=1000 {
            let cos = f64::from(i) / 1000.0;
            assert_eq!(fresnel(cos, 1.0), Fresnel { reflectance: 0.0, cos_t: cos });
        }
    }

    /// D8: the reflectance is the same from both sides at Snell partners. Coming back out near grazing,
    /// cos_t^2 is a difference of numbers near 1 and carries eps / cos^2, so 1e-12 is asked from cos
    /// 0.05.
    #[test]
    fn snell_partners_reflect_alike() {
        for eta in [1.05, 1.3, 1.5, 2.4] {
            for i in 50..=1000 {
                let outside = fresnel(f64::from(i) / 1000.0, eta);
                let inside = fresnel(outside.cos_t, 1.0 / eta);
                assert!((outside.reflectance - inside.reflectance).abs() < 1e-12);
                assert!((inside.cos_t - f64::from(i) / 1000.0).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn total_internal_reflection_beyond_the_critical_angle() {
        let critical = (1.0f64 - 1.0 / (1.5 * 1.5)).sqrt();
        assert_eq!(fresnel(critical - 1e-9, 1.0 / 1.5).reflectance, 1.0);
        assert!(fresnel(critical + 1e-9, 1.0 / 1.5).reflectance < 1.0);
    }
}
