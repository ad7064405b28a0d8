//! A viewer that compares the pictures of one cell. It has one PNG per estimator for readers without scripts,
//! and the input of the page's script: linear values, and maps of noise, of differences and of their
//! z-scores.

use serde::Serialize;

use super::base64;
use super::document::{FigureBlock, ViewerBlock};
use super::pictures::{RunPicture, few_bands};
use crate::error::Result;
use crate::results::image::{Picture, to_byte_png, to_linear_png};
use crate::results::number::significant;
use crate::results::record::{Cell, EstimatorRun, StatedBias};
use crate::results::store::Stored;
use crate::stats::tails::student_two_sided;
use crate::verify::means::SKEWNESS_LIMIT;

/// The viewer in HTML.
mod html;
/// False-colour maps.
mod maps;

pub(crate) use html::{cells, parts, to_html};

/// Bytes of all viewers of a page together; a browser opens that much at once.
const ROOM: usize = 24_000_000;

#[derive(Serialize)]
struct Data<'a> {
    cell: &'a str,
    width: usize,
    height: usize,
    /// Tiles per row; each has its own seam.
    columns: usize,
    /// The exposure of the PNG files.
    stops: f64,
    /// Names of the bands that have maps.
    bands: Vec<&'a str>,
    bands_note: String,
    /// Ends of the scale of differences.
    limit: f64,
    z_limit: f64,
    noise_range: (f64, f64),
    pictures: Vec<PictureData<'a>>,
}

#[derive(Default, Serialize)]
struct PictureData<'a> {
    name: &'a str,
    about: String,
    linear: String,
    noise: Vec<String>,
    difference: Option<Maps<'a>>,
    z: Option<Maps<'a>>,
    /// Why there is no z-score: no other estimator has the same integral.
    alone: String,
}

/// One map per band, with one note per band.
#[derive(Serialize)]
struct Maps<'a> {
    of: &'a str,
    maps: Vec<String>,
    notes: Vec<String>,
}

/// The viewers of all cells that have pictures.
///
/// # Errors
/// Pictures without pixels.
pub(super) fn viewers(stored: &Stored, pictures: &[RunPicture]) -> Result<Vec<ViewerBlock>> {
    viewers_within(stored, pictures, ROOM)
}

fn viewers_within(stored: &Stored, pictures: &[RunPicture], room: usize) -> Result<Vec<ViewerBlock>> {
    let (mut viewers, mut left) = (Vec::new(), Some(room));
    for cell in &stored.record.cells {
        let figures: Vec<FigureBlock> =
            pictures.iter().filter(|p| p.cell == cell.label).map(|p| p.figure.clone()).collect();
        if figures.is_empty() {
            continue;
        }
        let mut data = None;
        if let Some(room) = left {
            let text = json(stored, cell)?;
            left = room.checked_sub(text.len());
            data = left.map(|_| text);
        }
        viewers.push(ViewerBlock { cell: cell.title(), figures, data });
    }
    Ok(viewers)
}

/// A run with its pixels.
#[derive(Clone, Copy)]
struct Shot<'a> {
    run: &'a EstimatorRun,
    picture: Picture<'a>,
}

fn json(stored: &Stored, cell: &Cell) -> Result<String> {
    let shot = |run| Some(Shot { run, picture: Picture::of(stored, run)? });
    let shots: Vec<Shot> = cell.runs.iter().filter_map(shot).collect();
    let (bands, bands_note) = mapped(stored.record.bands.len());
    let differences = shots.iter().enumerate().filter_map(|(i, a)| Some((a, other(&shots, i)?)));
    let differences = differences.flat_map(|(a, b)| {
        bands.iter().flat_map(move |band| maps::difference(&a.picture, &b.picture, *band))
    });
    let limit = maps::limit(differences);
    let pictures: Result<Vec<PictureData>> =
        (0..shots.len()).map(|i| picture(&shots, i, &bands, limit)).collect();
    let first = shots.first().map(|shot| shot.picture);
    let data = Data {
        cell: &cell.label,
        width: first.map_or(0, |p| p.width),
        height: first.map_or(0, |p| p.height),
        columns: 1,
        stops: stored.record.resolved["display"]["exposure_stops"].as_f64().unwrap_or(0.0),
        bands: bands.iter().map(|band| stored.record.bands[*band].name.as_str()).collect(),
        bands_note,
        limit,
        z_limit: maps::Z_LIMIT,
        noise_range: maps::NOISE_RANGE,
        pictures: pictures?,
    };
    Ok(data.to_text())
}

