//! Tests of the importance field, and of walks with good and bad guides.

use std::sync::Arc;

use super::diffusion::{BoundaryMoments, Diffusion, growth_of_flights};
use super::exit::ExitRule;
use super::importance::Importance;
use super::*;
use crate::estimators::field::{Field, Path};
use crate::estimators::path::PathTracer;
use crate::estimators::testing::measure;
use crate::estimators::walk::{CameraWalk, Unrivalled};
use crate::estimators::{Estimator, Layout, Roulette, Scores};
use crate::geometry::{Ray, Shape, procedural};
use crate::math::{Frame, exp, integrate};
use crate::optics::boundary::Boundary;
use crate::optics::guided::{Escape, diffuse_growth};
use crate::optics::microfacet::{MicrofacetKind, Microfacets};
use crate::optics::phase::HenyeyGreenstein;
use crate::sampling::stream::PassKey;
use crate::scene::sensor::Probe;
use crate::scene::{Emission, Light, Sensor};

const SMOOTH: Boundary = Boundary::Smooth { eta: 1.3 };
const ROUGH: Boundary =
    Boundary::Rough { eta: 1.3, facets: Microfacets { kind: MicrofacetKind::Ggx, alpha: 0.3 } };

fn medium(sigma_t: f64, albedo: f64, g: f64) -> Medium {
    Medium { sigma_t, albedo, phase: HenyeyGreenstein { g }, emission: 0.0 }
}

fn cap(toward: DVec3, height: f64, radiance: f64) -> Light {
    let frame = Frame::about(toward.normalize());
    Light { name: "cap".into(), emission: Emission::Cap { frame, height, radiance: vec![radiance] } }
}

fn sky() -> Light {
    cap(DVec3::Z, 2.0, 1.0)
}

fn directional(toward: DVec3, irradiance: f64) -> Light {
    Light {
        name: "sun".into(),
        emission: Emission::Directional { toward, irradiance: vec![irradiance] },
    }
}

fn scene(shape: Shape, boundary: Boundary, medium: Medium, lights: Vec<Light>) -> Arc<Scene> {
    let ray = Ray { origin: DVec3::new(0.3, -0.4, 3.0), dir: -DVec3::Z };
    let sensor = Sensor::Probe(Probe { ray, paths: 64 });
    Arc::new(Scene {
        shape: Arc::new(shape),
        boundary: vec![boundary],
        medium: vec![medium],
        lights,
        sensor,
    })
}

const SPHERE: Shape = Shape::Sphere { radius: 1.0 };

fn first<T>(bands: Vec<Option<T>>) -> Option<T> {
    bands.into_iter().next().expect("a band")
}

fn solution(scene: &Scene, nodes: u32) -> Importance {
    first(Importance::of_bands(scene, nodes, GuideRule::EVERYWHERE)).expect("light comes in")
}

/// Per mean free path.
fn gradient(importance: &Importance, x: DVec3) -> DVec3 {
    let pull = guide(importance, x).pull;
    pull.axis * pull.strength()
}

fn guide(importance: &Importance, x: DVec3) -> StepGuide {
    let mut guide = StepGuide::NONE;
    assert!(importance.at(x, &mut guide) > 0.0, "a field");
    guide
}

