//! Comma-separated text as RFC 4180 has it, with numbers that read back exactly.

/// A header and rows as CSV text.
pub fn to_text(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer =
        csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
    let mut put = |row: Vec<String>| {
        assert_eq!(row.len(), header.len(), "one field a column");
        // Writing to memory cannot fail.
        let _ = writer.write_record(&row);
    };
    put(header.iter().map(|name| name.to_string()).collect());
    rows.into_iter().for_each(&mut put);
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// The shortest text that reads back as the same number; empty for NaN.
pub fn number(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{x:?}") }
}

/// The same for a value that may be absent.
pub fn optional(x: Option<f64>) -> String {
    x.map(number).unwrap_or_default()
}

/// The rows of a CSV text, its header among them; rows after a malformed one are left out.
pub fn rows(text: &str) -> Vec<Vec<String>> {
    let mut reader =
        csv::ReaderBuilder::new().has_headers(false).flexible(true).from_reader(text.as_bytes());
    let fields = |record: csv::StringRecord| record.iter().map(String::from).collect();
    reader.records().map_while(Result::ok).map(fields).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_where_needed() {
        let text = to_text(&["a", "b"], [vec!["x,\"y\"".into(), number(1e-300)]]);
        assert_eq!(text, "a,b\n\"x,\"\"y\"\"\",1e-300\n");
        assert_eq!((number(f64::NAN), optional(None)), (String::new(), String::new()));
    }
}
