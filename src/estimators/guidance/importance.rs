//! Importance inside a body: the amount of light that a photon that scatters at x will find, up to a factor.
//!
//! In the diffusion approximation, with the exact asymptotic growth kappa of transport in its place:
//!   lap(phi) = kappa^2 phi   inside,      phi + 2 A D dphi/dn = k s(y)   on the boundary,
//! where s(y) is the light that enters at y (`incidence`), and A, D and k are those of [`super::diffusion`]. A
//! half-space and a slab have closed forms. Elsewhere phi is solved by finite volumes on cubic cells whose centres lie in the
//! body. A face between two cells carries (phi' - phi) h; one that the boundary cuts, in the direction e, carries
//!   w h^2 (k s - phi) / (2 A D + d),   w = |n.e|,   d = w t,
//! t being the distance from the centre to the boundary along e, n the normal there: of a plane the faces of the
//! staircase, weighted by w, have the area of the plane. h^2 kappa^2 is written 2 (cosh(kappa h) - 1), with which a plane
//! wave along an axis grows by e^{kappa h} from node to node, however coarse the grid is.
//!
//! Walks use the gradient of ln phi over sigma_t in their present cell, reduced where phi is no exponential
//! ([`growth_of_flights`]); cells just outside the body have the mean of their neighbours. Where there is no cell (in parts
//! thinner than one) or phi has underflowed, there is no gradient, and the walk is plain. The solution need not be exact, because it only guides.

mod lanes;
mod relax;

pub(super) use lanes::FoundLanes;

use super::diffusion::{Diffusion, growth_of_flights};
use super::exit::{ExitPlane, ExitRule, REACH, unit};
use super::incidence::{LetIn, TransmittedLight};
use super::rule::GuideRule;
use crate::geometry::{self, Ray, Shape};
use crate::math::{DVec3, Vec3, exp, ln, ln_1p};
use crate::optics::boundary::Boundary;
use crate::optics::guided::{Escape, Pull, StepGuide, bend};
use crate::optics::medium::Medium;
use crate::scene::Scene;
use relax::relax;

/// Importance in a body, one band.
#[derive(Clone, Debug)]
pub(super) enum Importance {
    /// e^{kappa z}.
    HalfSpace { kappa: f64, pull: Pull, rule: ExitRule, exit: Option<ExitPlane> },
    /// a e^{kappa z} + b e^{-kappa (z + thickness)}; exits above and below.
    Slab {
        is_bent: bool,
        kappa: f64,
        mean_free_path: f64,
        thickness: f64,
        a: f64,
        b: f64,
        rule: ExitRule,
        exits: [Option<ExitPlane>; 2],
    },
    /// Between nodes of a grid.
    Grid(ImportanceGrid),
}

/// Nodes at the middles of cubic cells.
#[derive(Clone, Debug)]
pub(super) struct ImportanceGrid {
    /// Where the first cell begins.
    low: DVec3,
    per_spacing: f64,
    counts: [usize; 3],
    /// Growth per mean free path; 0 where flights are straight.
    asymptotic: f64,
    /// Of the deepest point below the surface, mean free paths.
    depth: f64,
    nodes: Vec<Node>,
    rule: ExitRule,
    exits: Vec<ExitPlane>,
}

/// Cubic cells, counted along x first.
#[derive(Clone, Copy, Debug)]
struct Lattice {
    /// Middle of the first cell.
    first: DVec3,
    spacing: f64,
    counts: [usize; 3],
}

/// What a walk asks for: small, since the grid is to stay in the cache, and aligned, so that no node is in two cache lines.
#[derive(Clone, Copy, Debug)]
#[repr(align(32))]
struct Node {
    /// Unit, in single precision: [`unit`].
    axis: Vec3,
    /// In units that keep the body's range in single precision; 0 where nothing is known.
    phi: f32,
    /// The level of the pull in the last byte, before it the index of the exit; [`NO_EXIT`] where none is near.
    level_and_exit: u32,
}

