//! Importance in a plane as colours, its growth as arrows, as SVG.

use crate::math::{DVec2, log10};
use crate::results::csv_text;

/// A plane of x and z through a body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct SlicePlot {
    /// The x that it reaches from and to, mm.
    pub x_mm: [f64; 2],
    /// The z that it reaches from and to, mm.
    pub z_mm: [f64; 2],
    /// Nodes in a row.
    pub columns: usize,
    /// Importance over its largest, 0 where there is none, and its growth per mean free path along x and z; a row after the
    /// other from the top.
    pub nodes: Vec<[f64; 3]>,
}

/// Dark to light, distinguishable without colour: five stops of viridis (van der Walt & Smith 2015).
const STOPS: [[f64; 3]; 5] = [
    [68.0, 1.0, 84.0],
    [59.0, 82.0, 139.0],
    [33.0, 145.0, 140.0],
    [94.0, 201.0, 98.0],
    [253.0, 231.0, 37.0],
];
/// Colours that are told apart.
const SHADES: usize = 24;
/// Most decades that colours reach over.
const DECADES: f64 = 6.0;
/// Nodes from an arrow to the next.
const STRIDE: usize = 4;
/// Size of the picture without its legend.
const SIDE: f64 = 300.0;

impl SlicePlot {
    fn rows(&self) -> usize {
        self.nodes.len() / self.columns.max(1)
    }

    /// Whole decades from the largest importance down to the least, up to `DECADES`.
    fn decades(&self) -> f64 {
        let known = self.nodes.iter().map(|node| node[0]).filter(|phi| *phi > 0.0);
        (-log10(known.fold(1.0, f64::min))).ceil().clamp(1.0, DECADES)
    }

    /// The plane with its legend.
    pub(crate) fn to_svg(&self) -> String {
        let [width, height] = [self.x_mm, self.z_mm].map(|[low, high]| high - low);
        let scale = SIDE / width.max(height);
        let (left, top) = (56.0, 12.0);
        let step = [width * scale / self.columns as f64, height * scale / self.rows() as f64];
        let decades = self.decades();
        let mut svg = self.colours([left, top], step, decades);
        svg += &self.arrows([left, top], step);
        let (right, bottom) = (left + width * scale, top + height * scale);
        svg += &frame([left, top, right, bottom], self.x_mm, self.z_mm);
        svg += &legend(right + 16.0, top, decades);
        let (width, height) = (right + 130.0, bottom + 46.0);
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" role=\"img\" \
             font-family=\"system-ui, sans-serif\" font-size=\"12\" style=\"color: var(--ink, #1d2433)\">\n{svg}</svg>\n"
        )
    }

    /// Neighbours of one colour are one rectangle.
    fn colours(&self, [left, top]: [f64; 2], step: [f64; 2], decades: f64) -> String {
        let shade = |node: &[f64; 3]| (node[0] > 0.0).then(|| shade_of(node[0], decades));
        let mut svg = String::new();
        for (row, nodes) in self.nodes.chunks(self.columns.max(1)).enumerate() {
            let mut column = 0;
            for run in nodes.chunk_by(|a, b| shade(a) == shade(b)) {
                if let Some(shade) = shade(&run[0]) {
                    // A little wider than a node, so that no background shows between two.
                    svg += &format!(
                        "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{}\"/>\n",
                        left + step[0] * column as f64,
                        top + step[1] * row as f64,
                        step[0] * run.len() as f64 + 0.3,
                        step[1] + 0.3,
                        colour(shade)
                    );
                }
                column += run.len();
            }
        }
        svg
    }

    /// From nodes that are `STRIDE` apart, along the growth; of growth 1 per mean free path as long as that distance.
    fn arrows(&self, [left, top]: [f64; 2], step: [f64; 2]) -> String {
        let mut path = String::new();
        let first = STRIDE / 2;
        for row in (first..self.rows()).step_by(STRIDE) {
            for column in (first..self.columns).step_by(STRIDE) {
                let [phi, along_x, along_z] = self.nodes[row * self.columns + column];
                let strength = DVec2::new(along_x, along_z).length();
                if phi <= 0.0 || strength < 0.01 {
                    continue;
                }
                let (x, y) =
                    (left + step[0] * (column as f64 + 0.5), top + step[1] * (row as f64 + 0.5));
                let length = step[0] * STRIDE as f64 * strength.max(0.25);
                let [dx, dy] = [along_x, -along_z].map(|part| part / strength * length);
                let (tip_x, tip_y) = (x + 0.5 * dx, y + 0.5 * dy);
                let barb = |turn: f64| {
                    let (bx, by) = (-0.3 * dx - turn * 0.2 * dy, -0.3 * dy + turn * 0.2 * dx);
                    format!("M{tip_x:.1} {tip_y:.1}l{bx:.1} {by:.1}")
                };
                let (x, y) = (x - 0.5 * dx, y - 0.5 * dy);
                path += &format!("M{x:.1} {y:.1}L{tip_x:.1} {tip_y:.1}{}{}", barb(1.0), barb(-1.0));
            }
        }
        let stroke = |colour: &str, width: f64| {
            format!("<path d=\"{path}\" stroke=\"{colour}\" stroke-width=\"{width}\" fill=\"none\"/>\n")
        };
        if path.is_empty() { path } else { stroke("#000000", 2.6) + &stroke("#ffffff", 1.2) }
    }

    /// Its numbers, a row per node inside.
    pub(crate) fn to_csv(&self) -> String {
        let header = ["x / mm", "z / mm", "importance", "growth along x", "growth along z"];
        let rows = self.rows();
        let place = |[low, high]: [f64; 2], index: usize, count: usize| {
            low + (high - low) * (index as f64 + 0.5) / count as f64
        };
        let row = |(index, node): (usize, &[f64; 3])| {
            let x = place(self.x_mm, index % self.columns, self.columns);
            let z = place(self.z_mm, rows - 1 - index / self.columns, rows);
            [x, z, node[0], node[1], node[2]].map(csv_text::number).to_vec()
        };
        let inside = self.nodes.iter().enumerate().filter(|(_, node)| node[0] > 0.0);
        csv_text::to_text(&header, inside.map(row))
    }
}

