//! A plot as PDF, from its SVG: the few elements that plots consist of. Text is Helvetica, which every reader of PDF
//! has, so no font is embedded; characters beyond Latin-1 show as `?`.

use pdf_writer::{Content, Finish, Name, Pdf, Rect, Ref, Str};
use roxmltree::{Document, Node};

use crate::math::{cos, sin};

/// Points of a CSS pixel.
const POINTS: f32 = 0.75;
/// Font size of every text of a plot, CSS pixels.
const SIZE: f32 = 12.0;
/// Opacity of the bands of intervals.
const BAND: f32 = 0.18;

/// Widths of Helvetica's characters from the space to the tilde, thousandths of the font size (Adobe's font metrics).
const HELVETICA: [u16; 95] = [
    278, 278, 355, 556, 556, 889, 667, 191, 333, 333, 389, 584, 278, 333, 278, 278, 556, 556, 556, 556,
    556, 556, 556, 556, 556, 556, 278, 278, 584, 584, 584, 556, 1015, 667, 667, 722, 722, 667, 611, 778,
    722, 278, 500, 667, 556, 833, 722, 778, 667, 778, 722, 667, 611, 722, 667, 944, 667, 667, 611, 278,
    278, 278, 469, 556, 333, 556, 556, 500, 556, 556, 278, 556, 556, 222, 222, 500, 222, 833, 556, 556,
    556, 556, 333, 500, 278, 556, 500, 722, 500, 500, 500, 334, 260, 334, 584,
];

/// The file of a plot; nothing where the text is no SVG of a plot.
pub(crate) fn from_svg(svg: &str) -> Option<Vec<u8>> {
    let document = Document::parse(svg).ok()?;
    let root = document.root_element();
    let [_, _, width, height] = numbers(root.attribute("viewBox")?)[..] else { return None };
    let mut content = Content::new();
    // SVG counts rows from the top.
    content.transform([POINTS, 0.0, 0.0, -POINTS, 0.0, height * POINTS]);
    children(&mut content, root);
    Some(file([width * POINTS, height * POINTS], &content.finish()))
}

fn file([width, height]: [f32; 2], content: &[u8]) -> Vec<u8> {
    let [catalog, pages, page, font, stream, opacity] = [1, 2, 3, 4, 5, 6].map(Ref::new);
    let mut pdf = Pdf::new();
    // pdflatex warns of a newer version than it writes itself, and nothing here needs one.
    pdf.set_version(1, 4);
    pdf.catalog(catalog).pages(pages);
    pdf.pages(pages).kids([page]).count(1);
    let mut of_page = pdf.page(page);
    of_page.media_box(Rect::new(0.0, 0.0, width, height)).parent(pages).contents(stream);
    let mut resources = of_page.resources();
    resources.fonts().pair(Name(b"F"), font);
    resources.ext_g_states().pair(Name(b"B"), opacity);
    resources.finish();
    of_page.finish();
    pdf.type1_font(font).base_font(Name(b"Helvetica")).encoding_predefined(Name(b"WinAnsiEncoding"));
    pdf.ext_graphics(opacity).non_stroking_alpha(BAND);
    pdf.stream(stream, content);
    pdf.finish()
}

/// Numbers separated by blanks or commas.
fn numbers(text: &str) -> Vec<f32> {
    text.split([' ', ',']).filter_map(|word| word.parse().ok()).collect()
}

fn number(node: Node, name: &str) -> f32 {
    node.attribute(name).and_then(|text| text.parse().ok()).unwrap_or(0.0)
}

/// Red, green and blue; nothing for `none`. The colour of the text is black.
fn colour(text: Option<&str>) -> Option<[f32; 3]> {
    let text = text?;
    let byte = |value: f32| value / 255.0;
    // A variable of the page with what stands for it elsewhere.
    let text = match text.strip_prefix("var(").and_then(|rest| rest.split_once(", ")) {
        Some((_, other)) => other.trim_end_matches(')'),
        None => text,
    };
    if let Some(rgb) = text.strip_prefix("rgb(") {
        let [r, g, b] = numbers(rgb.trim_end_matches(')'))[..] else { return None };
        return Some([r, g, b].map(byte));
    }
    let hex = |range| u8::from_str_radix(text.get(range)?, 16).ok().map(f32::from);
    match text {
        "none" => None,
        "#fff" => Some([1.0; 3]),
        _ if text.starts_with('#') && text.len() == 7 => {
            Some([hex(1..3)?, hex(3..5)?, hex(5..7)?].map(byte))
        }
        _ => Some([0.0; 3]),
    }
}

