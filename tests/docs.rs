//! The documentation: examples are accepted, statements hold, links and commands are valid.

use std::fs;
use std::path::Path;

use scatterproof::results::exr_file::write_exr;
use scatterproof::results::image::Picture;
use scatterproof::results::layout::{BIN_ROWS, GUIDE, LAYOUT, MOMENTS, STATISTICS};
use scatterproof::results::npy::Array;
use scatterproof::results::record::Band;
use toml::Table;

use super::work::Work;

/// Every page, from the package's folder.
const PAGES: &[&str] = &[
    "README.md",
    "CONTRIBUTING.md",
    "CHANGELOG.md",
    "docs/bring-your-own.md",
    "docs/bssrdf.md",
    "docs/comparing-records.md",
    "docs/SUMMARY.md",
    "docs/experiment-file.md",
    "docs/first-report.md",
    "docs/gallery.md",
    "docs/index.md",
    "docs/results.md",
    "docs/judging-other-renderers.md",
    "docs/limits.md",
    "docs/live-view.md",
    "docs/own-estimator.md",
    "docs/python.md",
    "docs/record-layout.md",
    "docs/reliability.md",
    "docs/speed.md",
    "docs/subdivision.md",
    "docs/verification.md",
    "docs/walks.md",
    "examples/ci-gate/README.md",
    "examples/own-estimator/README.md",
    "results/README.md",
    "scripts/README.md",
];

fn package() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: &str) -> String {
    fs::read_to_string(package().join(path)).unwrap_or_else(|e| panic!("{path}: {e}"))
}

/// A fenced block of a page.
#[derive(Debug)]
struct Block<'a> {
    /// The info string behind the opening fence.
    tag: &'a str,
    /// The lines between the fences, numbered as in the page.
    lines: Vec<(usize, &'a str)>,
}

impl Block<'_> {
    fn text(&self) -> String {
        self.lines.iter().map(|(_, line)| format!("{line}\n")).collect()
    }

    fn is(&self, language: &str) -> bool {
        self.tag.split(' ').next() == Some(language)
    }
}

/// The blocks of a page, and the page with empty lines in their place.
fn split(page: &str) -> (Vec<Block<'_>>, String) {
    let (mut blocks, mut prose, mut open) = (Vec::new(), String::new(), None);
    for (line, number) in page.lines().zip(1..) {
        match (line.strip_prefix("```"), &mut open) {
            (Some(tag), None) => open = Some(Block { tag, lines: Vec::new() }),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some(block)) => block.lines.push((number, line)),
            (None, None) => prose += line,
        }
        prose.push('\n');
    }
    assert!(open.is_none(), "a fence is not closed: {open:?}");
    (blocks, prose)
}

/// The blocks of a language.
fn blocks<'a>(page: &'a str, language: &str) -> Vec<Block<'a>> {
    split(page).0.into_iter().filter(|block| block.is(language)).collect()
}

/// The only block of a language.
fn only_block(page: &str, language: &str) -> String {
    let found = blocks(page, language);
    assert_eq!(found.len(), 1, "one block of {language}");
    found[0].text()
}

/// A snippet in its place in the complete file: `object` part by part, every other key as a whole.
fn merged(base: &Table, snippet: Table) -> Table {
    let mut merged = base.clone();
    for (key, value) in snippet {
        match (merged.get_mut(&key), value) {
            (Some(toml::Value::Table(old)), toml::Value::Table(new)) if key == "object" => {
                old.extend(new)
            }
            (_, value) => drop(merged.insert(key, value)),
        }
    }
    merged
}

