//! What is published: every table, plot and picture is what its record gives, and every page quotes it as it is.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use scatterproof::report;
use scatterproof::results::store::RecordFolder;

/// Folders of published records, by setting.
const SETTINGS: [&str; 2] = ["short", "full"];
/// What a published folder holds that is no view.
const SOURCES: [&str; 4] = ["record", "timing.json", "provenance.json", "pictures.json"];
/// What is kept of the views.
const VIEWS: [&str; 3] = ["tables", "plots", "images"];

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

/// What is not as the record in `folder` gives it.
fn stale(folder: &Path) -> Vec<String> {
    let temp = tempfile::tempdir().expect("a folder");
    let copy = temp.path().join(folder.file_name().expect("a name"));
    let all = files(folder);
    let is_source =
        |name: &str| SOURCES.iter().any(|s| name == *s || name.starts_with(&format!("{s}/")));
    for (name, bytes) in all.iter().filter(|(name, _)| is_source(name)) {
        let path = copy.join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        fs::write(path, bytes).expect("a file");
    }
    report::write(&RecordFolder::new(&copy)).unwrap_or_else(|e| panic!("{}: {e}", folder.display()));
    let made = files(&copy);
    let is_view = |name: &&String| VIEWS.iter().any(|view| name.starts_with(&format!("{view}/")));
    let mut stale = Vec::new();
    for (name, bytes) in all.iter().filter(|(name, _)| !is_source(name)) {
        match made.get(name) {
            Some(own) if own == bytes => (),
            Some(_) => stale.push(format!("{}/{name}: not what the record gives", folder.display())),
            None => stale.push(format!("{}/{name}: the record gives no such file", folder.display())),
        }
    }
    // Pictures for people are kept, their data are not, nor what is shown whole elsewhere.
    let is_left_out = |name: &str| {
        let is_caption = name.starts_with("images/") && name.ends_with(".md");
        let is_part = name.starts_with("tables/measurements-") || name.contains("-cell-");
        name.ends_with(".exr") || is_caption || is_part
    };
    let kept = |name: &&String| is_view(name) && !is_left_out(name);
    let missing = made.keys().filter(kept).filter(|name| !all.contains_key(*name));
    stale.extend(missing.map(|name| format!("{}/{name}: missing", folder.display())));
    stale
}

const HELP: &str =
    "scripts/reproduce --views makes views again; --publish NAME plays the experiment again";

#[test]
fn every_view_is_what_its_record_gives() {
    let folders = published();
    assert!(folders.len() >= 10, "{folders:?}");
    let stale: Vec<String> = std::thread::scope(|scope| {
        let halves = folders.chunks(folders.len().div_ceil(2));
        let workers: Vec<_> = halves
            .map(|half| {
                scope.spawn(move || half.iter().flat_map(|folder| stale(folder)).collect::<Vec<_>>())
            })
            .collect();
        workers.into_iter().flat_map(|worker| worker.join().expect("a worker")).collect()
    });
    assert!(stale.is_empty(), "{}\n{HELP}", stale.join("\n"));
}

/// A published number that somebody improves by hand is found.
#[test]
fn a_changed_table_is_found() {
    let folders = published();
    let folder = folders.iter().find(|f| f.join("tables/efficiency.md").exists()).expect("efficiencies");
    let temp = tempfile::tempdir().expect("a folder");
    let copy = temp.path().join(folder.file_name().expect("a name"));
    for (name, bytes) in files(folder) {
        let path = copy.join(&name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a folder");
        let bytes = match name.as_str() {
            "tables/efficiency.md" => {
                String::from_utf8_lossy(&bytes).replacen("[1", "[2", 1).into_bytes()
            }
            _ => bytes,
        };
        fs::write(path, bytes).expect("a file");
    }
    fs::remove_file(copy.join("tables/efficiency.csv")).expect("removed");
    fs::write(copy.join("tables/other.md"), "| x |").expect("written");
    let found = stale(&copy).join("\n");
    for words in ["efficiency.md: not what", "efficiency.csv: missing", "other.md: the record gives no"]
    {
        assert!(found.contains(words), "{words}: {found}");
    }
    assert_eq!(found.lines().count(), 3, "{found}");
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

/// What a quote says that its file does not, in words.
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
    for planted in
        [text.replacen(last, &last.replacen('1', "2", 1), 1), text.replacen(&format!("{last}\n"), "", 1)]
    {
        assert!(misquoted(&quotes(&planted)[0]).is_some(), "{planted}");
    }
}

/// Pictures in docs/figures/NAME/ are those of the published record of that name.
#[test]
fn pictures_of_pages_are_published() {
    let copies = files(&package().join("docs/figures"));
    assert!(copies.len() >= 3, "{:?}", copies.keys());
    for (name, bytes) in copies {
        let (experiment, file) = name.split_once('/').expect("docs/figures/NAME/FILE");
        let published = package().join("results/published/short").join(experiment);
        let mut sources = ["images", "plots"].map(|part| published.join(part).join(file)).into_iter();
        let source = sources
            .find(|path| path.exists())
            .unwrap_or_else(|| panic!("docs/figures/{name} is not published"));
        assert!(
            fs::read(&source).expect("a picture") == bytes,
            "docs/figures/{name} is not {}",
            source.display()
        );
    }
}

/// What is kept in git stays small.
#[test]
fn what_is_published_is_small() {
    let size: usize = files(&package().join("results/published")).values().map(Vec::len).sum();
    assert!(size < 40 << 20, "{} MiB", size >> 20);
}

/// What docs/bssrdf.md says of the rules of acceptance, from the published ratios.
#[test]
fn the_advice_on_rules_is_what_the_ratios_say() {
    let path = package().join("results/published/short/acceptance/tables/efficiency.csv");
    let text = fs::read_to_string(path).expect("efficiencies");
    let rows: Vec<Vec<String>> = scatterproof::results::csv_text::rows(&text);
    let (header, rows) = rows.split_first().expect("a header");
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
    let largest = |rule: &str| *behind(rule).last().expect("ratios");
    let kernel = behind("kernel");
    assert_eq!(kernel.len(), rows.len(), "kernel has a ratio in every row");
    let sentence = format!(
        "nowhere more than {:.1} times behind the best rule of its band (median {:.1}), while the published `mean` has \
         none in red of skin1 and ketchup but on small bodies, and floors fall behind the best by up to \
         {:.1} times (0.001) and {:.1} times (0.01)",
        largest("kernel"),
        kernel[kernel.len() / 2],
        largest("floor 0.001"),
        largest("floor 0.01"),
    );
    let page = fs::read_to_string(package().join("docs/bssrdf.md")).expect("a page");
    let page: String = page.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(page.contains(&sentence), "docs/bssrdf.md should say: {sentence}");
    let none = rows.iter().filter(|row| ratio(row, column("mean")).is_none());
    assert!(
        none.clone().count() > 0 && none.clone().all(|row| row.contains(&"R".to_string())),
        "{:?}",
        none.collect::<Vec<_>>()
    );
}
