//! Tables and images for people, made from a record and its timing alone, again at will.

use serde_json::{Value, json};

use crate::error::Result;
use crate::results::exr_file::write_exr;
use crate::results::image::{Picture, write_png};
use crate::results::measurements::{self, Measurement, measurements};
use crate::results::provenance::Provenance;
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::{RecordFolder, Stored};
use crate::results::timing::Timing;
use crate::results::{atomic, json::canonical};
use crate::verify::comparisons;
use crate::verify::judge::{Case, Looks, judge};
use crate::verify::model_errors::{self, ModelError, model_errors};
use crate::verify::verdict::{self, Verdict};

/// Bytes as text, for data URIs.
mod base64;
/// A page as blocks, in Markdown.
pub mod document;
/// The same page as HTML.
pub mod html;
/// Tables for papers.
pub mod latex;
/// Numbers with their uncertainty.
pub mod number;
/// What the page says.
mod page;
/// Plots as SVG.
pub mod plot;
/// The plots of a record.
pub mod plots;
/// Two estimators in one picture.
pub mod split;
/// The tables that a text quotes.
pub mod summary;
/// Aligned text, Markdown and CSV.
pub mod table;
/// The tables that everybody wants.
pub mod tables;
/// For the terminal.
pub mod terminal;
/// How the tests were tested.
mod trust;
/// Pictures to be compared.
pub mod viewer;

/// Everything that a report is made from.
pub struct Material {
    /// The record.
    pub stored: Stored,
    /// What it cost, where it was measured.
    pub timing: Option<Timing>,
    /// What made it, where it was noted.
    pub provenance: Option<Provenance>,
    /// What verification says of it.
    pub verdicts: Vec<Verdict>,
    /// Everything that was measured.
    pub rows: Vec<Measurement>,
    /// Efficiencies of pairs of estimators.
    pub comparisons: Vec<comparisons::Row>,
    /// Models against light transport itself.
    pub model_errors: Vec<ModelError>,
    /// The pictures, in the order of cells and estimators.
    pub figures: Vec<Figure>,
    /// The same by cell, to be compared.
    pub viewers: Vec<viewer::Viewer>,
    /// Grids of split pictures.
    pub splits: Vec<split::SplitFigure>,
    /// Plots.
    pub plots: Vec<plots::Section>,
}

/// A picture of one run.
pub struct Figure {
    /// Cell label.
    pub cell: String,
    /// Estimator name.
    pub estimator: String,
    /// Path relative to the results folder, without extension.
    pub stem: String,
    /// The PNG file.
    pub png: Vec<u8>,
    /// What it shows and what it cannot.
    pub caption: String,
}

/// Makes every derived view of a results folder: `measurements.csv`, `comparisons.csv`, `model_errors.csv` where there are
/// models, `verdicts.csv`, `summary.json`, `images/`, `plots/`, `tables/`, `report.md`, `report.tex` and `report.html`. The record is judged by itself, with the second look that a
/// verification may have left beside it.
pub fn write(folder: &RecordFolder) -> Result<Material> {
    let stored = folder.read()?;
    let retest = folder.retest_of(&stored)?;
    let looks = if retest.is_some() { Looks::Two } else { Looks::One };
    let verdicts = judge(&[Case { main: &stored, retest: retest.as_ref() }], looks).verdicts;
    write_judged(folder, stored, verdicts)
}

