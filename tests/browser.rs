//! The report's viewer in a real browser. A script at the end of a copy of the page acts as a reader
//! would, and prints what it found to the browser's console, which goes to its standard error.
//!
//! The browser is `SCATTERPROOF_BROWSER`, or the first of chromium, chromium-browser and google-chrome
//! on the path.

use std::io::{BufRead, BufReader, Cursor};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::Duration;

use scatterproof::results::image::Picture;
use scatterproof::results::store::RecordFolder;
use serde_json::{Value, json};

use super::work::{IMAGE, Work, replaced};

const SCRIPT: &str = include_str!("data/browser-test.js");
/// Prefix of the script's outcome.
const MARK: &str = "BROWSER-TEST ";
/// A browser that prints nothing for so long has failed.
const PATIENCE: Duration = Duration::from_secs(20);

fn browser() -> PathBuf {
    if let Some(given) = std::env::var_os("SCATTERPROOF_BROWSER") {
        return given.into();
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&path).flat_map(|folder| names.map(|name| folder.join(name)));
    found
        .into_iter()
        .find(|path| path.is_file())
        .expect("no chromium on the path: install it, or name a browser in SCATTERPROOF_BROWSER")
}

/// A browser with a page open, until it is dropped.
struct Open {
    child: Child,
    lines: Receiver<String>,
    _profile: tempfile::TempDir,
}

impl Open {
    fn page(page: &Path, is_dark: bool) -> Open {
        let profile = tempfile::tempdir().expect("a folder");
        let scheme = format!("--blink-settings=preferredColorScheme={}", u8::from(!is_dark));
        let mut command = Command::new(browser());
        command.args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
        ]);
        command.args([
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
        ]);
        command.args(["--enable-logging=stderr", "--window-size=1200,900", &scheme]);
        command.arg(format!("--user-data-dir={}", profile.path().display()));
        command.arg(format!("file://{}", page.display()));
        // A group of its own: the browser is many processes.
        let piped = command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = piped.process_group(0).spawn().expect("the browser starts");
        let (sender, lines) = channel();
        let errors = BufReader::new(child.stderr.take().expect("a pipe"));
        std::thread::spawn(move || {
            for line in errors.lines().map_while(Result::ok) {
                if sender.send(line).is_err() {
                    break;
                }
            }
        });
        Open { child, lines, _profile: profile }
    }

    /// Findings of the script.
    fn outcome(&self) -> Value {
        let mut said = String::new();
        loop {
            let Ok(line) = self.lines.recv_timeout(PATIENCE) else {
                panic!("the browser did not say how the test went:\n{said}");
            };
            if let Some((_, outcome)) = line.split_once(MARK) {
                // `CONSOLE(1)] "the message", source: file:///...`
                let end = outcome.rfind("\", source:").unwrap_or(outcome.len());
                return serde_json::from_str(&outcome[..end]).expect("JSON");
            }
            said += &(line + "\n");
        }
    }
}

impl Drop for Open {
    fn drop(&mut self) {
        let group = format!("-{}", self.child.id());
        let _ = Command::new("bash").args(["-c", "kill -KILL -- \"$1\"", "bash", &group]).status();
        let _ = self.child.wait();
    }
}

/// A report with pictures, and the facts of its record that the script checks.
struct Report {
    work: Work,
    page: String,
    expected: Value,
}

impl Report {
    fn of(text: &str, name: &str) -> Report {
        let work = Work::with(text);
        work.run("run x.toml -q").exits(0);
        let root = work.path(&format!("results/{name}"));
        let expected = expected(&root);
        let page = std::fs::read_to_string(root.join("report.html")).expect("a page");
        Report { work, page, expected }
    }

    /// Two cells, two estimators, three bands, few passes.
    fn small() -> Report {
        let text = replaced(IMAGE, "passes = 100", "passes = 24");
        let sweep = "[[sweep]]\nname = \"g\"\nkeys = [\"object.medium.coefficients.g\"]\n\
                     rows = [{ label = '</script><b>\"&', values = [0.0] }, { label = \"0.6\", values = [0.6] }]\n";
        let split = "[[picture]]\nsplit = { left = \"mis\", right = \"analog\", columns = \"g\" }\n";
        let mut report = Report::of(&(text + sweep + split), "x");
        report.expected["grid"] = json!(grid(&report.work.path("results/x/images/split-1.png")));
        report
    }

    /// The page with the script at its end.
    fn test_page(&self, what: &str, is_dark: bool) -> PathBuf {
        let mut test = self.expected.clone();
        (test["what"], test["dark"]) = (what.into(), is_dark.into());
        let script = format!("<script>const TEST = {test};\n{SCRIPT}</script></body>");
        let name = format!("{what}.html");
        self.work.write(&name, &replaced(&self.page, "</body>", &script));
        self.work.path(&name)
    }

    fn test(&self, what: &str, is_dark: bool) -> Value {
        sound(Open::page(&self.test_page(what, is_dark), is_dark).outcome())
    }
}

/// The outcome of a test without findings.
fn sound(outcome: Value) -> Value {
    let failures = outcome["failures"].as_array().expect("failures");
    let lines: Vec<&str> = failures.iter().filter_map(Value::as_str).collect();
    assert!(lines.is_empty(), "of {} checks failed:\n{}", outcome["checks"], lines.join("\n"));
    outcome
}

