//! Bins in which the draws of a sampler are counted, chosen by the density alone and never by the draws.
//!
//! A piece of two dimensions starts as a grid whose resolution follows the mass of the piece. Boxes that hold
//! more than four times their share are quartered repeatedly; boxes that would expect fewer than 25 draws are
//! merged with neighbours. Periodic axes begin at an irrational offset, so that symmetry planes are not edges
//! of bins. A piece of one dimension has bins of equal mass, further edges in its upper tail at 1 - 2^-k, and
//! bins of mass 1e-4 at both ends. Coarse bins are unions of fine ones; both are unions of leaves, whose masses
//! are integrated.

use super::quadrature::{Area, Mass, Quadrature, wrap};
use crate::samplers::Coordinate;

/// Least number of draws that a bin expects.
pub(crate) const LEAST: f64 = 25.0;
/// Coarse bins of two dimensions, in all, before boxes are quartered and joined.
const COARSE: f64 = 256.0;
/// Coarse bins of one dimension.
const COARSE_LINE: f64 = 64.0;
/// Boxes are quartered at most this often.
const DEPTH: u32 = 8;
/// Where periodic axes begin, as a fraction of the period: 1 / golden ratio^2.
const OFFSET: f64 = 0.381_966_011_250_105_15;

/// Something of mass that is no box of a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Extra {
    /// A discrete outcome.
    Delta(usize),
    /// The sampler returned no sample.
    Null,
}

/// Leaves, and the bins that they are joined to.
#[derive(Clone, Debug)]
pub(crate) struct Partition {
    maps: Vec<LeafMap>,
    /// Areas of the leaves.
    pub leaves: Vec<Area>,
    /// Coarse bin of each leaf, then of each extra.
    pub coarse: Vec<usize>,
    /// Fine bin of each leaf, then of each extra.
    pub fine: Vec<usize>,
    /// Number of coarse bins.
    pub coarse_count: usize,
    /// Number of fine bins.
    pub fine_count: usize,
}

/// From points of a piece to leaves.
#[derive(Clone, Debug)]
enum LeafMap {
    Line { range: [f64; 2], edges: Vec<f64>, first: usize },
    Plane(Plane),
}

#[derive(Clone, Debug)]
struct Plane {
    axes: [Coordinate; 2],
    low: [f64; 2],
    grid: [usize; 2],
    /// The grid's boxes, the second coordinate fastest, then quarters of boxes.
    nodes: Vec<Node>,
}

#[derive(Clone, Copy, Debug)]
enum Node {
    Leaf(usize),
    /// Four quarters from here on, the second coordinate fastest.
    Quarters(usize),
}

/// A square block of a plane's grid, or a box within one of its boxes.
#[derive(Clone, Copy)]
enum Patch {
    Grid { at: [usize; 2], size: [usize; 2] },
    Node(usize),
}

