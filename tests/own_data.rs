//! Meshes, spectra and skies from files, and sweeps over options and budgets: what is measured, and what is
//! refused.

use std::fs;

use scatterproof::results::store::RecordFolder;

use super::work::{IMAGE, SENSOR, Work, edit, replaced};

const FLUX: &str = "sensor.flux = { bins = 1, axis = [0, 0, 1], paths_per_pass = 64 }";
const SPECTRAL: &str = "bands = { spectral = { from_nm = 400, to_nm = 700, count = 3 } }";

/// The usual experiment in three bands of wavelengths, one number each.
fn spectral() -> String {
    let text = replaced(IMAGE, "bands = { rgb = {} }", SPECTRAL);
    let grey = "sigma_t_per_mm = 2, albedo = 0.8, g = 0.2";
    replaced(&text, "sigma_t_per_mm = [1, 2, 4], albedo = [0.9, 0.8, 0.7], g = 0.2", grey)
}

fn column(keys: &str) -> String {
    let words = "path = \"t.csv\", wavelength = \"nm\", unit = \"nm\", column = \"a\", interpolation = \"linear\"";
    let given = keys.split(" = ").next().unwrap_or_default();
    let kept = words.split(", ").filter(|word| keys.is_empty() || !word.starts_with(given));
    let kept: Vec<&str> = kept.chain((!keys.is_empty()).then_some(keys)).collect();
    format!("{{ csv = {{ {} }} }}", kept.join(", "))
}

const TABLE: &str = "nm,a,b\n400,0.2,1\n600,0.6,1\n700,0.6,1\n";

#[track_caller]
fn wrong(text: &str, table: &str, words: &[&str]) {
    let work = Work::with(text);
    work.write("t.csv", table);
    let ran = work.run("check x.toml");
    ran.exits(2).complains_of(words).complains("help: ").complains("-->");
    ran.check(ran.stderr().matches("error: ").count() == 1, "one finding");
}

/// A spectrum from a table is the same experiment as its means by hand, to the last bit.
#[test]
fn a_table_is_its_means() {
    let from_table = replaced(&spectral(), "albedo = 0.8", &format!("albedo = {}", column("")));
    let by_hand = replaced(&spectral(), "albedo = 0.8", "albedo = [0.3, 0.5, 0.6]");
    let numbers = |text: &str| {
        let work = Work::with(&replaced(text, "passes = 100", "passes = 4"));
        work.write("t.csv", TABLE);
        work.run("run x.toml -q").exits(0);
        let stored = RecordFolder::new(work.path("results/x")).read().expect("a record");
        let albedo = stored.record.resolved["object"]["medium"]["coefficients"]["albedo"].clone();
        (albedo, stored.record.checksums)
    };
    let (albedo, _) = numbers(&from_table);
    let list: Vec<f64> = serde_json::from_value(albedo).expect("numbers");
    assert!(list.iter().zip([0.3, 0.5, 0.6]).all(|(a, b)| (a - b).abs() < 1e-15), "{list:?}");
    let exact = format!("albedo = [{:?}, {:?}, {:?}]", list[0], list[1], list[2]);
    assert_eq!(
        numbers(&from_table).1,
        numbers(&replaced(&by_hand, "albedo = [0.3, 0.5, 0.6]", &exact)).1
    );
}

#[test]
fn tables_that_do_not_fit_are_refused() {
    let with = |keys: &str| replaced(&spectral(), "albedo = 0.8", &format!("albedo = {}", column(keys)));
    wrong(&with("column = \"c\""), TABLE, &["the CSV file has no column `c`", "known columns"]);
    wrong(&with("path = \"no.csv\""), TABLE, &["could not read `no.csv`", "relative to the folder"]);
    wrong(&with("unit = \"mm\""), TABLE, &["unknown kind `mm`"]);
    wrong(&with(""), &TABLE.replace("700,", "690,"), &["covers 400 to 690 nm, and band `600-700nm`"]);
    wrong(
        &with(""),
        &TABLE.replace("700,", "500,"),
        &["wavelengths must increase, 500 nm follows 600 nm", "t.csv:4"],
    );
    wrong(&with(""), &TABLE.replace("0.2", "x"), &["`x` in column `a` is not a number", "t.csv:2"]);
    let rgb = edit("albedo = [0.9, 0.8, 0.7]", &format!("albedo = {}", column("")));
    wrong(&rgb, TABLE, &["a spectrum needs wavelengths, and band `R` has none", "bands.spectral"]);
    wrong(&with("extra = 1"), TABLE, &["unknown key `extra`"]);
}

