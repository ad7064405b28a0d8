//! No root is lost, none is found twice or where there is none.

use super::super::testing::{direction, entering, exhaustive, meshes, point_inside, stream};
use super::*;
use crate::geometry::procedural;
use crate::reference::refracting_plane::PlaneBeam;
use crate::reference::refracting_sphere::LitSphere;

fn all(conic: &Conic, shape: &Shape, query: &Query, work: &mut SolverWork) -> Vec<Root> {
    let mut roots = Vec::new();
    conic.roots(shape, query, work, &mut |root| roots.push(root));
    roots
}

/// Connections per mesh of the tests that compare with the search by subdivision.
const CONNECTIONS: u32 = 400;

#[test]
fn no_root_differs_from_exhaustive_subdivision() {
    let mut stream = stream("no_root_differs_from_exhaustive_subdivision");
    for eta in [1.5, 0.8] {
        for (name, shape) in meshes(3) {
            let conic = Conic::new(&shape);
            let (mut count, mut most, mut work) = (0, 0, SolverWork::default());
            let mut done = 0;
            while done < CONNECTIONS {
                let Some(x) = point_inside(&shape, &mut stream) else { continue };
                done += 1;
                let query = Query::new(x, direction(&mut stream), eta);
                let roots = all(&conic, &shape, &query, &mut work);
                count += roots.len();
                most = most.max(roots.len());
                let search = |depth: u32| {
                    let mut found = Vec::new();
                    for facet in conic.tree().expect("a mesh").facets() {
                        exhaustive(&query, facet, depth, &mut found);
                    }
                    found
                };
                let differs = |found: &[Root]| {
                    let is_in = |root: &Root, others: &[Root]| {
                        let same =
                            |o: &&Root| o.face == root.face && o.point.distance(root.point) < 1e-8;
                        others.iter().filter(same).count() == 1
                    };
                    found.len() != roots.len()
                        || !roots.iter().all(|root| is_in(root, found))
                        || !found.iter().all(|root| is_in(root, &roots))
                };
                let mut found = search(3);
                if differs(&found) {
                    found = search(8); // two roots in one part
                }
                assert!(!differs(&found), "{name} {eta} {query:?}:\n{roots:#?}\n{found:#?}");
            }
            let per = |n: u64| n as f64 / f64::from(done);
            println!(
                "{name}, eta {eta}: {:.3} roots (at most {most}), {:.1} nodes, {:.2} facets solved per connection",
                per(count as u64),
                per(work.nodes),
                per(work.solves)
            );
        }
    }
}

/// Light that is followed from its source is found from every point that it reaches.
#[test]
fn light_that_enters_is_found() {
    for body in bodies() {
        find_entering_light(body, 1600, |u| u);
    }
}

/// From depths of all orders down to 1e-12 of its way inside.
#[test]
fn light_that_enters_is_found_just_below_the_boundary() {
    for body in bodies() {
        find_entering_light(body, 400, of_every_order);
    }
}

#[test]
#[ignore = "5 minutes"]
fn light_that_enters_is_found_a_million_times() {
    std::thread::scope(|scope| {
        for body in bodies() {
            scope.spawn(|| find_entering_light(body, 1_000_000, |u| u));
        }
    });
}

#[test]
#[ignore = "minutes"]
fn light_that_enters_is_found_thousands_of_times_just_below_the_boundary() {
    std::thread::scope(|scope| {
        for body in bodies() {
            scope.spawn(|| find_entering_light(body, 10_000, of_every_order));
        }
    });
}

/// Parts of a length of all orders of magnitude down to 1e-12, equally often.
fn of_every_order(u: f64) -> f64 {
    (-u * 12.0 * std::f64::consts::LN_10).exp()
}

fn bodies() -> Vec<(&'static str, Shape)> {
    let mut bodies = meshes(3);
    bodies.push(("sphere", Shape::Sphere { radius: 1.3 }));
    bodies.push(("box", Shape::Box { half: DVec3::new(1.0, 0.5, 0.7) }));
    bodies
}

