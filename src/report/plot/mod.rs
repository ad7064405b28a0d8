//! Plots as SVG, inline in the page and as files, and their numbers as CSV. Text has the text colour of the
//! page. Series use the palette of Okabe & Ito, which is safe for colour-blind readers, and each series
//! is also labelled at its end.

use super::markup::escape;
use crate::results::csv_text;
use crate::stats::hypothesis::{Estimate, critical_value};
use scale::Scale;

pub(crate) use scale::PlotAxis;

/// The same as PDF.
pub(crate) mod pdf;
mod scale;
/// Importance in a plane.
pub(crate) mod slice;
/// Colours with their names.
pub(crate) mod swatches;

/// A plot of named series over two axes.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Plot {
    /// The horizontal axis.
    pub x: PlotAxis,
    /// The vertical axis.
    pub y: PlotAxis,
    /// Series, in the order of the legend.
    pub series: Vec<Series>,
    /// Horizontal lines at known values, with their names.
    pub levels: Vec<(f64, String)>,
    /// Size of the picture.
    pub size: Size,
}

/// Size of a plot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Size {
    /// As wide as the page.
    #[default]
    Wide,
    /// One of several side by side.
    Small,
    /// A low strip.
    Flat,
}

/// How a series is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Style {
    /// A line through its points, with the band of their intervals.
    #[default]
    Line,
    /// Points with their intervals as bars.
    Marks,
    /// A bar per point.
    Bars,
    /// A thin dashed guide line in the colour of the text.
    Guide,
}

/// A series of points.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Series {
    /// Name in the legend.
    pub name: String,
    /// Its points, by x.
    pub points: Vec<PlotPoint>,
    /// How it is drawn.
    pub style: Style,
}

impl Series {
    /// A named series.
    pub(crate) fn new(name: impl Into<String>, style: Style, points: Vec<PlotPoint>) -> Series {
        Series { name: name.into(), points, style }
    }
}

/// A point with an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct PlotPoint {
    /// Position on the horizontal axis.
    pub x: f64,
    /// Position on the vertical axis.
    pub y: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end of its interval.
    pub high: f64,
    /// Whether it is resolved; others are drawn hollow.
    pub is_firm: bool,
}

impl PlotPoint {
    /// A value with its interval.
    pub(crate) fn new(x: f64, y: f64, [low, high]: [f64; 2]) -> PlotPoint {
        PlotPoint { x, y, low, high, is_firm: true }
    }

    /// An estimate with its 95 % interval.
    pub(crate) fn of(x: f64, estimate: &Estimate) -> PlotPoint {
        let reach = critical_value(0.05, estimate.dof) * estimate.std_error;
        PlotPoint::new(x, estimate.value, [estimate.value - reach, estimate.value + reach])
    }

    /// A value without an interval.
    pub(crate) fn bare(x: f64, y: f64) -> PlotPoint {
        PlotPoint::new(x, y, [y, y])
    }
}

/// Colours of the series, in their order.
pub(super) const COLOURS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#b07b00", "#3a9bd9", "#8c6d31"];
/// Least distance between labels at the right, in units of the picture.
const LINE: f64 = 15.0;
/// Most points of a line that are drawn as marks.
const MARKED: usize = 20;
/// With more points marks are small.
const CROWDED: usize = 60;
/// Longest label of a series, in characters.
const LETTERS: usize = 30;
/// Width of a character.
const LETTER: f64 = 6.6;

/// Size of the picture, and the rectangle of the axes.
struct PlotFrame {
    width: f64,
    height: f64,
    left: f64,
    top: f64,
    right: f64,
    bottom: f64,
}

impl Plot {
    /// A small plot of some series.
    pub(crate) fn small(x: PlotAxis, y: PlotAxis, series: Vec<Series>) -> Plot {
        Plot { x, y, series, size: Size::Small, ..Plot::default() }
    }

    /// The plot as an SVG document.
    #[cfg(test)]
    pub(crate) fn to_svg(&self) -> String {
        panels(std::slice::from_ref(self))
    }

    /// Its numbers as CSV, a row per point.
    pub(crate) fn to_csv(&self) -> String {
        let header = ["series", &self.x.label, &self.y.label, "low", "high", "firm"];
        let x = |p: &PlotPoint| match self.x.names.get(p.x.round() as usize) {
            Some(name) => name.clone(),
            None => csv_text::number(p.x),
        };
        let rows = self.series.iter().flat_map(|series| {
            series.points.iter().map(|p| {
                let [y, low, high] = [p.y, p.low, p.high].map(csv_text::number);
                vec![series.name.clone(), x(p), y, low, high, p.is_firm.to_string()]
            })
        });
        csv_text::to_text(&header, rows)
    }

