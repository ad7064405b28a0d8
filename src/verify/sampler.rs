//! Tests of a sampler: its draws compared with the density that it claims.
//!
//! | test | statement | judged by |
//! |---|---|---|
//! | `chi2 coarse`, `chi2 fine` | draws fall into bins with the density's masses | Pearson |
//! | `serial` | so do pairs of consecutive draws, with the products of masses | Pearson |
//! | `contrast NAME` | the mean of a function of the draw | Student's t |
//! | `delta NAME` | a discrete outcome has its probability, and its value | exact binomial |
//! | `null` | the sampler returns nothing as often as is stated, or never | exact binomial, or none |
//! | `identity D5` | each draw's own density is the density function's, to 1e-9 and rounding | none differs |
//! | `identity D7` | density, discrete masses and stated null sum to 1 | certified quadrature |
//! | `outside` | no draw where the density is 0, or outside the chart | there is none |
//!
//! Masses come with bounds of their quadrature errors. Where those could shift a test by more than
//! `stats::goodness` allows, or D7 by more than 1e-4, the quadrature is unresolved: the test is invalid.

use super::evidence::{CountsFit, Evidence};
use super::family::Finding;
use super::trial::{Subject, Trial, blank};
use super::verdict::{TestKind, Verdict};
use crate::results::record::SamplerComparison;
use crate::results::sampler::{ContrastRun, Delta, NullMass, OWN_DENSITY, SamplerRun};
use crate::results::store::{Bins, Stored};
use crate::stats::goodness::{Bin, contrast, pearson, proportion};
use crate::stats::hypothesis::Test;
use crate::stats::moments::Moments;

/// Largest bound of the error of the total mass with which its being 1 is a stricter test than counts:
/// those of 1e6 draws see relative errors of 1e-2. The bound itself is the row's `detectable`.
const TOTAL_BOUND: f64 = 1e-4;

/// Sampling errors and deviations of contrasts below this, relative to the value, are rounding.
const ROUNDING: f64 = 1e-12;

/// All tests that comparison `index` of samplers makes.
pub(super) fn trials(stored: &Stored, index: usize, comparison: &SamplerComparison) -> Vec<Trial> {
    let record = &stored.record;
    let claim = &record.statements[comparison.claim];
    let verdict = Verdict { estimators: comparison.sampler.clone(), ..blank(record, claim) };
    let findings = match record.samplers.iter().find(|run| run.sampler == comparison.sampler) {
        Some(run) => Tests { stored, run, verdict, findings: Vec::new() }.all(comparison),
        None => {
            let nothing = Evidence::Nothing("the record does not hold this sampler".into());
            vec![Finding::new(verdict, nothing)]
        }
    };
    let trial = |finding| Trial::new(record, comparison.claim, Subject::Sampler(index), finding);
    findings.into_iter().map(trial).collect()
}

/// The tests of one sampler.
struct Tests<'a> {
    stored: &'a Stored,
    run: &'a SamplerRun,
    /// A verdict with the names filled in.
    verdict: Verdict,
    findings: Vec<Finding>,
}

