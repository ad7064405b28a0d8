//! The content of the page: the experiment, claims and verdicts, then efficiency, pictures and plots,
//! measurements, cost, and how to reproduce it.

use super::answer;
use super::data::{FOREIGN_TIMING, ReportData};
use super::document::{Document, PageBlock, TableBlock};
use super::plots::Section;
use super::summary;
use super::table::Table;
use super::tables::{
    claim_table, comparison_table, measurement_table, model_error_table, verdict_table,
};
use super::undecided::{Undecided, two_digits_up, undecided};
use crate::results::json::canonical;
use crate::results::measurements::Measurement;
use crate::results::number::significant;
use crate::results::record::{CostMeasure, EstimatorRun};
use crate::verify::levels::FAMILY_LEVEL;
use crate::verify::verdict::Outcome;
use crate::verify::weights::{self, DRIFT_LIMIT};

/// With more verdicts that are undecided their table is folded: what they have in common is above it.
const MOST_OPEN_VERDICTS: usize = 12;
/// Tables with more rows are folded.
const OPEN_ROWS: usize = 40;
/// With more cells their measurements are folded.
const OPEN_CELLS: usize = 4;

/// The page of one record.
pub(super) fn page(data: &ReportData) -> Document {
    let mut blocks = asked(data);
    if data.stored.record.samplers.is_empty() {
        blocks.extend(answer::blocks(data));
    }
    blocks.extend(claims(data));
    if data.stored.record.samplers.is_empty() {
        blocks.extend(efficiency(data));
        blocks.extend(pictures(data));
        blocks.extend(super::split::blocks(&data.splits));
        blocks.extend(super::strip::blocks(&data.strips));
        blocks.extend(model_errors(data));
        blocks.extend(data.plots.iter().flat_map(Section::blocks));
        blocks.extend(measured(data));
        blocks.extend(cost(data));
        blocks.extend(notes(data));
    } else {
        blocks.extend(samplers(data));
        blocks.extend(data.plots.iter().flat_map(Section::blocks));
    }
    blocks.extend(origin(data));
    Document { title: data.stored.record.experiment.clone(), blocks }
}

/// The description of the experiment, and its size.
fn asked(data: &ReportData) -> Vec<PageBlock> {
    let record = &data.stored.record;
    let description = record.resolved["description"].as_str().unwrap_or_default();
    let mut blocks = Vec::new();
    if !description.is_empty() {
        blocks.push(PageBlock::Text(description.split_whitespace().collect::<Vec<_>>().join(" ")));
    }
    if !record.samplers.is_empty() {
        blocks.push(PageBlock::Text(format!("{} samplers.", record.samplers.len())));
        return blocks;
    }
    let bands: Vec<&str> = record.bands.iter().map(|band| band.name.as_str()).collect();
    let bands = match &bands[..] {
        [first, .., last] if bands.len() > 6 => format!("{} bands, {first} to {last}", bands.len()),
        [one] => format!("band {one}"),
        few => format!("bands {}", few.join(", ")),
    };
    let runs = || record.cells.iter().flat_map(|cell| &cell.runs);
    let mut names: Vec<&str> = Vec::new();
    for run in runs().filter(|run| run.control_of.is_none()) {
        if !names.contains(&run.estimator.as_str()) {
            names.push(&run.estimator);
        }
    }
    let passes = |pick: fn(u64, u64) -> u64| runs().map(|run| run.passes).reduce(pick).unwrap_or(0);
    let passes = match (passes(u64::min), passes(u64::max)) {
        (least, most) if least == most => format!("{least}"),
        (least, most) => format!("{least} to {most}"),
    };
    let cells = match record.cells.len() {
        1 => "One cell".into(),
        n => format!("{n} cells"),
    };
    blocks.push(PageBlock::Text(format!(
        "{cells}, {bands}; estimators {}; {passes} passes each.",
        names.join(", ")
    )));
    blocks
}

fn heading(text: &str) -> PageBlock {
    PageBlock::Heading(2, text.into())
}

fn named(name: &str, table: Table) -> PageBlock {
    PageBlock::Table(TableBlock::new(name, "", table))
}