/// The experiments that a page by example shows: line and file. The block `toml complete` is the base
/// of all snippets; `toml samplers` is a file of its own; in `toml one-of` each line is one; `spectral`
/// ones have bands with wavelengths.
fn experiments(page: &str) -> Vec<(usize, Table)> {
    let parse = |line: usize, text: &str| {
        toml::from_str::<Table>(text)
            .unwrap_or_else(|e| panic!("the snippet at line {line}: {e}\n{text}"))
    };
    let blocks = blocks(page, "toml");
    let complete = blocks.iter().find(|block| block.tag == "toml complete").expect("a complete file");
    let base = parse(complete.lines[0].0, &complete.text());
    let spectral = parse(0, "bands = { spectral = { from_nm = 400, to_nm = 700, count = 3 } }");
    let spectral = merged(&base, spectral);
    let mut files = Vec::new();
    for block in &blocks {
        let first = block.lines[0].0;
        match block.tag {
            "toml complete" => files.push((first, base.clone())),
            "toml samplers" => files.push((first, parse(first, &block.text()))),
            "toml" => files.push((first, merged(&base, parse(first, &block.text())))),
            "toml one-of" | "toml one-of spectral" => {
                for &(number, line) in &block.lines {
                    // The measurement was in R, G and B.
                    let in_rgb = block.tag == "toml one-of" || line.contains("\"marble\"");
                    let base = if in_rgb { &base } else { &spectral };
                    files.push((number, merged(base, parse(number, line))));
                }
            }
            tag => panic!("line {first}: nothing is known of blocks headed `{tag}`"),
        }
    }
    files
}

/// A closed body, as an OBJ file.
const OCTAHEDRON: &str = "v 1 0 0\nv -1 0 0\nv 0 1 0\nv 0 -1 0\nv 0 0 1\nv 0 0 -1\n\
    f 1 3 5\nf 3 2 5\nf 2 4 5\nf 4 1 5\nf 3 1 6\nf 2 3 6\nf 4 2 6\nf 1 4 6\n";

/// A grey sky.
fn write_sky(path: &Path) {
    let bands = [Band { name: "grey".into(), range_nm: None, display_rgb: [1.0; 3] }];
    let pixels = Array::new(vec![2, 2, 4, 1], vec![0.5; 16]);
    write_exr(path, &Picture::new(&bands, &pixels), &[]).expect("a sky");
}

/// The same body as a PLY file.
fn octahedron_ply() -> String {
    let lines = |key: char| OCTAHEDRON.lines().filter(move |line| line.starts_with(key));
    let vertices = lines('v').map(|line| format!("{}\n", &line[2..]));
    let faces = lines('f').map(|line| {
        let corners =
            line[2..].split(' ').map(|i| (i.parse::<usize>().expect("an index") - 1).to_string());
        format!("3 {}\n", corners.collect::<Vec<_>>().join(" "))
    });
    let head = "ply\nformat ascii 1.0\nelement vertex 6\nproperty float x\nproperty float y\nproperty float z\n\
                element face 8\nproperty list uchar int vertex_indices\nend_header\n";
    head.to_string() + &vertices.collect::<String>() + &faces.collect::<String>()
}

/// A sky of four columns, reddish on one side.
fn write_hdr(path: &Path) {
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 2 +X 4\n".to_vec();
    for pixel in 0..8u8 {
        bytes.extend([100 + 20 * (pixel % 4), 100, 100, 128]);
    }
    fs::write(path, bytes).expect("a sky");
}

/// Result of `check` on a page's experiments: their number, and the errors.
fn refused(page: &str) -> (usize, String) {
    let work = Work::new();
    work.write("body.obj", OCTAHEDRON);
    write_sky(&work.path("sky.exr"));
    write_hdr(&work.path("sky.hdr"));
    work.write("body.ply", &octahedron_ply());
    work.write("statue.ply", &octahedron_ply());
    for block in blocks(page, "csv") {
        let name = block.tag.strip_prefix("csv ").expect("the name of the CSV file");
        work.write(name, &block.text());
    }
    let files = experiments(page);
    let mut names = Vec::new();
    for (line, file) in &files {
        names.push(format!("line-{line}.toml"));
        work.write(&names[names.len() - 1], &toml::to_string(file).expect("a text"));
    }
    let ran = work.run(&format!("check {}", names.join(" ")));
    let said = ran.stdout();
    // Not every error names its experiment.
    names.retain(|name| !said.contains(&format!("{name}: ok, ")));
    ran.check((ran.code() == Some(0)) == names.is_empty(), "the exit code says what the lines say");
    let errors = format!("{}\n{}", names.join(" "), ran.stderr());
    (files.len(), if names.is_empty() { String::new() } else { errors })
}

