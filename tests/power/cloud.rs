//! The point-cloud method a second time, with places for defects: M points of a convex body with the
//! flux
//!   Phi = T12 pi L / f,   f = 1/A by area, 1/(K A_i) where one of K faces is chosen by index,
//! that one direction with the density cos / pi brings, and camera paths that are refracted into the
//! body with probability T21 and find there
//!   L = 1/M sum_p K(d_p) Phi_p B_p / p(d_p),   B_p = 1 with probability p(d_p),
//! K = R_d / pi of the classical dipole (Jensen, Marschner, Levoy & Hanrahan 2001). Only multiple
//! scattering is scored; a convex body shades nothing of itself.

use std::f64::consts::PI;
use std::sync::Arc;

use scatterproof::estimators::{BandUse, Cost, Estimator, Scores, TransportClass};
use scatterproof::geometry::{Shape, Side};
use scatterproof::math::{DVec3, Frame, exp, integrate, sin_cos_turns};
use scatterproof::optics::boundary::Boundary;
use scatterproof::optics::bssrdf::{Model, MomentKind, Outgoing};
use scatterproof::optics::fresnel::fresnel;
use scatterproof::optics::medium::Medium;
use scatterproof::sampling::stream::{PassKey, Purpose, Stream};
use scatterproof::scene::Scene;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::defects::{Defect, Family, Planted, of, row};

/// Forms of the acceptance probability p(d).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Rule {
    /// All points: p = 1.
    All,
    /// e^(-sigma_tr d) with each band's own, bands apart.
    Band,
    /// e^(-m d), m the mean over the bands, all bands together.
    Mean,
}

/// How one of a box's faces is chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Faces {
    ByArea,
    ByIndex,
}

/// Options of the estimator.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CloudOptions {
    /// Number of points.
    samples: usize,
    /// Which of them are evaluated.
    rule: Rule,
    /// How faces are chosen.
    #[serde(default = "by_area")]
    faces: Faces,
}

fn by_area() -> Faces {
    Faces::ByArea
}

/// The estimator, for a scene of a sphere or a box, one index of refraction, one light and three bands.
pub struct Cloud {
    scene: Arc<Scene>,
    options: CloudOptions,
    defect: Defect,
    eta: f64,
    dipoles: [Dipole; BANDS],
    /// Mean of sigma_tr, 1/mm.
    mean: f64,
}

const BANDS: usize = 3;

/// The classical dipole of one band.
#[derive(Clone, Copy)]
struct Dipole {
    /// alpha' / (4 pi^2): the radiance is the exitance over pi.
    strength: f64,
    sigma_tr: f64,
    depths: [f64; 2],
}

impl Dipole {
    fn new(medium: &Medium, eta: f64) -> Dipole {
        let scattering = medium.sigma_t * medium.albedo * (1.0 - medium.phase.g);
        let absorption = medium.sigma_t * (1.0 - medium.albedo);
        let extinction = scattering + absorption;
        let external = integrate(|mu| 2.0 * mu * fresnel(mu, eta).reflectance, 0.0, 1.0, 1e-10).value;
        let internal = 1.0 - (1.0 - external) / (eta * eta);
        let mismatch = (1.0 + internal) / (1.0 - internal);
        let real = 1.0 / extinction;
        Dipole {
            strength: scattering / extinction / (4.0 * PI * PI),
            sigma_tr: (3.0 * absorption * extinction).sqrt(),
            depths: [real, real * (1.0 + 4.0 / 3.0 * mismatch)],
        }
    }

    /// Radiance that leaves at squared distance `rr` per flux that entered, without transmittances.
    fn kernel(&self, rr: f64) -> f64 {
        let source = |z: f64| {
            let d = (rr + z * z).sqrt();
            let sd = self.sigma_tr * d;
            z * (1.0 + sd) * exp(-sd) / (d * d * d)
        };
        self.strength * (source(self.depths[0]) + source(self.depths[1]))
    }
}

/// A point of the surface and the flux that enters there, over the number of points.
struct Lit {
    point: DVec3,
    flux: [f64; BANDS],
}

