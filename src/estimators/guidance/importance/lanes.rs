//! Importance where several walks are.

use super::ImportanceGrid;
use crate::estimators::guidance::exit::fading;
use crate::math::lanes::{LANES, Lanes, VectorLanes, vector};
use crate::math::{DVec3, Vec3, Vectorized, renormalized, vectorized};
use crate::optics::guided::{GuideLanes, bend, strengths};

/// Vectors in single precision.
type Vec3Lanes = [[f32; LANES]; 3];

/// What is stored where walks are ([`super::Node`], [`super::ExitPlane`]). It is looked up as soon as it is known where that
/// is, since memory is slow.
#[derive(Clone, Debug)]
pub(in crate::estimators::guidance) struct FoundLanes {
    axes: Vec3Lanes,
    levels: [i32; LANES],
    phi: [f32; LANES],
    normals: Vec3Lanes,
    offsets: [f32; LANES],
    chances: [f32; LANES],
}

impl FoundLanes {
    /// Nothing.
    pub(in crate::estimators::guidance) fn none() -> FoundLanes {
        let (zero, none) = ([0.0; LANES], [[0.0; LANES]; 3]);
        let levels = [0; LANES];
        FoundLanes { axes: none, levels, phi: zero, normals: none, offsets: zero, chances: zero }
    }
}

impl ImportanceGrid {
    /// Looks up what is stored where a walk is.
    #[inline(always)]
    pub(in crate::estimators::guidance) fn find(&self, x: DVec3, lane: usize, found: &mut FoundLanes) {
        let node = self.node(x);
        set(&mut found.axes, lane, node.axis);
        found.levels[lane] = (node.level_and_exit & 0xff) as i32;
        found.phi[lane] = node.phi;
        // Without an exit, an escape has no chance.
        let (normal, offset, chance) = match self.exit(node) {
            Some(exit) => (exit.normal, exit.offset, exit.chance),
            None => (Vec3::Z, 0.0, 0.0),
        };
        set(&mut found.normals, lane, normal);
        (found.offsets[lane], found.chances[lane]) = (offset, chance);
    }

    /// The same for all walks.
    #[inline(always)]
    pub(in crate::estimators::guidance) fn find_all(
        &self,
        points: &VectorLanes,
        found: &mut FoundLanes,
    ) {
        for lane in 0..LANES {
            self.find(vector(points, lane), lane, found);
        }
    }

    /// What guides steps from these points, of which this has been found, and phi there.
    #[inline(always)]
    pub(in crate::estimators::guidance) fn guide_all(
        &self,
        points: &VectorLanes,
        found: &FoundLanes,
        guides: &mut GuideLanes,
    ) -> Lanes {
        guides.levels = found.levels;
        guides.least_cosines = [self.rule.least_cosine; LANES];
        let (sigma_t, asymptotic) = (self.rule.sigma_t, self.asymptotic);
        vectorized(Guides { sigma_t, asymptotic, points, found, guides })
    }
}

#[inline(always)]
fn set([x, y, z]: &mut Vec3Lanes, lane: usize, to: Vec3) {
    (x[lane], y[lane], z[lane]) = (to.x, to.y, to.z);
}

/// [`ImportanceGrid::at`] behind the look-up.
struct Guides<'a> {
    sigma_t: f64,
    asymptotic: f64,
    points: &'a VectorLanes,
    found: &'a FoundLanes,
    guides: &'a mut GuideLanes,
}

impl Vectorized for Guides<'_> {
    type Output = Lanes;

    #[inline(always)]
    fn call(self) -> Lanes {
        let Guides { sigma_t, asymptotic, points: [px, py, pz], found, guides } = self;
        let FoundLanes { axes: [ax, ay, az], normals: [nx, ny, nz], offsets, chances, .. } = found;
        let [mut axes, mut normals] = [[[0.0; LANES]; 3]; 2];
        let [mut chance, mut phi, mut bends] = [[0.0; LANES]; 3];
        let strengths = strengths(found.levels);
        let ([x, y, z], [u, v, w]) = (&mut axes, &mut normals);
        for lane in 0..LANES {
            let wide = |a: f32, b: f32, c: f32| {
                renormalized(DVec3::new(f64::from(a), f64::from(b), f64::from(c)))
            };
            let axis = wide(ax[lane], ay[lane], az[lane]);
            (x[lane], y[lane], z[lane]) = (axis.x, axis.y, axis.z);
            phi[lane] = f64::from(found.phi[lane]);
            let bend = bend(asymptotic, strengths[lane]);
            bends[lane] = if phi[lane] > 0.0 { bend } else { 0.0 };
            let normal = wide(nx[lane], ny[lane], nz[lane]);
            (u[lane], v[lane], w[lane]) = (normal.x, normal.y, normal.z);
            let depth = f64::from(offsets[lane]) - normal.dot(DVec3::new(px[lane], py[lane], pz[lane]));
            chance[lane] = f64::from(chances[lane]) * fading(depth, sigma_t);
        }
        (guides.axes, guides.normals, guides.chances) = (axes, normals, chance);
        guides.bends = bends;
        phi
    }
}