/// A sky that is red in the east and blue in the west: turned by half a turn, the light on the east side
/// of the body is blue; upsampled, it is the long wavelengths that shine from where red did.
#[test]
fn skies_turn_and_get_wavelengths() {
    let sky = |work: &Work| {
        let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
        // The middle columns are the east, +x: columns 1 and 2.
        for _ in 0..2 {
            for pixel in [[0, 0, 128, 129], [128, 0, 0, 129], [128, 0, 0, 129], [0, 0, 128, 129u8]] {
                bytes.extend(pixel);
            }
        }
        fs::write(work.path("sky.hdr"), bytes).expect("a sky");
    };
    let east = "sensor.probe = { point_mm = [3, 0, 0.2], toward = [-1, 0, 0], paths_per_pass = 512 }";
    let one = |text: &str| {
        let light =
            "name = \"sun\"\ndirectional = { toward = [1, 0, 1], irradiance = 1.0 }\n[[light]]\n";
        // So dense that no light from behind comes through.
        let dense = text.replace("sigma_t_per_mm = 2", "sigma_t_per_mm = 40");
        let dense = dense.replace("[1, 2, 4], albedo = [0.9, 0.8, 0.7]", "40, albedo = 0.8");
        replaced(&replaced(&dense, light, ""), SENSOR, east)
    };
    let measured = |text: &str, words: &str| -> Vec<f64> {
        let map = format!("map = \"sky.hdr\"{words}");
        let work = Work::with(&replaced(&one(text), "radiance = 0.2", &map));
        sky(&work);
        work.run("run x.toml -q").exits(0);
        let table = work.read("results/x/measurements.csv");
        let mut rows = table.lines();
        let head: Vec<&str> = rows.next().expect("a head").split(',').collect();
        let at = |name: &str| head.iter().position(|column| *column == name).expect("a column");
        let (mean, class, estimator) = (at("mean"), at("class"), at("estimator"));
        let all = rows.map(|row| row.split(',').collect::<Vec<_>>());
        let all = all.filter(|row| row[class] == "all" && row[estimator] == "mis");
        all.map(|row| row[mean].parse().expect("a number")).collect()
    };
    let rgb = |words: &str| measured(IMAGE, words);
    let (as_it_is, turned) = (rgb(""), rgb(", rotate_deg = 180"));
    assert!(as_it_is[0] > 3.0 * as_it_is[2] && as_it_is[1] == 0.0, "{as_it_is:?}");
    assert!(turned[2] > 3.0 * turned[0] && turned[1] == 0.0, "{turned:?}");
    let bands = measured(&spectral(), ", upsampling = \"smooth\"");
    assert!(bands[2] > 3.0 * bands[0], "600 to 700 nm over 400 to 500 nm: {bands:?}");
    wrong(
        &replaced(&one(&spectral()), "radiance = 0.2", "map = \"t.csv\""),
        TABLE,
        &["`t.csv`: not a usable OpenEXR image"],
    );
    let work = Work::with(&replaced(&one(&spectral()), "radiance = 0.2", "map = \"sky.hdr\""));
    sky(&work);
    work.run("check x.toml").exits(2).complains_of(&[
        "no channel for band",
        "upsampling = \"smooth\"",
        "-->",
    ]);
}

#[test]
fn presets_in_bands_of_wavelengths() {
    let preset = |bands: &str, more: &str| {
        let text = replaced(IMAGE, "bands = { rgb = {} }", bands);
        replaced(
            &text,
            "coefficients = { sigma_t_per_mm = [1, 2, 4], albedo = [0.9, 0.8, 0.7], g = 0.2 }",
            &format!("preset = {{ name = \"skin1\", scale = 1.0{more} }}"),
        )
    };
    wrong(&preset(SPECTRAL, ""), "", &["measured in rgb bands only", "upsampling = \"smooth\""]);
    wrong(
        &preset("bands = { rgb = {} }", ", upsampling = \"smooth\""),
        "",
        &["`upsampling` is for bands of wavelengths"],
    );
    Work::with(&preset(SPECTRAL, ", upsampling = \"smooth\"")).run("check x.toml").exits(0);
}

/// Cells that differ in an option or a budget alone: other options, other passes, other streams.
#[test]
fn options_and_budgets_are_swept() {
    let sweeps = "[[sweep]]\nkey = \"estimator.mis.path.roulette.below\"\nvalues = [0.1, 0.9]\n\
                  [[sweep]]\nname = \"budget\"\nkey = \"budget.passes\"\nvalues = [4, 8]\n";
    let text = edit(SENSOR, FLUX).replace("path = {}", "path = { roulette = { below = 0.25 } }");
    let work = Work::with(&(text.clone() + sweeps));
    work.run("run x.toml -q").exits(0);
    let stored = RecordFolder::new(work.path("results/x")).read().expect("a record");
    let cells = &stored.record.cells;
    let labels: Vec<&str> = cells.iter().map(|cell| cell.label.as_str()).collect();
    assert_eq!(labels, ["0.1, 4", "0.1, 8", "0.9, 4", "0.9, 8"]);
    let passes: Vec<u64> = cells.iter().map(|cell| cell.runs[0].passes).collect();
    assert_eq!(passes, [4, 8, 4, 8]);
    let mut hashes: Vec<&str> = cells.iter().map(|cell| cell.content_hash.as_str()).collect();
    hashes.dedup();
    assert_eq!(hashes.len(), 4, "streams of their own");
    // What the option does: walks that are ended early cost less.
    let cost = |cell: usize| cells[cell].runs[0].cost.values().sum::<u64>() as f64;
    assert!(cost(1) > 1.1 * cost(3), "{} {}", cost(1), cost(3));

    let refused = |sweep: &str, words: &[&str]| wrong(&(text.clone() + sweep), "", words);
    refused(
        "[[sweep]]\nkey = \"estimator.mis.snee\"\nvalues = [{}, { preset = \"guided\" }]\n",
        &["cannot be swept: a sweep changes options", "estimator.mis.path.OPTION"],
    );
    refused(
        "[[sweep]]\nkey = \"estimator.mis.name\"\nvalues = [\"a\", \"b\"]\n",
        &["cannot be swept: a sweep changes options"],
    );
    refused(
        "[[sweep]]\nkey = \"estimator.miss.path.roulette.below\"\nvalues = [0.1, 0.9]\n",
        &["no `[[estimator]]` is named `miss`", "did you mean `estimator.mis`?"],
    );
    let beyond = "[[sweep]]\nkey = \"estimator.mis.path.roulette.below\"\nvalues = [0.1, 9]\n";
    let ran = Work::with(&(text.clone() + beyond)).run("check x.toml");
    ran.exits(2).complains_of(&["must be at most 1, is 9", "x.toml:23:16"]);
}