    fn frame(&self) -> PlotFrame {
        let (width, height) = match self.size {
            Size::Wide => (760.0, 380.0),
            Size::Small => (480.0, 320.0),
            Size::Flat => (480.0, 140.0),
        };
        let names = self.series.iter().map(|s| &s.name).chain(self.levels.iter().map(|(_, name)| name));
        let longest = names.map(|name| name.chars().count().min(LETTERS)).max().unwrap_or(0);
        let right = width - 16.0 - LETTER * longest as f64;
        // Labels of categories are slanted where they would overlap.
        let bottom = height - if self.is_slanted(right - 66.0) { 92.0 } else { 46.0 };
        PlotFrame { width, height, left: 66.0, top: 12.0, right, bottom }
    }

    fn is_slanted(&self, width: f64) -> bool {
        let letters = self.x.names.iter().map(|name| name.chars().count()).max().unwrap_or(0);
        LETTER * (letters * self.x.names.len()) as f64 > 0.95 * width
    }

    fn paint(&self) -> String {
        let frame = self.frame();
        let PlotFrame { left, top, right, bottom, .. } = frame;
        let points = || self.series.iter().flat_map(|series| &series.points);
        let x = Scale::new(&self.x, points().map(|p| p.x), [left, right]);
        let levels = self.levels.iter().map(|(value, _)| *value);
        let heights = points().flat_map(|p| [p.y, p.low, p.high]).chain(levels);
        let y = Scale::new(&self.y, heights, [bottom, top]);
        let mut svg = self.axes(&frame, &x, &y);
        for (value, _) in &self.levels {
            let at = y.at(*value);
            svg += &format!(
                "<path d=\"M{left} {at:.1}H{right:.1}\" stroke=\"currentColor\" stroke-dasharray=\"5 4\" \
                 fill=\"none\"/>\n"
            );
        }
        // A nested SVG clips what lies outside the axes.
        let (wide, high) = (right - left, bottom - top);
        svg += &format!(
            "<svg x=\"{left}\" y=\"{top}\" width=\"{wide:.1}\" height=\"{high:.1}\" viewBox=\"{left} {top} \
             {wide:.1} {high:.1}\">\n"
        );
        let coloured = || self.series.iter().zip(self.colours());
        coloured().for_each(|(series, colour)| svg += &series.band(&x, &y, colour));
        coloured().for_each(|(series, colour)| svg += &series.line(&x, &y, colour));
        svg += "</svg>\n";
        svg + &self.names(&frame, &y)
    }