const NO_EXIT: u32 = (1 << 24) - 1;

const UNKNOWN: Node = Node { axis: Vec3::Z, phi: 0.0, level_and_exit: NO_EXIT << 8 };

/// Walks through a smooth boundary stay plain in a finite body where the contrast of importance, times 1 - a g, is less than
/// this: they find nearly the same light whatever they do, and a plain step costs less. (With forward scattering a walk takes
/// more steps to one contrast, each of which costs.) Chosen between albedo 0.9999, where guided walks lost under a sky, and
/// 0.999, where they gained, in spheres of 6.3 mean free paths after similarity, with g from 0 to 0.95.
const LEAST_CONTRAST: f64 = 0.016;

/// Flights stay straight in bodies that are deep (in lengths 1 / kappa) and where importance grows slowly (per mean free path): there
/// bends gained 5 % of the variance (kappa = 0.08, depth 4) or nothing, for 4 to 7 % of the time.
const STRAIGHT_DEPTH: f64 = 3.0;
const STRAIGHT_GROWTH: f64 = 0.1;

/// phi where it is largest, as nodes keep it.
const LARGEST: f64 = 1e30;

impl Importance {
    /// Per band, with `nodes` cells along the longest side of a finite body; `None` where nothing scatters, no light comes
    /// in, or walks are plain by the rule.
    pub(super) fn of_bands(scene: &Scene, nodes: u32, rule: GuideRule) -> Vec<Option<Importance>> {
        let incidence = TransmittedLight::new(scene, rule.finder);
        let bands = 0..scene.bands();
        let let_in = |origin: DVec3, dir: DVec3| {
            let hit = scene.shape.leave(&Ray { origin, dir })?;
            Some(incidence.irradiance(&hit))
        };
        match *scene.shape {
            Shape::HalfSpace => {
                let Some(let_in) = let_in(DVec3::NEG_Z, DVec3::Z) else {
                    return vec![None; scene.bands()];
                };
                let half_space = |band: usize| {
                    let diffusion = Diffusion::of(scene, band);
                    let Diffusion { kappa, reach, boundary } = diffusion;
                    let pull = Pull::new(DVec3::Z * (kappa / scene.medium[band].sigma_t));
                    let LetIn { all, wide } = let_in[band];
                    let phi = boundary.kept * all / (1.0 + reach * kappa);
                    let rule = ExitRule::of(scene, band, &diffusion);
                    let exit = rule.exit(DVec3::ZERO, DVec3::Z, wide, phi);
                    Importance::HalfSpace { kappa, pull, rule, exit }
                };
                let guided = rule.guides(scene, f64::INFINITY);
                bands.map(|band| guided[band].then(|| half_space(band))).collect()
            }
            Shape::Slab { thickness } => {
                let guided = rule.guides(scene, 0.5 * thickness);
                if !guided.contains(&true) {
                    return vec![None; scene.bands()];
                }
                let middle = DVec3::new(0.0, 0.0, -0.5 * thickness);
                let (Some(top), Some(bottom)) = (let_in(middle, DVec3::Z), let_in(middle, -DVec3::Z))
                else {
                    return vec![None; scene.bands()];
                };
                let slab =
                    |band: usize| Importance::slab(scene, band, thickness, [top[band], bottom[band]]);
                bands.map(|band| guided[band].then(|| slab(band)).flatten()).collect()
            }
            _ => {
                let Some(cells) = Cells::of(&scene.shape, nodes) else {
                    return vec![None; scene.bands()];
                };
                let depth = cells.depth(&scene.shape);
                let guided = rule.guides(scene, depth);
                if !guided.contains(&true) {
                    return vec![None; scene.bands()];
                }
                let borders = cells.borders(&scene.shape, &incidence);
                let thinnest = scene.medium.iter().map(|medium| medium.sigma_t).filter(|s| *s > 0.0);
                let reach = REACH / thinnest.fold(f64::INFINITY, f64::min);
                let shores = cells.shores(&scene.shape, &borders, &incidence, reach);
                let grid = |band: usize| {
                    let sigma_t = scene.medium[band].sigma_t;
                    let diffusion = Diffusion::of(scene, band);
                    let solved = cells.solve(&borders, band, diffusion)?;
                    let Medium { albedo, phase, .. } = scene.medium[band];
                    if matches!(scene.boundary[band], Boundary::Smooth { .. })
                        && solved.contrast(&borders, band) * (1.0 - albedo * phase.g) < LEAST_CONTRAST
                    {
                        return None;
                    }
                    let rule = ExitRule::of(scene, band, &diffusion);
                    let mut grid = cells.grid(&solved, 1.0 / sigma_t, depth * sigma_t, diffusion, rule);
                    cells.place_exits(&mut grid, &solved, &shores, band, diffusion);
                    if grid.asymptotic < STRAIGHT_GROWTH && diffusion.kappa * depth > STRAIGHT_DEPTH {
                        grid.asymptotic = 0.0;
                    }
                    Some(Importance::Grid(grid))
                };
                bands.map(|band| guided[band].then(|| grid(band)).flatten()).collect()
            }
        }
    }

