//! What is published: tables are those of their manifests, manifests are those of their records, and
//! every page quotes a table as it is.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use scatterproof::results::json::hash_hex;
use scatterproof::results::manifest::{MANIFEST, Manifest};

/// Folders of published results, by setting.
const SETTINGS: [&str; 2] = ["short", "full"];
/// Files of a published folder beside its record and its tables.
const BESIDE: [&str; 4] = [MANIFEST, "provenance.json", "timing.json", "pictures.json"];

const HELP: &str =
    "scripts/reproduce --views makes views again; --publish NAME runs the experiment again";

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Files below a folder, by path relative to it.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    fn add(folder: &Path, name: &str, found: &mut BTreeMap<String, Vec<u8>>) {
        let Ok(entries) = fs::read_dir(folder) else { return };
        for entry in entries {
            let path = entry.expect("an entry").path();
            let own = path.file_name().expect("a name").to_string_lossy().into_owned();
            let name = if name.is_empty() { own } else { format!("{name}/{own}") };
            if path.is_dir() {
                add(&path, &name, found);
            } else {
                found.insert(name, fs::read(&path).expect("a file"));
            }
        }
    }
    let mut found = BTreeMap::new();
    add(folder, "", &mut found);
    found
}

fn published() -> Vec<PathBuf> {
    let folders = SETTINGS.iter().flat_map(|setting| {
        let folder = package().join("results/published").join(setting);
        fs::read_dir(folder).into_iter().flatten().map(|entry| entry.expect("an entry").path())
    });
    let mut folders: Vec<PathBuf> = folders.filter(|path| path.is_dir()).collect();
    folders.sort();
    folders
}

fn manifest(bytes: &[u8]) -> Manifest {
    serde_json::from_slice(bytes).expect("a manifest")
}

/// Files of a published folder that differ from its manifest.
fn changed(files: &BTreeMap<String, Vec<u8>>) -> Vec<String> {
    let views = manifest(&files[MANIFEST]).views;
    let is_kept =
        |name: &&String| name.starts_with("tables/") && !name.starts_with("tables/measurements-");
    let kept: Vec<&String> = views.keys().filter(is_kept).collect();
    let mut found = Vec::new();
    for (name, bytes) in files {
        let is_beside = BESIDE.contains(&name.as_str()) || name.starts_with("record/");
        match views.get(name) {
            Some(hash) if *hash == hash_hex(bytes) => (),
            Some(_) => found.push(format!("{name}: not what was made from the record")),
            None if is_beside => (),
            None => found.push(format!("{name}: the manifest names no such file")),
        }
    }
    let missing = kept.into_iter().filter(|name| !files.contains_key(*name));
    found.extend(missing.map(|name| format!("{name}: missing")));
    found
}

/// Differences between the record in a published folder and its manifest.
fn stale(folder: &Path) -> Vec<String> {
    let temp = tempfile::tempdir().expect("a folder");
    let copy = temp.path().join(folder.file_name().expect("a name"));
    let all = files(folder);
    for (name, bytes) in &all {
        if name.starts_with("record/") || (BESIDE.contains(&name.as_str()) && name != MANIFEST) {
            let path = copy.join(name);
            fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
            fs::write(path, bytes).expect("a file");
        }
    }
    let report = Command::new(env!("CARGO_BIN_EXE_scatterproof")).arg("report").arg(&copy).output();
    let report = report.expect("the program starts");
    assert!(
        report.status.success(),
        "{}: {}",
        folder.display(),
        String::from_utf8_lossy(&report.stderr)
    );
    let (told, made) = (manifest(&all[MANIFEST]), manifest(&files(&copy)[MANIFEST]));
    let names =
        told.views.keys().chain(made.views.keys().filter(|name| !told.views.contains_key(*name)));
    let differing = names.filter(|name| told.views.get(*name) != made.views.get(*name));
    let mut found: Vec<String> =
        differing.map(|name| format!("{name}: not what the record gives")).collect();
    if (told.runs, told.experiment_hash) != (made.runs, made.experiment_hash) {
        found.push(format!("{MANIFEST}: not that of the record"));
    }
    found
}

/// A folder as bytes, with some files replaced, put back on a disk.
fn with(folder: &Path, replaced: &[(&str, Vec<u8>)]) -> tempfile::TempDir {
    let temp = tempfile::tempdir().expect("a folder");
    let mut all = files(folder);
    all.extend(replaced.iter().map(|(name, bytes)| (name.to_string(), bytes.clone())));
    for (name, bytes) in all {
        let path = temp.path().join(&name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, bytes).expect("a file");
    }
    temp
}

