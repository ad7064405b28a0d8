//! False-colour maps: one number per pixel, as an index into a palette of 255 colours.

use crate::math;
use crate::results::image::{Picture, diverging};
use crate::verify::means::SKEWNESS_LIMIT;

/// z-scores are shown from -4 to 4.
pub(super) const Z_LIMIT: f64 = 4.0;
/// Relative standard errors are shown from the first to the second, by their logarithm.
pub(super) const NOISE_RANGE: (f64, f64) = (1e-3, 1.0);
/// Relative differences are shown up to one of these.
const LIMITS: [f64; 5] = [0.01, 0.03, 0.1, 0.3, 1.0];
/// Fraction of the pixels within the range of differences.
const SHOWN: f64 = 0.95;

/// Index of a pixel that has no value.
const NONE: u8 = 0;
/// Index of 0 in a signed map; 1 and 255 are its ends.
const ZERO: f64 = 128.0;

/// Standard error over mean; not a number where both are 0.
pub(super) fn noise(picture: &Picture, band: usize) -> Vec<f64> {
    let pixels = picture.mean(band).zip(picture.std_error(band));
    pixels.map(|(mean, error)| error / mean.abs()).collect()
}

/// (a - b) / |b|; not a number where both are 0.
pub(super) fn difference(a: &Picture, b: &Picture, band: usize) -> Vec<f64> {
    a.mean(band).zip(b.mean(band)).map(|(a, b)| (a - b) / b.abs()).collect()
}

/// (a - b) over its standard error, of two that are independent and of so many passes.
pub(super) struct ZScores {
    /// By pixel; not a number where there is none.
    pub values: Vec<f64>,
    /// Pixels without a standard error on either side.
    pub without_error: usize,
    /// Pixels whose noise is so skewed on a side that a test of its mean would be refused.
    pub skewed: usize,
}

impl ZScores {
    pub(super) fn of([a, b]: [&Picture; 2], band: usize, passes: [u64; 2]) -> ZScores {
        let mut scores = ZScores { values: Vec::new(), without_error: 0, skewed: 0 };
        let sides = |of: &Picture| of.mean(band).zip(of.std_error(band)).collect::<Vec<_>>();
        for ((a, ea), (b, eb)) in sides(a).into_iter().zip(sides(b)) {
            let error = (ea * ea + eb * eb).sqrt();
            let is_skewed = is_skewed(a, ea, passes[0]) || is_skewed(b, eb, passes[1]);
            scores.without_error += usize::from(error == 0.0);
            scores.skewed += usize::from(error != 0.0 && is_skewed);
            scores.values.push(if error == 0.0 || is_skewed { f64::NAN } else { (a - b) / error });
        }
        scores
    }
}

/// Whether the passes of a pixel are so skewed that a test of their mean would be refused
/// ([`SKEWNESS_LIMIT`]), as far as mean and error tell. Of values that are never negative, E x^3 E x >=
/// (E x^2)^2 (Cauchy and Schwarz), so their skewness is at least c - 1/c with c = standard deviation over
/// mean; with c = r sqrt(n), r the relative error of the mean, skewness / sqrt(n) >= r - 1 / (n r).
fn is_skewed(mean: f64, error: f64, passes: u64) -> bool {
    let relative = error / mean;
    mean > 0.0 && relative - 1.0 / (passes as f64 * relative) > SKEWNESS_LIMIT
}

/// The smallest range of [`LIMITS`] that holds 95 % of the values.
pub(super) fn limit(values: impl Iterator<Item = f64>) -> f64 {
    let sizes: Vec<f64> = values.filter(|x| !x.is_nan()).map(f64::abs).collect();
    let holds = |limit: f64| {
        let held = sizes.iter().filter(|size| **size <= limit).count();
        held as f64 >= SHOWN * sizes.len() as f64
    };
    LIMITS.into_iter().find(|limit| holds(*limit)).unwrap_or(1.0)
}

