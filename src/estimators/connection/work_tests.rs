//! Cost and roots of a connection, method by method.

use super::facet::SolverWork;
use super::method::{ConnectionMethod, Solver};
use super::testing::{direction, point_inside, stream};
use super::throughput::Query;
use crate::geometry::{Shape, procedural};

const ETA: f64 = 1.4;

/// Connections of random points with random directions.
struct Found {
    connections: u32,
    roots: u32,
    /// Roots that magnify more than ten times.
    bright: u32,
    work: SolverWork,
}

fn connect(shape: &Shape, method: ConnectionMethod, connections: u32) -> Found {
    let solver = Solver::new(method, shape);
    let mut stream = stream("what_a_connection_costs");
    let mut found = Found { connections, roots: 0, bright: 0, work: SolverWork::default() };
    let (mut done, mut roots) = (0, Vec::new());
    while done < connections {
        let Some(x) = point_inside(shape, &mut stream) else { continue };
        done += 1;
        let query = Query::new(x, direction(&mut stream), ETA);
        // Trials of a method that draws must not move the points of the others.
        let mut trials = stream.clone();
        roots.clear();
        solver.roots(shape, &query, &mut trials, &mut found.work, &mut roots);
        found.roots += roots.len() as u32;
        found.bright += roots.iter().filter(|r| ETA * ETA / r.root.ratio > 10.0).count() as u32;
    }
    found
}

/// The table of `docs/subdivision.md`: random points, uniform on random chords, and random directions.
#[test]
#[ignore = "a table: --nocapture"]
fn what_a_connection_costs() {
    table(20_000);
}

/// On bumps one walk finds less than one iteration a triangle, and that no more than the complete solver.
#[test]
fn complete_methods_find_most() {
    table(300);
}

fn table(connections: u32) {
    let bumpy = |wavenumber: f64| {
        Shape::Mesh(procedural::bumpy_sphere(1.0, 5, 0.03, wavenumber, true).expect("closed"))
    };
    let bodies = [
        ("sphere", Shape::Sphere { radius: 1.0 }),
        ("lumpy", Shape::Mesh(procedural::lumpy_sphere(1.0, 5, 0.25, false).expect("closed"))),
        ("bumpy-6", bumpy(6.0)),
        ("bumpy-12", bumpy(12.0)),
        ("bumpy-40", bumpy(40.0)),
    ];
    println!("| body | method | roots | above 10 times, % | nodes | solves | Newton steps | rays |");
    println!("|---|---|---|---|---|---|---|---|");
    for (name, shape) in bodies {
        let methods = [
            ("conic", ConnectionMethod::Conic {}),
            ("newton", ConnectionMethod::Newton {}),
            ("mnee", ConnectionMethod::Mnee {}),
            ("sms", ConnectionMethod::Sms {}),
        ];
        let mut counts = Vec::new();
        for (method, of) in methods {
            let Found { connections, roots, bright, work } = connect(&shape, of, connections);
            let per = |n: u64| n as f64 / f64::from(connections);
            println!(
                "| {name} | {method} | {:.3} | {:.2} | {:.1} | {:.2} | {:.2} | {:.2} |",
                per(u64::from(roots)),
                100.0 * f64::from(bright) / f64::from(roots),
                per(work.nodes),
                per(work.solves),
                per(work.steps),
                per(work.rays)
            );
            counts.push(roots);
        }
        assert!(counts[2] <= counts[1] && counts[1] <= counts[0], "{name}: {counts:?}");
        assert!(!name.starts_with("bumpy") || counts[2] < counts[0], "{name}: {counts:?}");
    }
}
