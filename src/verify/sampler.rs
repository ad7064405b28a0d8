//! What a sampler's record shows: its draws held against the density that it claims.
//!
//! | test | statement | judged by |
//! |---|---|---|
//! | `chi2 coarse`, `chi2 fine` | draws fall into bins as the density's masses say | Pearson |
//! | `serial` | so do pairs of consecutive draws, as the products of masses say | Pearson |
//! | `contrast NAME` | the mean of a function of the draw | Student's t |
//! | `delta NAME` | a discrete outcome has its probability, and its value | exact binomial |
//! | `null` | the sampler returns nothing as often as is stated; never, where that is stated | exact binomial, or none |
//! | `identity D5` | each draw's own density is the density function's, to 1e-9 | none differs |
//! | `identity D7` | density, discrete masses and stated null sum to 1 | certified quadrature |
//! | `outside` | no draw where the density is 0, or outside the chart | there is none |
//!
//! Masses come with bounds of their quadrature errors. Where those could shift a test by more than
//! `stats::goodness` allows, or D7 by more than 1e-4, the quadrature is unresolved: the test is invalid.

use super::trial::{Claim, Evidence, Fit, Item, Trial};
use super::verdict::Verdict;
use crate::results::record::Record;
use crate::results::sampler::{ContrastRun, Delta, NullMass, OWN_DENSITY, SamplerRun};
use crate::results::store::{Bins, Stored};
use crate::stats::goodness::{Bin, contrast, pearson, proportion};
use crate::stats::hypothesis::Test;
use crate::stats::moments::Moments;

/// Largest bound of the error of the total mass with which its being 1 says more than counts do: those of
/// 1e6 draws see relative errors of 1e-2. The bound itself is the row's `detectable`.
const TOTAL_BOUND: f64 = 1e-4;

/// Sampling errors and deviations of contrasts below this, relative to the value, are rounding.
const ROUNDING: f64 = 1e-12;

/// All that the claims of a record say of samplers.
pub(super) fn trials(stored: &Stored) -> Vec<Trial> {
    let record = &stored.record;
    let claims = record.claims.as_array().map_or(0, Vec::len);
    let of_claim = |index: usize| {
        let words = &record.claims[index]["sampler"];
        let named = words["samplers"].as_array();
        let names = move |run: &&SamplerRun| {
            named.is_none_or(|names| names.iter().any(|name| name == run.sampler.as_str()))
        };
        let runs = record.samplers.iter().filter(move |run| !words.is_null() && names(run));
        runs.flat_map(move |run| Rows::new(stored, index, run).all())
    };
    let missing = (0..claims).flat_map(|index| missing(record, index));
    (0..claims).flat_map(of_claim).chain(missing).collect()
}

/// Samplers that a claim names and the record of a first look does not hold.
fn missing(record: &Record, index: usize) -> Vec<Trial> {
    let names = record.claims[index]["sampler"]["samplers"].as_array().into_iter().flatten();
    let held = |name: &&str| record.samplers.iter().any(|run| run.sampler == *name);
    names
        .filter_map(|name| name.as_str())
        .filter(|name| !held(name) && record.stage == "main")
        .map(|name| {
            let nothing = Evidence::None("the record does not hold this sampler".into());
            blank(record, index, name, "", nothing)
        })
        .collect()
}

fn blank(record: &Record, index: usize, sampler: &str, test: &str, evidence: Evidence) -> Trial {
    let claim = Claim::of(record, index);
    let verdict =
        Verdict { estimators: sampler.into(), test: test.into(), ..super::trial::blank(record, &claim) };
    Trial {
        item: Item::Sampler,
        claim,
        claim_index: index,
        evidence,
        detect: None,
        one_look: false,
        reference: None,
        verdict,
    }
}

/// The rows of one sampler under one claim.
struct Rows<'a> {
    stored: &'a Stored,
    index: usize,
    run: &'a SamplerRun,
    rows: Vec<Trial>,
}

