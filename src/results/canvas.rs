//! A canvas of 8-bit sRGB values on which pictures are painted side by side.

use std::ops::Range;

use super::image::{Picture, encoded, show};
use super::letters;
use crate::error::Result;

/// White paper, row by row from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Canvas {
    width: usize,
    height: usize,
    data: Vec<u8>,
}

/// Pixels of a picture that a display cannot show.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Unshown {
    /// Brighter than white: shown with the channel at its end.
    pub clipped: usize,
    /// Outside the sRGB gamut or not finite.
    pub out_of_gamut: usize,
}

/// Columns beside the text of a label; above and below it half as many rows.
const LABEL_MARGIN: usize = 8;

/// How much of the picture the ground of a label hides.
const LABEL_GROUND: f64 = 0.6;

impl Canvas {
    /// A white canvas, width by height in pixels.
    pub fn new(width: usize, height: usize) -> Canvas {
        Canvas { width, height, data: vec![255; 3 * width * height] }
    }

    /// Paints the columns `columns` of a picture, radiance times `gain`, every pixel as a square of
    /// `zoom` by `zoom`, with its top left corner at `(x, y)`. What lies beyond the canvas is
    /// not painted.
    pub fn paint(
        &mut self,
        picture: &Picture,
        columns: Range<usize>,
        gain: f64,
        zoom: usize,
        (x, y): (usize, usize),
    ) -> Unshown {
        self.paint_pixels(picture.rgb(), picture.width, columns, gain, zoom, (x, y))
    }

    /// Paints one band of a picture in grey, as [`Canvas::paint`] does.
    pub fn paint_band(
        &mut self,
        picture: &Picture,
        band: usize,
        gain: f64,
        zoom: usize,
        corner: (usize, usize),
    ) -> Unshown {
        let grey = picture.mean(band).map(|radiance| [radiance; 3]);
        self.paint_pixels(grey, picture.width, 0..picture.width, gain, zoom, corner)
    }

    fn paint_pixels(
        &mut self,
        pixels: impl Iterator<Item = [f64; 3]>,
        width: usize,
        columns: Range<usize>,
        gain: f64,
        zoom: usize,
        (x, y): (usize, usize),
    ) -> Unshown {
        let mut unshown = Unshown::default();
        for (index, rgb) in pixels.enumerate() {
            let (row, column) = (index / width, index % width);
            if !columns.contains(&column) {
                continue;
            }
            let shown = show(rgb, gain);
            unshown.clipped += usize::from(shown.clipped);
            unshown.out_of_gamut += usize::from(shown.out_of_gamut);
            let (left, top) = (x + (column - columns.start) * zoom, y + row * zoom);
            for v in top..(top + zoom).min(self.height) {
                for u in left..(left + zoom).min(self.width) {
                    let at = 3 * (v * self.width + u);
                    self.data[at..at + 3].copy_from_slice(&shown.bytes);
                }
            }
        }
        unshown
    }

    /// Writes a line of white text on a dark ground, its box with one corner at `(x, y)`: the top left one, or with
    /// `from_right` the top right one.
    pub fn label(&mut self, text: &str, (x, y): (usize, usize), from_right: bool) {
        let (wide, high) = (letters::width(text) + 2 * LABEL_MARGIN, Canvas::LABEL_HEIGHT);
        let left = if from_right { x.saturating_sub(wide) } else { x };
        for v in y..(y + high).min(self.height) {
            for u in left..(left + wide).min(self.width) {
                self.mix((u, v), 0.0, LABEL_GROUND);
            }
        }
        letters::each_pixel(text, |u, v, coverage| {
            self.mix((left + LABEL_MARGIN + u, y + LABEL_MARGIN / 2 + v), 255.0, coverage);
        });
    }

    /// Mixes a grey value into a pixel.
    fn mix(&mut self, (u, v): (usize, usize), grey: f64, part: f64) {
        if u >= self.width || v >= self.height {
            return;
        }
        let at = 3 * (v * self.width + u);
        for value in &mut self.data[at..at + 3] {
            *value = (f64::from(*value) + part * (grey - f64::from(*value))).round() as u8;
        }
    }

    /// Rows of a label.
    pub const LABEL_HEIGHT: usize = letters::HEIGHT + LABEL_MARGIN;

    /// Columns of a label.
    pub fn label_width(text: &str) -> usize {
        letters::width(text) + 2 * LABEL_MARGIN
    }

    /// The file.
    ///
    /// # Errors
    /// A canvas without pixels.
    pub fn to_png(&self) -> Result<Vec<u8>> {
        encoded(self.width, self.height, &self.data)
    }
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    #[test]
    fn labels_stay_on_the_canvas_and_are_white_on_dark() {
        let mut canvas = Canvas::new(80, 40);
        canvas.label("mis", (0, 0), false);
        let at = |canvas: &Canvas, u: usize, v: usize| canvas.data[3 * (80 * v + u)];
        assert_eq!(at(&canvas, 0, 0), 102, "the ground hides 60 % of white paper");
        assert_eq!(at(&canvas, Canvas::label_width("mis"), 0), 255, "beside it is paper");
        assert_eq!(at(&canvas, 0, Canvas::LABEL_HEIGHT), 255, "and below it");
        assert!(
            (0..40).any(|v| (0..60).any(|u| at(&canvas, u, v) == 255 && v < 30)),
            "the text is white"
        );
        canvas.label("a text that is far too long", (79, 39), false);
        canvas.label("another that begins before the left edge", (40, 20), true);
        assert_eq!(canvas.data.len(), 3 * 80 * 40);
    }

    // The sample's red and green are 0.2 i and 0.2 i + 0.1 in pixel i = 3 row + column.
    #[test]
    fn columns_are_painted_where_they_belong() {
        let stored = sample::stored(0.5);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        let mut canvas = Canvas::new(6, 5);
        let unshown = canvas.paint(&picture, 1..3, 1.5, 2, (1, 1));
        // Times 1.5 the last pixel, (1.0, 1.1), and the one before it, (0.8, 0.9), are too bright.
        assert_eq!(unshown, Unshown { clipped: 2, out_of_gamut: 0 });
        let at = |u: usize, v: usize| &canvas.data[3 * (6 * v + u)..][..3];
        let first = show([0.2, 0.3, 0.0], 1.5).bytes;
        assert!([at(1, 1), at(2, 1), at(1, 2), at(2, 2)].iter().all(|pixel| *pixel == first));
        assert_eq!(at(3, 1), show([0.4, 0.5, 0.0], 1.5).bytes);
        assert_eq!(at(4, 4), [255, 255, 0]);
        assert!([at(0, 0), at(5, 1), at(0, 4)].iter().all(|pixel| *pixel == [255; 3]), "paper");
        // Beyond the canvas.
        canvas.paint(&picture, 0..3, 1.0, 4, (3, 3));
        assert_eq!(canvas.data.len(), 3 * 6 * 5);
    }
}
