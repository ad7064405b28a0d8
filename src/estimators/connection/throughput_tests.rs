//! The forms of the focusing, against each other and against finite differences.

use super::super::patch::{Facet, SurfacePatch};
use super::super::testing::{direction, entering, meshes, stream};
use super::*;
use crate::geometry::{Ray, Shape, Side};
use crate::reference::differences;

/// Irradiance across the ray at x over that outside, without T, from the light's side: the area across w
/// onto which the rays through a unit of the surface spread. With p on the surface, x = p - d w and
/// w = (w_L + m N) / eta, where m = eta ct - cl and dm = (cl / (eta ct) - 1) w_L . dN at fixed w_L.
fn light_side(patch: &SurfacePatch, dir: DVec3, distance: f64, w_l: DVec3, eta: f64) -> f64 {
    let n = patch.shading;
    let (cl, eta_ct) = (w_l.dot(n), eta * dir.dot(n));
    let Frame { s, t, .. } = Frame::about(patch.normal);
    let [a, b] = [s, t].map(|dp| {
        let dn = patch.turn(dp);
        let dw = (n * ((cl / eta_ct - 1.0) * w_l.dot(dn)) + dn * (eta_ct - cl)) / eta;
        let dx = dp - dw * distance;
        dx - dir * dir.dot(dx)
    });
    w_l.dot(patch.normal) / a.cross(b).length()
}

/// eta^2 (ctg / d^2) |dp / dw_L| at fixed x, by the implicit function of the constraint: (d r / d p) dp
/// = -(d r / d w_L) dw_L.
fn implicit(patch: &SurfacePatch, query: &Query) -> f64 {
    let at = query.constraint(patch);
    let Frame { s, t, .. } = Frame::about(patch.normal);
    let [a, b] = [s, t].map(|dp| {
        let across = dp - at.dir * at.dir.dot(dp);
        let change = across * (query.eta / at.distance) - patch.turn(dp) * at.along;
        DVec2::new(at.frame.s.dot(change), at.frame.t.dot(change))
    });
    let light = Frame::about(query.w_l);
    let [c, d] = [light.s, light.t].map(|dw| -DVec2::new(at.frame.s.dot(dw), at.frame.t.dot(dw)));
    let per_light = c.perp_dot(d).abs() / a.perp_dot(b).abs();
    query.eta * query.eta * at.dir.dot(patch.normal) / (at.distance * at.distance) * per_light
}

/// A patch about a point of a body.
fn patch_at(shape: &Shape, face: FaceId, point: DVec3, normal: DVec3) -> SurfacePatch {
    SurfacePatch::at(shape, face, point, normal)
}

/// On spheres, flat and bumpy meshes with interpolated normals: form by the implicit function to 1e-9,
/// the light's side with Veach's factor to 1e-9, and finite differences through intersection and Snell's
/// law to 1e-7 where the ray stays on its facet.
#[test]
fn all_forms_agree() {
    let mut stream = stream("all_forms_agree");
    let mut bodies = meshes(2);
    bodies.push(("sphere", Shape::Sphere { radius: 1.3 }));
    bodies.push(("box", Shape::Box { half: DVec3::new(1.0, 0.5, 0.7) }));
    for (name, shape) in &bodies {
        let (mut compared, mut most, mut most_veach) = (0, 0.0f64, 0.0f64);
        for eta in [1.0, 1.1, 1.5, 2.2, 0.8] {
            for _ in 0..400 {
                let w_l = direction(&mut stream);
                let Some((hit, dir, length)) = entering(shape, w_l, eta, stream.draw2()) else {
                    continue;
                };
                let distance = length * (0.05 + 0.9 * stream.draw());
                let x = hit.point - dir * distance;
                let patch = patch_at(shape, hit.face, hit.point, hit.normal);
                let query = Query::new(x, w_l, eta);
                let Judgement::Root(root) = query.judge(&patch, 1e-9) else {
                    panic!("{name} {eta}: light that enters is no root: {:?}", query.constraint(&patch));
                };
                let m = eta * eta / root.ratio;
                let (cl, ct) = (w_l.dot(patch.shading), dir.dot(patch.shading));
                let (clg, ctg) = (w_l.dot(patch.normal), dir.dot(patch.normal));
                if cl.min(ct).min(clg).min(ctg) < 0.05 || m > 100.0 {
                    continue; // where roundings and steps are magnified
                }
                compared += 1;
                assert!((implicit(&patch, &query) / m - 1.0).abs() < 1e-9, "{name} {eta}");
                let veach = (clg * ct) / (ctg * cl);
                let of_light = light_side(&patch, dir, distance, w_l, eta);
                assert!((of_light / (m * veach) - 1.0).abs() < 1e-9, "{name} {eta}");
                most_veach = most_veach.max((veach - 1.0).abs());
                // Through the surface that the patch stands for: its own facet, continued, or the
                // sphere.
                let map = |w: DVec3| -> Option<DVec3> {
                    let n = match shape {
                        Shape::Mesh(mesh) => {
                            let facet = Facet::new(mesh, hit.face.0);
                            let t = (facet.corner - x).dot(facet.normal) / w.dot(facet.normal);
                            facet.patch(facet.place(x + w * t)).shading
                        }
                        _ => {
                            shape.intersect(&Ray { origin: x, dir: w }, Side::Inside, None, 1e9)?.normal
                        }
                    };
                    let ct = w.dot(n);
                    let cl2 = 1.0 - eta * eta * (1.0 - ct * ct);
                    (cl2 > 0.0).then(|| w * eta + n * (cl2.sqrt() - eta * ct))
                };
                let step = 1e-3 * cl * cl;
                if let Some(ratio) = differences::solid_angle_ratio(map, dir, step) {
                    most = most.max((ratio / root.ratio - 1.0).abs());
                }
            }
        }
        assert!(compared > 500, "{name}: {compared}");
        println!(
            "{name}: {compared} compared, differences {most:.1e}, Veach's factor off 1 by {most_veach:.1e}"
        );
        assert!(most < 1e-7, "{name}: {most}");
        assert_eq!(most_veach > 1e-6, name.contains("interpolated"), "{name}: {most_veach}");
    }
}