fn children(content: &mut Content, node: Node) {
    for child in node.children().filter(Node::is_element) {
        content.save_state();
        match child.tag_name().name() {
            "svg" => nested(content, child),
            "path" => {
                painted(content, child, |content| path(content, child.attribute("d").unwrap_or("")))
            }
            "circle" => painted(content, child, |content| circle(content, child)),
            "rect" => painted(content, child, |content| {
                let [x, y, width, height] =
                    ["x", "y", "width", "height"].map(|name| number(child, name));
                content.rect(x, y, width, height);
            }),
            "text" => text(content, child),
            _ => (),
        }
        content.restore_state();
    }
}

/// A picture within the picture, which is clipped.
fn nested(content: &mut Content, node: Node) {
    let [x, y, width, height] = ["x", "y", "width", "height"].map(|name| number(node, name));
    let [left, top] = match node.attribute("viewBox").map(numbers).as_deref() {
        Some([left, top, _, _]) => [*left, *top],
        _ => [0.0, 0.0],
    };
    content.transform([1.0, 0.0, 0.0, 1.0, x - left, y - top]);
    content.rect(left, top, width, height).clip_nonzero().end_path();
    children(content, node);
}

/// Fills and strokes a shape as its attributes have it.
fn painted(content: &mut Content, node: Node, shape: impl FnOnce(&mut Content)) {
    let fill = match (node.attribute("fill"), node.has_attribute("stroke")) {
        // What has no fill is drawn by its stroke alone: lines enclose nothing.
        (None, true) => None,
        (fill, _) => colour(fill),
    };
    let stroke = colour(node.attribute("stroke"));
    if let Some([r, g, b]) = fill {
        content.set_fill_rgb(r, g, b);
        if node.has_attribute("fill-opacity") {
            content.set_parameters(Name(b"B"));
        }
    }
    if let Some([r, g, b]) = stroke {
        content.set_stroke_rgb(r, g, b);
        content.set_line_width(
            node.attribute("stroke-width").map_or(1.0, |_| number(node, "stroke-width")),
        );
        content.set_dash_pattern(numbers(node.attribute("stroke-dasharray").unwrap_or("")), 0.0);
    }
    shape(content);
    match (fill, stroke) {
        (Some(_), Some(_)) => content.fill_nonzero_and_stroke(),
        (Some(_), None) => content.fill_nonzero(),
        (None, Some(_)) => content.stroke(),
        (None, None) => content.end_path(),
    };
}

/// The commands M, L, l, H, V and Z.
fn path(content: &mut Content, data: &str) {
    let mut at = [0.0f32; 2];
    let mut rest = data;
    while let Some(command) = rest.chars().next() {
        rest = &rest[command.len_utf8()..];
        let end = rest.find(|c: char| c.is_ascii_alphabetic() && c != 'e').unwrap_or(rest.len());
        let values = numbers(&rest[..end]);
        rest = &rest[end..];
        match (command, &values[..]) {
            ('M', [x, y]) => {
                at = [*x, *y];
                content.move_to(at[0], at[1]);
                continue;
            }
            ('L', [x, y]) => at = [*x, *y],
            ('l', [x, y]) => at = [at[0] + x, at[1] + y],
            ('H', [x]) => at[0] = *x,
            ('V', [y]) => at[1] = *y,
            ('Z', _) => {
                content.close_path();
                continue;
            }
            _ => continue,
        }
        content.line_to(at[0], at[1]);
    }
}

/// Four arcs, each nearly a quarter of a circle.
fn circle(content: &mut Content, node: Node) {
    const HANDLE: f32 = 0.552_284_8;
    let [x, y, r] = ["cx", "cy", "r"].map(|name| number(node, name));
    let h = HANDLE * r;
    content.move_to(x + r, y);
    content.cubic_to(x + r, y + h, x + h, y + r, x, y + r);
    content.cubic_to(x - h, y + r, x - r, y + h, x - r, y);
    content.cubic_to(x - r, y - h, x - h, y - r, x, y - r);
    content.cubic_to(x + h, y - r, x + r, y - h, x + r, y);
    content.close_path();
}