/// In a sphere under a sky phi = sinh(kappa r) / r: growth coth(kappa r) kappa - 1 / r per length. On coarse and fine
/// grids, also where a cell is longer than the growth length; everywhere in a cell it is that of its middle.
#[test]
fn a_sphere_in_a_sky_has_its_closed_form() {
    // Beside the cell's size: 5 % for the quadrature of the sky and the staircase. With kappa h = 3.6 the grid's own waves
    // grow faster along its diagonals, by 14 % in the direction (0.6, 0, 0.8): sum of cosh(kappa' d_i h) - 1 over the axes =
    // cosh(kappa h) - 1.
    for (sigma_t, albedo, nodes, tolerance) in
        [(10.0, 0.95, 32, 0.05), (10.0, 0.8, 32, 0.05), (30.0, 0.99, 16, 0.05), (40.0, 0.8, 16, 0.15)]
    {
        let medium = medium(sigma_t, albedo, 0.0);
        let importance = solution(&scene(SPHERE, SMOOTH, medium, vec![sky()]), nodes);
        let kappa = diffuse_growth(albedo, 0.0) * sigma_t;
        for dir in [DVec3::X, DVec3::new(0.6, 0.0, 0.8), DVec3::new(0.48, -0.6, 0.64)] {
            for r in [0.2, 0.5, 0.8, 0.95] {
                // The last cell before the boundary is not resolved where it is longer than the growth length.
                let cell = 2.0 / f64::from(nodes);
                if kappa * cell > 1.0 && 1.0 - r < cell {
                    continue;
                }
                let growth = gradient(&importance, dir * r);
                let e = exp(-2.0 * kappa * r);
                let expected = (kappa * (1.0 + e) / (1.0 - e) - 1.0 / r) / sigma_t;
                let error = (growth - dir * expected).length() / diffuse_growth(albedo, 0.0);
                // Half a diagonal of a cell away the field turns by 1 / r and changes by kappa / 3 at most.
                let within = 0.87 * cell * (kappa / 3.0).min(1.0 / r);
                assert!(
                    error < tolerance + within,
                    "{sigma_t} {albedo} {nodes}: {growth} at {r} {dir}, {expected}"
                );
            }
        }
    }
}

/// A wide flat box is a slab: grid and closed form agree in its middle, whichever side is lit.
#[test]
fn a_flat_box_is_a_slab() {
    let medium = medium(8.0, 0.97, 0.3);
    for toward in [DVec3::Z, -DVec3::Z, DVec3::new(0.5, 0.0, 0.8)] {
        let lights = || vec![cap(toward, 1e-3, 100.0)];
        let slab = solution(&scene(Shape::Slab { thickness: 1.0 }, SMOOTH, medium, lights()), 4);
        let flat = Shape::Box { half: DVec3::new(2.0, 2.0, 0.5) };
        let grid = solution(&scene(flat, SMOOTH, medium, lights()), 64);
        for depth in [0.1, 0.5, 0.9] {
            let of_slab = gradient(&slab, DVec3::new(0.0, 0.0, -depth));
            let of_grid = gradient(&grid, DVec3::new(0.0, 0.0, 0.5 - depth));
            let error = (of_slab - of_grid).length();
            assert!(error < 0.03, "{toward} {depth}: {of_slab:?} {of_grid:?}");
        }
    }
}

/// Ways out of a sphere in a sky: along the normal, the more often the more is absorbed and the nearer the boundary is; none
/// in its middle, in parallel light, and where nothing is absorbed.
#[test]
fn ways_out() {
    let chance = |albedo: f64, boundary: Boundary, light: Light, r: f64| {
        let scene = scene(SPHERE, boundary, medium(10.0, albedo, 0.0), vec![light]);
        let dir = DVec3::new(0.48, -0.6, 0.64);
        // Without a guide walks are plain and do not escape.
        let Some(importance) = first(Importance::of_bands(&scene, 24, GuideRule::EVERYWHERE)) else {
            return 0.0;
        };
        let escape = guide(&importance, dir * r).escape;
        // A plane is that of another point of its cell, whose diagonal is 0.14.
        assert!(escape.chance == 0.0 || escape.normal.dot(dir) > 0.98, "{:?}", escape.normal);
        escape.chance
    };
    let at_boundary = [0.8, 0.95, 0.99, 0.999, 1.0].map(|albedo| chance(albedo, SMOOTH, sky(), 0.999));
    assert!(at_boundary.is_sorted_by(|a, b| a > b) && at_boundary[4] < 0.01, "{at_boundary:?}");
    assert!(at_boundary[0] > 0.05 && at_boundary[0] < 0.3, "{at_boundary:?}");
    assert!(chance(0.8, SMOOTH, sky(), 0.85) < 0.5 * at_boundary[0]);
    assert_eq!(chance(0.8, SMOOTH, sky(), 0.3), 0.0);
    assert!(chance(0.8, Boundary::Matched, sky(), 0.999) > 0.05);
    assert_eq!(chance(0.8, SMOOTH, cap(DVec3::Z, 1e-3, 100.0), 0.99), 0.0);
    let slab = scene(Shape::Slab { thickness: 1.0 }, SMOOTH, medium(10.0, 0.9, 0.0), vec![sky()]);
    let slab = solution(&slab, 4);
    for (z, normal) in [(-0.01, DVec3::Z), (-0.99, -DVec3::Z)] {
        let Escape { normal: own, chance, .. } = guide(&slab, DVec3::new(0.0, 0.0, z)).escape;
        assert!(own == normal && chance > 0.05, "{own} {chance}");
    }
    assert_eq!(guide(&slab, DVec3::new(0.0, 0.0, -0.5)).escape.chance, 0.0);
}