#[test]
fn every_table_is_the_one_that_was_made() {
    let folders = published();
    assert!(folders.len() >= 10, "{folders:?}");
    let found: Vec<String> = folders
        .iter()
        .flat_map(|folder| {
            changed(&files(folder)).into_iter().map(move |what| format!("{}/{what}", folder.display()))
        })
        .collect();
    assert!(found.is_empty(), "{}\n{HELP}", found.join("\n"));
}

#[test]
fn every_published_record_gives_its_tables_and_plots() {
    let folders = published().into_iter().filter(|folder| folder.join("record").exists());
    let found: Vec<Vec<String>> = folders
        .map(|folder| stale(&folder).iter().map(|what| format!("{}/{what}", folder.display())).collect())
        .collect();
    assert!(found.len() >= 3, "{} records", found.len());
    let found = found.concat();
    assert!(found.is_empty(), "{}\n{HELP}", found.join("\n"));
}

/// A published number that is improved by hand is found: in the table, and in table and manifest where
/// the record is published, too.
#[test]
fn a_changed_table_is_found() {
    let table = "tables/efficiency.md";
    let folder = package().join("results/published/short/snee-sharp");
    let text = fs::read_to_string(folder.join(table)).expect("efficiencies");
    let improved = text.replacen("[1", "[2", 1).into_bytes();
    assert_ne!(text.as_bytes(), improved);
    let mut planted = files(&folder);
    planted.insert(table.into(), improved.clone());
    planted.insert("tables/other.md".into(), b"| x |".to_vec());
    planted.remove("tables/means.md").expect("means");
    let found = changed(&planted).join("\n");
    for words in ["efficiency.md: not what", "means.md: missing", "other.md: the manifest names no"] {
        assert!(found.contains(words), "{words}: {found}");
    }
    assert_eq!(found.lines().count(), 3, "{found}");

    let told = fs::read_to_string(folder.join(MANIFEST)).expect("a manifest");
    let told = told.replace(&hash_hex(text.as_bytes()), &hash_hex(&improved)).into_bytes();
    let copy = with(&folder, &[(table, improved), (MANIFEST, told)]);
    assert_eq!(changed(&files(copy.path())), [""; 0], "the manifest was changed with it");
    assert_eq!(stale(copy.path()), [format!("{table}: not what the record gives")]);
}

/// A table that a page quotes: its file, the words that its rows hold, its lines.
struct Quote<'a> {
    line: usize,
    path: &'a str,
    words: Vec<&'a str>,
    rows: Vec<&'a str>,
}

fn quotes(page: &str) -> Vec<Quote<'_>> {
    let mut quotes: Vec<Quote> = Vec::new();
    let mut is_open = false;
    for (text, line) in page.lines().zip(1..) {
        if let Some(head) =
            text.strip_prefix("<!-- results/published/").and_then(|t| t.strip_suffix(" -->"))
        {
            let (path, words) = head.split_once(" rows: ").unwrap_or((head, ""));
            let words = words.split(';').map(str::trim).filter(|word| !word.is_empty()).collect();
            quotes.push(Quote { line, path, words, rows: Vec::new() });
            is_open = true;
        } else if is_open && text.starts_with('|') {
            quotes.last_mut().expect("an open quote").rows.push(text);
        } else {
            is_open = false;
        }
    }
    quotes
}

/// Differences between a quote and its file, as text.
fn misquoted(quote: &Quote) -> Option<String> {
    let path = package().join("results/published").join(quote.path);
    let Ok(text) = fs::read_to_string(&path) else { return Some(format!("no file {}", quote.path)) };
    let is_wanted = |line: &&str| {
        let holds = |word: &&str| line.split('|').any(|field| field.trim() == *word);
        quote.words.is_empty() || quote.words.iter().any(holds)
    };
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with('|')).collect();
    let (head, rows) = lines.split_at(lines.len().min(2));
    let expected: Vec<&str> =
        head.iter().chain(rows.iter().filter(|line| is_wanted(line))).copied().collect();
    (expected.len() < 3 || expected != quote.rows).then(|| format!("not as {} has it", quote.path))
}

fn pages() -> Vec<PathBuf> {
    let docs =
        fs::read_dir(package().join("docs")).expect("docs").map(|entry| entry.expect("an entry").path());
    let mut pages: Vec<PathBuf> =
        docs.filter(|path| path.extension().is_some_and(|e| e == "md")).collect();
    pages.push(package().join("README.md"));
    pages
}