#[test]
fn every_snippet_is_accepted() {
    let (count, errors) = refused(&text("docs/experiment-file.md"));
    assert!(errors.is_empty(), "snippets of docs/experiment-file.md, by their line: {errors}");
    assert!(count > 40, "only {count} snippets were found");
    let (_, errors) = refused(&text("docs/bssrdf.md"));
    assert!(errors.is_empty(), "snippets of docs/bssrdf.md, by their line: {errors}");
    let with_toml = PAGES.iter().copied().filter(|page| !blocks(&text(page), "toml").is_empty());
    let (_, errors) = refused(&text("docs/bring-your-own.md"));
    assert!(errors.is_empty(), "snippets of docs/bring-your-own.md, by their line: {errors}");
    let judged = [
        "README.md",
        "docs/bring-your-own.md",
        "docs/bssrdf.md",
        "docs/experiment-file.md",
        "docs/own-estimator.md",
    ];
    assert_eq!(with_toml.collect::<Vec<_>>(), judged, "each page with TOML needs a test of it");
}

#[test]
fn planted_snippets_are_found() {
    let page = text("docs/experiment-file.md");
    // Those with a seed: experiments on samplers have none.
    let every = experiments(&page).iter().filter(|(_, file)| file.contains_key("seed")).count();
    for (old, new, at_least, words) in [
        ("\nseed = 1 ", "\nsead = 1 ", every, "unknown key `sead`"),
        ("cavity_radius_mm = 0.4", "cavity_radius = 0.4", 1, "unknown key `cavity_radius`"),
        ("one-of spectral", "one-of", 3, "wavelength"),
        ("path = \"body.obj\"", "path = \"corpse.obj\"", 1, "corpse.obj"),
        ("map = \"sky.exr\"", "map = \"ski.exr\"", 1, "ski.exr"),
        ("radius,albedo,", "radios,albedo,", 1, "radius"),
        ("{ albedo = \"1.0\" }", "{ albedo = \"1.5\" }", 1, "1.5"),
    ] {
        assert!(page.contains(old), "{old}");
        let (_, errors) = refused(&page.replacen(old, new, 1));
        let files = errors.lines().next().unwrap_or_default().split_whitespace().count();
        // After a file that cannot be read nothing more is checked.
        assert!(files >= at_least && errors.contains(words), "{new}:\n{errors}");
    }
}

/// The worked example of the page on own data runs, and its numbers are those of the files.
#[test]
fn own_data_is_read_as_the_page_says() {
    let work = Work::new();
    let page = text("docs/bring-your-own.md");
    let complete = blocks(&page, "toml").into_iter().find(|block| block.tag == "toml complete");
    work.write("my-statue.toml", &complete.expect("a complete file").text());
    work.write("milk.csv", &only_block(&page, "csv"));
    work.write("statue.ply", &octahedron_ply());
    write_hdr(&work.path("sky.hdr"));
    let small = "--set sensor.perspective.resolution=[8,8] --set budget.passes=4";
    work.run("check my-statue.toml").exits(0).says("2 cells, 2 estimators, 6 bands");
    // The band of 450 to 500 nm lies between the rows of 450 and 520 nm: the mean of a straight line.
    let mean = 0.1 * (0.40 + (0.12 - 0.40) * 25.0 / 70.0);
    let plan = work.run("plan my-statue.toml --dry");
    plan.exits(0).says(&format!("{mean:.4}"));
    work.run(&format!("run my-statue.toml -q {small}")).exits(0).says("results/my-statue/report.html");
}

#[test]
fn the_example_of_the_readme_verifies() {
    let work = Work::new();
    work.write("slab.toml", &only_block(&text("README.md"), "toml"));
    // Fewer passes could miss what the claim wants to see: the verdict would be `underpowered`.
    let less = "-q --set budget.passes=256";
    work.run(&format!("run slab.toml {less}")).exits(0).says("results/slab/report.html");
    work.run(&format!("verify slab.toml {less}")).exits(0).says("verdicts are green");
}

