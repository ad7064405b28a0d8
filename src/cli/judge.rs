//! `scatterproof judge`.

use std::io::Write;
use std::path::{Path, PathBuf};

use super::console::Console;
use super::output::unwritable;
use crate::error::{Error, Result};
use crate::report::document::{FigureBlock, PictureFile};
use crate::report::outcome;
use crate::report::tables::verdict_table;
use crate::results::exr_file::{Part, read_exr, write_parts};
use crate::results::image::write_diverging_png;
use crate::results::number::{per_cent, significant};
use crate::results::store::{RecordFolder, Stored};
use crate::results::{
    atomic,
    record::{Cell, EstimatorRun},
};
use crate::verify::foreign::efficiency::{Ratio, ratios};
use crate::verify::foreign::images::{Planes, planes};
use crate::verify::foreign::{Answer, LEVEL, PixelMap, Question, judge, run_of};
use crate::verify::junit;
use crate::verify::verdict::{self, Outcome, Verdict};

/// z-scores of this size have full colour.
const Z_LIMIT: f64 = 5.0;

/// Relative differences of this size have full colour.
const RELATIVE_LIMIT: f64 = 0.1;

/// Test images of another renderer against a record of the same scene.
///
/// IMAGES are OpenEXR files of the same scene, each rendered with a different seed: linear radiance,
/// the resolution of the record, row 0 at the top, box filter. The tests cover the image mean, the 4 x
/// 4 tiles and the squared bias of all pixels per band, use the errors of both sides, and are one
/// family at
/// --level.
///
/// Without --independent-pixels a seed is one observation: two seeds have one degree of freedom and find
/// nothing; use eight or more. With it the spread of the pixels is used too, and two seeds suffice.
///
/// Exit codes: 0 no bias was found, and a bias of --detect of an image mean would have been found; 1 a
/// bias was found; 2 bad input; 3 such a bias could have gone unseen (underpowered), or the test would
/// be meaningless (invalid).
#[derive(clap::Args, Debug)]
pub(super) struct Args {
    /// The images, two or more.
    #[arg(required = true, value_name = "IMAGES")]
    images: Vec<PathBuf>,
    /// The results folder that holds the record.
    #[arg(long, value_name = "DIR")]
    reference: PathBuf,
    /// Label of the cell; required if the record has several.
    #[arg(long, value_name = "LABEL")]
    cell: Option<String>,
    /// Estimator of the record; required if the cell has several.
    #[arg(long, value_name = "NAME")]
    estimator: Option<String>,
    /// Transport class of the images. For classes other than `all` only the image mean is tested.
    #[arg(long, value_name = "CLASS", default_value = "all")]
    class: String,
    /// Assign a channel to a band if the names do not tell; may be repeated.
    #[arg(long, value_name = "BAND=CHANNEL")]
    channel: Vec<String>,
    /// Factor from the images' unit to the record's.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = super::positive)]
    scale: f64,
    /// CPU seconds of one image, or of each as FILE=SECONDS (repeated); compares the efficiency.
    #[arg(long, value_name = "[FILE=]SECONDS")]
    seconds: Vec<String>,
    /// Assert that the noise of different pixels is independent: box filter, independent samples.
    #[arg(long)]
    independent_pixels: bool,
    /// Probability of any false alarm in the whole call.
    #[arg(long, value_name = "P", default_value_t = LEVEL, value_parser = super::probability)]
    level: f64,
    /// The bias of an image mean that must not go unseen, as a fraction of the mean.
    #[arg(long, value_name = "FRACTION", default_value_t = 0.05, value_parser = super::positive)]
    detect: f64,
    /// Write a page (judge.html), verdicts.csv, z-scores and relative differences (judge.exr, *.png) into this
    /// folder.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Write the verdicts as JUnit XML.
    #[arg(long, value_name = "FILE")]
    junit: Option<PathBuf>,
    /// Print every verdict; default: image means, pixels, and verdicts that are not green.
    #[arg(long, short)]
    verbose: bool,
}