#[test]
fn pages_quote_tables_as_they_are() {
    let (mut count, mut wrong) = (0, Vec::new());
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page");
        for quote in quotes(&text) {
            count += 1;
            wrong.extend(
                misquoted(&quote).map(|what| format!("{}:{}: {what}", page.display(), quote.line)),
            );
        }
    }
    assert!(wrong.is_empty(), "{}\nscripts/quote.py brings them up to date", wrong.join("\n"));
    assert!(count >= 5, "{count} quotes");

    // A number that was changed, and a row that was left out.
    let text = fs::read_to_string(package().join("docs/subdivision.md")).expect("a page");
    let quote = &quotes(&text)[0];
    let last = quote.rows.last().expect("rows");
    let digit = last.find(|c: char| c.is_ascii_digit()).expect("a number");
    let other = if last[digit..].starts_with('1') { "2" } else { "1" };
    let changed = format!("{}{other}{}", &last[..digit], &last[digit + 1..]);
    for planted in [text.replacen(last, &changed, 1), text.replacen(&format!("{last}\n"), "", 1)] {
        assert!(misquoted(&quotes(&planted)[0]).is_some(), "{planted}");
    }
}

/// Pictures in docs/figures/NAME/ are those that were made when the experiment of that name was
/// published, with its full budget where that was published.
#[test]
fn pictures_of_pages_are_published() {
    let copies = files(&package().join("docs/figures"));
    assert!(copies.len() >= 3, "{:?}", copies.keys());
    let is_published = |name: &str, bytes: &[u8]| {
        let (experiment, file) = name.split_once('/').expect("docs/figures/NAME/FILE");
        let of = |setting| package().join("results/published").join(setting).join(experiment);
        let setting = if of("full").exists() { "full" } else { "short" };
        let path = of(setting).join(MANIFEST);
        let views =
            manifest(&fs::read(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))).views;
        ["images", "plots"]
            .iter()
            .any(|part| views.get(&format!("{part}/{file}")) == Some(&hash_hex(bytes)))
    };
    for (name, bytes) in &copies {
        assert!(
            is_published(name, bytes),
            "docs/figures/{name} is not what was published; scripts/publish copies it"
        );
        assert!(!is_published(name, b"another picture"), "{name}");
    }
}

/// The published files stay small.
#[test]
fn what_is_published_is_small() {
    let files = files(&package().join("results/published"));
    let size: usize = files.values().map(Vec::len).sum();
    assert!(size < 4 << 20 && files.len() < 300, "{} KiB in {} files", size >> 10, files.len());
}

/// The numbers of docs/bssrdf.md on the rules of acceptance are those of the published ratios: `kernel`
/// at most so many times behind the best rule of a band and its median, then the two floors at most.
#[test]
fn the_advice_on_rules_is_what_the_ratios_say() {
    let path = package().join("results/published/short/acceptance/tables/efficiency.md");
    let text = fs::read_to_string(path).expect("efficiencies");
    let fields = |line: &str| -> Vec<String> {
        line.trim_matches('|').split('|').map(|field| field.trim().to_string()).collect()
    };
    let mut lines = text.lines().filter(|line| line.starts_with('|'));
    let header = fields(lines.next().expect("a header"));
    let rows: Vec<Vec<String>> = lines.skip(1).map(fields).collect();
    let column = |rule: &str| header.iter().position(|h| *h == format!("{rule} / all")).expect(rule);
    let ratio = |row: &Vec<String>, column: usize| {
        row[column].split([' ', '*']).next().and_then(|number| number.parse::<f64>().ok())
    };
    let first = header.iter().position(|h| h.ends_with(" / all")).expect("a rule");
    // How far a rule is behind the best of its row.
    let behind = |rule: &str| -> Vec<f64> {
        let behind = rows.iter().filter_map(|row| {
            let best = (first..header.len()).filter_map(|c| ratio(row, c)).fold(0.0, f64::max);
            Some(best / ratio(row, column(rule))?)
        });
        let mut behind: Vec<f64> = behind.collect();
        behind.sort_by(f64::total_cmp);
        behind
    };
    let largest = |rule: &str| format!("{:.1} times", behind(rule).last().expect("ratios"));
    let kernel = behind("kernel");
    assert_eq!(kernel.len(), rows.len(), "kernel has a ratio in every row");
    let median = format!("median {:.1}", kernel[kernel.len() / 2]);
    let numbers = [largest("kernel"), median, largest("floor 0.001"), largest("floor 0.01")];

    // The numbers occur in this order in one paragraph.
    let page = fs::read_to_string(package().join("docs/bssrdf.md")).expect("a page");
    let says = |paragraph: &str| {
        let mut rest = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
        numbers.iter().all(|number| match rest.split_once(number.as_str()) {
            Some((_, after)) => {
                rest = after.to_string();
                true
            }
            None => false,
        })
    };
    assert!(page.split("\n\n").any(says), "no paragraph of docs/bssrdf.md has {numbers:?}");
    assert!(
        !page.replace(&numbers[0], "9.9 times").split("\n\n").any(says),
        "a changed number is found"
    );

    let none = rows.iter().filter(|row| ratio(row, column("mean")).is_none());
    assert!(
        none.clone().count() > 0 && none.clone().all(|row| row.contains(&"R".to_string())),
        "{:?}",
        none.collect::<Vec<_>>()
    );
}