impl<'a> Rows<'a> {
    fn new(stored: &'a Stored, index: usize, run: &'a SamplerRun) -> Rows<'a> {
        Rows { stored, index, run, rows: Vec::new() }
    }

    fn push(&mut self, test: &str, evidence: Evidence) -> &mut Trial {
        let evidence = match self.objection() {
            Some(objection) => Evidence::None(objection),
            None => evidence,
        };
        let trial = blank(&self.stored.record, self.index, &self.run.sampler, test, evidence);
        self.rows.push(trial);
        let last = self.rows.len() - 1;
        &mut self.rows[last]
    }

    /// Why nothing that is said of this sampler is worth anything.
    fn objection(&self) -> Option<String> {
        let (n, values) = (self.run.senseless, self.run.senseless_contrasts);
        if n > 0 {
            return Some(format!(
                "the density is negative or not finite at {n} nodes of the quadrature"
            ));
        }
        (values > 0).then(|| format!("{values} values of contrasts are not finite"))
    }

    fn all(mut self) -> Vec<Trial> {
        let run = self.run;
        self.bins("chi2 coarse", Some(&run.coarse), true);
        self.bins("chi2 fine", run.fine.as_ref(), true);
        self.bins("serial", run.serial.as_ref(), false);
        let detect = self.stored.record.claims[self.index]["sampler"]["detect"].as_f64();
        if let Some(row) = self.rows.iter_mut().find(|row| row.verdict.test == "chi2 coarse") {
            row.detect = detect;
        }
        run.contrasts.iter().for_each(|contrast| self.contrast(contrast));
        run.deltas.iter().for_each(|delta| self.delta(delta));
        self.null();
        self.own_density();
        self.total();
        self.outside();
        self.rows
    }

    fn bins(&mut self, test: &str, path: Option<&String>, is_everything: bool) {
        let Some(path) = path else { return };
        let Some(bins) = self.stored.bins(path) else {
            self.push(test, Evidence::None("the record does not hold its bins".into()));
            return;
        };
        if bins.mass.iter().filter(|mass| **mass > 0.0).count() < 2 {
            return; // one outcome has all the mass: its own row says what there is to say
        }
        let counted: f64 = bins.observed.iter().sum();
        let evidence = if is_everything && counted != self.run.samples as f64 {
            Evidence::None(format!("the bins hold {counted} draws of {}", self.run.samples))
        } else {
            fit(&bins)
        };
        self.push(test, evidence);
    }

    fn contrast(&mut self, run: &ContrastRun) {
        let moments = Moments::from_array(run.moments);
        // What quadrature cannot tell from 0 is 0, and differences from it are absolute.
        let expected = if run.expected.abs() <= run.bound { 0.0 } else { run.expected };
        let rounding = ROUNDING * moments.mean.abs().max(expected.abs());
        let evidence = if moments.n != self.run.samples {
            Evidence::None(format!("{} values for {} draws", moments.n, self.run.samples))
        } else if moments.std_error() <= rounding {
            let holds = (moments.mean - expected).abs() <= run.bound + rounding;
            let said = format!("no sampling error: {:e}, expected {expected:e}", moments.mean);
            Evidence::Exact { holds, said }
        } else {
            match contrast(&moments, expected, run.bound) {
                Ok(found) => Evidence::Test { difference: found.estimate, test: found.test },
                Err(refusal) => Evidence::None(refusal.to_string()),
            }
        };
        let verdict = &mut self.push(&format!("contrast {}", run.name), evidence).verdict;
        (verdict.value, verdict.std_error) = (moments.mean, moments.std_error());
        (verdict.expected, verdict.expected_error) = (expected, run.bound);
    }

    fn delta(&mut self, delta: &Delta) {
        let test = format!("delta {}", delta.name);
        if delta.inexact > 0 {
            let said =
                format!("{} of {} values are not what they have to be", delta.inexact, delta.observed);
            self.push(&test, Evidence::Exact { holds: false, said });
        } else {
            self.share(&test, delta.observed, delta.mass);
        }
    }

    fn null(&mut self) {
        match self.run.null {
            NullMass::Stated(mass) => self.share("null", self.run.nulls, mass),
            NullMass::Never => {
                let said = format!("{} draws returned nothing", self.run.nulls);
                self.push("null", Evidence::Exact { holds: self.run.nulls == 0, said });
            }
            NullMass::Remainder => {} // a bin like others
        }
    }

    fn share(&mut self, test: &str, count: u64, mass: f64) {
        let n = self.run.samples;
        let evidence = match proportion(count, n, mass, 0.0) {
            Ok(found) => {
                let test = Test { statistic: count as f64, dof: f64::NAN, p_value: found.p_value };
                let said = format!("{count} of {n}, expected {:.1}", mass * n as f64);
                Evidence::Fit { fit: Fit::Share(found), test, said }
            }
            Err(refusal) => Evidence::None(refusal.to_string()),
        };
        let share = count as f64 / n as f64;
        let verdict = &mut self.push(test, evidence).verdict;
        (verdict.value, verdict.std_error) = (share, (share * (1.0 - share) / n as f64).sqrt());
        (verdict.expected, verdict.expected_error) = (mass, 0.0);
    }

    fn own_density(&mut self) {
        let (n, largest) = (self.run.own_density_differs, self.run.own_density_largest);
        let said =
            format!("{n} draws whose own density is another; largest relative difference {largest:.1e}");
        let verdict = &mut self.push("identity D5", Evidence::Exact { holds: n == 0, said }).verdict;
        (verdict.statistic, verdict.detectable) = (largest, OWN_DENSITY);
    }

    fn total(&mut self) {
        let (total, bound) = (self.run.total, self.run.total_bound);
        let excess = match self.run.null {
            NullMass::Remainder => total - 1.0,
            NullMass::Never | NullMass::Stated(_) => (total - 1.0).abs(),
        };
        let said = format!("all masses sum to 1{:+.1e}, known to {bound:.1e}", total - 1.0);
        let evidence = if excess > bound || bound <= TOTAL_BOUND {
            Evidence::Exact { holds: excess <= bound, said }
        } else {
            Evidence::None(format!("quadrature unresolved: {said}"))
        };
        let verdict = &mut self.push("identity D7", evidence).verdict;
        (verdict.value, verdict.std_error, verdict.expected) = (total, bound, 1.0);
        (verdict.statistic, verdict.detectable) = (total - 1.0, bound);
    }

    fn outside(&mut self) {
        let nulls = if self.run.null == NullMass::Never { self.run.nulls } else { 0 };
        let n = self.run.outside.saturating_sub(nulls);
        let said = format!("{n} draws where the density is 0 or outside the chart");
        self.push("outside", Evidence::Exact { holds: n == 0, said });
    }
}

