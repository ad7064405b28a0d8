//! How bands are shown: CIE 1931 colour matching functions and linear sRGB (IEC 61966-2-1).
//! Pictures are the only use; no colour enters a result.
//!
//! A flat spectrum of radiance 1 over 380..780 nm is shown as RGB (1, 1, 1): tristimulus values are
//! divided by the integral of the y function, and the equal-energy white is adapted to the D65 white
//! of sRGB by the Bradford transform. Narrow bands lie outside the gamut of sRGB, so single weights
//! may be negative.

use std::sync::LazyLock;

use crate::math::DVec3;

/// The table: rows of wavelength in nm and x, y, z at steps of 5 nm.
const TABLE: &str = include_str!("cie1931_2deg.csv");
/// The first wavelength of the table, nm.
const FROM_NM: f64 = 380.0;
/// The last wavelength of the table, nm.
const TO_NM: f64 = 780.0;
/// The distance of its wavelengths, nm.
const STEP_NM: f64 = 5.0;
/// CIE x, y of the sRGB primaries R, G, B.
const PRIMARIES: [[f64; 2]; 3] = [[0.64, 0.33], [0.30, 0.60], [0.15, 0.06]];
/// CIE x, y of the sRGB white, D65.
const WHITE: [f64; 2] = [0.3127, 0.3290];
/// Rows of the Bradford transform from XYZ to cone responses (Lam 1985).
const BRADFORD: [DVec3; 3] = [
    DVec3::new(0.8951, 0.2664, -0.1614),
    DVec3::new(-0.7502, 1.7135, 0.0367),
    DVec3::new(0.0389, -0.0685, 1.0296),
];

static CMF: LazyLock<Vec<DVec3>> = LazyLock::new(|| {
    let rows = TABLE.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit()));
    rows.map(|row| {
        let mut numbers = row.split(',').skip(1).map(|n| n.parse().expect("the table holds numbers"));
        DVec3::from_array(std::array::from_fn(|_| numbers.next().expect("a row has four columns")))
    })
    .collect()
});

/// The colours of an experiment's bands, from their wavelengths or names.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum BandColours<'a> {
    /// Bands that are red, green and blue themselves.
    Rgb,
    /// Bands with their range of wavelengths, nm.
    Ranges(&'a [[f64; 2]]),
    /// This many bands of unknown wavelengths.
    Unknown(usize),
}

