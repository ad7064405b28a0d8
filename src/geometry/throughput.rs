//! Figures of speed, printed by an ignored test.

use std::time::Instant;

use super::testing::{Uniform, direction, inward};
use super::{FaceId, Ray, Side, procedural};
use crate::math::{cbrt, ln};

/// `cargo test --release --lib throughput -- --ignored --nocapture`
#[test]
#[ignore = "prints figures, checks nothing"]
fn throughput() {
    const RAYS: usize = 1_000_000;
    for subdivisions in [6, 8] {
        let start = Instant::now();
        let mesh = procedural::bumpy_sphere(1.0, subdivisions, 0.1, 6.0, true).expect("closed");
        let (built, count) = (start.elapsed().as_secs_f64(), mesh.triangles().len());
        println!("{count} triangles: {built:.2} s, {} MB", mesh.heap_bytes() / 1_000_000);
        let mut u = Uniform::named("throughput");
        let rays: Vec<Ray> = (0..RAYS)
            .map(|_| {
                let radius = 0.9 * cbrt(u.next());
                Ray { origin: direction(&mut u) * radius, dir: direction(&mut u) }
            })
            .collect();
        let on_surface: Vec<(Ray, Option<FaceId>)> = (rays.iter())
            .filter_map(|ray| mesh.intersect(ray, Side::Inside, None, f64::INFINITY))
            .map(|hit| (Ray { origin: hit.point, dir: -inward(hit.normal, &mut u) }, Some(hit.face)))
            .collect();
        let measure = |what: &str, cast: &mut dyn FnMut(usize) -> bool| {
            let start = Instant::now();
            let hits = (0..RAYS).filter(|&i| cast(i)).count();
            let speed = RAYS as f64 / start.elapsed().as_secs_f64() / 1e6;
            println!("  {what:32} {speed:7.2} Mrays/s, {hits} hits");
        };
        let inside = |t_max: f64| {
            let mesh = &mesh;
            let rays = &rays;
            move |i: usize| mesh.search(&rays[i], Side::Inside, None, t_max).is_some()
        };
        measure("closest, from inside", &mut inside(f64::INFINITY));
        measure("shadow, from the surface", &mut |i| mesh.occluded(&on_surface[i].0, on_surface[i].1));
        for mean in [0.3, 0.1, 0.03, 0.01] {
            let mut u = Uniform::named("throughput");
            let mut t_max = move || -mean * ln(1.0 - u.next());
            let mut again = t_max.clone();
            measure(&format!("flights of {mean} R, tree"), &mut |i| inside(t_max())(i));
            measure(&format!("flights of {mean} R, grid"), &mut |i| {
                mesh.intersect(&rays[i], Side::Inside, None, again()).is_some()
            });
        }
        // The same along walks of isotropic scattering that start and end on the surface.
        for mean in [0.1, 0.03, 0.01] {
            let walk = |what: &str, grid: bool| {
                let mut u = Uniform::named("throughput");
                let (mut ray, mut from) = on_surface[0];
                ray.dir = -ray.dir;
                measure(&format!("walk of mfp {mean} R, {what}"), &mut |_| {
                    let t_max = -mean * ln(1.0 - u.next());
                    let hit = match grid {
                        true => mesh.intersect(&ray, Side::Inside, from, t_max),
                        false => mesh.search(&ray, Side::Inside, from, t_max),
                    };
                    (ray, from) = match hit {
                        Some(hit) => {
                            let dir = inward(hit.normal, &mut u);
                            (Ray { origin: hit.point, dir }, Some(hit.face))
                        }
                        None => (Ray { origin: ray.at(t_max), dir: direction(&mut u) }, None),
                    };
                    hit.is_some()
                });
            };
            walk("tree", false);
            walk("grid", true);
        }
    }
}
