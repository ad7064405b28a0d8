//! Phase one: points of the surface with the flux that enters there, in the order of their hierarchy.
//!
//! A point's random numbers are those of its index, so the flux is computed after the hierarchy has put
//! the points in order, from the same numbers again: only positions are ever moved.

use crate::estimators::emergence::BssrdfScene;
use crate::geometry::{BodyPoint, BodySampler, Ray};
use crate::math::DVec3;
use crate::optics::bssrdf::Entry;
use crate::optics::fresnel::fresnel;
use crate::sampling::stream::{PassKey, Purpose};
use crate::sampling::thinning::PointTree;

/// The points of one pass.
pub(super) struct Cloud {
    pub tree: PointTree,
    bands: usize,
    /// T12 E / (f M), W, `[point][band]`.
    flux: Vec<f64>,
    /// Index of the light of each point; empty where there is one light.
    light: Vec<u16>,
    /// Shading normal and direction to the light, where the model needs them. Single precision
    /// saves memory: 6e-8, far below what any number of passes can see.
    directions: Vec<[[f32; 3]; 2]>,
    pub shadow_rays: u64,
    pub wrong_side: u64,
}

/// A light sample that arrives at a point.
struct Incidence {
    light: usize,
    wi: DVec3,
    cos: f64,
    /// 1 / (f M p(light) p(wi)).
    scale: f64,
}

impl Cloud {
    /// Draws `count` points on the surface of the body.
    pub(super) fn new(
        bssrdf: &BssrdfScene,
        sampler: &BodySampler,
        count: usize,
        key: &PassKey,
    ) -> Cloud {
        let scene = &*bssrdf.scene;
        let point = |index: u32| {
            let mut stream = key.stream(u64::from(index), Purpose::Cloud);
            (sampler.sample(&scene.shape, stream.draw3()), stream)
        };
        let positions: Vec<DVec3> = (0..count as u32).map(|index| point(index).0.point).collect();
        let tree = PointTree::new(&positions);
        drop(positions);
        let bands = scene.bands();
        let several = scene.lights.len() > 1;
        let directed = bssrdf.models.iter().any(|model| model.needs_directions());
        let reserve = |needed: bool| if needed { count } else { 0 };
        let mut cloud = Cloud {
            bands,
            flux: Vec::with_capacity(count * bands),
            light: Vec::with_capacity(reserve(several)),
            directions: Vec::with_capacity(reserve(directed)),
            shadow_rays: 0,
            wrong_side: 0,
            tree,
        };
        for place in 0..count {
            let (drawn, mut stream) = point(cloud.tree.order()[place]);
            let incidence = cloud.incidence(bssrdf, &drawn, stream.draw3(), count);
            let light = incidence.as_ref().map_or(0, |incidence| incidence.light);
            let wi = incidence.as_ref().map_or(drawn.normal, |incidence| incidence.wi);
            for band in 0..bands {
                let flux = incidence.as_ref().map_or(0.0, |i| {
                    let radiance = scene.lights[i.light].sampled_radiance(band, i.wi);
                    let transmitted = 1.0 - fresnel(i.cos, bssrdf.eta[band]).reflectance;
                    radiance * transmitted * i.cos * i.scale
                });
                cloud.flux.push(flux);
            }
            if several {
                cloud.light.push(light as u16);
            }
            if directed {
                let single = |v: DVec3| v.to_array().map(|x| x as f32);
                cloud.directions.push([single(drawn.shading_normal), single(wi)]);
            }
        }
        cloud
    }

    /// Light that reaches a point; none where the point is turned away or in shadow.
    fn incidence(
        &mut self,
        bssrdf: &BssrdfScene,
        at: &BodyPoint,
        u: [f64; 3],
        count: usize,
    ) -> Option<Incidence> {
        let scene = &*bssrdf.scene;
        let (light, choice) = bssrdf.choose_light(u[0])?;
        let sample = scene.lights[light].sample(0, [u[1], u[2]]);
        let [geometric, cos] = [at.normal, at.shading_normal].map(|normal| normal.dot(sample.wi));
        if (geometric > 0.0) != (cos > 0.0) {
            self.wrong_side += 1;
            return None;
        }
        if cos <= 0.0 {
            return None;
        }
        self.shadow_rays += 1;
        let shadow = Ray { origin: at.point, dir: sample.wi };
        if scene.shape.occluded(&shadow, Some(at.face)) {
            return None;
        }
        let density = at.pdf_area * count as f64 * choice * sample.pdf.unwrap_or(1.0);
        Some(Incidence { light, wi: sample.wi, cos, scale: 1.0 / density })
    }

    /// Number of surface points M.
    pub(super) fn len(&self) -> usize {
        self.tree.len()
    }

    /// Flux that enters at a place of the tree, W.
    #[inline]
    pub(super) fn flux(&self, place: usize, band: usize) -> f64 {
        self.flux[place * self.bands + band]
    }

    /// Index of the light that it comes from.
    #[inline]
    pub(super) fn light(&self, place: usize) -> usize {
        self.light.get(place).map_or(0, |&light| usize::from(light))
    }

    /// The point, and the refracted direction of its light under this index.
    #[inline]
    pub(super) fn entry(&self, place: usize, eta: f64) -> Entry {
        let point = self.tree.point(place);
        match self.directions.get(place) {
            None => Entry { point, normal: DVec3::ZERO, dir: DVec3::ZERO },
            Some(directions) => {
                let [normal, wi] = directions.map(|v| DVec3::from_array(v.map(f64::from)));
                let cos = normal.dot(wi).clamp(0.0, 1.0);
                let cos_t = fresnel(cos, eta).cos_t;
                Entry { point, normal, dir: (-wi + (cos - eta * cos_t) * normal) / eta }
            }
        }
    }

    /// The most memory that `count` points take, while they are put in order too, bytes.
    pub(super) fn bytes(bssrdf: &BssrdfScene, count: usize) -> usize {
        // A code, an index and a position; then coordinates, places and about half a node (40 bytes) a
        // point.
        let (sorted, kept) = (16 + 24, 24 + 4 + 20);
        let light = if bssrdf.scene.lights.len() > 1 { 2 } else { 0 };
        let directions = if bssrdf.models.iter().any(|model| model.needs_directions()) { 24 } else { 0 };
        count * (kept + (8 * bssrdf.scene.bands() + light + directions).max(sorted))
    }

    /// Memory behind it, bytes.
    #[cfg(test)]
    pub(crate) fn heap_bytes(&self) -> usize {
        self.tree.heap_bytes()
            + size_of_val(&*self.flux)
            + size_of_val(&*self.light)
            + size_of_val(&*self.directions)
    }
}
