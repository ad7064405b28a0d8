//! Moments that merge without loss of accuracy.
//!
//! For a sample with mean m, let Mp = sum (x_i - m)^p. Join samples A and B, n = nA + nB and
//! d = mB - mA. Then m - mA = d nB/n and mB - m = d nA/n, and expanding
//! sum (x_i - m)^p = sum_A ((x_i - mA) - d nB/n)^p + sum_B ((x_i - mB) + d nA/n)^p
//! with sum (x_i - mA) = sum (x_i - mB) = 0 gives the formulas below, in which no large numbers cancel.
//! p = 2: T. Chan, G. Golub, R. LeVeque, "Updating formulae and a pairwise algorithm for computing
//! sample variances" (1979). p = 3, 4: P. Pebay, SAND2008-6212 (2008), eqs. 2.1 and 2.2 with p = 3, 4.

use serde::{Deserialize, Serialize};

use super::tree::Merge;

/// Count, mean, and the sums of second, third and fourth powers of deviations from the mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moments {
    /// Number of values.
    pub n: u64,
    /// Mean of the values.
    pub mean: f64,
    /// Sum of squared deviations.
    pub m2: f64,
    /// Sum of cubed deviations.
    pub m3: f64,
    /// Sum of fourth powers of deviations.
    pub m4: f64,
}

impl Moments {
    /// The moments of one value.
    pub fn of(x: f64) -> Moments {
        Moments { n: 1, mean: x, m2: 0.0, m3: 0.0, m4: 0.0 }
    }

    /// Adds one value: the same bits as merging `Moments::of(x)`.
    pub fn push(&mut self, x: f64) {
        *self = self.merge(Moments::of(x));
    }

    /// As a record's observables array'stores them: `[n, mean, m2, m3, m4]`.
    pub fn to_array(&self) -> [f64; 5] {
        [self.n as f64, self.mean, self.m2, self.m3, self.m4]
    }

    /// The inverse of [`Moments::to_array`].
    pub fn from_array(a: [f64; 5]) -> Moments {
        Moments { n: a[0] as u64, mean: a[1], m2: a[2], m3: a[3], m4: a[4] }
    }

    /// Unbiased variance of one value; NaN for fewer than two.
    pub fn variance(&self) -> f64 {
        if self.n < 2 { f64::NAN } else { self.m2 / (self.n - 1) as f64 }
    }

    /// Standard error of the mean; NaN for fewer than two values.
    pub fn std_error(&self) -> f64 {
        (self.variance() / self.n as f64).sqrt()
    }

    /// Skewness sqrt(n) M3 / M2^(3/2); 0 where all values are equal.
    pub fn skewness(&self) -> f64 {
        if self.m2 == 0.0 { 0.0 } else { (self.n as f64).sqrt() * self.m3 / (self.m2 * self.m2.sqrt()) }
    }

    /// Kurtosis n M4 / M2^2 (3 for a normal); NaN where all values are equal.
    pub fn kurtosis(&self) -> f64 {
        self.n as f64 * self.m4 / (self.m2 * self.m2)
    }
}

impl Merge for Moments {
    fn merge(self, later: Moments) -> Moments {
        let (a, b) = (self, later);
        if a.n == 0 || b.n == 0 {
            return if a.n == 0 { b } else { a };
        }
        let n = a.n + b.n;
        let (na, nb, nn) = (a.n as f64, b.n as f64, n as f64);
        let d = b.mean - a.mean;
        let (d_n, d2) = (d / nn, d * d);
        let (mean, m2) = merge_two((na, a.mean, a.m2), (nb, b.mean, b.m2));
        let m3 =
            a.m3 + b.m3 + d * d2 * na * nb * (na - nb) / (nn * nn) + 3.0 * d_n * (na * b.m2 - nb * a.m2);
        let m4 = a.m4
            + b.m4
            + d2 * d2 * na * nb * (na * na - na * nb + nb * nb) / (nn * nn * nn)
            + 6.0 * d_n * d_n * (na * na * b.m2 + nb * nb * a.m2)
            + 4.0 * d_n * (na * b.m3 - nb * a.m3);
        Moments { n, mean, m2, m3, m4 }
    }
}