/// The index of a value between -`limit` and `limit`; beyond them the index of the end.
pub(super) fn signed_index(value: f64, limit: f64) -> u8 {
    if value.is_nan() { NONE } else { (ZERO + 127.0 * (value / limit).clamp(-1.0, 1.0)).round() as u8 }
}

/// The index of a relative standard error.
pub(super) fn noise_index(value: f64) -> u8 {
    if value.is_nan() {
        return NONE;
    }
    let (low, high) = NOISE_RANGE;
    let part = math::ln(value.clamp(low, high) / low) / math::ln(high / low);
    (1.0 + 254.0 * part).round() as u8
}

/// Ten steps of viridis (S. van der Walt, N. Smith, Matplotlib; in the public domain), which is ordered
/// by lightness for every kind of colour vision.
const VIRIDIS: [[u8; 3]; 11] = [
    [0x44, 0x01, 0x54],
    [0x48, 0x24, 0x75],
    [0x41, 0x44, 0x87],
    [0x35, 0x5f, 0x8d],
    [0x2a, 0x78, 0x8e],
    [0x21, 0x91, 0x8c],
    [0x22, 0xa8, 0x84],
    [0x44, 0xbf, 0x70],
    [0x7a, 0xd1, 0x51],
    [0xbd, 0xdf, 0x26],
    [0xfd, 0xe7, 0x25],
];

/// From dark at 0 to light at 1, sRGB values.
fn sequential(x: f64) -> [u8; 3] {
    let at = 10.0 * x;
    let from = (at as usize).min(9);
    let part = at - from as f64;
    [0, 1, 2].map(|c| {
        let [a, b] = [VIRIDIS[from][c], VIRIDIS[from + 1][c]].map(f64::from);
        (a + part * (b - a)).round() as u8
    })
}