/// What leaving gains: in a half-space f (1 + (f - 1) / A), f = 1 + 2 A D kappa, under a sky and nothing in parallel light, the same on both sides of a
/// thick slab, and on the grid of a thick flat box.
#[test]
fn gains_of_leaving() {
    let medium = medium(10.0, 0.9, 0.3);
    let half_space = |light: Light| {
        let scene = scene(Shape::HalfSpace, SMOOTH, medium, vec![light]);
        (solution(&scene, 4).gain_of_leaving(DVec3::X), scene)
    };
    let (gain, under_sky) = half_space(sky());
    let diffusion = 1.0 / (3.0 * 10.0 * (1.0 - 0.9 * 0.3));
    let Boundary::Smooth { eta } = under_sky.boundary[0] else { unreachable!() };
    let mismatch = crate::optics::bssrdf::FresnelMoments::exact(eta).mismatch();
    let found = 1.0 + 2.0 * 1.065_669 * mismatch * diffusion * diffuse_growth(0.9, 0.3) * 10.0;
    let expected = found * (1.0 + (found - 1.0) / mismatch);
    // The exit keeps its chance in single precision.
    assert!((gain / expected - 1.0).abs() < 1e-5 && gain > 1.5, "{gain} {expected}");
    assert_eq!(half_space(cap(DVec3::Z, 1e-3, 100.0)).0, 1.0);
    let rule = ExitRule::of(&under_sky, 0, &Diffusion::of(&under_sky, 0));
    let dim = |phi| rule.gain(&rule.exit(DVec3::ZERO, DVec3::Z, 1.0, phi).expect("a gain"));
    assert!(dim(1e-9) == dim(1e-30) && dim(0.2) < dim(1e-9) && dim(1e-30).is_finite());

    let all_round = |shape: Shape| scene(shape, SMOOTH, medium, vec![sky()]);
    let slab = solution(&all_round(Shape::Slab { thickness: 4.0 }), 4);
    let flat = solution(&all_round(Shape::Box { half: DVec3::new(4.0, 4.0, 2.0) }), 64);
    for (of_slab, of_box) in [(0.0, 2.0), (-4.0, -2.0)] {
        let gains = [
            slab.gain_of_leaving(DVec3::Z * of_slab),
            flat.gain_of_leaving(DVec3::new(0.01, 0.01, of_box)),
        ];
        // `sky` is all directions: the underside is lit as the upper side is. A quadrature of the sky, and cells.
        assert!(gains.iter().all(|own| (own / gain - 1.0).abs() < 0.1), "{gains:?} {gain}");
    }
}

/// Light that goes in near a cell is that of the border ahead, also where a body has gaps narrower than a cell.
#[test]
fn borders_know_what_goes_in() {
    let torus = procedural::torus(0.7, 0.3, [24, 12], true).expect("closed");
    let drilled = procedural::drilled_box(DVec3::new(2.0, 1.5, 1.0), [2, 1], 0.1).expect("closed");
    for shape in
        [Shape::Mesh(torus), Shape::Mesh(drilled), Shape::Box { half: DVec3::new(0.5, 0.4, 0.3) }]
    {
        let scene =
            scene(shape, SMOOTH, medium(5.0, 0.9, 0.0), vec![cap(DVec3::new(0.3, 0.2, 1.0), 0.2, 1.0)]);
        let [known, anew] = Importance::let_in_near_cells(&scene, 12, 0.5);
        assert!(known.iter().flatten().count() > 50);
        for (a, b) in known.iter().zip(&anew) {
            let [a, b] = [a, b].map(|let_in| let_in.map_or(f64::NAN, |let_in| let_in.all));
            assert!((a - b).abs() <= 1e-9 * b || (a.is_nan() && b.is_nan()), "{a} {b}");
        }
    }
}