    /// What is let in: above, below.
    fn slab(scene: &Scene, band: usize, thickness: f64, let_in: [LetIn; 2]) -> Option<Importance> {
        let diffusion = Diffusion::of(scene, band);
        let Diffusion { kappa, reach, boundary } = diffusion;
        let [top, bottom] = let_in.map(|let_in| boundary.kept * let_in.all);
        if top + bottom <= 0.0 {
            return None;
        }
        // Without absorption phi is linear, which a slow growth is, too.
        let kappa = kappa.max(1e-3 / thickness);
        let (p, m, e) = (1.0 + reach * kappa, 1.0 - reach * kappa, exp(-kappa * thickness));
        let det = p * p - e * e * m * m;
        let (a, b) = ((top * p - bottom * e * m) / det, (bottom * p - top * e * m) / det);
        let mean_free_path = 1.0 / scene.medium[band].sigma_t;
        let rule = ExitRule::of(scene, band, &diffusion);
        let exits = [
            rule.exit(DVec3::ZERO, DVec3::Z, let_in[0].wide, a + b * e),
            rule.exit(-DVec3::Z * thickness, -DVec3::Z, let_in[1].wide, a * e + b),
        ];
        Some(Importance::Slab { is_bent: true, kappa, mean_free_path, thickness, a, b, rule, exits })
    }

    /// What guides a step from a point of the body, and phi; 0 where nothing is known.
    #[inline(always)]
    pub(super) fn at(&self, x: DVec3, guide: &mut StepGuide) -> f64 {
        let escape = |rule: &ExitRule, exit: &Option<ExitPlane>| {
            exit.as_ref().map_or(Escape::NONE, |exit| rule.escape(exit, x))
        };
        match self {
            Importance::HalfSpace { kappa, pull, rule, exit } => {
                *guide = StepGuide { pull: *pull, escape: escape(rule, exit), bend: 0.0 };
                exp(kappa * x.z)
            }
            Importance::Slab { is_bent, kappa, mean_free_path, thickness, a, b, rule, exits } => {
                let up = a * exp(kappa * x.z);
                let down = b * exp(-kappa * (x.z + thickness));
                let phi = up + down;
                let asymptotic = kappa * mean_free_path;
                let gradient = asymptotic * (up - down) / phi;
                let growth = growth_of_flights(asymptotic, gradient.abs()).copysign(gradient);
                if phi <= 0.0 || !growth.is_finite() {
                    *guide = StepGuide::NONE;
                    return 0.0;
                }
                let escape = escape(rule, &exits[usize::from(x.z < -0.5 * thickness)]);
                let pull = Pull::new(DVec3::Z * growth);
                let bend = if *is_bent { bend(asymptotic, pull.strength()) } else { 0.0 };
                *guide = StepGuide { pull, escape, bend };
                phi
            }
            Importance::Grid(grid) => grid.at(x, guide),
        }
    }