impl Partition {
    /// Bins for `samples` draws. `extras` are discrete outcomes and a null with their masses.
    pub(crate) fn new(quadrature: &mut Quadrature, samples: u64, extras: &[(Extra, f64)]) -> Partition {
        let n = samples as f64;
        let shares = shares(quadrature);
        let mut builder = PartitionBuilder { n, quadrature, leaves: Vec::new(), masses: Vec::new() };
        let mut maps = Vec::new();
        let (mut coarse, mut thin): (Vec<Vec<usize>>, Vec<usize>) = (Vec::new(), Vec::new());
        for (piece, share) in shares.into_iter().enumerate() {
            let is_line = builder.quadrature.pieces()[piece].dimensions == 1;
            let (map, blocks) =
                if is_line { builder.line(piece, share) } else { builder.plane(piece, share) };
            maps.push(map);
            let (bins, rest) = builder.join(blocks);
            coarse.extend(bins);
            thin.extend(rest);
        }
        let PartitionBuilder { leaves, mut masses, .. } = builder;
        let count = leaves.len();
        // Within a coarse bin: the leaves one by one, thin ones joined.
        let mass = |bin: &[usize], masses: &[f64]| bin.iter().map(|&i| masses[i]).sum::<f64>();
        for (i, (_, extra)) in extras.iter().enumerate() {
            masses.push(*extra);
            if n * extra >= LEAST { coarse.push(vec![count + i]) } else { thin.push(count + i) }
        }
        if n * mass(&thin, &masses) >= LEAST {
            coarse.push(thin);
        } else if !thin.is_empty() {
            let lightest = (0..coarse.len())
                .min_by(|&a, &b| mass(&coarse[a], &masses).total_cmp(&mass(&coarse[b], &masses)));
            match lightest {
                Some(bin) => coarse[bin].extend(thin),
                None => coarse.push(thin),
            }
        }
        let mut partition = Partition {
            maps,
            leaves,
            coarse: vec![0; masses.len()],
            fine: vec![0; masses.len()],
            coarse_count: coarse.len(),
            fine_count: 0,
        };
        for (number, bin) in coarse.into_iter().enumerate() {
            bin.iter().for_each(|&leaf| partition.coarse[leaf] = number);
            let single: Vec<Vec<usize>> = bin.iter().map(|&leaf| vec![leaf]).collect();
            let (fine, rest) = join(single, n, &masses);
            // What is thin as a whole is one fine bin too.
            for group in fine.into_iter().chain((!rest.is_empty()).then_some(rest)) {
                group.iter().for_each(|&leaf| partition.fine[leaf] = partition.fine_count);
                partition.fine_count += 1;
            }
        }
        partition
    }

    /// The leaf of a point; none where it lies outside the chart or is not a number.
    #[inline]
    pub(crate) fn leaf(&self, piece: usize, at: [f64; 2]) -> Option<usize> {
        match self.maps.get(piece)? {
            LeafMap::Line { range, edges, first } => {
                let inside = at[0] >= range[0] && at[0] <= range[1];
                let inner = &edges[1..edges.len() - 1];
                inside.then(|| first + inner.partition_point(|edge| *edge <= at[0]))
            }
            LeafMap::Plane(plane) => plane.leaf(at),
        }
    }
}

/// The mass of each piece, roughly. Everything that was integrated is forgotten.
pub(crate) fn shares(quadrature: &mut Quadrature) -> Vec<f64> {
    let pieces = quadrature.pieces().to_vec();
    let steps = |dimensions: usize| if dimensions == 1 { [64, 1] } else { [8, 8] };
    let masses = pieces.iter().enumerate().map(|(piece, p)| {
        let steps = steps(p.dimensions);
        let edge = |k: usize, i: usize| {
            p.axes[k].range[0] + (p.axes[k].range[1] - p.axes[k].range[0]) * i as f64 / steps[k] as f64
        };
        let boxes = (0..steps[0]).flat_map(|i| (0..steps[1]).map(move |j| (i, j)));
        let areas = boxes.map(|(i, j)| Area {
            piece,
            low: [edge(0, i), edge(1, j)],
            high: [edge(0, i + 1), edge(1, j + 1)],
        });
        areas.collect::<Vec<_>>()
    });
    let areas: Vec<Vec<Area>> = masses.collect();
    let sums: Vec<f64> = areas
        .into_iter()
        .map(|areas| areas.into_iter().map(|area| quadrature.add(0, area).value).sum())
        .collect();
    quadrature.forget();
    sums
}

struct PartitionBuilder<'q, 's> {
    n: f64,
    quadrature: &'q mut Quadrature<'s>,
    leaves: Vec<Area>,
    masses: Vec<f64>,
}

impl PartitionBuilder<'_, '_> {
    /// How many times finer the fine bins are than `coarse` bins, along a coordinate of two: 4, 2 or 1.
    fn finer(&self, coarse: f64) -> usize {
        let fits = |f: &usize| self.n >= 2.0 * LEAST * coarse * (f * f) as f64;
        [4, 2].into_iter().find(fits).unwrap_or(1)
    }

