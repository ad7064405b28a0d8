//! Tests of the contents of a viewer, with artificial cells.

use serde_json::Value;

use super::*;
use crate::report::document::{PageBlock, PictureFile};
use crate::results::image::decoded_plane;
use crate::results::npy::Array;
use crate::results::sample;

fn pictures(stored: &Stored) -> Vec<RunPicture> {
    let cell = &stored.record.cells[0];
    let picture = |run: &EstimatorRun| RunPicture {
        cell: cell.label.clone(),
        figure: FigureBlock {
            path: format!("images/000-{}.png", run.estimator),
            picture: PictureFile::Png(vec![1, 2, 3]),
            title: run.estimator.clone(),
            caption: "a caption".into(),
        },
    };
    cell.runs.iter().map(picture).collect()
}

fn data(stored: &Stored) -> (String, Value) {
    let viewers = viewers(stored, &pictures(stored)).expect("viewers");
    let text = viewers[0].data.clone().expect("data");
    let value = serde_json::from_str(&text).expect("JSON");
    (text, value)
}

/// Base64 as in RFC 4648.
fn bytes(text: &Value) -> Vec<u8> {
    let letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let text = text.as_str().expect("text").trim_end_matches('=');
    let digits: Vec<u32> = text.chars().map(|c| letters.find(c).expect("a letter") as u32).collect();
    let group = |group: &[u32]| {
        let bits = group.iter().fold(0, |bits, digit| bits << 6 | digit) << (6 * (4 - group.len()));
        bits.to_be_bytes()[1..group.len()].to_vec()
    };
    digits.chunks(4).flat_map(group).collect()
}

fn map(text: &Value) -> Vec<u8> {
    decoded_plane(&bytes(text)).1.2
}

/// Sets a run's mean and standard error in the first pixel's first band.
fn set(stored: &mut Stored, run: usize, mean: f64, error: f64) {
    let path = stored.record.cells[0].runs[run].image.as_ref().expect("an image").pixels.clone();
    let array: &mut Array = stored.arrays.get_mut(&path).expect("pixels");
    (array.data[0], array.data[12]) = (mean, error);
}

#[test]
fn maps_of_a_cell() {
    let mut stored = sample::stored(0.5);
    set(&mut stored, 0, 2.0, 0.3);
    set(&mut stored, 1, 1.0, 0.4);
    let (_, data) = data(&stored);
    assert_eq!(
        (&data["width"], &data["height"], &data["cell"]),
        (&3.into(), &2.into(), &"smooth".into())
    );
    let (mis, snee) = (&data["pictures"][0], &data["pictures"][1]);
    assert_eq!(map(&mis["noise"][0])[0], maps::noise_index(0.15));
    assert_eq!(map(&snee["noise"][0])[0], maps::noise_index(0.4));
    assert_eq!((&mis["z"], &mis["difference"]), (&Value::Null, &Value::Null));
    assert_eq!((&mis["alone"], &snee["alone"]), (&"".into(), &"".into()));
    assert_eq!((&snee["z"]["of"], &snee["difference"]["of"]), (&"mis".into(), &"mis".into()));
    // Relative errors of 0.15 and 0.4: too skewed to judge; the other pixels are equal.
    assert_eq!(map(&snee["z"]["maps"][0]), [0, 128, 128, 128, 128, 128]);
    assert_eq!(data["limit"], 1.0, "one of eleven pixels differs by a half");
    assert_eq!(map(&snee["difference"]["maps"][0]), [65, 128, 128, 128, 128, 128]);
    let note = snee["z"]["notes"][0].as_str().expect("a note");
    assert!(
        note.starts_with(
            "0 of 5 pixels are beyond ±4 (0 above, 0 below); by chance it would be at most 4"
        ),
        "{note}"
    );
    assert!(note.contains("Grey: 1 pixels are not judged"), "{note}");
    // (1.95 - 2) / sqrt(0.03^2 + 0.04^2) = -1.
    set(&mut stored, 0, 2.0, 0.03);
    set(&mut stored, 1, 1.95, 0.04);
    let (_, data) = self::data(&stored);
    let z = &data["pictures"][1]["z"];
    assert_eq!(map(&z["maps"][0])[0], 96);
    assert!(!z["notes"][0].to_string().contains("not judged"));
}

#[test]
fn cells_have_a_viewer_and_a_thumbnail_each() {
    let stored = sample::stored(0.5);
    let mut viewers = viewers(&stored, &pictures(&stored)).expect("viewers");
    viewers.push(ViewerBlock { cell: "<rough>".into(), ..viewers[0].clone() });
    let html = cells(&viewers);
    assert_eq!(html.matches("<section class=\"viewer-cell\"").count(), 2);
    assert_eq!(html.matches("class=\"viewer-thumb\"").count(), 2);
    assert!(html.contains("data-cell=\"&lt;rough&gt;\"") && !html.contains("<rough>"), "{html}");
    assert_eq!(parts(&[PageBlock::Cells(viewers)]).1.matches("<script").count(), 2);
}