/// Prose and code of a page without its fences: pieces with their line.
fn pieces(prose: &str) -> Vec<(usize, &str)> {
    let mut line = 1;
    let pieces = prose.split('`').map(|piece| {
        let begins = line;
        line += piece.matches('\n').count();
        (begins, piece)
    });
    let pieces = pieces.collect::<Vec<_>>();
    assert!(pieces.len() % 2 == 1, "a backtick without its twin");
    pieces
}

/// The anchors of a page's headings.
fn anchors(page: &str) -> impl Iterator<Item = String> + '_ {
    let headings = page.lines().filter(|line| line.starts_with('#'));
    headings.map(|line| {
        let kept = line
            .trim_start_matches('#')
            .trim()
            .chars()
            .filter(|c| c.is_alphanumeric() || " -".contains(*c));
        kept.map(|c| if c == ' ' { '-' } else { c.to_ascii_lowercase() }).collect()
    })
}

/// Relative links that point nowhere.
fn dead_links(path: &str, page: &str) -> (usize, Vec<String>) {
    let folder = package().join(path).parent().expect("a folder").to_path_buf();
    let prose = split(page).1;
    let without_code: String = pieces(&prose).into_iter().step_by(2).map(|(_, piece)| piece).collect();
    let targets =
        without_code.split("](").skip(1).filter_map(|rest| rest.split_once(')')).map(|(to, _)| to);
    let relative: Vec<&str> = targets.filter(|to| !to.contains("://")).collect();
    let dead = relative.iter().filter(|to| {
        let (file, anchor) = to.split_once('#').unwrap_or((to, ""));
        let is_there =
            folder.join(file).is_file() || file.is_empty() && anchors(page).any(|a| a == anchor);
        !is_there
    });
    (relative.len(), dead.map(|to| format!("{path}: {to}")).collect())
}

#[test]
fn every_relative_link_points_to_a_file() {
    let (counts, dead): (Vec<usize>, Vec<_>) =
        PAGES.iter().map(|path| dead_links(path, &text(path))).unzip();
    assert_eq!(dead.concat(), [""; 0], "links to no file");
    assert!(counts.iter().sum::<usize>() > 10, "links per page: {counts:?}");

    let planted =
        "[a](limits.md), [`b`](../README.md#start) `[c](no)` [d](http://no/)\n```\n[e](no)\n```\n";
    assert_eq!(dead_links("docs/x.md", planted), (2, vec![]));
    let planted = "![a](README.md) and\n[`b`\nb](docs)";
    assert_eq!(dead_links("docs/x.md", planted).1, ["docs/x.md: README.md", "docs/x.md: docs"]);
}

/// The commands of a page, from code in its prose and from blocks: line and what follows `scatterproof`.
fn commands(page: &str) -> Vec<(usize, String)> {
    let (blocks, prose) = split(page);
    let spans = pieces(&prose).into_iter().skip(1).step_by(2);
    let spans = spans.map(|(line, span)| (line, span.replace('\n', " ")));
    let in_blocks = blocks.iter().filter(|block| !block.is("rust")).flat_map(|block| &block.lines);
    let in_blocks = in_blocks.map(|(line, text)| (*line, text.to_string()));
    let mut found = Vec::new();
    for (line, code) in spans.chain(in_blocks) {
        let code = code.trim_start_matches([' ', '#']);
        // A dependency in a Cargo.toml is none.
        let own = code.strip_prefix("scatterproof ").filter(|rest| !rest.starts_with('='));
        let cargo = || code.strip_prefix("cargo run ")?.split_once("-- ").map(|(_, rest)| rest);
        let comment = code.find("# scatterproof ").map(|at| &code[at + "# scatterproof ".len()..]);
        let Some(command) = own.or_else(cargo).or(comment) else { continue };
        let command = command.split(" #").next().unwrap_or_default();
        found.push((line, command.trim().to_string()));
    }
    found
}