/// The quadrature over facets, of a surface that is nearly smooth, has the moments of a smooth one; of a rough one, which loses
/// light, those of a finer quadrature.
#[test]
fn moments_of_boundaries() {
    let rough = |alpha: f64, eta: f64| Boundary::Rough {
        eta,
        facets: Microfacets { kind: MicrofacetKind::Ggx, alpha },
    };
    for eta in [1.0 / 1.4, 1.1, 1.4, 2.0] {
        let own = BoundaryMoments::of(&rough(1e-3, eta));
        let smooth = BoundaryMoments::of(&Boundary::Smooth { eta });
        assert!((own.mismatch / smooth.mismatch - 1.0).abs() < 0.05, "{eta}: {own:?} {smooth:?}");
        assert!((own.kept - 1.0).abs() < 0.01 && smooth.kept == 1.0, "{eta}: {own:?}");
    }
    for (alpha, kept) in [(0.05, 0.97), (0.2, 0.82), (0.4, 0.65)] {
        let own = BoundaryMoments::of(&rough(alpha, 1.4));
        let fine = BoundaryMoments::of_facets(&rough(alpha, 1.4), [200, 400]);
        assert!((fine.kept - kept).abs() < 0.01, "{alpha}: {fine:?}");
        assert!((own.kept - fine.kept).abs() < 0.01, "{alpha}: {own:?} {fine:?}");
        assert!((own.mismatch / fine.mismatch - 1.0).abs() < 0.02, "{alpha}: {own:?} {fine:?}");
    }
}

/// An exponential of the growth of flights has the mean flight of phi, by quadrature.
#[test]
fn flights_have_the_mean_of_the_solution() {
    for c in [0.0, 0.2, 0.6] {
        for gradient in [c, c + 0.05, 0.7, 3.0] {
            let phi = |t: f64| {
                let (up, down) = (0.5 * exp(c * t), 0.5 * exp(-c * t));
                let rise = if c > 0.0 { (up - down) / c } else { t };
                up + down + gradient * rise
            };
            let weighted =
                |power: i32| integrate(|t| t.powi(power) * phi(t) * exp(-t), 0.0, 90.0, 1e-9).value;
            let mean = weighted(1) / weighted(0);
            let growth = growth_of_flights(c, gradient);
            assert!((growth - (1.0 - 1.0 / mean)).abs() < 1e-6, "{c} {gradient}: {growth} {mean}");
        }
    }
    assert_eq!(growth_of_flights(0.5, 0.3), 0.3);
}

const FROM_5: GuideRule = GuideRule { least_depth: Some(5.0), finder: Finder::Connections };

