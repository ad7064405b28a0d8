//! Pictures band by band: a row for each cell, with all bands together as they are displayed, and then bands by
//! themselves in grey. All pictures in colour have one exposure, and all in grey have one: a band is dark where the body is.

use super::document::{FigureBlock, PageBlock, PictureFile};
use super::pictures::spread_bands;
use super::split::{GAP, WHITE, brightest, white_level};
use crate::error::Result;
use crate::results::canvas::{Canvas, Unshown};
use crate::results::image::Picture;
use crate::results::pictures::{Strip, Wanted};
use crate::results::store::{RecordFolder, Stored};

/// Cells that a strip shows at most.
const MOST_CELLS: usize = 16;
/// A picture narrower than this is enlarged by an integer factor.
const WIDE_ENOUGH: usize = 96;

/// Writes every strip that the experiment requests into `images/`; none of an estimator without pictures.
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
    let sheets =
        strips.enumerate().filter_map(|(index, strip)| Some((index, StripSheet::new(stored, strip)?)));
    sheets.map(|(index, sheet)| sheet.write(folder, index)).collect()
}

/// The section of the page.
pub(super) fn blocks(strips: &[FigureBlock]) -> Vec<PageBlock> {
    let heading = (!strips.is_empty()).then(|| PageBlock::Heading(2, "Bands".into()));
    heading.into_iter().chain(strips.iter().cloned().map(PageBlock::Wide)).collect()
}

/// The pictures of a strip, and their places.
struct StripSheet<'a> {
    estimator: &'a str,
    /// From the top: the title of the cell, and its picture.
    rows: Vec<(String, Picture<'a>)>,
    /// Cells with pictures, shown or not.
    cells: usize,
    /// From the left: index and name of the band.
    bands: Vec<(usize, &'a str)>,
    zoom: usize,
    /// Pixels of the sheet that a picture takes.
    tile: (usize, usize),
}

impl<'a> StripSheet<'a> {
    fn new(stored: &'a Stored, strip: &'a Strip) -> Option<StripSheet<'a>> {
        let record = &stored.record;
        let mut rows: Vec<(String, Picture)> = Vec::new();
        for cell in &record.cells {
            let run = cell.runs.iter().find(|run| run.estimator == strip.estimator);
            rows.extend(run.and_then(|run| Some((cell.title(), Picture::of(stored, run)?))));
        }
        let cells = rows.len();
        rows.truncate(MOST_CELLS);
        let bands = spread_bands(record.bands.len(), strip.bands).into_iter();
        let bands: Vec<(usize, &str)> =
            bands.map(|band| (band, record.bands[band].name.as_str())).collect();
        let width = rows.iter().map(|(_, picture)| picture.width).max()?;
        let height = rows.iter().map(|(_, picture)| picture.height).max()?;
        let zoom = WIDE_ENOUGH.div_ceil(width).max(1);
        let widest_label = bands.iter().map(|(_, name)| Canvas::label_width(name)).max()?;
        let tile = ((width * zoom).max(widest_label), height * zoom);
        Some(StripSheet { estimator: &strip.estimator, rows, cells, bands, zoom, tile })
    }

    fn write(&self, folder: &RecordFolder, index: usize) -> Result<FigureBlock> {
        let (canvas, unshown) = self.painted();
        let png = canvas.to_png()?;
        let path = format!("images/strip-{}.png", index + 1);
        folder.write_view(&path, &png)?;
        let (title, caption) = (format!("{} by band", self.estimator), self.caption(unshown));
        Ok(FigureBlock { path, picture: PictureFile::Png(png), title, caption })
    }

    fn painted(&self) -> (Canvas, Unshown) {
        let (width, height) = self.tile;
        let (across, down) = (width + GAP, height + GAP);
        let columns = 1 + self.bands.len();
        let mut canvas =
            Canvas::new(columns * across - GAP, Canvas::LABEL_HEIGHT + self.rows.len() * down - GAP);
        for (column, (_, name)) in (1..).zip(&self.bands) {
            canvas.label(name, (column * across, 0), false);
        }
        let pictures = || self.rows.iter().map(|(_, picture)| picture);
        let colours = pictures().flat_map(|picture| picture.rgb()).map(brightest);
        let greys =
            pictures().flat_map(|picture| self.bands.iter().flat_map(|(band, _)| picture.mean(*band)));
        let colour = 1.0 / white_level(colours).unwrap_or(1.0);
        let grey = 1.0 / white_level(greys).unwrap_or(1.0);
        let mut all = Unshown::default();
        let mut add = |Unshown { clipped, out_of_gamut }| {
            all.clipped += clipped;
            all.out_of_gamut += out_of_gamut;
        };
        for (row, picture) in pictures().enumerate() {
            let y = Canvas::LABEL_HEIGHT + row * down;
            add(canvas.paint(picture, 0..picture.width, colour, self.zoom, (0, y)));
            for (column, (band, _)) in (1..).zip(&self.bands) {
                add(canvas.paint_band(picture, *band, grey, self.zoom, (column * across, y)));
            }
        }
        (canvas, all)
    }

    fn caption(&self, unshown: Unshown) -> String {
        let mut text = format!(
            "From the left: all bands together, then bands by themselves in grey. White is the {:.0}th percentile of \
             the pixels that are not black, for all pictures in colour, and for all in grey; clipped to sRGB.",
            100.0 * WHITE
        );
        if self.cells > 1 {
            let titles: Vec<&str> = self.rows.iter().map(|(title, _)| title.as_str()).collect();
            text += &format!(" Rows from the top: {}.", titles.join(" | "));
        }
        if self.cells > self.rows.len() {
            text += &format!(" {} of {} cells are shown.", self.rows.len(), self.cells);
        }
        if unshown.clipped > 0 {
            text += &format!(" Pixels too bright: {}.", unshown.clipped);
        }
        if unshown.out_of_gamut > 0 {
            text += &format!(" Pixels outside the gamut or not finite: {}.", unshown.out_of_gamut);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::image::decoded;
    use crate::results::sample;

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
        // 6 pixels in 3 pictures: 95 % of the 5 that are not black are below the brightest.
        assert!(figure.caption.ends_with("clipped to sRGB."), "{}", figure.caption);
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
