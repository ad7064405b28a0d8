//! The pixels of an image, and its tiles.

use super::{RegionShares, SensorRegion};
use crate::math::DVec3;

/// A rectangle of square pixels; row 0 at the top.
#[derive(Clone, Copy, Debug)]
pub struct Screen {
    /// Number of columns, pixels.
    pub width: usize,
    /// Number of rows, pixels.
    pub height: usize,
    /// To the right by one pixel: mm, or at unit distance from a pinhole.
    pub right: DVec3,
    /// Down by one pixel.
    pub down: DVec3,
    /// Unit vector of view.
    pub view: DVec3,
    /// Whether the means of 4 by 4 tiles are observables too.
    pub has_tiles: bool,
}

/// Pixels `columns[0]..columns[1]` of rows `rows[0]..rows[1]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PixelRectangle {
    /// First column, and the one after the last.
    pub columns: [usize; 2],
    /// First row, and the one after the last.
    pub rows: [usize; 2],
}

/// Tiles per side of an image.
const TILES: usize = 4;

/// The tile that holds pixel `at` of a side of `size` pixels. Tiles are as even as integers allow.
#[inline]
fn tile_at(at: usize, size: usize) -> usize {
    at * TILES / size
}

/// The first pixel of a tile and of the next one: the first with at * TILES >= tile * size.
#[inline]
fn tile_ends(tile: usize, size: usize) -> [usize; 2] {
    [(tile * size).div_ceil(TILES), ((tile + 1) * size).div_ceil(TILES)]
}

impl Screen {
    /// Number of pixels.
    #[inline]
    pub(super) fn count(&self) -> usize {
        self.width * self.height
    }

    /// Pixels per row and rows.
    pub(super) fn size(&self) -> (usize, usize) {
        (self.width, self.height)
    }

    /// From the middle of the image to a point of pixel `index`.
    #[inline]
    pub(super) fn offset(&self, index: usize, u: [f64; 4]) -> DVec3 {
        let column = (index % self.width) as f64 + u[0] - 0.5 * self.width as f64;
        let row = (index / self.width) as f64 + u[1] - 0.5 * self.height as f64;
        column * self.right + row * self.down
    }

    /// The image's mean, then its tiles, row by row.
    pub(super) fn regions(&self) -> Vec<SensorRegion> {
        let count = if self.has_tiles { TILES * TILES } else { 0 };
        let tile = |k: usize| {
            let (row, column) = (k / TILES, k % TILES);
            let columns = tile_ends(column, self.width);
            let rows = tile_ends(row, self.height);
            let tile = Some(PixelRectangle { columns, rows });
            SensorRegion { name: format!("tile_{row}_{column}"), split: false, tile }
        };
        std::iter::once(SensorRegion::split("mean")).chain((0..count).map(tile)).collect()
    }

    /// The image's mean, and the pixel's tile.
    #[inline]
    pub(super) fn regions_of(&self, pixel: usize) -> RegionShares {
        let mean = RegionShares::one(0, 1.0 / self.count() as f64);
        if !self.has_tiles {
            return mean;
        }
        let (tile, pixels) = self.tile(pixel);
        mean.and(1 + tile, 1.0 / pixels as f64)
    }

    /// The tile of a pixel and the number of pixels in that tile.
    #[inline]
    pub(super) fn tile(&self, pixel: usize) -> (usize, usize) {
        let across = |at: usize, size: usize| {
            let tile = tile_at(at, size);
            let [start, end] = tile_ends(tile, size);
            (tile, end - start)
        };
        let (column, columns) = across(pixel % self.width, self.width);
        let (row, rows) = across(pixel / self.width, self.height);
        (row * TILES + column, rows * columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every pixel lies in one tile, the rectangle of that tile's region, and a tile's factor is one
    /// over its pixels.
    #[test]
    fn tiles_partition_images() {
        for (width, height) in [(64, 64), (7, 5), (4, 9), (3, 2)] {
            let [right, down, view] = [DVec3::X, -DVec3::Y, -DVec3::Z];
            let screen = Screen { width, height, right, down, view, has_tiles: true };
            let mut counts = [0usize; TILES * TILES];
            for pixel in 0..width * height {
                counts[screen.tile(pixel).0] += 1;
            }
            let regions = screen.regions();
            for pixel in 0..width * height {
                let (tile, pixels) = screen.tile(pixel);
                assert_eq!(counts[tile], pixels, "{width}x{height} pixel {pixel}");
                let holds = |region: &SensorRegion| {
                    region.tile.is_some_and(|PixelRectangle { columns, rows }| {
                        (columns[0]..columns[1]).contains(&(pixel % width))
                            && (rows[0]..rows[1]).contains(&(pixel / width))
                    })
                };
                let holders: Vec<usize> = (0..regions.len()).filter(|&i| holds(&regions[i])).collect();
                assert_eq!(holders, [1 + tile], "{width}x{height} pixel {pixel}");
            }
        }
    }
}
