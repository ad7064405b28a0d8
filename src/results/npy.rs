//! NumPy's array files, format version 1.0 (numpy.lib.format): f64, little-endian, C order.

use std::path::Path;

use crate::error::{Error, Result};

const MAGIC: &[u8] = b"\x93NUMPY\x01\x00";

/// An array of any shape, last axis fastest.
#[derive(Clone, Debug, PartialEq)]
pub struct Array {
    /// Lengths of the axes.
    pub shape: Vec<usize>,
    /// Elements in C order.
    pub data: Vec<f64>,
}

impl Array {
    /// Panics where the shape does not fit the data.
    pub fn new(shape: Vec<usize>, data: Vec<f64>) -> Array {
        assert_eq!(shape.iter().product::<usize>(), data.len(), "shape {shape:?}");
        Array { shape, data }
    }

    /// The file's bytes: magic, header length, a Python dictionary padded so that the data is aligned
    /// to 64 bytes, data.
    pub fn to_npy(&self) -> Vec<u8> {
        let axes: String = self.shape.iter().map(|n| format!("{n}, ")).collect();
        let axes = if self.shape.len() == 1 { axes.trim_end() } else { axes.trim_end_matches(", ") };
        let mut header = format!("{{'descr': '<f8', 'fortran_order': False, 'shape': ({axes}), }}");
        let unpadded = MAGIC.len() + 2 + header.len() + 1;
        header.push_str(&" ".repeat(unpadded.next_multiple_of(64) - unpadded));
        header.push('\n');
        let mut bytes = MAGIC.to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(self.data.iter().flat_map(|x| x.to_le_bytes()));
        bytes
    }

    /// Reads a file's bytes; `path` is for messages.
    pub fn from_npy(bytes: &[u8], path: &Path) -> Result<Array> {
        let refuse = |what: &str| Error::record(path, format!("not a usable .npy array: {what}"));
        let rest = bytes.strip_prefix(MAGIC).ok_or_else(|| refuse("no NumPy 1.0 header"))?;
        let (length, rest) = rest.split_at_checked(2).ok_or_else(|| refuse("the header is cut off"))?;
        let length = u16::from_le_bytes([length[0], length[1]]) as usize;
        let (header, data) =
            rest.split_at_checked(length).ok_or_else(|| refuse("the header is cut off"))?;
        let shape = parse_header(&String::from_utf8_lossy(header)).map_err(|what| refuse(&what))?;
        let wanted = shape.iter().try_fold(8usize, |n, axis| n.checked_mul(*axis));
        if wanted != Some(data.len()) {
            let found = data.len() / 8;
            return Err(refuse(&format!(
                "shape {shape:?} but {found} elements; the file is truncated or foreign"
            )));
        }
        let data = data.as_chunks::<8>().0.iter().map(|b| f64::from_le_bytes(*b)).collect();
        Ok(Array { shape, data })
    }
}

/// The shape, where the header describes f64 in C order.
fn parse_header(header: &str) -> std::result::Result<Vec<usize>, String> {
    let compact: String = header.chars().filter(|c| !c.is_whitespace()).collect();
    if !compact.contains("'descr':'<f8'") {
        return Err("elements are not little-endian f64".into());
    }
    if !compact.contains("'fortran_order':False") {
        return Err("elements are not in C order".into());
    }
    let axes = compact.split_once("'shape':(").and_then(|(_, rest)| rest.split_once(')'));
    let (axes, _) = axes.ok_or("the header states no shape")?;
    let axes = axes.split(',').filter(|axis| !axis.is_empty());
    axes.map(|axis| axis.parse().map_err(|_| format!("`{axis}` is no length of an axis"))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn path() -> &'static Path {
        Path::new("a.npy")
    }

    // numpy: buffer = io.BytesIO(); np.save(buffer, np.array([[1.0, -2.5, 1e300]])); buffer.getvalue()
    #[test]
    fn bytes_are_numpys() {
        let mut expected =
            b"\x93NUMPY\x01\x00v\x00{'descr': '<f8', 'fortran_order': False, 'shape': (1, 3), }"
                .to_vec();
        expected.resize(127, b' ');
        expected.push(b'\n');
        expected.extend(b"\0\0\0\0\0\0\xf0?\0\0\0\0\0\0\x04\xc0\x9cu\0\x88<\xe47~");
        let array = Array::new(vec![1, 3], vec![1.0, -2.5, 1e300]);
        assert_eq!(array.to_npy(), expected);
        assert_eq!(Array::from_npy(&expected, path()).expect("an array"), array);
    }

    #[test]
    fn every_shape_reads_back() {
        for shape in [vec![], vec![4], vec![0], vec![2, 3], vec![2, 3, 4, 5]] {
            let count: usize = shape.iter().product();
            let array = Array::new(shape, (0..count).map(|i| i as f64 / 3.0).collect());
            let bytes = array.to_npy();
            assert_eq!((bytes.len() - 8 * count) % 64, 0);
            assert_eq!(Array::from_npy(&bytes, path()).expect("an array"), array);
        }
    }

    #[test]
    fn refuses_others_by_name() {
        let good = Array::new(vec![2], vec![1.0, 2.0]).to_npy();
        let refused = |bytes: &[u8], what: &str| {
            let error = Array::from_npy(bytes, path()).expect_err("a refusal").to_string();
            assert!(error.contains("a.npy") && error.contains(what), "{error}");
        };
        let swap = |from: &str, to: &str| {
            let text: String = good.iter().map(|b| *b as char).collect();
            text.replace(from, to).chars().map(|c| c as u8).collect::<Vec<u8>>()
        };
        refused(b"PK\x03\x04", "no NumPy 1.0 header");
        refused(&good[..9], "cut off");
        refused(&good[..60], "cut off");
        refused(&good[..good.len() - 8], "truncated");
        refused(&swap("<f8", "<f4"), "little-endian f64");
        refused(&swap("False", "True "), "C order");
        refused(&swap("(2,)", "(x,)"), "no length");
    }
}
