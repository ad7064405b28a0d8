//! The samplers that come with the program: one line each, and their options in a file.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use serde_json::Value as Json;

use super::cloud_samplers::{Body, ProbedSphere, Thinning};
use super::estimators::read;
use super::registry::SamplerEntry;
use crate::error::{Error, Result};
use crate::geometry::procedural;
use crate::math::DVec3;
use crate::optics::joint::{JointDirections, JointTable};
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::samplers::Sampler;
use crate::samplers::boundary::{RoughSampler, SmoothSampler};
use crate::samplers::discrete::{BandSampler, HeroFlightSampler};
use crate::samplers::distance::{
    EquiangularSampler, ExponentialSampler, MixtureSampler, TruncatedExponentialSampler,
};
use crate::samplers::facets::NormalSampler;
use crate::samplers::joint::BounceSampler;
use crate::samplers::light::{CapSampler, LatLongSampler};
use crate::samplers::lobe::{PlaneSampler, PowerSampler};
use crate::samplers::phase::HenyeyGreensteinSampler;
use crate::samplers::radial::RadialSampler;
use crate::samplers::surface::{MeshSampler, TriangleSampler};
use crate::samplers::towards::{JointSampler, TowardsSampler};
use crate::sampling::radial::{Dipole, Radial};

/// An entry from its name, its line of documentation, the type of its options, and how it is built from
/// them; `?` works in the last.
macro_rules! entry {
    ($kind:literal, $doc:literal, $options:ident => $build:expr) => {
        SamplerEntry {
            kind: $kind,
            doc: $doc,
            options_schema: || schemars::schema_for!($options),
            build: |json: &Json| -> Result<Box<dyn Sampler>> {
                let build: fn($options) -> Result<_> = $build;
                Ok(Box::new(build(read(json)?)?))
            },
        }
    };
}

