//! Real roots of polynomials on [0, 1], none lost: Bernstein form, the rule of signs, and subdivision.
//!
//! In Bernstein form, p(t) = sum_i c_i B_i(t), the number of roots in (0, 1) is at most the number of
//! sign changes of the c_i, and differs from it by an even number (the variation diminishing property;
//! Lane & Riesenfeld 1981, "Bounds on a polynomial"). So no change means no root, and one change means
//! exactly one. Everything else is cut in halves by de Casteljau's algorithm, whose steps are means:
//! rounding stays at the size of the c_i.

use crate::math::bracketed_root;

/// Degree of the polynomials that are solved here.
pub(super) const DEGREE: usize = 6;

/// Bernstein coefficients on [0, 1].
pub(super) type BernsteinForm = [f64; DEGREE + 1];

/// Halvings after which what still changes its sign more than once is one candidate: a multiple root to
/// rounding.
const HALVINGS: u32 = 40;

/// Length of an interval on which a polynomial of separate roots does not vanish: a double root spoils
/// the square root of the precision, 2^-26.
const WIDE: f64 = 1.0 / (1 << 24) as f64;

/// The polynomial's value.
#[cfg(test)]
fn value(coefficients: &BernsteinForm, t: f64) -> f64 {
    let mut c = *coefficients;
    for end in (1..=DEGREE).rev() {
        for i in 0..end {
            c[i] += (c[i + 1] - c[i]) * t;
        }
    }
    c[0]
}

/// Cuts a polynomial in two at the middle: the coefficients on [0, 1/2] and on [1/2, 1].
fn halves<const N: usize>(coefficients: &[f64; N]) -> [[f64; N]; 2] {
    let mut c = *coefficients;
    let (mut left, mut right) = (*coefficients, *coefficients);
    for end in (1..N).rev() {
        for i in 0..end {
            c[i] = 0.5 * (c[i] + c[i + 1]);
        }
        left[N - end] = c[0];
        right[end - 1] = c[end - 1];
    }
    [left, right]
}

/// What the coefficients' signs state about roots inside.
enum Signs {
    /// No root.
    None,
    /// Exactly one.
    One,
    /// Rounding decides, or there may be several.
    Unknown,
    /// All coefficients are 0 to rounding.
    Zero,
}

/// By the rule of signs, where it holds whatever coefficients below `noise` are: one such coefficient
/// between opposite signs changes nothing.
fn signs(coefficients: &BernsteinForm, noise: f64) -> Signs {
    let (mut count, mut last, mut run) = (0, 0.0f64, 0);
    for &c in coefficients {
        if c.abs() <= noise {
            run += 1;
            continue;
        }
        let changes = last * c < 0.0;
        if run > 1 || run == 1 && !changes {
            return Signs::Unknown;
        }
        count += usize::from(changes);
        (last, run) = (c.signum(), 0);
    }
    match (count, run) {
        (_, run) if run == DEGREE + 1 => Signs::Zero,
        (0, 0) => Signs::None,
        (1, 0) => Signs::One,
        _ => Signs::Unknown,
    }
}

/// The polynomial vanishes, to rounding, on more than a point: roots of high order, which it cannot tell
/// apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Degenerate;

/// Polynomials of degree 3 at most that must have one sign, all of them, where a root counts.
pub(super) type Conditions<const N: usize> = [[f64; 4]; N];

/// Calls `found` for every root in [0, 1] at which the conditions may hold, and for the middle of every
/// interval shorter than 2^-40 in which rounding leaves it open whether there are roots. `noise` bounds
/// the rounding of the coefficients. A double root to rounding is found once, twice or
/// not; a root at which an interval is cut may be found twice, 2^-40 apart.
///
/// # Errors
/// Where the polynomial vanishes on an interval longer than 2^-24.
pub(super) fn roots<const N: usize>(
    coefficients: &BernsteinForm,
    noise: f64,
    conditions: &Conditions<N>,
    found: &mut impl FnMut(f64),
) -> Result<(), Degenerate> {
    isolate(coefficients, noise, conditions, [0.0, 1.0], HALVINGS, found)
}

/// Whether conditions have opposite signs all over the interval.
pub(super) fn excludes<const N: usize>(conditions: &Conditions<N>) -> bool {
    let is = |sign: f64| move |c: &[f64; 4]| c.iter().all(|c| c * sign > 0.0);
    conditions.iter().any(is(1.0)) && conditions.iter().any(is(-1.0))
}

