//! Expansion of claims into elementary statements, each with its expected value. Expected values are written
//! to the record here, so that verification needs only the record.

use std::collections::BTreeMap;

use crate::error::{Error, Place, Refusals, Result};
use crate::experiment::schema::{
    Agree, ClaimEntry, Differs, Equals, Expect, Faster, MeanPathLength, SamplerClaim,
};
use crate::experiment::{CellSpec, Experiment, suggest};
use crate::results::record::{
    self, Against, Band, Claim, ClaimKind, Comparison, ExpectedOutcome, Observable, Quantity,
    SamplerComparison,
};
use crate::results::sampler::SamplerRun;
use crate::scene::Scene;

/// Names every observable, or every class.
const EACH: &str = "each";

/// All comparisons of an experiment, in the order of its claims, cells, estimators and bands.
/// `observables` are those of each cell, `scenes` their scenes.
///
/// # Errors
/// A claim that names an observable the sensor does not have; a table's cell that is not a number.
pub(crate) fn expand(
    experiment: &Experiment,
    bands: &[Band],
    observables: &[Vec<Observable>],
    scenes: &[&Scene],
) -> Result<Vec<Comparison>> {
    let claims = experiment.file.claim.iter().enumerate();
    let scope = Scope { experiment, bands, observables, scenes };
    let mut refusals = Refusals::default();
    let mut comparisons = Vec::new();
    for (index, claim) in claims {
        let of_claim = scope.claim(index, claim).map_err(|error| error.at(scope.place(index, "")));
        comparisons.extend(refusals.keep("", of_claim)?.into_iter().flatten());
    }
    refusals.none_in(0)?;
    Ok(comparisons)
}

/// The claims on samplers, for each of the samplers that were drawn from.
pub(crate) fn expand_samplers(claims: &[ClaimEntry], drawn: &[SamplerRun]) -> Vec<SamplerComparison> {
    let claims = claims.iter().enumerate();
    let claims = claims.filter_map(|(claim, entry)| Some((claim, entry.sampler.as_ref()?)));
    let of_claim = |(claim, words): (usize, &SamplerClaim)| {
        let is_meant =
            |run: &&SamplerRun| words.samplers.as_ref().is_none_or(|names| names.contains(&run.sampler));
        let sampler = |run: &SamplerRun| SamplerComparison {
            claim,
            sampler: run.sampler.clone(),
            detect: words.detect,
            detect_fine: words.detect_fine,
            detect_serial: words.detect_serial,
        };
        drawn.iter().filter(is_meant).map(sampler).collect::<Vec<_>>()
    };
    claims.flat_map(of_claim).collect()
}

/// The statements that claims make.
pub(crate) fn statements(claims: &[ClaimEntry]) -> Vec<Claim> {
    let of_claim = |(index, entry): (usize, &ClaimEntry)| {
        let each = |word: &Option<String>| word.as_deref() == Some(EACH);
        let (kind, each) = match entry {
            ClaimEntry { agree: Some(words), .. } => {
                (ClaimKind::Agree, each(&words.class) || each(&words.observable))
            }
            ClaimEntry { differs: Some(words), .. } => {
                (ClaimKind::Differs, each(&words.class) || each(&words.observable))
            }
            ClaimEntry { reproduces: Some(words), .. } => {
                (ClaimKind::Reproduces { numbers: words.numbers.clone() }, false)
            }
            ClaimEntry { sampler: Some(_), .. } => (ClaimKind::Sampler, false),
            ClaimEntry { faster: Some(_), .. } => (ClaimKind::Faster, false),
            ClaimEntry { not_slower: Some(_), .. } => (ClaimKind::NotSlower, false),
            // Validation has found exactly one kind: `equals`, or `mean_path_length`, which states values.
            ClaimEntry { .. } => (ClaimKind::Equals, false),
        };
        statement(index, kind, entry, each)
    };
    claims.iter().enumerate().map(of_claim).collect()
}

