//! OpenEXR files: a run's image with its error in every band, and images made elsewhere.

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::Path;

use exr::meta::MetaData;
use exr::meta::header::Header;
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, ReadChannels, ReadLayers, SmallVec, Text, WritableImage,
};

use super::atomic;
use super::image::Picture;
use crate::error::{Error, Result};
use crate::input;

/// Planes of f32 by channel name.
#[derive(Clone, Debug, PartialEq)]
pub struct ExrImage {
    /// Pixels per row.
    pub width: usize,
    /// Rows, from the top.
    pub height: usize,
    /// Row by row. Channels of the first part have their own names, those of later parts
    /// `part.channel`.
    pub channels: BTreeMap<String, Vec<f32>>,
    /// True where a channel is stored in half precision (11 bits).
    pub has_half: bool,
}

/// A part of a file: its name, and its channels by name.
pub type Part = (String, Vec<(String, Vec<f32>)>);

/// Writes a picture, row 0 of the file at the top: a first part `rgb` that any viewer shows (channels R,
/// G, B), then a part for each band with channels `mean` and `std_error`. Values are rounded to f32; the
/// record has them whole. Every part carries `attributes` as lines of its standard attribute `comments`.
pub fn write_exr(path: &Path, picture: &Picture, attributes: &[(&str, &str)]) -> Result<()> {
    let rgb = |c: usize| picture.rgb().map(|rgb| rgb[c] as f32).collect();
    let colours = ["R", "G", "B"].iter().enumerate();
    let mut parts: Vec<Part> =
        vec![("rgb".into(), colours.map(|(c, name)| (name.to_string(), rgb(c))).collect())];
    for (b, band) in picture.bands.iter().enumerate() {
        let mean = picture.mean(b).map(|x| x as f32).collect();
        let std_error = picture.std_error(b).map(|x| x as f32).collect();
        let channels = vec![("mean".into(), mean), ("std_error".into(), std_error)];
        parts.push((band.name.clone(), channels));
    }
    write_parts(path, (picture.width, picture.height), parts, attributes)
}

/// Writes planes of `size` (pixels per row, rows) as 32-bit floats, every part with `attributes` as
/// lines of its standard attribute `comments`.
///
/// # Errors
/// Planes of another size, I/O.
pub fn write_parts(
    path: &Path,
    size: (usize, usize),
    parts: Vec<Part>,
    attributes: &[(&str, &str)],
) -> Result<()> {
    let layers: Vec<_> = parts.into_iter().map(|part| layer(size, part, attributes)).collect();
    let window = IntegerBounds::from_dimensions(size);
    let image = Image::from_layers(ImageAttributes::new(window), layers);
    let mut bytes = Cursor::new(Vec::new());
    let encoded = image.write().non_parallel().to_buffered(&mut bytes);
    encoded.map_err(|e| Error::record(path, format!("could not encode the image: {e}")))?;
    atomic::write(path, &bytes.into_inner(), "write the image")
}

fn layer(
    size: (usize, usize),
    (name, channels): Part,
    attributes: &[(&str, &str)],
) -> Layer<AnyChannels<FlatSamples>> {
    let channels =
        channels.into_iter().map(|(name, data)| AnyChannel::new(&*name, FlatSamples::F32(data)));
    let mut about = LayerAttributes::named(&*name);
    // One standard attribute: the crate writes custom ones in a hash map's order, which is random.
    let lines: String = attributes.iter().map(|(key, value)| format!("{key}: {value}\n")).collect();
    about.comments = Some(Text::from(&*lines));
    let channels = AnyChannels::sort(channels.collect::<SmallVec<_>>());
    Layer::new(size, about, Encoding::SMALL_LOSSLESS, channels)
}

/// Longest side of an image.
const LONGEST_SIDE: usize = 16_384;
/// Largest image, bytes of all its channels.
const LARGEST_IMAGE: usize = 4 << 30;
/// No compression of OpenEXR makes an image smaller than this part of itself: deflate, the strongest on a constant,
/// reaches 1/1032.
const STRONGEST_COMPRESSION: usize = 2048;

/// What speaks against memory for the image that the headers describe. The decoder would ask for whatever they state.
fn too_large(headers: &[Header], file: usize) -> Option<String> {
    let side = headers.iter().flat_map(|header| [header.layer_size.x(), header.layer_size.y()]).max();
    if let Some(side) = side.filter(|side| *side > LONGEST_SIDE) {
        return Some(format!("a side of {side} pixels; at most {LONGEST_SIDE} are read"));
    }
    let of = |header: &Header| {
        let samples = header.channels.list.iter().map(|channel| channel.sample_type.bytes_per_sample());
        samples.sum::<usize>().saturating_mul(header.layer_size.area())
    };
    let bytes = headers.iter().map(of).fold(0, usize::saturating_add);
    if bytes > LARGEST_IMAGE {
        return Some(format!(
            "its header states {bytes} bytes of pixels; at most {LARGEST_IMAGE} are read"
        ));
    }
    let possible = file.saturating_mul(STRONGEST_COMPRESSION);
    (bytes > possible).then(|| {
        format!("its header states {bytes} bytes of pixels, which a file of {file} bytes cannot hold")
    })
}

