//! Radiance HDR files (`.hdr`). The only module that uses `image`.

use std::io::Cursor;
use std::path::Path;

use ::image::DynamicImage;
use ::image::codecs::hdr::HdrDecoder;

use super::exr_file::ExrImage;
use crate::error::{Error, Result};
use crate::input;

/// Reads an image of R, G and B.
///
/// # Errors
/// I/O, and what is no such image.
pub(crate) fn read_hdr(path: &Path) -> Result<ExrImage> {
    let bytes = input::read(path, input::LARGEST_DATA).map_err(Error::io(path, "read the image"))?;
    let refuse = |what: String| Error::record(path, format!("not a usable Radiance HDR image: {what}"));
    let decoder = HdrDecoder::new(Cursor::new(bytes)).map_err(|e| refuse(e.to_string()))?;
    let image = DynamicImage::from_decoder(decoder).map_err(|e| refuse(e.to_string()))?.into_rgb32f();
    let plane = |channel: usize| image.pixels().map(|pixel| pixel.0[channel]).collect();
    Ok(ExrImage {
        width: image.width() as usize,
        height: image.height() as usize,
        channels: ["R", "G", "B"]
            .iter()
            .zip(0..)
            .map(|(name, c)| (name.to_string(), plane(c)))
            .collect(),
        has_half: false,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_are_read_in_their_order() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("sky.hdr");
        // Two pixels a row, two rows: mantissas and a shared exponent of 128 + e, value m / 256 * 2^e.
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 2\n".to_vec();
        for pixel in [[128, 64, 0, 129], [255, 255, 255, 128], [0, 0, 0, 0], [64, 128, 192, 136]] {
            bytes.extend(pixel);
        }
        std::fs::write(&path, bytes).expect("written");
        let image = read_hdr(&path).expect("an image");
        assert_eq!((image.width, image.height), (2, 2));
        assert_eq!(image.channels["R"], [1.0, 255.0 / 256.0, 0.0, 64.0]);
        assert_eq!(image.channels["G"], [0.5, 255.0 / 256.0, 0.0, 128.0]);
        assert_eq!(image.channels["B"], [0.0, 255.0 / 256.0, 0.0, 192.0]);
        std::fs::write(&path, b"no image").expect("written");
        let error = read_hdr(&path).expect_err("refused").to_string();
        assert!(error.contains("sky.hdr: not a usable Radiance HDR image"), "{error}");
    }
}