/// No light, no field; in parts thinner than a cell there is none, either, and walks are plain.
#[test]
fn where_nothing_guides() {
    let dark = scene(SPHERE, SMOOTH, medium(5.0, 0.9, 0.0), vec![cap(DVec3::Z, 1e-3, 0.0)]);
    assert!(first(Importance::of_bands(&dark, 16, GuideRule::EVERYWHERE)).is_none());
    let still = scene(SPHERE, SMOOTH, medium(5.0, 0.0, 0.0), vec![sky()]);
    let guided = WalkDraw::Guided { share: 0.9, nodes: 16, least_depth: Some(0.0), near_lights: true };
    assert!(first(Guidance::of_bands(&still, guided, Finder::Walks)).is_none());
    for shape in [SPHERE, Shape::Slab { thickness: 2.0 }] {
        // By similarity a mean free path becomes 1 / (1 - 0.9 * 0.8) of it; a third of this counts.
        for (g, unit) in [(0.0, 1.0), (0.8, (2.0 + 1.0 / 0.28) / 3.0)] {
            for (depth, is_deep) in [(4.99, false), (5.01, true)] {
                let scene = scene(shape.clone(), SMOOTH, medium(depth * unit, 0.9, g), vec![sky()]);
                let found = first(Importance::of_bands(&scene, 16, FROM_5));
                assert_eq!(found.is_some(), is_deep, "{shape:?} {g} {depth}");
            }
        }
    }
    // On a coarse grid, too, a ring is at most as deep as its radius, though there is more room in its middle.
    let ring = |radius| Shape::Mesh(procedural::torus(1.0, radius, [96, 24], false).expect("closed"));
    for (radius, is_deep) in [(0.06, false), (0.15, false), (0.2, false), (0.4, true)] {
        let scene = scene(ring(radius), SMOOTH, medium(20.0, 0.9, 0.0), vec![sky()]);
        for nodes in [4, 5, 8, 11, 16, 24] {
            let found = first(Importance::of_bands(&scene, nodes, FROM_5));
            assert!(found.is_none() || is_deep, "{radius} {nodes}");
            assert!(found.is_some() || !is_deep || nodes < 8, "{radius} {nodes}");
        }
    }
    // Where little is absorbed and a sky is everywhere, walks find the same whatever they do; not if light comes from one side.
    let bright = |albedo, boundary, light: Light| {
        first(Importance::of_bands(
            &scene(SPHERE, boundary, medium(8.0, albedo, 0.0), vec![light]),
            16,
            FROM_5,
        ))
    };
    assert!(bright(0.9999, SMOOTH, sky()).is_none() && bright(0.999, SMOOTH, sky()).is_some());
    assert!(bright(0.9999, ROUGH, sky()).is_some());
    // So it is in a body that is small beside the distance over which its boundary lets light in, where a relaxation that begins
    // far from the solution does not reach it.
    for (sigma_t, albedo) in [(0.25, 0.99), (0.1, 0.99), (0.1, 0.9999)] {
        let small = scene(SPHERE, SMOOTH, medium(sigma_t, albedo, 0.0), vec![sky()]);
        assert!(first(Importance::of_bands(&small, 16, GuideRule::EVERYWHERE)).is_none());
    }
    assert!(bright(0.9999, SMOOTH, cap(DVec3::Z, 0.5, 1.0)).is_some());
    let ring = Shape::Mesh(procedural::torus(1.0, 0.01, [24, 6], false).expect("closed"));
    let thin = scene(ring, SMOOTH, medium(5.0, 0.9, 0.0), vec![sky()]);
    let importance = first(Importance::of_bands(&thin, 4, GuideRule::EVERYWHERE));
    let is_lost = |i: u32| {
        let (s, c) = crate::math::sin_cos_turns(f64::from(i) / 100.0);
        let mut guide = StepGuide::NONE;
        importance.as_ref().is_none_or(|field| field.at(DVec3::new(c, s, 0.0), &mut guide) == 0.0)
    };
    assert!((0..100).any(is_lost), "a grid of 4 nodes resolves a ring of 0.01");
}

/// The rule of every kind of body, boundary, light, albedo and depth that it tells apart.
#[test]
fn where_walks_are_guided_by_default() {
    let slab = Shape::Slab { thickness: 2.0 };
    let mesh = Shape::Mesh(procedural::icosphere(1.0, 3, true).expect("closed"));
    let small: fn() -> Light = || cap(DVec3::Z, 0.01, 50.0);
    let sky: fn() -> Light = sky;
    // Depth is in the rule's units.
    for (shape, boundary, light, albedo, depth, expected) in [
        (SPHERE, SMOOTH, sky, 0.5, 2.9, false),
        (SPHERE, SMOOTH, sky, 0.5, 3.2, true),
        (SPHERE, SMOOTH, sky, 0.95, 2.9, false),
        (SPHERE, ROUGH, sky, 0.7, 2.9, false),
        (SPHERE, ROUGH, sky, 0.8, 0.1, true),
        (SPHERE, ROUGH, small, 0.8, 2.9, false),
        (SPHERE, ROUGH, small, 0.8, 3.2, true),
        (mesh.clone(), ROUGH, sky, 0.8, 0.1, true),
        (mesh.clone(), SMOOTH, sky, 0.8, 2.9, false),
        // What a mesh knows of its depth is a lower bound.
        (mesh, SMOOTH, sky, 0.8, 4.0, true),
        (slab.clone(), ROUGH, sky, 0.8, 2.9, false),
        (slab.clone(), ROUGH, sky, 0.8, 3.1, true),
        (SPHERE, Boundary::Matched, sky, 0.4, 9.0, false),
        (SPHERE, Boundary::Matched, sky, 0.5, 3.2, true),
        (SPHERE, Boundary::Matched, sky, 0.8, 2.9, false),
        (Shape::HalfSpace, Boundary::Matched, sky, 0.4, 1.0, false),
        (Shape::HalfSpace, SMOOTH, sky, 0.4, 1.0, true),
    ] {
        for (finder, g) in [(Finder::Walks, 0.0), (Finder::Connections, 0.0), (Finder::Walks, 0.8)] {
            // The albedo is that after similarity.
            let all = albedo / (1.0 - g * (1.0 - albedo));
            let unit = (2.0 + 1.0 / (1.0 - all * g)) / 3.0;
            let scene = scene(shape.clone(), boundary, medium(depth * unit, all, g), vec![light()]);
            let rule = GuideRule { least_depth: None, finder };
            let found = first(Importance::of_bands(&scene, 24, rule));
            assert_eq!(found.is_some(), expected, "{boundary:?} {albedo} {depth} {finder:?} {g}");
        }
    }
}