fn text(content: &mut Content, node: Node) {
    let words = node.text().unwrap_or_default();
    let bytes: Vec<u8> = words.chars().map(encoded).collect();
    let width = bytes.iter().map(|byte| width(*byte)).sum::<f32>() * SIZE / 1000.0;
    let shift = match node.attribute("text-anchor") {
        Some("middle") => -0.5 * width,
        Some("end") => -width,
        _ => 0.0,
    };
    let [mut x, mut y] = ["x", "y"].map(|name| number(node, name));
    let mut turn = 0.0f32;
    let transform = node.attribute("transform").unwrap_or("");
    let arguments = |name: &str| {
        let (_, rest) = transform.split_once(name)?;
        Some(numbers(rest.split_once(')')?.0))
    };
    if let Some([dx, dy]) = arguments("translate(").as_deref() {
        [x, y] = [x + dx, y + dy];
    }
    // About the point at which the text is placed.
    if let Some([degrees, ..]) = arguments("rotate(").as_deref() {
        turn = degrees.to_radians();
    }
    let (c, s) = (cos(f64::from(turn)) as f32, sin(f64::from(turn)) as f32);
    let [r, g, b] = colour(node.attribute("fill")).unwrap_or([0.0; 3]);
    content.set_fill_rgb(r, g, b);
    content.begin_text().set_font(Name(b"F"), SIZE);
    content.set_text_matrix([c, s, s, -c, x + shift * c, y + shift * s]);
    content.show(Str(&bytes)).end_text();
}

/// A character in Windows' encoding.
fn encoded(letter: char) -> u8 {
    match letter {
        ' '..='~' | '\u{a0}'..='\u{ff}' => letter as u8,
        '…' => 0x85,
        '–' | '−' => 0x96,
        '—' => 0x97,
        '’' => 0x92,
        _ => b'?',
    }
}

fn width(byte: u8) -> f32 {
    let known = HELVETICA.get(usize::from(byte.wrapping_sub(b' ')));
    known.map_or(556.0, |width| f32::from(*width))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::plot::{Plot, PlotAxis, PlotPoint, Series, Size, Style, panels};

    fn stream(pdf: &[u8]) -> String {
        let text = String::from_utf8_lossy(pdf).into_owned();
        let (_, rest) = text.split_once("stream\n").expect("a stream");
        rest.split_once("\nendstream").expect("its end").0.to_string()
    }

    #[test]
    fn a_plot_has_its_lines_marks_and_words() {
        let point = |k: u8| PlotPoint::new(f64::from(k), 2.0, [1.0, 3.0]);
        let series = vec![Series::new("a (b) \\ é…", Style::Line, (1..5).map(point).collect())];
        let plot = Plot {
            x: PlotAxis::log("passes"),
            y: PlotAxis::linear("mean"),
            series,
            levels: vec![(1.5, "truth".into())],
            size: Size::Small,
        };
        let svg = panels(&[plot]);
        let pdf = from_svg(&svg).expect("a file");
        // pdflatex takes it without a warning.
        assert!(pdf.starts_with(b"%PDF-1.4") && pdf.ends_with(b"%%EOF"));
        let content = stream(&pdf);
        // `a (b) \ é…` in Windows' encoding.
        for words in ["(passes) Tj", "(mean) Tj", "(truth) Tj", "<6120286229205C20E985> Tj"] {
            assert!(content.contains(words), "{words}: {content}");
        }
        assert_eq!(content.matches(" Tj").count(), svg.matches("<text").count());
        // Every circle is four arcs, filled and stroked.
        assert_eq!(
            content.lines().filter(|line| line.ends_with(" c")).count(),
            4 * svg.matches("<circle").count()
        );
        // The band of the interval, the circles, and nothing else is filled.
        assert_eq!(content.lines().filter(|line| *line == "f" || *line == "B").count(), 1 + 4);
        assert_eq!(content.matches("/B gs").count(), 1);
        assert_eq!(
            content.lines().filter(|l| *l == "q").count(),
            content.lines().filter(|l| *l == "Q").count()
        );
        assert!(from_svg("no picture").is_none() && from_svg("<svg/>").is_none());
    }

    #[test]
    fn paths_and_colours_are_read() {
        let mut content = Content::new();
        path(&mut content, "M1 2L3 4l1 -1H9V5.5Z");
        let text = String::from_utf8(content.finish().to_vec()).expect("text");
        assert_eq!(text, "1 2 m\n3 4 l\n4 3 l\n9 3 l\n9 5.5 l\nh");
        assert_eq!(colour(Some("var(--line, #ff0000)")), Some([1.0, 0.0, 0.0]));
        assert_eq!(colour(Some("rgb(0,255,0)")), Some([0.0, 1.0, 0.0]));
        assert_eq!((colour(Some("none")), colour(None)), (None, None));
        assert_eq!(colour(Some("currentColor")), Some([0.0; 3]));
    }
}