fn statement(index: usize, kind: ClaimKind, entry: &ClaimEntry, each: bool) -> Claim {
    let expects = match (entry.expect, entry.because) {
        // Validation has found a reason exactly where invalidity is expected.
        (_, Some(reason)) => ExpectedOutcome::Invalid(reason),
        (Some(Expect::Differs), _) => ExpectedOutcome::Differs,
        (Some(Expect::Fails), _) => ExpectedOutcome::Fails,
        (Some(Expect::Invalid), None) => unreachable!("invalidity is expected for a reason"),
        (None, _) if kind == ClaimKind::Differs => ExpectedOutcome::Differs,
        (None, _) => ExpectedOutcome::Pass,
    };
    let label = entry.name.clone().unwrap_or_else(|| format!("{} #{}", kind.name(), index + 1));
    Claim { label, kind, expects, each }
}

impl From<&Agree> for Differs {
    /// The same pairs; what may go unseen is left out.
    fn from(words: &Agree) -> Differs {
        let Agree { estimators, across, observable, class, band, only, .. } = words.clone();
        Differs { estimators, across, observable, class, band, only }
    }
}

struct Scope<'a> {
    experiment: &'a Experiment,
    bands: &'a [Band],
    observables: &'a [Vec<Observable>],
    scenes: &'a [&'a Scene],
}

