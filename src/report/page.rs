//! What the page says: claims and verdicts first, then what was measured, then what it cost and how
//! to make it again.

use super::Material;
use super::document::{Block, Document, TableBlock};
use super::number::significant;
use super::table::{
    Table, claim_table, comparison_table, measurement_table, model_error_table, verdict_table,
};
use crate::results::measurements::Measurement;
use crate::verify::levels::FAMILY_LEVEL;
use crate::verify::verdict::Outcome;
use crate::verify::weights::{self, DRIFT_LIMIT};

/// The page of one record.
pub(super) fn page(material: &Material) -> Document {
    let mut blocks = claims(material);
    if material.stored.record.samplers.is_empty() {
        blocks.extend(measured(material));
        blocks.extend(super::split::blocks(&material.splits));
        blocks.extend(super::running::blocks(&material.running));
        blocks.extend(model_errors(material));
        blocks.extend(efficiency(material));
        blocks.extend(cost(material));
        blocks.extend(notes(material));
    } else {
        blocks.extend(samplers(material));
    }
    if !material.verdicts.is_empty() {
        blocks.extend(super::trust::blocks());
    }
    blocks.extend(origin(material));
    Document { title: material.stored.record.experiment.clone(), blocks }
}

fn heading(text: &str) -> Block {
    Block::Heading(2, text.into())
}

fn named(name: &str, table: Table) -> Block {
    Block::Table(TableBlock::new(name, "", table))
}

fn claims(material: &Material) -> Vec<Block> {
    let verdicts = &material.verdicts;
    if verdicts.is_empty() {
        return vec![heading("Claims"), Block::Text("This experiment claims nothing.".into())];
    }
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    let failed = verdicts.iter().filter(|v| v.outcome == Outcome::Fail).count();
    let text = format!(
        "{green} of {} comparisons hold, {failed} fail, {} could not be judged. The probability of any false \
         failure in the verification that judged them is at most {FAMILY_LEVEL:.0e} (Holm). \"detectable\" is the smallest true difference, relative \
         to the expected value (absolute where that is 0), that its test would have found with 99 % probability.",
        verdicts.len(),
        verdicts.len() - green - failed,
    );
    // What is not green comes first.
    let mut ordered = verdicts.clone();
    ordered.sort_by_key(|v| v.is_green());
    let (summary, verdicts) =
        (named("claims", claim_table(verdicts)), named("verdicts", verdict_table(&ordered)));
    vec![heading("Claims"), Block::Text(text), summary, heading("Verdicts"), verdicts]
}

/// What was drawn, and how exactly it is known what should have been.
fn samplers(material: &Material) -> Vec<Block> {
    let text = "Draws are counted in cells chosen by the density alone (coarse + fine). \"detectable\" is \
                the relative error of the density, of one size in all coarse cells, that would have been \
                found with 99 % probability. Seconds are of this machine and this run.";
    let table = super::terminal::sampler_table(material);
    let mut masses = Table::new(&["sampler", "kind", "total mass - 1", "bound", "evaluations", "note"]);
    for run in &material.stored.record.samplers {
        masses.push(vec![
            run.sampler.clone(),
            run.kind.clone(),
            format!("{:.1e}", run.total - 1.0),
            format!("{:.1e}", run.total_bound),
            run.evaluations.to_string(),
            if run.exhausted { "the budget of evaluations was spent".into() } else { String::new() },
        ]);
    }
    let quadrature = "The masses of the cells, by quadrature of the density.";
    vec![
        heading("Samplers"),
        Block::Text(text.into()),
        named("samplers", table),
        heading("Expected masses"),
        Block::Text(quadrature.into()),
        named("masses", masses.without_empty_columns()),
    ]
}