/// Pearson's test of the bins.
fn fit(bins: &Bins) -> Evidence {
    let counted: f64 = bins.observed.iter().sum();
    let rows = bins.observed.iter().zip(bins.mass).zip(bins.bound);
    let rows: Vec<Bin> = rows
        .map(|((count, mass), error)| Bin { mass: *mass, error: *error, count: *count as u64 })
        .collect();
    match pearson(&rows) {
        Ok(found) => {
            let test = Test { statistic: found.statistic, dof: found.dof, p_value: found.p_value };
            let z = |bin: &Bin| {
                let expected = bin.mass * counted;
                if expected > 0.0 { (bin.count as f64 - expected) / expected.sqrt() } else { 0.0 }
            };
            let worst = (0..rows.len()).max_by(|&a, &b| z(&rows[a]).abs().total_cmp(&z(&rows[b]).abs()));
            let said = worst.map_or(String::new(), |i| {
                let expected = rows[i].mass * counted;
                let (count, z) = (rows[i].count, z(&rows[i]));
                format!("worst is bin {i}: {count}, expected {expected:.1}, {z:+.1} standard errors")
            });
            Evidence::Fit { fit: Fit::Bins(found), test, said }
        }
        Err(refusal) => Evidence::None(refusal.to_string()),
    }
}
