//! The viewer in HTML: data for the script, and the pictures beside the page for a reader without it.

use super::maps;
use crate::report::base64;
use crate::report::document::{FigureBlock, PageBlock, PictureFile, ViewerBlock};
use crate::report::markup::escape;

const STYLE: &str = include_str!("viewer.css");
/// In this order: each uses the ones before it.
const SCRIPTS: [&str; 5] = [
    include_str!("values.js"),
    include_str!("canvases.js"),
    include_str!("controls.js"),
    include_str!("viewer.js"),
    include_str!("cells.js"),
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

/// Viewers of several cells, of which the script shows one at a time; without it all are there.
pub(crate) fn cells(viewers: &[ViewerBlock]) -> String {
    let mut room = SHEET_ROOM;
    let mut cell = |viewer: &ViewerBlock| {
        let label = escape(&viewer.cell);
        // The last estimator's picture stands for the cell in the contact sheet.
        let thumb = viewer.figures.last().and_then(|figure| match &figure.picture {
            PictureFile::Png(png) => {
                room = room.checked_sub(png.len())?;
                let data = base64::encode(png);
                Some(format!(
                    "<img class=\"viewer-thumb\" alt=\"\" hidden src=\"data:image/png;base64,{data}\">\n"
                ))
            }
            PictureFile::Svg(_) => None,
        });
        format!(
            "<section class=\"viewer-cell\" data-cell=\"{label}\">\n<h3>{label}</h3>\n{}{}</section>\n",
            thumb.unwrap_or_default(),
            to_html(viewer)
        )
    };
    let cells: String = viewers.iter().map(&mut cell).collect();
    format!("<div class=\"viewer-cells\">\n{cells}</div>\n")
}

/// Bytes of all pictures of a contact sheet together.
const SHEET_ROOM: usize = 3_000_000;

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
        PageBlock::Viewer(_) | PageBlock::Cells(_) => true,
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
