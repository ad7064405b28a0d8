//! What the entries of a file mean: values per band, coefficients.

use super::schema::{
    BandsEntry, Coefficients, Eta, EtaFormula, ExperimentFile, MediumEntry, PresetMedium, Spectrum,
    Upsampling,
};
use crate::optics::colour::{self, BandColours};
use crate::optics::dispersion::{self, Dispersion};
use crate::optics::{materials, upsampling};

/// One wavelength band.
#[derive(Clone, Debug, PartialEq)]
pub struct BandInterval {
    /// Its name in tables.
    pub name: String,
    /// From and to, nm, where they are known.
    pub range_nm: Option<[f64; 2]>,
}

/// The medium in one band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandMedium {
    /// Absorption, 1/mm.
    pub sigma_a: f64,
    /// Scattering, 1/mm.
    pub sigma_s: f64,
    /// Mean cosine of the phase function.
    pub g: f64,
}

impl ExperimentFile {
    /// The bands in order; none without a scene.
    pub fn band_list(&self) -> Vec<BandInterval> {
        self.bands.as_ref().map(BandsEntry::list).unwrap_or_default()
    }
}

impl BandsEntry {
    /// The bands in order. Bins of a range are named by it, as `400-420nm`.
    pub fn list(&self) -> Vec<BandInterval> {
        match self {
            BandsEntry::Rgb {} => {
                ["R", "G", "B"].map(|name| BandInterval { name: name.into(), range_nm: None }).to_vec()
            }
            BandsEntry::Spectral { from_nm, to_nm, count } => {
                let edge = |i: usize| from_nm + (to_nm - from_nm) * (i as f64 / *count as f64);
                let bins = (0..*count).map(|i| [edge(i), edge(i + 1)]);
                bins.map(|[from, to]| BandInterval {
                    name: format!("{}-{}nm", rounded(from), rounded(to)),
                    range_nm: Some([from, to]),
                })
                .collect()
            }
            BandsEntry::Explicit(list) => {
                let range = |from: Option<f64>, to: Option<f64>| Some([from?, to?]);
                list.iter()
                    .map(|b| BandInterval { name: b.name.clone(), range_nm: range(b.from_nm, b.to_nm) })
                    .collect()
            }
        }
    }

    /// The linear sRGB weight of each band in pictures.
    pub fn display_rgb(&self) -> Vec<[f64; 3]> {
        let bands = self.list();
        let ranges: Option<Vec<[f64; 2]>> = bands.iter().map(|band| band.range_nm).collect();
        colour::display_rgb(match (self, &ranges) {
            (BandsEntry::Rgb {}, _) => BandColours::Rgb,
            (_, Some(ranges)) => BandColours::Ranges(ranges),
            (_, None) => BandColours::Unknown(bands.len()),
        })
    }
}

/// A wavelength to thousandths of a nm, so that names of bins stay short and unique.
fn rounded(nm: f64) -> f64 {
    (nm * 1000.0).round() / 1000.0
}

impl Spectrum {
    /// A value for each of `count` bands; a list is taken as it is.
    pub fn values(&self, count: usize) -> Vec<f64> {
        match self {
            Spectrum::Grey(value) => vec![*value; count],
            Spectrum::PerBand(values) => values.clone(),
        }
    }
}

impl Eta {
    /// The index in each band, at the middle wavelength of the band where it disperses.
    ///
    /// # Errors
    /// Why there is none: bands without wavelengths, a formula that is not real, an unknown name.
    pub fn per_band(&self, bands: &[BandInterval]) -> Result<Vec<f64>, String> {
        let formula = match self {
            Eta::Grey(eta) => return Ok(vec![*eta; bands.len()]),
            Eta::PerBand(list) => return Ok(list.clone()),
            Eta::Formula(EtaFormula::Material(name)) => match materials::find(name) {
                Some(material) => return Ok(vec![material.eta; bands.len()]),
                None => dispersion::glass(name).ok_or(format!("unknown material `{name}`"))?,
            },
            Eta::Formula(EtaFormula::Cauchy { a, b_um2, c_um4 }) => {
                Dispersion::Cauchy { a: *a, b_um2: *b_um2, c_um4: *c_um4 }
            }
            Eta::Formula(EtaFormula::Sellmeier { b, c_um2 }) => {
                Dispersion::Sellmeier { terms: b.iter().zip(c_um2).map(|(b, c)| [*b, *c]).collect() }
            }
        };
        bands.iter().map(|band| dispersed(&formula, band)).collect()
    }
}

fn dispersed(formula: &Dispersion, band: &BandInterval) -> Result<f64, String> {
    let [from, to] = band.range_nm.ok_or(format!(
        "dispersion needs wavelengths, and band `{}` has none: use `bands.spectral`, or explicit bands \
         with `from_nm` and `to_nm`",
        band.name
    ))?;
    let middle = 0.5 * (from + to);
    formula.eta(middle).ok_or(format!("the formula gives no positive real index at {middle} nm"))
}

/// The names that `eta = { material = NAME }` takes.
pub(crate) fn eta_materials() -> Vec<&'static str> {
    materials::names().into_iter().chain(dispersion::GLASSES.iter().map(|glass| glass.name)).collect()
}

