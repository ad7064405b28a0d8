//! The page as one HTML file: no network, pictures as data URIs, light and dark, readable on a phone.

use super::base64;
use super::document::{Block, Document, FigureBlock, Picture};
use super::table::Table;
use super::viewer;

const STYLE: &str = include_str!("style.css");

/// The page as a file of its own.
pub fn to_html(page: &Document) -> String {
    let title = escape(&page.title);
    let body: String = page.blocks.iter().map(block).collect();
    let (style, script) = viewer::parts(&page.blocks);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{body}{script}</body>\n</html>\n"
    )
}

fn block(block: &Block) -> String {
    match block {
        Block::Heading(level, text) => format!("<h{level}>{}</h{level}>\n", escape(text)),
        Block::Text(text) => format!("<p>{}</p>\n", escape(text)),
        Block::List(items) => {
            let items: String =
                items.iter().map(|item| format!("<li>{}</li>\n", escape(item))).collect();
            format!("<ul>\n{items}</ul>\n")
        }
        Block::Code(code) => format!("<pre>{}</pre>\n", escape(code)),
        Block::Table(t) => table(&t.table),
        Block::Viewer(viewer) => viewer::to_html(viewer),
        Block::Folded(title, blocks) => {
            let inner: String = blocks.iter().map(self::block).collect();
            format!("<details>\n<summary>{}</summary>\n{inner}</details>\n", escape(title))
        }
        Block::Wide(f) => format!("<div class=\"wide\">\n{}</div>\n", figure(f)),
        Block::Figures(f) => figures(f),
    }
}

fn figures(figures: &[FigureBlock]) -> String {
    format!("<div class=\"figures\">\n{}</div>\n", figures.iter().map(figure).collect::<String>())
}

fn table(table: &Table) -> String {
    let numeric: Vec<bool> = (0..table.header.len()).map(|column| table.is_numeric(column)).collect();
    let class = |column: usize| if numeric[column] { " class=\"number\"" } else { "" };
    let head =
        table.header.iter().enumerate().map(|(c, h)| format!("<th{}>{}</th>", class(c), escape(h)));
    let row = |row: &Vec<String>| {
        let fields = row.iter().enumerate().map(|(c, f)| format!("<td{}>{}</td>", class(c), field(f)));
        format!("<tr>{}</tr>\n", fields.collect::<String>())
    };
    format!(
        "<div class=\"scroll\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody>\n</table></div>\n",
        head.collect::<String>(),
        table.rows.iter().map(row).collect::<String>()
    )
}

/// A field; outcomes are coloured, and still say in words what they are.
fn field(text: &str) -> String {
    match text {
        "pass" | "fail" | "underpowered" | "invalid" => format!("<span class=\"{text}\">{text}</span>"),
        _ => escape(text),
    }
}

fn figure(f: &FigureBlock) -> String {
    let title = escape(&f.title);
    let picture = match &f.picture {
        Picture::Png(png) => {
            format!("<img alt=\"{title}\" src=\"data:image/png;base64,{}\">", base64::encode(png))
        }
        Picture::Svg(svg) => svg.clone(),
    };
    let caption = escape(&f.caption);
    format!("<figure>{picture}<figcaption><b>{title}</b><br>{caption}</figcaption></figure>\n")
}

/// Text that stands between tags or in an attribute.
pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