/// Walks through a smooth boundary do not find parallel light, and are not guided to it; connections do.
#[test]
fn walks_are_guided_to_what_they_find() {
    let sun = || directional(DVec3::new(0.8, 0.0, 0.6), 5.0);
    let at = |boundary, lights, finder| {
        let scene = scene(SPHERE, boundary, medium(10.0, 0.9, 0.0), lights);
        let rule = GuideRule { least_depth: None, finder };
        let importance = first(Importance::of_bands(&scene, 16, rule))?;
        Some([DVec3::X, DVec3::NEG_X].map(|x| importance.at(0.5 * x, &mut StepGuide::NONE.clone())))
    };
    let of_the_sky = at(SMOOTH, vec![sky()], Finder::Walks);
    assert!(of_the_sky.is_some());
    assert_eq!(at(SMOOTH, vec![sky(), sun()], Finder::Walks), of_the_sky);
    assert!(at(SMOOTH, vec![sun()], Finder::Walks).is_none());
    for (boundary, finder) in [(SMOOTH, Finder::Connections), (ROUGH, Finder::Walks)] {
        let [lit, dark] = at(boundary, vec![sky(), sun()], finder).expect("light comes in");
        assert!(lit > 1.3 * dark, "{boundary:?} {finder:?}: {lit} {dark}");
    }
}

/// What would be right in a half-space, with a way out wherever z > -1.
fn half_space(scene: &Scene, growth: f64) -> Aim {
    let rule = ExitRule::of(scene, 0, &Diffusion::of(scene, 0));
    let exit = rule.exit(DVec3::Z, DVec3::Z, 3.0, 1.0);
    assert!(exit.is_some_and(|exit| exit.parts().1 > 0.02));
    let pull = Pull::new(DVec3::Z * growth);
    Aim::Solution(Importance::HalfSpace { kappa: 2.0 * growth, pull, rule, exit })
}

/// Paths of a given field.
struct Misled(Field);

impl Estimator for Misled {
    fn pass(&self, bands: &[usize], key: &PassKey, scores: &mut Scores) {
        for &band in bands {
            for index in 0..self.0.scene.sensor.rays_per_pass() {
                let path = Path { field: &self.0, band, index, key };
                let guidance = self.0.guidance(band).expect("guided");
                let guided = GuidedBand::new(guidance, &self.0.scene.medium[band]);
                CameraWalk::trace(path, scores, Unrivalled, guided);
            }
        }
    }
}

