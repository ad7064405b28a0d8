//! Split pictures: a grid with one picture per cell, its left half by one estimator and its right half
//! by another, with the same exposure. The caption states the CPU time of each half, and either that
//! the times are equal or by how much they differ.

use super::document::{Document, FigureBlock, PageBlock, PictureFile, TableBlock, ViewerBlock};
use super::table::Table;
use super::viewer;
use crate::error::Result;
use crate::results::canvas::{Canvas, Unshown};
use crate::results::image::{Picture, gain};
use crate::results::number::significant;
use crate::results::pictures::{Split, Wanted};
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::{RecordFolder, Stored};

/// Times of two halves that differ by more than this factor are not called equal.
const EQUAL: f64 = 1.1;
/// The fraction of non-black pixels that are darker than the white level of a picture. It is below 1, so
/// that a highlight does not darken the body.
pub(super) const WHITE: f64 = 0.95;
/// A picture narrower than this is enlarged by an integer factor.
const WIDE_ENOUGH: usize = 192;
/// Gap between the halves of a picture, in pixels of the sheet.
const SEAM: usize = 1;
/// Gap between pictures, pixels.
pub(super) const GAP: usize = 6;

/// A grid of split pictures in the report.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SplitFigure {
    /// Path relative to the results folder, without extension.
    pub stem: String,
    /// Estimators, and the labels of the axes that are neither rows nor columns.
    pub title: String,
    /// Bytes of the PNG file.
    pub png: Vec<u8>,
    /// Caption that explains the grid.
    pub caption: String,
    /// A row for each cell.
    pub table: Table,
    /// The complete pictures of both estimators, with movable seams.
    pub viewer: ViewerBlock,
}

/// The grids that the experiment requests.
pub(super) fn wanted(all: &[Wanted]) -> Vec<Split> {
    let split = |wanted: &Wanted| match wanted {
        Wanted::Split(split) => Some(split.clone()),
        Wanted::Running(_) | Wanted::Strip(_) => None,
    };
    all.iter().filter_map(split).collect()
}

/// Writes every requested grid, and each of its pictures separately, into `images/`.
pub(super) fn write_splits(
    folder: &RecordFolder,
    stored: &Stored,
    wanted: &[Split],
) -> Result<Vec<SplitFigure>> {
    let mut figures = Vec::new();
    for (index, split) in wanted.iter().enumerate() {
        let groups = groups(&stored.record.cells, split);
        let count = groups.len();
        for (part, (labels, cells)) in groups.into_iter().enumerate() {
            let stem = match count {
                1 => format!("images/split-{}", index + 1),
                _ => format!("images/split-{}-{}", index + 1, part + 1),
            };
            let figure = Grid::new(stored, split, &cells).write(folder, &stem, &labels)?;
            folder.write_view(&format!("{stem}.md"), figure.document().to_markdown().as_bytes())?;
            figures.push(figure);
        }
    }
    Ok(figures)
}

/// The section of the page.
pub(super) fn blocks(figures: &[SplitFigure]) -> Vec<PageBlock> {
    if figures.is_empty() {
        return Vec::new();
    }
    let heading = PageBlock::Heading(2, "Split pictures".into());
    [heading].into_iter().chain(figures.iter().flat_map(SplitFigure::blocks)).collect()
}

impl SplitFigure {
    fn blocks(&self) -> [PageBlock; 3] {
        let figure = FigureBlock {
            path: format!("{}.png", self.stem),
            picture: PictureFile::Png(self.png.clone()),
            title: self.title.clone(),
            caption: self.caption.clone(),
        };
        [PageBlock::Wide(figure), PageBlock::Viewer(self.viewer.clone()), self.times()]
    }

    fn times(&self) -> PageBlock {
        let name = self.stem.rsplit('/').next().unwrap_or_default();
        PageBlock::Table(TableBlock::new(name, "", self.table.clone()))
    }

    /// The caption as a page, for a file beside the picture.
    fn document(&self) -> Document {
        let text = PageBlock::Text(self.caption.clone());
        Document { title: self.title.clone(), blocks: vec![text, self.times()] }
    }
}

/// The width that a lead picture has at least, in pixels.
const LEAD_WIDE: usize = 640;

