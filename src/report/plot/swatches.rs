//! Colours with their names, as SVG.

use crate::report::markup::escape;

/// Colours with their names.
pub(crate) fn to_svg(colours: &[(String, [u8; 3])]) -> String {
    let height = 12.0 + 44.0 * colours.len() as f64;
    let row = |(place, (name, [r, g, b])): (usize, &(String, [u8; 3]))| {
        let top = 12.0 + 44.0 * place as f64;
        let name = escape(name);
        format!(
            "<rect x=\"12\" y=\"{top}\" width=\"120\" height=\"36\" rx=\"4\" fill=\"rgb({r},{g},{b})\" \
             stroke=\"currentColor\" stroke-opacity=\"0.3\"/><text x=\"146\" y=\"{}\" \
             fill=\"currentColor\">{name}, rgb({r}, {g}, {b})</text>\n",
            top + 22.0
        )
    };
    let rows: String = colours.iter().enumerate().map(row).collect();
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 480 {height}\" role=\"img\" font-family=\"system-ui, \
         sans-serif\" font-size=\"12\" style=\"color: var(--ink, #1d2433)\">\n{rows}</svg>\n"
    )
}
