//! Upsampling of a colour R, G and B to wavelengths.
//!
//! Three weights over wavelength, positive and with sum 1 everywhere (Mallett & Yuksel 2019 propose such a
//! partition), here the softmax of quadratics in x = (lambda - 560 nm) / 100 nm:
//!   w_R : w_G : w_B = exp(q_R(x)) : 1 : exp(q_B(x)).
//! The six coefficients are the solution of the six equations that the light w_R shows as pure red, w_B
//! as pure blue and so w_G as pure green, in linear sRGB as `optics::colour` shows bands. A spectrum
//! R w_R + G w_G + B w_B therefore shows as (R, G, B), is smooth, and lies between the least and the
//! largest of the three: equal numbers give a constant, positive ones a positive spectrum. Beyond the
//! range of the colour matching functions, 380 to 780 nm, the weights are those of its ends.

use crate::math::exp;

/// Coefficients of 1, x and x^2 in q_R.
const RED: [f64; 3] = [-3.768_385_81, 7.006_076_42, 10.463_179_26];
/// Those in q_B.
const BLUE: [f64; 3] = [-3.996_230_25, 0.060_908_88, 7.692_464_64];
/// Distance of the midpoints by which a band is averaged, nm, at most.
const STEP_NM: f64 = 1.0;

/// The weights of R, G and B at a wavelength, nm.
fn at(nm: f64) -> [f64; 3] {
    let x = (nm.clamp(380.0, 780.0) - 560.0) / 100.0;
    let quadratic = |[a, b, c]: [f64; 3]| a + x * (b + x * c);
    let exponents = [quadratic(RED), 0.0, quadratic(BLUE)];
    let largest = exponents.into_iter().fold(0.0, f64::max);
    let weights = exponents.map(|q| exp(q - largest));
    let sum: f64 = weights.iter().sum();
    weights.map(|weight| weight / sum)
}

/// Means of the three weights over a band, by midpoints.
pub(crate) fn band_weights([from_nm, to_nm]: [f64; 2]) -> [f64; 3] {
    let count = ((to_nm - from_nm) / STEP_NM).ceil().max(1.0) as usize;
    let mut sums = [0.0; 3];
    for i in 0..count {
        let weights = at(from_nm + (to_nm - from_nm) * (i as f64 + 0.5) / count as f64);
        sums.iter_mut().zip(weights).for_each(|(sum, weight)| *sum += weight);
    }
    sums.map(|sum| sum / count as f64)
}

#[cfg(test)]
mod tests {
    use super::super::colour::band_rgb;
    use super::*;

    /// What the weights show as is the colour that they stand for.
    #[test]
    fn weights_show_as_their_colours() {
        let mut shown = [[0.0; 3]; 3];
        for nm in 380..780 {
            let range = [f64::from(nm), f64::from(nm + 1)];
            let rgb = band_rgb(range[0], range[1]);
            for (weight, shown) in band_weights(range).into_iter().zip(&mut shown) {
                shown.iter_mut().zip(rgb).for_each(|(sum, part)| *sum += weight * part);
            }
        }
        for (colour, shown) in shown.iter().enumerate() {
            for (channel, value) in shown.iter().enumerate() {
                let expected = if channel == colour { 1.0 } else { 0.0 };
                assert!((value - expected).abs() < 2e-4, "{colour} {channel}: {value}");
            }
        }
    }

    #[test]
    fn weights_are_positive_and_add_up() {
        for range in [[300.0, 400.0], [380.0, 780.0], [555.0, 555.5], [700.0, 1000.0]] {
            let weights = band_weights(range);
            assert!(
                weights.iter().all(|w| *w > 0.0) && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-12
            );
        }
        let largest = |nm: f64| {
            let weights = band_weights([nm, nm + 10.0]);
            (0..3).max_by(|a, b| weights[*a].total_cmp(&weights[*b]))
        };
        assert_eq!([440.0, 540.0, 620.0].map(largest), [Some(2), Some(1), Some(0)]);
    }
}
