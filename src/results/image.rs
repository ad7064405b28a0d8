//! A run's image, and the PNG that shows it.

use std::path::Path;

use super::record::{Band, EstimatorRun};
use super::store::Stored;
use super::{atomic, npy::Array};
use crate::error::{Error, Result};
use crate::math;

/// The pixels of one run: mean and standard error in every band.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Pixels per row.
    pub width: usize,
    /// Rows, from the top.
    pub height: usize,
    /// The bands, in the order of the array's last axis.
    pub bands: &'a [Band],
    pixels: &'a [f64],
}

impl<'a> Picture<'a> {
    /// A run's image, where it has one.
    pub fn of(stored: &'a Stored, run: &EstimatorRun) -> Option<Picture<'a>> {
        let pixels = stored.arrays.get(&run.image.as_ref()?.pixels)?;
        Some(Picture::new(&stored.record.bands, pixels))
    }

    /// From an array `[2][row][column][band]`; panics on other shapes.
    pub fn new(bands: &'a [Band], array: &'a Array) -> Picture<'a> {
        let [2, height, width, n] = array.shape[..] else { panic!("shape {:?}", array.shape) };
        assert_eq!(n, bands.len(), "one plane a band");
        Picture { width, height, bands, pixels: &array.data }
    }

    /// Mean over passes of a band, row by row.
    pub fn mean(&self, band: usize) -> impl Iterator<Item = f64> {
        self.half(0).iter().skip(band).step_by(self.bands.len()).copied()
    }

    /// Standard error of the mean of a band, row by row.
    pub fn std_error(&self, band: usize) -> impl Iterator<Item = f64> {
        self.half(1).iter().skip(band).step_by(self.bands.len()).copied()
    }

    /// Linear sRGB of every pixel: the sum over bands of radiance times display colour.
    pub fn rgb(&self) -> impl Iterator<Item = [f64; 3]> {
        self.half(0).chunks(self.bands.len().max(1)).map(|pixel| {
            let mut rgb = [0.0; 3];
            for (radiance, band) in pixel.iter().zip(self.bands) {
                (0..3).for_each(|c| rgb[c] += radiance * band.display_rgb[c]);
            }
            rgb
        })
    }

    fn half(&self, index: usize) -> &'a [f64] {
        let length = self.pixels.len() / 2;
        &self.pixels[index * length..(index + 1) * length]
    }
}

/// A tone-mapped image.
#[derive(Clone, Debug, PartialEq)]
pub struct Png {
    /// Bytes of the PNG file.
    pub bytes: Vec<u8>,
    /// Pixels with a channel above 1 after exposure, shown as 1: brighter than the picture can show.
    pub clipped: usize,
    /// Pixels with a channel below 0 (outside the sRGB gamut) or not finite; negatives and NaN show as
    /// 0.
    pub out_of_gamut: usize,
}

/// An 8-bit sRGB picture: radiance times 2^stops, clipped to [0, 1], sRGB transfer, nothing else.
pub fn to_png(picture: &Picture, exposure_stops: f64) -> Result<Png> {
    let gain = gain(exposure_stops);
    let (mut clipped, mut out_of_gamut) = (0, 0);
    let mut data = Vec::with_capacity(3 * picture.width * picture.height);
    for rgb in picture.rgb() {
        let shown = show(rgb, gain);
        clipped += usize::from(shown.clipped);
        out_of_gamut += usize::from(shown.out_of_gamut);
        data.extend(shown.bytes);
    }
    let bytes = encoded(picture.width, picture.height, &data)?;
    Ok(Png { bytes, clipped, out_of_gamut })
}

/// The factor of an exposure in stops.
pub fn gain(exposure_stops: f64) -> f64 {
    math::pow(2.0, exposure_stops)
}

/// A pixel on a display.
pub(super) struct Shown {
    /// Colour as sRGB bytes.
    pub bytes: [u8; 3],
    /// A channel above 1 is shown as 1.
    pub clipped: bool,
    /// A channel is negative or not finite.
    pub out_of_gamut: bool,
}

/// Linear sRGB times `gain`, clipped to [0, 1], through the sRGB transfer.
pub(super) fn show(rgb: [f64; 3], gain: f64) -> Shown {
    let exposed = rgb.map(|c| c * gain);
    Shown {
        bytes: exposed.map(|c| (srgb_transfer(c.clamp(0.0, 1.0)) * 255.0).round() as u8),
        clipped: exposed.iter().any(|c| *c > 1.0),
        out_of_gamut: exposed.iter().any(|c| *c < 0.0 || !c.is_finite()),
    }
}

/// 8-bit sRGB of linear sRGB times `gain`, clipped to [0, 1].
pub fn shown_bytes(rgb: [f64; 3], gain: f64) -> [u8; 3] {
    show(rgb, gain).bytes
}