    /// Guides have the colour of the text and use none of the palette.
    fn colours(&self) -> Vec<&'static str> {
        let mut palette = COLOURS.iter().cycle();
        let colour = |series: &Series| match series.style {
            Style::Guide => "currentColor",
            _ => palette.next().copied().unwrap_or("currentColor"),
        };
        self.series.iter().map(colour).collect()
    }

    fn axes(&self, frame: &PlotFrame, x: &Scale, y: &Scale) -> String {
        let PlotFrame { height, left, top, right, bottom, .. } = *frame;
        let mut svg = String::new();
        let is_slanted = self.is_slanted(right - left);
        for (tick, name) in x.ticks() {
            let (at, base) = (x.at(tick), bottom + 16.0);
            let turned = match is_slanted {
                true => format!("text-anchor=\"end\" transform=\"rotate(-28 {at:.1} {base:.1})\""),
                false => "text-anchor=\"middle\"".into(),
            };
            svg += &format!(
                "<path d=\"M{at:.1} {top}V{bottom}\" stroke=\"var(--line, #d9dce3)\"/>\
                 <text x=\"{at:.1}\" y=\"{base:.1}\" {turned} fill=\"currentColor\">{}</text>\n",
                escape(&shortened(&name))
            );
        }
        for (tick, name) in y.ticks() {
            let at = y.at(tick);
            svg += &format!(
                "<path d=\"M{left} {at:.1}H{right:.1}\" stroke=\"var(--line, #d9dce3)\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{}</text>\n",
                left - 6.0,
                at + 4.0,
                escape(&name)
            );
        }
        svg + &format!(
            "<path d=\"M{left} {top}V{bottom}H{right:.1}\" stroke=\"currentColor\" fill=\"none\"/><text \
             x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text><text \
             transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\" \
             fill=\"currentColor\">{}</text>\n",
            0.5 * (left + right),
            height - 8.0,
            escape(&self.x.label),
            0.5 * (top + bottom),
            escape(&self.y.label)
        )
    }

    /// Labels at the right, each at the height where its line ends, moved apart.
    fn names(&self, frame: &PlotFrame, y: &Scale) -> String {
        let end = |series: &Series| series.points.last().map_or(f64::NAN, |p| p.y);
        let series = self.series.iter().zip(self.colours());
        let mut names: Vec<(f64, &str, &str)> =
            series.map(|(s, colour)| (y.at(end(s)), s.name.as_str(), colour)).collect();
        names.extend(self.levels.iter().map(|(v, name)| (y.at(*v), name.as_str(), "currentColor")));
        names.retain(|(_, name, _)| !name.is_empty());
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends: Vec<f64> = names.iter().map(|name| name.0).collect();
        let mut lowest = frame.top;
        for name in &mut names {
            name.0 = name.0.max(lowest).max(frame.top);
            lowest = name.0 + LINE;
        }
        let mut highest = frame.bottom;
        for name in names.iter_mut().rev() {
            name.0 = name.0.min(highest);
            highest = name.0 - LINE;
        }
        let text = |((at, name, colour), end): (&(f64, &str, &str), &f64)| {
            // A line leads to a name that had to move away from where its series ends.
            let end = end.clamp(frame.top, frame.bottom);
            let lead = match (at - end).abs() > 0.5 * LINE {
                true => format!(
                    "<path d=\"M{:.1} {end:.1}L{:.1} {at:.1}\" stroke=\"{colour}\" stroke-width=\"0.7\" fill=\"none\"/>\n",
                    frame.right + 1.0,
                    frame.right + 7.0
                ),
                false => String::new(),
            };
            lead + &format!(
                "<text x=\"{:.1}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>\n",
                frame.right + 8.0,
                at + 4.0,
                escape(&shortened(name))
            )
        };
        names.iter().zip(&ends).map(text).collect()
    }
}

/// Plots below each other in one picture.
pub(crate) fn panels(plots: &[Plot]) -> String {
    let frames: Vec<PlotFrame> = plots.iter().map(Plot::frame).collect();
    let width = frames.iter().map(|f| f.width).fold(0.0, f64::max);
    let height: f64 = frames.iter().map(|f| f.height).sum();
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" role=\"img\" \
         font-family=\"system-ui, sans-serif\" font-size=\"12\" style=\"color: var(--ink, #1d2433)\">\n"
    );
    let mut below = 0.0;
    for (plot, frame) in plots.iter().zip(&frames) {
        let PlotFrame { width, height, .. } = frame;
        svg += &format!(
            "<svg y=\"{below}\" width=\"{width}\" height=\"{height}\">\n{}</svg>\n",
            plot.paint()
        );
        below += height;
    }
    svg + "</svg>\n"
}

/// The picture as a file of its own: on paper, so that it reads on dark pages, too.
pub(crate) fn on_paper(svg: &str) -> String {
    svg.replacen(">\n", ">\n<rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n", 1)
}

impl Series {
    fn line(&self, x: &Scale, y: &Scale, colour: &str) -> String {
        let points = || self.points.iter().filter(|p| p.y.is_finite());
        let places = || points().map(|p| (x.at(p.x), y.at(p.y), p));
        let path = || places().map(|(x, y, _)| format!("{x:.1} {y:.1}")).collect::<Vec<_>>().join("L");
        let stroked = |width: f64, more: &str| {
            format!(
                "<path d=\"M{}\" stroke=\"{colour}\" stroke-width=\"{width}\"{more} fill=\"none\"/>\n",
                path()
            )
        };
        let radius = if self.points.len() > CROWDED { 1.4 } else { 3.0 };
        let marks =
            || places().map(|(x, y, p)| mark(x, y, radius, (colour, p.is_firm))).collect::<String>();
        match self.style {
            _ if points().next().is_none() => String::new(),
            Style::Guide => stroked(1.0, " stroke-dasharray=\"2 4\""),
            Style::Line if self.points.len() > MARKED => stroked(1.8, ""),
            Style::Line => stroked(1.8, "") + &marks(),
            Style::Marks => {
                let bar = |(at, _, p): (f64, f64, &PlotPoint)| {
                    format!("M{at:.1} {:.1}V{:.1}", y.at(p.low), y.at(p.high))
                };
                let bars: String = places().map(bar).collect();
                format!("<path d=\"{bars}\" stroke=\"{colour}\" stroke-width=\"1.4\"/>\n") + &marks()
            }
            Style::Bars => {
                let base = y.at(0.0);
                let width = (x.at(1.0) - x.at(0.0)).abs().min(24.0) * 0.8;
                let bar = |(at, height, _)| format!("M{at:.1} {base:.1}V{height:.1}");
                let bars: String = places().map(bar).collect();
                format!("<path d=\"{bars}\" stroke=\"{colour}\" stroke-width=\"{width:.1}\"/>\n")
            }
        }
    }