    /// What light finds that leaves the body at a boundary point, over phi there; 1 where there is no exit.
    #[inline]
    pub(super) fn gain_of_leaving(&self, at: DVec3) -> f64 {
        let gain = |rule: &ExitRule, exit: Option<&ExitPlane>| exit.map_or(1.0, |exit| rule.gain(exit));
        match self {
            Importance::HalfSpace { rule, exit, .. } => gain(rule, exit.as_ref()),
            Importance::Slab { thickness, rule, exits, .. } => {
                gain(rule, exits[usize::from(at.z < -0.5 * thickness)].as_ref())
            }
            Importance::Grid(grid) => gain(&grid.rule, grid.exit(grid.node(at))),
        }
    }

    /// Whether flights are bent anywhere.
    pub(super) fn is_bent(&self) -> bool {
        match self {
            Importance::HalfSpace { .. } => false,
            Importance::Slab { is_bent, .. } => *is_bent,
            Importance::Grid(grid) => grid.asymptotic > 0.0,
        }
    }

    /// Takes flights along the gradient alone, where the others do not pay.
    pub(super) fn straighten(&mut self) {
        match self {
            Importance::HalfSpace { .. } => {}
            Importance::Slab { is_bent, .. } => *is_bent = false,
            Importance::Grid(grid) => grid.asymptotic = 0.0,
        }
    }

    /// Of the deepest point below the surface, mean free paths.
    pub(super) fn depth(&self) -> f64 {
        match self {
            Importance::HalfSpace { .. } => f64::INFINITY,
            Importance::Slab { thickness, mean_free_path, .. } => 0.5 * thickness / mean_free_path,
            Importance::Grid(grid) => grid.depth,
        }
    }

    /// The largest phi.
    pub(super) fn largest(&self) -> f64 {
        match self {
            Importance::HalfSpace { .. } => 1.0,
            Importance::Slab { kappa, thickness, a, b, .. } => {
                let e = exp(-kappa * thickness);
                (a + b * e).max(a * e + b)
            }
            Importance::Grid(_) => LARGEST,
        }
    }

    /// Memory on the heap, bytes.
    pub(super) fn heap_bytes(&self) -> usize {
        match self {
            Importance::Grid(grid) => size_of_val(&*grid.nodes) + size_of_val(&*grid.exits),
            _ => 0,
        }
    }
}

impl ImportanceGrid {
    #[inline(always)]
    fn node(&self, x: DVec3) -> &Node {
        let counts = self.counts;
        let place = (x - self.low) * self.per_spacing;
        // The cast takes what is negative to 0.
        let cell = |axis: usize| (place[axis] as u32 as usize).min(counts[axis] - 1);
        &self.nodes[(cell(2) * counts[1] + cell(1)) * counts[0] + cell(0)]
    }

    #[inline(always)]
    fn exit(&self, node: &Node) -> Option<&ExitPlane> {
        self.exits.get((node.level_and_exit >> 8) as usize)
    }

    /// Of the cell that holds the point.
    #[inline(always)]
    fn at(&self, x: DVec3, guide: &mut StepGuide) -> f64 {
        let node = self.node(x);
        guide.pull = Pull { axis: unit(node.axis), level: (node.level_and_exit & 0xff) as usize };
        match self.exit(node) {
            Some(exit) => guide.escape = self.rule.escape(exit, x),
            None => guide.escape.chance = 0.0,
        }
        let is_bent = self.asymptotic > 0.0 && node.phi > 0.0;
        guide.bend = if is_bent { bend(self.asymptotic, guide.pull.strength()) } else { 0.0 };
        f64::from(node.phi)
    }
}

