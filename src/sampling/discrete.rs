//! Discrete choices: one uniform number chooses an index, and is rescaled to a uniform number again.

/// The largest number below 1.
const BELOW_ONE: f64 = 1.0 - 0.5 * f64::EPSILON;

/// The first of two techniques with probability `share` (in [0, 1]), and `u` stretched back over [0, 1).
#[inline]
pub fn choose(u: f64, share: f64) -> (bool, f64) {
    if u < share {
        (true, (u / share).min(BELOW_ONE))
    } else {
        (false, ((u - share) / (1.0 - share)).min(BELOW_ONE))
    }
}

/// The index that `u` selects out of shares that sum to 1, and its share.
#[inline]
pub fn choose_share(shares: impl Iterator<Item = f64>, u: f64) -> Option<(usize, f64)> {
    let mut rest = u;
    let mut last = None;
    for (index, share) in shares.enumerate() {
        if rest < share {
            return Some((index, share));
        }
        rest -= share;
        if share > 0.0 {
            last = Some((index, share));
        }
    }
    last // rounding of the sum
}

/// A choice by its distribution function: exact at both ends, O(log n).
#[derive(Clone, Debug, PartialEq)]
pub struct Cumulative {
    /// Where the interval of every index ends; 1 from the last index of positive weight on.
    ends: Vec<f64>,
}

impl Cumulative {
    /// Indices in proportion to `weights`; `None` unless they are finite, none is negative, and their
    /// sum is positive and finite.
    pub fn new(weights: &[f64]) -> Option<Cumulative> {
        let total: f64 = weights.iter().sum();
        let are_weights = weights.iter().all(|w| w.is_finite() && *w >= 0.0);
        if !(are_weights && total > 0.0 && total.is_finite()) {
            return None;
        }
        let last = weights.iter().rposition(|&w| w > 0.0)?;
        let mut sum = 0.0;
        let end = |(i, w): (usize, &f64)| {
            sum += w;
            if i >= last { 1.0 } else { (sum / total).min(1.0) }
        };
        Some(Cumulative { ends: weights.iter().enumerate().map(end).collect() })
    }

    /// The index that `u` selects, never one of weight 0, and `u` stretched from its interval to [0, 1).
    #[inline]
    pub fn sample(&self, u: f64) -> (usize, f64) {
        // The last end is 1 and u < 1.
        let index = self.ends.partition_point(|&end| end <= u).min(self.ends.len() - 1);
        let begin = self.begin(index);
        (index, ((u - begin) / (self.ends[index] - begin)).min(BELOW_ONE))
    }

    /// The probability of an index: the length of its interval, to the last bit what is drawn.
    #[inline]
    pub fn probability(&self, index: usize) -> f64 {
        self.ends[index] - self.begin(index)
    }

    /// Density of a sample whose technique (or hero band) was picked by this table, `pdfs` being what
    /// each of them has there: sum of P_m p_m, the denominator of the balance heuristic over one sample
    /// (Veach & Guibas 1995; over hero wavelengths Wilkie et al. 2014).
    pub fn mixture_pdf(&self, pdfs: impl IntoIterator<Item = f64>) -> f64 {
        pdfs.into_iter().enumerate().map(|(index, pdf)| self.probability(index) * pdf).sum()
    }

    /// How many indices there are.
    pub fn count(&self) -> usize {
        self.ends.len()
    }

    #[inline]
    fn begin(&self, index: usize) -> f64 {
        if index == 0 { 0.0 } else { self.ends[index - 1] }
    }
}

/// A choice in constant time (Walker 1977, in Vose's 1991 form): slot k keeps its own index with the
/// probability in it, else gives the other one.
#[derive(Clone, Debug, PartialEq)]
pub struct AliasTable {
    slots: Vec<(f64, u32)>,
}

impl AliasTable {
    /// Indices in proportion to `weights`, finite and not negative; all alike if all are 0.
    pub fn new(weights: &[f64]) -> AliasTable {
        let total: f64 = weights.iter().sum();
        let n = weights.len();
        let mut slots: Vec<(f64, u32)> = (0..n).map(|k| (1.0, k as u32)).collect();
        if total == 0.0 {
            return AliasTable { slots };
        }
        let mut share: Vec<f64> = weights.iter().map(|w| w / total * n as f64).collect();
        let (mut small, mut large): (Vec<usize>, Vec<usize>) = (0..n).partition(|&k| share[k] < 1.0);
        while let (Some(&s), Some(&l)) = (small.last(), large.last()) {
            small.pop();
            slots[s] = (share[s], l as u32);
            share[l] -= 1.0 - share[s];
            if share[l] < 1.0 {
                large.pop();
                small.push(l);
            }
        }
        // Rounding can leave a small slot without a partner: it keeps itself, unless it has no weight.
        for s in small {
            if weights[s] == 0.0 {
                let heaviest = (0..n).max_by(|&a, &b| weights[a].total_cmp(&weights[b])).unwrap_or(s);
                slots[s] = (0.0, heaviest as u32);
            }
        }
        AliasTable { slots }
    }