/// The error in a command, if any. Files in folders must be there; `example.toml` is
/// the file of the page by example.
fn wrong(work: &Work, command: &str) -> Option<String> {
    let words: Vec<&str> = command.split_whitespace().collect();
    let (name, rest) = words.split_first()?;
    if !name.starts_with('-') && !work.run("--help").stdout().contains(&format!("\n  {name} ")) {
        return Some(format!("no subcommand `{name}`"));
    }
    let is_flag = |word: &&&str| word.starts_with('-');
    let help = work.run(&if name.starts_with('-') { "--help".into() } else { format!("help {name}") });
    let help = help.stdout();
    let known: Vec<&str> = help.split([' ', ',', '\n']).collect();
    if let Some(flag) = words.iter().filter(is_flag).find(|flag| !known.contains(*flag)) {
        return Some(format!("`{name}` has no `{flag}`"));
    }
    if *name == "list" {
        let ran = work.run(command);
        return (ran.code() != Some(0)).then(|| ran.stderr());
    }
    let file = rest.iter().find(|word| word.ends_with(".toml") && !is_flag(word))?;
    let folder = match *file {
        "example.toml" => work.path(""),
        _ if file.contains('/') => package().to_path_buf(),
        _ => return None,
    };
    if !folder.join(file).is_file() {
        return Some(format!("no file {file}"));
    }
    // The program under test does not know the reader's own estimator.
    let overrides_only = rest.iter().filter(is_flag).all(|flag| ["--set", "--setting"].contains(flag));
    if !overrides_only || file.starts_with("examples/") {
        return None;
    }
    let arguments = command.split_once(' ').map_or("", |(_, rest)| rest);
    let ran = work.shell(&format!("cd '{}' && exec \"$0\" check {arguments}", folder.display()));
    (ran.code() != Some(0)).then(|| ran.stderr())
}

/// The streams of the project's own verification are named by what they test: nobody picks a seed.
#[test]
fn verification_has_no_literal_seed() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut seen = 0;
    for folder in ["experiments/verify", "tests/power"] {
        for entry in std::fs::read_dir(root.join(folder)).expect(folder) {
            let path = entry.expect("an entry").path();
            if path.extension().is_some_and(|e| e == "toml") {
                let text = std::fs::read_to_string(&path).expect("a text");
                let seed =
                    text.lines().find(|l| l.trim_start().starts_with("seed") || l.contains("fresh ="));
                assert!(seed.is_none(), "{}: {seed:?}", path.display());
                seen += 1;
            }
        }
    }
    assert!(seen > 12, "{seen} files");
}

