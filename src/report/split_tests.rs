//! Tests of split pictures: which half is whose, one white for both, and the caption's statement of
//! times.

use super::*;
use crate::results::image::decoded;
use crate::results::npy::Array;
use crate::results::sample;
use crate::results::store::pixels_path;
use crate::results::timing::{TimeSpent, Timing};

fn wanted(exposure_stops: Option<f64>) -> Split {
    let (left, right) = ("mis".into(), "snee".into());
    Split { left, right, rows: Some("boundary".into()), columns: Some("light".into()), exposure_stops }
}

/// Four cells, two boundaries times two lights. `mis` shows 1 everywhere in red with an error of 0.5,
/// `snee` 2 with an error of 0.1, where its last pixel is 40; both times `brightness(cell)`.
fn grid(brightness: fn(usize) -> f64, seconds: [f64; 2]) -> Stored {
    let mut stored = sample::stored(0.1);
    let (mut cells, mut timing) = (Vec::new(), Timing::default());
    for (index, (boundary, light)) in
        [("rough", "sun"), ("rough", "sky"), ("smooth", "sun"), ("smooth", "sky")]
            .into_iter()
            .enumerate()
    {
        let mut cell = stored.record.cells[0].clone();
        cell.label = format!("{boundary}, {light}");
        cell.axes = [("boundary", boundary), ("light", light)].map(|(a, l)| (a.into(), l.into())).into();
        let scores = [(1.0, 0.5, seconds[0]), (2.0, 0.1, seconds[1])];
        for (number, (run, (value, error, time))) in cell.runs.iter_mut().zip(scores).enumerate() {
            let red = |x: f64| [x * brightness(index), 0.0];
            let mut data: Vec<f64> = (0..6).flat_map(|_| red(value)).collect();
            if run.estimator == "snee" {
                data[10] = 40.0 * brightness(index);
            }
            data.extend((0..6).flat_map(|_| red(error)));
            let path = pixels_path(index, number);
            stored.arrays.insert(path.clone(), Array::new(vec![2, 2, 3, 2], data));
            run.image.as_mut().expect("an image").pixels = path;
            let cost = TimeSpent {
                cpu_seconds: time,
                set_up_seconds: 0.0,
                wall_seconds: time,
                passes: run.passes,
                paths: 1,
            };
            timing.add(&cell.label, &run.estimator, cost);
        }
        cells.push(cell);
    }
    stored.record.cells = cells;
    stored.timing = Some(timing);
    stored
}

fn write(stored: &Stored, split: &Split) -> (tempfile::TempDir, Vec<SplitFigure>) {
    let temp = tempfile::tempdir().expect("a folder");
    let folder = RecordFolder::new(temp.path());
    let figures = write_splits(&folder, stored, std::slice::from_ref(split)).expect("pictures");
    (temp, figures)
}

fn column<'a>(figure: &'a SplitFigure, name: &str) -> Vec<&'a str> {
    let header = &figure.table.header;
    let at = header.iter().position(|h| h == name).unwrap_or_else(|| panic!("{name}: {header:?}"));
    figure.table.rows.iter().map(|row| row[at].as_str()).collect()
}

#[test]
fn halves_are_whose_they_should_be_and_share_a_white() {
    let stored = grid(|cell| [1.0, 10.0, 0.1, 3.0][cell], [2.0, 2.1]);
    let (folder, figures) = write(&stored, &wanted(None));
    let [figure] = &figures[..] else { panic!("{} grids", figures.len()) };
    // `snee` has the lower noise; of its five pixels at 2 and one at 40, the 95th percentile is the
    // last.
    assert_eq!(column(figure, "white"), ["40.0", "400", "4.00", "120"]);
    assert!(column(figure, "white of").iter().all(|name| *name == "snee"));
    // 3 x 2 pixels, 64 times: 1 column left, 2 right, 1 of paper between; 6 between pictures.
    let (width, height, data) = decoded(&figure.png);
    assert_eq!((width, height), (2 * 193 + 6, 2 * 128 + 6));
    let red = |u: usize, v: usize| data[3 * (v * width + u)];
    let shown = |x: f64| (255.0 * (1.055 * (x / 40.0f64).powf(1.0 / 2.4) - 0.055)).round() as u8;
    for (x, y) in [(0, 0), (199, 0), (0, 134), (199, 134)] {
        assert_eq!((red(x, y), red(x + 63, y + 127)), (shown(1.0), shown(1.0)), "left: mis");
        assert_eq!((red(x + 65, y), red(x + 192, y)), (shown(2.0), shown(2.0)), "right: snee");
        assert_eq!((red(x + 128, y + 127), red(x + 192, y + 127)), (shown(2.0), 255), "its last pixel");
    }
    let is_paper = |u: usize, v: usize| data[3 * (v * width + u)..][..3] == [255; 3];
    assert!(is_paper(64, 0) && is_paper(195, 0) && is_paper(0, 130) && !is_paper(65, 0));
    assert!(figure.caption.contains("boundary = rough | smooth"), "{}", figure.caption);
    assert!(figure.caption.contains("light = sun | sky"), "{}", figure.caption);
    // Beside it the caption, and each picture alone.
    let path = |name: &str| folder.path().join("images").join(name);
    let caption = std::fs::read_to_string(path("split-1.md")).expect("a caption");
    assert!(
        caption.contains("| boundary = rough, light = sun") && caption.contains(&figure.caption),
        "{caption}"
    );
    let alone = std::fs::read(path("split-1-cell-002.png")).expect("a picture");
    assert_eq!(decoded(&alone).0, 193);
    assert_eq!(std::fs::read(path("split-1.png")).expect("the grid"), figure.png);
}