/// A PNG of 8-bit sRGB values, row by row from the top.
pub(super) fn encoded(width: usize, height: usize, data: &[u8]) -> Result<Vec<u8>> {
    let set = |encoder: &mut png::Encoder<&mut Vec<u8>>| {
        encoder.set_source_srgb(png::SrgbRenderingIntent::RelativeColorimetric);
    };
    encode((width, height), png::ColorType::Rgb, data, set)
}

/// Writes the PNG and returns what it could not show.
pub fn write_png(path: &Path, picture: &Picture, exposure_stops: f64) -> Result<Png> {
    let png = to_png(picture, exposure_stops)?;
    atomic::write(path, &png.bytes, "write the picture")?;
    Ok(png)
}

/// Writes signed values, row by row from the top, in diverging colours: white at 0, deep red at `limit`
/// and beyond, deep blue at -`limit` and below, grey where the value is not a number.
pub fn write_diverging_png(path: &Path, width: usize, values: &[f64], limit: f64) -> Result<()> {
    let height = values.len() / width.max(1);
    let data: Vec<u8> = values.iter().flat_map(|x| diverging(x / limit)).collect();
    let bytes = encoded(width, height, &data)?;
    atomic::write(path, &bytes, "write the picture")
}

/// From -1 (blue) over 0 (white) to 1 (red), sRGB values: linear between the end and middle colours of
/// C. Brewer's scheme RdBu.
pub fn diverging(x: f64) -> [u8; 3] {
    if x.is_nan() {
        return [128; 3];
    }
    const WHITE: [f64; 3] = [247.0, 247.0, 247.0];
    let (half, end) = if x < 0.0 {
        ([67.0, 147.0, 195.0], [5.0, 48.0, 97.0])
    } else {
        ([214.0, 96.0, 77.0], [103.0, 0.0, 31.0])
    };
    let at = 2.0 * x.abs().min(1.0);
    let (from, to, part) = if at < 1.0 { (WHITE, half, at) } else { (half, end, at - 1.0) };
    [0, 1, 2].map(|c| (from[c] + part * (to[c] - from[c])).round() as u8)
}

/// Linear sRGB, row by row from the top, as data for a script, not to be looked at: a PNG of twice its
/// height, without a colour profile and without row filters. A value is the upper half of its 32-bit
/// float (sign, 8 bits of exponent, 7 of mantissa): relative error at most 2^-8, not finite where the
/// value is not, any exposure. The upper rows hold the first bytes, the lower rows the second ones. An
/// exponent of its own for every channel: one that three channels share loses the dark ones of saturated
/// colours by several levels of a display.
pub fn to_linear_png(width: usize, rgb: impl Iterator<Item = [f64; 3]>) -> Result<Vec<u8>> {
    let pixels: Vec<[u16; 3]> = rgb.map(|rgb| rgb.map(upper_half)).collect();
    let is_grey = pixels.iter().all(|[r, g, b]| r == g && g == b);
    let (colour, channels) =
        if is_grey { (png::ColorType::Grayscale, 1) } else { (png::ColorType::Rgb, 3) };
    let values = || pixels.iter().flat_map(|pixel| &pixel[..channels]);
    let bytes = |byte: usize| values().map(move |value| value.to_be_bytes()[byte]);
    let data: Vec<u8> = bytes(0).chain(bytes(1)).collect();
    plane_png(width, 2 * (pixels.len() / width.max(1)), colour, &data)
}

/// One byte a pixel, row by row from the top, as data for a script: see [`to_linear_png`].
pub fn to_byte_png(width: usize, bytes: &[u8]) -> Result<Vec<u8>> {
    plane_png(width, bytes.len() / width.max(1), png::ColorType::Grayscale, bytes)
}

/// The upper 16 bits of the nearest 32-bit float, rounded.
fn upper_half(x: f64) -> u16 {
    let bits = (x as f32).to_bits();
    if x.is_nan() { 0x7fc0 } else { ((bits + 0x7fff + (bits >> 16 & 1)) >> 16) as u16 }
}

/// Data for a script: no profile, no filters.
fn plane_png(width: usize, height: usize, colour: png::ColorType, data: &[u8]) -> Result<Vec<u8>> {
    let set = |encoder: &mut png::Encoder<&mut Vec<u8>>| {
        encoder.set_compression(png::Compression::Balanced);
        encoder.set_filter(png::Filter::NoFilter);
    };
    encode((width, height), colour, data, set)
}

/// A PNG of 8 bits a channel, with what `set` sets.
fn encode(
    (width, height): (usize, usize),
    colour: png::ColorType,
    data: &[u8],
    set: impl FnOnce(&mut png::Encoder<&mut Vec<u8>>),
) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
    encoder.set_color(colour);
    encoder.set_depth(png::BitDepth::Eight);
    set(&mut encoder);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(data)?;
        writer.finish()
    });
    match written {
        Ok(()) => Ok(bytes),
        Err(e) => Err(Error::input(format!("an image of {width}x{height} pixels: {e}"))),
    }
}