/// `part` is the part of its way inside at which light is looked for, of a uniform number.
fn find_entering_light((name, shape): (&str, Shape), entries: usize, part: impl Fn(f64) -> f64) {
    let mut stream = stream(&format!("light_that_enters_is_found, {name}"));
    let conic = Conic::new(&shape);
    let mut worst = 0.0f64;
    for eta in [1.05, 1.5, 2.2, 0.8] {
        let mut tried = 0;
        while tried < entries / 4 {
            let w_l = direction(&mut stream);
            let Some((hit, dir, length)) = entering(&shape, w_l, eta, stream.draw2()) else { continue };
            tried += 1;
            let distance = length * part(stream.draw());
            let query = Query::new(hit.point - dir * distance, w_l, eta);
            let roots = all(&conic, &shape, &query, &mut SolverWork::default());
            let miss = roots.iter().map(|r| r.point.distance(hit.point)).fold(f64::INFINITY, f64::min);
            let count = roots.len();
            assert!(
                miss < distance.min(1e-7),
                "{name} {eta} {query:?} {hit:?}: nearest of {count} at {miss:e}"
            );
            worst = worst.max(miss);
            for root in roots {
                assert!(root.ratio > 0.0 && !root.ratio.is_nan() && root.distance > 0.0);
                assert!((0.0..=1.0).contains(&root.transmittance));
            }
        }
    }
    println!("{name}: {entries} entries, found to {worst:.1e}");
}

/// The sphere against the scalar equation of the reference, in number, place and focusing.
#[test]
fn the_sphere_has_the_roots_of_its_scalar_equation() {
    let mut stream = stream("the_sphere_has_the_roots_of_its_scalar_equation");
    let shape = Shape::Sphere { radius: 1.3 };
    let conic = Conic::new(&shape);
    for eta in [1.05, 1.3, 1.5, 2.4] {
        let oracle = LitSphere { radius: 1.3, eta, reflections: 0 };
        for _ in 0..1000 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            let w_l = direction(&mut stream);
            let z = x.dot(w_l);
            let rho = (x - w_l * z).length();
            let mut expected: Vec<(f64, f64)> =
                oracle.rays([rho, z]).iter().map(|ray| (ray.distance, ray.magnification)).collect();
            let query = Query::new(x, w_l, eta);
            let roots = all(&conic, &shape, &query, &mut SolverWork::default());
            let mut got: Vec<(f64, f64)> =
                roots.iter().map(|r| (r.distance, eta * eta / r.ratio)).collect();
            for list in [&mut expected, &mut got] {
                list.sort_by(|a, b| a.0.total_cmp(&b.0));
            }
            assert_eq!(got.len(), expected.len(), "{eta} {query:?} {got:?} {expected:?}");
            for ((d, m), (d0, m0)) in got.iter().zip(&expected) {
                // A root moves by a rounding times the focusing, and the focusing by its square.
                let bound = 1e-12 * (1.0 + m0 * m0);
                // That of grazing light is as small as the cosine, which is known to a rounding.
                let relative = 10.0 * bound + 4.0 * f64::EPSILON / m0;
                assert!(
                    (d - d0).abs() < bound && (m / m0 - 1.0).abs() < relative,
                    "{eta} {query:?} {got:?} {expected:?}"
                );
            }
        }
    }
}

/// Half-space, slab and box have the plane's closed form.
#[test]
fn planes_have_their_closed_form() {
    let w_l = DVec3::new(0.3, -0.4, 0.8).normalize();
    let x = DVec3::new(0.1, 0.2, -0.4);
    let beam = PlaneBeam::new(w_l, 1.4).expect("from above");
    let (entry, distance) = beam.entry(x);
    for shape in [Shape::HalfSpace, Shape::Slab { thickness: 1.0 }] {
        let query = Query::new(x, w_l, 1.4);
        let roots = all(&Conic::new(&shape), &shape, &query, &mut SolverWork::default());
        let [root] = &roots[..] else { panic!("{roots:?}") };
        assert!(root.point.distance(entry) < 1e-15 && (root.distance - distance).abs() < 1e-15);
        assert!((1.4 * 1.4 / root.ratio / beam.magnification() - 1.0).abs() < 1e-14);
        assert!((root.transmittance - beam.transmittance).abs() < 1e-15);
    }
    // From below the half-space is dark, the slab is not.
    let query = Query::new(x, -w_l, 1.4);
    assert!(
        all(&Conic::new(&Shape::HalfSpace), &Shape::HalfSpace, &query, &mut SolverWork::default())
            .is_empty()
    );
    let slab = Shape::Slab { thickness: 1.0 };
    assert_eq!(all(&Conic::new(&slab), &slab, &query, &mut SolverWork::default()).len(), 1);
    // At grazing light, below the critical angle, every face that is lit and whose refracted direction
    // leads through it.
    let cube = Shape::Box { half: DVec3::ONE };
    let query = Query::new(DVec3::new(0.2, 0.1, -0.1), DVec3::new(0.6, 0.64, 0.48), 1.4);
    assert_eq!(all(&Conic::new(&cube), &cube, &query, &mut SolverWork::default()).len(), 3);
}

