//! Rules of the body: shape, boundary, medium.

use super::{At, one_per_band, spectrum, value_rule};
use crate::experiment::resolve::{BandInterval, BandMedium, eta_materials};
use crate::experiment::schema::{
    BandsEntry, BoundaryEntry, Coefficients, Eta, EtaFormula, MediumEntry, PresetMedium, ShapeEntry,
    SkinFractions, Spectrum,
};
use crate::experiment::suggest;
use crate::optics::materials;

/// The rules of the body in the bands.
pub(crate) fn object(at: At, bands: &BandsEntry) {
    let list = bands.list();
    let body: Option<ShapeEntry> = at.typed("shape");
    if let Some(body) = &body {
        shape(at.to("shape"), body);
    }
    if let Some(surface) = at.typed("boundary") {
        boundary(at.to("boundary"), &surface, &list);
    }
    if let Some(inside) = at.typed("medium") {
        medium(at.to("medium"), &inside, bands);
        if matches!(body, Some(ShapeEntry::HalfSpace {})) {
            conservative(at.to("medium"), &inside, &list);
            bounded(at.to("medium"), &inside, &list);
        }
    }
}

/// Whether the medium of a body emits in some band.
pub(crate) fn emits(at: At) -> bool {
    let medium: Option<MediumEntry> = at.typed("medium");
    medium.is_some_and(|medium| medium.emission(1).iter().any(|emission| *emission > 0.0))
}

fn shape(at: At, shape: &ShapeEntry) {
    match shape {
        ShapeEntry::Box { size_mm } => positive(at.to("box").to("size_mm"), size_mm),
        ShapeEntry::DrilledBox { size_mm, .. } => positive(at.to("drilled_box").to("size_mm"), size_mm),
        ShapeEntry::Mesh { longest_side_mm: Some(_), unit: Some(_), .. } => {
            at.to("mesh").to("unit").report_help(
                "`unit` has no effect: `longest_side_mm` states the size of the mesh",
                "leave one of the two out",
            );
        }
        ShapeEntry::Torus { major_radius_mm, minor_radius_mm, .. } => {
            let at = at.to("torus").to("minor_radius_mm");
            less(at, *minor_radius_mm, "major_radius_mm", *major_radius_mm);
        }
        ShapeEntry::CavitySphere { radius_mm, cavity_radius_mm, .. } => {
            let at = at.to("cavity_sphere").to("cavity_radius_mm");
            less(at, *cavity_radius_mm, "radius_mm", *radius_mm);
        }
        _ => {}
    }
}

fn less(at: At, value: f64, key: &str, bound: f64) {
    if value >= bound {
        at.report(format!("must be less than `{key}`, is {value} of {bound}"));
    }
}

fn positive(at: At, values: &[f64]) {
    for (i, value) in values.iter().enumerate() {
        value_rule(at.item(i), *value, "greater than 0", |x| x > 0.0);
    }
}

fn boundary(at: At, boundary: &BoundaryEntry, bands: &[BandInterval]) {
    match boundary {
        BoundaryEntry::Smooth { eta: index } => eta(at.to("smooth").to("eta"), index, bands),
        BoundaryEntry::Rough { eta: index, .. } => {
            let at = at.to("rough").to("eta");
            eta(at, index, bands);
            // Without refraction no facet is told from another: the half-vector has no direction.
            if index.per_band(bands).is_ok_and(|values| values.contains(&1.0)) {
                let help = "use `object.boundary.matched`, or an index other than 1 in every band";
                at.report_help("a rough boundary needs an index other than 1", help);
            }
        }
        BoundaryEntry::Matched {} => {}
    }
}

fn eta(at: At, index: &Eta, bands: &[BandInterval]) {
    match index {
        Eta::Grey(value) => value_rule(at, *value, "greater than 0", |x| x > 0.0),
        Eta::PerBand(values) => {
            one_per_band(at, values.len(), bands.len());
            positive(at, values);
        }
        Eta::Formula(EtaFormula::Material(name)) if !eta_materials().contains(&name.as_str()) => {
            let help = suggest::help(name, &eta_materials(), "materials");
            at.to("material").report_help(format!("unknown material `{name}`"), help);
        }
        Eta::Formula(EtaFormula::Sellmeier { b, c_um2 }) if b.len() != c_um2.len() => {
            let counts = format!("`b` has {} entries, `c_um2` has {}", b.len(), c_um2.len());
            at.to("sellmeier").to("c_um2").report(counts);
        }
        Eta::Formula(_) => {
            if let Err(why) = index.per_band(bands) {
                at.report(why);
            }
        }
    }
}