/// eta = 1: nothing is focused, J = 1 and T = 1.
#[test]
fn a_matched_boundary_does_nothing() {
    let mut stream = stream("a_matched_boundary_does_nothing");
    for (name, shape) in meshes(2) {
        for _ in 0..200 {
            let w_l = direction(&mut stream);
            let Some((hit, dir, length)) = entering(&shape, w_l, 1.0, stream.draw2()) else { continue };
            let patch = patch_at(&shape, hit.face, hit.point, hit.normal);
            let query = Query::new(hit.point - dir * (0.5 * length), w_l, 1.0);
            let Judgement::Root(root) = query.judge(&patch, 1e-12) else { panic!("{name}") };
            // Rounding of directions, over the cosines that are divided by.
            let bound = 1e-14 / (w_l.dot(patch.shading) * w_l.dot(patch.normal));
            assert!((root.ratio - 1.0).abs() < bound, "{name} {root:?} {bound:e}");
            assert!((root.dir - w_l).length() < 1e-12 && root.transmittance == 1.0);
        }
    }
}

/// At a rough boundary: the area of slopes per solid angle of w against finite differences of the slopes that
/// refract to where a turned ray meets its facet, or the sphere.
#[test]
fn slopes_per_direction_are_differences() {
    let mut stream = stream("slopes_per_direction_are_differences");
    let mut bodies = meshes(2);
    bodies.push(("sphere", Shape::Sphere { radius: 1.3 }));
    for (name, shape) in &bodies {
        let (mut compared, mut most) = (0, 0.0f64);
        for eta in [1.3, 1.6, 0.8] {
            for _ in 0..300 {
                let w_l = direction(&mut stream);
                let Some((hit, dir, length)) = entering(shape, w_l, eta, stream.draw2()) else {
                    continue;
                };
                let x = hit.point - dir * (length * (0.1 + 0.8 * stream.draw()));
                // A ray beside the one that the smooth boundary would refract.
                let [a, b] = stream.draw2().map(|u| 0.3 * (u - 0.5));
                let frame = Frame::about(dir);
                let on_surface = |w: DVec3| -> Option<SurfacePatch> {
                    match shape {
                        Shape::Mesh(mesh) => {
                            let facet = Facet::new(mesh, hit.face.0);
                            let t = (facet.corner - x).dot(facet.normal) / w.dot(facet.normal);
                            Some(facet.patch(facet.place(x + w * t)))
                        }
                        _ => {
                            let hit =
                                shape.intersect(&Ray { origin: x, dir: w }, Side::Inside, None, 1e9)?;
                            Some(patch_at(shape, hit.face, hit.point, hit.normal))
                        }
                    }
                };
                let toward = |a: f64, b: f64| (frame.n + frame.s * a + frame.t * b).normalize();
                let slopes = |w: DVec3| -> Option<DVec2> {
                    let patch = on_surface(w)?;
                    Some(Query::through(x, w_l, eta, patch.point, patch.shading).slopes)
                };
                let w = toward(a, b);
                let Some(patch) = on_surface(w) else { continue };
                let query = Query::through(x, w_l, eta, patch.point, patch.shading);
                let at = query.constraint(&patch);
                let facet = query.facet_normal(patch.shading);
                let cosines = [w, w_l].map(|v| v.dot(facet).min(v.dot(patch.normal)));
                if cosines[0].min(cosines[1]) < 0.1 || query.slopes.length() > 2.0 {
                    continue;
                }
                assert!(at.residual.length() < 1e-12, "{name}: {query:?} {at:?}");
                let across = Frame::about(w);
                let column = |u: DVec3| -> Option<DVec2> {
                    let central = |h: f64| {
                        let [p, q] = [h, -h].map(|h| slopes((w + u * h).normalize()));
                        Some((p? - q?) / (2.0 * h))
                    };
                    Some((central(1e-4)? * 4.0 - central(2e-4)?) / 3.0)
                };
                let (Some(p), Some(q)) = (column(across.s), column(across.t)) else { continue };
                let (expected, got) = (p.perp_dot(q).abs(), query.ratio(&patch, &at));
                compared += 1;
                most = most.max((got - expected).abs() / (1e-3 + expected));
            }
        }
        println!("{name}: {compared} compared, {most:.1e}");
        assert!(compared > 100 && most < 1e-6, "{name}: {compared} {most}");
    }
}
