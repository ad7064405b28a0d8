//! Latitude-longitude environment maps, importance-sampled per band.
//!
//! Radiance is constant inside a texel, so that its density can be exactly proportional to it: texel k
//! of row r subtends (cos theta_r - cos theta_{r+1}) 2 pi / width. A texel is drawn with probability
//! radiance * solid angle over their sum S (alias table), a direction uniformly inside it, and the density
//! of direction w is radiance(w) / S: no sine, no pole.
//!
//! +z is up (first row); the middle column looks along +x and azimuth grows towards the left edge,
//! as seen from inside, counter-clockwise from above.

use std::f64::consts::PI;

use crate::math::{DVec3, atan2, cos, sin_cos_turns};
use crate::sampling::discrete::AliasTable;

/// A map of radiance.
#[derive(Debug)]
pub struct LatLong {
    width: usize,
    height: usize,
    bands: Vec<BandMap>,
    /// cos theta of the row edges, height + 1 numbers from 1 down to -1.
    edges: Vec<f64>,
}

#[derive(Debug)]
struct BandMap {
    radiance: Vec<f64>,
    /// S of the module's comment.
    strength: f64,
    alias: AliasTable,
}

impl LatLong {
    /// From one row-major plane of radiance per band, W/(mm^2 sr), finite and not negative.
    pub fn new(width: usize, height: usize, planes: Vec<Vec<f64>>) -> LatLong {
        let edge = |r: usize| match r {
            0 => 1.0,
            r if r == height => -1.0,
            r => cos(PI * r as f64 / height as f64),
        };
        let edges: Vec<f64> = (0..=height).map(edge).collect();
        let bands = planes
            .into_iter()
            .map(|radiance| {
                assert_eq!(radiance.len(), width * height);
                let texel = |k: usize| {
                    let row = k / width;
                    radiance[k] * (edges[row] - edges[row + 1]) * 2.0 * PI / width as f64
                };
                let weights: Vec<f64> = (0..radiance.len()).map(texel).collect();
                BandMap { strength: weights.iter().sum(), alias: AliasTable::new(&weights), radiance }
            })
            .collect();
        LatLong { width, height, bands, edges }
    }

    /// Direction, radiance and density.
    pub fn sample(&self, band: usize, u: [f64; 2]) -> (DVec3, f64, f64) {
        let map = &self.bands[band];
        if map.strength == 0.0 {
            return (DVec3::Z, 0.0, 1.0);
        }
        // One number chooses the texel; what is left of it places the direction inside the row.
        let (texel, v) = map.alias.sample(u[0]);
        let (row, column) = (texel / self.width, texel % self.width);
        let z = self.edges[row] + v * (self.edges[row + 1] - self.edges[row]);
        let turns = 0.5 - (column as f64 + u[1]) / self.width as f64;
        let (sin_phi, cos_phi) = sin_cos_turns(turns);
        let r = (1.0 - z * z).max(0.0).sqrt();
        let radiance = map.radiance[texel];
        (DVec3::new(r * cos_phi, r * sin_phi, z), radiance, radiance / map.strength)
    }

    /// Radiance and density in direction `wi`.
    pub fn eval(&self, band: usize, wi: DVec3) -> (f64, f64) {
        let map = &self.bands[band];
        let row = self.edges[1..self.height].partition_point(|&edge| edge >= wi.z);
        let turns = atan2(wi.y, wi.x) / (2.0 * PI);
        let column = ((0.5 - turns) * self.width as f64) as usize;
        let radiance = map.radiance[row * self.width + column.min(self.width - 1)];
        (radiance, if map.strength > 0.0 { radiance / map.strength } else { 0.0 })
    }

    /// Memory that the map holds, bytes.
    pub fn memory_bytes(&self) -> usize {
        let bytes = |map: &BandMap| size_of_val(&*map.radiance) + map.alias.heap_bytes();
        self.bands.iter().map(bytes).sum()
    }

    /// Radiance integrated over directions.
    pub fn strength(&self, band: usize) -> f64 {
        self.bands[band].strength
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map() -> LatLong {
        let (width, height) = (16, 9);
        let plane: Vec<f64> =
            (0..width * height).map(|k| if k % 5 == 0 { 0.0 } else { ((k * k) % 37) as f64 }).collect();
        LatLong::new(width, height, vec![plane])
    }

    /// D5: what is drawn has the radiance and density that evaluation reports (off the exact edges of
    /// texels, where a direction belongs to two).
    #[test]
    fn sample_and_eval_agree() {
        let map = map();
        for i in 0..200 {
            for j in 0..50 {
                let u = [(f64::from(i) + 0.5) / 200.3, (f64::from(j) + 0.5) / 50.0];
                let (wi, radiance, pdf) = map.sample(0, u);
                assert_eq!(map.eval(0, wi), (radiance, pdf), "{u:?}");
                assert!(radiance > 0.0);
            }
        }
    }

    /// D7 and D3: the density integrates to 1 (exactly: it is constant per texel), and the alias table
    /// gives every texel its share, by enumeration.
    #[test]
    fn texels_get_their_share() {
        let map = map();
        let n = 1 << 20;
        let mut counts = vec![0u32; map.width * map.height];
        for k in 0..n {
            let (wi, _, _) = map.sample(0, [(f64::from(k) + 0.5) / f64::from(n), 0.5]);
            let row = map.edges[1..map.height].partition_point(|&edge| edge >= wi.z);
            let turns = atan2(wi.y, wi.x) / (2.0 * PI);
            counts[row * map.width + ((0.5 - turns) * map.width as f64) as usize] += 1;
        }
        let mut mass = 0.0;
        for (k, &count) in counts.iter().enumerate() {
            let row = k / map.width;
            let solid_angle = (map.edges[row] - map.edges[row + 1]) * 2.0 * PI / map.width as f64;
            let share = map.bands[0].radiance[k] * solid_angle / map.bands[0].strength;
            mass += share;
            // A texel is made of at most a few intervals of u, each counted to one step.
            assert!((f64::from(count) / f64::from(n) - share).abs() < 20.0 / f64::from(n), "texel {k}");
        }
        assert!((mass - 1.0).abs() < 1e-12);
    }

    #[test]
    fn black_maps_do_not_divide_by_zero() {
        let black = LatLong::new(4, 2, vec![vec![0.0; 8]]);
        assert_eq!(black.sample(0, [0.3, 0.4]).1, 0.0);
        assert_eq!(black.eval(0, DVec3::X), (0.0, 0.0));
    }
}
