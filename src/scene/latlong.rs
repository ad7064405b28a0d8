//! Latitude-longitude environment maps, importance-sampled per band.
//!
//! Radiance is constant inside a texel, so that its density can be exactly proportional to it: texel k
//! of row r subtends (cos theta_r - cos theta_{r+1}) 2 pi / width. A texel is drawn with probability
//! radiance * solid angle over their sum S (alias table), a direction uniformly inside it, and the
//! density of direction w is radiance(w) / S: no sine, no pole.
//!
//! +z is up (first row); the middle column looks along +x and azimuth grows towards the left edge,
//! as seen from inside, counter-clockwise from above.

use std::f64::consts::PI;

use crate::math::{DVec3, acos, atan2, cos, sin_cos_turns};
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
        let radiance = map.radiance[texel];
        (self.direction(texel, [v, u[1]]), radiance, radiance / map.strength)
    }

    /// A direction of a texel, uniform per solid angle.
    fn direction(&self, texel: usize, [v, u]: [f64; 2]) -> DVec3 {
        let (row, column) = (texel / self.width, texel % self.width);
        let z = self.edges[row] + v * (self.edges[row + 1] - self.edges[row]);
        let turns = 0.5 - (column as f64 + u) / self.width as f64;
        let (sin_phi, cos_phi) = sin_cos_turns(turns);
        let r = (1.0 - z * z).max(0.0).sqrt();
        DVec3::new(r * cos_phi, r * sin_phi, z)
    }

    /// The texel that a direction lies in.
    fn texel(&self, wi: DVec3) -> usize {
        let row = self.edges[1..self.height].partition_point(|&edge| edge >= wi.z);
        let turns = atan2(wi.y, wi.x) / (2.0 * PI);
        let column = ((0.5 - turns) * self.width as f64) as usize;
        row * self.width + column.min(self.width - 1)
    }

    /// Radiance times solid angle of a texel.
    fn weight(&self, radiance: &[f64], texel: usize) -> f64 {
        let row = texel / self.width;
        radiance[texel] * (self.edges[row] - self.edges[row + 1]) * 2.0 * PI / self.width as f64
    }

    /// The part of a band's map that is more than `excess` times as bright as its mean and at most
    /// `reach` (rad) from its brightest texel, as a light of its own. `None` if there is no such part.
    pub fn bright(&self, band: usize, excess: f64, reach: f64) -> Option<Bright> {
        let map = &self.bands[band];
        let least = excess * map.strength / (4.0 * PI);
        let middle = |texel| self.direction(texel, [0.5, 0.5]);
        let peak =
            (0..map.radiance.len()).max_by(|&a, &b| map.radiance[a].total_cmp(&map.radiance[b]))?;
        let within = cos(reach.min(PI));
        let belongs = |&texel: &usize| {
            map.radiance[texel] > least && middle(texel).dot(middle(peak)) >= within - 1e-12
        };
        let texels: Vec<usize> = (0..map.radiance.len()).filter(belongs).collect();
        let weights: Vec<f64> = texels.iter().map(|&t| self.weight(&map.radiance, t)).collect();
        let strength: f64 = weights.iter().sum();
        if strength <= 0.0 {
            return None;
        }
        let sum: DVec3 = texels.iter().zip(&weights).map(|(&t, &w)| w * middle(t)).sum();
        let axis = sum.try_normalize().unwrap_or(middle(peak));
        // The corners of texels reach a little farther than their middles.
        let texel = PI / self.height.min(self.width) as f64;
        let spread =
            texels.iter().map(|&t| acos(axis.dot(middle(t)).clamp(-1.0, 1.0))).fold(0.0, f64::max)
                + texel;
        let squares: f64 = texels.iter().zip(&weights).map(|(&t, &w)| w * map.radiance[t]).sum();
        let mut slot = vec![false; map.radiance.len()];
        texels.iter().for_each(|&t| slot[t] = true);
        Some(Bright {
            band,
            alias: AliasTable::new(&weights),
            texels,
            is_part: slot,
            strength,
            axis,
            half_angle: spread.min(PI),
            concentration: 4.0 * PI * squares / (strength * strength),
        })
    }

    /// Radiance and density in direction `wi`.
    pub fn eval(&self, band: usize, wi: DVec3) -> (f64, f64) {
        let map = &self.bands[band];
        let radiance = map.radiance[self.texel(wi)];
        (radiance, if map.strength > 0.0 { radiance / map.strength } else { 0.0 })
    }

    /// Memory that the map holds, bytes.
    pub fn memory_bytes(&self) -> usize {
        let bytes = |map: &BandMap| size_of_val(&*map.radiance) + map.alias.heap_bytes();
        self.bands.iter().map(bytes).sum()
    }

    /// Whether two bands are alike.
    pub fn is_same_in(&self, a: usize, b: usize) -> bool {
        self.bands[a].radiance == self.bands[b].radiance
    }

    /// Radiance integrated over directions.
    pub fn strength(&self, band: usize) -> f64 {
        self.bands[band].strength
    }

    /// 4 pi int L^2 / (int L)^2.
    pub fn concentration(&self, band: usize) -> f64 {
        let radiance = &self.bands[band].radiance;
        let (mut strength, mut squares) = (0.0, 0.0);
        for (texel, value) in radiance.iter().enumerate() {
            let weight = self.weight(radiance, texel);
            strength += weight;
            squares += weight * value;
        }
        4.0 * PI * squares / (strength * strength)
    }
}