/// The shade of an importance: 0 at the least of the decades.
fn shade_of(phi: f64, decades: f64) -> usize {
    let part = (1.0 + log10(phi) / decades).clamp(0.0, 1.0);
    (part * (SHADES - 1) as f64).round() as usize
}

fn colour(shade: usize) -> String {
    let place = shade as f64 / (SHADES - 1) as f64 * (STOPS.len() - 1) as f64;
    let index = (place as usize).min(STOPS.len() - 2);
    let part = place - index as f64;
    let [r, g, b] = [0, 1, 2].map(|i| STOPS[index][i] + part * (STOPS[index + 1][i] - STOPS[index][i]));
    format!("rgb({r:.0},{g:.0},{b:.0})")
}

fn frame([left, top, right, bottom]: [f64; 4], x_mm: [f64; 2], z_mm: [f64; 2]) -> String {
    let text = |x: f64, y: f64, anchor: &str, words: &str| {
        format!(
            "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"currentColor\">{words}</text>\n"
        )
    };
    let number = |x: f64| format!("{x:.2}");
    let middle = 0.5 * (left + right);
    format!(
        "<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{:.1}\" height=\"{:.1}\" stroke=\"currentColor\" fill=\"none\"/>\n",
        right - left,
        bottom - top
    ) + &text(left, bottom + 16.0, "middle", &number(x_mm[0]))
        + &text(right, bottom + 16.0, "middle", &number(x_mm[1]))
        + &text(middle, bottom + 34.0, "middle", "x / mm")
        + &text(left - 6.0, top + 10.0, "end", &number(z_mm[1]))
        + &text(left - 6.0, bottom, "end", &number(z_mm[0]))
        + &text(left - 6.0, 0.5 * (top + bottom), "end", "z / mm")
}

fn legend(left: f64, top: f64, decades: f64) -> String {
    let height = 160.0 / SHADES as f64;
    let step = |shade: usize| {
        let y = top + 160.0 - height * (shade + 1) as f64;
        format!(
            "<rect x=\"{left:.1}\" y=\"{y:.1}\" width=\"14\" height=\"{:.1}\" fill=\"{}\"/>\n",
            height + 0.3,
            colour(shade)
        )
    };
    let label = |y: f64, words: String| {
        format!("<text x=\"{:.1}\" y=\"{y:.1}\" fill=\"currentColor\">{words}</text>\n", left + 20.0)
    };
    let steps: String = (0..SHADES).map(step).collect();
    steps + &label(top + 10.0, "importance 1".into()) + &label(top + 160.0, format!("1e-{decades:.0}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn slice() -> SlicePlot {
        let node = |index: usize| {
            let (row, column) = (index / 8, index % 8);
            if column == 0 { [0.0; 3] } else { [0.1f64.powi(row as i32 / 2), 0.0, 0.5] }
        };
        SlicePlot {
            x_mm: [-2.0, 2.0],
            z_mm: [-4.0, 0.0],
            columns: 8,
            nodes: (0..64).map(node).collect(),
        }
    }

    #[test]
    fn colours_and_arrows() {
        let svg = slice().to_svg();
        assert!(!svg.contains("NaN") && svg.contains("1e-3") && svg.contains("importance 1"), "{svg}");
        // A rectangle a row beside the legend's and the frame.
        assert_eq!(svg.matches("<rect").count(), 8 + SHADES + 1);
        // Four arrows, upwards: their shafts end above where they begin.
        let shafts = svg.split("d=\"").nth(1).expect("a path").split('L').count() - 1;
        assert_eq!(shafts, 4);
        let empty = SlicePlot { nodes: vec![[0.0; 3]; 64], ..slice() };
        assert!(!empty.to_svg().contains("NaN"));
    }

    #[test]
    fn numbers_of_what_is_inside() {
        let csv = slice().to_csv();
        assert_eq!(csv.lines().count(), 1 + 56);
        let first = csv.lines().nth(1).expect("a row");
        assert!(first.starts_with("-1.25,-0.25,1.0,"), "{first}");
    }
}
