//! BSSRDF integration by rays from inside: rays start below the surface in all directions, and the
//! illumination is evaluated where they hit the surface.
//!
//! The rays start from a point on the normal below the exit, at most half way to the opposite side, in
//! uniform directions w. The first surface point that each meets from inside is an entry; its density is
//!   pdf_area = |n_i . w| / (4 pi d^2),
//! d being the ray's length. From a depth h below a plane that is h / (4 pi (r^2 + h^2)^(3/2)), the
//! shape of a dipole's source without absorption, which keeps the weights bounded for every h. (Rays from the
//! exit itself would miss the plane or the face that the exit lies on.)
//!
//! Such rays miss entries that the boundary of the body hides from the point below the exit. There are none
//! in a convex body.

use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use super::bssrdf_single::score_single;
use super::emergence::{BssrdfScene, Emergence, Gather, PathStreams};
use super::{Anomaly, BandUse, Bias, Cost, Estimator, EstimatorKind, Scores, Serves, read_options};
use crate::error::Result;
use crate::geometry::{Mesh, Ray, Shape, Side};
use crate::math::DVec3;
use crate::optics::bssrdf::Model;
use crate::sampling::stream::PassKey;
use crate::sampling::warp::{pdf_cap, square_to_cap};
use crate::scene::Scene;

/// Options of `bssrdf_rays`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RayOptions {
    /// BSSRDF model.
    pub model: Model,
    /// Rays per refraction of a camera path.
    #[serde(default = "super::kind::one")]
    #[schemars(range(min = 1, max = 65536))]
    pub rays: usize,
    /// Depth below the exit at which the rays start, mm; by default the reduced mean free path.
    ///
    /// For bands that share a path, the geometric mean of the smallest and the largest. At most half way to
    /// the opposite side.
    #[serde(rename = "depth_mm")]
    #[schemars(extend("exclusiveMinimum" = 0))]
    pub depth: Option<f64>,
    /// Whether single scattering is added by sampling; by default where the model leaves it out.
    pub single: Option<bool>,
    /// Whether light that goes straight through the body is followed.
    #[serde(default = "super::kind::on")]
    pub straight: bool,
}

/// The estimator, for one scene.
#[derive(Debug)]
pub struct BssrdfRays {
    bssrdf: BssrdfScene,
    rays: usize,
    depth: Option<f64>,
    sees_all: bool,
}

impl BssrdfRays {
    /// `bssrdf_rays` in experiment files.
    pub const KIND: EstimatorKind = EstimatorKind {
        kind: "bssrdf_rays",
        doc: "a BSSRDF integrated by rays from under the exit; unbiased for the model in convex bodies",
        serves: Serves::BSSRDF,
        options_schema: || schemars::schema_for!(RayOptions),
        build: |options, scene| Ok(Box::new(BssrdfRays::new(scene, &read_options(options)?)?)),
    };

    /// For a scene.
    ///
    /// # Errors
    /// A scene that it does not serve; a medium that the model does not fit.
    pub fn new(scene: Arc<Scene>, options: &RayOptions) -> Result<BssrdfRays> {
        BssrdfRays::KIND.check(&scene)?;
        let bssrdf = BssrdfScene::new(scene, &options.model, options.straight, options.single)?;
        Ok(BssrdfRays {
            rays: options.rays,
            depth: options.depth,
            sees_all: match &*bssrdf.scene.shape {
                Shape::Mesh(mesh) => is_convex(mesh),
                shape => shape.is_convex(),
            },
            bssrdf,
        })
    }

    fn depth(&self, bands: &[usize]) -> f64 {
        self.depth.unwrap_or_else(|| {
            let mfp = bands.iter().map(|&band| {
                let medium = &self.bssrdf.scene.medium[band];
                1.0 / (medium.sigma_t * (1.0 - medium.albedo * medium.phase.g))
            });
            let (least, most) = mfp.fold((f64::INFINITY, 0f64), |(a, b), mfp| (a.min(mfp), b.max(mfp)));
            (least * most).sqrt()
        })
    }
}

/// Pairs of triangle and vertex that a look at a mesh's convexity may take.
const MOST_PAIRS: usize = 1 << 30;

/// Whether no vertex of a mesh rises above the plane of one of its triangles by more than rounding.
/// Not asked of convex meshes that are very large, which then count as not known to be convex.
fn is_convex(mesh: &Mesh) -> bool {
    let vertices = mesh.vertices();
    if mesh.triangles().len().saturating_mul(vertices.len()) > MOST_PAIRS {
        return false;
    }
    let rounding = 64.0 * f64::EPSILON * mesh.bounds().radius;
    mesh.triangles().iter().all(|triangle| {
        let [a, b, c] = triangle.map(|i| vertices[i as usize]);
        let normal = (b - a).cross(c - a);
        let bound = rounding * normal.length();
        vertices.iter().all(|v| (*v - a).dot(normal) <= bound)
    })
}

impl Estimator for BssrdfRays {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let shooting = |group: &[usize]| Shooting { estimator: self, depth: self.depth(group) };
        self.bssrdf.pass(bands, key, scores, shooting);
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared
    }

    fn model(&self) -> Option<String> {
        Some(self.bssrdf.model.clone())
    }

    fn bias(&self) -> Bias {
        if self.sees_all {
            Bias::Unbiased
        } else {
            Bias::Biased("entries that cannot be seen from under the exit are left out".into())
        }
    }

    fn notes(&self) -> Vec<String> {
        self.bssrdf.notes()
    }
}

struct Shooting<'a> {
    estimator: &'a BssrdfRays,
    depth: f64,
}

impl Gather for Shooting<'_> {
    fn gather(&mut self, emergence: &Emergence<'_>, streams: &mut PathStreams, scores: &mut Scores) {
        let BssrdfRays { bssrdf, rays, .. } = self.estimator;
        score_single(bssrdf, emergence, &mut streams.single, scores);
        let Some(origin) = self.below(emergence, scores) else { return };
        let shape = &bssrdf.scene.shape;
        for _ in 0..*rays {
            let u = streams.entries.draw2();
            let u_light = streams.lights.draw3();
            let ray = Ray { origin, dir: square_to_cap(2.0, u) };
            scores.count(Cost::Rays);
            let Some(hit) = shape.leave(&ray) else {
                if shape.bounds().is_some() {
                    scores.note(Anomaly::LostRay);
                }
                continue;
            };
            let pdf_area = pdf_cap(2.0) * ray.dir.dot(hit.normal).abs() / (hit.t * hit.t);
            bssrdf.enter(emergence, &hit, *rays as f64 * pdf_area, u_light, scores);
        }
    }
}

impl Shooting<'_> {
    /// The point under the exit.
    fn below(&self, emergence: &Emergence<'_>, scores: &mut Scores) -> Option<DVec3> {
        let shape = &self.estimator.bssrdf.scene.shape;
        let down = Ray { origin: emergence.exit.point, dir: -emergence.exit.normal };
        scores.count(Cost::Rays);
        let opposite = shape.intersect(&down, Side::Inside, Some(emergence.face), f64::INFINITY);
        let point = down.at(opposite.map_or(self.depth, |hit| self.depth.min(0.5 * hit.t)));
        if shape.contains(point) {
            return Some(point);
        }
        scores.note(Anomaly::WrongSide); // the shading normal points into the body
        None
    }
}