/// Every sampler of this crate.
#[rustfmt::skip]
pub fn builtin() -> Vec<SamplerEntry> {
    vec![
        entry!("henyey_greenstein", "directions of the Henyey-Greenstein phase function",
            Phase => |o| Ok(HenyeyGreensteinSampler::new(o.g))),
        entry!("triangle", "points of a triangle, uniform per area",
            Corners => |o| Ok(TriangleSampler::new(o.corners_mm))),
        entry!("mesh_surface", "points on a mesh, its triangles by area or by index",
            Surface => |o| Ok(MeshSampler::new(&o.shape.mesh()?, o.triangles == Triangles::ByArea))),
        entry!("body_surface", "points on a sphere or a box",
            Body => |o| Ok(o.sampler())),
        entry!("probe_crossings", "where a BSSRDF's probes through a sphere cross its surface",
            ProbedSphere => |o| Ok(o.sampler())),
        entry!("thinning", "points of a cloud accepted by distance, by hierarchy or by asking all",
            Thinning => |o| Ok(o.sampler())),
        entry!("exponential_distance", "free flights",
            Flight => |o| Ok(ExponentialSampler::new(o.sigma_t_per_mm))),
        entry!("truncated_exponential_distance", "free flights that end inside a segment",
            Segment => |o| Ok(TruncatedExponentialSampler::new(o.sigma_t_per_mm, o.t_max_mm))),
        entry!("equiangular_distance", "distances along a ray by the angle at a point",
            Angle => |o| some(EquiangularSampler::new(o.foot_mm, o.distance_mm, end(o.t_max_mm)))),
        entry!("distance_mixture", "truncated exponential and equiangular distances, one-sample MIS",
            Mixture => |o| some(MixtureSampler::new(
                o.sigma_t_per_mm, o.foot_mm, o.distance_mm, end(o.t_max_mm), o.share_exponential))),
        entry!("towards_point", "directions of joint direction-distance sampling towards a point",
            Towards => |o| some(TowardsSampler::new(o.distance_mm))),
        entry!("direction_distance", "joint direction-distance sampling towards a point",
            Joint => |o| some(JointSampler::new(o.distance_mm, end(o.t_max_mm)))),
        entry!("bounce_table", "directions of a single bounce towards a point by the table of the joint density",
            Bounce => |o| Ok(BounceSampler::new(JointDirections::Table(JointTable::new(o.phase())), o.angle_deg))),
        entry!("bounce_mixture", "directions of a single bounce towards a point, phase function and geometry mixed",
            Bounce => |o| Ok(BounceSampler::new(JointDirections::Mixture(o.phase()), o.angle_deg))),
        entry!("power_lobe", "directions of a lobe with a power tail about an axis",
            Width => |o| Ok(PowerSampler::new(o.width))),
        entry!("plane_lobe", "directions from a vertex to the points of a plane above it",
            Depth => |o| Ok(PlaneSampler::new(o.height_mm, o.mfp_mm))),
        entry!("facet_normals", "microfacet normals in proportion to their projected area",
            Facets => |o| Ok(NormalSampler::plain(o.facets()))),
        entry!("visible_normals", "microfacet normals as seen from a direction",
            SeenFacets => |o| Ok(NormalSampler::visible(o.facets(), o.cos))),
        entry!("rough_dielectric", "the rough dielectric as a whole: reflection, refraction, total reflection",
            Rough => |o| o.sampler(RoughSampler::new)),
        entry!("rough_refraction", "refraction through a rough dielectric, without a choice of lobe",
            Rough => |o| o.sampler(RoughSampler::refraction)),
        entry!("smooth_dielectric", "which lobe of the smooth dielectric, with exact directions",
            Smooth => |o| Ok(SmoothSampler::smooth(o.eta, o.view.signed(o.cos)))),
        entry!("matched_boundary", "the boundary that is none: straight through",
            View => |o| Ok(SmoothSampler::matched(o.view.signed(o.cos)))),
        entry!("solid_angle_light", "directions to a cap of uniform radiance, up to the whole sphere",
            Cap => |o| Ok(CapSampler::new(o.solid_angle_sr))),
        entry!("lat_long_light", "directions to a latitude-longitude map with a bright spot and a black part",
            Map => |o| Ok(LatLongSampler::new(o.resolution[0] as usize, o.resolution[1] as usize))),
        entry!("radial", "points of a plane by a BSSRDF's radial profile",
            Profile => |o| Ok(RadialSampler::new(o.into()))),
        entry!("band_selection", "one band of many, by its probability",
            Bands => |o| some(BandSampler::new(&o.weights))),
        entry!("hero_flight", "free flights by a hero band, with the density of all bands together",
            HeroBands => |o| some(HeroFlightSampler::new(o.sigma_t_per_mm, &o.weights))),
    ]
}

/// A sampler that its options must make possible.
fn some<T>(sampler: Option<T>) -> Result<T> {
    sampler.ok_or_else(|| {
        Error::input("sampler options: they leave nothing to sample (a point on the ray's origin, or weights that are all 0)")
    })
}

/// An end of a ray that may be left out.
fn end(t_max: Option<f64>) -> f64 {
    t_max.unwrap_or(f64::INFINITY)
}

/// Options of `henyey_greenstein`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Phase {
    /// Mean cosine.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    pub g: f64,
}

/// Options of `triangle`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Corners {
    /// Its corners, mm.
    pub corners_mm: [[f64; 3]; 3],
}

/// Options of `mesh_surface`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Surface {
    /// The mesh.
    pub shape: UnevenShape,
    /// How a triangle is chosen.
    pub triangles: Triangles,
}

/// How a triangle is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Triangles {
    /// In proportion to its area.
    ByArea,
    /// Each as likely as any other.
    ByIndex,
}

/// Meshes of triangles of very different sizes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum UnevenShape {
    /// A thin plate with a small hole: 64 triangles, areas 1 to 750.
    DrilledBox,
    /// A torus whose inner rim is nearly closed: 192 triangles, areas 1 to 13.
    Torus,
}

impl UnevenShape {
    fn mesh(self) -> Result<crate::geometry::Mesh> {
        match self {
            UnevenShape::DrilledBox => procedural::drilled_box(DVec3::new(1.5, 1.0, 0.05), [1, 1], 0.02),
            UnevenShape::Torus => procedural::torus(1.0, 0.9, [12, 8], false),
        }
    }
}

