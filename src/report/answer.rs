//! The head of a page: a badge for the verdicts, a sentence for each pair of estimators, and a split picture
//! of the most informative pair.

use super::data::ReportData;
use super::document::{BadgeKind, FigureBlock, PageBlock};
use super::split;
use super::summary::chosen;
use super::terminal::reason;
use crate::error::Result;
use crate::results::number::significant;
use crate::results::record::{CostMeasure, EstimatorRun, PIXELS};
use crate::results::store::{RecordFolder, Stored};
use crate::stats::hypothesis::{Estimate, critical_value};
use crate::verify::comparisons::EfficiencyRow;
use crate::verify::verdict::{Outcome, Verdict};

/// Confidence of the bound of the difference of means, over all bands and cells together.
const CONFIDENCE: f64 = 0.95;

/// With more pairs only as many are told; the tables have all.
const MOST_PAIRS: usize = 6;

/// The head of the page.
pub(super) fn blocks(data: &ReportData) -> Vec<PageBlock> {
    let mut blocks = Vec::new();
    blocks.extend(badges(&data.verdicts));
    let sentences = sentences(data);
    if !sentences.is_empty() {
        blocks.push(PageBlock::List(sentences));
    }
    blocks.extend(data.lead.clone().map(PageBlock::Lead));
    blocks
}

/// How many verdicts there are of each kind; nothing where nothing is claimed.
pub(super) fn badges(verdicts: &[Verdict]) -> Option<PageBlock> {
    if verdicts.is_empty() {
        return None;
    }
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let failed = verdicts.iter().filter(|v| v.outcome == Outcome::Fail && !v.is_green()).count();
    let undecided = verdicts.len() - green - failed;
    let verb =
        |count: usize, one: &str, more: &str| if count == 1 { one.into() } else { String::from(more) };
    let mut badges = vec![(
        BadgeKind::Good,
        format!("{green} of {} comparisons {}", verdicts.len(), verb(green, "holds", "hold")),
    )];
    if failed > 0 {
        badges.push((BadgeKind::Bad, format!("{failed} {}", verb(failed, "fails", "fail"))));
    }
    if undecided > 0 {
        badges.push((BadgeKind::Open, format!("{undecided} undecided")));
    }
    // Nothing is good about none.
    if green == 0 {
        badges[0].0 = BadgeKind::Open;
    }
    Some(PageBlock::Badges(badges))
}

/// The rows of one pair of estimators.
struct PairRows<'a> {
    candidate: &'a str,
    baseline: &'a str,
    rows: Vec<&'a EfficiencyRow>,
}

/// The pairs by CPU time, or by counted work where no time was measured.
fn pairs<'a>(stored: &Stored, rows: &'a [EfficiencyRow]) -> (CostMeasure, Vec<PairRows<'a>>) {
    let by = |cost| {
        let mut pairs: Vec<PairRows> = Vec::new();
        for row in chosen(stored, rows, cost) {
            match pairs.iter_mut().find(|p| p.candidate == row.candidate && p.baseline == row.baseline) {
                Some(pair) => pair.rows.push(row),
                None => pairs.push(PairRows {
                    candidate: &row.candidate,
                    baseline: &row.baseline,
                    rows: vec![row],
                }),
            }
        }
        pairs
    };
    let is_known = |pairs: &[PairRows]| {
        pairs.iter().flat_map(|p| &p.rows).any(|row| row.quoted().is_some() || row.at_least.is_some())
    };
    match by(CostMeasure::Cpu) {
        pairs if is_known(&pairs) => (CostMeasure::Cpu, pairs),
        _ => (CostMeasure::Counters, by(CostMeasure::Counters)),
    }
}

/// A sentence for each pair.
fn sentences(data: &ReportData) -> Vec<String> {
    let (cost, pairs) = pairs(&data.stored, &data.comparisons);
    let told = pairs.iter().take(MOST_PAIRS).map(|pair| pair.sentence(&data.stored, cost));
    let mut sentences: Vec<String> = told.collect();
    if pairs.len() > MOST_PAIRS {
        sentences
            .push(format!("{} more pairs are in the table of efficiencies.", pairs.len() - MOST_PAIRS));
    }
    sentences
}