/// A point uniform on a face or a sphere, its outward normal, and 1/f.
struct Drawn {
    point: DVec3,
    normal: DVec3,
    area: f64,
}

impl Cloud {
    pub fn new(scene: Arc<Scene>, options: CloudOptions, defect: Defect) -> Cloud {
        let Boundary::Smooth { eta } = scene.boundary[0] else { panic!("a smooth boundary") };
        assert!(scene.bands() == BANDS && scene.lights.len() == 1, "three bands and one light");
        let dipoles: [Dipole; BANDS] = std::array::from_fn(|band| Dipole::new(&scene.medium[band], eta));
        let mean = dipoles.iter().map(|dipole| dipole.sigma_tr).sum::<f64>() / BANDS as f64;
        Cloud { scene, options, defect, eta, dipoles, mean }
    }

    fn draw(&self, stream: &mut Stream) -> Drawn {
        let [choose, u, v] = stream.draw3();
        let half = match *self.scene.shape {
            Shape::Box { half } => half,
            Shape::Sphere { radius } => {
                let (z, (sin, cos)) = (1.0 - 2.0 * u, sin_cos_turns(v));
                let across = (1.0 - z * z).sqrt();
                let normal = DVec3::new(across * cos, across * sin, z);
                return Drawn { point: radius * normal, normal, area: 4.0 * PI * radius * radius };
            }
            _ => panic!("a sphere or a box"),
        };
        // Faces across x, y, z, and each pair's upper face first.
        let areas = [half.y * half.z, half.z * half.x, half.x * half.y].map(|quarter| 4.0 * quarter);
        let whole = 2.0 * areas.iter().sum::<f64>();
        let (axis, rest, area) = match self.options.faces {
            Faces::ByIndex => {
                let face = (6.0 * choose) as usize;
                let count = if self.defect == Defect::FaceCountMissing { 1.0 } else { 6.0 };
                (face / 2, (face % 2) as f64, count * areas[face / 2])
            }
            Faces::ByArea => {
                let mut rest = choose * whole;
                let mut axis = 0;
                while axis < 2 && rest >= 2.0 * areas[axis] {
                    rest -= 2.0 * areas[axis];
                    axis += 1;
                }
                (axis, (rest / areas[axis]).floor(), whole)
            }
        };
        let mut normal = DVec3::ZERO;
        normal[axis] = 1.0 - 2.0 * rest.min(1.0);
        let mut point = half * normal;
        point[(axis + 1) % 3] = half[(axis + 1) % 3] * (2.0 * u - 1.0);
        point[(axis + 2) % 3] = half[(axis + 2) % 3] * (2.0 * v - 1.0);
        Drawn { point, normal, area }
    }

    fn lit(&self, stream: &mut Stream) -> Lit {
        let Drawn { point, normal, area } = self.draw(stream);
        let [u, turns] = stream.draw2();
        let (cos, sin) = ((1.0 - u).sqrt(), u.sqrt());
        let (s, c) = sin_cos_turns(turns);
        let wi = Frame::about(normal).to_world(DVec3::new(sin * c, sin * s, cos));
        let transmitted = 1.0 - fresnel(cos, self.eta).reflectance;
        let entering = match self.defect {
            Defect::EntryTwice => transmitted * transmitted,
            _ => transmitted,
        };
        let scale = entering * PI * area / self.options.samples as f64;
        Lit { point, flux: std::array::from_fn(|band| scale * self.scene.lights[0].eval(band, wi).0) }
    }

    /// Weight of a point that was accepted with e^(-sigma d).
    fn weight(&self, sigma: f64, d: f64) -> f64 {
        match self.defect {
            Defect::NoReweighting => 1.0,
            Defect::MeanWeighsBand => exp(self.mean * d),
            Defect::CloudClamped => exp(sigma * d).min(1e3),
            _ => exp(sigma * d),
        }
    }

