//! Axes: from values to places in a picture, and the round values at the ticks.

use crate::math::log10;
use crate::results::number::significant;

/// Label, scale and range of an axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct PlotAxis {
    /// Label of the axis, with its unit.
    pub label: String,
    /// Whether it is logarithmic.
    pub is_log: bool,
    /// Lower and upper end; default: the range of the series.
    pub range: Option<[f64; 2]>,
    /// Names of the values 0, 1, ... of an axis of categories.
    pub names: Vec<String>,
}

impl PlotAxis {
    /// A linear axis over the range of the series.
    pub(crate) fn linear(label: impl Into<String>) -> PlotAxis {
        PlotAxis { label: label.into(), ..PlotAxis::default() }
    }

    /// A logarithmic axis over the range of the series.
    pub(crate) fn log(label: impl Into<String>) -> PlotAxis {
        PlotAxis { is_log: true, ..PlotAxis::linear(label) }
    }
}

/// From values to places in the picture.
pub(super) struct Scale<'a> {
    axis: &'a PlotAxis,
    range: [f64; 2],
    place: [f64; 2],
}

impl<'a> Scale<'a> {
    /// The scale of an axis that shows `values` between two places.
    pub(super) fn new(
        axis: &'a PlotAxis,
        values: impl Iterator<Item = f64>,
        place: [f64; 2],
    ) -> Scale<'a> {
        let usable = values.filter(|v| v.is_finite() && (!axis.is_log || *v > 0.0));
        let wide = usable.fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], v| [a.min(v), b.max(v)]);
        let named = (!axis.names.is_empty()).then(|| [-0.5, axis.names.len() as f64 - 0.5]);
        let mut range = axis.range.or(named).unwrap_or_else(|| roomy(wide, axis.is_log));
        if !(range[0].is_finite() && range[1].is_finite()) {
            range = [0.1, 1.0];
        }
        if range[0] >= range[1] {
            let around = if range[0] == 0.0 { 1.0 } else { 0.1 * range[0].abs() };
            range = [range[0] - around, range[0] + around];
        }
        Scale { axis, range, place }
    }

    fn share(&self, value: f64) -> f64 {
        let [from, to] = self.range;
        match self.axis.is_log {
            true => log10(value / from) / log10(to / from),
            false => (value - from) / (to - from),
        }
    }

    /// Position of a value; values far outside are clipped near the picture. A logarithmic
    /// axis has what is not positive below its lower end.
    pub(super) fn at(&self, value: f64) -> f64 {
        let share = match self.axis.is_log && value <= 0.0 {
            true => -2.0,
            false => self.share(value).clamp(-2.0, 3.0),
        };
        self.place[0] + share * (self.place[1] - self.place[0])
    }

    /// Values within the range that the axis names, and their names.
    pub(super) fn ticks(&self) -> Vec<(f64, String)> {
        if !self.axis.names.is_empty() {
            let names = self.axis.names.iter().enumerate();
            return names.map(|(place, name)| (place as f64, name.clone())).collect();
        }
        let values = if self.axis.is_log { self.log_ticks() } else { self.linear_ticks() };
        let mut ticks: Vec<(f64, String)> =
            values.into_iter().map(|value| (value, number(value))).collect();
        // One form on one axis.
        if self.axis.is_log && ticks.iter().any(|(_, name)| name.contains('e')) {
            ticks.iter_mut().for_each(|(value, name)| *name = with_exponent(*value));
        }
        ticks
    }

    fn log_ticks(&self) -> Vec<f64> {
        let [from, to] = self.range;
        let decades = log10(to / from);
        let exponents = (log10(from).floor() as i32)..=(log10(to).ceil() as i32);
        let steps: &[f64] = match decades {
            d if d < 0.5 => return self.linear_ticks(),
            d if d < 1.5 => &[1.0, 2.0, 3.0, 5.0],
            d if d < 2.5 => &[1.0, 3.0],
            _ => &[1.0],
        };
        let every = 1 + (decades as usize) / 8;
        let powers = exponents.step_by(every).map(power_of_ten);
        let all = powers.flat_map(|power| steps.iter().map(move |step| step * power));
        all.filter(|tick| *tick >= from * 0.999 && *tick <= to * 1.001).collect()
    }

    fn linear_ticks(&self) -> Vec<f64> {
        let [from, to] = self.range;
        let rough = (to - from) / 5.0;
        let unit = power_of_ten(log10(rough).floor() as i32);
        let step = [1.0, 2.0, 5.0, 10.0].into_iter().find(|m| m * unit >= rough).unwrap_or(10.0) * unit;
        let first = (from / step).ceil() as i64;
        let last = (to / step).floor() as i64;
        (first..=last).map(|k| k as f64 * step).collect()
    }
}

