//! Split pictures and the pixels' variance, as a run leaves them.

use scatterproof::results::image::Picture;
use scatterproof::results::store::RecordFolder;
use scatterproof::stats::moments::Moments;
use scatterproof::stats::tree::total;

use super::work::{IMAGE, Work, replaced, same};

const SPLIT: &str = "[[picture]]\nsplit = { left = \"mis\", right = \"analog\" }\n";

#[test]
fn a_picture_is_a_view_and_no_part_of_the_record() {
    let plain = Work::with(IMAGE);
    plain.run("run x.toml -q").exits(0);
    let work = Work::with(&(IMAGE.to_string() + SPLIT));
    work.run("run x.toml -q").exits(0);
    same(&plain.record("results"), &work.record("results"), "with a picture");
    let files = || work.files("results/x/images");
    let first = files();
    let names: Vec<&str> = first.keys().map(String::as_str).filter(|n| n.contains("split")).collect();
    assert_eq!(names, ["split-1-cell-000.png", "split-1.md", "split-1.png"]);
    assert!(work.read("results/x/report.md").contains("](images/split-1.png)"));
    // It is made again from the folder alone.
    std::fs::remove_dir_all(work.path("results/x/images")).expect("removed");
    work.run("report results/x").exits(0);
    assert!(files() == first, "another picture");
    // It is removed when no file asks for it; nothing is run again.
    work.write("x.toml", IMAGE);
    work.run("run x.toml -q").exits(0);
    assert!(!work.path("results/x/pictures.json").exists());
    assert!(!work.read("results/x/report.md").contains("split-1"));
}

/// The image under two skies: paths under parallel light have a tail that no test of a hundred means
/// bears.
fn lit_evenly() -> String {
    let sun = "directional = { toward = [1, 0, 1], irradiance = 1.0 }";
    replaced(IMAGE, sun, "environment = { radiance = 0.5, hemisphere = [1, 0, 1] }")
}

#[test]
fn verification_that_runs_nothing_makes_the_pictures_asked_for_since() {
    let claim = "[[claim]]\nagree = { estimators = [\"mis\", \"analog\"], detect = 9 }\n";
    let image = lit_evenly();
    let work = Work::with(&(image.clone() + claim));
    work.run("verify x.toml -q").exits(0);
    assert!(!work.path("results/x/images/split-1.png").exists());
    work.write("x.toml", &(image + claim + SPLIT));
    work.run("verify x.toml -q").exits(0);
    assert!(work.path("results/x/images/split-1.png").exists());
}

/// The variance of a pixel as pairs of passes show it, and as all passes do: of one expectation. The
/// first has the larger error of the two, known from its values.
#[test]
fn pairs_show_the_variance_that_all_passes_show() {
    // 301 passes: 75 batches of 2 pairs, and a last pass without a partner.
    let work = Work::with(&replaced(&lit_evenly(), "passes = 100", "passes = 301"));
    work.run("run x.toml -q").exits(0);
    let stored = RecordFolder::new(work.path("results/x")).read().expect("a record");
    for run in &stored.record.cells[0].runs {
        let picture = Picture::of(&stored, run).expect("an image");
        for band in 0..3 {
            let batches = stored.spread(run, band).expect("a spread");
            assert_eq!((batches.len(), batches[0].n, batches[74].n), (75, 2, 2));
            let pairs: Moments = total(batches).expect("pairs");
            assert_eq!(pairs.n, 150);
            let squares: f64 = picture.std_error(band).map(|e| e * e * 301.0).sum();
            let whole = squares / (picture.width * picture.height) as f64;
            let z = (pairs.mean - whole) / pairs.std_error();
            assert!(z.abs() < 5.0, "{} band {band}: {} and {whole}, z = {z}", run.estimator, pairs.mean);
            assert!(pairs.std_error() < 0.2 * whole, "it knows nothing");
        }
    }
}

#[test]
fn claims_are_about_pixels_where_there_are_some() {
    let claim = |words: &str| {
        format!(
            "[[claim]]\nfaster = {{ candidate = \"mis\", baseline = \"analog\", observable = \"pixels\"{words} }}\n"
        )
    };
    let text = replaced(IMAGE, "passes = 100", "passes = 1000");
    let work = Work::with(&(text.clone() + &claim(", ratio = 0.2")));
    work.run("verify x.toml -q --verbose").says("efficiency by counters").says("pixels");
    let csv = work.read("results/x/comparisons.csv");
    let rows = csv.lines().filter(|line| line.contains(",all,pixels,")).count();
    assert_eq!(rows, 3 * 2, "bands, measures: {csv}");
    work.write("x.toml", &(text + &claim(", class = \"single\"")));
    work.run("run x.toml -q --replace").exits(2).complains("images are not kept by class");
    work.write("x.toml", &(super::work::probe() + &claim("")));
    work.run("run x.toml -q --replace").exits(2).complains("the sensor has no `pixels`");
}