/// The linear sRGB weight of each band: a picture is the sum of its bands times these.
pub fn display_rgb(bands: BandColours) -> Vec<[f64; 3]> {
    match bands {
        BandColours::Rgb => vec![[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        BandColours::Ranges(ranges) => ranges.iter().map(|&[from, to]| band_rgb(from, to)).collect(),
        BandColours::Unknown(count) => vec![[1.0 / count as f64; 3]; count],
    }
}

/// Linear sRGB of a band of spectral radiance 1 between two wavelengths in nm.
pub fn band_rgb(from_nm: f64, to_nm: f64) -> [f64; 3] {
    let luminous = integral(FROM_NM, TO_NM);
    let cones = apply(&BRADFORD, integral(from_nm, to_nm));
    let adapted = cones / apply(&BRADFORD, luminous) * apply(&BRADFORD, white());
    xyz_to_linear_srgb(apply(&inverse(&BRADFORD), adapted).to_array())
}

/// Linear sRGB of CIE XYZ with the white of D65 at Y = 1.
pub fn xyz_to_linear_srgb(xyz: [f64; 3]) -> [f64; 3] {
    apply(&inverse(&rgb_to_xyz()), DVec3::from_array(xyz)).to_array()
}

/// The XYZ of each primary in a column, scaled so that RGB (1, 1, 1) is the white.
fn rgb_to_xyz() -> [DVec3; 3] {
    let primaries = transpose(&PRIMARIES.map(chromaticity));
    let scale = apply(&inverse(&primaries), white());
    primaries.map(|row| row * scale)
}

fn chromaticity([x, y]: [f64; 2]) -> DVec3 {
    DVec3::new(x, y, 1.0 - x - y)
}

fn white() -> DVec3 {
    chromaticity(WHITE) / WHITE[1]
}

/// The integral of the colour matching functions, linear between the table's wavelengths, over the
/// part of a range that the table covers; nm.
fn integral(from_nm: f64, to_nm: f64) -> DVec3 {
    let (from, to) = (from_nm.max(FROM_NM), to_nm.min(TO_NM));
    let steps = CMF.windows(2).enumerate().map(|(i, ends)| {
        let start = FROM_NM + STEP_NM * i as f64;
        let (low, high) = (from.max(start), to.min(start + STEP_NM));
        let middle = (0.5 * (low + high) - start) / STEP_NM;
        ends[0].lerp(ends[1], middle) * (high - low).max(0.0)
    });
    steps.sum()
}

fn apply(rows: &[DVec3; 3], v: DVec3) -> DVec3 {
    DVec3::new(rows[0].dot(v), rows[1].dot(v), rows[2].dot(v))
}

fn transpose(m: &[DVec3; 3]) -> [DVec3; 3] {
    std::array::from_fn(|i| DVec3::new(m[0][i], m[1][i], m[2][i]))
}

fn inverse(rows: &[DVec3; 3]) -> [DVec3; 3] {
    let [a, b, c] = *rows;
    let determinant = a.dot(b.cross(c));
    transpose(&[b.cross(c), c.cross(a), a.cross(b)].map(|column| column / determinant))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(a: [f64; 3], b: [f64; 3], tolerance: f64) {
        assert!((0..3).all(|i| (a[i] - b[i]).abs() < tolerance), "{a:?} {b:?}");
    }

    #[test]
    fn the_table_is_whole() {
        assert_eq!(CMF.len(), 81);
        let y = |nm: f64| CMF[((nm - FROM_NM) / STEP_NM) as usize].y;
        assert_eq!((y(555.0), y(450.0)), (1.0, 0.038));
        // Sums at 5 nm of the standard table.
        close(CMF.iter().sum::<DVec3>().to_array(), [21.3715, 21.3713, 21.3715], 1e-3);
    }

    #[test]
    fn a_flat_spectrum_is_white_and_bands_add_up() {
        close(band_rgb(380.0, 780.0), [1.0; 3], 1e-14);
        let edges = [300.0, 412.3, 433.0, 511.1, 512.2, 600.0, 703.7, 900.0];
        let ranges: Vec<_> = edges.windows(2).map(|e| [e[0], e[1]]).collect();
        let bands = display_rgb(BandColours::Ranges(&ranges));
        close(std::array::from_fn(|c| bands.iter().map(|b| b[c]).sum()), [1.0; 3], 1e-14);
        assert_eq!(band_rgb(800.0, 900.0), [0.0; 3]);
    }

    #[test]
    fn bands_show_their_colour() {
        let largest = |rgb: [f64; 3]| (0..3).max_by(|&a, &b| rgb[a].total_cmp(&rgb[b])).unwrap();
        assert_eq!(largest(band_rgb(610.0, 660.0)), 0);
        assert_eq!(largest(band_rgb(520.0, 550.0)), 1);
        assert_eq!(largest(band_rgb(440.0, 480.0)), 2);
    }

    #[test]
    fn the_matrix_is_that_of_the_standard() {
        close(xyz_to_linear_srgb([1.0, 0.0, 0.0]), [3.2406, -0.9689, 0.0557], 2e-3);
        close(xyz_to_linear_srgb([0.0, 1.0, 0.0]), [-1.5372, 1.8758, -0.2040], 2e-3);
        close(xyz_to_linear_srgb([0.0, 0.0, 1.0]), [-0.4986, 0.0415, 1.0570], 2e-3);
    }

    #[test]
    fn bands_without_wavelengths_are_grey() {
        assert_eq!(display_rgb(BandColours::Unknown(2)), vec![[0.5; 3]; 2]);
        close(display_rgb(BandColours::Rgb)[2], [0.0, 0.0, 1.0], 1e-15);
    }
}