/// Reads every channel of an image as f32: half, float or integer, one part or several of one size.
pub fn read_exr(path: &Path) -> Result<ExrImage> {
    let refuse = |what: String| Error::record(path, format!("not a usable OpenEXR image: {what}"));
    let bytes = input::read(path, input::LARGEST_DATA).map_err(Error::io(path, "read the image"))?;
    let about = MetaData::read_from_buffered(&bytes[..], false).map_err(|e| refuse(e.to_string()))?;
    if let Some(what) = too_large(&about.headers, bytes.len()) {
        return Err(refuse(what));
    }
    let reader = exr::prelude::read().no_deep_data().largest_resolution_level().all_channels();
    let image = reader.all_layers().all_attributes().non_parallel().from_buffered(Cursor::new(bytes));
    let layers = image.map_err(|e| refuse(e.to_string()))?.layer_data;
    let size = layers.first().map(|layer| layer.size).ok_or_else(|| refuse("it has no parts".into()))?;
    let (mut channels, mut has_half) = (BTreeMap::new(), false);
    for (index, layer) in layers.iter().enumerate() {
        let part = layer.attributes.layer_name.as_ref().map_or(index.to_string(), ToString::to_string);
        if layer.size != size {
            return Err(refuse(format!("part `{part}` has another size than the first")));
        }
        for channel in &layer.channel_data.list {
            let name =
                if index == 0 { channel.name.to_string() } else { format!("{part}.{}", channel.name) };
            if channel.sampling.x() != 1 || channel.sampling.y() != 1 {
                return Err(refuse(format!("channel `{name}` is subsampled")));
            }
            has_half |= matches!(channel.sample_data, FlatSamples::F16(_));
            channels.insert(name, channel.sample_data.values_as_f32().collect());
        }
    }
    Ok(ExrImage { width: size.x(), height: size.y(), channels, has_half })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::super::sample;
    use super::*;

    #[test]
    fn reads_back_what_was_written_and_is_deterministic() {
        let folder = tempfile::tempdir().expect("a folder");
        let stored = sample::stored(0.5);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        let [a, b] = ["a.exr", "b.exr"].map(|name| folder.path().join(name));
        let attributes = [("experiment", "sample"), ("cell", "smooth"), ("estimator", "mis")];
        write_exr(&a, &picture, &attributes).expect("a write");
        write_exr(&b, &picture, &attributes).expect("a write");
        assert!(fs::read(&a).expect("bytes") == fs::read(&b).expect("bytes"));
        let image = read_exr(&a).expect("an image");
        assert_eq!((image.width, image.height), (3, 2));
        let names: Vec<_> = image.channels.keys().map(String::as_str).collect();
        assert_eq!(names, ["B", "G", "G.mean", "G.std_error", "R", "R.mean", "R.std_error"]);
        let mean: Vec<f32> = picture.mean(1).map(|x| x as f32).collect();
        assert_eq!(image.channels["G.mean"], mean);
        assert_eq!(image.channels["G"], mean);
        let meta = exr::meta::MetaData::read_from_file(&a, true).expect("meta data");
        let comments = meta.headers[2].own_attributes.comments.as_ref().map(ToString::to_string);
        assert_eq!(comments.as_deref(), Some("experiment: sample\ncell: smooth\nestimator: mis\n"));
    }

    #[test]
    fn headers_are_not_believed() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("a.exr");
        let stored = sample::stored(0.5);
        let picture = Picture::of(&stored, &stored.record.cells[0].runs[0]).expect("a picture");
        write_exr(&path, &picture, &[]).expect("a write");
        let good = fs::read(&path).expect("bytes");
        // `dataWindow` and `displayWindow` are two corners, inclusive.
        let window = |[x, y]: [i32; 2]| [0, 0, x - 1, y - 1].map(i32::to_le_bytes).concat();
        let claiming = |size: [i32; 2]| {
            let old = window([3, 2]);
            let mut bytes = good.clone();
            let at: Vec<usize> =
                (0..bytes.len() - 16).filter(|&i| bytes[i..i + 16] == old[..]).collect();
            assert!(at.len() >= 2, "{at:?}");
            at.iter().for_each(|&i| bytes[i..i + 16].copy_from_slice(&window(size)));
            fs::write(&path, bytes).expect("a write");
            read_exr(&path).expect_err("a refusal").to_string()
        };
        for (size, what) in [
            ([100_000, 100_000], "a side of 100000 pixels; at most 16384"),
            ([16_384, 16_384], "bytes of pixels"),
            ([2_000, 2_000], "cannot hold"),
        ] {
            let message = claiming(size);
            assert!(message.contains("a.exr") && message.contains(what), "{message}");
        }
    }

    #[test]
    fn errors_name_the_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("sky.exr");
        let message = |path: &Path| read_exr(path).expect_err("a refusal").to_string();
        assert!(
            message(&path).contains("could not read the image") && message(&path).contains("sky.exr")
        );
        fs::write(&path, b"no image").expect("a write");
        assert!(message(&path).contains("sky.exr: not a usable OpenEXR image"), "{}", message(&path));
    }
}
