//! The viewer in HTML: data for the script, and the pictures beside the page for a reader without it.

use super::maps;
use crate::report::document::{FigureBlock, PageBlock, ViewerBlock};
use crate::report::markup::escape;

const STYLE: &str = include_str!("viewer.css");
/// In this order: each uses the ones before it.
const SCRIPTS: [&str; 4] = [
    include_str!("values.js"),
    include_str!("canvases.js"),
    include_str!("controls.js"),
    include_str!("viewer.js"),
];

/// A viewer on the page.
pub(crate) fn to_html(viewer: &ViewerBlock) -> String {
    let figures: String = viewer.figures.iter().map(figure).collect();
    let figures = format!("<div class=\"figures\">\n{figures}</div>");
    let label = match viewer.cell.as_str() {
        "" => "Pictures".to_string(),
        cell => format!("Pictures of {}", escape(cell)),
    };
    match &viewer.data {
        Some(data) if viewer.figures.is_empty() => format!(
            "<details>\n<summary>The same with movable seams</summary>\n\
             <div class=\"viewer\" role=\"group\" aria-label=\"{label}\">\n\
             <script type=\"application/json\">{data}</script>\n<noscript>This needs a script.</noscript>\n</div>\n\
             </details>\n"
        ),
        Some(data) => format!(
            "<div class=\"viewer\" role=\"group\" aria-label=\"{label}\">\n\
             <script type=\"application/json\">{data}</script>\n<noscript>{figures}</noscript>\n</div>\n"
        ),
        None if viewer.figures.is_empty() => {
            "<p class=\"viewer-left-out\">The page has no room for the same with movable seams.</p>\n"
                .into()
        }
        None => format!(
            "<p class=\"viewer-left-out\">The page has no room for more pictures that a script can compare. Their \
             PNG and EXR files are beside the page.</p>\n{figures}\n"
        ),
    }
}

/// Style and script of a page with viewers, for its head and its end.
pub(crate) fn parts(blocks: &[PageBlock]) -> (String, String) {
    if !blocks.iter().any(has_viewer) {
        return Default::default();
    }
    let [noise, signed] = maps::palettes();
    let scripts = SCRIPTS.join("\n");
    // One function around everything, so that nothing is global.
    let script = format!(
        "<script type=\"application/json\" id=\"viewer-palettes\">{{\"noise\":\"{noise}\",\"signed\":\"{signed}\"}}\
         </script>\n<script>\n\"use strict\";\n(() => {{\n{scripts}}})();\n</script>\n"
    );
    (STYLE.into(), script)
}

fn has_viewer(block: &PageBlock) -> bool {
    match block {
        PageBlock::Viewer(_) => true,
        PageBlock::Folded(_, blocks) => blocks.iter().any(has_viewer),
        _ => false,
    }
}

/// A picture by its file: the page already contains its values.
fn figure(f: &FigureBlock) -> String {
    let (title, caption) = (escape(&f.title), escape(&f.caption));
    let path =
        escape(&f.path.replace('%', "%25").replace(' ', "%20").replace('#', "%23").replace('?', "%3f"));
    format!(
        "<figure><img alt=\"{title}\" loading=\"lazy\" src=\"{path}\"><figcaption><b>{title}</b><br>{caption}\
         </figcaption></figure>\n"
    )
}
