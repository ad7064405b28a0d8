//! How the tests themselves were tested, as published with the program: which planted defects they find,
//! and that they hold their levels.

use super::document::{Block, TableBlock};
use super::table::Table;
use crate::results::csv_text::rows;

/// Made by `cargo test --release --test power -- matrix`.
const BLINDNESS: &str = include_str!("../../results/published/blindness.csv");

/// Made by the long version of `src/stats/calibration.rs`.
const CALIBRATION: &str = include_str!("../../results/published/calibration.csv");

/// The section of the page.
pub(super) fn blocks() -> Vec<Block> {
    let (defects, matrix) = matrix(&rows(BLINDNESS));
    let text = format!(
        "Before a test is believed it is seen to fail. {defects} defects were planted one by one in a second path \
         tracer, in samplers and in the verifier's arithmetic, and every one must turn the verification red at the \
         budgets of continuous integration. Seeds that caught each, and the tests that saw it with every seed:"
    );
    let levels = "And it is seen to hold its level: runs with a true hypothesis, driven by another random generator, \
                  and the shares of p-values below 1e-2 and 1e-3.";
    let matrix = Block::Table(TableBlock::new("planted-defects", "", matrix));
    let calibration = Block::Table(TableBlock::new("calibration", "", calibration(&rows(CALIBRATION))));
    vec![
        Block::Heading(2, "How these tests were tested".into()),
        Block::Text(text),
        Block::Folded("Planted defects, and what sees them".into(), vec![matrix]),
        Block::Text(levels.into()),
        Block::Folded("Levels, measured".into(), vec![calibration]),
    ]
}

/// The number of planted defects, and their table. Columns: defect, seeds, caught, then the tests.
fn matrix(rows: &[Vec<String>]) -> (usize, Table) {
    let mut table = Table::new(&["defect", "caught", "seen by"]);
    let Some((tests, defects)) = rows.split_first() else { return (0, table) };
    for row in defects {
        let always =
            tests.iter().zip(row).skip(3).filter(|(_, count)| !count.is_empty() && **count == row[1]);
        let names: Vec<&str> = always.map(|(test, _)| test.as_str()).collect();
        table.push(vec![row[0].clone(), format!("{}/{}", row[2], row[1]), names.join(", ")]);
    }
    let planted = defects.iter().filter(|row| row[0] != "sham").count();
    (planted, table)
}

/// Columns: group, what, runs, distance and p of a test of uniformity, shares below 1e-2 and 1e-3, kept.
fn calibration(rows: &[Vec<String>]) -> Table {
    let mut table = Table::new(&["test", "runs", "below 1e-2", "below 1e-3", "level"]);
    for row in rows.iter().filter(|row| row[0] == "null") {
        let kept = if row[7] == "true" { "kept" } else { "broken" };
        let [what, runs, hundredth, thousandth] = [1, 2, 5, 6].map(|column| row[column].clone());
        table.push(vec![what, runs, hundredth, thousandth, kept.into()]);
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_published_is_shown() {
        let (defects, matrix) = matrix(&rows(BLINDNESS));
        assert_eq!(matrix.rows.len(), defects + 1, "and the sham");
        assert!(defects > 50);
        let row = |name: &str| matrix.rows.iter().find(|row| row[0] == name).expect(name);
        assert!(row("sham")[1].starts_with("0/") && row("sham")[2].is_empty());
        assert!(row("phase-flipped")[2].contains("slab.UR1"));
        let calibration = calibration(&rows(CALIBRATION));
        assert!(calibration.rows.iter().any(|row| row[0] == "binomial, exact"), "a name with a comma");
        assert!(calibration.rows.iter().all(|row| row[4] == "kept"));
    }
}