impl Data<'_> {
    /// A name may contain `</script>`; JSON allows `<` to be escaped by its number.
    fn to_text(&self) -> String {
        serde_json::to_string(self).expect("numbers and names are JSON").replace('<', "\\u003c")
    }
}

/// The pictures of one estimator in a grid, tile by tile without a gap.
pub(super) struct Sheet<'a> {
    /// Name of the estimator.
    pub name: &'a str,
    /// Linear sRGB over what is shown as white, row by row from the top.
    pub rgb: Vec<[f64; 3]>,
}

/// The viewer of a grid whose pictures are already on the page: two sheets of one size with `columns`
/// tiles per row.
///
/// # Errors
/// Sheets without pixels.
pub(super) fn grid(
    title: &str,
    sheets: [Sheet; 2],
    width: usize,
    columns: usize,
) -> Result<ViewerBlock> {
    let height = sheets[0].rgb.len() / width.max(1);
    let picture =
        |sheet: &Sheet<'_>| Ok(base64::encode(&to_linear_png(width, sheet.rgb.iter().copied())?));
    let [a, b] = &sheets;
    let linear = [picture(a)?, picture(b)?];
    let pictures = [a, b].into_iter().zip(linear).map(|(sheet, linear)| PictureData {
        name: sheet.name,
        about: "exposed as in the picture above".into(),
        linear,
        ..PictureData::default()
    });
    let data = Data {
        cell: title,
        width,
        height,
        columns,
        stops: 0.0,
        bands: Vec::new(),
        bands_note: String::new(),
        limit: 1.0,
        z_limit: maps::Z_LIMIT,
        noise_range: maps::NOISE_RANGE,
        pictures: pictures.collect(),
    };
    Ok(ViewerBlock { cell: title.into(), figures: Vec::new(), data: Some(data.to_text()) })
}

/// Removes the data of viewers that exceed the room of the page.
pub(super) fn keep_room<'a>(first: &[ViewerBlock], more: impl Iterator<Item = &'a mut ViewerBlock>) {
    let size = |viewer: &ViewerBlock| viewer.data.as_ref().map_or(0, String::len);
    let mut used: usize = first.iter().map(size).sum();
    for viewer in more {
        used += size(viewer);
        if used > ROOM {
            viewer.data = None;
        }
    }
}

/// The bands that have maps, and a note if these are not all.
fn mapped(bands: usize) -> (Vec<usize>, String) {
    let few = few_bands(bands);
    let note = match few.len() == bands {
        true => String::new(),
        false => format!("Maps of the first, the middle and the last of {bands} bands."),
    };
    (few, note)
}

/// The first estimator of the cell with the same integral, if it is another one.
fn same_integral<'a>(shots: &[Shot<'a>], index: usize) -> Option<Shot<'a>> {
    let of_model = |shot: &&Shot| shot.run.model == shots[index].run.model;
    let first = shots.iter().position(|shot| of_model(&shot))?;
    (first != index).then(|| shots[first])
}

/// The reference of differences: an estimator of the same integral, or light transport where a model has
/// no other estimator.
fn other<'a>(shots: &[Shot<'a>], index: usize) -> Option<Shot<'a>> {
    let truth = || shots.iter().find(|shot| shot.run.model.is_none()).copied();
    same_integral(shots, index).or_else(|| shots[index].run.model.as_ref().and_then(|_| truth()))
}