    fn leaf(&mut self, area: Area) -> usize {
        let leaf = self.leaves.len();
        let mass = self.quadrature.add(leaf, area);
        self.leaves.push(area);
        self.masses.push(mass.value);
        leaf
    }

    /// Stretches of a line, and the blocks of them that are coarse bins.
    fn line(&mut self, piece: usize, share: f64) -> (LeafMap, Vec<Vec<usize>>) {
        let range = self.quadrature.pieces()[piece].axes[0].range;
        let bins = (COARSE_LINE * share).min(self.n * share / (2.0 * LEAST)).round().max(1.0);
        let finer = self.finer(bins / share.max(1e-300));
        let finer = finer * finer;
        let count = bins as usize * finer;
        let mut marks: Vec<(f64, bool)> =
            (1..count).map(|j| (j as f64 / count as f64, j % finer == 0)).collect();
        let expected = self.n * share;
        let mut tail = 2.0 / bins;
        while expected * tail >= LEAST && bins > 1.0 {
            marks.push((1.0 - tail, true));
            tail *= 0.5;
        }
        if expected * 1e-4 >= LEAST {
            marks.extend([(1e-4, true), (1.0 - 1e-4, true)]);
        }
        marks.sort_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(&a.1)));
        marks.dedup_by(|a, b| a.0 - b.0 < 1e-12);
        let quantiles = self.quantiles(piece, range, &marks);
        let mut edges = vec![range[0]];
        let mut opens = vec![true];
        for (edge, (_, is_coarse)) in quantiles.into_iter().zip(&marks) {
            if edge > edges[edges.len() - 1] && edge < range[1] {
                edges.push(edge);
                opens.push(*is_coarse);
            }
        }
        edges.push(range[1]);
        let first = self.leaves.len();
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        for (ends, opens) in edges.windows(2).zip(opens) {
            let leaf = self.leaf(Area { piece, low: [ends[0], 0.0], high: [ends[1], 1.0] });
            match blocks.last_mut() {
                Some(block) if !opens => block.push(leaf),
                _ => blocks.push(vec![leaf]),
            }
        }
        (LeafMap::Line { range, edges, first }, blocks)
    }

    /// Points below which the piece has these parts of its mass, each to within a part in 1e9 of the
    /// range.
    fn quantiles(&mut self, piece: usize, range: [f64; 2], marks: &[(f64, bool)]) -> Vec<f64> {
        let steps = 1024;
        let edge = |i: usize| range[0] + (range[1] - range[0]) * i as f64 / steps as f64;
        let mut below = vec![0.0];
        for i in 0..steps {
            let mass = self.quadrature.stretch(piece, edge(i), edge(i + 1));
            below.push(below[i] + mass);
        }
        let all = below[steps];
        let mut find = |part: f64| {
            let wanted = part * all;
            let i = below.partition_point(|mass| *mass <= wanted).clamp(1, steps) - 1;
            let (mut low, mut high, mut known) = (edge(i), edge(i + 1), below[i]);
            let least = 1e-9 * (range[1] - range[0]);
            while high - low > least {
                let middle = 0.5 * (low + high);
                let half = self.quadrature.stretch(piece, low, middle);
                if known + half <= wanted {
                    (low, known) = (middle, known + half);
                } else {
                    high = middle;
                }
            }
            high
        };
        marks.iter().map(|(part, _)| find(*part)).collect()
    }

    /// Boxes of a plane, and the blocks of them that are coarse bins, in serpentines.
    fn plane(&mut self, piece: usize, share: f64) -> (LeafMap, Vec<Vec<usize>>) {
        let axes = self.quadrature.pieces()[piece].axes.clone();
        let bins = COARSE.min(self.n / (2.0 * LEAST)) * share;
        let side = (bins.sqrt().round() as usize).max(1);
        let total = COARSE.min(self.n / (2.0 * LEAST)).max(1.0);
        let finer = self.finer(total);
        let grid = [side * finer; 2];
        let length = |k: usize| axes[k].range[1] - axes[k].range[0];
        let low =
            [0, 1].map(|k| axes[k].range[0] + if axes[k].periodic { OFFSET * length(k) } else { 0.0 });
        let edge = |k: usize, i: usize| low[k] + length(k) * i as f64 / grid[k] as f64;
        let mut plane = Plane { axes: axes.clone(), low, grid, nodes: Vec::new() };
        for i in 0..grid[0] {
            for j in 0..grid[1] {
                let corners = ([edge(0, i), edge(1, j)], [edge(0, i + 1), edge(1, j + 1)]);
                let leaf = self.leaf(Area { piece, low: corners.0, high: corners.1 });
                plane.nodes.push(Node::Leaf(leaf));
            }
        }
        let most = 4.0 / (total * (finer * finer) as f64);
        for node in 0..plane.nodes.len() {
            self.quarter(&mut plane.nodes, node, most, DEPTH);
        }
        let blocks = self.blocks(&plane, side, finer, 4.0 / total);
        (LeafMap::Plane(plane), blocks)
    }

    /// Quarters a leaf that holds more than `most`, and its quarters likewise.
    fn quarter(&mut self, nodes: &mut Vec<Node>, node: usize, most: f64, depth: u32) {
        let Node::Leaf(leaf) = nodes[node] else { return };
        if depth == 0 || self.masses[leaf] <= most {
            return;
        }
        let Area { piece, low, high } = self.leaves[leaf];
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        self.quadrature.forget_owner(leaf);
        let quarters = nodes.len();
        nodes[node] = Node::Quarters(quarters);
        for q in 0..4 {
            let upper = [q / 2 == 1, q % 2 == 1];
            let area = Area {
                piece,
                low: [0, 1].map(|k| if upper[k] { middle[k] } else { low[k] }),
                high: [0, 1].map(|k| if upper[k] { high[k] } else { middle[k] }),
            };
            // The first quarter takes the leaf's number.
            let number = if q == 0 {
                self.leaves[leaf] = area;
                self.masses[leaf] = self.quadrature.add(leaf, area).value;
                leaf
            } else {
                self.leaf(area)
            };
            nodes.push(Node::Leaf(number));
        }
        for q in 0..4 {
            self.quarter(nodes, quarters + q, most, depth - 1);
        }
    }

    /// The coarse blocks of a plane as lists of leaves.
    fn blocks(&self, plane: &Plane, side: usize, finer: usize, most: f64) -> Vec<Vec<usize>> {
        let mut blocks = Vec::new();
        for i in 0..side {
            for j in 0..side {
                let j = if i % 2 == 0 { j } else { side - 1 - j };
                let block = Patch::Grid { at: [i * finer, j * finer], size: [finer; 2] };
                self.split(plane, block, most, &mut blocks);
            }
        }
        blocks
    }

    fn split(&self, plane: &Plane, block: Patch, most: f64, blocks: &mut Vec<Vec<usize>>) {
        let leaves = plane.leaves_of(block);
        let mass: f64 = leaves.iter().map(|&leaf| self.masses[leaf]).sum();
        match plane.parts(block) {
            Some(parts) if mass > most => {
                parts.into_iter().for_each(|part| self.split(plane, part, most, blocks));
            }
            _ => blocks.push(leaves),
        }
    }

    fn join(&self, blocks: Vec<Vec<usize>>) -> (Vec<Vec<usize>>, Vec<usize>) {
        join(blocks, self.n, &self.masses)
    }
}