impl Solved {
    /// How much less a walk finds at worst than one that leaves at best: 1 - phi / s, the least phi and the largest s.
    fn contrast(&self, borders: &[[Option<Border>; 6]], band: usize) -> f64 {
        let least = self.phi.iter().copied().fold(f64::INFINITY, f64::min);
        let brightest = borders.iter().flatten().flatten().map(|border| border.let_in[band].all);
        1.0 - least / brightest.fold(0.0, f64::max)
    }
}

/// No cell.
const NONE: u32 = u32::MAX;

/// Cells that cover a body, and which of them have their middles inside.
struct Cells {
    lattice: Lattice,
    /// Per cell its number among those inside.
    numbers: Vec<u32>,
    /// Their indices.
    inside: Vec<usize>,
}

/// Directions of the six faces of a cell: -x, +x, -y, +y, -z, +z.
const FACES: [(usize, f64); 6] = [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, -1.0), (2, 1.0)];

/// Where the boundary cuts a face of a cell.
struct Border {
    at: DVec3,
    /// |cosine| between the normal and the axis.
    lean: f64,
    /// From the middle, along the axis.
    distance: f64,
    /// What goes in there, per band.
    let_in: Vec<LetIn>,
}

/// The boundary near a cell, as a plane.
struct Shore {
    at: DVec3,
    normal: DVec3,
    /// From the cell's middle, mm.
    distance: f64,
    /// What goes in there, per band.
    let_in: Vec<LetIn>,
}

/// Of the cells inside.
struct Solved {
    phi: Vec<f64>,
    /// Per face phi on the boundary and its distance, where the boundary cuts it.
    cut: Vec<[Option<(f64, f64)>; 6]>,
}

impl Lattice {
    fn place(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.counts;
        [index % nx, index / nx % ny, index / (nx * ny)]
    }

    fn middle(&self, index: usize) -> DVec3 {
        self.first + DVec3::from_array(self.place(index).map(|i| i as f64)) * self.spacing
    }

    /// The cell at an offset of -1, 0 or 1 along each axis.
    fn neighbour(&self, index: usize, offset: [isize; 3]) -> Option<usize> {
        let mut place = self.place(index);
        for axis in 0..3 {
            place[axis] = place[axis].checked_add_signed(offset[axis])?;
            if place[axis] >= self.counts[axis] {
                return None;
            }
        }
        let [i, j, k] = place;
        Some((k * self.counts[1] + j) * self.counts[0] + i)
    }

    /// The 27 cells around one, itself included, that there are.
    fn around(&self, index: usize) -> impl Iterator<Item = usize> + '_ {
        (0..27).filter_map(move |offset: isize| {
            self.neighbour(index, [offset % 3 - 1, offset / 3 % 3 - 1, offset / 9 - 1])
        })
    }
}

impl Cells {
    /// `None` where no middle is inside.
    fn of(shape: &Shape, nodes: u32) -> Option<Cells> {
        let [low, high] = extent(shape)?;
        let size = high - low;
        let spacing = size.max_element() / f64::from(nodes);
        // One cell more on either side, for the nodes outside that interpolation asks for.
        let counts = [0, 1, 2].map(|axis| (size[axis] / spacing).ceil() as usize + 2);
        let spare = DVec3::from_array(counts.map(|n| n as f64)) * spacing - size;
        let first = low - 0.5 * spare + 0.5 * spacing;
        let lattice = Lattice { first, spacing, counts };
        let all = 0..counts.iter().product();
        let inside: Vec<usize> = all.clone().filter(|&i| shape.contains(lattice.middle(i))).collect();
        let mut numbers = vec![NONE; all.len()];
        for (number, &index) in inside.iter().enumerate() {
            numbers[index] = number as u32;
        }
        (!inside.is_empty()).then_some(Cells { lattice, numbers, inside })
    }

    fn across(&self, index: usize, (axis, sign): (usize, f64)) -> u32 {
        let mut offset = [0; 3];
        offset[axis] = sign as isize;
        self.lattice.neighbour(index, offset).map_or(NONE, |index| self.numbers[index])
    }

