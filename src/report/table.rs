//! Tables as aligned text for a terminal, as Markdown and as CSV; `latex` has them for papers.

use super::markup::without_html;
use crate::results::csv_text;

/// A header and rows of text.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Table {
    /// Column names.
    pub header: Vec<String>,
    /// Rows, one field per column.
    pub rows: Vec<Vec<String>>,
}

impl Table {
    /// An empty table.
    pub(crate) fn new(header: &[&str]) -> Table {
        Table { header: header.iter().map(|name| name.to_string()).collect(), rows: Vec::new() }
    }

    /// Appends a row.
    pub(crate) fn push(&mut self, row: Vec<String>) {
        assert_eq!(row.len(), self.header.len(), "one field per column");
        self.rows.push(row);
    }

    /// Without the columns that are empty in every row.
    pub(crate) fn without_empty_columns(mut self) -> Table {
        for column in (0..self.header.len()).rev() {
            if self.rows.iter().all(|row| row[column].is_empty()) {
                self.remove_column(column);
            }
        }
        self
    }

    /// Removes a column.
    pub(crate) fn remove_column(&mut self, column: usize) {
        self.header.remove(column);
        self.rows.iter_mut().for_each(|row| drop(row.remove(column)));
    }

    /// Aligned plain text: columns two spaces apart, numbers to the right. Empty for a table
    /// without columns.
    pub(crate) fn to_text(&self) -> String {
        if self.header.is_empty() {
            return String::new();
        }
        let columns = self.columns();
        let rule: Vec<String> = columns.iter().map(|c| "-".repeat(c.width)).collect();
        let lines = [&self.header, &rule].into_iter().chain(&self.rows);
        lines.map(|row| format!("{}\n", aligned(row, &columns).join("  ").trim_end())).collect()
    }

    /// A Markdown table, aligned so that it also reads as plain text.
    pub(crate) fn to_markdown(&self) -> String {
        let escaped = |row: &Vec<String>| {
            row.iter().map(|f| without_html(f).replace('|', "\\|").replace('\n', " ")).collect()
        };
        let table =
            Table { header: escaped(&self.header), rows: self.rows.iter().map(escaped).collect() };
        let columns = table.columns();
        let rule = columns.iter().map(|c| match c.numeric {
            true => format!("{}:", "-".repeat(c.width.max(2) - 1)),
            false => "-".repeat(c.width),
        });
        let rule: Vec<String> = rule.collect();
        let lines = [&table.header, &rule].into_iter().chain(&table.rows);
        lines.map(|row| format!("| {} |\n", aligned(row, &columns).join(" | "))).collect()
    }

    /// Comma-separated text.
    pub(crate) fn to_csv(&self) -> String {
        let header: Vec<&str> = self.header.iter().map(String::as_str).collect();
        csv_text::to_text(&header, self.rows.iter().cloned())
    }

    /// Whether the fields of a column begin like numbers.
    pub(crate) fn is_numeric(&self, column: usize) -> bool {
        let numeric =
            |field: &str| field.trim_start_matches('-').starts_with(|c: char| c.is_ascii_digit());
        let mut fields =
            self.rows.iter().map(|row| row[column].as_str()).filter(|f| !f.is_empty()).peekable();
        fields.peek().is_some() && fields.all(numeric)
    }

    fn columns(&self) -> Vec<ColumnLayout> {
        let width = |c: usize| {
            let fields = self.rows.iter().map(|row| row[c].chars().count());
            fields.chain([self.header[c].chars().count()]).max().unwrap_or(0)
        };
        (0..self.header.len())
            .map(|c| ColumnLayout { width: width(c), numeric: self.is_numeric(c) })
            .collect()
    }
}

/// Width and alignment of a column.
struct ColumnLayout {
    width: usize,
    numeric: bool,
}

fn aligned(row: &[String], columns: &[ColumnLayout]) -> Vec<String> {
    // Not by a width in `format!`, which takes at most 65535.
    let pad = |(field, &ColumnLayout { width, numeric }): (&String, &ColumnLayout)| {
        let blanks = " ".repeat(width - field.chars().count());
        if numeric { blanks + field } else { format!("{field}{blanks}") }
    };
    row.iter().zip(columns).map(pad).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small() -> Table {
        let mut table = Table::new(&["name", "value", "nothing"]);
        table.push(vec!["a|b".into(), "1.0(2)".into(), String::new()]);
        table.push(vec!["c".into(), "-12".into(), String::new()]);
        table.without_empty_columns()
    }

    #[test]
    fn fields_may_be_long() {
        let mut table = Table::new(&["a", "b"]);
        table.push(vec!["x".repeat(70_000), "y".into()]);
        assert!(table.to_text().ends_with("x  y\n"));
    }

    #[test]
    fn three_forms() {
        assert_eq!(small().to_text(), "name   value\n----  ------\na|b   1.0(2)\nc        -12\n");
        let markdown = "| name |  value |\n| ---- | -----: |\n| a\\|b | 1.0(2) |\n| c    |    -12 |\n";
        assert_eq!(small().to_markdown(), markdown);
        assert_eq!(small().to_csv(), "name,value\na|b,1.0(2)\nc,-12\n");
    }
}