/// A bright part of a map, in one band, drawn by itself.
#[derive(Debug)]
pub struct Bright {
    band: usize,
    texels: Vec<usize>,
    is_part: Vec<bool>,
    alias: AliasTable,
    strength: f64,
    axis: DVec3,
    half_angle: f64,
    concentration: f64,
}

impl Bright {
    /// Direction, radiance and density, for the map that it is part of.
    pub fn sample(&self, map: &LatLong, u: [f64; 2]) -> (DVec3, f64, f64) {
        let (index, v) = self.alias.sample(u[0]);
        let texel = self.texels[index];
        let radiance = map.bands[self.band].radiance[texel];
        (map.direction(texel, [v, u[1]]), radiance, radiance / self.strength)
    }

    /// Density of [`Self::sample`] per solid angle; 0 outside the part.
    pub fn pdf(&self, map: &LatLong, wi: DVec3) -> f64 {
        let texel = map.texel(wi);
        if self.is_part[texel] { map.bands[self.band].radiance[texel] / self.strength } else { 0.0 }
    }

    /// Radiance integrated over the part's directions.
    pub fn strength(&self) -> f64 {
        self.strength
    }

    /// Mean direction, weighted by radiance.
    pub fn axis(&self) -> DVec3 {
        self.axis
    }

    /// Greatest angle between the axis and the part, rad, an upper bound.
    pub fn half_angle(&self) -> f64 {
        self.half_angle
    }

    /// 4 pi int L^2 / (int L)^2 over the part.
    pub fn concentration(&self) -> f64 {
        self.concentration
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

    /// The bright part of a map with a sun: only the sun's texels, with a density that is the part's
    /// share of the whole's, and samples that it evaluates alike.
    #[test]
    fn bright_part() {
        let (width, height) = (32, 16);
        let sun = |k: usize| (k / width == 4 || k / width == 5) && (k % width == 9 || k % width == 10);
        let plane: Vec<f64> =
            (0..width * height).map(|k| if sun(k) { 500.0 + k as f64 } else { 1.0 }).collect();
        let map = LatLong::new(width, height, vec![plane]);
        let part = map.bright(0, 10.0, 0.5).expect("a sun");
        assert_eq!(part.texels.len(), 4);
        let whole = map.strength(0);
        for i in 0..400 {
            let u = [(f64::from(i) + 0.5) / 400.0, f64::from(i * 37 % 400) / 400.0];
            let (wi, radiance, pdf) = part.sample(&map, u);
            assert!(radiance >= 500.0 && wi.angle_between(part.axis()) <= part.half_angle());
            assert_eq!(pdf, part.pdf(&map, wi));
            assert!((map.eval(0, wi).1 / (pdf * part.strength() / whole) - 1.0).abs() < 1e-12);
            let elsewhere = map.sample(0, u).0;
            assert_eq!(part.pdf(&map, elsewhere) > 0.0, map.eval(0, elsewhere).0 > 1.0);
        }
        // Four texels of nearly one radiance: 4 pi over their solid angle.
        let solid_angle: f64 =
            part.texels.iter().map(|&t| map.weight(&vec![1.0; width * height], t)).sum();
        assert!((part.concentration() * solid_angle / (4.0 * PI) - 1.0).abs() < 1e-3);
        assert!(map.bright(0, 1e6, PI).is_none());
    }

    #[test]
    fn black_maps_do_not_divide_by_zero() {
        let black = LatLong::new(4, 2, vec![vec![0.0; 8]]);
        assert_eq!(black.sample(0, [0.3, 0.4]).1, 0.0);
        assert_eq!(black.eval(0, DVec3::X), (0.0, 0.0));
    }
}