    /// The radiance that arrives at `x_o` under the surface, per band.
    fn gather(&self, points: &[Lit], x_o: DVec3, stream: &mut Stream) -> [f64; BANDS] {
        let mut sums = [0.0; BANDS];
        for Lit { point, flux } in points {
            let rr = (*point - x_o).length_squared();
            let d = rr.sqrt();
            let mut add = |band: usize, weight: f64| {
                sums[band] += self.dipoles[band].kernel(rr) * flux[band] * weight;
            };
            match self.options.rule {
                Rule::All => (0..BANDS).for_each(|band| add(band, 1.0)),
                Rule::Mean => {
                    if stream.draw() < exp(-self.mean * d) {
                        (0..BANDS).for_each(|band| add(band, self.weight(self.mean, d)));
                    }
                }
                Rule::Band => {
                    for (band, dipole) in self.dipoles.iter().enumerate() {
                        if stream.draw() < exp(-dipole.sigma_tr * d) {
                            add(band, self.weight(dipole.sigma_tr, d));
                        }
                    }
                }
            }
        }
        sums
    }
}

impl Estimator for Cloud {
    fn pass(&self, _bands: &[usize], key: &PassKey, scores: &mut Scores) {
        let scene = &*self.scene;
        let mut stream = key.stream(0, Purpose::Cloud);
        let points: Vec<Lit> = (0..self.options.samples).map(|_| self.lit(&mut stream)).collect();
        for index in 0..scene.sensor.rays_per_pass() {
            scores.count(Cost::Paths);
            let mut sensor = key.stream(index as u64, Purpose::Sensor);
            let ([a, b], [c, d]) = (sensor.draw2(), sensor.draw2());
            let seen = scene.sensor.ray(index, [a, b, c, d]);
            let hit = scene.shape.intersect(&seen.ray, Side::Outside, None, f64::INFINITY);
            let Some(hit) = hit else { continue };
            let mut stream = key.stream(index as u64, Purpose::Connection);
            let reflectance = fresnel(-seen.ray.dir.dot(hit.normal), self.eta).reflectance;
            if stream.draw() < reflectance {
                continue; // leaves towards the sky: surface reflection, which is not scored
            }
            let exit = if self.defect == Defect::ExitTwice { 1.0 - reflectance } else { 1.0 };
            let radiance = self.gather(&points, hit.point, &mut stream);
            for (band, radiance) in radiance.into_iter().enumerate() {
                let value = seen.weight * exit * radiance;
                scores.add(seen.slot, band, TransportClass::Multiple, 0, value);
            }
        }
    }

    fn band_use(&self) -> BandUse {
        BandUse::Shared
    }

    fn model(&self) -> Option<String> {
        let model = Model::Classical { moments: MomentKind::Exact, outgoing: Outgoing::Plain };
        Some(model.to_string())
    }
}

const fn cloud(
    name: &'static str,
    defect: Defect,
    what: &'static str,
    expected: &'static [&'static str],
) -> Planted {
    of(Family::Cloud, row(name, defect, what, expected))
}

/// Defects that this estimator plants.
pub const ROWS: &[Planted] = &[
    cloud(
        "cloud-face-count-missing",
        Defect::FaceCountMissing,
        "faces are chosen by index, and the flux lacks their number",
        &["faces.choices agree"],
    ),
    cloud(
        "cloud-exit-twice",
        Defect::ExitTwice,
        "a path that is refracted with probability T21 is multiplied by T21",
        &["cloud.red", "cloud.green", "cloud.blue"],
    ),
    cloud(
        "cloud-entry-twice",
        Defect::EntryTwice,
        "the flux that enters has T12 twice",
        &["cloud.red", "cloud.green", "cloud.blue"],
    ),
    cloud(
        "cloud-mean-weighs-band",
        Defect::MeanWeighsBand,
        "bands accept by their own coefficients and have the weight of the mean's",
        &["cloud.red", "cloud.blue", "cloud.rules agree"],
    ),
    cloud(
        "cloud-no-reweighting",
        Defect::NoReweighting,
        "accepted points have weight 1",
        &["cloud.red", "cloud.green", "cloud.blue", "cloud.rules agree"],
    ),
    cloud(
        "cloud-weight-clamp",
        Defect::CloudClamped,
        "weights of accepted points are clamped at 1000",
        &["cloud.red"],
    ),
];