/// Options of `exponential_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Flight {
    /// Extinction, 1/mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sigma_t_per_mm: f64,
}

/// Options of `truncated_exponential_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Extinction, 1/mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sigma_t_per_mm: f64,
    /// Length of the segment, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub t_max_mm: f64,
}

/// Options of `equiangular_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Angle {
    /// Where the point's foot is along the ray, mm; negative behind its origin.
    pub foot_mm: f64,
    /// The point's distance from the ray's line, mm.
    #[schemars(range(min = 0.0))]
    pub distance_mm: f64,
    /// Length of the ray, mm; left out, it has no end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub t_max_mm: Option<f64>,
}

/// Options of `distance_mixture`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mixture {
    /// Extinction, 1/mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub sigma_t_per_mm: f64,
    /// Where the point's foot is along the ray, mm; negative behind its origin.
    pub foot_mm: f64,
    /// The point's distance from the ray's line, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub distance_mm: f64,
    /// Length of the ray, mm; left out, it has no end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub t_max_mm: Option<f64>,
    /// Probability of the exponential.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub share_exponential: f64,
}

/// Options of `towards_point`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Towards {
    /// Distance of the point, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub distance_mm: f64,
}

/// Options of `direction_distance`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Joint {
    /// Distance of the point, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub distance_mm: f64,
    /// Length of the rays, mm; left out, they have no end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub t_max_mm: Option<f64>,
}

/// Options of `bounce_table` and `bounce_mixture`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bounce {
    /// Mean cosine of the Henyey-Greenstein phase function.
    #[schemars(range(min = -0.9999, max = 0.9999))]
    pub g: f64,
    /// Angle between the direction of travel on arrival and the point, degrees; at both ends there is no plane
    /// of arrival to chart the azimuth from.
    #[schemars(extend("exclusiveMinimum" = 0, "exclusiveMaximum" = 180))]
    pub angle_deg: f64,
}

impl Bounce {
    fn phase(&self) -> HenyeyGreenstein {
        HenyeyGreenstein { g: self.g }
    }
}

/// Options of `power_lobe`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Width {
    /// Tangent of half the angle that holds half of it; 1 is uniform.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub width: f64,
}

/// Options of `plane_lobe`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// Distance of the vertex from the plane, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub height_mm: f64,
    /// Mean free path, mm.
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub mfp_mm: f64,
}

/// A distribution of microfacets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Distribution {
    /// Trowbridge & Reitz 1975, Walter et al. 2007.
    Ggx,
    /// Gaussian slopes.
    Beckmann,
}

impl Distribution {
    fn facets(self, alpha: f64) -> Microfacets {
        let kind = match self {
            Distribution::Ggx => MicrofacetKind::Ggx,
            Distribution::Beckmann => MicrofacetKind::Beckmann,
        };
        Microfacets { kind, alpha }
    }
}

/// Options of `facet_normals`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Facets {
    /// Shape of the distribution.
    pub distribution: Distribution,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub alpha: f64,
}

impl Facets {
    fn facets(&self) -> Microfacets {
        self.distribution.facets(self.alpha)
    }
}

/// Options of `visible_normals`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SeenFacets {
    /// Shape of the distribution.
    pub distribution: Distribution,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub alpha: f64,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub cos: f64,
}

impl SeenFacets {
    fn facets(&self) -> Microfacets {
        self.distribution.facets(self.alpha)
    }
}

/// From where a boundary is seen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ViewSide {
    /// From the vacuum.
    Outside,
    /// From the medium.
    Inside,
}

impl ViewSide {
    fn signed(self, cos: f64) -> f64 {
        if self == ViewSide::Outside { cos } else { -cos }
    }
}

/// Options of `rough_dielectric` and `rough_refraction`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Rough {
    /// Shape of the distribution.
    pub distribution: Distribution,
    /// Roughness of the facets.
    #[schemars(range(min = 0.001, max = 1.0))]
    pub alpha: f64,
    /// Index inside over outside, not 1.
    #[schemars(range(min = 0.25, max = 4.0))]
    pub eta: f64,
    /// From where it is seen.
    pub view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub cos: f64,
}

