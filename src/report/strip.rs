//! Pictures band by band: a row for each cell, with all bands together as they are displayed, and then bands by
//! themselves in grey. All pictures of a column, and all in grey, have one exposure: a band is dark where the body is.

use super::document::{FigureBlock, PageBlock, PictureFile};
use super::split::{GAP, WHITE, white_level};
use crate::error::Result;
use crate::results::canvas::Canvas;
use crate::results::image::Picture;
use crate::results::pictures::{Strip, Wanted};
use crate::results::record::Cell;
use crate::results::store::{RecordFolder, Stored};

/// Cells that a strip shows at most.
const MOST_CELLS: usize = 16;
/// A picture narrower than this is enlarged by an integer factor.
const WIDE_ENOUGH: usize = 96;

/// A row of pictures.
struct Row<'a> {
    picture: Picture<'a>,
    title: String,
}

/// Writes every strip that the experiment requests into `images/`.
///
/// # Errors
/// I/O.
pub(super) fn write_strips(
    folder: &RecordFolder,
    stored: &Stored,
    wanted: &[Wanted],
) -> Result<Vec<FigureBlock>> {
    let strips = wanted.iter().filter_map(|wanted| match wanted {
        Wanted::Strip(strip) => Some(strip),
        Wanted::Split(_) | Wanted::Running(_) => None,
    });
    strips.enumerate().map(|(index, strip)| write(folder, stored, index, strip)).collect()
}

/// The section of the page.
pub(super) fn blocks(strips: &[FigureBlock]) -> Vec<PageBlock> {
    let heading = (!strips.is_empty()).then(|| PageBlock::Heading(2, "Bands".into()));
    heading.into_iter().chain(strips.iter().cloned().map(PageBlock::Wide)).collect()
}

/// At most `most` of `count` bands, evenly spaced, the first and the last among them.
fn shown_bands(count: usize, most: usize) -> Vec<usize> {
    let shown = most.min(count);
    (0..shown).map(|i| if shown > 1 { i * (count - 1) / (shown - 1) } else { count / 2 }).collect()
}

fn write(folder: &RecordFolder, stored: &Stored, index: usize, strip: &Strip) -> Result<FigureBlock> {
    let record = &stored.record;
    let row = |cell: &Cell| {
        let run = cell.runs.iter().find(|run| run.estimator == strip.estimator)?;
        Some(Row { picture: Picture::of(stored, run)?, title: cell.title() })
    };
    let rows: Vec<Row> = record.cells.iter().take(MOST_CELLS).filter_map(row).collect();
    let bands = shown_bands(record.bands.len(), strip.bands);
    let width = rows.iter().map(|row| row.picture.width).max().unwrap_or(1);
    let height = rows.iter().map(|row| row.picture.height).max().unwrap_or(1);
    let zoom = WIDE_ENOUGH.div_ceil(width).max(1);
    let names = bands.iter().map(|band| record.bands[*band].name.as_str());
    let widest = names.clone().map(Canvas::label_width).max().unwrap_or(0);
    let (width, height) = ((width * zoom).max(widest), height * zoom);
    let sheet = |count: usize, length: usize| (count * (length + GAP)).saturating_sub(GAP).max(1);
    let label = Canvas::LABEL_HEIGHT;
    let mut canvas = Canvas::new(sheet(1 + bands.len(), width), label + sheet(rows.len(), height));
    for (number, name) in names.enumerate() {
        canvas.label(name, ((1 + number) * (width + GAP), 0), false);
    }
    let brightest = |row: &Row| -> Vec<f64> {
        row.picture.rgb().map(|rgb| rgb.into_iter().fold(f64::NEG_INFINITY, f64::max)).collect()
    };
    let in_bands = |row: &Row| -> Vec<f64> { bands.iter().flat_map(|b| row.picture.mean(*b)).collect() };
    let colour = 1.0 / white_level(rows.iter().flat_map(brightest)).unwrap_or(1.0);
    let grey = 1.0 / white_level(rows.iter().flat_map(in_bands)).unwrap_or(1.0);
    for (number, Row { picture, .. }) in rows.iter().enumerate() {
        let y = label + number * (height + GAP);
        canvas.paint(picture, 0..picture.width, colour, zoom, (0, y));
        for (number, band) in bands.iter().enumerate() {
            canvas.paint_band(picture, *band, grey, zoom, ((1 + number) * (width + GAP), y));
        }
    }
    let png = canvas.to_png()?;
    let path = format!("images/strip-{}.png", index + 1);
    folder.write_view(&path, &png)?;
    let title = format!("{} by band", strip.estimator);
    Ok(FigureBlock {
        path,
        picture: PictureFile::Png(png),
        title,
        caption: caption(record.cells.len(), &rows),
    })
}

fn caption(cells: usize, rows: &[Row]) -> String {
    let mut text = format!(
        "From the left: all bands together, then bands by themselves in grey. White is the {:.0}th percentile of the \
         pixels that are not black, for all pictures in colour, and for all in grey; clipped to sRGB.",
        100.0 * WHITE
    );
    if cells > 1 {
        let titles: Vec<&str> = rows.iter().map(|row| row.title.as_str()).collect();
        text += &format!(" Rows from the top: {}.", titles.join(" | "));
    }
    if cells > rows.len() {
        text += &format!(" {} of {cells} cells are shown.", rows.len());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::image::decoded;
    use crate::results::sample;

    #[test]
    fn bands_are_evenly_spaced() {
        assert_eq!(shown_bands(20, 8), [0, 2, 5, 8, 10, 13, 16, 19]);
        assert_eq!(shown_bands(3, 8), [0, 1, 2]);
        assert_eq!(shown_bands(5, 1), [2]);
        assert!(shown_bands(0, 8).is_empty());
    }

    /// The sample's picture has 3 x 2 pixels; red is 0.2 i and green 0.2 i + 0.1 in pixel i.
    #[test]
    fn bands_stand_beside_each_other_with_one_exposure() {
        let stored = sample::stored(0.5);
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path());
        let strip = Strip { estimator: stored.record.cells[0].runs[0].estimator.clone(), bands: 8 };
        let figures = write_strips(&folder, &stored, &[Wanted::Strip(strip)]).expect("a strip");
        let [figure] = &figures[..] else { panic!("{figures:?}") };
        assert_eq!(figure.path, "images/strip-1.png");
        let PictureFile::Png(png) = &figure.picture else { panic!("no PNG") };
        let (width, height, data) = decoded(png);
        assert_eq!((width, height), (3 * 96 + 2 * GAP, Canvas::LABEL_HEIGHT + 64));
        let at = |u: usize, v: usize| &data[3 * (v * width + u)..][..3];
        // The middle of pixel 2 of the first row: red 0.4, green 0.5, both in grey and in units of the brightest.
        let (x, y) = (64 + 16, Canvas::LABEL_HEIGHT + 16);
        let red = at(96 + GAP + x, y);
        let green = at(2 * (96 + GAP) + x, y);
        assert!(red[0] == red[1] && green[0] == green[2], "grey: {red:?} {green:?}");
        assert!(red[0] < green[0] && red[0] > 100, "{red:?} {green:?}");
        assert!(at(x, y)[2] < 10 && at(x, y)[1] > 100, "in colour: {:?}", at(x, y));
    }
}
