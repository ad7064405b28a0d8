//! The content of experiment files. The types below are the only definition: `scatterproof schema` prints the
//! JSON Schema that they generate, and `validate` checks a file against the same schema. Keys contain units.
//! Physical quantities have no defaults; options of a run have.
//!
//! A file has a scene with estimators, or samplers, or both; `rules` defines which keys belong together.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub(crate) use super::claim_words::{
    Agree, ClaimEntry, Differs, Equals, Expect, MeanPathLength, SamplerClaim,
};
pub(crate) use super::direction::Direction;
pub(crate) use super::duel::{CONTROL, CostMeasure, Faster};
use super::picture::PictureEntry;
pub(crate) use super::sensor::SensorEntry;
pub(crate) use crate::optics::microfacet::MicrofacetKind;
pub(crate) use crate::optics::skin::SkinFractions;

/// One experiment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExperimentFile {
    /// Name of the experiment and of its folder under `results/`: letters, digits, `-`, `_`.
    #[schemars(regex(pattern = r"^[A-Za-z0-9][A-Za-z0-9_-]*$"))]
    pub name: String,
    /// What the experiment shows, for reports.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub description: Option<String>,
    /// Root of all random streams, to draw another sample.
    /// By default the streams depend on the name and content of the experiment alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0, max = 9223372036854775807u64))]
    pub seed: Option<u64>,
    /// A text that enters the name of every stream, as `verify --fresh-seed` sets it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fresh: Option<String>,
    /// The wavelength bands; each is rendered separately.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bands: Option<BandsEntry>,
    /// The body: shape, boundary and medium.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub object: Option<Object>,
    /// The sensor, which defines what is measured.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensor: Option<SensorEntry>,
    /// The lights, all switched on; none is needed if the medium emits.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub light: Vec<LightEntry>,
    /// The estimators that are compared.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub estimator: Vec<EstimatorEntry>,
    /// Whether an estimator runs only in the cells in which a claim names it; by default it runs in all.
    /// Cells without a claim stay empty.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub only_claimed: bool,
    /// Axes of the sweep; they multiply.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub sweep: Vec<Sweep>,
    /// Cells that share random streams.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pair: Option<PairEntry>,
    /// Number of passes, or CPU time, of every measurement.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget: Option<Budget>,
    /// Runs that take less than the whole budget; all others take all of it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub budget_share: Vec<BudgetShare>,
    /// Draws per sampler.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 1000, max = 10000000000u64))]
    pub samples: Option<u64>,
    /// The samplers whose draws are compared with the densities that they claim.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schemars(length(min = 1))]
    pub sampler: Vec<SamplerEntry>,
    /// Claims that `verify` tests.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub claim: Vec<ClaimEntry>,
    /// Pictures beside those of every run.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub picture: Vec<PictureEntry>,
    /// Named sets of overrides, chosen by `--setting NAME`: dotted key -> value. Tables in braces are
    /// values; other tables only group keys.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub setting: BTreeMap<String, BTreeMap<String, Value>>,
    /// How pictures are displayed; never changes a number.
    #[serde(default)]
    pub display: Display,
}

/// How the spectrum is divided into wavelength bands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BandsEntry {
    /// Three bands R, G, B without wavelengths.
    Rgb {},
    /// Equal bins over a range of wavelengths.
    Spectral {
        /// Lower end, nm.
        #[schemars(range(min = 100.0, max = 100000.0))]
        from_nm: f64,
        /// Upper end, nm.
        #[schemars(range(min = 100.0, max = 100000.0))]
        to_nm: f64,
        /// Number of bins.
        #[schemars(range(min = 1, max = 1024))]
        count: usize,
    },
    /// A list of 1 to 1024 named bands.
    Explicit(#[schemars(length(min = 1, max = 1024))] Vec<ExplicitBand>),
}

/// One band of an explicit list.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct ExplicitBand {
    /// Its name, unique in the list.
    #[schemars(length(min = 1))]
    pub name: String,
    /// Lower wavelength, nm; needed by dispersion formulas and for colour.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 100.0, max = 100000.0))]
    pub from_nm: Option<f64>,
    /// Upper wavelength, nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 100.0, max = 100000.0))]
    pub to_nm: Option<f64>,
}

