//! Images rendered elsewhere, with two or more seeds, against a record of the same scene.
//!
//! The tests share one family-wise level over all bands (Holm):
//! - the image mean and the tiles: the means of the seeds against the batches of the record, both with their
//!   errors. By default a seed is one observation. If the user states that pixels are independent, the
//!   spread of the pixels gives the error of the mean of a region, with far more degrees of freedom;
//! - the squared bias of all pixels, from products of different seeds (`pixels::squared_bias`).
//!
//! Convention: row 0 is at the top of the image and column 0 at its left; OpenEXR files are read as their
//! data window states, whatever the order of their lines. Values are linear radiance, without exposure.

use super::evidence::Evidence;
use super::family::{Finding, conclude};
use super::levels::Looks;
use super::means::{QuantityMean, SHARE_LIMIT};
use super::verdict::{Objection, Outcome, TestKind, Verdict};
use crate::error::{Error, Result};
use crate::results::image::Picture;
use crate::results::record::{EstimatorRun, Observable, ObservedRegion, Quantity};
use crate::results::store::Stored;
use crate::stats::hypothesis::{Estimate, Spread};
use crate::stats::tails::{chi_square_sf, normal_two_sided};

/// Variance times seconds, as a ratio.
pub(crate) mod efficiency;
/// Images made elsewhere, as planes of a record's bands.
pub(crate) mod images;
/// Statistics per pixel.
mod pixels;

use images::Planes;
use pixels::BandImages;

/// The default of the probability of any false alarm in one call.
pub(crate) const LEVEL: f64 = 1e-4;

/// One pixel of fewer than this many may well hold half of their spread.
const FEW_PIXELS: usize = 64;

/// The record contradicts the user's assertion of independent pixels where the seeds' spread is less
/// likely than this.
const SPREAD_LEVEL: f64 = 1e-6;

/// What the images are compared with, and how.
pub(crate) struct Question<'a> {
    /// Record that the images are compared with.
    pub stored: &'a Stored,
    /// Index of the cell.
    pub cell: usize,
    /// Name of the estimator.
    pub estimator: &'a str,
    /// Transport class; another than `all` is compared by its image mean alone.
    pub class: &'a str,
    /// Probability of any false alarm.
    pub level: f64,
    /// The smallest bias of an image mean that must not go unseen, relative to it.
    pub detect: f64,
    /// The user vouches that the noise of one pixel is independent of another's.
    pub independent_pixels: bool,
}

/// One band's pixels for a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PixelMap {
    /// Band name.
    pub band: String,
    /// Scores: differences in units of their error, as normal values.
    pub z: Vec<f64>,
    /// Theirs less ours, relative to ours; NaN where ours is 0.
    pub relative: Vec<f64>,
    /// Mean over seeds of each pixel.
    pub mean: Vec<f64>,
    /// Standard error of each pixel's mean.
    pub std_error: Vec<f64>,
}

/// Result of judging the images.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Answer {
    /// One verdict a test.
    pub verdicts: Vec<Verdict>,
    /// One map for each band; none for a single class, of which the record has no pixels.
    pub maps: Vec<PixelMap>,
    /// What a reader must know.
    pub notes: Vec<String>,
}

/// The run that images are compared with.
///
/// # Errors
/// No such estimator in the cell, or no image of it.
pub(crate) fn run_of<'a>(stored: &'a Stored, cell: usize, estimator: &str) -> Result<&'a EstimatorRun> {
    let runs = &stored.record.cells[cell].runs;
    let run = runs.iter().find(|run| run.estimator == estimator).ok_or_else(|| {
        let names: Vec<&str> = runs.iter().map(|run| run.estimator.as_str()).collect();
        Error::input_help(
            format!("the record has no estimator `{estimator}`"),
            format!("it has {}", names.join(", ")),
        )
    })?;
    if run.image.is_none() {
        return Err(Error::input_help(
            "the record has no image: its sensor has no pixels",
            "run the experiment with an orthographic or perspective sensor",
        ));
    }
    Ok(run)
}

