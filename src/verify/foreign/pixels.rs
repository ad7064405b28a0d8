//! Per pixel: moments of the seeds, scores against a record's pixels, and one test of all of them.

use super::images::Planes;
use crate::results::image::Picture;
use crate::stats::hypothesis::Estimate;
use crate::stats::tails::{critical_value, student_two_sided};

/// The image is cut into this many blocks a side for [`squared_bias`].
const BLOCKS: usize = 8;

/// Largest |z| shown; p-values end there.
const LARGEST_Z: f64 = 37.0;

/// One band of both sides.
pub(super) struct BandImages<'a> {
    pub width: usize,
    pub height: usize,
    /// Values of the images, `[seed][pixel]`.
    pub theirs: Vec<&'a [f64]>,
    /// The record's mean and standard error.
    pub ours: Vec<f64>,
    pub ours_error: Vec<f64>,
    /// Of the record's errors.
    pub ours_dof: f64,
    pub rounding: f64,
}

impl<'a> BandImages<'a> {
    pub(super) fn of(planes: &'a Planes, picture: &Picture, band: usize, passes: u64) -> BandImages<'a> {
        BandImages {
            width: planes.width,
            height: planes.height,
            theirs: planes.seeds.iter().map(|seed| seed[band].as_slice()).collect(),
            ours: picture.mean(band).collect(),
            ours_error: picture.std_error(band).collect(),
            ours_dof: passes as f64 - 1.0,
            rounding: planes.rounding,
        }
    }

    pub(super) fn seeds(&self) -> f64 {
        self.theirs.len() as f64
    }

    /// Mean over seeds.
    pub(super) fn mean(&self, pixel: usize) -> f64 {
        self.theirs.iter().map(|seed| seed[pixel]).sum::<f64>() / self.seeds()
    }

    /// Sum over seeds of squared deviations from their mean.
    pub(super) fn squares(&self, pixel: usize) -> f64 {
        let mean = self.mean(pixel);
        self.theirs.iter().map(|seed| (seed[pixel] - mean) * (seed[pixel] - mean)).sum()
    }

    /// Variance of the mean over seeds.
    pub(super) fn variance(&self, pixel: usize) -> f64 {
        self.squares(pixel) / (self.seeds() * (self.seeds() - 1.0))
    }

    /// Standard error of the mean over seeds, arithmetic included.
    pub(super) fn std_error(&self, pixel: usize) -> f64 {
        let rounding = self.rounding * self.mean(pixel);
        (self.variance(pixel) + rounding * rounding).sqrt()
    }

    /// The difference at a pixel with both errors. It has the fewer of both sides' degrees of freedom:
    /// with these Student's t bounds the tails for every ratio of the two variances (M. Mickey, M.
    /// Brown, "Bounds on the distribution functions of the Behrens-Fisher statistic", 1966). The number
    /// that Satterthwaite estimates is too large where a few seeds agree by chance.
    pub(super) fn difference(&self, pixel: usize) -> Estimate {
        let (a, b) = (self.std_error(pixel), self.ours_error[pixel]);
        let dof = self.ours_dof.min(self.seeds() - 1.0);
        let value = self.mean(pixel) - self.ours[pixel];
        Estimate { value, std_error: (a * a + b * b).sqrt(), dof }
    }

    /// The score of a pixel: the normal value with the p-value and sign of its t test; 0 where both
    /// sides are the same, without any error.
    pub(super) fn z(&self, pixel: usize) -> f64 {
        let difference = self.difference(pixel);
        if difference.value == 0.0 {
            return 0.0;
        }
        let t = difference.value / difference.std_error;
        if !t.is_finite() {
            return if t.is_nan() { t } else { LARGEST_Z.copysign(t) };
        }
        let p = student_two_sided(t, difference.dof);
        let z = if p > 0.0 { critical_value(p, f64::INFINITY).min(LARGEST_Z) } else { LARGEST_Z };
        z.copysign(difference.value)
    }

    /// Where a value is not a number that can be judged.
    pub(super) fn not_finite(&self) -> Option<String> {
        let bad = |x: &f64| !x.is_finite();
        let found = self.theirs.iter().enumerate().find_map(|(k, seed)| {
            let pixel = seed.iter().position(bad)?;
            Some((k, pixel, seed.iter().filter(|x| bad(x)).count()))
        });
        if let Some((seed, pixel, count)) = found {
            let (row, column) = (pixel / self.width, pixel % self.width);
            return Some(format!(
                "image {} holds {count} values that are not finite, the first at row {row}, column \
                 {column}",
                seed + 1
            ));
        }
        let ours = self.ours.iter().chain(&self.ours_error).any(bad);
        ours.then(|| "the record's image holds a value that is not finite".to_string())
    }

    /// The share of the pixels' squared deviations that one pixel holds, among these.
    pub(super) fn largest_share(&self, pixels: &[usize]) -> f64 {
        let squares: Vec<f64> = pixels.iter().map(|&i| self.squares(i)).collect();
        let sum: f64 = squares.iter().sum();
        if sum > 0.0 { squares.iter().fold(0.0, |a: f64, b| a.max(*b)) / sum } else { 0.0 }
    }
}

/// The mean over pixels of the squared bias, its noise, and the statistic that tests it.
pub(super) struct SquaredBias {
    /// Unbiased: may be below 0 by chance where there is no bias.
    pub mean: f64,
    /// Standard deviation of the estimate without bias.
    pub noise: f64,
    /// Number of blocks that hold anything.
    pub terms: f64,
}

/// The squared bias of the pixels, from products of different seeds.
///
/// With x_k the value of seed k, m the record's with error s, d_k = x_k - m and bias b:
/// E[d_k d_l] = b^2 + E[s^2] for k != l, whatever the distributions, since the seeds are independent of
/// each other and of the record. So u = mean over k != l of d_k d_l, less s^2, has expectation b^2 at
/// every pixel, and no estimated variance of a few seeds enters it. The sums of u over 8 x 8 blocks of
/// the image are independent where noise does not reach across blocks, and symmetric about 0 without
/// bias up to the skewness of s^2. A bias as small as the other renderer's rounding is taken off too.
pub(super) fn squared_bias(band: &BandImages) -> SquaredBias {
    let seeds = band.seeds();
    let mut blocks = vec![0.0; BLOCKS * BLOCKS];
    for (pixel, ours) in band.ours.iter().enumerate() {
        let sum: f64 = band.theirs.iter().map(|seed| seed[pixel] - ours).sum();
        let squares: f64 =
            band.theirs.iter().map(|seed| (seed[pixel] - ours) * (seed[pixel] - ours)).sum();
        let error = band.ours_error[pixel];
        let rounding = band.rounding * ours;
        let own = error * error + rounding * rounding;
        let u = (sum * sum - squares) / (seeds * (seeds - 1.0)) - own;
        let row = pixel / band.width * BLOCKS / band.height;
        let column = pixel % band.width * BLOCKS / band.width;
        blocks[row * BLOCKS + column] += u;
    }
    let pixels = band.ours.len() as f64;
    let sum: f64 = blocks.iter().sum();
    let noise = blocks.iter().map(|b| b * b).sum::<f64>().sqrt();
    let terms = blocks.iter().filter(|b| **b != 0.0).count() as f64;
    SquaredBias { mean: sum / pixels, noise: noise / pixels, terms }
}

/// How the image would have to be turned to fit better, where turning it would at least halve the
/// squared difference.
pub(super) fn orientation(band: &BandImages) -> Option<&'static str> {
    let (width, height) = (band.width, band.height);
    let distance = |turned: &dyn Fn(usize, usize) -> (usize, usize)| -> f64 {
        let pixels = (0..height).flat_map(|row| (0..width).map(move |column| (row, column)));
        let square = |(row, column): (usize, usize)| {
            let (r, c) = turned(row, column);
            let d = band.mean(r * width + c) - band.ours[row * width + column];
            d * d
        };
        pixels.map(square).sum()
    };
    let as_is = distance(&|r, c| (r, c));
    let others = [
        ("upside down", distance(&|r, c| (height - 1 - r, c))),
        ("mirrored left to right", distance(&|r, c| (r, width - 1 - c))),
        ("turned by 180 degrees", distance(&|r, c| (height - 1 - r, width - 1 - c))),
    ];
    let best = others.into_iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    (best.1 < 0.5 * as_is).then_some(best.0)
}
