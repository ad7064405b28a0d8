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
    let adapted = adapt(integral(from_nm, to_nm), integral(FROM_NM, TO_NM), white());
    xyz_to_linear_srgb(adapted.to_array())
}

/// XYZ under one white as seen under another, by the Bradford transform: cone responses are scaled from
/// those of the first white to those of the second.
fn adapt(xyz: DVec3, from: DVec3, to: DVec3) -> DVec3 {
    let cones = apply(&BRADFORD, xyz);
    apply(&inverse(&BRADFORD), cones / apply(&BRADFORD, from) * apply(&BRADFORD, to))
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

    /// Columns of the matrix from XYZ to linear sRGB, CSS Color Module Level 4, section 18, and of its
    /// inverse: Y of the primaries is 0.2126, 0.7152, 0.0722.
    #[test]
    fn the_matrix_is_that_of_the_standard() {
        let columns = [
            ([1.0, 0.0, 0.0], [3.2409699419045226, -0.9692436362808796, 0.05563007969699366]),
            ([0.0, 1.0, 0.0], [-1.537383177570094, 1.8759675015077202, -0.20397695888897652]),
            ([0.0, 0.0, 1.0], [-0.4986107602930034, 0.04155505740717559, 1.0569715142428786]),
        ];
        for (xyz, expected) in columns {
            close(xyz_to_linear_srgb(xyz), expected, 1e-12);
        }
        close(
            rgb_to_xyz()[1].to_array(),
            [0.21263900587151027, 0.715168678767756, 0.0721923153607337],
            1e-12,
        );
        for rgb in [DVec3::X, DVec3::Y, DVec3::Z] {
            close(xyz_to_linear_srgb(apply(&rgb_to_xyz(), rgb).to_array()), rgb.to_array(), 1e-14);
        }
    }

    /// From D65 to D50, B. Lindbloom, "Chromatic Adaptation" (columns of his matrix, to 7 digits, for
    /// the whites of ASTM E308-01), and back again.
    #[test]
    fn whites_are_adapted_as_published() {
        let (d65, d50) = (DVec3::new(0.95047, 1.0, 1.08883), DVec3::new(0.96422, 1.0, 0.82521));
        let columns = [
            (DVec3::X, [1.0478112, 0.0295424, -0.0092345]),
            (DVec3::Y, [0.0228866, 0.9904844, 0.0150436]),
            (DVec3::Z, [-0.0501270, -0.0170491, 0.7521316]),
        ];
        for (xyz, expected) in columns {
            close(adapt(xyz, d65, d50).to_array(), expected, 1e-7);
            close(adapt(adapt(xyz, d65, d50), d50, d65).to_array(), xyz.to_array(), 1e-14);
        }
        close(adapt(d65, d65, d50).to_array(), d50.to_array(), 1e-14);
    }

    #[test]
    fn bands_without_wavelengths_are_grey() {
        assert_eq!(display_rgb(BandColours::Unknown(2)), vec![[0.5; 3]; 2]);
        close(display_rgb(BandColours::Rgb)[2], [0.0, 0.0, 1.0], 1e-15);
    }
}
