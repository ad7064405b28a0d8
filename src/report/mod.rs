//! Tables and images for readers, made from a record and its timing alone, so that they can be made again at
//! any time.

use serde_json::{Value, json};

pub(crate) use self::data::ReportData;
use crate::error::Result;
use crate::results::json::canonical;
use crate::results::lock;
use crate::results::measurements::{self, measurements};
use crate::results::store::{RecordFolder, Stored};
use crate::verify::comparisons;
use crate::verify::judge::{Case, Looks, judge};
use crate::verify::model_errors::{self, model_errors};
use crate::verify::verdict::{self, Verdict};

/// The head of a page: what the record says in a few words.
mod answer;
/// Base64, for data URIs.
mod base64;
/// Input of the views.
pub(crate) mod data;
/// A page as blocks, in Markdown.
pub(crate) mod document;
/// The same page as HTML.
pub(crate) mod html;
/// Tables for papers.
pub(crate) mod latex;
/// Text as HTML shows it.
mod markup;
/// A page for verdicts without a record of their own.
pub(crate) mod outcome;
/// The content of the page.
mod page;
/// The pictures of runs.
pub(crate) mod pictures;
/// Plots as SVG.
pub(crate) mod plot;
/// The plots of a record.
pub(crate) mod plots;
/// Split pictures: two estimators in one picture.
pub(crate) mod split;
/// Pictures band by band.
mod strip;
/// Tables that papers quote: a row per cell and band.
pub(crate) mod summary;
/// Aligned text, Markdown and CSV.
pub(crate) mod table;
/// Tables of claims, verdicts, measurements, efficiencies and model errors.
pub(crate) mod tables;
/// Tables for the terminal.
pub(crate) mod terminal;
/// What would decide verdicts that are neither green nor failed.
pub(crate) mod undecided;
/// Viewers that compare pictures.
pub(crate) mod viewer;

/// Makes every view of a results folder: `measurements.csv`, `comparisons.csv`, `verdicts.csv`,
/// `summary.json`, `model_errors.csv` where there are models, `images/`, `plots/`, `tables/`,
/// `report.md`, `report.tex` and `report.html`. The record is judged by itself, together with the
/// second look that a verification may have left beside it.
pub(crate) fn write(folder: &RecordFolder) -> Result<ReportData> {
    let stored = folder.read()?;
    let retest = folder.retest_of(&stored)?;
    let looks = if retest.is_some() { Looks::Two } else { Looks::ALONE };
    let verdicts = judge(&[Case { main: &stored, retest: retest.as_ref() }], looks).verdicts;
    write_judged(folder, stored, verdicts)
}

/// The same with given verdicts on this record, from a family of several records.
pub(crate) fn write_judged(
    folder: &RecordFolder,
    stored: Stored,
    verdicts: Vec<Verdict>,
) -> Result<ReportData> {
    let _lock = lock::lock(folder.root())?;
    let provenance = folder.read_provenance()?;
    let rows = measurements(&stored, stored.timing.as_ref());
    folder.clear_views()?;
    let pictures = pictures::write_pictures(folder, &stored)?;
    let viewers = viewer::viewers(&stored, &pictures)?;
    let wanted = folder.read_pictures()?;
    let mut splits = split::write_splits(folder, &stored, &split::wanted(&wanted))?;
    let strips = strip::write_strips(folder, &stored, &wanted)?;
    viewer::keep_room(&viewers, splits.iter_mut().map(|split| &mut split.viewer));
    let comparisons = comparisons::comparisons(&stored);
    let model_errors = model_errors(&stored);
    let plots = plots::sections(&stored, &comparisons, &wanted);
    plots.iter().try_for_each(|section| section.write(folder))?;
    let lead = answer::lead(folder, &stored, &comparisons)?;
    let data = ReportData {
        stored,
        lead,
        provenance,
        verdicts,
        rows,
        comparisons,
        model_errors,
        viewers,
        splits,
        strips,
        plots,
    };
    let page = page::page(&data);
    write_tables(folder, &page)?;
    let views = [
        ("measurements.csv", measurements::to_csv(&data.rows)),
        ("comparisons.csv", comparisons::to_csv(&data.comparisons)),
        ("verdicts.csv", verdict::to_csv(&data.verdicts)),
        ("summary.json", canonical(&summary(&data))),
        ("report.md", page.to_markdown()),
        ("report.tex", latex::to_document(&page)),
        ("report.html", html::to_html(&page)),
    ];
    for (name, text) in views {
        folder.write_view(name, text.as_bytes())?;
    }
    if !data.model_errors.is_empty() {
        folder.write_view("model_errors.csv", model_errors::to_csv(&data.model_errors).as_bytes())?;
    }
    folder.write_manifest(&data.stored.record)?;
    Ok(data)
}

