//! A canvas of 8-bit sRGB values on which pictures are painted side by side.

use std::ops::Range;

use super::image::{Picture, encoded, show};
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
        let mut unshown = Unshown::default();
        for (index, rgb) in picture.rgb().enumerate() {
            let (row, column) = (index / picture.width, index % picture.width);
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