fn measured(material: &Material) -> Vec<Block> {
    let record = &material.stored.record;
    let bands: Vec<String> = record.bands.iter().map(|band| band.name.clone()).collect();
    let text = "Means over passes; in brackets one standard error in units of the last digit.";
    let mut blocks = vec![heading("Measurements"), Block::Text(text.into())];
    for (index, cell) in record.cells.iter().enumerate() {
        if !cell.label.is_empty() {
            blocks.push(Block::Heading(3, cell.label.clone()));
        }
        let rows: Vec<&Measurement> =
            material.rows.iter().filter(|row| row.cell == cell.label).collect();
        let viewer = material.viewers.iter().find(|viewer| viewer.cell == cell.label);
        blocks.extend(viewer.cloned().map(Block::Viewer));
        blocks.push(named(&format!("measurements-{index:03}"), measurement_table(&rows, &bands)));
    }
    blocks
}

fn model_errors(material: &Material) -> Vec<Block> {
    if material.model_errors.is_empty() {
        return Vec::new();
    }
    let text = "What a model's mean is off by, relative to light transport itself; in brackets the 95 % interval. A \
                property of the model, not of an implementation: it is no claim and cannot fail.";
    let table = named("model-errors", model_error_table(&material.model_errors));
    vec![heading("Model errors"), Block::Text(text.into()), table]
}

fn efficiency(material: &Material) -> Vec<Block> {
    if material.comparisons.is_empty() {
        return Vec::new();
    }
    let text = "Variance of a pass times its cost, of the first estimator over the other: above 1 the other is the \
                better. In brackets the 95 % interval. By counters the cost is a weighted sum of counts, the same on \
                every machine; by CPU time it is this machine's, and fair only where the two were timed side by side. \
                A ratio is quoted where the two means agree; it is not resolved where more passes would still move \
                it or a single pass may make it.";
    let table = named("efficiency", comparison_table(&material.comparisons));
    let mut blocks = vec![heading("Efficiency"), Block::Text(text.into()), table];
    if let Some(drift) = weights::drift(&weights::timed(&material.stored)).filter(|d| *d > DRIFT_LIMIT) {
        blocks.push(Block::Text(format!(
            "CPU times of these runs deviate by up to {:.0} % from what the counters' weights predict: measure the \
             weights again, or compare by CPU time.",
            100.0 * drift
        )));
    }
    blocks
}

fn cost(material: &Material) -> Vec<Block> {
    let runs = material
        .stored
        .record
        .cells
        .iter()
        .flat_map(|cell| cell.runs.iter().map(move |run| (cell, run)));
    let mut table =
        Table::new(&["cell", "estimator", "passes", "CPU seconds", "wall seconds", "paths / s", "work"]);
    for (cell, run) in runs {
        let cost = material.timing.as_ref().and_then(|timing| timing.of(&cell.label, &run.estimator));
        let seconds = |pick: fn(f64, f64) -> f64| {
            cost.map_or(String::new(), |c| significant(pick(c.cpu_seconds, c.wall_seconds), 3))
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
    vec![heading("Cost"), Block::Text(text.into()), named("cost", table.without_empty_columns())]
}

fn notes(material: &Material) -> Vec<Block> {
    let mut items = Vec::new();
    for cell in &material.stored.record.cells {
        for run in &cell.runs {
            let place = format!("{} {}", cell.label, run.estimator);
            let counted = run.anomalies.iter().filter(|(_, count)| **count > 0);
            items.extend(counted.map(|(name, count)| format!("{}: {count} of `{name}`", place.trim())));
            items.extend(run.notes.iter().map(|note| format!("{}: {note}", place.trim())));
        }
    }
    if items.is_empty() {
        items.push("No anomalies were counted, and no estimator has a reservation.".into());
    }
    vec![heading("Anomalies and notes"), Block::List(items)]
}

fn origin(material: &Material) -> Vec<Block> {
    let record = &material.stored.record;
    let mut table = Table::new(&["", "value"]);
    let mut row = |key: &str, value: String| table.push(vec![key.into(), value]);
    row("experiment, blake3", record.experiment_hash.clone());
    row("claims, blake3", record.claims_hash.clone());
    row("fingerprint", record.fingerprint.clone());
    let mut command = "scatterproof run FILE".to_string();
    if let Some(p) = &material.provenance {
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
    let again = Block::Text("The command that made it:".into());
    vec![heading("Provenance"), named("provenance", table), again, Block::Code(command)]
}