/// Writes one picture labelled with the names of both estimators, their CPU seconds, and the result for their ratio. Its exposure
/// is that of the experiment's pictures, if the experiment sets one; otherwise the picture has a white level of its own.
///
/// # Errors
/// I/O.
pub(super) fn lead(
    folder: &RecordFolder,
    stored: &Stored,
    cell: (usize, &Cell),
    [left, right]: [&str; 2],
    ratio: &str,
) -> Result<FigureBlock> {
    let [left, right] = [left, right].map(String::from);
    let exposure_stops =
        stored.record.resolved["display"]["exposure_stops"].as_f64().filter(|s| *s != 0.0);
    let split = Split { left, right, rows: None, columns: None, exposure_stops };
    let mut grid = Grid::new(stored, &split, &[cell]);
    let (single, pair) = (split.left == split.right, &grid.pairs[0]);
    let label = |half: &Half, name: &str| match half.seconds {
        seconds if seconds.is_finite() => format!("{name}, {} CPU s", significant(seconds, 2)),
        _ => name.to_string(),
    };
    let names = [label(&pair.halves[0], &split.left), label(&pair.halves[1], &split.right)];
    let result = if ratio.is_empty() { String::new() } else { format!("{}: {ratio}", split.right) };
    let needed = names.iter().map(|name| Canvas::label_width(name)).sum::<usize>() + GAP;
    let needed = needed.max(Canvas::label_width(&result));
    grid.zoom = LEAD_WIDE.max(needed).div_ceil(grid.size.0).max(1);
    let (width, height) = (grid.size.0 * grid.zoom + SEAM, grid.size.1 * grid.zoom);
    let mut canvas = Canvas::new(width, height);
    grid.paint(&mut canvas, &grid.pairs[0], (0, 0));
    canvas.label(&names[0], (0, 0), false);
    if !single {
        canvas.label(&names[1], (width, 0), true);
    }
    if !result.is_empty() {
        let left = (width - Canvas::label_width(&result).min(width)) / 2;
        canvas.label(&result, (left, height.saturating_sub(Canvas::LABEL_HEIGHT)), false);
    }
    let png = canvas.to_png()?;
    let path = "images/lead.png".to_string();
    folder.write_view(&path, &png)?;
    let title = if single { split.left.clone() } else { format!("{} | {}", split.left, split.right) };
    let mut caption = match single {
        true => String::new(),
        false => {
            format!("Left half: `{}`; right half: `{}`, at the same exposure.", split.left, split.right)
        }
    };
    let ratio = grid.pairs[0].time_ratio();
    let factor = ratio.max(1.0 / ratio);
    if !single && factor.is_finite() {
        caption += &match factor > EQUAL {
            true => format!(
                " Their CPU times differ by a factor of {}: their noise alone is no comparison.",
                significant(factor, 2)
            ),
            false => " Equal CPU time.".to_string(),
        };
    }
    if grid.zoom > 1 {
        caption += &format!(" A pixel is shown as {0} x {0}.", grid.zoom);
    }
    let place = match stored.record.cells.len() {
        0 | 1 => String::new(),
        _ => format!("Cell {}. ", cell.1.title()),
    };
    Ok(FigureBlock { path, picture: PictureFile::Png(png), title, caption: place + &caption })
}

/// Cells by their labels on the axes that are neither rows nor columns, each with those labels in words.
fn groups<'a>(cells: &'a [Cell], split: &Split) -> Vec<(String, Vec<(usize, &'a Cell)>)> {
    let mut groups: Vec<(String, Vec<(usize, &Cell)>)> = Vec::new();
    for (index, cell) in cells.iter().enumerate() {
        let is_other =
            |axis: &String| Some(axis) != split.rows.as_ref() && Some(axis) != split.columns.as_ref();
        let others = cell.axes.iter().filter(|(axis, _)| is_other(axis));
        let labels =
            others.map(|(axis, label)| format!("{axis} {label}")).collect::<Vec<_>>().join(", ");
        match groups.iter_mut().find(|(known, _)| *known == labels) {
            Some((_, members)) => members.push((index, cell)),
            None => groups.push((labels, vec![(index, cell)])),
        }
    }
    groups
}

/// The labels of an axis in the order in which cells have them; one nameless label without an axis.
fn labels<'a>(cells: &[(usize, &'a Cell)], axis: Option<&String>) -> Vec<&'a str> {
    let mut labels = Vec::new();
    for (_, cell) in cells {
        let label = label(cell, axis);
        if !labels.contains(&label) {
            labels.push(label);
        }
    }
    labels
}