impl Rough {
    fn sampler(&self, new: fn(f64, Microfacets, f64) -> RoughSampler) -> Result<RoughSampler> {
        if self.eta == 1.0 {
            return Err(Error::input(
                "sampler options: eta = 1 is no rough dielectric; use matched_boundary",
            ));
        }
        let facets = self.distribution.facets(self.alpha);
        Ok(new(self.eta, facets, self.view.signed(self.cos)))
    }
}

/// Options of `smooth_dielectric`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Smooth {
    /// Index inside over outside.
    #[schemars(range(min = 0.25, max = 4.0))]
    pub eta: f64,
    /// From where it is seen.
    pub view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub cos: f64,
}

/// Options of `matched_boundary`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct View {
    /// From where it is seen.
    pub view: ViewSide,
    /// Cosine of the view.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 1.0))]
    pub cos: f64,
}

/// Options of `solid_angle_light`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cap {
    /// Solid angle; 12.566370614359172 is the whole sphere.
    #[schemars(extend("exclusiveMinimum" = 0), range(max = 12.566370614359174))]
    pub solid_angle_sr: f64,
}

/// Options of `lat_long_light`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Map {
    /// Columns and rows.
    #[schemars(inner(range(min = 4, max = 1024)))]
    pub resolution: [u32; 2],
}

/// Options of `radial`: the profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Profile {
    /// Exponential radius.
    Exponential {
        /// 1/mm.
        #[schemars(extend("exclusiveMinimum" = 0))]
        sigma_per_mm: f64,
    },
    /// A Gaussian of the plane.
    Gaussian {
        /// Along each axis.
        #[schemars(extend("exclusiveMinimum" = 0))]
        variance_mm2: f64,
        /// Radius of the disc that it is cut to; left out, it is not.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schemars(extend("exclusiveMinimum" = 0))]
        r_max_mm: Option<f64>,
    },
    /// Normalized diffusion (Christensen & Burley 2015).
    NormalizedDiffusion {
        /// Its parameter d.
        #[schemars(extend("exclusiveMinimum" = 0))]
        d_mm: f64,
    },
    /// The classical dipole (Jensen et al. 2001).
    Dipole {
        /// Effective transport coefficient.
        #[schemars(range(min = 0.0))]
        sigma_tr_per_mm: f64,
        /// Depth of the real source.
        #[schemars(extend("exclusiveMinimum" = 0))]
        z_real_mm: f64,
        /// Height of the virtual source.
        #[schemars(extend("exclusiveMinimum" = 0))]
        z_virtual_mm: f64,
    },
}

impl From<Profile> for Radial {
    fn from(profile: Profile) -> Radial {
        match profile {
            Profile::Exponential { sigma_per_mm: sigma } => Radial::Exponential { sigma },
            Profile::Gaussian { variance_mm2: variance, r_max_mm } => {
                Radial::Gaussian { variance, r_max: end(r_max_mm) }
            }
            Profile::NormalizedDiffusion { d_mm: d } => Radial::NormalizedDiffusion { d },
            Profile::Dipole {
                sigma_tr_per_mm: sigma_tr,
                z_real_mm: z_real,
                z_virtual_mm: z_virtual,
            } => Radial::Dipole(Dipole { sigma_tr, z_real, z_virtual }),
        }
    }
}

/// Options of `band_selection`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Bands {
    /// Weights of the bands, in any unit.
    #[schemars(length(min = 1), inner(range(min = 0.0)))]
    pub weights: Vec<f64>,
}

/// Options of `hero_flight`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct HeroBands {
    /// Extinctions of the bands, 1/mm.
    #[schemars(length(min = 1), inner(range(min = 1e-6)))]
    pub sigma_t_per_mm: Vec<f64>,
    /// Weights of the bands, as many, in any unit.
    #[schemars(length(min = 1), inner(range(min = 0.0)))]
    pub weights: Vec<f64>,
}

#[cfg(test)]
#[path = "samplers_tests.rs"]
mod tests;