/// The transfer function of IEC 61966-2-1: linear in, display value out.
fn srgb_transfer(x: f64) -> f64 {
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * math::pow(x, 1.0 / 2.4) - 0.055 }
}

/// Width, height and values of a PNG file, which is marked as sRGB.
#[cfg(test)]
pub(crate) fn decoded(bytes: &[u8]) -> (usize, usize, Vec<u8>) {
    let (is_srgb, decoded) = decoded_plane(bytes);
    assert!(is_srgb);
    decoded
}

/// The same of any PNG file, and whether it is marked as sRGB.
#[cfg(test)]
pub(crate) fn decoded_plane(bytes: &[u8]) -> (bool, (usize, usize, Vec<u8>)) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(bytes)).read_info().expect("a PNG");
    let is_srgb = reader.info().srgb.is_some();
    let (width, height) = reader.info().size();
    let mut data = vec![0; reader.output_buffer_size().expect("a size")];
    reader.next_frame(&mut data).expect("a frame");
    (is_srgb, (width as usize, height as usize, data))
}

#[cfg(test)]
mod tests {
    use super::super::sample;
    use super::*;

    // Linear 0.5 is 188 in sRGB, 0.2 is 124, 0.18 is 118 (IEC 61966-2-1).
    #[test]
    fn transfer() {
        let byte = |x: f64| (srgb_transfer(x) * 255.0).round();
        assert_eq!([0.0, 0.001, 0.18, 0.5, 1.0].map(byte), [0.0, 3.0, 118.0, 188.0, 255.0]);
    }

    #[test]
    fn diverging_colours() {
        assert_eq!([-2.0, -0.5, 0.0].map(diverging), [[5, 48, 97], [67, 147, 195], [247; 3]]);
        assert_eq!([0.5, 1.0, f64::NAN].map(diverging), [[214, 96, 77], [103, 0, 31], [128; 3]]);
    }

    #[test]
    fn planes_and_colours() {
        let stored = sample::stored(0.5);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        assert_eq!((picture.width, picture.height), (3, 2));
        let expected: Vec<f64> = (0..6).map(|i| 0.1 * (2 * i + 1) as f64).collect();
        assert_eq!(picture.mean(1).collect::<Vec<_>>(), expected);
        assert!(picture.std_error(0).all(|e| e == 0.01));
        assert_eq!(picture.rgb().nth(1), Some([0.2, 0.1 * 3.0, 0.0]));
    }

    #[test]
    fn png_shows_and_counts() {
        let mut stored = sample::stored(0.5);
        let path = stored.record.cells[0].runs[0].image.as_ref().expect("an image").pixels.clone();
        let pixels = stored.arrays.get_mut(&path).expect("pixels");
        pixels.data[..4].copy_from_slice(&[0.25, 0.09, -0.1, f64::NAN]);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        let png = to_png(&picture, 1.0).expect("a PNG");
        assert_eq!((png.clipped, png.out_of_gamut), (3, 1));
        assert_eq!(decoded(&png.bytes).2[..6], [188, 118, 0, 0, 0, 0]);
    }

    #[test]
    fn linear_values_come_back() {
        let mut x = 1e-30;
        while x < 1e30 {
            for value in [x, -x] {
                let back = f64::from(f32::from_bits(u32::from(upper_half(value)) << 16));
                assert!((back / value - 1.0).abs() <= 1.0 / 256.0, "{value} {back}");
            }
            x *= 1.001;
        }
        let values = [0.0, 1.0, 2.0, -1.5, f64::INFINITY, f64::NAN, 1e300];
        let halves = [0, 0x3f80, 0x4000, 0xbfc0, 0x7f80, 0x7fc0, 0x7f80];
        assert_eq!(values.map(upper_half), halves);
    }

    #[test]
    fn linear_png_holds_bytes_by_plane() {
        let stored = sample::stored(0.5);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        let (is_srgb, (width, height, data)) =
            decoded_plane(&to_linear_png(3, picture.rgb()).expect("a PNG"));
        assert_eq!((is_srgb, width, height), (false, 3, 4));
        for (index, rgb) in picture.rgb().enumerate() {
            for (channel, value) in rgb.iter().enumerate() {
                let at = 3 * index + channel;
                assert_eq!([data[at], data[18 + at]], upper_half(*value).to_be_bytes());
            }
        }
        let bytes = [3, 1, 4, 1, 5, 9];
        assert_eq!(decoded_plane(&to_byte_png(3, &bytes).expect("a PNG")).1, (3, 2, bytes.to_vec()));
    }

    #[test]
    fn default_exposure_is_the_picture_to_a_level() {
        let mut x = 1e-5;
        while x < 1.5 {
            let back = f64::from(f32::from_bits(u32::from(upper_half(x)) << 16));
            let [a, b] = [x, back].map(|x| i32::from(show([x; 3], 1.0).bytes[0]));
            assert!((a - b).abs() <= 1, "{x}: {a} {b}");
            x *= 1.0007;
        }
    }
}
