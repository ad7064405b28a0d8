//! Figures of speed, printed by an ignored test.

use std::time::Instant;

use super::testing::{Uniform, direction};
use super::{Ray, Side, procedural};
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
        let mut u = Uniform::new(6);
        let rays: Vec<Ray> = (0..RAYS)
            .map(|_| {
                let radius = 0.9 * cbrt(u.next());
                Ray { origin: direction(&mut u) * radius, dir: direction(&mut u) }
            })
            .collect();
        let measure = |what: &str, cast: &mut dyn FnMut(&Ray) -> bool| {
            let start = Instant::now();
            let hits = rays.iter().filter(|ray| cast(ray)).count();
            let speed = RAYS as f64 / start.elapsed().as_secs_f64() / 1e6;
            println!("  {what:32} {speed:7.2} Mrays/s, {hits} hits");
        };
        let inside = |t_max| {
            let mesh = &mesh;
            move |ray: &Ray| mesh.search(ray, Side::Inside, None, t_max).is_some()
        };
        measure("closest, from inside", &mut inside(f64::INFINITY));
        measure("shadow, from outside", &mut |ray| {
            mesh.occluded(&Ray { origin: ray.origin * 2.5, dir: ray.dir }, None)
        });
        for mean in [0.3, 0.1, 0.03, 0.01] {
            let mut u = Uniform::new(7);
            let mut t_max = move || -mean * ln(1.0 - u.next());
            let mut again = t_max.clone();
            measure(&format!("flights of {mean} R, tree"), &mut |ray| inside(t_max())(ray));
            measure(&format!("flights of {mean} R, grid"), &mut |ray| {
                mesh.intersect(ray, Side::Inside, None, again()).is_some()
            });
        }
    }
}