impl Scope<'_> {
    /// Where a claim states a word, or the claim itself where it does not.
    fn place(&self, claim: usize, word: &str) -> Option<Place> {
        let kind = self.experiment.file.claim.get(claim).map_or("", ClaimEntry::kind);
        let key = format!("claim.{claim}.{kind}.{word}");
        self.experiment.sources.place(0, key.trim_end_matches('.'))
    }

    fn claim(&self, index: usize, claim: &ClaimEntry) -> Result<Vec<Comparison>> {
        if let Some(equals) = &claim.equals {
            return self.equals(index, equals);
        }
        if let Some(words) = &claim.mean_path_length {
            return self.mean_path_length(index, words);
        }
        if let Some(duel) = claim.duel() {
            return self.duel(index, &duel);
        }
        match (&claim.agree, &claim.differs) {
            (Some(agree), _) => self.pairs(index, &Differs::from(agree), Some(agree.detect)),
            (_, Some(differs)) => self.pairs(index, differs, None),
            _ => Ok(Vec::new()),
        }
    }

    /// The band of this name, or every one.
    fn bands_of(&self, name: &Option<String>) -> impl Iterator<Item = usize> {
        let is_meant = |band: &usize| name.as_ref().is_none_or(|name| self.bands[*band].name == *name);
        (0..self.bands.len()).filter(is_meant)
    }

    fn equals(&self, claim: usize, words: &Equals) -> Result<Vec<Comparison>> {
        let names: Vec<&str> = match &words.estimator {
            Some(name) => vec![name],
            None => self.experiment.file.estimator.iter().map(|e| e.name.as_str()).collect(),
        };
        let mut comparisons = Vec::new();
        for cell in self.cells(&words.only) {
            let spec = &self.experiment.cells[cell];
            let read = |column: &String| number(spec, column);
            let value =
                words.value.map_or_else(|| words.column.as_ref().map_or(Ok(f64::NAN), read), Ok)?;
            let error = match (words.error, &words.error_column) {
                (Some(error), _) => error,
                (None, Some(column)) => read(column)?,
                (None, None) => 0.0,
            };
            let observable = self.observable(claim, cell, &words.observable, &words.class)?;
            for name in &names {
                for band in self.bands_of(&words.band) {
                    comparisons.push(Comparison {
                        claim,
                        quantity: quantity(cell, name, &observable, band),
                        against: Against::Value { value, error, source: words.source.clone() },
                        detect: words.detect,
                    });
                }
            }
        }
        Ok(comparisons)
    }

    /// Both means against their values in a sky without losses.
    fn mean_path_length(&self, claim: usize, words: &MeanPathLength) -> Result<Vec<Comparison>> {
        let all = || self.experiment.file.estimator.iter().map(|entry| entry.name.clone()).collect();
        let names: Vec<String> = words.estimators.clone().unwrap_or_else(all);
        let source = "4 eta^2 V / S (Blanco & Fournier 2003; Martelli et al. 2021)";
        let mut comparisons = Vec::new();
        for cell in self.cells(&words.only) {
            for name in &names {
                for band in self.bands_of(&words.band) {
                    let means = self.scenes[cell].lossless_means(band).into_iter().flatten();
                    for (value, observable) in means.zip(["path_length", "incident"]) {
                        let observable =
                            self.observable(claim, cell, &Some(observable.into()), &None)?;
                        comparisons.push(Comparison {
                            claim,
                            quantity: quantity(cell, name, &observable, band),
                            against: Against::Value { value, error: 0.0, source: source.into() },
                            detect: words.detect,
                        });
                    }
                }
            }
        }
        Ok(comparisons)
    }

    fn duel(&self, claim: usize, duel: &Faster) -> Result<Vec<Comparison>> {
        let mut comparisons = Vec::new();
        for cell in self.cells(&duel.only) {
            let observable = self.varying(claim, cell, duel)?;
            for band in 0..self.bands.len() {
                let baseline = quantity(cell, &duel.baseline, &observable, band);
                comparisons.push(Comparison {
                    claim,
                    quantity: quantity(cell, &duel.candidate, &observable, band),
                    against: Against::Efficiency { baseline, exceeds: duel.ratio, cost: duel.cost },
                    detect: duel.detect,
                });
            }
        }
        Ok(comparisons)
    }

    /// The observable whose variance a claim of efficiency is about: one of the sensor's, or its pixels.
    fn varying(&self, claim: usize, cell: usize, duel: &Faster) -> Result<Observable> {
        if duel.observable.as_deref() != Some(record::PIXELS) {
            return self.observable(claim, cell, &duel.observable, &duel.class);
        }
        let refuse = |word: &str, rule: String, help: &str| {
            Err(Error::input_help(rule, help).at(self.place(claim, word)))
        };
        let pixels = record::PIXELS;
        if !self.experiment.cells[cell].sensor.has_pixels() {
            return refuse(
                "observable",
                format!("the sensor has no `{pixels}`"),
                "leave `observable` out, or take an `orthographic` or a `perspective` sensor",
            );
        }
        match duel.class.as_deref() {
            None | Some("all") => Ok(Observable::pixels()),
            Some(class) => refuse(
                "class",
                format!("`{pixels}` of class `{class}`: images are not kept by class"),
                "leave `class` out, or compare the image's mean: `observable = \"mean\"`",
            ),
        }
    }

    /// What `agree` and `differs` compare.
    fn pairs(&self, claim: usize, words: &Differs, detect: Option<f64>) -> Result<Vec<Comparison>> {
        let mut comparisons = Vec::new();
        let mut push = |a: (usize, &str), b: (usize, &str), paired: bool| -> Result<()> {
            for observable in self.observables(claim, a.0, &words.observable, &words.class)? {
                for band in self.bands_of(&words.band) {
                    let other = quantity(b.0, b.1, &observable, band);
                    comparisons.push(Comparison {
                        claim,
                        quantity: quantity(a.0, a.1, &observable, band),
                        against: Against::Quantity { other, paired },
                        detect,
                    });
                }
            }
            Ok(())
        };
        let cells = self.cells(&words.only);
        match &words.across {
            None => {
                for &cell in &cells {
                    for (i, first) in words.estimators.iter().enumerate() {
                        for second in &words.estimators[i + 1..] {
                            push((cell, first), (cell, second), false)?;
                        }
                    }
                }
            }
            Some(axis) => {
                let mut groups: BTreeMap<Vec<(&String, &String)>, Vec<usize>> = BTreeMap::new();
                for &cell in &cells {
                    let axes = self.experiment.cells[cell].axes.iter();
                    groups
                        .entry(axes.filter(|(name, _)| *name != axis).collect())
                        .or_default()
                        .push(cell);
                }
                for group in groups.values() {
                    for name in &words.estimators {
                        for &other in &group[1..] {
                            push((group[0], name), (other, name), self.is_paired(group[0], other))?;
                        }
                    }
                }
            }
        }
        Ok(comparisons)
    }

    /// Two cells share their streams where all that tells them apart is paired over.
    fn is_paired(&self, a: usize, b: usize) -> bool {
        let Some(pair) = &self.experiment.file.pair else { return false };
        let cells = &self.experiment.cells;
        cells[a].content_without(&pair.over) == cells[b].content_without(&pair.over)
    }

    fn cells(&self, only: &BTreeMap<String, String>) -> Vec<usize> {
        (0..self.experiment.cells.len()).filter(|&i| is_in(&self.experiment.cells[i], only)).collect()
    }

    /// The observables that the names choose; `each` is all that the cell has.
    fn observables(
        &self,
        claim: usize,
        cell: usize,
        name: &Option<String>,
        class: &Option<String>,
    ) -> Result<Vec<Observable>> {
        let each = |word: &Option<String>| word.as_deref() == Some(EACH);
        let known = &self.observables[cell];
        let first = name.as_ref().unwrap_or(&known[0].name);
        let fits = |o: &&Observable| {
            (each(name) || o.name == *first)
                && (each(class) || o.class == class.as_deref().unwrap_or("all"))
        };
        if !each(name) && !each(class) {
            return Ok(vec![self.observable(claim, cell, name, class)?]);
        }
        let chosen: Vec<Observable> = known.iter().filter(fits).cloned().collect();
        if chosen.is_empty() {
            self.observable(
                claim,
                cell,
                &name.clone().filter(|n| n != EACH),
                &class.clone().filter(|c| c != EACH),
            )?;
        }
        Ok(chosen)
    }

    fn observable(
        &self,
        claim: usize,
        cell: usize,
        name: &Option<String>,
        class: &Option<String>,
    ) -> Result<Observable> {
        let known = &self.observables[cell];
        let name = name.as_deref().unwrap_or(&known[0].name);
        let class = class.as_deref().unwrap_or("all");
        if let Some(found) = known.iter().find(|o| o.name == name && o.class == class) {
            return Ok(found.clone());
        }
        let unique = |words: Vec<&'_ str>| {
            let mut unique: Vec<String> = Vec::new();
            for word in words {
                if !unique.iter().any(|known| known == word) {
                    unique.push(word.into());
                }
            }
            unique
        };
        let names = unique(known.iter().map(|o| o.name.as_str()).collect());
        let of_name = || known.iter().filter(|o| o.name == name);
        let classes = unique(of_name().map(|o| o.class.as_str()).collect());
        let help = |word: &str, known: &[String], what: &str| {
            suggest::help(word, &known.iter().map(String::as_str).collect::<Vec<_>>(), what)
        };
        let (word, rule, help) = match classes.is_empty() {
            true => {
                let has = "observables of this sensor";
                ("observable", format!("unknown observable `{name}`"), help(name, &names, has))
            }
            false => {
                let has = format!("classes of `{name}`");
                ("class", format!("unknown class `{class}`"), help(class, &classes, &has))
            }
        };
        Err(Error::input_help(rule, help).at(self.place(claim, word)))
    }
}

