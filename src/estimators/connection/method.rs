//! The methods that find roots, behind one interface.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::conic::Conic;
use super::facet::SolverWork;
use super::throughput::{Query, Root};
use super::{manifold, newton, straight_line};
use crate::geometry::{FaceId, Shape};
use crate::math::DVec3;
use crate::sampling::stream::Stream;

/// How a medium vertex is connected to a light through the boundary.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum ConnectionMethod {
    /// All roots: per triangle a conic, and a polynomial on it.
    Conic {},
    /// One Newton iteration per triangle; may lose roots where normals are interpolated.
    Newton {},
    /// Manifold next-event estimation: one deterministic walk, at most one root.
    Mnee {},
    /// Specular manifold sampling: random walks, weighted by further trials.
    Sms {},
    /// All roots; single scattering by one point on each triangle's part of the camera ray.
    Segments {},
    /// The straight line through the boundary, not refracted: biased.
    StraightLine {},
}

impl ConnectionMethod {
    /// Whether it can refract at a microfacet, whose normal is not linear in the place on a triangle.
    pub(super) fn takes_slopes(self) -> bool {
        matches!(
            self,
            ConnectionMethod::Newton {} | ConnectionMethod::Mnee {} | ConnectionMethod::Sms {}
        )
    }
}

/// A root, and the factor of what it contributes.
#[derive(Clone, Copy, Debug)]
pub(super) struct WeightedRoot {
    pub root: Root,
    pub weight: f64,
}

/// A method, prepared for a body.
#[derive(Debug)]
pub(super) struct Solver {
    method: ConnectionMethod,
    conic: Conic,
}

impl Solver {
    pub(super) fn new(method: ConnectionMethod, shape: &Shape) -> Solver {
        Solver { method, conic: Conic::new(shape) }
    }

    pub(super) fn method(&self) -> ConnectionMethod {
        self.method
    }

    /// The complete solver, which every method has for the shapes that it does not search itself.
    pub(super) fn conic(&self) -> &Conic {
        &self.conic
    }

    /// Puts the roots that the method finds into `found`. Hidden ones may be among them.
    pub(super) fn roots(
        &self,
        shape: &Shape,
        query: &Query,
        stream: &mut Stream,
        work: &mut SolverWork,
        found: &mut Vec<WeightedRoot>,
    ) {
        let mut all = |root: Root| found.push(WeightedRoot { root, weight: 1.0 });
        match self.method {
            ConnectionMethod::Conic {} | ConnectionMethod::Segments {} => {
                self.conic.roots(shape, query, work, &mut all);
            }
            ConnectionMethod::Newton {} => newton::roots(&self.conic, shape, query, work, &mut all),
            ConnectionMethod::Mnee {} => manifold::mnee(shape, query, work).into_iter().for_each(all),
            ConnectionMethod::Sms {} => {
                let sampled = manifold::sms(shape, query, stream, work);
                found.extend(sampled.map(|(root, weight)| WeightedRoot { root, weight }));
            }
            ConnectionMethod::StraightLine {} => {
                straight_line::root(shape, query, work).into_iter().for_each(all);
            }
        }
    }

    /// Whether the method finds the root of a query that is at this point of a face, so that its density
    /// there is known; `None` where the density is not: what such a method connects to is left to it alone.
    pub(super) fn finds(
        &self,
        shape: &Shape,
        query: &Query,
        at: (FaceId, DVec3),
        work: &mut SolverWork,
    ) -> Option<bool> {
        match self.method {
            ConnectionMethod::Conic {} | ConnectionMethod::Segments {} => Some(true),
            ConnectionMethod::Sms {} | ConnectionMethod::StraightLine {} => None,
            ConnectionMethod::Newton {} => Some(newton::finds(shape, query, at, work)),
            ConnectionMethod::Mnee {} => {
                let root = manifold::mnee(shape, query, work);
                Some(root.is_some_and(|root| manifold::is_same(&root, at.1)))
            }
        }
    }

    /// Memory behind it, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        self.conic.heap_bytes()
    }
}