/// Blocks, folded under a title if they are long.
fn folded_if(is_long: bool, title: &str, blocks: Vec<PageBlock>) -> Vec<PageBlock> {
    if is_long { vec![PageBlock::Folded(title.into(), blocks)] } else { blocks }
}

fn claims(data: &ReportData) -> Vec<PageBlock> {
    let verdicts = &data.verdicts;
    if verdicts.is_empty() {
        return Vec::new();
    }
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let failed = verdicts.iter().filter(|v| v.outcome == Outcome::Fail).count();
    let text = format!(
        "{green} of {} comparisons hold, {failed} fail, {} could not be judged. The probability of any false \
         failure in the verification that judged them is at most {FAMILY_LEVEL:.0e} (Holm). \"detectable\" is \
         the smallest true difference, relative to the expected value (absolute where that is 0), that its test \
         would have found with 99 % probability. That the tests find planted defects and hold their levels is \
         measured: docs/verification.md of the program.",
        verdicts.len(),
        verdicts.len() - green - failed,
    );
    let (green_ones, others): (Vec<_>, Vec<_>) = verdicts.iter().cloned().partition(|v| v.is_green());
    let mut blocks =
        vec![heading("Claims"), PageBlock::Text(text), named("claims", claim_table(verdicts))];
    if !others.is_empty() {
        blocks.push(PageBlock::Heading(3, "Verdicts that are not green".into()));
        let groups = undecided(verdicts);
        if !groups.is_empty() {
            blocks.push(PageBlock::List(groups.iter().map(|group| cause(data, group)).collect()));
        }
        let table = named("verdicts-not-green", verdict_table(&others));
        let title = format!("All {} verdicts that are not green", others.len());
        blocks.extend(folded_if(failed == 0 && others.len() > MOST_OPEN_VERDICTS, &title, vec![table]));
    }
    if !green_ones.is_empty() {
        let title = format!(
            "The {} verdicts that are green, each with the smallest defect that it would have found",
            green_ones.len()
        );
        blocks.push(PageBlock::Folded(title, vec![named("verdicts-green", verdict_table(&green_ones))]));
    }
    blocks
}

/// Why verdicts are undecided, and the passes that would decide them.
fn cause(data: &ReportData, group: &Undecided) -> String {
    let Some(factor) = group.factor() else {
        return format!("{}; no number of passes is known to decide all of them.", group.sentence());
    };
    let cpu: f64 = data
        .stored
        .timing
        .iter()
        .flat_map(|timing| timing.cells.values().flat_map(|cell| cell.values()))
        .map(|spent| spent.all_seconds())
        .sum();
    let seconds =
        if cpu > 0.0 { format!(", about {} CPU s", two_digits_up(factor * cpu)) } else { String::new() };
    let runs = || data.stored.record.cells.iter().flat_map(|cell| &cell.runs).map(|run| run.passes);
    match (runs().min(), runs().max()) {
        (Some(least), Some(most)) if least == most => format!(
            "{}; `--set budget.passes={}`{seconds}, would probably decide them.",
            group.sentence(),
            two_digits_up(factor * most as f64)
        ),
        _ => format!(
            "{}; {factor:.1} times the passes{seconds}, would probably decide them.",
            group.sentence()
        ),
    }
}

/// The tests of samplers, and the precision of their expected masses.
fn samplers(data: &ReportData) -> Vec<PageBlock> {
    let text = "Draws are counted in bins chosen from the density alone (coarse + fine). \"detectable\" is \
                the relative error of the density, of equal magnitude in all coarse bins, that would have been \
                found with 99 % probability. Seconds are of this machine and this run.";
    let table = super::terminal::sampler_table(data);
    let mut masses = Table::new(&["sampler", "kind", "total mass - 1", "bound", "evaluations", "note"]);
    for run in &data.stored.record.samplers {
        masses.push(vec![
            run.sampler.clone(),
            run.kind.clone(),
            format!("{:.1e}", run.total - 1.0),
            format!("{:.1e}", run.total_bound),
            run.evaluations.to_string(),
            if run.exhausted { "the budget of evaluations was spent".into() } else { String::new() },
        ]);
    }
    let quadrature = "The masses of the bins, by quadrature of the density.";
    vec![
        heading("Samplers"),
        PageBlock::Text(text.into()),
        named("samplers", table),
        heading("Expected masses"),
        PageBlock::Text(quadrature.into()),
        named("masses", masses.without_empty_columns()),
    ]
}