/// Joins blocks that expect too few draws with the next such ones in order, and the last of them with
/// the one joined before, or with the block before. What is thin as a whole comes back as the rest.
fn join(blocks: Vec<Vec<usize>>, n: f64, masses: &[f64]) -> (Vec<Vec<usize>>, Vec<usize>) {
    let expected = |block: &[usize]| n * block.iter().map(|&i| masses[i]).sum::<f64>();
    let mut bins: Vec<Vec<usize>> = Vec::new();
    let mut thin: Vec<usize> = Vec::new();
    let mut last_joined = None;
    for block in blocks {
        if expected(&block) >= LEAST {
            bins.push(block);
            continue;
        }
        thin.extend(block);
        if expected(&thin) >= LEAST {
            last_joined = Some(bins.len());
            bins.push(std::mem::take(&mut thin));
        }
    }
    let target = last_joined.or(bins.len().checked_sub(1));
    if let Some(bin) = target {
        bins[bin].extend(std::mem::take(&mut thin));
    }
    (bins, thin)
}

impl Plane {
    #[inline]
    fn leaf(&self, at: [f64; 2]) -> Option<usize> {
        let mut t = [0.0; 2];
        let mut index = [0; 2];
        for k in 0..2 {
            let axis = &self.axes[k];
            let [from, to] = axis.range;
            // Written so that a NaN is outside.
            if !(at[k] >= from && at[k] <= to) {
                return None;
            }
            let mut x = at[k] - self.low[k];
            if x < 0.0 {
                x += to - from;
            }
            let scaled = x / (to - from) * self.grid[k] as f64;
            index[k] = (scaled as usize).min(self.grid[k] - 1);
            t[k] = scaled - index[k] as f64;
        }
        let mut node = index[0] * self.grid[1] + index[1];
        loop {
            match self.nodes[node] {
                Node::Leaf(leaf) => return Some(leaf),
                Node::Quarters(first) => {
                    let upper = t.map(|t| t >= 0.5);
                    node = first + 2 * usize::from(upper[0]) + usize::from(upper[1]);
                    t = [0, 1].map(|k| 2.0 * t[k] - f64::from(u8::from(upper[k])));
                }
            }
        }
    }