/// Judges the images.
///
/// # Errors
/// No such estimator or class, no image in the record.
pub(crate) fn judge(question: &Question, planes: &Planes) -> Result<Answer> {
    let run = run_of(question.stored, question.cell, question.estimator)?;
    let Some(picture) = Picture::of(question.stored, run) else {
        return Err(Error::input("the record has no image"));
    };
    let cell = &question.stored.record.cells[question.cell];
    let of_class = run.observables.iter().filter(|o| o.class == question.class);
    let regions: Vec<(&Observable, &ObservedRegion)> =
        of_class.filter_map(|o| Some((o, cell.region_of(o)?))).collect();
    if regions.is_empty() {
        let mut classes: Vec<&str> = run.observables.iter().map(|o| o.class.as_str()).collect();
        classes.sort_unstable();
        classes.dedup();
        return Err(Error::input_help(
            format!("the record has no image mean of class `{}`", question.class),
            format!("it has {}", classes.join(", ")),
        ));
    }
    let has_pixels = question.class == "all";
    let mut findings = Vec::new();
    let mut answer = Answer { verdicts: vec![], maps: vec![], notes: planes.notes.clone() };
    for (index, about) in question.stored.record.bands.iter().enumerate() {
        let band = BandImages::of(planes, &picture, index, run.passes);
        let asked = BandQuestion { question, band: &band, index };
        let objection = band.not_finite();
        for (observable, region) in &regions {
            findings.push(asked.region(observable, region, objection.as_deref(), has_pixels));
        }
        if has_pixels {
            findings.push(asked.pixels(objection.as_deref()));
            if objection.is_none() {
                answer.notes.extend(asked.notes(&about.name));
            }
            answer.maps.push(map(&about.name, &band));
        }
    }
    let looks = Looks::One { level: question.level };
    answer.verdicts = conclude(findings, looks, |_, _| None).verdicts;
    let differs = |v: &Verdict| v.outcome == Outcome::Fail;
    if has_pixels && answer.verdicts.iter().any(differs) {
        let bands = 0..question.stored.record.bands.len();
        let turned =
            bands.map(|b| pixels::orientation(&BandImages::of(planes, &picture, b, run.passes)));
        if let Some(how) = turned.flatten().next() {
            answer.notes.push(format!(
                "the images fit far better {how}: check the camera's axes and the order of rows"
            ));
        }
    }
    Ok(answer)
}

fn map(name: &str, band: &BandImages) -> PixelMap {
    let all = 0..band.ours.len();
    PixelMap {
        band: name.into(),
        z: all.clone().map(|i| band.z(i)).collect(),
        relative: all.clone().map(|i| band.mean(i) / band.ours[i] - 1.0).map(finite_or_nan).collect(),
        mean: all.clone().map(|i| band.mean(i)).collect(),
        std_error: all.map(|i| band.std_error(i)).collect(),
    }
}

fn finite_or_nan(x: f64) -> f64 {
    if x.is_finite() { x } else { f64::NAN }
}

/// One band of the comparison.
struct BandQuestion<'a> {
    question: &'a Question<'a>,
    band: &'a BandImages<'a>,
    index: usize,
}