/// The same with verdicts at hand: those of this record, from a family of several.
pub fn write_judged(folder: &RecordFolder, stored: Stored, verdicts: Vec<Verdict>) -> Result<Material> {
    let (timing, provenance) = (folder.read_timing()?, folder.read_provenance()?);
    folder.clear_pictures()?;
    let rows = measurements(&stored, timing.as_ref());
    let figures = write_figures(folder, &stored)?;
    let viewers = viewer::viewers(&stored, &figures)?;
    let stored = Stored { timing: timing.clone(), ..stored };
    let wanted = folder.read_pictures()?;
    let mut splits = split::write_splits(folder, &stored, &split::wanted(&wanted))?;
    viewer::keep_room(&viewers, splits.iter_mut().map(|split| &mut split.viewer));
    let comparisons = comparisons::comparisons(&stored);
    let model_errors = model_errors(&stored);
    let plots = plots::sections(&stored, &comparisons, &wanted);
    folder.clear_views("plots")?;
    plots.iter().try_for_each(|section| section.write(folder))?;
    let material = Material {
        stored,
        timing,
        provenance,
        verdicts,
        rows,
        comparisons,
        model_errors,
        figures,
        viewers,
        splits,
        plots,
    };
    let page = page::page(&material);
    write_tables(folder, &page)?;
    let views = [
        ("measurements.csv", measurements::to_csv(&material.rows)),
        ("comparisons.csv", comparisons::to_csv(&material.comparisons)),
        ("verdicts.csv", verdict::to_csv(&material.verdicts)),
        ("summary.json", canonical(&summary(&material))),
        ("report.md", page.to_markdown()),
        ("report.tex", latex::to_document(&page)),
        ("report.html", html::to_html(&page)),
    ];
    for (name, text) in views {
        folder.write_view(name, text.as_bytes())?;
    }
    if !material.model_errors.is_empty() {
        folder
            .write_view("model_errors.csv", model_errors::to_csv(&material.model_errors).as_bytes())?;
    }
    Ok(material)
}

/// Every table of the page as Markdown, CSV and LaTeX.
fn write_tables(folder: &RecordFolder, page: &document::Document) -> Result<()> {
    folder.clear_views("tables")?;
    for block in page.tables() {
        let document::TableBlock { name, caption, table } = block;
        let forms = [
            ("md", table.to_markdown()),
            ("csv", table.to_csv()),
            ("tex", latex::to_latex(table, name, caption)),
        ];
        for (extension, text) in forms {
            folder.write_view(&format!("tables/{name}.{extension}"), text.as_bytes())?;
        }
    }
    Ok(())
}

/// The numbers of a record for programs: what was measured and how many claims hold.
fn summary(material: &Material) -> Value {
    let count = |name: &str| material.verdicts.iter().filter(|v| v.outcome.to_string() == name).count();
    let record = &material.stored.record;
    json!({
        "experiment": record.experiment,
        "experiment_hash": record.experiment_hash,
        "claims_hash": record.claims_hash,
        "fingerprint": record.fingerprint,
        "numbers": material.stored.numbers(),
        "exit_code": verdict::exit_code(&material.verdicts),
        "verdicts": {
            "pass": count("pass"),
            "fail": count("fail"),
            "underpowered": count("underpowered"),
            "invalid": count("invalid"),
        },
        "measurements": material.rows,
    })
}

/// Of so many bands those that have pictures of their own: all of three, and of more the first, the middle and the last.
fn few_bands(count: usize) -> Vec<usize> {
    match count {
        0..=3 => (0..count).collect(),
        _ => vec![0, count / 2, count - 1],
    }
}

fn write_figures(folder: &RecordFolder, stored: &Stored) -> Result<Vec<Figure>> {
    let stops = stored.record.resolved["display"]["exposure_stops"].as_f64().unwrap_or(0.0);
    let mut figures = Vec::new();
    for (index, cell) in stored.record.cells.iter().enumerate() {
        for (number, run) in cell.runs.iter().enumerate() {
            if let Some(picture) = Picture::of(stored, run) {
                let stem = stem(index, number, &run.estimator);
                figures.push(write_figure(folder, stored, cell, (run, stem), &picture, stops)?);
            }
        }
    }
    Ok(figures)
}

/// Path of a run's picture without extension: the name that people know it by, where that is plain, and
/// otherwise its number and what is plain of the name.
fn stem(cell: usize, run: usize, estimator: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if estimator.chars().all(is_plain) {
        return format!("images/{cell:03}-{estimator}");
    }
    let words: Vec<&str> = estimator.split(|c| !is_plain(c)).filter(|word| !word.is_empty()).collect();
    format!("images/{cell:03}-{run:03}.{}", words.join("-"))
}