/// Guides that are wrong, reversed, of another body, or too strong change no mean, in any class, at any boundary, under
/// parallel, narrow and wide light, in media that scatter forwards, evenly and backwards.
#[test]
fn wrong_guides_do_not_bias() {
    let bodies = || {
        let mesh = |smooth| procedural::torus(0.7, 0.3, [24, 12], smooth).expect("closed");
        [SPHERE, Shape::Mesh(mesh(false)), Shape::Mesh(mesh(true))]
    };
    let mut judged = 0;
    for (index, g) in [0.0, 0.8, -0.5].into_iter().enumerate() {
        for boundary in [SMOOTH, ROUGH, Boundary::Matched] {
            let lights = match boundary {
                Boundary::Smooth { .. } => vec![sky(), cap(DVec3::new(0.5, 0.1, 0.7), 0.2, 5.0)],
                _ => vec![
                    cap(DVec3::new(-0.5, 0.1, -0.7), 0.5, 2.0),
                    Light {
                        name: "sun".into(),
                        emission: Emission::Directional {
                            toward: DVec3::new(0.3, 0.4, 0.8).normalize(),
                            irradiance: vec![2.0],
                        },
                    },
                ],
            };
            let [sphere, flat, interpolated] = bodies();
            let body = [sphere, flat, interpolated].into_iter().nth(index).expect("three");
            let scene = scene(body, boundary, medium(2.0, 0.8, g), lights);
            let layout = Layout::new(&scene);
            let path = PathTracer::new(Arc::clone(&scene), Roulette::default()).expect("a scene for it");
            let name = format!("wrong_guides_do_not_bias {g} {boundary:?}");
            let (plain, _) = measure(&path, &layout, 800, &name);
            let constant = |growth: f64| half_space(&scene, growth);
            let aims = [
                ("right", Aim::Solution(solution(&scene, 16)), 0.9),
                ("another body's", constant(0.5), 0.8),
                ("reversed", constant(-0.5), 0.8),
                ("along the normal", Aim::Normal(0.6), 0.5),
            ];
            for (aim_name, aim, share) in aims {
                let turns = GuidedTurns::new(scene.medium[0].phase, scene.medium[0].albedo);
                let guidance = Guidance { share, turns, facets: 8, aim };
                let field = Field::new(Arc::clone(&scene), Roulette::default()).guided_by(&guidance);
                let (guided, _) = measure(&Misled(field), &layout, 800, &format!("{name} {aim_name}"));
                for (observable, (a, b)) in plain.iter().zip(&guided).enumerate() {
                    let error = (a.1 * a.1 + b.1 * b.1).sqrt();
                    // Rare classes have no normal means.
                    if a.0 == 0.0 || a.1 > 0.1 * a.0 || b.1 > 0.1 * a.0 {
                        continue;
                    }
                    judged += 1;
                    assert!(
                        (a.0 - b.0).abs() < 5.5 * error,
                        "{g} {boundary:?} {aim_name} {observable}: {a:?} {b:?}"
                    );
                }
            }
        }
    }
    println!("{judged} means are judged");
    assert!(judged > 150, "{judged}");
}

/// Where walks are guided, and in bright matched and rough bodies, light sampling leaves a sky to the walks and keeps a
/// small light; plain walks in dark ones sample both.
#[test]
fn even_lights_are_sampled_where_it_pays() {
    let lights = || vec![sky(), cap(DVec3::new(0.5, 0.1, 0.7), 0.01, 50.0)];
    let mesh = Shape::Mesh(procedural::icosphere(1.0, 2, false).expect("closed"));
    let draw = WalkDraw::Guided { share: 0.95, nodes: 16, least_depth: Some(5.0), near_lights: true };
    for shape in [SPHERE, mesh] {
        // An albedo of 0.9 is 0.64 after similarity, one of 0.95 is 0.79.
        for (boundary, albedo, depth, is_sampled) in [
            (ROUGH, 0.9, 2.0, true),
            (ROUGH, 0.95, 2.0, false),
            (ROUGH, 0.9, 10.0, false),
            (Boundary::Matched, 0.9, 2.0, true),
            (Boundary::Matched, 0.95, 2.0, false),
        ] {
            // Depth is that after similarity.
            let medium = medium(depth / (1.0 - albedo * 0.8), albedo, 0.8);
            let scene = scene(shape.clone(), boundary, medium, lights());
            let field = Field::with_walks(scene, Roulette::default(), draw, Finder::Walks);
            let field = field.finding_even_lights_where_it_pays();
            assert_eq!(field.guidance(0).is_some(), depth > 5.0);
            let [sky, small] = [0, 1].map(|light| field.choice[0][light]);
            assert!(
                small > 0.0 && (sky > 0.0) == is_sampled,
                "{boundary:?} {albedo} {depth}: {sky} {small}"
            );
        }
    }
}

/// Without absorption in a sky every path sees radiance 1, whatever guides it, and no event weighs more than 1 / (1 - q).
#[test]
fn furnace() {
    for (g, share) in [(0.0, 0.5), (0.7, 0.5)] {
        let scene = scene(SPHERE, SMOOTH, medium(5.0, 1.0, g), vec![sky()]);
        let layout = Layout::new(&scene);
        let aim = half_space(&scene, 0.2);
        let turns = GuidedTurns::new(scene.medium[0].phase, 1.0);
        let guidance = Guidance { share, turns, facets: 8, aim };
        let field = Field::new(Arc::clone(&scene), Roulette::default()).guided_by(&guidance);
        let (means, _) = measure(&Misled(field), &layout, 1500, "furnace of guided walks");
        let (mean, error) = means[0];
        assert!((mean - 1.0).abs() < 5.0 * error && error < 0.02, "{g}: {mean} {error}");
    }
}