    /// How far from the boundary a point inside may be (a lower bound of it), mm: the deepest middle, moved by less and less of a
    /// cell as long as that leads deeper.
    fn depth(&self, shape: &Shape) -> f64 {
        let below = |point: DVec3| (shape.clearance(point), point);
        let middles = self.inside.iter().map(|&index| below(self.lattice.middle(index)));
        let deeper = |a: (f64, DVec3), b: (f64, DVec3)| if b.0 > a.0 { b } else { a };
        let Some(mut deepest) = middles.reduce(deeper) else { return 0.0 };
        let mut step = 0.5 * self.lattice.spacing;
        while step > 0.01 * self.lattice.spacing {
            // No farther than the boundary: the clearance of a mesh does not tell outside from inside.
            let reach = step.min(deepest.0);
            let ways = DVec3::AXES.into_iter().flat_map(|axis| [axis * reach, axis * -reach]);
            let moved = ways.map(|way| below(deepest.1 + way)).fold(deepest, deeper);
            // Steps that gain next to nothing would only be many.
            step *= if moved.0 > deepest.0 + 0.01 * step { 1.0 } else { 0.5 };
            deepest = moved;
        }
        deepest.0
    }

    /// Where the boundary cuts faces of the cells inside.
    fn borders(&self, shape: &Shape, incidence: &TransmittedLight<'_>) -> Vec<[Option<Border>; 6]> {
        let border = |index: usize, face: (usize, f64)| {
            if self.across(index, face) != NONE {
                return None;
            }
            let (axis, sign) = face;
            let mut dir = DVec3::ZERO;
            dir[axis] = sign;
            let ray = Ray { origin: self.lattice.middle(index), dir };
            let hit = shape.leave(&ray)?;
            let lean = hit.normal.dot(dir).abs();
            let distance = hit.t.min(self.lattice.spacing);
            Some(Border { at: hit.point, lean, distance, let_in: incidence.irradiance(&hit) })
        };
        self.inside.iter().map(|&index| FACES.map(|face| border(index, face))).collect()
    }

