//! Line plots with bands, as SVG: inline in the page, and by itself as a file. Text in the reader's colours, series in
//! the palette of Okabe & Ito, which colour-blind readers can tell apart, each named at its end too.

use super::number::significant;
use crate::math::log10;

/// A plot.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Plot {
    /// Horizontally.
    pub x: Axis,
    /// Vertically.
    pub y: Axis,
    /// The lines.
    pub series: Vec<Series>,
    /// Horizontal lines with their names: values that are known.
    pub levels: Vec<(f64, String)>,
}

/// An axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Axis {
    /// What it shows, with its unit.
    pub label: String,
    /// Whether it is logarithmic.
    pub is_log: bool,
    /// From and to, where it is not what the series need.
    pub range: Option<[f64; 2]>,
}

/// A line.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Series {
    /// Its name.
    pub name: String,
    /// Its points, by x.
    pub points: Vec<Point>,
}

/// A point with an interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Point {
    /// Where.
    pub x: f64,
    /// The value.
    pub y: f64,
    /// Lower end of its interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

const COLOURS: [&str; 7] = ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#8c6d31"];
const WIDTH: f64 = 720.0;
const HEIGHT: f64 = 380.0;
/// Left, top, right, bottom.
const MARGINS: [f64; 4] = [70.0, 12.0, 170.0, 46.0];
/// Least distance of names at the right, in units of the picture.
const LINE: f64 = 15.0;

/// From values to places in the picture.
struct Scale {
    range: [f64; 2],
    place: [f64; 2],
    is_log: bool,
}

impl Scale {
    fn new(axis: &Axis, values: impl Iterator<Item = f64>, place: [f64; 2]) -> Scale {
        let usable = values.filter(|v| v.is_finite() && (!axis.is_log || *v > 0.0));
        let wide = usable.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let mut range = axis.range.unwrap_or(wide);
        if !(range[0].is_finite() && range[1].is_finite()) {
            range = [0.1, 1.0];
        }
        if range[0] >= range[1] {
            let around = if range[0] == 0.0 { 1.0 } else { 0.1 * range[0].abs() };
            range = [range[0] - around, range[0] + around];
        }
        Scale { range, place, is_log: axis.is_log }
    }

    fn share(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        if self.is_log { log10(value / from) / log10(to / from) } else { (value - from) / (to - from) }
    }

    /// Where a value is; what is far outside stays near the picture, where it is clipped.
    fn at(&self, value: f64) -> f64 {
        let share = self.share(value).clamp(-2.0, 3.0);
        self.place[0] + share * (self.place[1] - self.place[0])
    }

    /// Round values within the range.
    fn ticks(&self) -> Vec<f64> {
        let [from, to] = self.range;
        if self.is_log && to / from > 8.0 {
            let decades = (log10(from).floor() as i32)..=(log10(to).ceil() as i32);
            let every = 1 + (log10(to / from) as usize) / 8;
            let all = decades.step_by(every).map(power_of_ten);
            return all.filter(|tick| *tick >= from * 0.999 && *tick <= to * 1.001).collect();
        }
        let rough = (to - from) / 5.0;
        let unit = power_of_ten(log10(rough).floor() as i32);
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * unit >= rough).unwrap_or(10.0) * unit;
        let first = (from / step).ceil() as i64;
        let last = (to / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

/// 10^k, exactly as it is written.
fn power_of_ten(k: i32) -> f64 {
    format!("1e{k}").parse().unwrap_or(f64::NAN)
}

impl Plot {
    /// The picture.
    pub fn to_svg(&self) -> String {
        let [left, top, right, bottom] = MARGINS;
        let points = || self.series.iter().flat_map(|series| &series.points);
        let x = Scale::new(&self.x, points().map(|p| p.x), [left, WIDTH - right]);
        let levels = self.levels.iter().map(|(value, _)| *value);
        let heights = points().flat_map(|p| [p.y, p.low, p.high]).chain(levels);
        let y = Scale::new(&self.y, heights, [HEIGHT - bottom, top]);
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {HEIGHT}\" role=\"img\" \
             font-family=\"system-ui, sans-serif\" font-size=\"12\" style=\"color: var(--ink, #1d2433)\">\n\
             <clipPath id=\"area\"><rect x=\"{left}\" y=\"{top}\" width=\"{}\" height=\"{}\"/></clipPath>\n",
            WIDTH - left - right,
            HEIGHT - top - bottom
        );
        self.axes(&x, &y, &mut svg);
        for (value, _) in &self.levels {
            let at = y.at(*value);
            svg += &format!(
                "<path d=\"M{left} {at:.1}H{}\" stroke=\"currentColor\" stroke-dasharray=\"5 4\" fill=\"none\"/>\n",
                WIDTH - right
            );
        }
        svg += "<g clip-path=\"url(#area)\">\n";
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            svg += &series.band(&x, &y, colour);
        }
        for (series, colour) in self.series.iter().zip(COLOURS.iter().cycle()) {
            svg += &series.line(&x, &y, colour);
        }
        svg += "</g>\n";
        svg += &self.names(&y);
        svg + "</svg>\n"
    }

