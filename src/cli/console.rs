//! Output on a terminal: tables that fit its width, and colour if it has any. If the output is not a terminal,
//! everything is printed, without colour. The only module that uses `console`.

use console::{Style, Term, colors_enabled};

use crate::report::table::Table;
use crate::report::terminal::wrapped;

/// Narrower terminals are taken to be this wide.
const NARROWEST: usize = 40;
/// Columns of a terminal that does not tell.
const USUAL: usize = 80;
/// Bands up to this number are shown one by one.
const FEW: usize = 3;
/// What stands for the bands that are left out.
pub(super) const ALL_BANDS: &str = "all bands";

/// What standard output is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Console {
    /// Columns of the terminal; none where it is no terminal.
    pub width: Option<usize>,
    has_colour: bool,
}

impl Console {
    /// Of standard output.
    pub(super) fn of_output() -> Console {
        let columns = || Term::stdout().size_checked().map_or(USUAL, |(_, columns)| columns.into());
        let width = console::user_attended().then(columns).map(|columns| columns.max(NARROWEST));
        Console { width, has_colour: width.is_some() && colors_enabled() }
    }

    /// A table with a column for each band, which are those named `bands`: where it is too wide, the first,
    /// the middle and the last of them are left, and then the columns named `less` go, the first of them
    /// first.
    pub(super) fn fit(&self, mut table: Table, bands: &[String], less: &[&str]) -> String {
        let Some(width) = self.width else { return table.to_text() };
        let mut note = String::new();
        if text_width(&table) > width && bands.len() > FEW {
            let kept = [0, bands.len() / 2, bands.len() - 1].map(|band| &bands[band]);
            let is_folded = |name: &String| bands.contains(name) && !kept.contains(&name);
            for column in (0..table.header.len()).rev() {
                if is_folded(&table.header[column]) {
                    table.remove_column(column);
                }
            }
            note = format!("{} of {} bands; the report shows all of them\n", kept.len(), bands.len());
        }
        for name in less {
            if text_width(&table) <= width {
                break;
            }
            if let Some(column) = table.header.iter().position(|known| known == name) {
                table.remove_column(column);
            }
        }
        self.laid_out(&table) + &note
    }

    /// A table with a row for each band: of more than a few, the first, the middle and the last, and a row
    /// that says between what the others are.
    pub(super) fn fit_rows(&self, table: &Table, bands: &[String]) -> String {
        let column = table.header.iter().position(|name| name == "band");
        let (Some(_), Some(column), true) = (self.width, column, bands.len() > FEW) else {
            return self.laid_out(table);
        };
        let kept = [0, bands.len() / 2, bands.len() - 1].map(|band| &bands[band]);
        let mut folded = Table { header: table.header.clone(), rows: Vec::new() };
        for group in table.rows.chunk_by(|a, b| a[..column] == b[..column]) {
            folded.rows.extend(group.iter().filter(|row| kept.contains(&&row[column])).cloned());
            let mut all = group[0].clone();
            all[column] = ALL_BANDS.into();
            for field in column + 1..all.len() {
                all[field] = spread(group.iter().map(|row| row[field].as_str()));
            }
            folded.rows.push(all);
        }
        self.laid_out(&folded)
    }

    /// The table, or where it is too wide its rows as paragraphs.
    pub(super) fn laid_out(&self, table: &Table) -> String {
        let Some(width) = self.width.filter(|width| text_width(table) > *width) else {
            return table.to_text();
        };
        let paragraph = |row: &Vec<String>| {
            let fields = table.header.iter().zip(row).filter(|(_, field)| !field.is_empty());
            let fields: Vec<String> = fields.map(|(name, field)| format!("{name}: {field}")).collect();
            let text = wrapped(&fields.join("; "), width.saturating_sub(2));
            text.replace('\n', "\n  ") + "\n"
        };
        table.rows.iter().map(paragraph).collect()
    }

    /// A text whose lines fit.
    pub(super) fn wrapped(&self, text: &str, usual: usize) -> String {
        wrapped(text, self.width.unwrap_or(usual).min(usual))
    }

    /// Words that say how a claim fares, in colour.
    pub(super) fn outcomes(&self, text: &str) -> String {
        if !self.has_colour {
            return text.into();
        }
        let style = |word: &str| match word.trim_end_matches([':', ',', ';']) {
            "pass" | "green" | "ok" | "ok," => Some(Style::new().green()),
            "fail" => Some(Style::new().red().bold()),
            "underpowered" | "invalid" => Some(Style::new().yellow()),
            _ => None,
        };
        let line = |line: &str| {
            // The outcome is the first word of a row, or the second after its name.
            let at = line.find(|c: char| c != ' ').unwrap_or(0);
            let at = if line[at..].starts_with("outcome: ") { at + "outcome: ".len() } else { at };
            let end = line[at..].find([' ', ';']).map_or(line.len(), |n| at + n);
            match style(&line[at..end]) {
                Some(style) => {
                    let word = style.force_styling(true).apply_to(&line[at..end]);
                    format!("{}{word}{}\n", &line[..at], &line[end..])
                }
                None => format!("{line}\n"),
            }
        };
        text.lines().map(line).collect()
    }