    /// Where the boundary cuts the last cell inside in the direction of a face: what lies ahead, unless the body has a gap
    /// between two middles.
    fn border_ahead<'a>(
        &self,
        borders: &'a [[Option<Border>; 6]],
        mut index: usize,
        face: usize,
    ) -> Option<&'a Border> {
        loop {
            match self.across(index, FACES[face]) {
                NONE => return borders[self.numbers[index] as usize][face].as_ref(),
                next => index = self.inside[next as usize],
            }
        }
    }

    /// Per cell inside that is nearer to the boundary than `reach`, of what lies ahead along the axes the plane that is nearest.
    /// The light that goes in there is known from the border of the last cell before it, as a rule.
    fn shores(
        &self,
        shape: &Shape,
        borders: &[[Option<Border>; 6]],
        incidence: &TransmittedLight<'_>,
        reach: f64,
    ) -> Vec<Option<Shore>> {
        let same = 1e-6 * self.lattice.spacing;
        let shore = |&index: &usize| {
            let middle = self.lattice.middle(index);
            let within = reach + self.lattice.spacing;
            if shape.clearance(middle) > within {
                return None;
            }
            let ahead = |face: usize| {
                let (axis, sign) = FACES[face];
                let mut dir = DVec3::ZERO;
                dir[axis] = sign;
                let ray = Ray { origin: middle, dir };
                let hit = shape.leave(&ray)?;
                Some((hit.normal.dot(hit.point - middle), face, hit))
            };
            let nearest = (0..6).filter_map(ahead).min_by(|a, b| a.0.total_cmp(&b.0));
            let (distance, face, hit) = nearest.filter(|(distance, ..)| *distance < within)?;
            let border = self.border_ahead(borders, index, face);
            let let_in = match border.filter(|border| border.at.distance(hit.point) < same) {
                Some(border) => border.let_in.clone(),
                None => incidence.irradiance(&hit),
            };
            Some(Shore { at: hit.point, normal: hit.normal, distance, let_in })
        };
        self.inside.iter().map(shore).collect()
    }

    /// Gives the cells near the boundary their exits; those outside next to the body have the nearest plane of their
    /// neighbours.
    fn place_exits(
        &self,
        grid: &mut ImportanceGrid,
        solved: &Solved,
        shores: &[Option<Shore>],
        band: usize,
        diffusion: Diffusion,
    ) {
        let mut known: Vec<Option<ExitPlane>> = vec![None; self.numbers.len()];
        for (number, shore) in shores.iter().enumerate() {
            let Some(Shore { at, normal, distance, let_in }) = shore else { continue };
            let LetIn { all, wide } = let_in[band];
            let Diffusion { reach, boundary, .. } = diffusion;
            let phi = (boundary.kept * all * distance + solved.phi[number] * reach) / (distance + reach);
            known[self.inside[number]] = grid.rule.exit(*at, *normal, wide, phi);
        }
        for index in 0..self.numbers.len() {
            let middle = self.lattice.middle(index);
            let exit = if self.numbers[index] == NONE {
                let near = self.lattice.around(index).filter_map(|next| known[next]);
                near.min_by(|a, b| a.depth(middle).abs().total_cmp(&b.depth(middle).abs()))
            } else {
                known[index]
            };
            let Some(exit) = exit.filter(|_| grid.exits.len() < NO_EXIT as usize) else { continue };
            let place = &mut grid.nodes[index].level_and_exit;
            *place = (*place & 0xff) | (grid.exits.len() as u32) << 8;
            grid.exits.push(exit);
        }
    }

    /// By successive over-relaxation in a fixed order, from the constant that loses what is supplied: a body that exchanges little
    /// through its boundary would need very many sweeps to correct another mean.
    fn solve(
        &self,
        borders: &[[Option<Border>; 6]],
        band: usize,
        diffusion: Diffusion,
    ) -> Option<Solved> {
        let h = self.lattice.spacing;
        let e = exp((diffusion.kappa * h).min(300.0));
        let loss = e + 1.0 / e - 2.0;
        let count = self.inside.len();
        let mut near = vec![[NONE; 6]; count];
        let mut source = vec![0.0; count];
        let mut diagonal = vec![loss; count];
        let mut lost = loss * count as f64;
        for (number, &index) in self.inside.iter().enumerate() {
            for (face, border) in borders[number].iter().enumerate() {
                near[number][face] = self.across(index, FACES[face]);
                if near[number][face] != NONE {
                    diagonal[number] += 1.0;
                }
                if let Some(Border { lean, distance, let_in, .. }) = border {
                    let conductance = lean * h / (diffusion.reach + lean * distance);
                    diagonal[number] += conductance;
                    lost += conductance;
                    source[number] += conductance * diffusion.boundary.kept * let_in[band].all;
                }
            }
        }
        let supplied: f64 = source.iter().sum();
        if supplied <= 0.0 {
            return None;
        }
        let phi = relax(&near, &source, &diagonal, supplied / lost, self.lattice.counts);
        let cut = |(phi, borders): (&f64, &[Option<Border>; 6])| {
            [0, 1, 2, 3, 4, 5].map(|face: usize| {
                borders[face].as_ref().map(|Border { lean, distance, let_in, .. }| {
                    let share = lean * distance / (diffusion.reach + lean * distance);
                    (phi + share * (diffusion.boundary.kept * let_in[band].all - phi), *distance)
                })
            })
        };
        let cut = phi.iter().zip(borders).map(cut).collect();
        Some(Solved { phi, cut })
    }

    /// Growth at the nodes inside, and at those next to them.
    fn grid(
        &self,
        solved: &Solved,
        mean_free_path: f64,
        depth: f64,
        diffusion: Diffusion,
        rule: ExitRule,
    ) -> ImportanceGrid {
        let largest = solved.phi.iter().copied().fold(0.0, f64::max);
        let least = largest * (f64::from(f32::MIN_POSITIVE) / LARGEST);
        let mut known: Vec<Option<(DVec3, f64)>> = vec![None; self.numbers.len()];
        for (number, &index) in self.inside.iter().enumerate() {
            let phi = solved.phi[number];
            if phi.is_nan() || phi < least {
                continue;
            }
            // ln of what is on the other side of a face over what is here, and how far that is.
            let towards = |face: usize| match solved.cut[number][face] {
                Some((border, t)) if t > 0.0 => (ln_1p((border / phi - 1.0).max(-0.99)), t),
                Some(_) => (0.0, 0.0),
                None => match self.across(index, FACES[face]) {
                    NONE => (0.0, 0.0),
                    next => (ln(solved.phi[next as usize].max(least) / phi), self.lattice.spacing),
                },
            };
            let gradient = [0, 1, 2].map(|axis| {
                let [(down, d), (up, u)] = [towards(2 * axis), towards(2 * axis + 1)];
                if d + u > 0.0 { (up - down) / (d + u) * mean_free_path } else { 0.0 }
            });
            let gradient = DVec3::from_array(gradient);
            let growth = growth_of_flights(diffusion.kappa * mean_free_path, gradient.length());
            known[index] = Some((gradient.normalize_or_zero() * growth, phi));
        }
        let node = |index: usize| {
            let of_neighbours = || {
                let all: Vec<(DVec3, f64)> =
                    self.lattice.around(index).filter_map(|next| known[next]).collect();
                let count = all.len() as f64;
                let sum =
                    all.iter().fold((DVec3::ZERO, 0.0), |sum, node| (sum.0 + node.0, sum.1 + node.1));
                (count > 0.0).then(|| (sum.0 / count, sum.1 / count))
            };
            match known[index].or_else(of_neighbours) {
                Some((gradient, phi)) => {
                    let Pull { axis, level } = Pull::new(gradient);
                    let (axis, phi) = (axis.as_vec3(), (phi / largest * LARGEST) as f32);
                    Node { axis, phi, level_and_exit: NO_EXIT << 8 | level as u32 }
                }
                None => UNKNOWN,
            }
        };
        let nodes = (0..self.numbers.len()).map(node).collect();
        let Lattice { first, spacing, counts } = self.lattice;
        let (low, per_spacing) = (first - 0.5 * spacing, 1.0 / spacing);
        let (asymptotic, exits) = (diffusion.kappa * mean_free_path, Vec::new());
        ImportanceGrid { low, per_spacing, counts, asymptotic, depth, nodes, rule, exits }
    }
}