impl PairRows<'_> {
    /// The estimator whose ratio is the largest, with the largest ratio of all pairs.
    fn best(&self) -> f64 {
        self.rows.iter().filter_map(|row| row.efficiency_ratio.or(row.at_least)).fold(0.0, f64::max)
    }

    fn sentence(&self, stored: &Stored, cost: CostMeasure) -> String {
        let (a, b) = (self.candidate, self.baseline);
        let quoted: Vec<[f64; 3]> = self.rows.iter().filter_map(|row| row.quoted()).collect();
        let bounds: Vec<f64> = self
            .rows
            .iter()
            .filter(|row| row.quoted().is_none())
            .filter_map(|row| row.at_least)
            .collect();
        let mut text = match range(&quoted) {
            Some(how) => format!("`{a}` is {how} times as efficient as `{b}`"),
            None if !bounds.is_empty() => {
                let least = bounds.iter().copied().fold(f64::INFINITY, f64::min);
                format!(
                    "`{a}` is at least {} times as efficient as `{b}`, if their means agree",
                    significant(0.995 * least, 2)
                )
            }
            None => format!("The efficiency of `{a}` over `{b}` is not known"),
        };
        let measure = match cost {
            CostMeasure::Cpu => "CPU time",
            CostMeasure::Counters => "counted work",
        };
        if let Some(row) = self.rows.iter().find(|row| row.quoted().is_some() || row.at_least.is_some())
        {
            let what = if row.metric == PIXELS { "a pixel".into() } else { format!("`{}`", row.metric) };
            text += &format!(" (variance of {what} times {measure})");
        }
        let known = quoted.len() + if quoted.is_empty() { bounds.len() } else { 0 };
        if known < self.rows.len() {
            let mut missing =
                self.rows.iter().filter(|row| row.quoted().is_none()).map(|row| reason(row));
            let first = missing.next().unwrap_or_default();
            // Numbers that hold for all of them are told, and no others.
            let is_of_all = missing.all(|reason| reason == first);
            let reason =
                if is_of_all { Some(first) } else { first.split(':').next() }.unwrap_or_default();
            text += &match (known, self.rows.len()) {
                (0, 1) => format!(": {reason}"),
                (0, all) => format!(" in any of {all} bands and cells: {reason}"),
                (_, all) => {
                    format!("; in {} of {all} bands and cells there is no ratio: {reason}", all - known)
                }
            };
        }
        let loose = self.rows.iter().filter(|row| row.quoted().is_some() && !row.resolved).count();
        if loose > 0 {
            text += &match quoted.len() {
                1 => "; the ratio is not resolved".to_string(),
                all => format!("; {loose} of {all} ratios are not resolved"),
            };
        }
        text += &self.agreement(stored).map_or(".".into(), |bound| {
            format!(
                ". Their means agree within {} % ({:.0} % confidence).",
                significant(100.0 * bound, 2),
                100.0 * CONFIDENCE
            )
        });
        text
    }

    /// A bound of the relative difference of the two means, over all rows with a ratio together.
    fn agreement(&self, stored: &Stored) -> Option<f64> {
        let quoted: Vec<&&EfficiencyRow> =
            self.rows.iter().filter(|row| row.quoted().is_some()).collect();
        let level = (1.0 - CONFIDENCE) / quoted.len().max(1) as f64;
        let bound = |row: &&&EfficiencyRow| {
            let [a, b] = [&row.candidate, &row.baseline].map(|name| mean(stored, row, name));
            let (a, b) = (a?, b?);
            let difference = a.minus(&b);
            let reach = critical_value(level, difference.dof) * difference.std_error;
            Some((difference.value.abs() + reach) / b.value.abs())
        };
        let bounds = quoted.iter().map(bound).collect::<Option<Vec<f64>>>()?;
        bounds.into_iter().reduce(f64::max).filter(|bound| bound.is_finite())
    }
}

/// The mean of the sensor's first observable.
fn mean(stored: &Stored, row: &EfficiencyRow, estimator: &str) -> Option<Estimate> {
    let cell = stored.record.cells.iter().find(|cell| cell.label == row.cell)?;
    let run = cell.runs.iter().find(|run| run.estimator == estimator)?;
    let band = stored.record.bands.iter().position(|band| band.name == row.band)?;
    Some(Estimate::of_batches(&stored.moments(run, 0, band)?))
}

/// `5.7 to 8.7`, or `5.7 [5.5, 5.8]` where there is one ratio.
fn range(quoted: &[[f64; 3]]) -> Option<String> {
    let two = |x: f64| significant(x, 2);
    match quoted {
        [] => None,
        [[ratio, low, high]] => {
            let [ratio, low, high] = [ratio, low, high].map(|x| significant(*x, 3));
            Some(format!("{ratio} [{low}, {high}]"))
        }
        many => {
            let low = many.iter().map(|q| q[0]).fold(f64::INFINITY, f64::min);
            let high = many.iter().map(|q| q[0]).fold(0.0, f64::max);
            let (low, high) = (two(low), two(high));
            Some(if low == high { format!("about {low}") } else { format!("{low} to {high}") })
        }
    }
}