fn write_figure(
    folder: &RecordFolder,
    stored: &Stored,
    cell: &Cell,
    (run, stem): (&EstimatorRun, String),
    picture: &Picture,
    stops: f64,
) -> Result<Figure> {
    let path = |extension: &str| folder.root().join(format!("{stem}.{extension}"));
    atomic::create_folder(&folder.root().join("images"), "create the image folder")?;
    let attributes = [
        ("experiment", stored.record.experiment.as_str()),
        ("cell", &cell.label),
        ("estimator", &run.estimator),
        ("passes", &run.passes.to_string()),
        ("fingerprint", &stored.record.fingerprint),
    ];
    write_exr(&path("exr"), picture, &attributes)?;
    let png = write_png(&path("png"), picture, stops)?;
    let mut caption = format!("{} passes, exposure {stops:+} stops, clipped to sRGB", run.passes);
    if png.clipped > 0 {
        caption += &format!("; pixels too bright: {}", png.clipped);
    }
    if png.out_of_gamut > 0 {
        caption += &format!("; pixels outside the gamut or not finite: {}", png.out_of_gamut);
    }
    let (cell, estimator) = (cell.label.clone(), run.estimator.clone());
    Ok(Figure { cell, estimator, stem, png: png.bytes, caption })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::sample;
    use crate::results::timing::Cost;

    #[test]
    fn views_are_made_from_the_folder_alone_and_again() {
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path().join("sample"));
        let mut stored = sample::judged(&[("holds", 1.0), ("does <not>", 2.0)]);
        stored.record.cells[0].runs[0].anomalies.insert("wrong_side".into(), 3);
        stored.record.cells[0].runs[1].notes.push("cannot sample x".into());
        folder.write(stored.record, stored.arrays).expect("a record");
        let mut timing = Timing::default();
        timing.add(
            "smooth",
            "mis",
            Cost { cpu_seconds: 2.0, wall_seconds: 1.0, passes: 256, paths: 1000 },
        );
        folder.write_timing(&timing).expect("a timing");
        folder.write_provenance(&Provenance::collect(2)).expect("a provenance");
        write(&folder).expect("a report");

        let read = |name: &str| std::fs::read_to_string(folder.root().join(name)).expect(name);
        let (markdown, html) = (read("report.md"), read("report.html"));
        let wanted = [
            "does &lt;not&gt;",
            "wrong_side",
            "cannot sample x",
            "\"linear\":\"iVBOR",
            "src=\"images/000-mis.png\"",
            "class=\"fail\"",
        ];
        wanted.iter().for_each(|w| assert!(html.contains(w), "{w}"));
        assert!(!html.contains("http"), "nothing is fetched");
        assert!(markdown.contains("](images/000-mis.png)"), "{markdown}");
        assert!(markdown.contains(" 500 |"), "{markdown}");
        let summary: Value = serde_json::from_str(&read("summary.json")).expect("JSON");
        assert_eq!((&summary["verdicts"]["pass"], &summary["exit_code"]), (&json!(1), &json!(1)));
        assert_eq!(read("verdicts.csv").lines().count(), 3);

        write(&folder).expect("a report");
        assert_eq!((read("report.md"), read("report.html")), (markdown, html));
    }

    #[test]
    fn pictures_of_an_earlier_record_go_and_names_are_no_paths() {
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path().join("sample"));
        let stored = sample::stored(0.5);
        folder.write(stored.record.clone(), stored.arrays.clone()).expect("a record");
        write(&folder).expect("a report");
        folder.write_view("images/of-mine.png", b"").expect("a file");
        let mut renamed = stored;
        renamed.record.cells[0].runs[0].estimator = "../mean, as published".into();
        folder.write(renamed.record, renamed.arrays).expect("a record");
        write(&folder).expect("a report");
        let names = std::fs::read_dir(folder.root().join("images")).expect("a folder").flatten();
        let mut names: Vec<_> = names.map(|entry| entry.file_name()).collect();
        names.sort();
        let runs = ["000-000.mean-as-published.exr", "000-000.mean-as-published.png"];
        assert_eq!(names[..2], runs);
        assert_eq!(names[2..], ["000-snee.exr", "000-snee.png", "of-mine.png"]);
    }
}