/// A value per band: one number for all of them, or a list with one number per band.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Spectrum {
    /// The same in every band.
    Grey(f64),
    /// One number per band, in the order of the bands.
    PerBand(Vec<f64>),
}

/// The body: a shape, its boundary, the medium in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Object {
    /// Geometry of the body.
    pub shape: ShapeEntry,
    /// Refractive surface of the body.
    pub boundary: BoundaryEntry,
    /// The homogeneous medium inside.
    pub medium: MediumEntry,
}

/// Geometry, mm. Bodies are at the origin; the top face of `half_space` and `slab` is z = 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ShapeEntry {
    /// Everything below z = 0.
    HalfSpace {},
    /// -thickness <= z <= 0.
    Slab {
        /// Thickness, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        thickness_mm: f64,
    },
    /// An axis-aligned box about the origin.
    Box {
        /// Edge lengths along x, y, z, mm; positive.
        size_mm: [f64; 3],
    },
    /// A sphere about the origin, exact.
    Sphere {
        /// Radius, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_mm: f64,
    },
    /// A closed triangle mesh from a Wavefront OBJ or a PLY file.
    Mesh {
        /// Path, relative to the experiment file.
        path: String,
        /// Axis of the file that points up, to +z; by default z.
        ///
        /// From y the mesh is turned about x: y becomes z, z becomes -y.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        up: Option<UpAxis>,
        /// Unit of the file's numbers; by default mm.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        unit: Option<LengthUnit>,
        /// Scales the longest side of the bounding box to this, and centres the box at the origin.
        /// By default the mesh keeps its size and place.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        longest_side_mm: Option<f64>,
        /// Turns about x, then y, then z, degrees, counter-clockwise as seen from the tip of the axis.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        rotate_deg: Option<[f64; 3]>,
        /// Shift after everything else, mm.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        translate_mm: Option<[f64; 3]>,
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A sphere of 20 * 4^subdivisions triangles.
    Icosphere {
        /// Radius, mm; vertices lie on it.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_mm: f64,
        /// Number of subdivisions of the icosahedron.
        #[schemars(range(min = 0, max = 9))]
        subdivisions: u32,
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A sphere displaced along its radius by amplitude * sin(kx) sin(ky) sin(kz) of the unit vector.
    BumpySphere {
        /// Mean radius, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_mm: f64,
        /// Number of subdivisions of the icosahedron.
        #[schemars(range(min = 0, max = 9))]
        subdivisions: u32,
        /// Largest displacement as a fraction of the radius.
        #[schemars(range(min = 0.0, max = 0.5))]
        amplitude: f64,
        /// Wavenumber k per radius.
        #[schemars(range(min = 0.0, max = 1000.0))]
        wavenumber: f64,
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A sphere displaced along its radius by irregular hollows and lumps of four scales, like a scan.
    LumpySphere {
        /// Mean radius, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_mm: f64,
        /// Number of subdivisions of the icosahedron.
        #[schemars(range(min = 0, max = 9))]
        subdivisions: u32,
        /// Bound of the displacement as a fraction of the radius.
        #[schemars(range(min = 0.0, max = 0.5))]
        amplitude: f64,
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A torus about the z axis.
    Torus {
        /// Radius of the ring, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        major_radius_mm: f64,
        /// Radius of the tube, mm; smaller than the ring's.
        #[schemars(extend("exclusiveMinimum" = 0))]
        minor_radius_mm: f64,
        /// Segments around the ring and around the tube.
        #[schemars(inner(range(min = 3, max = 4096)))]
        segments: [u32; 2],
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A sphere with a concentric empty cavity.
    CavitySphere {
        /// Outer radius, mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        radius_mm: f64,
        /// Radius of the cavity, mm; smaller than the outer one.
        #[schemars(extend("exclusiveMinimum" = 0))]
        cavity_radius_mm: f64,
        /// Number of subdivisions of both icosahedra.
        #[schemars(range(min = 0, max = 9))]
        subdivisions: u32,
        /// Normals with which the boundary reflects and refracts.
        normals: NormalsEntry,
    },
    /// A box with square holes through it along z.
    DrilledBox {
        /// Edge lengths along x, y, z, mm; positive.
        size_mm: [f64; 3],
        /// Number of holes along x and y.
        #[schemars(inner(range(min = 1, max = 64)))]
        holes: [u32; 2],
        /// Side of a hole as a fraction of the distance between hole centres.
        #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 1))]
        hole_fraction: f64,
    },
}

/// Axis of a file that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UpAxis {
    /// The convention of most modelling programs.
    Y,
    /// The convention of this program.
    Z,
}

/// Unit of a file's lengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LengthUnit {
    /// Micrometres.
    Um,
    /// Millimetres.
    Mm,
    /// Centimetres.
    Cm,
    /// Metres.
    M,
    /// Inches of 25.4 mm.
    Inch,
}

impl LengthUnit {
    /// Its length, mm.
    pub(crate) fn mm(self) -> f64 {
        match self {
            LengthUnit::Um => 0.001,
            LengthUnit::Mm => 1.0,
            LengthUnit::Cm => 10.0,
            LengthUnit::M => 1000.0,
            LengthUnit::Inch => 25.4,
        }
    }
}

/// How R, G and B become values in bands of wavelengths.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Upsampling {
    /// Smooth weights over wavelength with sum 1; the spectrum is displayed as the colour from which it is made.
    Smooth,
}

/// Which normal the boundary of a mesh sees.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum NormalsEntry {
    /// Geometric normal of the triangle.
    Flat,
    /// Interpolated between vertex normals (the file's, or else angle-weighted).
    Interpolated,
}