/// The least box that holds a finite body.
pub(super) fn extent(shape: &Shape) -> Option<[DVec3; 2]> {
    match *shape {
        Shape::Box { half } => Some([-half, half]),
        Shape::Mesh(ref mesh) => {
            let (low, high) = geometry::extent(mesh.vertices().iter().copied());
            Some([low, high])
        }
        _ => shape.bounds().map(|ball| [ball.center - ball.radius, ball.center + ball.radius]),
    }
}

#[cfg(test)]
impl Importance {
    /// What goes in near each cell of a finite body, first band: as borders know it, and computed anew.
    pub(super) fn let_in_near_cells(scene: &Scene, nodes: u32, reach: f64) -> [Vec<Option<LetIn>>; 2] {
        let incidence = TransmittedLight::new(scene, GuideRule::EVERYWHERE.finder);
        let cells = Cells::of(&scene.shape, nodes).expect("cells");
        let borders = cells.borders(&scene.shape, &incidence);
        let none: Vec<_> = borders.iter().map(|_| [const { None }; 6]).collect();
        [borders, none].map(|borders| {
            let shores = cells.shores(&scene.shape, &borders, &incidence, reach);
            shores.iter().map(|shore| Some(shore.as_ref()?.let_in[0])).collect()
        })
    }
}