/// Whether a claim's `where` chooses the cell.
pub(super) fn is_in(cell: &CellSpec, only: &BTreeMap<String, String>) -> bool {
    only.iter().all(|(axis, label)| cell.axes.get(axis) == Some(label))
}

fn quantity(cell: usize, estimator: &str, observable: &Observable, band: usize) -> Quantity {
    Quantity { cell, estimator: estimator.into(), observable: observable.clone(), band }
}

fn number(cell: &CellSpec, column: &str) -> Result<f64> {
    let text = cell.csv_row.get(column).map_or("", String::as_str);
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(Error::input(format!(
            "column `{column}` holds `{text}` in cell `{}`, where a claim needs a number",
            cell.label
        ))),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn claims_say_what_they_expect() {
        let claims: Vec<ClaimEntry> = serde_json::from_value(json!([
            {"agree": {"estimators": ["a", "b"], "class": "each", "detect": 0.1}},
            {"name": "apart", "differs": {"estimators": ["a", "b"]}},
            {"expect": "invalid", "because": "heavy_tail", "equals": {"value": 1.0, "source": "by hand"}},
            {"reproduces": {"passes": 4, "numbers": "ff"}},
        ]))
        .expect("claims");
        let claim =
            |label: &str, kind, expects, each| Claim { label: label.into(), kind, expects, each };
        let numbers = Some("ff".to_string());
        let expected = [
            claim("agree #1", ClaimKind::Agree, ExpectedOutcome::Pass, true),
            claim("apart", ClaimKind::Differs, ExpectedOutcome::Differs, false),
            claim(
                "equals #3",
                ClaimKind::Equals,
                ExpectedOutcome::Invalid(record::InvalidReason::HeavyTail),
                false,
            ),
            claim("reproduces #4", ClaimKind::Reproduces { numbers }, ExpectedOutcome::Pass, false),
        ];
        assert_eq!(statements(&claims), expected);
    }
}