/// Without refraction the light comes straight, to the last bit.
#[test]
fn without_refraction_the_light_comes_straight() {
    let mut stream = stream("without_refraction_the_light_comes_straight");
    for (name, shape) in meshes(2) {
        let conic = Conic::new(&shape);
        for _ in 0..500 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            let query = Query::new(x, direction(&mut stream), 1.0);
            let roots = all(&conic, &shape, &query, &mut SolverWork::default());
            let Some(straight) = straight_line::root(&shape, &query, &mut SolverWork::default()) else {
                assert!(roots.is_empty()); // the shading normal faces away
                continue;
            };
            let [root] = &roots[..] else { panic!("{name}: {roots:?}") };
            assert_eq!((root.point, root.dir, root.transmittance), (straight.point, straight.dir, 1.0));
            assert!((root.ratio - 1.0).abs() < 1e-9, "{name} {}", root.ratio);
        }
    }
}

/// Just above 1 the conic finds what the straight line finds at 1, moved by a little.
#[test]
fn the_limit_without_refraction_is_continuous() {
    let mut stream = stream("the_limit_without_refraction_is_continuous");
    let (_, shape) = meshes(3).swap_remove(1);
    let conic = Conic::new(&shape);
    for eta in [1.0 + 1e-9, 1.0 - 1e-9] {
        let (mut done, mut single) = (0, 0);
        while done < 1000 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            done += 1;
            let query = Query::new(x, direction(&mut stream), eta);
            let roots = all(&conic, &shape, &query, &mut SolverWork::default());
            let straight =
                straight_line::root(&shape, &query, &mut SolverWork::default()).expect("a ray leaves");
            let near = roots.iter().any(|r| r.point.distance(straight.point) < 1e-6);
            single += u32::from(near && roots.len() == 1);
        }
        // Grazing light is turned by sqrt(2e-9) and may find another facet.
        assert!(single > 995, "{eta}: {single}");
    }
}

/// The energy inside: E over points x drawn by following the light of sum T M / density, the density of
/// x being that of every ray through it, is the light that enters times the length that it runs. For a
/// sphere the budget is a closed form.
#[test]
fn the_energy_budget_is_kept() {
    let mut stream = stream("the_energy_budget_is_kept");
    for eta in [1.3, 1.5] {
        let shape = Shape::Sphere { radius: 1.0 };
        let conic = Conic::new(&shape);
        let oracle = LitSphere { radius: 1.0, eta, reflections: 0 }.budget().value;
        let w_l = DVec3::new(0.48, -0.6, 0.64);
        let count = 40_000;
        let (mut sum, mut squares) = (0.0, 0.0);
        for _ in 0..count {
            let (hit, dir, length) = entering(&shape, w_l, eta, stream.draw2()).expect("a sphere");
            let query = Query::new(hit.point - dir * (length * stream.draw()), w_l, eta);
            let (mut energy, mut density) = (0.0, 0.0);
            conic.roots(&shape, &query, &mut SolverWork::default(), &mut |root| {
                let m = eta * eta / root.ratio;
                let chord = 2.0 * root.dir.dot(root.point);
                energy += root.transmittance * m;
                density += m / (std::f64::consts::PI * chord);
            });
            let value = energy / density;
            sum += value;
            squares += value * value;
        }
        let mean = sum / f64::from(count);
        let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
        println!("eta {eta}: {mean:.5} +- {error:.5}, budget {oracle:.5}");
        assert!((mean - oracle).abs() < 4.0 * error && error < 0.01, "{mean} {error} {oracle}");
    }
}