/// Judges the images and prints the result.
///
/// # Errors
/// Bad input, no record, I/O. A bias is no error: it is the exit code.
pub(super) fn run(args: &Args, out: &mut impl Write) -> Result<u8> {
    let folder = RecordFolder::new(&args.reference);
    let stored = folder.read()?;
    let cell = cell(&stored, args.cell.as_deref())?;
    let run = run_of(&stored, cell, &estimator(&stored, cell, args.estimator.as_deref())?)?;
    let names: Vec<String> = args.images.iter().map(|path| path.display().to_string()).collect();
    let seconds = seconds(&args.seconds, &args.images)?;
    let planes = read(args, &stored, run, &names)?;
    let question = Question {
        stored: &stored,
        cell,
        estimator: &run.estimator,
        class: &args.class,
        level: args.level,
        detect: args.detect,
        independent_pixels: args.independent_pixels,
    };
    let answer = judge(&question, &planes)?;
    let cost = seconds.and_then(|theirs| cost(&stored, cell, run, &planes, theirs));
    if let Some(path) = &args.out {
        let figures = write_views(path, &answer, &planes)?;
        let title = format!("{} images against {}", planes.seeds.len(), run.estimator);
        let page = outcome::page(&title, sentences(args, &answer), figures, &answer.verdicts);
        atomic::write(&path.join("judge.html"), page.as_bytes(), "write the page")?;
    }
    if let Some(path) = &args.junit {
        atomic::write(path, junit::to_junit(&answer.verdicts).as_bytes(), "write the JUnit file")?;
    }
    tell(args, &answer, &planes, cost.as_deref(), out).map_err(unwritable)?;
    Ok(verdict::exit_code(&answer.verdicts))
}

fn read(args: &Args, stored: &Stored, run: &EstimatorRun, names: &[String]) -> Result<Planes> {
    let mut images = Vec::new();
    for (path, name) in args.images.iter().zip(names) {
        let image = read_exr(path).map_err(|error| match error {
            Error::Record { .. } => {
                error.of_input("name linear OpenEXR images, as renderers write them")
            }
            error => error,
        })?;
        images.push((name.clone(), image));
    }
    let mut channels = Vec::new();
    for word in &args.channel {
        let Some((band, channel)) = word.split_once('=') else {
            let rule = format!("--channel {word} is not BAND=CHANNEL");
            return Err(Error::input_help(rule, "as --channel R=Beauty.R"));
        };
        channels.push((band.to_string(), channel.to_string()));
    }
    let size = run.image.as_ref().map_or((0, 0), |image| (image.width, image.height));
    planes(&images, &stored.record.bands, size, &channels, args.scale)
}

/// The cell that a label names, blanks aside.
fn cell(stored: &Stored, label: Option<&str>) -> Result<usize> {
    let cells = &stored.record.cells;
    let plain = |text: &str| text.split_whitespace().collect::<String>();
    let labels = || cells.iter().map(|c| format!("`{}`", c.label)).collect::<Vec<_>>().join(", ");
    match label {
        None if cells.len() == 1 => Ok(0),
        None => Err(Error::input_help(
            format!("the record has {} cells", cells.len()),
            format!("select one with --cell: {}", labels()),
        )),
        Some(label) => {
            // As the record names it, or as `run` prints it: `alpha = 0.1`.
            let is_meant =
                |c: &Cell| [&c.label, &c.title()].iter().any(|known| plain(known) == plain(label));
            cells.iter().position(is_meant).ok_or_else(|| {
                let rule = format!("the record has no cell `{label}`");
                Error::input_help(rule, format!("it has {}", labels()))
            })
        }
    }
}

