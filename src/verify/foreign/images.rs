//! Images of other renderers, as planes of a record's bands.

use crate::error::{Error, Result};
use crate::results::exr_file::ExrImage;
use crate::results::record::Band;

/// A renderer that computes in 32 bits is given this relative error, which no number of seeds makes
/// smaller: a hundred roundings.
const SINGLE: f64 = 1e-5;

/// The same for a file of half floats: the largest relative rounding error, 2^-11.
const HALF: f64 = 1.0 / 2048.0;

/// The pixels of several seeds in every band of a record.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Planes {
    /// Pixels per row.
    pub width: usize,
    /// Rows, from the top.
    pub height: usize,
    /// `[seed][band][pixel]`, row by row from the top.
    pub seeds: Vec<Vec<Vec<f64>>>,
    /// Relative error of arithmetic and storage, the same in every seed.
    pub rounding: f64,
    /// What a reader must know: which channel is which band, and what was not compared.
    pub notes: Vec<String>,
}

/// Matches channels to bands.
///
/// A band `b` is the channel that `channels` names for it, or the first that an image has of `b.mean`
/// (the program's own images), `b`, the only one that ends in `.b`; and where there is one band, `Y`,
/// or `R`, `G` and `B` with equal values. Values are multiplied by `scale`.
///
/// # Errors
/// Fewer than two images, two with the same pixels, other sizes than `size` (pixels per row, rows),
/// a band without a channel.
pub(crate) fn planes(
    images: &[(String, ExrImage)],
    bands: &[Band],
    size: (usize, usize),
    channels: &[(String, String)],
    scale: f64,
) -> Result<Planes> {
    if images.len() < 2 {
        return Err(Error::input_help(
            "one image has no error: its mean cannot be tested",
            "name two or more images of the same scene, rendered with different seeds",
        ));
    }
    if let Some((name, _)) = channels.iter().find(|(name, _)| bands.iter().all(|b| b.name != *name)) {
        let names: Vec<&str> = bands.iter().map(|band| band.name.as_str()).collect();
        let rule = format!("--channel names band `{name}`, which the record does not have");
        return Err(Error::input_help(rule, format!("its bands are {}", names.join(", "))));
    }
    for (name, image) in images {
        if (image.width, image.height) != size {
            let (width, height) = size;
            return Err(Error::input_help(
                format!(
                    "{name} has {} x {} pixels, the record's image {width} x {height}",
                    image.width, image.height
                ),
                "render it in the record's resolution: a resampled image has no independent pixels",
            ));
        }
    }
    let mut seeds = Vec::new();
    let mut notes = Vec::new();
    for (name, image) in images {
        let found = bands.iter().map(|band| channel(name, image, band, bands.len(), channels));
        let found = found.collect::<Result<Vec<String>>>()?;
        let plane = |channel: &String| {
            image.channels[channel].iter().map(|x| f64::from(*x) * scale).collect::<Vec<f64>>()
        };
        seeds.push(found.iter().map(plane).collect::<Vec<_>>());
        note(&mut notes, image, bands, &found);
    }
    if let Some((a, b)) = twins(&seeds) {
        let black = seeds[a].iter().flatten().all(|x| *x == 0.0);
        let (what, help) = match black {
            true => (", all black", "was anything rendered? Or can neither sample this light?"),
            false => (
                "",
                "were they rendered with one seed? Each image needs its own; a copy hides the noise",
            ),
        };
        let rule = format!("{} and {} hold the same pixels{what}", images[a].0, images[b].0);
        return Err(Error::input_help(rule, help));
    }
    let rounding = if images.iter().any(|(_, image)| image.has_half) { HALF } else { SINGLE };
    if rounding == HALF {
        notes.push(format!(
            "stored as half floats: {:.2} % of a value are their error, whatever the seeds' spread",
            100.0 * HALF
        ));
    }
    Ok(Planes { width: size.0, height: size.1, seeds, rounding, notes })
}

/// The channel of a band.
fn channel(
    name: &str,
    image: &ExrImage,
    band: &Band,
    bands: usize,
    channels: &[(String, String)],
) -> Result<String> {
    let has = |channel: &str| image.channels.contains_key(channel);
    let listed = || image.channels.keys().map(String::as_str).collect::<Vec<_>>().join(", ");
    if let Some((_, given)) = channels.iter().find(|(b, _)| *b == band.name) {
        return match has(given) {
            true => Ok(given.clone()),
            false => Err(Error::input_help(
                format!("{name} has no channel `{given}`"),
                format!("it has {}", listed()),
            )),
        };
    }
    let own = format!("{}.mean", band.name);
    if let Some(found) = [own, band.name.clone()].into_iter().find(|channel| has(channel)) {
        return Ok(found);
    }
    let ending = format!(".{}", band.name);
    let mut layers = image.channels.keys().filter(|channel| channel.ends_with(&ending));
    match (layers.next(), layers.next()) {
        (Some(found), None) => return Ok(found.clone()),
        (Some(a), Some(b)) => {
            return Err(Error::input_help(
                format!("{name}: both `{a}` and `{b}` could be band `{}`", band.name),
                format!("state which: --channel {}={a}", band.name),
            ));
        }
        _ => {}
    }
    if bands == 1 {
        if has("Y") {
            return Ok("Y".into());
        }
        if let [Some(r), Some(g), Some(b)] = ["R", "G", "B"].map(|c| image.channels.get(c)) {
            let same = |x: &[f32], y: &[f32]| x.iter().zip(y).all(|(x, y)| x.to_bits() == y.to_bits());
            if same(r, g) && same(r, b) {
                return Ok("R".into());
            }
            return Err(Error::input_help(
                format!("{name}: R, G and B differ, and the record has the one band `{}`", band.name),
                format!("render in one band, or name its channel: --channel {}=R", band.name),
            ));
        }
    }
    Err(Error::input_help(
        format!("{name} has no channel for band `{}`", band.name),
        format!("it has {}; --channel {}=NAME says which one it is", listed(), band.name),
    ))
}

/// Which channel is which band, and what was left out, once for all images that are alike.
fn note(notes: &mut Vec<String>, image: &ExrImage, bands: &[Band], found: &[String]) {
    let renamed = bands.iter().zip(found).filter(|(band, channel)| band.name != **channel);
    let renamed: Vec<String> = renamed.map(|(b, c)| format!("channel {c} is band {}", b.name)).collect();
    let grey = bands.len() == 1 && found[0] == "R";
    let left = image.channels.keys().filter(|c| !found.contains(c));
    let left: Vec<&str> =
        left.map(String::as_str).filter(|c| !(grey && ["G", "B"].contains(c))).collect();
    let mut add = |text: String| {
        if !text.is_empty() && !notes.contains(&text) {
            notes.push(text);
        }
    };
    add(renamed.join(", "));
    if !left.is_empty() {
        add(format!("not looked at: {}", left.join(", ")));
    }
}

/// Two images with the same bits in every band.
fn twins(seeds: &[Vec<Vec<f64>>]) -> Option<(usize, usize)> {
    let bits = |seed: &[Vec<f64>]| -> Vec<u64> { seed.iter().flatten().map(|x| x.to_bits()).collect() };
    let all: Vec<Vec<u64>> = seeds.iter().map(|seed| bits(seed)).collect();
    let pairs = (0..all.len()).flat_map(|a| (a + 1..all.len()).map(move |b| (a, b)));
    pairs.into_iter().find(|&(a, b)| all[a] == all[b])
}
