//! Cubic voxels over a mesh: what grids about its surface have in common.

use super::tree::{MeshFrame, PAD};
use super::triangle::PreciseNormal;
use crate::math::DVec3;

/// Cubic voxels over the box around a mesh, x fastest. All lengths are in units of the mesh's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Voxels {
    /// Their least corner.
    corner: DVec3,
    /// The middle of the first one.
    first: DVec3,
    /// The edge of one: a power of two, so that dividing by it is exact.
    edge: f64,
    per_edge: f64,
    counts: [usize; 3],
}

impl Voxels {
    /// Voxels over the box (`min`, `max`), mm.
    pub(super) fn over(frame: &MeshFrame, (min, max): (DVec3, DVec3), edge: f64) -> Voxels {
        let corner = frame.place(min) - PAD;
        let size = frame.place(max) + PAD - corner;
        Voxels::at(corner, edge, size.to_array().map(|side| (side / edge) as usize + 1))
    }

    fn at(corner: DVec3, edge: f64, counts: [usize; 3]) -> Voxels {
        Voxels { corner, first: corner + 0.5 * edge, edge, per_edge: 1.0 / edge, counts }
    }

    /// Voxels of twice the edge over the same box.
    pub(super) fn coarser(&self) -> Voxels {
        Voxels::at(self.corner, 2.0 * self.edge, self.counts.map(|n| n.div_ceil(2)))
    }

    /// The edge of one.
    pub(super) fn edge(&self) -> f64 {
        self.edge
    }

    /// How many there are along each axis.
    #[inline]
    pub(super) fn counts(&self) -> [usize; 3] {
        self.counts
    }

    /// How many there are.
    pub(super) fn len(&self) -> usize {
        self.counts.iter().product()
    }

    /// The place of a voxel among the others.
    pub(super) fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    /// The index of the voxel at a place; none beside the box.
    #[inline]
    pub(super) fn index(&self, [i, j, k]: [usize; 3]) -> Option<usize> {
        let [nx, ny, nz] = self.counts;
        (i < nx && j < ny && k < nz).then(|| i + nx * (j + ny * k))
    }

    /// The index of the voxel of a point; none beside the box.
    #[inline]
    pub(super) fn index_of(&self, point: DVec3) -> Option<usize> {
        let (voxel, place) = self.voxel_of(point);
        if voxel.min_element() < 0.0 { None } else { self.index(place) }
    }

    /// Where a point is, in edges from the corner, and the place of its voxel: at 0 where that is negative.
    #[inline]
    fn voxel_of(&self, point: DVec3) -> (DVec3, [usize; 3]) {
        let voxel = (point - self.corner) * self.per_edge;
        // Not `map`, which is not inlined.
        (voxel, [voxel.x as usize, voxel.y as usize, voxel.z as usize])
    }

    /// The place of the voxel whose middle is nearest to a point, in fewer instructions: that of its voxel, but for rounding;
    /// beside the box one that has no index, and any where the point is farther away than 2^31 voxels, or is no number.
    #[inline(always)]
    pub(super) fn nearest(&self, point: DVec3) -> [usize; 3] {
        /// A sum with this is rounded to a whole number, whose bits are the last ones.
        const WHOLE: f64 = (3u64 << 51) as f64;
        let voxel = (point - self.first) * self.per_edge + WHOLE;
        let whole = |x: f64| x.to_bits() as u32 as usize;
        [whole(voxel.x), whole(voxel.y), whole(voxel.z)]
    }

    /// The middle of the voxel at a place.
    pub(super) fn center(&self, [i, j, k]: [usize; 3]) -> DVec3 {
        self.first + DVec3::new(i as f64, j as f64, k as f64) * self.edge
    }

    /// The voxel beside one along an axis.
    pub(super) fn beside(&self, index: usize, axis: usize, step: i8) -> Option<usize> {
        let at = self.place(index)[axis].checked_add_signed(step.into())?;
        let stride = self.stride(axis);
        (at < self.counts[axis]).then(|| index.wrapping_add_signed(isize::from(step) * stride as isize))
    }

    fn stride(&self, axis: usize) -> usize {
        self.counts[..axis].iter().product()
    }

    /// Visits the voxels that a triangle may touch: those in its box that its plane passes, where that is known.
    pub(super) fn touched(
        &self,
        triangle: &[DVec3; 3],
        normal: Option<PreciseNormal>,
        mut visit: impl FnMut(usize),
    ) {
        let [a, b, c] = *triangle;
        let (_, low) = self.voxel_of(a.min(b).min(c) - PAD);
        let (_, high) = self.voxel_of(a.max(b).max(c) + PAD);
        let plane = normal
            .map(|PreciseNormal(normal)| (normal, (0.5 * self.edge + PAD) * normal.abs().element_sum()));
        let [nx, ny, nz] = self.counts;
        for k in low[2]..=high[2].min(nz - 1) {
            for j in low[1]..=high[1].min(ny - 1) {
                for i in low[0]..=high[0].min(nx - 1) {
                    let is_passed = plane.is_none_or(|(normal, reach)| {
                        normal.dot(self.center([i, j, k]) - a).abs() <= reach
                    });
                    if is_passed {
                        visit(i + nx * (j + ny * k));
                    }
                }
            }
        }
    }

    /// Applies `step` to every line of voxels along an axis: it is given what the line holds, and changes a copy of it.
    pub(super) fn along<T: Copy>(&self, axis: usize, field: &mut [T], step: impl Fn(&[T], &mut [T])) {
        let (n, stride) = (self.counts[axis], self.stride(axis));
        let (mut line, mut changed) = (Vec::with_capacity(n), Vec::with_capacity(n));
        // Lines that begin side by side lie in one block.
        for block in field.chunks_exact_mut(n * stride) {
            for start in 0..stride {
                line.clear();
                line.extend(block[start..].iter().step_by(stride).copied());
                changed.clone_from(&line);
                step(&line, &mut changed);
                let places = block[start..].iter_mut().step_by(stride);
                places.zip(&changed).for_each(|(place, value)| *place = *value);
            }
        }
    }
}