/// The pictures of every cell.
fn pictures(data: &ReportData) -> Vec<PageBlock> {
    match &data.viewers[..] {
        [] => Vec::new(),
        [one] => vec![heading("Pictures"), PageBlock::Viewer(one.clone())],
        many => vec![heading("Pictures"), PageBlock::Cells(many.to_vec())],
    }
}

fn measured(data: &ReportData) -> Vec<PageBlock> {
    let record = &data.stored.record;
    let bands: Vec<String> = record.bands.iter().map(|band| band.name.clone()).collect();
    let text = "Every observable, by class: means over passes; in brackets one standard error in units of the \
                last digit.";
    let mut blocks = vec![heading("Measurements")];
    blocks.extend(summary::means(&data.stored, &data.rows).map(PageBlock::Table));
    blocks.push(PageBlock::Text(text.into()));
    for (index, cell) in record.cells.iter().enumerate() {
        let rows: Vec<&Measurement> = data.rows.iter().filter(|row| row.cell == cell.label).collect();
        let table = named(&format!("measurements-{index:03}"), measurement_table(&rows, &bands));
        let is_long = record.cells.len() > OPEN_CELLS || rows.len() / bands.len().max(1) > OPEN_ROWS;
        let named_cell = cell.title();
        let title = if record.cells.len() == 1 { "All measurements" } else { &named_cell };
        if !is_long && record.cells.len() > 1 {
            blocks.push(PageBlock::Heading(3, named_cell.clone()));
        }
        blocks.extend(folded_if(is_long, title, vec![table]));
    }
    blocks
}

fn model_errors(data: &ReportData) -> Vec<PageBlock> {
    if data.model_errors.is_empty() {
        return Vec::new();
    }
    let text = "The error of a model's mean relative to light transport, with the 95 % interval in brackets. It is \
                a property of the model, not of an implementation: it is not a claim and cannot fail.";
    let table = named("model-errors", model_error_table(&data.model_errors));
    let mut blocks = vec![heading("Model errors"), PageBlock::Text(text.into())];
    blocks.extend(summary::model_errors(&data.stored, &data.model_errors).map(PageBlock::Table));
    blocks.push(PageBlock::Folded("By class".into(), vec![table]));
    blocks
}

fn efficiency(data: &ReportData) -> Vec<PageBlock> {
    if data.comparisons.is_empty() {
        return Vec::new();
    }
    let by_cpu: Vec<_> = data.comparisons.iter().filter(|row| row.cost == CostMeasure::Cpu).collect();
    let text = format!(
        "Variance of a pass times its cost, of `against` over that of `candidate`: above 1, the candidate is the better. \
         In brackets the 95 % interval. By counters the cost is a weighted sum of counts, the same on every machine; \
         by CPU time it is this machine's, {}. A ratio is quoted where the two means agree; it is not resolved where \
         more passes could still change it or where a single pass may dominate it.",
        summary::clock_words(&by_cpu)
    );
    let table = named("efficiency-by-class", comparison_table(&data.comparisons));
    let mut blocks = vec![heading("Efficiency")];
    let by = |cost| summary::efficiency(&data.stored, &data.comparisons, cost).map(PageBlock::Table);
    match (by(CostMeasure::Cpu), by(CostMeasure::Counters)) {
        (Some(cpu), counters) => {
            blocks.push(cpu);
            let folded = |table| PageBlock::Folded("The same by counted work".into(), vec![table]);
            blocks.extend(counters.map(folded));
        }
        (None, counters) => blocks.extend(counters),
    }
    let title = "By transport class, by counted work and by CPU time, with reasons";
    blocks.push(PageBlock::Folded(title.into(), vec![PageBlock::Text(text), table]));
    if let Some(drift) = weights::drift(&weights::timed(&data.stored)).filter(|d| *d > DRIFT_LIMIT) {
        blocks.push(PageBlock::Text(format!(
            "CPU times of these runs deviate by up to {:.0} % from what the counters' weights predict: measure the \
             weights again, or compare by CPU time.",
            100.0 * drift
        )));
    }
    blocks
}

