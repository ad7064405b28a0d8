//! Models against published and independently computed tables, and against identities.

mod albedos;
mod directional;
mod fits;
mod identities;
mod options;
mod profiles;
mod single;

/// A table: lines that start with # are comments, the first other line names the columns.
struct OracleTable {
    names: Vec<&'static str>,
    rows: Vec<Vec<&'static str>>,
}

#[derive(Clone, Copy)]
struct OracleRow<'a> {
    table: &'a OracleTable,
    fields: &'a [&'static str],
}

impl OracleTable {
    fn of(text: &'static str) -> OracleTable {
        let mut lines = text.lines().filter(|line| !line.starts_with('#'));
        let split = |line: &'static str| line.split(',').collect::<Vec<&str>>();
        let names = split(lines.next().unwrap());
        let rows: Vec<Vec<&str>> = lines.map(split).collect();
        assert!(!rows.is_empty() && rows.iter().all(|row| row.len() == names.len()));
        OracleTable { names, rows }
    }

    fn rows(&self) -> impl Iterator<Item = OracleRow<'_>> {
        self.rows.iter().map(|fields| OracleRow { table: self, fields })
    }
}

impl OracleRow<'_> {
    fn text(&self, name: &str) -> &'static str {
        self.fields[self.table.names.iter().position(|n| *n == name).unwrap()]
    }

    fn number(&self, name: &str) -> f64 {
        self.text(name).parse().unwrap()
    }

    /// The column to `digits` significant ones.
    fn has(&self, name: &str, got: f64, digits: i32) {
        self.is_within(name, got, half_unit(self.number(name), digits));
    }

    /// The column within a bound, and a rounding of f64.
    fn is_within(&self, name: &str, got: f64, bound: f64) {
        let expected = self.number(name);
        let off = (got - expected).abs();
        assert!(
            off <= bound + 1e-14 * expected.abs(),
            "{name}: {got:e} is off by {off:e}, may be by {bound:e}: {:?}",
            self.fields
        );
    }
}

/// Half a unit of the last of `digits` significant digits.
fn half_unit(value: f64, digits: i32) -> f64 {
    if value == 0.0 { 0.0 } else { 0.5 * 10f64.powi(value.abs().log10().floor() as i32 + 1 - digits) }
}