#[test]
fn equal_time_is_stated_where_it_is_true() {
    let (_folder, figures) = write(&grid(|_| 1.0, [2.0, 2.1]), &wanted(None));
    let caption = &figures[0].caption;
    assert!(caption.contains("Equal time") && caption.contains("at most 5.0 %"), "{caption}");
    assert_eq!(column(&figures[0], "time, right over left"), ["1.05"; 4]);

    let (_folder, figures) = write(&grid(|_| 1.0, [2.5, 2.0]), &wanted(None));
    let caption = &figures[0].caption;
    assert!(caption.contains("NOT equal time in 4 of 4") && caption.contains("25 %"), "{caption}");
    assert_eq!(column(&figures[0], "note"), ["mis took 25 % more time than snee"; 4]);
}

#[test]
fn time_that_is_not_known_is_not_called_equal() {
    let mut stored = grid(|_| 1.0, [2.0, 2.0]);
    // A resumed run that lost the time of half of its passes.
    let timing = stored.timing.as_mut().expect("a timing");
    timing.cells.get_mut("rough, sky").expect("a cell").get_mut("snee").expect("a run").passes /= 2;
    let (_folder, figures) = write(&stored, &wanted(None));
    assert!(
        figures[0].caption.contains("In 1 pictures the time is not known"),
        "{}",
        figures[0].caption
    );
    assert_eq!(column(&figures[0], "note")[1], "the time of snee is not known");
    stored.timing = None;
    let (_folder, figures) = write(&stored, &wanted(None));
    assert!(figures[0].caption.contains("is not known"), "{}", figures[0].caption);
    assert!(!figures[0].caption.contains("qual time"), "{}", figures[0].caption);
}

#[test]
fn a_black_half_never_sets_the_white() {
    let mut stored = grid(|_| 1.0, [2.0, 2.0]);
    for cell in 0..4 {
        let pixels = stored.arrays.get_mut(&pixels_path(cell, 1)).expect("pixels");
        pixels.data.fill(0.0);
    }
    let (_folder, figures) = write(&stored, &wanted(None));
    assert!(column(&figures[0], "white of").iter().all(|name| *name == "mis"));
    assert_eq!(column(&figures[0], "white"), ["1.00"; 4]);
}

#[test]
fn a_stated_exposure_is_that_of_all_pictures() {
    let (_folder, figures) = write(&grid(|_| 1.0, [2.0, 2.0]), &wanted(Some(-2.0)));
    assert_eq!(column(&figures[0], "white"), ["4.00"; 4]);
    assert_eq!(column(&figures[0], "snee: too bright"), ["1"; 4]);
    assert!(figures[0].caption.contains("Exposure -2 stops"), "{}", figures[0].caption);
}

#[test]
fn axes_that_are_neither_rows_nor_columns_give_grids() {
    let split = Split { rows: None, ..wanted(None) };
    let (_folder, figures) = write(&grid(|_| 1.0, [2.0, 2.0]), &split);
    let stems: Vec<&str> = figures.iter().map(|figure| figure.stem.as_str()).collect();
    assert_eq!(stems, ["images/split-1-1", "images/split-1-2"]);
    assert_eq!(figures[1].title, "mis | snee, boundary smooth");
    assert_eq!(
        column(&figures[1], "cell"),
        ["boundary = smooth, light = sun", "boundary = smooth, light = sky"]
    );
}

#[test]
fn a_missing_image_is_noted() {
    let mut stored = grid(|_| 1.0, [2.0, 2.0]);
    stored.record.cells[3].runs.truncate(1);
    let (_folder, figures) = write(&stored, &wanted(None));
    assert_eq!(column(&figures[0], "note")[3], "no image of snee");
    assert_eq!(column(&figures[0], "white of")[3], "mis");
}

/// The picture at the head of the report: `snee`, the right half, shows 2 everywhere but in its last pixel.
#[test]
fn the_lead_has_the_exposure_of_the_experiment() {
    let mut stored = grid(|_| 1.0, [2.0, 2.0]);
    let red = |stored: &Stored| {
        let temp = tempfile::tempdir().expect("a folder");
        let folder = RecordFolder::new(temp.path());
        let cell = (0, &stored.record.cells[0]);
        let figure = lead(&folder, stored, cell, ["mis", "snee"], "").expect("a picture");
        let PictureFile::Png(png) = figure.picture else { panic!("no PNG") };
        let (width, height, data) = decoded(&png);
        data[3 * (height / 4 * width + 3 * width / 4)]
    };
    let shown = |x: f64| (255.0 * (1.055 * x.powf(1.0 / 2.4) - 0.055)).round() as u8;
    assert_eq!(red(&stored), shown(2.0 / 40.0), "white is the brightest of the few pixels");
    stored.record.resolved = serde_json::json!({ "display": { "exposure_stops": -2.0 } });
    assert_eq!(red(&stored), shown(2.0 * 0.25));
}