/// The refractive surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum BoundaryEntry {
    /// A smooth dielectric.
    Smooth {
        /// Refractive index inside over outside.
        eta: Eta,
    },
    /// A rough dielectric of microfacets with separable Smith masking (Walter et al. 2007).
    Rough {
        /// Distribution of microfacet normals.
        distribution: MicrofacetKind,
        /// Roughness alpha of the microfacet distribution.
        #[schemars(range(min = 0.0001, max = 1.0))]
        alpha: f64,
        /// Refractive index inside over outside.
        eta: Eta,
    },
    /// No surface: the same index inside and outside.
    Matched {},
}

/// A relative refractive index.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Eta {
    /// The same in every band.
    Grey(f64),
    /// One value per band.
    PerBand(Vec<f64>),
    /// By formula or from a built-in material.
    Formula(EtaFormula),
}

/// Dispersion formulas; they take the middle wavelength of a band.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum EtaFormula {
    /// n = a + b/l^2 + c/l^4, l in um.
    Cauchy {
        /// Constant term.
        a: f64,
        /// Coefficient of l^-2, um^2.
        b_um2: f64,
        /// Coefficient of l^-4, um^4.
        #[serde(default)]
        c_um4: f64,
    },
    /// n^2 = 1 + sum_i b_i l^2 / (l^2 - c_i), l in um.
    Sellmeier {
        /// Oscillator strengths b_i.
        #[schemars(length(min = 1))]
        b: Vec<f64>,
        /// Squared resonance wavelengths, um^2.
        c_um2: Vec<f64>,
    },
    /// The index of a built-in material (`scatterproof list`).
    Material(String),
}

/// The medium: exactly one of `coefficients`, `preset`, `skin`; and what it emits.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["coefficients"] }, { "required": ["preset"] }, { "required": ["skin"] }]))]
pub struct MediumEntry {
    /// Explicit coefficients.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub coefficients: Option<Coefficients>,
    /// A built-in measured material (`scatterproof list`), for rgb bands, or for others by `upsampling`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub preset: Option<PresetMedium>,
    /// Skin defined by its constituents (Donner & Jensen 2006), for spectral bands within 380 to 780 nm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub skin: Option<SkinFractions>,
    /// Radiance that a ray gains per length by emission, W/(mm^2 sr) per mm; by default 0.
    ///
    /// The same in every direction.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub emission_per_mm: Option<Spectrum>,
}

