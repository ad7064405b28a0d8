//! The roots that manifold walks find, compared with all roots.

use super::super::conic::Conic;
use super::super::testing::{direction, meshes, point_inside, stream};
use super::super::{newton, straight_line};
use super::*;

fn visible(conic: &Conic, shape: &Shape, query: &Query) -> Vec<Root> {
    let mut roots = Vec::new();
    conic.roots(shape, query, &mut SolverWork::default(), &mut |root| {
        let hit = first_hit(shape, query.x, root.dir);
        if hit.is_some_and(|hit| hit.t > root.distance * (1.0 - 1e-7)) {
            roots.push(root);
        }
    });
    roots
}

fn bodies() -> Vec<(&'static str, Shape)> {
    let mut bodies = meshes(3);
    bodies.retain(|(name, _)| name.contains("interpolated"));
    bodies.push(("sphere", Shape::Sphere { radius: 1.0 }));
    bodies
}

/// Newton and MNEE find nothing that is not a root. The shares that they find, of all roots and of their
/// light, are printed; on the sphere Newton is complete, and nowhere does MNEE find more than there is.
#[test]
fn newton_and_mnee_find_roots_only() {
    let mut stream = stream("newton_and_mnee_find_roots_only");
    for (name, shape) in bodies() {
        let conic = Conic::new(&shape);
        let (mut all, mut by_newton, mut by_mnee, mut several) = (0, 0, 0, 0);
        let (mut work, mut walks) = (SolverWork::default(), SolverWork::default());
        let mut done = 0;
        while done < 3000 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            done += 1;
            let query = Query::new(x, direction(&mut stream), 1.5);
            let mut roots = Vec::new();
            conic.roots(&shape, &query, &mut SolverWork::default(), &mut |root| roots.push(root));
            let seen = visible(&conic, &shape, &query);
            newton::roots(&conic, &shape, &query, &mut work, &mut |root| {
                assert!(
                    roots.iter().any(|other| is_same(other, root.point)),
                    "{name}: {root:?} {roots:?}"
                );
                by_newton += 1;
            });
            if let Some(root) = mnee(&shape, &query, &mut walks) {
                assert!(
                    seen.iter().any(|other| is_same(other, root.point)),
                    "{name}: {root:?} {seen:?}"
                );
                by_mnee += 1;
            }
            several += u32::from(seen.len() > 1);
            all += roots.len();
        }
        println!(
            "{name}: {all} roots, {by_newton} by Newton ({:.1} solves, {:.1} steps a connection), {by_mnee} by MNEE ({:.1} \
             steps), {several} of {done} points have several",
            work.solves as f64 / f64::from(done),
            work.steps as f64 / f64::from(done),
            walks.steps as f64 / f64::from(done),
        );
        assert!(by_newton <= all && by_mnee <= all);
        assert!(name != "sphere" || by_newton == all);
    }
}

/// Specular manifold sampling finds the sum over all visible roots, for points that have several.
#[test]
fn weighted_trials_sum_over_all_roots() {
    let mut stream = stream("weighted_trials_sum_over_all_roots");
    for (name, shape) in bodies() {
        let conic = Conic::new(&shape);
        let (mut done, mut work, mut trials) = (0, SolverWork::default(), 0);
        let mut worst = 0.0f64;
        while done < 6 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            let query = Query::new(x, direction(&mut stream), 1.5);
            let roots = visible(&conic, &shape, &query);
            if roots.len() < 2 {
                continue;
            }
            done += 1;
            let value = |root: &Root| root.transmittance * (1.0 - 0.5 * root.dir.dot(query.w_l));
            let expected: f64 = roots.iter().map(value).sum();
            let count = 3000;
            let (mut sum, mut squares) = (0.0, 0.0);
            for _ in 0..count {
                let found = sms(&shape, &query, &mut stream, &mut work);
                let score = found.map_or(0.0, |(root, weight)| weight * value(&root));
                sum += score;
                squares += score * score;
                trials += 1;
            }
            let mean = sum / f64::from(count);
            let error = ((squares / f64::from(count) - mean * mean) / f64::from(count)).sqrt();
            worst = worst.max((mean - expected).abs() / error);
            assert!(
                (mean - expected).abs() < 5.0 * error,
                "{name} {query:?}: {mean} +- {error}, {expected}"
            );
        }
        println!(
            "{name}: worst {worst:.1} standard errors, {:.1} walks and {:.1} steps a connection",
            work.solves as f64 / f64::from(trials),
            work.steps as f64 / f64::from(trials)
        );
    }
}

/// Without refraction every method finds the straight ray.
#[test]
fn without_refraction_all_methods_are_the_straight_line() {
    let mut stream = stream("without_refraction_all_methods_are_the_straight_line");
    for (name, shape) in bodies() {
        let conic = Conic::new(&shape);
        let mut compared = 0;
        for _ in 0..300 {
            let Some(x) = point_inside(&shape, &mut stream) else { continue };
            let query = Query::new(x, direction(&mut stream), 1.0);
            let Some(straight) = straight_line::root(&shape, &query, &mut SolverWork::default()) else {
                continue;
            };
            let mut work = SolverWork::default();
            let by_mnee = mnee(&shape, &query, &mut work);
            let by_sms = sms(&shape, &query, &mut stream, &mut work).map(|(root, weight)| {
                assert_eq!(weight, 1.0);
                root
            });
            let mut by_newton = Vec::new();
            newton::roots(&conic, &shape, &query, &mut work, &mut |root| by_newton.push(root));
            assert_eq!(by_newton.len(), 1);
            for root in [by_mnee, by_sms].into_iter().flatten().chain(by_newton) {
                compared += 1;
                assert!(root.point.distance(straight.point) < 1e-9, "{name}");
                assert!(
                    (root.transmittance - 1.0).abs() < 1e-12
                        && (root.distance - straight.distance).abs() < 1e-9
                );
            }
        }
        assert!(compared > 300, "{name} {compared}");
    }
}