    /// The index that `u` selects, and what is left of `u`, uniform in [0, 1].
    #[inline]
    pub fn sample(&self, u: f64) -> (usize, f64) {
        let scaled = u * self.slots.len() as f64;
        let slot = (scaled as usize).min(self.slots.len() - 1);
        let rest = scaled - slot as f64;
        let (stay, other) = self.slots[slot];
        if rest < stay { (slot, rest / stay) } else { (other as usize, (rest - stay) / (1.0 - stay)) }
    }

    /// Memory behind the table, bytes.
    pub fn heap_bytes(&self) -> usize {
        size_of_val(&*self.slots)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WEIGHTS: [&[f64]; 5] =
        [&[1.0], &[0.0, 2.0, 0.0], &[0.2, 0.3, 0.5], &[1e-9, 0.0, 1.0, 3.0, 0.0], &[0.1; 10]];

    const ENDS: [f64; 3] = [0.0, 1.0 / (1 << 24) as f64, BELOW_ONE];

    /// D3: both tables give every index its share of 2^16 numbers, and never one of weight 0, ends
    /// included.
    #[test]
    fn shares_by_enumeration() {
        let n = 1u32 << 16;
        for weights in WEIGHTS {
            let total: f64 = weights.iter().sum();
            let cumulative = Cumulative::new(weights).expect("weights");
            let alias = AliasTable::new(weights);
            let mut counts = vec![[0u32; 2]; weights.len()];
            for k in 0..n {
                let u = (f64::from(k) + 0.5) / f64::from(n);
                counts[cumulative.sample(u).0][0] += 1;
                counts[alias.sample(u).0][1] += 1;
            }
            for (i, w) in weights.iter().enumerate() {
                let share = w / total;
                assert!((cumulative.probability(i) - share).abs() < 1e-15);
                // An interval begins and ends between two numbers; an index of the alias table has at
                // most as many intervals as there are slots.
                for (count, intervals) in counts[i].iter().zip([1, weights.len()]) {
                    let error = (f64::from(*count) / f64::from(n) - share).abs();
                    assert!(error <= (intervals + 1) as f64 / f64::from(n), "{weights:?} {i}");
                }
            }
            for u in ENDS {
                assert!(weights[cumulative.sample(u).0] > 0.0 && weights[alias.sample(u).0] > 0.0);
            }
        }
    }

    /// What is left of the number fills [0, 1) evenly inside every index: it can be used again.
    #[test]
    fn the_rest_is_uniform_given_the_index() {
        let weights = [0.2, 0.3, 0.5];
        let tables = (Cumulative::new(&weights).expect("weights"), AliasTable::new(&weights));
        let n = 1u32 << 18;
        let mut bins = [[[0u32; 16]; 3]; 2];
        for k in 0..n {
            let u = (f64::from(k) + 0.5) / f64::from(n);
            for (table, (index, rest)) in
                [tables.0.sample(u), tables.1.sample(u)].into_iter().enumerate()
            {
                assert!((0.0..1.0).contains(&rest));
                bins[table][index][(rest * 16.0) as usize] += 1;
            }
        }
        for table in bins {
            for (row, weight) in table.iter().zip(weights) {
                for &count in row {
                    assert!((f64::from(count) - weight * f64::from(n) / 16.0).abs() <= 4.0);
                }
            }
        }
    }

    #[test]
    fn what_is_no_distribution_is_refused() {
        for weights in [&[][..], &[0.0, 0.0], &[1.0, -0.1], &[f64::NAN], &[f64::INFINITY, 1.0]] {
            assert_eq!(Cumulative::new(weights), None, "{weights:?}");
        }
    }

    /// D3 for the choice of two, and the mixture over a table by hand.
    #[test]
    fn choice_of_two_and_mixture() {
        for share in [0.0, 0.25, 0.7, 1.0] {
            let n = 1u32 << 16;
            let first = (0..n).filter(|&k| choose((f64::from(k) + 0.5) / f64::from(n), share).0).count();
            assert!((first as f64 / f64::from(n) - share).abs() <= 1.0 / f64::from(n));
            for u in ENDS {
                assert!((0.0..1.0).contains(&choose(u, share).1), "{u} {share}");
            }
        }
        assert_eq!(choose(0.25, 0.5), (true, 0.5));
        assert_eq!(choose(0.75, 0.5), (false, 0.5));
        let table = Cumulative::new(&[1.0, 3.0]).expect("weights");
        assert_eq!(table.mixture_pdf([2.0, 4.0]), 0.25 * 2.0 + 0.75 * 4.0);
    }
}