fn picture<'a>(
    shots: &[Shot<'a>],
    index: usize,
    bands: &[usize],
    limit: f64,
) -> Result<PictureData<'a>> {
    let Shot { run, picture } = shots[index];
    let encoded = |indices: Vec<u8>| Ok(base64::encode(&to_byte_png(picture.width, &indices)?));
    let noise = |band: &usize| {
        encoded(maps::noise(&picture, *band).into_iter().map(maps::noise_index).collect())
    };
    let signed = |values: &[f64], limit: f64| {
        encoded(values.iter().map(|x| maps::signed_index(*x, limit)).collect())
    };
    let each = |other: Shot<'a>, values: &dyn Fn(usize) -> (Vec<f64>, String), limit: f64| {
        let (mut maps, mut notes) = (Vec::new(), Vec::new());
        for band in bands {
            let (values, note) = values(*band);
            maps.push(signed(&values, limit)?);
            notes.push(note);
        }
        Ok(Some(Maps { of: other.run.estimator.as_str(), maps, notes }))
    };
    let difference = |other: Shot<'a>| {
        let note = |band| [model_note(run, other.run), caution(&[run, other.run], band)].concat();
        each(other, &|band| (maps::difference(&picture, &other.picture, band), note(band)), limit)
    };
    let z = |other: Shot<'a>| {
        let scores = |band| {
            let z = maps::ZScores::of([&picture, &other.picture], band, [run.passes, other.run.passes]);
            let note = beyond(&z, run.passes.min(other.run.passes)) + &caution(&[run, other.run], band);
            (z.values, note)
        };
        each(other, &scores, maps::Z_LIMIT)
    };
    Ok(PictureData {
        name: &run.estimator,
        about: about(run),
        linear: base64::encode(&to_linear_png(picture.width, picture.rgb())?),
        noise: bands.iter().map(noise).collect::<Result<_>>()?,
        difference: other(shots, index).map_or(Ok(None), difference)?,
        z: same_integral(shots, index).map_or(Ok(None), z)?,
        alone: alone(shots, index),
    })
}

fn about(run: &EstimatorRun) -> String {
    let model = run.model.as_ref().map_or(String::new(), |model| format!(", the model {model}"));
    format!("{} passes{model}", run.passes)
}

/// Why there is no z-score of a picture, nor of another picture against it; empty if there is one.
fn alone(shots: &[Shot], index: usize) -> String {
    let of_model = |shot: &&Shot| shot.run.model == shots[index].run.model;
    if shots.iter().filter(of_model).count() > 1 {
        return String::new();
    }
    "no other estimator here has the same integral, and another model's mean differs by more than noise"
        .into()
}

fn model_note(run: &EstimatorRun, other: &EstimatorRun) -> String {
    if run.model == other.model {
        return String::new();
    }
    format!(
        " {} estimates a model, {} light transport itself: the model's error shows too.",
        run.estimator, other.estimator
    )
}

/// The number of z-scores beyond the scale, the number expected by chance, and what cannot be judged.
fn beyond(scores: &maps::ZScores, passes: u64) -> String {
    let z = &scores.values;
    let judged = z.iter().filter(|z| !z.is_nan()).count();
    let above = z.iter().filter(|z| **z > maps::Z_LIMIT).count();
    let below = z.iter().filter(|z| **z < -maps::Z_LIMIT).count();
    let limit = maps::Z_LIMIT;
    let mut text = format!(
        "{} of {judged} pixels are beyond ±{limit} ({above} above, {below} below)",
        above + below
    );
    // The smaller degrees of freedom of the two sides: their tail is at least as heavy as that of both.
    if passes > 1 && judged > 0 {
        let dof = passes as f64 - 1.0;
        let chance = student_two_sided(limit, dof) * judged as f64;
        text += &format!(
            "; by chance it would be at most {} were the passes' noise normal (Student's t, {dof} degrees of freedom)",
            significant(chance, 2)
        );
    }
    text += ".";
    if above + below > 0 {
        text += " Passes are skewed where rare paths are bright, and then z is too large on one side without any \
                 bias: the means of the image and of its tiles decide, not single pixels.";
    }
    if scores.skewed > 0 {
        text += &format!(
            " Grey: {} pixels are not judged, because their relative error shows that their passes are too skewed \
             (|skewness| / sqrt(passes) above {SKEWNESS_LIMIT}, as for claims; scores that are never negative).",
            scores.skewed
        );
    }
    if scores.without_error > 0 {
        text +=
            &format!(" Grey: {} pixels without a standard error on either side.", scores.without_error);
    }
    text
}

/// Reasons not to read a difference as a defect.
fn caution(runs: &[&EstimatorRun], band: usize) -> String {
    let mut text = String::new();
    for run in runs {
        if let StatedBias::Biased(why) = &run.bias {
            text += &format!(" {} is biased: {why}.", run.estimator);
        }
        let tails = run.heavy_tails.iter().filter(|tail| tail.band == band);
        tails.for_each(|tail| text += &format!(" {} has a heavy tail: {}.", run.estimator, tail.reason));
    }
    text
}

#[cfg(test)]
mod tests;