#[test]
fn every_command_exists() {
    let work = Work::new();
    let page = text("docs/experiment-file.md");
    let base = blocks(&page, "toml");
    let base = base.iter().find(|block| block.tag == "toml complete").expect("a complete file");
    work.write("example.toml", &base.text());
    let (mut count, mut found) = (0, Vec::new());
    for path in PAGES {
        for (line, command) in commands(&text(path)) {
            count += 1;
            found.extend(wrong(&work, &command).map(|what| format!("{path}:{line}: {command}: {what}")));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
    assert!(count > 30, "only {count} commands were found");

    let planted = "`scatterproof rum x` and `scatterproof\nlist glases`\n```\nscatterproof plan f --wet  # c\n\
        cargo run --release -- run experiments/none.toml\nscatterproof run example.toml --set sead=1\n```\n\
        ```toml\n[a]  # scatterproof chek\n```\n`scatterproof list glasses`, `scatterproof --help`\n";
    let found = commands(planted).into_iter().filter_map(|(line, command)| {
        let what = wrong(&work, &command)?;
        Some(format!("{line} {}", what.lines().next().unwrap_or_default()))
    });
    let found = found.collect::<Vec<_>>().join("\n");
    for words in [
        "1 no subcommand `rum`",
        "1 error: unknown topic or kind `glases`",
        "4 `plan` has no `--wet`",
        "5 no file experiments/none.toml",
        "6 error: unknown key `sead`",
        "9 no subcommand `chek`",
    ] {
        assert!(found.contains(words), "not found: {words}\n{found}");
    }
    assert_eq!(found.lines().count(), 6, "{found}");
}

/// Every page is listed in the book.
#[test]
fn the_book_lists_every_page() {
    let summary = text("docs/SUMMARY.md");
    let pages =
        fs::read_dir(package().join("docs")).expect("docs").map(|entry| entry.expect("an entry").path());
    let names = pages.filter(|path| path.extension().is_some_and(|e| e == "md"));
    let names: Vec<String> =
        names.filter_map(|path| Some(path.file_name()?.to_string_lossy().into_owned())).collect();
    assert!(names.len() > 8, "{names:?}");
    for name in names.iter().filter(|name| *name != "SUMMARY.md") {
        assert!(summary.contains(&format!("]({name})")), "docs/SUMMARY.md does not list {name}");
        assert!(
            PAGES.contains(&format!("docs/{name}").as_str()),
            "docs/{name} is not among the pages tested"
        );
    }
}

/// What a page's table of arrays states: what a file's name ends in, and its axes.
fn documented_arrays(page: &str) -> Vec<(String, Vec<String>)> {
    let row = |line: &str| {
        let (file, rest) = line.strip_prefix("| `")?.split_once(".npy` | `[")?;
        let (axes, _) = rest.split_once("]`")?;
        let what = file.rsplit('.').next()?;
        Some((what.to_string(), axes.split(", ").map(String::from).collect()))
    };
    page.lines().filter_map(row).collect()
}

/// The keys of a published `record.json`, its runs and images, that a page does not name.
fn unnamed_keys(page: &str) -> Vec<String> {
    let path = "results/published/short/snee-detail/record/record.json";
    let record: serde_json::Value = serde_json::from_str(&text(path)).expect("JSON");
    let run = &record["cells"][0]["runs"][0];
    let parts = [&record, &record["cells"][0], run, &run["image"], &record["bands"][0]];
    let keys = parts.iter().flat_map(|part| part.as_object().expect("an object").keys());
    keys.filter(|key| !page.contains(&format!("`{key}`"))).cloned().collect()
}

#[test]
fn the_layout_of_records_is_documented_as_it_is() {
    let page = text("docs/record-layout.md");
    let is_layout = |page: &str| {
        let told = documented_arrays(page);
        let known =
            LAYOUT.map(|of| (of.what.to_string(), of.axes.iter().map(|a| a.to_string()).collect()));
        told == known
    };
    assert!(is_layout(&page), "{:?}", documented_arrays(&page));
    let axes = LAYOUT.iter().flat_map(|of| of.axes.iter());
    let places = MOMENTS.iter().chain(&STATISTICS).chain(&GUIDE).chain(&BIN_ROWS);
    for name in axes.chain(places) {
        assert!(page.contains(&format!("`{name}`")), "{name} is not explained");
    }
    assert_eq!(unnamed_keys(&page), [""; 0], "keys of record.json that the page does not name");

    assert!(!is_layout(&page.replace("`[batch, counter]`", "`[counter, batch]`")));
    let without = page.replace("`anomalies`", "");
    assert_eq!(unnamed_keys(&without), ["anomalies"]);
}

/// The plot of how run time grows has the points of its table: each point's title states what it shows.
#[test]
fn the_plot_of_growth_has_the_points_of_its_table() {
    let [table, plot] = ["results/published/speed/scaling.md", "docs/speed.svg"].map(text);
    let mut points = 0;
    for line in table.lines().skip(2) {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        let &[axis, value, run, passes, ..] = &cells[..] else { panic!("a row of {table}") };
        for (curve, seconds) in [("run", run), ("passes", passes)] {
            let title = format!("<title>{value} {axis}, {curve}: {seconds} s</title>");
            assert!(plot.contains(&title), "docs/speed.svg has no `{title}`: `scripts/bench scaling`");
            points += 1;
        }
    }
    assert_eq!(points, plot.matches("<title>").count());
    assert!(points > 20, "{points} points");
}