fn medium(at: At, medium: &MediumEntry, bands: &BandsEntry) {
    let count = bands.list().len();
    if let Some(given) = &medium.coefficients {
        coefficients(at.to("coefficients"), given, count);
    }
    if let Some(words) = &medium.skin {
        skin(at.to("skin"), words, &bands.list());
    }
    if let Some(PresetMedium { name, upsampling, .. }) = &medium.preset {
        let at = at.to("preset");
        if materials::find(name).is_none() {
            let help = suggest::help(name, &materials::names(), "materials");
            at.to("name").report_help(format!("unknown material `{name}`"), help);
        }
        let is_rgb = matches!(bands, BandsEntry::Rgb {});
        match upsampling {
            None if !is_rgb => at.report_help(
                "built-in materials are measured in rgb bands only",
                "use `bands = { rgb = {} }`, add `upsampling = \"smooth\"` here, or give \
                 `medium.coefficients` with numbers per band",
            ),
            Some(_) if is_rgb => at.to("upsampling").report_help(
                "`upsampling` is for bands of wavelengths, and these are R, G and B",
                "leave it out",
            ),
            Some(_) => wavelengths(at.to("upsampling"), &bands.list()),
            None => {}
        }
    }
    if let Some(values) = &medium.emission_per_mm {
        spectrum(at.to("emission_per_mm"), values, count, "at least 0", |x| x >= 0.0);
    }
}

/// Every band has wavelengths, as upsampling needs.
pub(super) fn wavelengths(at: At, bands: &[BandInterval]) {
    if let Some(band) = bands.iter().find(|band| band.range_nm.is_none()) {
        at.report_help(
            format!("`upsampling` needs wavelengths, and band `{}` has none", band.name),
            "use `bands.spectral`, or explicit bands with `from_nm` and `to_nm`",
        );
    }
}

fn skin(at: At, words: &SkinFractions, bands: &[BandInterval]) {
    if words.melanin + words.blood > 1.0 {
        at.to("blood").report("`melanin` and `blood` are volume fractions: their sum is at most 1");
    }
    let [from, to] = crate::optics::skin::RANGE_NM;
    let is_known = |band: &BandInterval| band.range_nm.is_some_and(|[a, b]| a >= from && b <= to);
    if let Some(band) = bands.iter().find(|band| !is_known(band)) {
        at.key().report_help(
            format!("skin is known from {from} to {to} nm, and band `{}` is not within", band.name),
            "use `bands.spectral`, or explicit bands with `from_nm` and `to_nm`",
        );
    }
}

/// The pairs of keys that define a medium.
const PAIRS: [[&str; 2]; 3] = [
    ["sigma_t_per_mm", "albedo"],
    ["sigma_a_per_mm", "sigma_s_per_mm"],
    ["sigma_a_per_mm", "reduced_sigma_s_per_mm"],
];

fn coefficients(at: At, given: &Coefficients, bands: usize) {
    let named: [(&str, &Option<Spectrum>); 5] = [
        ("sigma_t_per_mm", &given.sigma_t_per_mm),
        ("albedo", &given.albedo),
        ("sigma_a_per_mm", &given.sigma_a_per_mm),
        ("sigma_s_per_mm", &given.sigma_s_per_mm),
        ("reduced_sigma_s_per_mm", &given.reduced_sigma_s_per_mm),
    ];
    let keys: Vec<&str> = named.iter().filter(|(_, s)| s.is_some()).map(|(key, _)| *key).collect();
    if !PAIRS.iter().any(|pair| keys == pair) {
        let pairs = PAIRS.map(|[a, b]| format!("(`{a}`, `{b}`)")).join(", ");
        let found = if keys.is_empty() { "none".into() } else { suggest::quoted(&keys) };
        at.report_help(format!("exactly one pair of coefficients is needed, found {found}"), pairs);
    }
    for (key, values) in named {
        let Some(values) = values else { continue };
        match key {
            "albedo" => {
                spectrum(at.to(key), values, bands, "between 0 and 1", |x| (0.0..=1.0).contains(&x))
            }
            _ => spectrum(at.to(key), values, bands, "at least 0", |x| x >= 0.0),
        }
    }
    spectrum(at.to("g"), &given.g, bands, "between -1 and 1, both excluded", |g| g.abs() < 1.0);
}

/// Without absorption a walk in a half-space returns surely, but after infinitely many steps on average.
fn conservative(at: At, medium: &MediumEntry, bands: &[BandInterval]) {
    let key = match &medium.coefficients {
        Some(given) if given.albedo.is_some() => "albedo",
        _ => "sigma_a_per_mm",
    };
    let Some(coefficients) = medium.per_band(bands) else { return };
    let lossless = |(c, _): &(&BandMedium, &BandInterval)| c.sigma_a == 0.0 && c.sigma_s > 0.0;
    if let Some((_, band)) = coefficients.iter().zip(bands).find(lossless) {
        at.to("coefficients").to(key).report_help(
            "a conservative half-space has walks of infinite mean length",
            format!("band `{}` absorbs nothing: let it absorb a little, or use a slab", band.name),
        );
    }
}

/// What a half-space without extinction emits towards its surface adds up without end.
fn bounded(at: At, medium: &MediumEntry, bands: &[BandInterval]) {
    let Some(coefficients) = medium.per_band(bands) else { return };
    let emission = medium.emission(bands.len());
    let endless = |(c, emission): (&BandMedium, &f64)| c.sigma_a + c.sigma_s == 0.0 && *emission > 0.0;
    if let Some(band) = coefficients.iter().zip(&emission).position(endless) {
        at.to("emission_per_mm").report_help(
            "a half-space that emits and does not absorb has infinite radiance",
            format!("band `{}` absorbs nothing: let it absorb, or use a slab", bands[band].name),
        );
    }
}