impl MediumEntry {
    /// The coefficients in each band; none where a name is unknown, no pair is whole, or wavelengths are
    /// needed and missing.
    pub fn per_band(&self, bands: &[BandInterval]) -> Option<Vec<BandMedium>> {
        if let Some(words) = &self.skin {
            let g = words.g.unwrap_or(0.0);
            let band = |band: &BandInterval| {
                let (sigma_a, reduced) = words.band(band.range_nm?);
                Some(BandMedium { sigma_a, sigma_s: reduced / (1.0 - g), g })
            };
            bands.iter().map(band).collect()
        } else if let Some(PresetMedium { name, scale, g, upsampling }) = &self.preset {
            let material = materials::find(name)?;
            let g = g.unwrap_or(0.0);
            if let (Some(Upsampling::Smooth), Some(_)) = (upsampling, bands.first()?.range_nm) {
                let band = |band: &BandInterval| {
                    let weights = upsampling::band_weights(band.range_nm?);
                    let mean = |rgb: [f64; 3]| weights.iter().zip(rgb).map(|(w, x)| w * x).sum::<f64>();
                    Some(BandMedium {
                        sigma_a: mean(material.sigma_a) * scale,
                        sigma_s: mean(material.reduced_sigma_s) * scale / (1.0 - g),
                        g,
                    })
                };
                return bands.iter().map(band).collect();
            }
            let band = |(s, a): (&f64, &f64)| BandMedium {
                sigma_a: a * scale,
                sigma_s: s * scale / (1.0 - g),
                g,
            };
            Some(material.reduced_sigma_s.iter().zip(&material.sigma_a).map(band).collect())
        } else {
            self.coefficients.as_ref()?.per_band(bands.len())
        }
    }

    /// Emission in each of `count` bands, W/(mm^2 sr) per mm.
    pub fn emission(&self, count: usize) -> Vec<f64> {
        self.emission_per_mm.as_ref().map_or(vec![0.0; count], |values| values.values(count))
    }
}

impl Coefficients {
    fn per_band(&self, count: usize) -> Option<Vec<BandMedium>> {
        let g = self.g.values(count);
        let values = |spectrum: &Option<Spectrum>| spectrum.as_ref().map(|s| s.values(count));
        let absorption = values(&self.sigma_a_per_mm);
        let (sigma_a, sigma_s): (Vec<f64>, Vec<f64>) =
            if let (Some(t), Some(albedo)) = (values(&self.sigma_t_per_mm), values(&self.albedo)) {
                let absorbed = t.iter().zip(&albedo).map(|(t, w)| t * (1.0 - w));
                (absorbed.collect(), t.iter().zip(&albedo).map(|(t, w)| t * w).collect())
            } else if let Some(reduced) = values(&self.reduced_sigma_s_per_mm) {
                (absorption?, reduced.iter().zip(&g).map(|(s, g)| s / (1.0 - g)).collect())
            } else {
                (absorption?, values(&self.sigma_s_per_mm)?)
            };
        let bands = sigma_a.into_iter().zip(sigma_s).zip(g);
        Some(bands.map(|((sigma_a, sigma_s), g)| BandMedium { sigma_a, sigma_s, g }).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_cover_the_range() {
        let bands = BandsEntry::Spectral { from_nm: 400.0, to_nm: 700.0, count: 4 }.list();
        assert_eq!(bands[1], BandInterval { name: "475-550nm".into(), range_nm: Some([475.0, 550.0]) });
        assert_eq!(bands[3].range_nm.unwrap()[1], 700.0);
    }

    #[test]
    fn pairs_of_coefficients_say_the_same() {
        let grey = |x| Some(Spectrum::Grey(x));
        let none = Coefficients {
            sigma_t_per_mm: None,
            albedo: None,
            sigma_a_per_mm: None,
            sigma_s_per_mm: None,
            reduced_sigma_s_per_mm: None,
            g: Spectrum::Grey(0.5),
        };
        let expected = vec![BandMedium { sigma_a: 1.0, sigma_s: 3.0, g: 0.5 }; 2];
        let total = Coefficients { sigma_t_per_mm: grey(4.0), albedo: grey(0.75), ..none.clone() };
        let parts =
            Coefficients { sigma_a_per_mm: grey(1.0), sigma_s_per_mm: grey(3.0), ..none.clone() };
        let reduced = Coefficients {
            sigma_a_per_mm: grey(1.0),
            reduced_sigma_s_per_mm: grey(1.5),
            ..none.clone()
        };
        let two = BandsEntry::Rgb {}.list()[..2].to_vec();
        for coefficients in [total, parts, reduced] {
            let medium = MediumEntry { coefficients: Some(coefficients), ..MediumEntry::default() };
            assert_eq!(medium.per_band(&two), Some(expected.clone()));
        }
        assert_eq!(none.per_band(2), None);
        let preset = PresetMedium { name: "skin1".into(), scale: 2.0, g: Some(0.5), upsampling: None };
        let preset = MediumEntry { preset: Some(preset), ..MediumEntry::default() };
        let red = preset.per_band(&BandsEntry::Rgb {}.list()).unwrap()[0];
        assert_eq!(red, BandMedium { sigma_a: 0.064, sigma_s: 2.96, g: 0.5 });
    }
}