fn estimator(stored: &Stored, cell: usize, name: Option<&str>) -> Result<String> {
    let runs = &stored.record.cells[cell].runs;
    match (name, runs.as_slice()) {
        (Some(name), _) => Ok(name.into()),
        (None, [run]) => Ok(run.estimator.clone()),
        (None, _) => {
            let names: Vec<&str> = runs.iter().map(|run| run.estimator.as_str()).collect();
            Err(Error::input_help(
                format!("the record's cell has {} estimators", runs.len()),
                format!("select one with --estimator: {}", names.join(", ")),
            ))
        }
    }
}

/// CPU seconds of all images together.
fn seconds(words: &[String], images: &[PathBuf]) -> Result<Option<f64>> {
    let number = |text: &str| match text.parse::<f64>() {
        Ok(x) if x.is_finite() && x > 0.0 => Ok(x),
        _ => Err(Error::input_help(
            format!("--seconds: `{text}` is not a number above 0"),
            "CPU seconds of one image, or FILE=SECONDS for each",
        )),
    };
    match words {
        [] => Ok(None),
        [each] if !each.contains('=') => Ok(Some(number(each)? * images.len() as f64)),
        words => {
            let mut sum = 0.0;
            for image in images {
                let is_of = |file: &str| {
                    Path::new(file) == image || Some(file) == image.file_name().and_then(|n| n.to_str())
                };
                let own = words.iter().filter_map(|word| word.rsplit_once('='));
                let own: Vec<&str> = own.filter(|(file, _)| is_of(file)).map(|(_, s)| s).collect();
                let [one] = own[..] else {
                    return Err(Error::input_help(
                        format!("--seconds has {} times for {}", own.len(), image.display()),
                        "one number for every image, or FILE=SECONDS for each of them",
                    ));
                };
                sum += number(one)?;
            }
            Ok(Some(sum))
        }
    }
}

fn cost(
    stored: &Stored,
    cell: usize,
    run: &EstimatorRun,
    planes: &Planes,
    theirs: f64,
) -> Option<Vec<Ratio>> {
    let cost =
        stored.timing.as_ref().and_then(|t| t.of(&stored.record.cells[cell].label, &run.estimator));
    let per_pass = cost.and_then(|cost| cost.cpu_seconds_per_pass());
    per_pass.map(|ours| ratios(stored, cell, run, planes, [theirs, ours * run.passes as f64]))
}

/// Writes the pictures and the table.
fn write_views(folder: &Path, answer: &Answer, planes: &Planes) -> Result<Vec<FigureBlock>> {
    let mut figures = Vec::new();
    atomic::create_folder(folder, "create the folder")?;
    let csv = verdict::to_csv(&answer.verdicts);
    atomic::write(&folder.join("verdicts.csv"), csv.as_bytes(), "write the verdicts")?;
    if answer.maps.is_empty() {
        return Ok(figures);
    }
    let single = |values: &[f64]| values.iter().map(|x| *x as f32).collect::<Vec<f32>>();
    let part = |map: &PixelMap| -> Part {
        let channels = [
            ("z", &map.z),
            ("relative_difference", &map.relative),
            ("mean", &map.mean),
            ("std_error", &map.std_error),
        ];
        (map.band.clone(), channels.map(|(name, values)| (name.to_string(), single(values))).to_vec())
    };
    let parts = answer.maps.iter().map(part).collect();
    write_parts(&folder.join("judge.exr"), (planes.width, planes.height), parts, &[])?;
    for map in &answer.maps {
        let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '-' };
        let band: String = map.band.chars().map(plain).collect();
        let pictures = [("z", &map.z, Z_LIMIT), ("relative", &map.relative, RELATIVE_LIMIT)];
        for (name, values, limit) in pictures {
            let file = format!("{name}-{band}.png");
            let path = folder.join(&file);
            write_diverging_png(&path, planes.width, values, limit)?;
            let picture = std::fs::read(&path).map_err(Error::io(&path, "read the picture"))?;
            let what = if name == "z" { "z-score of the images' mean" } else { "relative difference" };
            figures.push(FigureBlock {
                path: file,
                picture: PictureFile::Png(picture),
                title: format!("{name}, band {}", map.band),
                caption: format!("{what}, blue to red from -{limit} to {limit}; grey: no value."),
            });
        }
    }
    Ok(figures)
}