    fn band(&self, x: &Scale, y: &Scale, colour: &str) -> String {
        let wide = || self.points.iter().filter(|p| p.low.is_finite() && p.high > p.low);
        if self.style != Style::Line || wide().next().is_none() {
            return String::new();
        }
        let place = |at: f64, value: f64| format!("{:.1} {:.1}", x.at(at), y.at(value));
        let mut places: Vec<String> = wide().map(|p| place(p.x, p.high)).collect();
        places.extend(wide().rev().map(|p| place(p.x, p.low)));
        format!("<path d=\"M{}Z\" fill=\"{colour}\" fill-opacity=\"0.18\"/>\n", places.join("L"))
    }
}

fn mark(x: f64, y: f64, radius: f64, (colour, is_firm): (&str, bool)) -> String {
    let fill = if is_firm { colour } else { "var(--paper, #fff)" };
    format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{radius}\" fill=\"{fill}\" stroke=\"{colour}\"/>\n")
}

/// A label, shortened to the longest that fits.
fn shortened(name: &str) -> String {
    if name.chars().count() <= LETTERS {
        return name.into();
    }
    name.chars().take(LETTERS - 1).chain(['…']).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        let point = |k: i32| {
            let x = f64::from(1 << k);
            PlotPoint::new(x, 1.0 + 1.0 / x, [1.0, 1.0 + 2.0 / x])
        };
        let series = ["one & only", "another"].map(|name| Series {
            name: name.into(),
            points: (0..12).map(point).collect(),
            ..Series::default()
        });
        Plot {
            x: PlotAxis::log("passes"),
            y: PlotAxis { range: Some([0.9, 2.1]), ..PlotAxis::linear("mean") },
            series: series.into(),
            levels: vec![(1.0, "truth".into())],
            size: Size::Wide,
        }
    }

    #[test]
    fn everything_is_drawn_once() {
        let svg = plot().to_svg();
        assert_eq!(svg.matches("stroke-width=\"1.8\"").count(), 2);
        assert_eq!(svg.matches("fill-opacity").count(), 2);
        for text in ["one &amp; only", ">another<", ">truth<", ">passes<", ">mean<", ">10<", ">1000<"] {
            assert_eq!(svg.matches(text).count(), 1, "{text}");
        }
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    }

    /// Marks that are side by side at one name belong to that name.
    #[test]
    fn numbers_stand_by_their_names() {
        let points = vec![PlotPoint::bare(-0.2, 1.0), PlotPoint::bare(0.8, 2.0)];
        let series = vec![Series { name: "a".into(), points, style: Style::Marks }];
        let x = PlotAxis { names: vec!["left".into(), "right".into()], ..PlotAxis::linear("side") };
        let csv = Plot { x, y: PlotAxis::linear("ratio"), series, ..Plot::default() }.to_csv();
        assert_eq!(
            csv,
            "series,side,ratio,low,high,firm\na,left,1.0,1.0,1.0,true\na,right,2.0,2.0,2.0,true\n"
        );
    }

    /// Names whose lines end at one height do not overlap.
    #[test]
    fn names_stand_apart() {
        let svg = plot().to_svg();
        let height = |name: &str| -> f64 {
            let at = svg.find(&format!(">{name}<")).expect("a name");
            let start = svg[..at].rfind("y=\"").expect("a place") + 3;
            svg[start..].split('"').next().and_then(|y| y.parse().ok()).expect("a number")
        };
        let mut heights = ["one &amp; only", "another", "truth"].map(height);
        heights.sort_by(f64::total_cmp);
        assert!(heights.windows(2).all(|pair| pair[1] - pair[0] >= LINE - 0.11), "{heights:?}");
    }

    #[test]
    fn nothing_to_draw_is_no_error() {
        let empty = Plot::default().to_svg();
        assert!(empty.starts_with("<svg") && !empty.contains("NaN"));
        let flat =
            Series { points: vec![PlotPoint::new(1.0, 0.0, [f64::NAN, 0.0])], ..Series::default() };
        let svg = Plot { series: vec![flat], ..Plot::default() }.to_svg();
        assert!(!svg.contains("NaN"), "{svg}");
    }
}