/// The pair that the lead picture shows, left and right: the first estimator and the one that is the most
/// efficient against it; without a ratio the first two.
fn lead_pair<'a>(stored: &'a Stored, rows: &'a [EfficiencyRow]) -> Option<(&'a str, &'a str, String)> {
    let is_shown = |run: &&EstimatorRun| run.control_of.is_none() && run.image.is_some();
    let cell = stored.record.cells.first()?;
    let names: Vec<&str> = cell.runs.iter().filter(is_shown).map(|run| run.estimator.as_str()).collect();
    let (_, pairs) = pairs(stored, rows);
    let best = pairs.iter().filter(|p| p.best() > 0.0).max_by(|a, b| a.best().total_cmp(&b.best()));
    if let Some(pair) = best.filter(|p| names.contains(&p.candidate) && names.contains(&p.baseline)) {
        let own: Vec<[f64; 3]> = pair
            .rows
            .iter()
            .filter(|row| row.cell == cell.label)
            .filter_map(|row| row.quoted())
            .collect();
        let ratio = range(&own).map_or(String::new(), |how| format!("{how} times as efficient"));
        return Some((pair.baseline, pair.candidate, ratio));
    }
    match names[..] {
        [a, b, ..] => Some((a, b, String::new())),
        [a] => Some((a, a, String::new())),
        [] => None,
    }
}

/// Writes the lead picture; nothing where there are no pictures.
///
/// # Errors
/// I/O.
pub(super) fn lead(
    folder: &RecordFolder,
    stored: &Stored,
    rows: &[EfficiencyRow],
) -> Result<Option<FigureBlock>> {
    let (Some((left, right, ratio)), Some(cell)) =
        (lead_pair(stored, rows), stored.record.cells.first())
    else {
        return Ok(None);
    };
    split::lead(folder, stored, (0, cell), [left, right], &ratio).map(Some)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;
    use crate::verify::comparisons::comparisons;

    fn told(stored: &Stored) -> String {
        let rows = comparisons(stored);
        let (cost, pairs) = pairs(stored, &rows);
        pairs.iter().map(|pair| pair.sentence(stored, cost)).collect::<Vec<_>>().join("\n")
    }

    #[test]
    fn a_pair_has_a_sentence_with_its_ratio_and_its_agreement() {
        let stored = sample::stored(0.1);
        let text = told(&stored);
        assert!(text.starts_with("`snee` is "), "{text}");
        assert!(
            text.contains("times as efficient as `mis` (variance of a pixel times counted work)"),
            "{text}"
        );
        assert!(text.contains(". Their means agree within "), "{text}");
        let rows = comparisons(&stored);
        let (left, right, ratio) = lead_pair(&stored, &rows).expect("a pair");
        assert_eq!((left, right), ("mis", "snee"));
        assert!(ratio.ends_with("times as efficient"), "{ratio}");
    }

    #[test]
    fn means_that_differ_are_told_and_not_called_equal() {
        let mut stored = sample::stored(0.1);
        sample::set_observables(&mut stored, "snee", |i, _, band| {
            let off = if band == 0 { 0.3 } else { 0.0 };
            1.0 + off + 0.05 * sample::uniform(i + 7000)
        });
        let text = told(&stored);
        assert!(
            text.contains("in 1 of 2 bands and cells there is no ratio: the means differ"),
            "{text}"
        );
        sample::set_observables(&mut stored, "snee", |i, _, _| 1.3 + 0.05 * sample::uniform(i + 7000));
        let text = told(&stored);
        assert!(text.contains("is not known in any of 2 bands and cells: the means differ"), "{text}");
        assert!(!text.contains("agree"), "{text}");
        let rows = comparisons(&stored);
        assert_eq!(lead_pair(&stored, &rows).expect("a pair").2, "", "no ratio in the picture");
    }

    #[test]
    fn ranges_are_short() {
        assert_eq!(range(&[]), None);
        assert_eq!(range(&[[5.684, 5.541, 5.832]]).as_deref(), Some("5.68 [5.54, 5.83]"));
        assert_eq!(range(&[[5.68, 5.5, 5.8], [8.72, 8.5, 9.0]]).as_deref(), Some("5.7 to 8.7"));
        assert_eq!(range(&[[2.01, 1.0, 3.0], [2.02, 1.0, 3.0]]).as_deref(), Some("about 2.0"));
    }
}