    /// The quarters of a block, where it has any.
    fn parts(&self, block: Patch) -> Option<Vec<Patch>> {
        match block {
            Patch::Grid { at, size: [1, 1] } => self.parts(Patch::Node(at[0] * self.grid[1] + at[1])),
            Patch::Grid { at, size } => {
                let half = size.map(|s| s / 2);
                let quarter = |q: usize| Patch::Grid {
                    at: [at[0] + half[0] * (q / 2), at[1] + half[1] * (q % 2)],
                    size: half,
                };
                Some((0..4).map(quarter).collect())
            }
            Patch::Node(node) => match self.nodes[node] {
                Node::Leaf(_) => None,
                Node::Quarters(first) => Some((first..first + 4).map(Patch::Node).collect()),
            },
        }
    }

    fn leaves_of(&self, block: Patch) -> Vec<usize> {
        match (block, self.parts(block)) {
            (_, Some(parts)) => parts.into_iter().flat_map(|part| self.leaves_of(part)).collect(),
            (Patch::Node(node), None) => self.leaf_at(node),
            (Patch::Grid { at, .. }, None) => self.leaf_at(at[0] * self.grid[1] + at[1]),
        }
    }

    fn leaf_at(&self, node: usize) -> Vec<usize> {
        match self.nodes[node] {
            Node::Leaf(leaf) => vec![leaf],
            Node::Quarters(_) => Vec::new(),
        }
    }
}