fn cost(data: &ReportData) -> Vec<PageBlock> {
    let runs =
        data.stored.record.cells.iter().flat_map(|cell| cell.runs.iter().map(move |run| (cell, run)));
    let mut table =
        Table::new(&["cell", "estimator", "passes", "CPU seconds", "wall seconds", "paths / s", "work"]);
    for (cell, run) in runs {
        let cost = data.stored.timing.as_ref().and_then(|timing| timing.of(&cell.label, &run.estimator));
        let seconds = |pick: fn(f64, f64) -> f64| {
            cost.map_or(String::new(), |c| significant(pick(c.all_seconds(), c.wall_seconds), 3))
        };
        let rate = cost.and_then(|c| c.paths_per_second());
        let work: Vec<String> = run
            .cost
            .iter()
            .filter(|(_, count)| **count > 0)
            .map(|(name, count)| format!("{name} {count}"))
            .collect();
        table.push(vec![
            cell.label.clone(),
            run.estimator.clone(),
            run.passes.to_string(),
            seconds(|cpu, _| cpu),
            seconds(|_, wall| wall),
            rate.map_or(String::new(), |rate| significant(rate, 3)),
            work.join(", "),
        ]);
    }
    let text = "Seconds are of this machine and this run, without an interval; counts of work are exactly \
                reproducible. Paths are per CPU second.";
    let mut blocks = vec![heading("Cost"), PageBlock::Text(text.into())];
    if data.stored.has_foreign_timing {
        blocks.push(PageBlock::Text(format!("{FOREIGN_TIMING}.")));
    }
    blocks.push(named("cost", table.without_empty_columns()));
    blocks
}

fn notes(data: &ReportData) -> Vec<PageBlock> {
    let mut items = Vec::new();
    let cells = &data.stored.record.cells;
    for cell in cells {
        for run in &cell.runs {
            let place = match cells.len() {
                1 => run.estimator.clone(),
                _ => format!("{}, {}", cell.title(), run.estimator),
            };
            let counted = run.anomalies.iter().filter(|(_, count)| **count > 0);
            items.extend(counted.map(|(name, count)| {
                format!("{}: {count} of `{name}`{}", place.trim(), of_paths(run, *count))
            }));
            items.extend(run.notes.iter().map(|note| format!("{}: {note}", place.trim())));
        }
    }
    if items.is_empty() {
        return Vec::new();
    }
    vec![heading("Anomalies and notes"), PageBlock::List(items)]
}

/// The part of the paths that a count is, where paths are counted.
fn of_paths(run: &EstimatorRun, count: u64) -> String {
    match run.cost.get("paths") {
        Some(paths) if *paths > 0 => {
            format!(" in {paths} paths ({} %)", significant(100.0 * count as f64 / *paths as f64, 2))
        }
        _ => String::new(),
    }
}

fn origin(data: &ReportData) -> Vec<PageBlock> {
    let record = &data.stored.record;
    let mut table = Table::new(&["", "value"]);
    let mut row = |key: &str, value: String| table.push(vec![key.into(), value]);
    row("experiment, blake3", record.experiment_hash.clone());
    row("claims, blake3", record.claims_hash.clone());
    row("fingerprint", record.fingerprint.clone());
    let mut command = "scatterproof run FILE".to_string();
    if let Some(p) = &data.provenance {
        let dirty = if p.dirty == Some(true) { ", with uncommitted changes" } else { "" };
        row("commit", format!("{}{dirty}", p.commit.as_deref().unwrap_or("unknown")));
        row("version", p.version.clone());
        row("rustc", p.rustc.clone());
        row("target", format!("{} {}", p.target, p.target_features.join(" ")).trim_end().into());
        row("CPU", p.cpu.clone());
        row("threads", p.threads.to_string());
        row("date", p.date.clone());
        command = p.command.join(" ");
    }
    let again = PageBlock::Text("The command that made this report:".into());
    let resolved = PageBlock::Code(canonical(&record.resolved));
    let resolved = PageBlock::Folded("The experiment as it was run, every value".into(), vec![resolved]);
    vec![heading("Provenance"), named("provenance", table), again, PageBlock::Code(command), resolved]
}
