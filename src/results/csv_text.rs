//! Comma-separated text by RFC 4180, with numbers that are read back exactly.

use std::borrow::Cow;
use std::fmt;

use serde::Serialize;
use serde::ser::{Impossible, SerializeStruct, Serializer};

/// A header and rows as CSV text.
pub fn to_text(header: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer =
        csv::WriterBuilder::new().terminator(csv::Terminator::Any(b'\n')).from_writer(Vec::new());
    let mut put = |row: Vec<String>| {
        assert_eq!(row.len(), header.len(), "one field a column");
        // Writing to memory cannot fail.
        let _ = writer.write_record(row.iter().map(|field| inert(field).into_owned()));
    };
    put(header.iter().map(|name| name.to_string()).collect());
    rows.into_iter().for_each(&mut put);
    String::from_utf8(writer.into_inner().unwrap_or_default()).unwrap_or_default()
}

/// A field that no spreadsheet takes for a formula: where it begins like one, an apostrophe stands before it. Numbers
/// with their signs stay.
fn inert(field: &str) -> Cow<'_, str> {
    let is_number = |text: &str| text.chars().all(|c| c.is_ascii_digit() || " .,()[]%+-e±".contains(c));
    let is_formula = match field.chars().next() {
        Some('=' | '@' | '\t' | '\r') => true,
        Some('+' | '-') => !is_number(field) && field.parse::<f64>().is_err(),
        _ => false,
    };
    if is_formula { format!("'{field}").into() } else { field.into() }
}

/// Structs as CSV text: the columns are the fields, in their order, with their names. What is absent or
/// not a number is an empty field.
pub fn table<T: Serialize + Default>(rows: &[T]) -> String {
    let fields = |row: &T| {
        let mut fields = Fields::default();
        // Only a field that is no text, number or flag fails, and that is a mistake in the type.
        row.serialize(&mut fields).unwrap_or_else(|_| panic!("a row of something else than texts"));
        fields
    };
    to_text(&fields(&T::default()).names, rows.iter().map(|row| fields(row).texts))
}

/// The shortest text that reads back as the same number; empty for NaN. `csv`'s own serializer would
/// write small numbers with many zeros.
pub fn number(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{x:?}") }
}

/// The names of a struct's fields, and their texts.
#[derive(Default)]
struct Fields {
    names: Vec<&'static str>,
    texts: Vec<String>,
}

impl Fields {
    fn put(&mut self, text: String) -> Result<(), fmt::Error> {
        self.texts.push(text);
        Ok(())
    }
}

impl SerializeStruct for &mut Fields {
    type Ok = ();
    type Error = fmt::Error;

    fn serialize_field<T: Serialize + ?Sized>(
        &mut self,
        name: &'static str,
        value: &T,
    ) -> Result<(), fmt::Error> {
        self.names.push(name);
        value.serialize(&mut **self)
    }

    fn end(self) -> Result<(), fmt::Error> {
        Ok(())
    }
}

/// Fields that print as they are.
macro_rules! displayed {
    ($($method:ident: $type:ty),*) => {
        $(fn $method(self, value: $type) -> Result<(), fmt::Error> {
            self.put(value.to_string())
        })*
    };
}

/// An error: not a field of a row.
macro_rules! refused {
    ($($method:ident($($argument:ty),*) -> $result:ty;)*) => {
        $(fn $method(self, $(_: $argument),*) -> Result<$result, fmt::Error> {
            Err(fmt::Error)
        })*
    };
}

type No = Impossible<(), fmt::Error>;

impl<'a> Serializer for &'a mut Fields {
    type Ok = ();
    type Error = fmt::Error;
    type SerializeSeq = No;
    type SerializeTuple = No;
    type SerializeTupleStruct = No;
    type SerializeTupleVariant = No;
    type SerializeMap = No;
    type SerializeStruct = &'a mut Fields;
    type SerializeStructVariant = No;

    displayed! {
        serialize_bool: bool, serialize_i8: i8, serialize_i16: i16, serialize_i32: i32, serialize_i64: i64,
        serialize_u8: u8, serialize_u16: u16, serialize_u32: u32, serialize_u64: u64, serialize_char: char,
        serialize_str: &str
    }

    fn serialize_f32(self, value: f32) -> Result<(), fmt::Error> {
        self.serialize_f64(f64::from(value))
    }

    fn serialize_f64(self, value: f64) -> Result<(), fmt::Error> {
        self.put(number(value))
    }

    fn serialize_none(self) -> Result<(), fmt::Error> {
        self.put(String::new())
    }

    fn serialize_some<T: Serialize + ?Sized>(self, value: &T) -> Result<(), fmt::Error> {
        value.serialize(self)
    }

    fn serialize_unit_variant(self, _: &str, _: u32, name: &'static str) -> Result<(), fmt::Error> {
        self.put(name.into())
    }

    fn serialize_newtype_struct<T: Serialize + ?Sized>(
        self,
        _: &str,
        value: &T,
    ) -> Result<(), fmt::Error> {
        value.serialize(self)
    }

    fn serialize_newtype_variant<T: Serialize + ?Sized>(
        self,
        _: &str,
        _: u32,
        _: &str,
        _: &T,
    ) -> Result<(), fmt::Error> {
        Err(fmt::Error)
    }

    fn serialize_struct(self, _: &str, _: usize) -> Result<&'a mut Fields, fmt::Error> {
        Ok(self)
    }

    refused! {
        serialize_bytes(&[u8]) -> ();
        serialize_unit() -> ();
        serialize_unit_struct(&'static str) -> ();
        serialize_seq(Option<usize>) -> No;
        serialize_tuple(usize) -> No;
        serialize_tuple_struct(&'static str, usize) -> No;
        serialize_tuple_variant(&'static str, u32, &'static str, usize) -> No;
        serialize_map(Option<usize>) -> No;
        serialize_struct_variant(&'static str, u32, &'static str, usize) -> No;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_where_needed() {
        let text = to_text(&["a", "b"], [vec!["x,\"y\"".into(), number(1e-300)]]);
        assert_eq!(text, "a,b\n\"x,\"\"y\"\"\",1e-300\n");
    }

    #[derive(Default, Serialize)]
    struct Row {
        name: String,
        count: u64,
        small: f64,
        absent: Option<f64>,
    }

    #[test]
    fn fields_are_columns() {
        assert_eq!(table::<Row>(&[]), "name,count,small,absent\n");
        let row = |small, absent| Row { name: "a,b".into(), count: 7, small, absent };
        let text = table(&[row(2e-5, Some(1.0)), row(f64::NAN, None)]);
        assert_eq!(text, "name,count,small,absent\n\"a,b\",7,2e-5,1.0\n\"a,b\",7,,\n");
    }

    #[test]
    fn nothing_is_a_formula() {
        for (field, inert) in [
            ("=1+1", "'=1+1"),
            ("@SUM(A1)", "'@SUM(A1)"),
            ("-1+cmd|' /C calc'!A0", "'-1+cmd|' /C calc'!A0"),
            ("+A1", "'+A1"),
            ("-1.5(2)e-7", "-1.5(2)e-7"),
            ("+1.7 [+1.4, -2.0] %", "+1.7 [+1.4, -2.0] %"),
            ("-inf", "-inf"),
            ("a=b", "a=b"),
            ("", ""),
        ] {
            assert_eq!(super::inert(field), inert);
        }
    }
}