/// Groups of coarse bins for pairs of consecutive draws, about equal in mass: strips along the first
/// coordinate, cut along the second, 4 by 4. `centres` are of the bins, by piece; `pairs` are to be
/// counted. Returns the group of each bin and their number, at most 16; 0 where the draws do not suffice
/// for two.
pub(crate) fn groups(centres: &[(usize, [f64; 2])], masses: &[Mass], pairs: f64) -> (Vec<usize>, usize) {
    let sides = 4;
    let mut order: Vec<usize> = (0..masses.len()).collect();
    order.sort_by(|&a, &b| key(centres[a], 0).total_cmp(&key(centres[b], 0)));
    let mut number = vec![0; masses.len()];
    for (strip, bins) in cut(&order, masses, sides).into_iter().enumerate() {
        let mut bins = bins;
        bins.sort_by(|&a, &b| key(centres[a], 1).total_cmp(&key(centres[b], 1)));
        for (part, bins) in cut(&bins, masses, sides).into_iter().enumerate() {
            bins.into_iter().for_each(|bin| number[bin] = strip * sides + part);
        }
    }
    // Empty groups go; then the lightest joins the next lightest until all pairs of groups are thick.
    let mut groups: Vec<(f64, Vec<usize>)> = (0..sides * sides)
        .map(|g| (0..masses.len()).filter(|&bin| number[bin] == g).collect::<Vec<_>>())
        .map(|bins| (bins.iter().map(|&bin| masses[bin].value).sum(), bins))
        .filter(|(_, bins): &(f64, Vec<usize>)| !bins.is_empty())
        .collect();
    groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    while groups.len() > 1 && pairs * groups[groups.len() - 1].0 * groups[groups.len() - 1].0 < LEAST {
        if let Some((mass, bins)) = groups.pop()
            && let Some(next) = groups.last_mut()
        {
            next.0 += mass;
            next.1.extend(bins);
        }
        groups.sort_by(|a, b| b.0.total_cmp(&a.0));
    }
    for (g, (_, bins)) in groups.iter().enumerate() {
        bins.iter().for_each(|&bin| number[bin] = g);
    }
    (number, if groups.len() < 2 { 0 } else { groups.len() })
}

/// Order along a coordinate, piece after piece.
fn key((piece, at): (usize, [f64; 2]), coordinate: usize) -> f64 {
    // Charts are of size 1 or so; what matters is a fixed order.
    piece as f64 * 1e6 + at[coordinate].clamp(-1e5, 1e5)
}

/// Cuts an order of bins into parts of about equal mass.
fn cut(order: &[usize], masses: &[Mass], parts: usize) -> Vec<Vec<usize>> {
    let all: f64 = order.iter().map(|&bin| masses[bin].value).sum();
    let mut cuts = vec![Vec::new(); parts];
    let mut below = 0.0;
    for &bin in order {
        let middle = below + 0.5 * masses[bin].value;
        below += masses[bin].value;
        let part = if all > 0.0 { (middle / all * parts as f64) as usize } else { 0 };
        cuts[part.min(parts - 1)].push(bin);
    }
    cuts
}