impl BandQuestion<'_> {
    fn quantity(&self, observable: &Observable) -> Quantity {
        Quantity {
            cell: self.question.cell,
            estimator: self.question.estimator.into(),
            observable: observable.clone(),
            band: self.index,
        }
    }

    fn finding(&self, observable: &str, evidence: Evidence) -> Finding {
        let record = &self.question.stored.record;
        let verdict = Verdict {
            experiment: record.experiment.clone(),
            cell: record.cells[self.question.cell].label.clone(),
            cell_title: record.cells[self.question.cell].title(),
            band: record.bands[self.index].name.clone(),
            class: self.question.class.into(),
            estimators: self.question.estimator.into(),
            claim: "judge".into(),
            observable: observable.into(),
            ..Verdict::default()
        };
        Finding { relative_to: self.image_mean(), ..Finding::new(verdict, evidence) }
    }

    /// The record's image mean, which `detectable` is relative to.
    fn image_mean(&self) -> f64 {
        let observable = Observable { name: "mean".into(), class: self.question.class.into() };
        QuantityMean::of(self.question.stored, &self.quantity(&observable))
            .map_or(f64::NAN, |arm| arm.mean.value)
    }

    /// The mean of a region.
    fn region(
        &self,
        observable: &Observable,
        region: &ObservedRegion,
        objection: Option<&str>,
        has_pixels: bool,
    ) -> Finding {
        let name = &observable.name;
        let Some(arm) = QuantityMean::of(self.question.stored, &self.quantity(observable)) else {
            return self.finding(name, Evidence::Nothing("the record does not hold this region".into()));
        };
        let pixels = region.pixels(self.band.width, self.band.height);
        let theirs = self.theirs(&pixels);
        let mut finding = self.finding(name, Evidence::Nothing(String::new().into()));
        finding.verdict.set_value(theirs.value, theirs.std_error);
        finding.verdict.set_expected(arm.mean.value, arm.mean.std_error);
        finding.evidence =
            match objection.map(Objection::from).or_else(|| arm.objection()).or_else(|| {
                has_pixels.then(|| self.misplaced(&pixels, &arm)).flatten().map(Objection::from)
            }) {
                Some(reason) => Evidence::Nothing(reason),
                None => self.weigh(&theirs, &arm, &pixels, &mut finding.verdict),
            };
        if region.tile.is_none() {
            finding.detect = Some(self.question.detect);
            if arm.mean.value == 0.0 && !matches!(finding.evidence, Evidence::Nothing(_)) {
                finding.evidence =
                    Evidence::Nothing("the record's image is black: there is nothing to compare".into());
            }
        }
        finding
    }

    fn weigh(
        &self,
        theirs: &Estimate,
        arm: &QuantityMean,
        pixels: &[usize],
        verdict: &mut Verdict,
    ) -> Evidence {
        let spread = self.band.theirs.iter().map(|seed| mean_of(seed, pixels));
        let spread = Spread::of(spread.map(|mean| (1.0, mean)));
        if spread.estimate.std_error == 0.0 && arm.mean.std_error == 0.0 && arm.mean.value == 0.0 {
            (verdict.test, verdict.statistic) = (Some(TestKind::Identity), Some(0.0));
            return Evidence::of_sides(theirs.value == 0.0, verdict);
        }
        if arm.mean.std_error > 0.0
            && let Some(objection) = arm.tail_objection()
        {
            return Evidence::Nothing(objection);
        }
        let share = self.band.largest_share(pixels);
        if pixels.len() >= FEW_PIXELS && share > SHARE_LIMIT {
            let share = 100.0 * share;
            let said =
                format!("heavy tail: one pixel holds {share:.0} % of the spread between the images");
            return Evidence::Nothing(said.into());
        }
        if self.question.independent_pixels {
            let squares: f64 = pixels.iter().map(|&i| self.band.variance(i)).sum();
            let predicted = squares.sqrt() / pixels.len() as f64;
            let ratio = spread.estimate.std_error / predicted;
            let dof = self.band.seeds() - 1.0;
            if chi_square_sf(dof * ratio * ratio, dof) < SPREAD_LEVEL {
                let said = format!(
                    "the images' means spread {ratio:.1} times as far as independent pixels would: judge \
                     without --independent-pixels"
                );
                return Evidence::Nothing(said.into());
            }
        }
        verdict.test = Some(match self.question.independent_pixels {
            true => TestKind::TOfPixels,
            false => TestKind::TOfSeeds,
        });
        let (a, b) = (theirs.std_error, arm.mean.std_error);
        // The fewer degrees of freedom bound the tails for every ratio of variances: see
        // `BandImages::difference`.
        Evidence::of_difference(Estimate {
            value: theirs.value - arm.mean.value,
            std_error: (a * a + b * b).sqrt(),
            dof: theirs.dof.min(arm.mean.dof),
        })
    }

    /// Their mean of a region, with its error.
    ///
    /// Seeds as blocks: K means, K - 1 degrees of freedom. Independent pixels: the variances v_i of the
    /// pixels' means, each with K - 1, add up, and by Satterthwaite dof = (K - 1) (sum s^2)^2 / sum s^4
    /// of the true variances s^2; since E[v^2] = s^4 (K + 1) / (K - 1), that is estimated by
    /// (K + 1) (sum v)^2 / sum v^2.
    fn theirs(&self, pixels: &[usize]) -> Estimate {
        let means = self.band.theirs.iter().map(|seed| mean_of(seed, pixels));
        let Estimate { value, std_error, dof } = Spread::of(means.map(|mean| (1.0, mean))).estimate;
        let (variance, dof) = if self.question.independent_pixels {
            let variances: Vec<f64> = pixels.iter().map(|&i| self.band.variance(i)).collect();
            let sum: f64 = variances.iter().sum();
            let squares: f64 = variances.iter().map(|v| v * v).sum();
            let dof = if squares > 0.0 { (self.band.seeds() + 1.0) * sum * sum / squares } else { dof };
            (sum / (pixels.len() * pixels.len()) as f64, dof)
        } else {
            (std_error * std_error, dof)
        };
        let rounding = self.band.rounding * value;
        Estimate { value, std_error: (variance + rounding * rounding).sqrt(), dof }
    }

    /// The record's pixels of a region must add up to its mean.
    fn misplaced(&self, pixels: &[usize], arm: &QuantityMean) -> Option<String> {
        let mean = mean_of(&self.band.ours, pixels);
        let off = (mean - arm.mean.value).abs() > 1e-9 * arm.mean.value.abs();
        off.then(|| "the record's pixels do not add up to its region".to_string())
    }

    /// The squared bias of all pixels.
    fn pixels(&self, objection: Option<&str>) -> Finding {
        let arm = self.quantity(&Observable { name: "mean".into(), class: "all".into() });
        let objection = objection
            .map(Objection::from)
            .or_else(|| QuantityMean::of(self.question.stored, &arm).and_then(|arm| arm.objection()));
        let found = pixels::squared_bias(self.band);
        let is_exact = objection.is_none() && found.noise == 0.0;
        let evidence = match objection {
            Some(reason) => Evidence::Nothing(reason),
            None if is_exact => Evidence::Exact { holds: true, said: "the same".into() },
            None => {
                Evidence::Bounded { t: found.mean / found.noise, terms: found.terms, unit: found.noise }
            }
        };
        let mut finding = self.finding("pixels", evidence);
        finding.verdict.test = Some(TestKind::SquaredBias);
        finding.verdict.statistic = is_exact.then_some(0.0);
        let mean = self.image_mean();
        let [low, high] = [-2.0, 2.0].map(|k| (found.mean + k * found.noise).max(0.0).sqrt() / mean);
        if low.is_finite() && high.is_finite() {
            finding.verdict.note =
                format!("rms bias of a pixel {:.2} to {:.2} % of the mean", 100.0 * low, 100.0 * high);
        }
        finding
    }

    /// Maps of a band's pixels.
    fn notes(&self, name: &str) -> Vec<String> {
        let judged = (0..self.band.ours.len()).filter(|&i| self.band.difference(i).std_error > 0.0);
        let z: Vec<f64> = judged.map(|i| self.band.z(i)).collect();
        let beyond = |p: f64| z.iter().filter(|z| normal_two_sided(**z) < p).count();
        let share = |p: f64| 100.0 * beyond(p) as f64 / z.len().max(1) as f64;
        vec![format!(
            "band {name}: of {} pixels {:.1} % have p < 0.05, {:.1} % p < 0.01, {:.1} % p < 0.001 (t with {} \
             degrees of freedom)",
            z.len(),
            share(0.05),
            share(0.01),
            share(0.001),
            self.band.seeds() - 1.0
        )]
    }
}

fn mean_of(values: &[f64], pixels: &[usize]) -> f64 {
    pixels.iter().map(|&i| values[i]).sum::<f64>() / pixels.len() as f64
}

#[cfg(test)]
#[path = "foreign_tests.rs"]
mod tests;