fn isolate<const N: usize>(
    c: &BernsteinForm,
    noise: f64,
    conditions: &Conditions<N>,
    [from, size]: [f64; 2],
    halvings: u32,
    found: &mut impl FnMut(f64),
) -> Result<(), Degenerate> {
    if excludes(conditions) {
        return Ok(());
    }
    match signs(c, noise) {
        Signs::None => {}
        Signs::One => found(from + size * single_root(c)),
        Signs::Zero if size > WIDE => return Err(Degenerate),
        _ if halvings == 0 => found(from + 0.5 * size),
        _ => {
            let [left, right] = halves(c);
            let half = 0.5 * size;
            let parts = conditions.map(|c| halves(&c));
            isolate(&left, noise, &parts.map(|[l, _]| l), [from, half], halvings - 1, found)?;
            isolate(&right, noise, &parts.map(|[_, r]| r), [from + half, half], halvings - 1, found)?;
        }
    }
    Ok(())
}

/// Value and derivative.
fn value_and_slope(coefficients: &BernsteinForm, t: f64) -> (f64, f64) {
    let mut c = *coefficients;
    for end in (2..=DEGREE).rev() {
        for i in 0..end {
            c[i] += (c[i + 1] - c[i]) * t;
        }
    }
    let change = c[1] - c[0];
    (c[0] + change * t, DEGREE as f64 * change)
}

/// The root where the coefficients change their sign once, to rounding.
fn single_root(c: &BernsteinForm) -> f64 {
    let is_rising = c.iter().rev().find(|c| **c != 0.0).is_some_and(|last| *last > 0.0);
    let secant = c[0] / (c[0] - c[DEGREE]);
    let start = if secant > 0.0 && secant < 1.0 { secant } else { 0.5 };
    bracketed_root(|t| value_and_slope(c, t), [0.0, 1.0], is_rising, start)
}

/// A parabola in Bernstein form of degree 3.
pub(super) fn parabola([p, q, r]: [f64; 3]) -> [f64; 4] {
    [p, (p + 2.0 * q) / 3.0, (2.0 * q + r) / 3.0, r]
}

/// Binomials of the degrees in use, `BINOMIALS[n][i]`.
const BINOMIALS: [[f64; 7]; 7] = [
    [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0],
    [1.0, 3.0, 3.0, 1.0, 0.0, 0.0, 0.0],
    [1.0, 4.0, 6.0, 4.0, 1.0, 0.0, 0.0],
    [1.0, 5.0, 10.0, 10.0, 5.0, 1.0, 0.0],
    [1.0, 6.0, 15.0, 20.0, 15.0, 6.0, 1.0],
];