/// A built-in measured material.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PresetMedium {
    /// Name of the built-in entry.
    pub name: String,
    /// Multiplies both coefficients: 2 is a body twice as large.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub scale: f64,
    /// Mean cosine; sigma_s = sigma_s' / (1 - g). By default g = 0 and sigma_s = sigma_s'.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = -1, "exclusiveMaximum" = 1))]
    pub g: Option<f64>,
    /// How bands of wavelengths take their coefficients from those of R, G and B; required for such bands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upsampling: Option<Upsampling>,
}

/// Coefficients: exactly one of the pairs (`sigma_t_per_mm`, `albedo`), (`sigma_a_per_mm`,
/// `sigma_s_per_mm`), (`sigma_a_per_mm`, `reduced_sigma_s_per_mm`), and `g`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Coefficients {
    /// Extinction, 1/mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_t_per_mm: Option<Spectrum>,
    /// sigma_s / sigma_t, 0 to 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub albedo: Option<Spectrum>,
    /// Absorption, 1/mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_a_per_mm: Option<Spectrum>,
    /// Scattering, 1/mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma_s_per_mm: Option<Spectrum>,
    /// Reduced scattering sigma_s (1 - g), 1/mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub reduced_sigma_s_per_mm: Option<Spectrum>,
    /// Mean cosine of the Henyey-Greenstein phase function, -1 < g < 1; 0 is isotropic.
    pub g: Spectrum,
}

/// One light: an optional name and exactly one kind.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["directional"] }, { "required": ["solid_angle"] }, { "required": ["environment"] }]))]
pub struct LightEntry {
    /// Name in observables (`mean@sun`); by default `light_1`, `light_2`, ...
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Parallel light.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub directional: Option<Directional>,
    /// A disc of directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solid_angle: Option<SolidAngle>,
    /// All directions.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
}

/// Parallel light.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Directional {
    /// From the scene towards the light.
    pub toward: Direction,
    /// Irradiance on a plane that faces the light, W/mm^2.
    pub irradiance: Spectrum,
}

/// A disc of directions of uniform radiance; exactly one of `radiance`, `irradiance`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["radiance"] }, { "required": ["irradiance"] }]))]
pub struct SolidAngle {
    /// From the scene towards the middle of the disc.
    pub toward: Direction,
    /// Solid angle of the disc, sr.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 12.566370614359172))]
    pub solid_angle_sr: f64,
    /// Radiance, W/(mm^2 sr).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Spectrum>,
    /// Irradiance on a plane that faces the middle; the disc must be smaller than a hemisphere.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub irradiance: Option<Spectrum>,
}

/// Light from all directions; exactly one of `radiance`, `map`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["radiance"] }, { "required": ["map"] }]))]
pub struct Environment {
    /// Constant radiance, W/(mm^2 sr).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radiance: Option<Spectrum>,
    /// Light comes only from directions with a positive cosine to this axis (a slab lit on one face).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub hemisphere: Option<[f64; 3]>,
    /// Latitude-longitude map, OpenEXR or Radiance HDR, relative to the experiment file; +z is up, the
    /// middle column is +x. Channels R, G, B for rgb bands, Y for any bands, else a channel named like each
    /// band, or `upsampling`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub map: Option<String>,
    /// Turns the map about z, degrees, counter-clockwise from above, to the nearest column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotate_deg: Option<f64>,
    /// How bands of wavelengths take their radiance from R, G and B; required for such bands if the map has
    /// no channel of each band.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub upsampling: Option<Upsampling>,
    /// Factor on the radiance of the map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.0))]
    pub scale: Option<f64>,
}

/// One estimator: a unique `name` and exactly one kind with its options, as `path = {}`.
/// The kinds are those that the program registers (`scatterproof list`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EstimatorEntry {
    /// Name in tables and claims, unique.
    #[schemars(length(min = 1), regex(pattern = r"^[^/\\\x00-\x1F\x7F]*$"))]
    pub name: String,
    /// The kind and its options.
    #[serde(flatten)]
    pub kind: BTreeMap<String, Value>,
}