impl Tests<'_> {
    fn push(&mut self, test: TestKind, evidence: Evidence) -> &mut Finding {
        let evidence = match self.objection() {
            Some(objection) => Evidence::Nothing(objection.into()),
            None => evidence,
        };
        let verdict = Verdict { test: Some(test), ..self.verdict.clone() };
        self.findings.push(Finding::new(verdict, evidence));
        let last = self.findings.len() - 1;
        &mut self.findings[last]
    }

    /// Why every test of this sampler is void.
    fn objection(&self) -> Option<String> {
        let (n, values) = (self.run.senseless, self.run.senseless_contrasts);
        if n > 0 {
            return Some(format!(
                "the density is negative or not finite at {n} nodes of the quadrature"
            ));
        }
        (values > 0).then(|| format!("{values} values of contrasts are not finite"))
    }

    fn all(mut self, asked: &SamplerComparison) -> Vec<Finding> {
        let run = self.run;
        self.bins(TestKind::Chi2Coarse, Some(&run.coarse), asked.detect);
        self.bins(TestKind::Chi2Fine, run.fine.as_ref(), asked.detect_fine);
        self.bins(TestKind::Serial, run.serial.as_ref(), asked.detect_serial);
        run.contrasts.iter().for_each(|contrast| self.contrast(contrast));
        run.deltas.iter().for_each(|delta| self.delta(delta));
        self.null();
        self.own_density();
        self.total();
        self.outside();
        self.findings
    }

    fn bins(&mut self, test: TestKind, path: Option<&String>, detect: Option<f64>) {
        let Some(path) = path else { return };
        let Some(bins) = self.stored.bins(path) else {
            self.push(test, Evidence::Nothing("the record does not hold its bins".into()));
            return;
        };
        if bins.mass.iter().filter(|mass| **mass > 0.0).count() < 2 {
            return; // one outcome has all the mass: its own row is the test
        }
        let counted: f64 = bins.observed.iter().sum();
        // Pairs with a draw that is in no bin are not counted.
        let is_everything = test != TestKind::Serial;
        let evidence = if is_everything && counted != self.run.samples as f64 {
            Evidence::Nothing(format!("the bins hold {counted} draws of {}", self.run.samples).into())
        } else {
            fit(&bins)
        };
        self.push(test, evidence).detect = detect;
    }

    fn contrast(&mut self, run: &ContrastRun) {
        let moments = Moments::from_array(run.moments);
        // What quadrature cannot tell from 0 is 0, and differences from it are absolute.
        let expected = if run.expected.abs() <= run.bound { 0.0 } else { run.expected };
        let rounding = ROUNDING * moments.mean.abs().max(expected.abs());
        let evidence = if moments.n != self.run.samples {
            Evidence::Nothing(format!("{} values for {} draws", moments.n, self.run.samples).into())
        } else if moments.std_error() <= rounding {
            let holds = (moments.mean - expected).abs() <= run.bound + rounding;
            let said = format!("no sampling error: {:e}, expected {expected:e}", moments.mean);
            Evidence::Exact { holds, said }
        } else {
            match contrast(&moments, expected, run.bound) {
                Ok(found) => Evidence::of_difference(found.estimate),
                Err(refusal) => Evidence::Nothing(refusal.to_string().into()),
            }
        };
        let finding = self.push(TestKind::Contrast(run.name.clone()), evidence);
        finding.verdict.set_value(moments.mean, moments.std_error());
        finding.verdict.set_expected(expected, run.bound);
        finding.relative_to = expected;
    }

    fn delta(&mut self, delta: &Delta) {
        let test = TestKind::Delta(delta.name.clone());
        if delta.inexact > 0 {
            let said =
                format!("{} of {} values are not what they have to be", delta.inexact, delta.observed);
            self.push(test, Evidence::Exact { holds: false, said });
        } else {
            self.share(test, delta.observed, delta.mass);
        }
    }

    fn null(&mut self) {
        match self.run.null {
            NullMass::Stated(mass) => self.share(TestKind::Null, self.run.nulls, mass),
            NullMass::Never => {
                let said = format!("{} draws returned nothing", self.run.nulls);
                self.push(TestKind::Null, Evidence::Exact { holds: self.run.nulls == 0, said });
            }
            NullMass::Remainder => {} // a bin like others
        }
    }

    fn share(&mut self, kind: TestKind, count: u64, mass: f64) {
        let n = self.run.samples;
        let evidence = match proportion(count, n, mass, 0.0) {
            Ok(found) => {
                let test = Test { statistic: count as f64, dof: f64::NAN, p_value: found.p_value };
                let said = format!("{count} of {n}, expected {:.1}", mass * n as f64);
                Evidence::Counts { fit: CountsFit::Share(found), test, said }
            }
            Err(refusal) => Evidence::Nothing(refusal.to_string().into()),
        };
        let share = count as f64 / n as f64;
        let verdict = &mut self.push(kind, evidence).verdict;
        verdict.set_value(share, (share * (1.0 - share) / n as f64).sqrt());
        verdict.set_expected(mass, 0.0);
    }

    fn own_density(&mut self) {
        let (n, largest) = (self.run.own_density_differs, self.run.own_density_largest);
        let said =
            format!("{n} draws whose own density is another; largest relative difference {largest:.1e}");
        let evidence = Evidence::Exact { holds: n == 0, said };
        let verdict = &mut self.push(TestKind::OwnDensity, evidence).verdict;
        (verdict.statistic, verdict.detectable) = (Some(largest), Some(OWN_DENSITY));
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
            Evidence::Nothing(format!("quadrature unresolved: {said}").into())
        };
        let verdict = &mut self.push(TestKind::TotalMass, evidence).verdict;
        verdict.set_value(total, bound);
        verdict.expected = Some(1.0);
        (verdict.statistic, verdict.detectable) = (Some(total - 1.0), Some(bound));
    }

    fn outside(&mut self) {
        let nulls = if self.run.null == NullMass::Never { self.run.nulls } else { 0 };
        let n = self.run.outside.saturating_sub(nulls);
        let said = format!("{n} draws where the density is 0 or outside the chart");
        self.push(TestKind::Outside, Evidence::Exact { holds: n == 0, said });
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
            Evidence::Counts { fit: CountsFit::Bins(found), test, said }
        }
        Err(refusal) => Evidence::Nothing(refusal.to_string().into()),
    }
}