/// The centre of an area, wrapped into the chart.
pub(crate) fn centre(area: &Area, axes: &[Coordinate; 2]) -> [f64; 2] {
    [0, 1].map(|k| wrap(&axes[k], 0.5 * (area.low[k] + area.high[k])))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::samplers::phase::HenyeyGreensteinSampler;
    use crate::samplers::{Draw, Piece, Sampler};
    use crate::sampling::stream::Stream;

    /// A peak in a corner of a plane, and a line.
    struct Two;

    impl Sampler for Two {
        fn draw(&self, _: &mut Stream) -> Draw {
            Draw::Null
        }

        fn pieces(&self) -> Vec<Piece> {
            let axes = [Coordinate::over(0.0, 1.0), Coordinate::over(-1.0, 1.0)];
            vec![Piece::plane("plane", axes), Piece::line("line", Coordinate::over(0.0, 2.0))]
        }

        /// 0.72 in [0, 0.01] x [-1, -0.98], 0.08 in the rest of the plane, 0.2 on the line.
        fn density(&self, piece: usize, [x, y]: [f64; 2]) -> f64 {
            match piece {
                0 if x < 0.01 && y < -0.98 => 0.72 / 2e-4,
                0 => 0.08 / (2.0 - 2e-4),
                _ => 0.1 * x,
            }
        }
    }

    fn check(sampler: &dyn Sampler, samples: u64, extras: &[(Extra, f64)]) -> Partition {
        let mut quadrature = Quadrature::new(sampler);
        let partition = Partition::new(&mut quadrature, samples, extras);
        quadrature.refine();
        let mut masses: Vec<f64> =
            quadrature.masses(partition.leaves.len()).iter().map(|mass| mass.value).collect();
        masses.extend(extras.iter().map(|(_, mass)| *mass));
        assert!((masses.iter().sum::<f64>() - 1.0).abs() < 1e-6);
        for (bin_of, count) in
            [(&partition.coarse, partition.coarse_count), (&partition.fine, partition.fine_count)]
        {
            let mut sums = vec![0.0; count];
            bin_of.iter().zip(&masses).for_each(|(&bin, mass)| sums[bin] += mass);
            let least = sums.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(least * samples as f64 > 24.9 || count == 1, "{least}");
        }
        // Fine bins are parts of coarse ones.
        let mut of_fine = vec![None; partition.fine_count];
        for (&fine, &coarse) in partition.fine.iter().zip(&partition.coarse) {
            assert_eq!(*of_fine[fine].get_or_insert(coarse), coarse);
        }
        // Points are in the leaves that are theirs.
        for (leaf, area) in partition.leaves.iter().enumerate() {
            let axes = &sampler.pieces()[area.piece].axes;
            assert_eq!(partition.leaf(area.piece, centre(area, axes)), Some(leaf));
        }
        partition
    }

    #[test]
    fn cells_are_thick_and_points_find_them() {
        let hg = check(&HenyeyGreensteinSampler::new(0.9), 1_000_000, &[]);
        assert!((200..450).contains(&hg.coarse_count), "{}", hg.coarse_count);
        assert!((2000..8000).contains(&hg.fine_count), "{}", hg.fine_count);
        let few = check(&HenyeyGreensteinSampler::new(0.9), 1_000, &[]);
        assert!((4..=20).contains(&few.coarse_count), "{}", few.coarse_count);
        let corner = check(&Two, 1_000_000, &[]);
        // The peak is one box of 100 x 100: bins within it are far smaller than the grid's.
        let inside =
            corner.leaves.iter().filter(|a| a.piece == 0 && a.high[0] <= 0.0101 && a.high[1] <= -0.979);
        assert!(inside.count() > 16);
        assert!(corner.leaf(0, [1.0, 1.0]).is_some() && corner.leaf(1, [2.0, 0.5]).is_some());
        for (piece, at) in [
            (0, [1.01, 0.0]),
            (0, [0.5, f64::NAN]),
            (1, [-1e-9, 0.5]),
            (1, [f64::NAN, 0.5]),
            (2, [0.5; 2]),
        ] {
            assert_eq!(corner.leaf(piece, at), None);
        }
    }

    #[test]
    fn groups_are_thick() {
        let masses: Vec<Mass> =
            (0..100).map(|i| Mass { value: f64::from(i + 1) / 5050.0, bound: 0.0 }).collect();
        let centres: Vec<(usize, [f64; 2])> =
            (0..100).map(|i| (0, [f64::from(i / 10), f64::from(i % 10)])).collect();
        let (groups, count) = groups(&centres, &masses, 500_000.0);
        assert_eq!(count, 16);
        let of = |g: usize| (0..100).filter(|&i| groups[i] == g).map(|i| masses[i].value).sum::<f64>();
        assert!((0..16).all(|g| (0.02..0.15).contains(&of(g))));
        for (pairs, most) in [(500.0, 4), (40.0, 1)] {
            let (groups, count) = super::groups(&centres, &masses, pairs);
            assert!(count <= most, "{count} groups for {pairs} pairs");
            assert!(groups.iter().all(|&g| g < count.max(1)));
        }
    }
}