/// Every table of the page as Markdown, CSV and LaTeX.
fn write_tables(folder: &RecordFolder, page: &document::Document) -> Result<()> {
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
fn summary(data: &ReportData) -> Value {
    let count = |name: &str| data.verdicts.iter().filter(|v| v.outcome.to_string() == name).count();
    let record = &data.stored.record;
    json!({
        "experiment": record.experiment,
        "experiment_hash": record.experiment_hash,
        "claims_hash": record.claims_hash,
        "fingerprint": record.fingerprint,
        "numbers": data.stored.numbers(),
        "exit_code": verdict::exit_code(&data.verdicts),
        "verdicts": {
            "pass": count("pass"),
            "fail": count("fail"),
            "underpowered": count("underpowered"),
            "invalid": count("invalid"),
        },
        "measurements": data.rows,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::provenance::Provenance;
    use crate::results::sample;
    use crate::results::timing::{TimeSpent, Timing};

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
            TimeSpent {
                cpu_seconds: 2.0,
                set_up_seconds: 0.0,
                wall_seconds: 1.0,
                passes: 256,
                paths: 1000,
            },
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
        // The answer is at the top: badges, sentences and the split picture come before the first section.
        let head = html.split("<h2").next().expect("a head");
        for wanted in [
            "badge pass\">1 of 2 comparisons holds",
            "badge fail\">1 fails",
            "class=\"lead\"",
            "as efficient as",
        ] {
            assert!(head.contains(wanted), "{wanted}: {head}");
        }
        assert!(folder.root().join("images/lead.png").exists());
        let pdf = std::fs::read_dir(folder.root().join("plots")).expect("plots").flatten();
        let pdf: Vec<_> =
            pdf.filter(|file| file.path().extension().is_some_and(|e| e == "pdf")).collect();
        assert!(!pdf.is_empty() && read("report.tex").contains(".pdf}"), "plots are PDF, too");
        assert!(markdown.contains("](images/000-mis.png)"), "{markdown}");
        assert!(markdown.contains(" 500 |"), "{markdown}");
        let summary: Value = serde_json::from_str(&read("summary.json")).expect("JSON");
        assert_eq!((&summary["verdicts"]["pass"], &summary["exit_code"]), (&json!(1), &json!(1)));
        assert_eq!(read("verdicts.csv").lines().count(), 3);

        write(&folder).expect("a report");
        assert_eq!((read("report.md"), read("report.html")), (markdown, html));
    }

    /// What has nothing to say has no heading.
    #[test]
    fn no_section_is_empty() {
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path().join("sample"));
        let stored = sample::stored(0.5);
        folder.write(stored.record, stored.arrays).expect("a record");
        write(&folder).expect("a report");
        let html = std::fs::read_to_string(folder.root().join("report.html")).expect("a page");
        assert!(
            !html.contains(">Claims<") && !html.contains("badges\">") && !html.contains(">Anomalies"),
            "{html}"
        );
        let headings: Vec<&str> = html.split("<h2").skip(1).collect();
        for section in headings {
            let (_, body) = section.split_once("</h2>").expect("its end");
            assert!(body.trim().len() > 40, "{section}");
        }
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
        assert_eq!(names[2..], ["000-snee.exr", "000-snee.png", "lead.png", "of-mine.png"]);
    }
}