/// Adds `factor` times the product of two polynomials, in Bernstein form, to one of degree [`DEGREE`];
/// the product is raised to it (by a factor 1 of the degree that is missing).
#[inline]
pub(super) fn add_product(sum: &mut BernsteinForm, factor: f64, p: &[f64], q: &[f64]) {
    let (m, n) = (p.len() - 1, q.len() - 1);
    let missing = DEGREE - m - n;
    let mut product = [0.0; DEGREE + 1];
    for (i, p) in p.iter().enumerate() {
        for (j, q) in q.iter().enumerate() {
            let part = BINOMIALS[m][i] * BINOMIALS[n][j] * p * q;
            for (k, raise) in BINOMIALS[missing][..=missing].iter().enumerate() {
                product[i + j + k] += part * raise;
            }
        }
    }
    for (at, product) in product.iter().enumerate() {
        sum[at] += factor * product / BINOMIALS[DEGREE][at];
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// prod (t - r_i), from linear factors in Bernstein form.
    fn with_roots(roots: &[f64; DEGREE]) -> BernsteinForm {
        let mut product = vec![1.0];
        for root in roots {
            let n = product.len() - 1;
            let mut raised = vec![0.0; n + 2];
            for (i, c) in product.iter().enumerate() {
                // B_i^n times (1 - t) or t.
                let share = BINOMIALS[n][i];
                raised[i] += -root * c * share / BINOMIALS[n + 1][i];
                raised[i + 1] += (1.0 - root) * c * share / BINOMIALS[n + 1][i + 1];
            }
            product = raised;
        }
        std::array::from_fn(|i| product[i])
    }

    fn solve(c: &BernsteinForm) -> Vec<f64> {
        let mut all = Vec::new();
        let noise = 1e-15 * c.iter().fold(0.0f64, |most, c| most.max(c.abs()));
        roots::<0>(c, noise, &[], &mut |t| all.push(t)).expect("separate roots");
        all.sort_by(f64::total_cmp);
        // A root at the end of two intervals is found in both.
        all.dedup_by(|a, b| (*a - *b).abs() < 1e-11);
        all
    }

    #[test]
    fn all_roots_are_found_and_no_others() {
        let sets = [
            [0.1, 0.2, 0.3, 0.5, 0.7, 0.9],
            [-0.5, 0.2, 0.200001, 0.7, 1.5, 2.0],
            [-3.0, -2.0, -1.0, 1.5, 2.0, 3.0],
            [0.5, -1.0, -2.0, 3.0, 4.0, 5.0],
            [0.25, 0.75, 1.25, 1.75, -0.25, -0.75],
        ];
        for set in sets {
            let inside: Vec<f64> = set.into_iter().filter(|r| (0.0..=1.0).contains(r)).collect();
            let got = solve(&with_roots(&set));
            assert_eq!(got.len(), inside.len(), "{set:?}: {got:?}");
            for (got, expected) in got.iter().zip(inside) {
                assert!((got - expected).abs() < 1e-9, "{set:?}: {got}");
            }
        }
    }

    /// Roots at the ends, a double root (which rounding may part or remove), and the zero polynomial,
    /// which has candidates and no end.
    #[test]
    fn special_cases() {
        let ends = solve(&with_roots(&[0.0, 1.0, 2.0, 3.0, -1.0, -2.0]));
        assert!(ends.len() <= 2);
        assert!(
            ends.first().is_some_and(|t| *t < 1e-12) && ends.last().is_some_and(|t| *t > 1.0 - 1e-12)
        );
        let double = solve(&with_roots(&[0.5, 0.5, 2.0, 3.0, -1.0, -2.0]));
        assert!(double.iter().all(|t| (t - 0.5).abs() < 1e-6), "{double:?}");
        assert_eq!(roots::<0>(&[0.0; 7], 0.0, &[], &mut |_| {}), Err(Degenerate));
        let four = with_roots(&[0.3, 0.3, 0.3, 0.3, 2.0, 3.0]);
        assert_eq!(roots::<0>(&four, 1e-15, &[], &mut |_| {}), Err(Degenerate));
        assert!(solve(&[1.0, 0.5, 0.2, 0.1, 0.2, 0.4, 1.0]).is_empty());
    }

    /// Roots where conditions contradict each other are left out.
    #[test]
    fn conditions_exclude() {
        let c = with_roots(&[0.1, 0.2, 0.3, 0.5, 0.7, 0.9]);
        // Positive beyond 0.4; positive everywhere.
        let line = [-0.4, -0.4 + 1.0 / 3.0, -0.4 + 2.0 / 3.0, 0.6];
        let mut all = Vec::new();
        roots(&c, 1e-16, &[line, [1.0; 4]], &mut |t| all.push(t)).expect("separate roots");
        all.retain(|t| *t < 0.35 || *t > 0.45);
        assert!((3..=4).contains(&all.len()) && all.iter().all(|t| *t > 0.25), "{all:?}");
    }

    #[test]
    fn products_are_products() {
        let (p, q) = ([0.3, -1.0, 2.0], [1.0, 0.5]);
        let mut product = [0.0; 7];
        add_product(&mut product, 2.0, &p, &q);
        for i in 0..=10 {
            let t = f64::from(i) / 10.0;
            let s = 1.0 - t;
            let expected =
                2.0 * (s * s * p[0] + 2.0 * s * t * p[1] + t * t * p[2]) * (s * q[0] + t * q[1]);
            assert!((value(&product, t) - expected).abs() < 1e-15);
            let (f, slope) = value_and_slope(&product, t);
            assert!((f - expected).abs() < 1e-15, "{f} {expected}");
            let by_differences = (value(&product, t + 1e-6) - value(&product, t - 1e-6)) / 2e-6;
            assert!((slope - by_differences).abs() < 1e-8, "{slope} {by_differences}");
            let square: f64 = (0..4)
                .map(|k| BINOMIALS[3][k] * s.powi(3 - k as i32) * t.powi(k as i32) * parabola(p)[k])
                .sum();
            assert!((2.0 * square * (s + 0.5 * t) - expected).abs() < 1e-15);
            let [left, right] = halves(&product);
            assert!((value(&left, t) - value(&product, 0.5 * t)).abs() < 1e-15);
            assert!((value(&right, t) - value(&product, 0.5 + 0.5 * t)).abs() < 1e-15);
        }
    }
}
