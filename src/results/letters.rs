//! Labels in pictures: the printable ASCII characters of DejaVu Sans Bold at 19 pixels (Bitstream Vera licence, which
//! permits this), as a picture of one row. Other characters are shown as `?`.

use std::sync::OnceLock;

/// The characters from the space to the tilde side by side, coverage in 8 bits.
const SHEET: &[u8] = include_bytes!("letters.png");

/// Rows of a line.
pub(super) const HEIGHT: usize = 23;

/// Columns of each character.
const WIDTHS: [u8; 95] = [
    7, 9, 10, 16, 13, 19, 17, 6, 9, 9, 10, 16, 7, 8, 7, 7, 13, 13, 13, 13, 13, 13, 13, 13, 13, 13, 8, 8,
    16, 16, 16, 11, 19, 15, 14, 14, 16, 13, 13, 16, 16, 7, 7, 15, 12, 19, 16, 16, 14, 16, 15, 14, 13,
    15, 15, 21, 15, 14, 14, 9, 7, 9, 16, 10, 10, 13, 14, 11, 14, 13, 8, 14, 14, 7, 7, 13, 7, 20, 14, 13,
    14, 14, 9, 11, 9, 14, 12, 18, 12, 12, 11, 14, 7, 14, 16,
];

fn sheet() -> &'static [u8] {
    static DECODED: OnceLock<Vec<u8>> = OnceLock::new();
    DECODED.get_or_init(|| {
        let mut reader = png::Decoder::new(std::io::Cursor::new(SHEET)).read_info();
        let data = reader.as_mut().ok().and_then(|reader| {
            let mut data = vec![0; reader.output_buffer_size()?];
            reader.next_frame(&mut data).ok()?;
            Some(data)
        });
        data.unwrap_or_else(|| panic!("the letters that are compiled in are no picture"))
    })
}

/// The index of a character.
fn index(letter: char) -> usize {
    let code = u32::from(letter);
    (if (32..127).contains(&code) { code - 32 } else { u32::from('?') - 32 }) as usize
}

/// Columns of a text.
pub(super) fn width(text: &str) -> usize {
    text.chars().map(|letter| usize::from(WIDTHS[index(letter)])).sum()
}

/// Calls `ink` with column, row and coverage (above 0, up to 1) of every pixel that a text touches.
pub(super) fn each_pixel(text: &str, mut ink: impl FnMut(usize, usize, f64)) {
    let (sheet, mut left) = (sheet(), 0);
    let row_length: usize = WIDTHS.iter().map(|w| usize::from(*w)).sum();
    for letter in text.chars() {
        let (index, wide) = (index(letter), usize::from(WIDTHS[index(letter)]));
        let from: usize = WIDTHS[..index].iter().map(|w| usize::from(*w)).sum();
        for row in 0..HEIGHT {
            for column in 0..wide {
                let coverage = sheet[row * row_length + from + column];
                if coverage > 0 {
                    ink(left + column, row, f64::from(coverage) / 255.0);
                }
            }
        }
        left += wide;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sheet_has_the_characters_that_the_widths_state() {
        assert_eq!(sheet().len(), HEIGHT * WIDTHS.iter().map(|w| usize::from(*w)).sum::<usize>());
        // Every character but the space has ink, within its own columns.
        for letter in (33..127u8).map(char::from) {
            let mut inked = 0.0;
            each_pixel(&letter.to_string(), |column, _, coverage| {
                assert!(column < width(&letter.to_string()));
                inked += coverage;
            });
            assert!(inked > 8.0, "{letter}: {inked}");
        }
        each_pixel(" ", |_, _, _| panic!("a space has no ink"));
        assert_eq!(width("é"), width("?"));
        assert_eq!(width("ab c"), width("a") + width("b") + width(" ") + width("c"));
    }
}