/// Mean and M2 of two joined samples, each given as (n, mean, M2).
#[inline]
fn merge_two((na, mean_a, m2_a): (f64, f64, f64), (nb, mean_b, m2_b): (f64, f64, f64)) -> (f64, f64) {
    let (n, d) = (na + nb, mean_b - mean_a);
    (mean_a + d * nb / n, m2_a + m2_b + d * d * (na * nb / n))
}

/// Mean and M2 of every pixel of an image, all with the same count.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ImageMoments {
    /// Number of values of each pixel.
    pub n: u64,
    /// Mean of each component.
    pub mean: Vec<f64>,
    /// Sums of squared deviations.
    pub m2: Vec<f64>,
}

impl ImageMoments {
    /// One realisation of the image.
    pub fn of(values: Vec<f64>) -> ImageMoments {
        ImageMoments { n: 1, m2: vec![0.0; values.len()], mean: values }
    }

    /// Standard error of the mean of every pixel; NaN for fewer than two values.
    pub fn std_error(&self) -> Vec<f64> {
        let per_m2 = if self.n < 2 { f64::NAN } else { 1.0 / ((self.n - 1) as f64 * self.n as f64) };
        self.m2.iter().map(|m2| (m2 * per_m2).sqrt()).collect()
    }
}

impl Merge for ImageMoments {
    fn merge(mut self, later: ImageMoments) -> ImageMoments {
        if self.n == 0 || later.n == 0 {
            return if self.n == 0 { later } else { self };
        }
        assert_eq!(self.mean.len(), later.mean.len(), "images of one size");
        let (na, nb) = (self.n as f64, later.n as f64);
        for i in 0..self.mean.len() {
            let (a, b) = ((na, self.mean[i], self.m2[i]), (nb, later.mean[i], later.m2[i]));
            (self.mean[i], self.m2[i]) = merge_two(a, b);
        }
        self.n += later.n;
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DATA: [f64; 7] = [1.0, 2.5, 3.25, 0.5, 9.0, 4.0, 4.5];

    fn moments(data: &[f64]) -> Moments {
        let mut m = Moments::default();
        data.iter().for_each(|x| m.push(*x));
        m
    }

    fn close(a: f64, b: f64, relative: f64) {
        assert!((a - b).abs() <= relative * b.abs(), "{a} is not {b}");
    }

    // scipy 1.x on DATA: mean(), var(ddof=1), stats.skew, stats.kurtosis(fisher=False).
    #[test]
    fn agrees_with_scipy() {
        let m = moments(&DATA);
        close(m.mean, 3.5357142857142856, 1e-15);
        close(m.variance(), 7.967261904761904, 1e-15);
        close(m.skewness(), 0.950485446210956, 1e-14);
        close(m.kurtosis(), 3.1240589847326303, 1e-14);
    }

    #[test]
    fn merging_any_cut_keeps_every_moment() {
        let whole = moments(&DATA);
        for cut in 0..=DATA.len() {
            let joined = moments(&DATA[..cut]).merge(moments(&DATA[cut..]));
            assert_eq!(joined.n, whole.n);
            for (a, b) in joined.to_array().iter().zip(whole.to_array()) {
                close(*a, b, 1e-13);
            }
        }
    }

    // Mean 1e9, standard deviation 1: E[x^2] - E[x]^2 would have lost every digit.
    #[test]
    fn survives_a_large_offset() {
        let m = moments(&DATA.map(|x| x + 1e9));
        close(m.variance(), 7.967261904761904, 1e-6);
    }

    #[test]
    fn equal_values_have_exactly_no_variance() {
        let m = moments(&[0.1; 1000]);
        assert_eq!((m.mean, m.m2, m.skewness()), (0.1, 0.0, 0.0));
        assert!(Moments::of(1.0).std_error().is_nan());
    }

    #[test]
    fn an_image_is_its_pixels() {
        let images = [[1.0, 5.0], [2.0, 3.0], [4.0, 3.5]];
        let image = images.map(|i| ImageMoments::of(i.to_vec())).into_iter().reduce(Merge::merge);
        let image = image.expect("three images");
        for pixel in 0..2 {
            let m = moments(&images.map(|i| i[pixel]));
            assert_eq!((image.mean[pixel], image.m2[pixel]), (m.mean, m.m2));
            close(image.std_error()[pixel], m.std_error(), 1e-15);
        }
    }
}
