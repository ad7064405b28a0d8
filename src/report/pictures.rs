//! The pictures of a record's runs, and the bands that have pictures of their own.

use super::document::{FigureBlock, PictureFile};
use crate::error::Result;
use crate::results::atomic;
use crate::results::exr_file::write_exr;
use crate::results::image::{Picture, write_png};
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::{RecordFolder, Stored};

/// A picture of one run.
pub(crate) struct RunPicture {
    /// Cell label.
    pub cell: String,
    /// The PNG file, named by the estimator, with its exposure and the pixels that could not be shown.
    pub figure: FigureBlock,
}

/// The bands that have pictures of their own: up to three bands all of them, else the first, the
/// middle and the last.
pub(super) fn few_bands(count: usize) -> Vec<usize> {
    spread_bands(count, 3)
}

/// At most `most` of `count` bands, evenly spaced, the first and the last among them; the middle one if `most` is 1.
pub(super) fn spread_bands(count: usize, most: usize) -> Vec<usize> {
    let shown = most.min(count);
    let nearest = |i: usize| (i * (count - 1) + (shown - 1) / 2) / (shown - 1);
    (0..shown).map(|i| if shown > 1 { nearest(i) } else { count / 2 }).collect()
}

/// Writes the picture of every run as OpenEXR and PNG into `images/`.
pub(super) fn write_pictures(folder: &RecordFolder, stored: &Stored) -> Result<Vec<RunPicture>> {
    let stops = stored.record.resolved["display"]["exposure_stops"].as_f64().unwrap_or(0.0);
    let mut pictures = Vec::new();
    for (index, cell) in stored.record.cells.iter().enumerate() {
        for (number, run) in cell.runs.iter().enumerate() {
            if let Some(picture) = Picture::of(stored, run) {
                let stem = stem(index, number, &run.estimator);
                pictures.push(write_picture(folder, stored, cell, (run, stem), &picture, stops)?);
            }
        }
    }
    Ok(pictures)
}

/// Path of a run's picture without extension: the estimator's name if it is plain, and otherwise the
/// number of the run and the plain parts of the name.
fn stem(cell: usize, run: usize, estimator: &str) -> String {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    if estimator.chars().all(is_plain) {
        return format!("images/{cell:03}-{estimator}");
    }
    let words: Vec<&str> = estimator.split(|c| !is_plain(c)).filter(|word| !word.is_empty()).collect();
    format!("images/{cell:03}-{run:03}.{}", words.join("-"))
}

fn write_picture(
    folder: &RecordFolder,
    stored: &Stored,
    cell: &Cell,
    (run, stem): (&EstimatorRun, String),
    picture: &Picture,
    stops: f64,
) -> Result<RunPicture> {
    let path = |extension: &str| folder.root().join(format!("{stem}.{extension}"));
    atomic::create_folder(&folder.root().join("images"), "create the image folder")?;
    let attributes = [
        ("experiment", stored.record.experiment.as_str()),
        ("cell", &cell.label),
        ("estimator", &run.estimator),
        ("passes", &run.passes.to_string()),
        ("fingerprint", &stored.record.fingerprint),
    ];
    write_exr(&path("exr"), picture, &attributes)?;
    let png = write_png(&path("png"), picture, stops)?;
    let mut caption = format!("{} passes, exposure {stops:+} stops, clipped to sRGB", run.passes);
    if png.clipped > 0 {
        caption += &format!("; pixels too bright: {}", png.clipped);
    }
    if png.out_of_gamut > 0 {
        caption += &format!("; pixels outside the gamut or not finite: {}", png.out_of_gamut);
    }
    let figure = FigureBlock {
        path: format!("{stem}.png"),
        picture: PictureFile::Png(png.bytes),
        title: run.estimator.clone(),
        caption,
    };
    Ok(RunPicture { cell: cell.label.clone(), figure })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_are_evenly_spaced() {
        assert_eq!(spread_bands(20, 8), [0, 3, 5, 8, 11, 14, 16, 19]);
        assert_eq!(spread_bands(3, 8), [0, 1, 2]);
        assert_eq!(spread_bands(5, 1), [2]);
        assert!(spread_bands(0, 8).is_empty());
        assert_eq!([few_bands(4), few_bands(31)], [[0, 2, 3], [0, 15, 30]]);
    }
}