    /// A text in green where `is_good`, else in yellow.
    pub(super) fn verdict(&self, text: &str, is_good: bool) -> String {
        let style = if is_good { Style::new().green() } else { Style::new().yellow() };
        if self.has_colour { style.force_styling(true).apply_to(text).to_string() } else { text.into() }
    }
}

/// Whether standard error is a terminal with colours.
pub(super) fn has_coloured_errors() -> bool {
    console::user_attended_stderr() && console::colors_enabled_stderr()
}

/// Characters of the longest line of a table as text.
fn text_width(table: &Table) -> usize {
    table.to_text().lines().map(|line| line.chars().count()).max().unwrap_or(0)
}

/// Between what the numbers are that texts begin with: `3.1 to 8.4`, and how many have none.
fn spread<'a>(texts: impl Iterator<Item = &'a str>) -> String {
    let (mut numbers, mut none): (Vec<(f64, &str)>, usize) = (Vec::new(), 0);
    for text in texts {
        let word = text.split([' ', '*', '(']).next().unwrap_or("");
        match word.parse::<f64>() {
            Ok(number) => numbers.push((number, word)),
            Err(_) => none += 1,
        }
    }
    let least = numbers.iter().min_by(|a, b| a.0.total_cmp(&b.0));
    let most = numbers.iter().max_by(|a, b| a.0.total_cmp(&b.0));
    match (least, most, none) {
        (Some(least), Some(most), 0) => format!("{} to {}", least.1, most.1),
        (Some(least), Some(most), _) => format!("{} to {}; none in {none}", least.1, most.1),
        _ => "none".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn narrow() -> Console {
        Console { width: Some(80), has_colour: false }
    }

    fn bands(count: usize) -> Vec<String> {
        (0..count).map(|i| format!("{}-{}nm", 400 + 10 * i, 410 + 10 * i)).collect()
    }

    /// 31 bands fit into 80 columns, and everything is printed where there is no terminal.
    #[test]
    fn many_bands_fold() {
        let bands = bands(31);
        let mut header = vec!["cell", "estimator", "observable"];
        header.extend(bands.iter().map(String::as_str));
        header.extend(["passes", "CPU s", "paths/s/core"]);
        let mut table = Table::new(&header);
        let numbers = (0..31).map(|i| format!("0.12{i}(3)"));
        let row = ["alpha = 0.1", "guided", "mean"].map(String::from).into_iter().chain(numbers);
        table.push(row.chain(["64", "12.1", "1.2e6"].map(String::from)).collect());
        let text = narrow().fit(table.clone(), &bands, &["observable", "paths/s/core", "CPU s"]);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        for part in ["400-410nm", "550-560nm", "700-710nm", "3 of 31 bands", "0.1230(3)", "alpha = 0.1"]
        {
            assert!(text.contains(part), "no `{part}` in:\n{text}");
        }
        let whole =
            Console { width: None, has_colour: false }.fit(table.clone(), &bands, &["observable"]);
        assert_eq!(whole, table.to_text());
    }

    #[test]
    fn rows_of_bands_fold() {
        let bands = bands(31);
        let mut table = Table::new(&["alpha", "band", "a / b"]);
        for alpha in ["0.1", "0.2"] {
            for (i, band) in bands.iter().enumerate() {
                let ratio = if alpha == "0.2" && i == 3 {
                    "none: heavy tail".into()
                } else {
                    format!("{}.5* [1, 9]", i + 2)
                };
                table.push(vec![alpha.into(), band.clone(), ratio]);
            }
        }
        let text = narrow().fit_rows(&table, &bands);
        assert_eq!(text.lines().count(), 2 + 2 * 4, "{text}");
        assert!(text.contains("all bands") && text.contains(" 2.5 to 32.5\n"), "{text}");
        assert!(text.contains("2.5 to 32.5; none in 1"), "{text}");
    }

    /// What does not fit even so becomes paragraphs; nothing is cut.
    #[test]
    fn wide_rows_become_paragraphs() {
        let mut table = Table::new(&["outcome", "claim", "note"]);
        let note =
            "heavy tail: path has |skewness| / sqrt(passes) = 0.14, limit 0.1, and more words of it";
        table.push(vec!["invalid".into(), "both agree".into(), note.into()]);
        let text = narrow().laid_out(&table);
        assert!(text.lines().all(|line| line.chars().count() <= 80), "{text}");
        let joined = text.split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(joined, format!("outcome: invalid; claim: both agree; note: {note}"));
        let colour = Console { width: Some(80), has_colour: true };
        assert!(colour.outcomes(&text).starts_with("outcome: \u{1b}["), "{:?}", colour.outcomes(&text));
        assert_eq!(narrow().outcomes(&text), text);
    }
}