/// A range with a margin, so that marks at its ends are not clipped.
fn roomy([from, to]: [f64; 2], is_log: bool) -> [f64; 2] {
    const ROOM: f64 = 0.04;
    match is_log {
        _ if !(from.is_finite() && to.is_finite() && from < to) => [from, to],
        true => {
            let factor = crate::math::pow(to / from, ROOM);
            [from / factor, to * factor]
        }
        false => [from - ROOM * (to - from), to + ROOM * (to - from)],
    }
}

/// 10^k, exactly as it is written.
fn power_of_ten(k: i32) -> f64 {
    format!("1e{k}").parse().unwrap_or(f64::NAN)
}

fn number(x: f64) -> String {
    let text = if x == 0.0 { "0".into() } else { significant(x, 3) };
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, ""));
    let mantissa = match mantissa.contains('.') {
        true => mantissa.trim_end_matches('0').trim_end_matches('.'),
        false => mantissa,
    };
    if exponent.is_empty() { mantissa.into() } else { format!("{mantissa}e{exponent}") }
}

/// A value above 0 with its exponent: `3e-4`; `3` without one.
fn with_exponent(x: f64) -> String {
    // A little more, because the logarithm of a power of ten may lie below the whole number.
    let exponent = (log10(x) + 1e-9).floor() as i32;
    let mantissa = number(x / power_of_ten(exponent));
    if exponent == 0 { mantissa } else { format!("{mantissa}e{exponent}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(is_log: bool, range: [f64; 2]) -> String {
        let axis = PlotAxis { is_log, range: Some(range), ..PlotAxis::default() };
        let scale = Scale::new(&axis, [].into_iter(), [0.0, 1.0]);
        scale.ticks().into_iter().map(|(_, name)| name).collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks(false, [0.0, 1.05]), "0 0.5 1");
        assert_eq!(ticks(false, [-0.013, 0.021]), "-0.01 0 0.01 0.02");
        assert_eq!(ticks(true, [0.9, 1.2e6]), "1 1e1 1e2 1e3 1e4 1e5 1e6");
        assert_eq!(ticks(true, [2e-5, 0.4]), "1e-4 1e-3 1e-2 1e-1");
        assert_eq!(ticks(true, [1e-4, 3e-3]), "1e-4 2e-4 3e-4 5e-4 1e-3 2e-3 3e-3");
        assert_eq!(ticks(true, [1e-3, 0.5]), "0.001 0.01 0.1");
        assert_eq!(
            ticks(true, [0.8, 30.0]),
            "1 2 3 5 10 20 30".replace("2 3", "3").replace("5 ", "").replace("20 ", "")
        );
        assert_eq!(ticks(true, [1.0, 12.0]), "1 2 3 5 10");
    }

    #[test]
    fn names_have_places_of_their_own() {
        let axis = PlotAxis { names: vec!["a".into(), "b".into()], ..PlotAxis::default() };
        let scale = Scale::new(&axis, [].into_iter(), [0.0, 100.0]);
        assert_eq!((scale.at(0.0), scale.at(1.0)), (25.0, 75.0));
        assert_eq!(scale.ticks(), [(0.0, "a".to_string()), (1.0, "b".to_string())]);
    }

    /// Values that are not positive are not drawn on a logarithmic axis.
    #[test]
    fn nothing_is_infinite() {
        let axis = PlotAxis { is_log: true, ..PlotAxis::default() };
        let scale = Scale::new(&axis, [1.0, 10.0].into_iter(), [0.0, 1.0]);
        assert_eq!((scale.at(0.0), scale.at(-1.0), scale.at(1e300)), (-2.0, -2.0, 3.0));
    }
}