/// The colours of all indices as hexadecimal digits, six per colour: of noise, and of signed values.
pub(super) fn palettes() -> [String; 2] {
    let grey = diverging(f64::NAN);
    let text = |colour: &dyn Fn(f64) -> [u8; 3]| {
        let shown = (1..=255).map(|index| colour(f64::from(index)));
        [grey].into_iter().chain(shown).map(|[r, g, b]| format!("{r:02x}{g:02x}{b:02x}")).collect()
    };
    [text(&|index| sequential((index - 1.0) / 254.0)), text(&|index| diverging((index - ZERO) / 127.0))]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::npy::Array;
    use crate::results::record::Band;

    fn band() -> [Band; 1] {
        [Band { name: "grey".into(), range_nm: None, display_rgb: [1.0; 3] }]
    }

    #[test]
    fn values_of_pixels() {
        let band = band();
        let array =
            |mean: [f64; 4], error: [f64; 4]| Array::new(vec![2, 2, 2, 1], [mean, error].concat());
        let a = array([2.0, 0.0, 1.0, 3.0], [0.3, 0.0, 0.5, 0.0]);
        let b = array([1.0, 0.0, 0.0, 4.0], [0.4, 0.0, 0.0, 0.0]);
        let (a, b) = (Picture::new(&band, &a), Picture::new(&band, &b));
        let text = |values: Vec<f64>| format!("{values:?}");
        assert_eq!(text(noise(&a, 0)), "[0.15, NaN, 0.5, 0.0]");
        assert_eq!(text(difference(&a, &b, 0)), "[1.0, NaN, inf, -0.25]");
        let scores = |pair, passes| ZScores::of(pair, 0, passes);
        // Two passes: nothing is known to be skewed.
        assert_eq!(text(scores([&a, &b], [2, 2]).values), "[2.0, NaN, 2.0, NaN]");
        let back = scores([&b, &a], [2, 2]);
        assert_eq!(text(back.values), "[-2.0, NaN, -2.0, NaN]");
        assert_eq!((back.without_error, back.skewed), (2, 0));
        // Relative errors of 0.15 and 0.4, and of 0.5, of a hundred passes: 0.15 - 1 / 15 is within the limit of 0.1,
        // 0.4 - 1 / 40 is not.
        let many = scores([&a, &b], [100, 100]);
        assert_eq!(
            (text(many.values), many.without_error, many.skewed),
            ("[NaN, NaN, NaN, NaN]".into(), 2, 2)
        );
        assert!(!is_skewed(2.0, 0.3, 100) && is_skewed(1.0, 0.4, 100) && !is_skewed(-1.0, 0.4, 100));
    }

    /// The bound holds of any values that are never negative, and is their skewness where only one differs from 0.
    #[test]
    fn skewness_is_at_least_what_mean_and_error_tell() {
        for power in 1..12 {
            for kind in 0..3 {
                let value = |i: i32| match kind {
                    0 => f64::from(u8::from(i % (1 << (power % 8)) == 0)),
                    1 => f64::from(i).powi(power),
                    _ => f64::from((i * 7919) % 101) + f64::from(power),
                };
                let values: Vec<f64> = (0..256).map(value).collect();
                let n = values.len() as f64;
                let mean = values.iter().sum::<f64>() / n;
                let moment = |p: i32| values.iter().map(|x| (x - mean).powi(p)).sum::<f64>() / n;
                let (deviation, skewness) = (moment(2).sqrt(), moment(3) / moment(2).powf(1.5));
                let c = deviation / mean;
                assert!(
                    skewness >= c - 1.0 / c - 1e-9 || deviation == 0.0,
                    "{power} {kind}: {skewness} {c}"
                );
                if kind == 0 && deviation > 0.0 {
                    assert!((skewness - (c - 1.0 / c)).abs() < 1e-9, "{skewness} {c}");
                }
            }
        }
    }

    #[test]
    fn indices_and_their_colours() {
        let signed = [-9.0, -4.0, -2.0, 0.0, 2.0, 4.0, f64::INFINITY, f64::NAN];
        assert_eq!(signed.map(|z| signed_index(z, 4.0)), [1, 1, 65, 128, 192, 255, 255, 0]);
        let errors = [0.0, 1e-3, 1e-2, 1e-1, 1.0, f64::INFINITY, f64::NAN];
        assert_eq!(errors.map(noise_index), [1, 1, 86, 170, 255, 255, 0]);
        let [noise, signed] = palettes();
        let colour = |palette: &str, index: usize| palette[6 * index..6 * index + 6].to_string();
        assert_eq!(
            [0, 1, 128, 255].map(|i| colour(&signed, i)),
            ["808080", "053061", "f7f7f7", "67001f"]
        );
        assert_eq!(
            [0, 1, 128, 255].map(|i| colour(&noise, i)),
            ["808080", "440154", "21918c", "fde725"]
        );
        assert_eq!((noise.len(), signed.len()), (1536, 1536));
    }

    #[test]
    fn noise_is_ordered_by_lightness() {
        let lightness = |i: i32| {
            let [r, g, b] = sequential(f64::from(i) / 254.0).map(f64::from);
            0.2126 * (r / 255.0).powf(2.2)
                + 0.7152 * (g / 255.0).powf(2.2)
                + 0.0722 * (b / 255.0).powf(2.2)
        };
        assert!((0..254).all(|i| lightness(i + 1) >= lightness(i) - 1e-3));
        assert!(lightness(254) > 30.0 * lightness(0));
    }

    #[test]
    fn ranges_hold_most() {
        let some = |n: usize, large: f64| (0..100).map(move |i| if i < n { large } else { -0.02 });
        assert_eq!([limit(some(0, 0.0)), limit(some(5, 0.5)), limit(some(6, 0.5))], [0.03, 0.03, 1.0]);
        assert_eq!([limit([f64::INFINITY, f64::NAN].into_iter()), limit([].into_iter())], [1.0, 0.01]);
    }
}