fn label<'a>(cell: &'a Cell, axis: Option<&String>) -> &'a str {
    axis.and_then(|axis| cell.axes.get(axis)).map_or("", String::as_str)
}

/// The picture of one cell.
struct SplitPair<'a> {
    index: usize,
    cell: &'a Cell,
    /// Row and column in the grid.
    at: (usize, usize),
    halves: [Half<'a>; 2],
    /// The radiance shown as white, and the estimator whose pixels determine it.
    white: f64,
    white_of: Option<&'a str>,
}

/// The half of one estimator.
struct Half<'a> {
    run: Option<&'a EstimatorRun>,
    picture: Option<Picture<'a>>,
    /// CPU seconds of all passes; NaN where they are not known.
    seconds: f64,
}

struct Grid<'a> {
    split: &'a Split,
    rows: Vec<&'a str>,
    columns: Vec<&'a str>,
    pairs: Vec<SplitPair<'a>>,
    /// Pixels of the largest picture.
    size: (usize, usize),
    zoom: usize,
}

impl<'a> Grid<'a> {
    fn new(stored: &'a Stored, split: &'a Split, cells: &[(usize, &'a Cell)]) -> Grid<'a> {
        let rows = labels(cells, split.rows.as_ref());
        let columns = labels(cells, split.columns.as_ref());
        let place = |labels: &[&str], label: &str| labels.iter().position(|l| *l == label).unwrap_or(0);
        let pair = |&(index, cell): &(usize, &'a Cell)| {
            let row = place(&rows, label(cell, split.rows.as_ref()));
            let column = place(&columns, label(cell, split.columns.as_ref()));
            let halves = [&split.left, &split.right].map(|name| Half::of(stored, cell, name));
            let (white, white_of) = white(&halves, split.exposure_stops);
            SplitPair { index, cell, at: (row, column), halves, white, white_of }
        };
        let pairs: Vec<SplitPair> = cells.iter().map(pair).collect();
        let pictures = || pairs.iter().flat_map(|pair| &pair.halves).filter_map(|half| half.picture);
        let width = pictures().map(|picture| picture.width).max().unwrap_or(1);
        let height = pictures().map(|picture| picture.height).max().unwrap_or(1);
        let zoom = WIDE_ENOUGH.div_ceil(width).max(1);
        Grid { split, rows, columns, pairs, size: (width, height), zoom }
    }

    /// Pixels of the sheet that a picture takes.
    fn tile(&self) -> (usize, usize) {
        (self.size.0 * self.zoom + SEAM, self.size.1 * self.zoom)
    }

    fn write(&self, folder: &RecordFolder, stem: &str, others: &str) -> Result<SplitFigure> {
        let (width, height) = self.tile();
        let sheet = |count: usize, length: usize| count * (length + GAP) - GAP;
        let mut canvas = Canvas::new(sheet(self.columns.len(), width), sheet(self.rows.len(), height));
        let mut unshown = Vec::new();
        for pair in &self.pairs {
            let (row, column) = pair.at;
            unshown.push(self.paint(&mut canvas, pair, (column * (width + GAP), row * (height + GAP))));
            let mut alone = Canvas::new(width, height);
            self.paint(&mut alone, pair, (0, 0));
            folder.write_view(&format!("{stem}-cell-{:03}.png", pair.index), &alone.to_png()?)?;
        }
        let png = canvas.to_png()?;
        folder.write_view(&format!("{stem}.png"), &png)?;
        let mut title = format!("{} | {}", self.split.left, self.split.right);
        if !others.is_empty() {
            title += &format!(", {others}");
        }
        let (caption, table) = (self.caption(), self.table(&unshown));
        let viewer = self.viewer(&title)?;
        Ok(SplitFigure { stem: stem.into(), title, png, caption, table, viewer })
    }

    fn viewer(&self, title: &str) -> Result<ViewerBlock> {
        let columns = self.columns.len();
        let sheets = [(0, &self.split.left), (1, &self.split.right)];
        let sheets = sheets.map(|(half, name)| viewer::Sheet { name, rgb: self.sheet(half) });
        viewer::grid(title, sheets, columns * self.size.0, columns)
    }

    /// The complete pictures of one side, divided by their white levels, tile by tile; black where
    /// there is none.
    fn sheet(&self, half: usize) -> Vec<[f64; 3]> {
        let (width, height) = self.size;
        let row_length = self.columns.len() * width;
        let mut rgb = vec![[0.0; 3]; row_length * self.rows.len() * height];
        for pair in &self.pairs {
            let Some(picture) = pair.halves[half].picture else { continue };
            let first = pair.at.0 * height * row_length + pair.at.1 * width;
            for (index, pixel) in picture.rgb().enumerate() {
                let at = first + index / picture.width * row_length + index % picture.width;
                rgb[at] = pixel.map(|c| c / pair.white);
            }
        }
        rgb
    }

    /// Paints the left columns by the left estimator, the right columns by the right one.
    fn paint(&self, canvas: &mut Canvas, pair: &SplitPair, (x, y): (usize, usize)) -> [Unshown; 2] {
        let gain = 1.0 / pair.white;
        let part = |half: &Half, is_left: bool, canvas: &mut Canvas| {
            let Some(picture) = half.picture else { return Unshown::default() };
            let middle = picture.width / 2;
            let (columns, x) = match is_left {
                true => (0..middle, x),
                false => (middle..picture.width, x + middle * self.zoom + SEAM),
            };
            canvas.paint(&picture, columns, gain, self.zoom, (x, y))
        };
        let left = part(&pair.halves[0], true, canvas);
        [left, part(&pair.halves[1], false, canvas)]
    }

    fn caption(&self) -> String {
        let Split { left, right, rows, columns, exposure_stops } = self.split;
        let mut text = format!("Left half of every picture: `{left}`; right half: `{right}`.");
        let mut axis = |name: &Option<String>, what: &str, labels: &[&str]| {
            if let Some(name) = name {
                text += &format!(" {what}: {name} = {}.", labels.join(" | "));
            }
        };
        axis(rows, "Rows from the top", &self.rows);
        axis(columns, "Columns from the left", &self.columns);
        text += " ";
        text += &self.times();
        text += &match exposure_stops {
            Some(stops) => {
                format!(" Exposure {stops:+} stops in both halves of all pictures, clipped to sRGB.")
            }
            None => format!(
                " White is the same in both halves of a picture: the {:.0}th percentile of the pixels that are not \
                 black, by their largest channel, of the half with less noise (mean of squared standard errors over \
                 mean of squared values, over its whole image); clipped to sRGB.",
                100.0 * WHITE
            ),
        };
        if self.zoom > 1 {
            text += &format!(" A pixel is shown as {0} x {0}.", self.zoom);
        }
        text
    }

    /// Whether the halves took the same time, as measured.
    fn times(&self) -> String {
        let ratios: Vec<f64> = self.pairs.iter().map(SplitPair::time_ratio).collect();
        let known: Vec<f64> = ratios.iter().copied().filter(|ratio| ratio.is_finite()).collect();
        let factor = |ratio: &f64| ratio.max(1.0 / ratio);
        let unequal = known.iter().filter(|ratio| factor(ratio) > EQUAL).count();
        let largest = known.iter().map(factor).fold(1.0, f64::max);
        let mut text = match (known.len(), unequal) {
            (0, _) => "The CPU time of the halves is not known.".to_string(),
            (_, 0) => format!(
                "Equal time: the CPU seconds of the two halves differ by at most {} %.",
                significant(100.0 * (largest - 1.0), 2)
            ),
            (n, _) => format!(
                "NOT equal time in {unequal} of {n} pictures: there the CPU seconds of the two halves differ by up to \
                 {} %.",
                significant(100.0 * (largest - 1.0), 2)
            ),
        };
        if !known.is_empty() && known.len() < ratios.len() {
            text += &format!(" In {} pictures the time is not known.", ratios.len() - known.len());
        }
        text
    }

    fn table(&self, unshown: &[[Unshown; 2]]) -> Table {
        let names = [&self.split.left, &self.split.right];
        let mut header = vec!["cell".to_string()];
        for name in names {
            header.extend([format!("{name}: passes"), format!("{name}: CPU s")]);
        }
        header.extend(["time, right over left".into(), "white".into(), "white of".into()]);
        header.extend(names.map(|name| format!("{name}: too bright")));
        header.extend(names.map(|name| format!("{name}: out of gamut")));
        header.push("note".into());
        let mut table = Table { header, rows: Vec::new() };
        for (pair, unshown) in self.pairs.iter().zip(unshown) {
            let mut row = vec![pair.cell.title()];
            for half in &pair.halves {
                row.push(half.run.map_or(String::new(), |run| run.passes.to_string()));
                row.push(significant(half.seconds, 3));
            }
            row.extend([significant(pair.time_ratio(), 3), significant(pair.white, 3)]);
            row.push(pair.white_of.unwrap_or_default().into());
            let count = |n: usize| if n == 0 { String::new() } else { n.to_string() };
            row.extend(unshown.map(|u| count(u.clipped)));
            row.extend(unshown.map(|u| count(u.out_of_gamut)));
            row.push(pair.note(&names.map(String::as_str)));
            table.push(row);
        }
        table.without_empty_columns()
    }
}

impl SplitPair<'_> {
    /// CPU time of the right half over that of the left one; NaN where one is not known.
    fn time_ratio(&self) -> f64 {
        self.halves[1].seconds / self.halves[0].seconds
    }

    fn note(&self, names: &[&str; 2]) -> String {
        let mut notes = Vec::new();
        let ratio = self.time_ratio();
        if ratio.max(1.0 / ratio) > EQUAL {
            let (slow, quick, ratio) = if ratio > 1.0 {
                (names[1], names[0], ratio)
            } else {
                (names[0], names[1], 1.0 / ratio)
            };
            notes.push(format!(
                "{slow} took {} % more time than {quick}",
                significant(100.0 * (ratio - 1.0), 2)
            ));
        }
        for (half, name) in self.halves.iter().zip(names) {
            if half.picture.is_none() {
                notes.push(format!("no image of {name}"));
            } else if half.seconds.is_nan() {
                notes.push(format!("the time of {name} is not known"));
            }
        }
        notes.join("; ")
    }
}

impl<'a> Half<'a> {
    fn of(stored: &'a Stored, cell: &'a Cell, name: &str) -> Half<'a> {
        let run = cell.runs.iter().find(|run| run.estimator == name);
        let cost = stored.timing.as_ref().and_then(|timing| timing.of(&cell.label, name));
        // A run for which the times of some passes are missing has no time to compare.
        let whole =
            run.zip(cost).filter(|(run, cost)| cost.passes == run.passes && cost.cpu_seconds > 0.0);
        Half {
            run,
            picture: run.and_then(|run| Picture::of(stored, run)),
            seconds: whole.map_or(f64::NAN, |(_, cost)| cost.all_seconds()),
        }
    }

    /// Squared standard errors over squared values, both summed over the image; infinite for a
    /// black image, which has no information on the brightness of the body.
    fn noise(&self) -> f64 {
        let Some(picture) = self.picture else { return f64::INFINITY };
        let squares = |values: &mut dyn Iterator<Item = f64>| values.map(|x| x * x).sum::<f64>();
        let (mut error, mut signal) = (0.0, 0.0);
        for band in 0..picture.bands.len() {
            error += squares(&mut picture.std_error(band));
            signal += squares(&mut picture.mean(band));
        }
        let noise = error / signal;
        if noise.is_nan() { f64::INFINITY } else { noise }
    }
}

/// The radiance that is shown as white, and the estimator whose pixels determine it.
fn white<'a>(halves: &[Half<'a>; 2], stops: Option<f64>) -> (f64, Option<&'a str>) {
    if let Some(stops) = stops {
        return (1.0 / gain(stops), None);
    }
    let quiet = if halves[1].noise() < halves[0].noise() { &halves[1] } else { &halves[0] };
    let pixels = quiet.picture.iter().flat_map(|picture| picture.rgb()).map(brightest);
    match white_level(pixels) {
        Some(white) => (white, quiet.run.map(|run| run.estimator.as_str())),
        None => (1.0, None),
    }
}

/// The largest channel.
pub(super) fn brightest(rgb: [f64; 3]) -> f64 {
    rgb.into_iter().fold(f64::NEG_INFINITY, f64::max)
}

/// The percentile [`WHITE`] of those values that are not black; none of a black picture.
pub(super) fn white_level(values: impl Iterator<Item = f64>) -> Option<f64> {
    let mut lit: Vec<f64> = values.filter(|x| *x > 0.0 && x.is_finite()).collect();
    lit.sort_by(f64::total_cmp);
    let at = (WHITE * lit.len() as f64) as usize;
    lit.get(at.min(lit.len().saturating_sub(1))).copied()
}

#[cfg(test)]
#[path = "split_tests.rs"]
mod tests;