    fn axes(&self, x: &Scale, y: &Scale, svg: &mut String) {
        let [left, top, right, bottom] = MARGINS;
        let (base, end) = (HEIGHT - bottom, WIDTH - right);
        for tick in x.ticks() {
            let at = x.at(tick);
            *svg += &format!(
                "<path d=\"M{at:.1} {top}V{base}\" stroke=\"var(--line, #d9dce3)\"/>\
                 <text x=\"{at:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>\n",
                base + 16.0,
                number(tick)
            );
        }
        for tick in y.ticks() {
            let at = y.at(tick);
            *svg += &format!(
                "<path d=\"M{left} {at:.1}H{end}\" stroke=\"var(--line, #d9dce3)\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" fill=\"currentColor\">{}</text>\n",
                left - 6.0,
                at + 4.0,
                number(tick)
            );
        }
        *svg += &format!(
            "<path d=\"M{left} {top}V{base}H{end}\" stroke=\"currentColor\" fill=\"none\"/>\
             <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>\
             <text transform=\"translate(14 {:.1}) rotate(-90)\" text-anchor=\"middle\" fill=\"currentColor\">{}</text>\n",
            0.5 * (left + end),
            HEIGHT - 8.0,
            escape(&self.x.label),
            0.5 * (top + base),
            escape(&self.y.label)
        );
    }

    /// Names at the right, each at the height where its line ends, moved apart.
    fn names(&self, y: &Scale) -> String {
        let [_, top, right, bottom] = MARGINS;
        let end = |series: &Series| series.points.last().map_or(f64::NAN, |p| p.y);
        let series = self.series.iter().zip(COLOURS.iter().cycle());
        let mut names: Vec<(f64, &str, &str)> =
            series.map(|(s, colour)| (y.at(end(s)), s.name.as_str(), *colour)).collect();
        names.extend(self.levels.iter().map(|(v, name)| (y.at(*v), name.as_str(), "currentColor")));
        names.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut lowest = top;
        for name in &mut names {
            name.0 = name.0.max(lowest).max(top);
            lowest = name.0 + LINE;
        }
        let mut highest = HEIGHT - bottom;
        for name in names.iter_mut().rev() {
            name.0 = name.0.min(highest);
            highest = name.0 - LINE;
        }
        let text = |(at, name, colour): &(f64, &str, &str)| {
            let x = WIDTH - right + 8.0;
            format!("<text x=\"{x}\" y=\"{:.1}\" fill=\"{colour}\">{}</text>\n", at + 4.0, escape(name))
        };
        names.iter().map(text).collect()
    }
}

impl Series {
    fn line(&self, x: &Scale, y: &Scale, colour: &str) -> String {
        let points = self.points.iter().filter(|p| p.y.is_finite());
        let places: Vec<String> = points.map(|p| format!("{:.1} {:.1}", x.at(p.x), y.at(p.y))).collect();
        format!(
            "<path d=\"M{}\" stroke=\"{colour}\" stroke-width=\"1.8\" fill=\"none\"/>\n",
            places.join("L")
        )
    }

    fn band(&self, x: &Scale, y: &Scale, colour: &str) -> String {
        let wide = || self.points.iter().filter(|p| p.low.is_finite() && p.high > p.low);
        let place = |at: f64, value: f64| format!("{:.1} {:.1}", x.at(at), y.at(value));
        let mut places: Vec<String> = wide().map(|p| place(p.x, p.high)).collect();
        places.extend(wide().rev().map(|p| place(p.x, p.low)));
        if places.is_empty() {
            return String::new();
        }
        format!("<path d=\"M{}Z\" fill=\"{colour}\" fill-opacity=\"0.18\"/>\n", places.join("L"))
    }
}

fn number(x: f64) -> String {
    let text = if x == 0.0 { "0".into() } else { significant(x, 3) };
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').into(),
        false => text,
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot() -> Plot {
        let point = |k: i32| {
            let x = f64::from(1 << k);
            Point { x, y: 1.0 + 1.0 / x, low: 1.0, high: 1.0 + 2.0 / x }
        };
        let series = ["one & only", "another"]
            .map(|name| Series { name: name.into(), points: (0..12).map(point).collect() });
        Plot {
            x: Axis { label: "passes".into(), is_log: true, range: None },
            y: Axis { label: "mean".into(), is_log: false, range: Some([0.9, 2.1]) },
            series: series.into(),
            levels: vec![(1.0, "truth".into())],
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

    /// Names whose lines end at one height do not stand on each other.
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
        let flat = Series {
            points: vec![Point { x: 1.0, y: 0.0, low: f64::NAN, high: 0.0 }],
            ..Series::default()
        };
        let svg = Plot { series: vec![flat], ..Plot::default() }.to_svg();
        assert!(!svg.contains("NaN"), "{svg}");
    }
}