/// The corner cases of the sphere: its middle, its axis, its surface.
#[test]
fn special_points_of_the_sphere() {
    let shape = Shape::Sphere { radius: 2.0 };
    let conic = Conic::new(&shape);
    let w_l = DVec3::Z;
    let find =
        |x: DVec3, eta: f64| all(&conic, &shape, &Query::new(x, w_l, eta), &mut SolverWork::default());
    let middle = find(DVec3::ZERO, 1.5);
    assert_eq!(middle.len(), 1);
    assert!(middle[0].point.distance(DVec3::Z * 2.0) < 1e-12);
    for z in [-1.9, -1.0, 0.5, 1.9] {
        let axial = find(DVec3::Z * z, 1.5);
        assert!(axial.iter().any(|r| r.point.distance(DVec3::Z * 2.0) < 1e-9), "{z} {axial:?}");
        assert!(axial.iter().all(|r| r.ratio.is_finite()));
    }
    let on = find(DVec3::new(0.0, 1.2, 1.6), 1.5);
    assert!(on.iter().all(|r| !r.ratio.is_nan() && !r.distance.is_nan()), "{on:?}");
}

/// Razor-thin triangles, normals that turn by more than a right angle within a triangle, and a body far
/// from the origin: light that enters is found, and nothing is NaN.
#[test]
fn hard_meshes() {
    let mut stream = stream("hard_meshes");
    let far = procedural::icosphere(1.0, 2, true).expect("closed");
    let moved = far.vertices().iter().map(|v| *v * 0.01 + DVec3::new(100.0, -30.0, 7.0));
    let far = crate::geometry::Mesh::new(moved.collect(), far.triangles().to_vec(), None, true);
    let meshes = [
        ("thin ring", procedural::torus(1.0, 0.05, [3, 100], true), 1e-6),
        ("thin flat ring", procedural::torus(1.0, 0.05, [3, 100], false), 1e-9),
        ("spikes", procedural::bumpy_sphere(1.0, 3, 0.3, 300.0, true), 1e-6),
        ("icosahedron", procedural::icosphere(1.0, 0, true), 1e-9),
        ("plate", procedural::drilled_box(DVec3::new(1.0, 3.0, 0.01), [4, 1], 0.01), 1e-9),
        // Coordinates 1e4 times the size cost as many digits.
        ("far", far, 1e-7),
    ];
    for (name, mesh, bound) in meshes {
        let shape = Shape::Mesh(mesh.expect(name));
        let conic = Conic::new(&shape);
        let size = shape.bounds().map_or(1.0, |bounds| bounds.radius);
        let (mut tried, mut lost, mut worst) = (0, 0, 0.0f64);
        for eta in [1.3, 2.0, 0.8] {
            for _ in 0..800 {
                let w_l = direction(&mut stream);
                let Some((hit, dir, length)) = entering(&shape, w_l, eta, stream.draw2()) else {
                    continue;
                };
                let query = Query::new(hit.point - dir * (length * stream.draw()), w_l, eta);
                let roots = all(&conic, &shape, &query, &mut SolverWork::default());
                tried += 1;
                let nearest = roots
                    .iter()
                    .min_by(|p, q| p.point.distance(hit.point).total_cmp(&q.point.distance(hit.point)));
                let miss = nearest.map_or(f64::INFINITY, |root| root.point.distance(hit.point) / size);
                for root in &roots {
                    assert!(root.ratio >= 0.0 && !root.distance.is_nan(), "{name} {root:?}");
                }
                if miss > bound {
                    lost += 1;
                    println!("{name} {eta} {query:?} {hit:?} {miss:e} {}", roots.len());
                } else {
                    worst = worst.max(miss);
                }
            }
        }
        println!("{name}: {tried} entries, {lost} lost, others found to {worst:.1e}");
        assert!(tried > 80 && lost == 0, "{name}: {lost} of {tried}");
    }
}