/// What the tests found, in sentences.
fn sentences(args: &Args, answer: &Answer) -> Vec<String> {
    let means = answer.verdicts.iter().filter(|v| v.observable == "mean").filter_map(|v| v.detectable);
    let worst = means.filter(|d| d.is_finite()).max_by(f64::total_cmp);
    let power = worst.map(|worst| {
        format!(
            "A bias of an image mean of {} would have been found with 99 % probability; the family-wise level is {:e}.",
            per_cent(worst),
            args.level
        )
    });
    power.into_iter().chain(answer.notes.iter().cloned()).collect()
}

fn tell(
    args: &Args,
    answer: &Answer,
    planes: &Planes,
    cost: Option<&[Ratio]>,
    out: &mut impl Write,
) -> std::io::Result<()> {
    let verdicts = &answer.verdicts;
    let shown = verdicts.iter().filter(|v| {
        args.verbose || !v.is_green() || ["mean", "pixels"].contains(&v.observable.as_str())
    });
    // Every row is of the same claim and cell.
    let blank = |v: &Verdict| Verdict { claim: String::new(), cell_title: String::new(), ..v.clone() };
    let rows: Vec<Verdict> = shown.map(blank).collect();
    let console = Console::of_output();
    write!(out, "{}", console.outcomes(&console.laid_out(&verdict_table(&rows))))?;
    for note in &answer.notes {
        writeln!(out, "{}", console.wrapped(&format!("note: {note}"), usize::MAX))?;
    }
    let green = verdicts.iter().filter(|v| v.is_green()).count();
    writeln!(
        out,
        "{} images: {green} of {} verdicts are green; family-wise level {:e} (Holm)",
        planes.seeds.len(),
        verdicts.len(),
        args.level
    )?;
    let means = verdicts.iter().filter(|v| v.observable == "mean").filter_map(|v| v.detectable);
    if let Some(worst) = means.filter(|d| d.is_finite()).max_by(f64::total_cmp) {
        let power = format!(
            "bias of an image mean that would have been found (99 % power): {}; `detectable` is relative \
             to the image mean",
            per_cent(worst)
        );
        writeln!(out, "{}", console.wrapped(&power, usize::MAX))?;
    }
    if verdicts.iter().any(|v| matches!(v.outcome, Outcome::Invalid(_) | Outcome::Underpowered)) {
        let advice = "undecided: images with further seeds narrow the images' side; a larger budget of the \
                      record narrows the record's, and where that has a heavy tail nothing else helps";
        writeln!(out, "{}", console.wrapped(advice, usize::MAX))?;
    }
    if args.seconds.is_empty() {
        return Ok(());
    }
    let Some(cost) = cost else {
        return writeln!(out, "efficiency: there is no timing for the record");
    };
    cost.iter().try_for_each(|ratio| writeln!(out, "{}", efficiency(ratio, verdicts)))
}

/// The efficiency of one band as text; no ratio where the image means were not found equal, because the
/// two sides then estimate different things.
fn efficiency(ratio: &Ratio, verdicts: &[Verdict]) -> String {
    let head = format!("efficiency, band {}: ", ratio.band);
    let own = || verdicts.iter().filter(|v| v.band == ratio.band);
    let is_equal = own().any(|v| v.observable == "mean" && v.is_green());
    if !is_equal || own().any(|v| v.outcome == Outcome::Fail) {
        return head + "not compared, because the means were not found equal";
    }
    let number = |x: f64| significant(x, 3);
    let [low, high] = ratio.interval.map(number);
    match &ratio.unresolved {
        Some(reason) => {
            format!("{head}not resolved ({reason}); variance x CPU seconds about {} of the record's", {
                number(ratio.ratio)
            })
        }
        None => format!(
            "{head}variance x CPU seconds {} times the record's, 95 % interval {low} to {high}",
            number(ratio.ratio)
        ),
    }
}