/// One sampler: a unique `name` and exactly one kind with its options, as
/// `henyey_greenstein = { g = 0.9 }`. The kinds are those that the program registers (`scatterproof
/// list`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SamplerEntry {
    /// Name in tables and claims, unique.
    #[schemars(length(min = 1), regex(pattern = r"^[^/\\\x00-\x1F\x7F]*$"))]
    pub name: String,
    /// The kind and its options.
    #[serde(flatten)]
    pub kind: BTreeMap<String, Value>,
}

impl EstimatorEntry {
    /// Its kind and options, which validation has found to be one pair.
    pub fn choice(&self) -> Option<(&str, &Value)> {
        self.kind.iter().next().map(|(kind, options)| (kind.as_str(), options))
    }
}

impl SamplerEntry {
    /// Its kind and options, which validation has found to be one pair.
    pub fn choice(&self) -> Option<(&str, &Value)> {
        self.kind.iter().next().map(|(kind, options)| (kind.as_str(), options))
    }
}

/// One axis of the sweep: `keys` with `rows`, one `key` with `values`, or rows from a CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Name of the axis in tables and in `where`; by default the last word of its first key.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// One dotted key, as `object.boundary.rough.alpha` or `light.0.solid_angle.solid_angle_sr`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub key: Option<String>,
    /// Its values; their texts are the labels.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<Value>>,
    /// Several dotted keys that change together.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub keys: Option<Vec<String>>,
    /// One row per point of the axis.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<SweepRow>>,
    /// Rows from a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub csv: Option<SweepCsv>,
}

/// One row of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepRow {
    /// Label in tables, unique in the axis.
    #[schemars(length(min = 1))]
    pub label: String,
    /// A value for each of `keys`.
    pub values: Vec<Value>,
    /// Further numbers and texts of the row, for `equals.column`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub columns: BTreeMap<String, Scalar>,
}

/// A number or a text.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(untagged)]
pub enum Scalar {
    /// A number.
    Number(f64),
    /// A text.
    Text(String),
}

/// A sweep read from a CSV file with a header row; lines that start with # are comments.
/// A column `label` labels the rows; without it the texts of `columns` do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SweepCsv {
    /// Path, relative to the experiment file.
    pub path: String,
    /// Column -> dotted key that it sets; numbers become numbers, other texts strings.
    pub columns: BTreeMap<String, String>,
    /// Rows to leave out: those that have, in each of these columns, one of the listed numbers or texts.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub except: BTreeMap<String, Vec<Scalar>>,
}

/// Cells that differ only in these keys use the same random streams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairEntry {
    /// Dotted keys that do not enter the key of the streams, as `object.shape`.
    #[schemars(length(min = 1))]
    pub over: Vec<String>,
}

/// The amount of work; exactly one key.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Budget {
    /// Passes per estimator and cell.
    Passes(#[schemars(range(min = 2, max = 1099511627776u64))] u64),
    /// CPU seconds per estimator and cell; a pilot run converts them into passes.
    CpuSeconds(#[schemars(extend("exclusiveMinimum" = 0))] f64),
    /// Relative standard error of the observables that claims name; a pilot run converts it into passes.
    RelativeError(RelativeError),
}

/// Runs that take a multiple of the budget, for estimators or cells that need fewer or more passes than others for
/// the same error. If several entries match a run, their shares are multiplied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BudgetShare {
    /// Only cells with these labels: axis -> label.
    #[serde(default, rename = "where", skip_serializing_if = "BTreeMap::is_empty")]
    pub only: BTreeMap<String, String>,
    /// Only these estimators, and their controls; all by default.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub estimators: Vec<String>,
    /// Multiplies the passes, or the CPU seconds.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1000.0))]
    pub share: f64,
}

/// A relative standard error.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RelativeError {
    /// Largest standard error over value.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub at_most: f64,
    /// Another bound for small values.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub small_values: Option<SmallValues>,
}

/// A relative standard error for values below a limit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SmallValues {
    /// Values below this are small.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub below: f64,
    /// Largest standard error over value below it.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub at_most: f64,
}

/// How pictures are displayed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Display {
    /// Stops by which PNG pictures are brightened. With 0 the picture at the head of the report has a white level of its own.
    #[serde(default)]
    pub exposure_stops: f64,
}