/// The values of all pixels as record and PNG files have them.
fn expected(root: &Path) -> Value {
    let stored = RecordFolder::new(root).read().expect("a record");
    let bands = stored.record.bands.len();
    let (mut cells, mut limits, mut size) = (Vec::new(), Vec::new(), (0, 0));
    for (index, cell) in stored.record.cells.iter().enumerate() {
        let pictures = cell.runs.iter().map(|run| {
            let picture = Picture::of(&stored, run).expect("an image");
            size = (picture.width, picture.height);
            let mean = |band| picture.mean(band).collect::<Vec<f64>>();
            let error = |band| picture.std_error(band).collect::<Vec<f64>>();
            json!({
                "name": run.estimator,
                "png": png(&root.join(format!("images/{index:03}-{}.png", run.estimator))),
                "rgb": picture.rgb().collect::<Vec<_>>(),
                "mean": (0..bands).map(mean).collect::<Vec<_>>(),
                "error": (0..bands).map(error).collect::<Vec<_>>(),
            })
        });
        cells.push(json!(pictures.collect::<Vec<_>>()));
        let [a, b] = [1, 0].map(|run| Picture::of(&stored, &cell.runs[run]).expect("an image"));
        let relative =
            (0..bands).flat_map(|band| a.mean(band).zip(b.mean(band)).map(|(a, b)| ((a - b) / b).abs()));
        let mut sizes: Vec<f64> = relative.filter(|x| !x.is_nan()).collect();
        sizes.sort_by(f64::total_cmp);
        // None where nothing is lit.
        let most = sizes.get(((0.95 * sizes.len() as f64).ceil() as usize).saturating_sub(1));
        let most = most.copied().unwrap_or(0.0);
        limits.push([0.01, 0.03, 0.1, 0.3].into_iter().find(|limit| most <= *limit).unwrap_or(1.0));
    }
    let names: Vec<&str> = stored.record.bands.iter().map(|band| band.name.as_str()).collect();
    let passes = stored.record.cells[0].runs[0].passes;
    json!({
        "width": size.0, "height": size.1, "cells": cells, "limits": limits, "bands": names, "passes": passes,
    })
}

/// A pixel each of the split picture of two tiles of 12 x 12 pixels: they are shown as squares of 16 x
/// 16, with a seam of one pixel and a gap of six.
fn grid(path: &Path) -> Vec<u8> {
    let (sheet, mut pixels) = (png(path), Vec::new());
    let width = 2 * (12 * 16 + 1) + 6;
    for y in 0..12 {
        for x in 0..24 {
            let (tile, column) = (x / 12, x % 12);
            let left = tile * (12 * 16 + 1 + 6) + column * 16 + 8 + usize::from(column >= 6);
            let at = 3 * ((16 * y + 8) * width + left);
            pixels.extend(&sheet[at..at + 3]);
        }
    }
    pixels
}

fn png(path: &Path) -> Vec<u8> {
    let bytes = std::fs::read(path).expect("a picture");
    let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().expect("a PNG");
    let mut data = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut data).expect("a frame");
    data
}

#[test]
#[ignore = "needs a browser; .ci/run installs one and runs this"]
fn browser_viewer_does_what_hands_ask() {
    let outcome = Report::small().test("behaviour", false);
    println!("{} checks", outcome["checks"]);
    assert!(outcome["checks"].as_u64() > Some(10_000), "{outcome}");
}

#[test]
#[ignore = "needs a browser; .ci/run installs one and runs this"]
fn browser_text_is_readable_in_both_schemes() {
    let report = Report::small();
    for is_dark in [false, true] {
        let outcome = report.test("contrast", is_dark);
        println!("least contrast, dark {is_dark}: {}", outcome["least"]);
        assert_eq!(outcome["dark"], is_dark);
    }
}

/// In a frame: a window is never as narrow as a phone.
#[test]
#[ignore = "needs a browser; .ci/run installs one and runs this"]
fn browser_page_fits_a_phone() {
    let report = Report::small();
    report.test_page("narrow", false);
    let frame = "<!doctype html><iframe src=\"narrow.html\" width=\"360\" height=\"740\" style=\"border: 0\"></iframe>";
    report.work.write("frame.html", frame);
    sound(Open::page(&report.work.path("frame.html"), false).outcome());
}

#[test]
#[ignore = "needs a browser; .ci/run installs one and runs this"]
fn browser_opens_nine_cells_at_once() {
    let nine = include_str!("../experiments/compare/nine-cells.toml");
    let second = "[[estimator]]\nname = \"other\"\npath = {}\n\n[[sweep]]\nname = \"boundary\"";
    let text = replaced(nine, "[[sweep]]\nname = \"boundary\"", second);
    let report = Report::of(&replaced(&text, "passes = 1024", "passes = 8"), "nine-cells");
    let size = report.page.len();
    let outcome = report.test("speed", false);
    assert_eq!(outcome["viewers"], 9, "{outcome}");
    assert!(outcome["late"].as_u64() >= Some(4), "those out of sight wait: {outcome}");
    let times = outcome["times"].as_array().expect("times");
    let mut times: Vec<f64> = times.iter().filter_map(Value::as_f64).collect();
    times.sort_by(f64::total_cmp);
    println!("{size} bytes; milliseconds until loaded and drawn: {times:.0?}");
    assert!(size < 5_000_000, "{size} bytes");
    assert!(times[times.len() / 2] < 1000.0, "{times:?}");
}