#[test]
fn pixels_without_errors_have_no_score() {
    let mut stored = sample::stored(0.5);
    set(&mut stored, 0, 2.0, 0.0);
    set(&mut stored, 1, 1.0, 0.0);
    let (_, value) = data(&stored);
    let z = &value["pictures"][1]["z"];
    assert_eq!(map(&z["maps"][0])[0], 0);
    assert!(
        z["notes"][0]
            .as_str()
            .expect("a note")
            .ends_with("Grey: 1 pixels without a standard error on either side.")
    );
    set(&mut stored, 1, 3.0, 0.1);
    let note = data(&stored).1["pictures"][1]["z"]["notes"][0].to_string();
    assert!(note.contains("1 of 6 pixels are beyond ±4"), "{note}");
}

#[test]
fn models_are_not_compared_by_z() {
    let mut stored = sample::stored(0.5);
    stored.record.cells[0].runs[1].model = Some("dipole".into());
    let (_, data) = data(&stored);
    let (mis, snee) = (&data["pictures"][0], &data["pictures"][1]);
    assert_eq!((&mis["z"], &snee["z"]), (&Value::Null, &Value::Null));
    assert!(snee["alone"].as_str().expect("words").contains("same integral"));
    assert!(snee["difference"]["notes"][0].as_str().expect("words").contains("estimates a model"));
    assert_eq!(snee["about"], "256 passes, the model dipole");
}

#[test]
fn objections_to_a_score_are_shown() {
    let mut stored = sample::stored(0.5);
    stored.record.cells[0].runs[1].bias = StatedBias::Biased("a cut".into());
    let note = data(&stored).1["pictures"][1]["z"]["notes"][1].to_string();
    assert!(note.contains("snee is biased: a cut."), "{note}");
}

#[test]
fn bands_beyond_three_are_chosen() {
    assert_eq!((mapped(1).0, mapped(3).0, mapped(31).0), (vec![0], vec![0, 1, 2], vec![0, 15, 30]));
    assert_eq!((mapped(3).1.as_str(), mapped(4).1.contains("of 4 bands")), ("", true));
}

#[test]
fn names_are_escaped() {
    let mut stored = sample::stored(0.5);
    let name = "</script><b>\"&'";
    stored.record.cells[0].label = name.into();
    stored.record.cells[0].runs[0].estimator = name.into();
    stored.record.bands[0].name = name.into();
    let (text, value) = data(&stored);
    assert!(!text.contains('<'));
    let names = [&value["cell"], &value["pictures"][0]["name"], &value["bands"][0]];
    assert!(names.iter().all(|n| *n == name), "{names:?}");
    let viewer = viewers(&stored, &pictures(&stored)).expect("viewers").remove(0);
    let html = to_html(&viewer);
    assert_eq!(html.matches("</script>").count(), 1, "{html}");
    assert!(!html.contains("<b>\"&'"), "{html}");
}

#[test]
fn what_the_page_leaves_out_is_noted() {
    let stored = sample::stored(0.5);
    let size = data(&stored).0.len();
    let within = |room| viewers_within(&stored, &pictures(&stored), room).expect("viewers").remove(0);
    assert!(within(size).data.is_some());
    let left_out = within(size - 1);
    assert_eq!(left_out.data, None);
    let html = to_html(&left_out);
    assert!(html.contains("no room") && html.contains("src=\"images/000-mis.png\""), "{html}");
    let blocks = [PageBlock::Folded("more".into(), vec![PageBlock::Viewer(left_out)])];
    assert_eq!(parts(&blocks).1.matches("<script").count(), 2);
    assert_eq!(parts(&[PageBlock::Text("x".into())]), Default::default());
}

#[test]
fn a_grid_is_two_sheets_without_maps() {
    let sheet = |name, value: f64| Sheet { name, rgb: vec![[value, 2.0 * value, 0.0]; 6] };
    let mut viewer = grid("a | b", [sheet("a", 0.5), sheet("b", 1.0)], 3, 3).expect("a viewer");
    let data: Value = serde_json::from_str(viewer.data.as_ref().expect("data")).expect("JSON");
    assert_eq!((&data["width"], &data["height"], &data["columns"]), (&3.into(), &2.into(), &3.into()));
    // 0.5, 1 and 0 are 3f00, 3f80 and 0000 (IEEE 754).
    let bytes = decoded_plane(&bytes(&data["pictures"][0]["linear"])).1;
    assert_eq!(
        (bytes.0, bytes.1, &bytes.2[..3], &bytes.2[18..21]),
        (3, 4, &[63, 63, 0][..], &[0, 128, 0][..])
    );
    assert_eq!((&data["bands"], &data["pictures"][1]["z"]), (&serde_json::json!([]), &Value::Null));
    assert!(to_html(&viewer).starts_with("<details>"));

    let full = ViewerBlock { data: Some(" ".repeat(ROOM)), ..ViewerBlock::default() };
    keep_room(&[], [&mut viewer].into_iter());
    assert!(viewer.data.is_some());
    keep_room(&[full], [&mut viewer].into_iter());
    assert_eq!(viewer.data, None);
    assert!(to_html(&viewer).contains("no room"));
}
