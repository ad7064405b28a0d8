//! Numbers with their uncertainty; no number is shown without it.

/// `1.234(5)`: the digits in brackets are one standard error in units of the last digit shown. The
/// error has one digit, or two where the first is 1. `1.234(5)e-7` where plain digits would not show
/// it; `1.234 ± 0` for an exact value, `1.234 ± ?` where no error is known.
pub(crate) fn with_error(value: f64, std_error: f64) -> String {
    if !value.is_finite() {
        return value.to_string();
    }
    if std_error == 0.0 {
        return format!("{value:?} ± 0");
    }
    if !std_error.is_finite() {
        return format!("{} ± ?", significant(value, 4));
    }
    let (digits, last) = error_digits(std_error);
    let (_, top) = exponent_form(value.abs().max(std_error), 0);
    if last <= 0 && (-3..6).contains(&top) {
        return format!("{value:.*}({digits})", -last as usize);
    }
    // The value in units of 10^top; parsing a decimal scale rounds once, where powers would twice.
    let scale: f64 = format!("1e{top}").parse().unwrap_or(1.0);
    format!("{:.*}({digits})e{top}", (top - last).max(0) as usize, value / scale)
}

/// The digits of an error to be shown, and the decimal place of the last of them: 0.005 has ("5", -3),
/// 0.0123 has ("12", -3), and 0.0096, which rounds to 0.010, has ("10", -3).
fn error_digits(std_error: f64) -> (String, i32) {
    let (one, exponent) = exponent_form(std_error, 0);
    if one != "1" {
        return (one, exponent);
    }
    match exponent_form(std_error, 1) {
        (two, same) if same == exponent => (two.replace('.', ""), exponent - 1),
        _ => ("10".into(), exponent - 1),
    }
}

/// A number to `digits` significant digits, plain or with an exponent; empty for NaN.
pub(crate) fn significant(x: f64, digits: usize) -> String {
    if x.is_nan() {
        return String::new();
    }
    if x == 0.0 || !x.is_finite() {
        return x.to_string();
    }
    let (mantissa, exponent) = exponent_form(x, digits.saturating_sub(1));
    match exponent {
        -3..6 => format!("{x:.*}", (digits as i32 - 1 - exponent).max(0) as usize),
        _ => format!("{mantissa}e{exponent}"),
    }
}

/// A fraction as per cent; empty for NaN.
pub(crate) fn per_cent(x: f64) -> String {
    if x.is_nan() { String::new() } else { format!("{} %", significant(100.0 * x, 2)) }
}

/// Mantissa with this many decimals, and decimal exponent.
fn exponent_form(x: f64, decimals: usize) -> (String, i32) {
    let text = format!("{x:.decimals$e}");
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    (mantissa.to_string(), exponent.parse().unwrap_or(0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_sets_the_digits() {
        let cases = [
            (1.23449, 0.005, "1.234(5)"),
            (1.23449, 0.0123, "1.234(12)"),
            (1.23449, 0.0096, "1.234(10)"),
            (-0.5, 0.25, "-0.5(2)"),
            (12.6, 3.0, "13(3)"),
            (1234.5, 30.0, "1.23(3)e3"),
            (1.2344e-7, 5e-10, "1.234(5)e-7"),
            (6.02214e23, 3e18, "6.02214(3)e23"),
            (0.0, 0.002, "0.000(2)"),
            (1e-9, 0.02, "0.00(2)"),
            (0.25, 0.0, "0.25 ± 0"),
            (0.25, f64::NAN, "0.2500 ± ?"),
            (f64::NAN, 0.1, "NaN"),
        ];
        for (value, error, text) in cases {
            assert_eq!(with_error(value, error), text, "{value} {error}");
        }
    }

    #[test]
    fn plain_numbers() {
        assert_eq!(
            [0.012345, 1234.5, 1e-9, -3.0].map(|x| significant(x, 3)),
            ["0.0123", "1234", "1.00e-9", "-3.00"]
        );
        assert_eq!((significant(f64::NAN, 3), per_cent(0.0123)), (String::new(), "1.2 %".into()));
    }
}
