//! The page as one HTML file: without network access, with pictures as data URIs, in light and dark colours,
//! and readable on a phone.

use super::base64;
use super::document::{BadgeKind, Document, FigureBlock, PageBlock, PictureFile, TableBlock, slug};
use super::latex::to_latex;
use super::markup::escape;
use super::viewer;

const STYLE: &str = include_str!("style.css");
const SCRIPT: &str = include_str!("page.js");

/// Most rows of a table whose LaTeX, Markdown and CSV are part of the page; those of longer tables are
/// in files only.
const CARRIED_ROWS: usize = 200;

/// The page as one file.
pub(crate) fn to_html(page: &Document) -> String {
    let title = escape(&page.title);
    let body: String = page.blocks.iter().map(block).collect();
    let contents = contents(page);
    let (style, script) = viewer::parts(&page.blocks);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}{style}</style>\n</head>\n<body>\n<h1>{title}</h1>\n{contents}{body}\
         <script>\n{SCRIPT}</script>\n{script}</body>\n</html>\n"
    )
}

/// Links to the sections, where there are several.
fn contents(page: &Document) -> String {
    let headings = page.blocks.iter().filter_map(|block| match block {
        PageBlock::Heading(2, text) => {
            Some(format!("<a href=\"#{}\">{}</a>\n", slug(text), escape(text)))
        }
        _ => None,
    });
    let links: Vec<String> = headings.collect();
    match links.len() {
        0 | 1 => String::new(),
        _ => format!("<nav aria-label=\"Sections\">\n{}</nav>\n", links.concat()),
    }
}

fn block(of: &PageBlock) -> String {
    match of {
        PageBlock::Heading(2, text) => format!("<h2 id=\"{}\">{}</h2>\n", slug(text), escape(text)),
        PageBlock::Heading(level, text) => format!("<h{level}>{}</h{level}>\n", escape(text)),
        PageBlock::Text(text) => format!("<p>{}</p>\n", inline(text)),
        PageBlock::List(items) => {
            let items: String =
                items.iter().map(|item| format!("<li>{}</li>\n", inline(item))).collect();
            format!("<ul>\n{items}</ul>\n")
        }
        PageBlock::Code(code) => format!("<pre tabindex=\"0\">{}</pre>\n", escape(code)),
        PageBlock::Table(t) => table(t),
        PageBlock::Viewer(viewer) => viewer::to_html(viewer),
        PageBlock::Folded(title, blocks) => {
            let inner: String = blocks.iter().map(block).collect();
            format!("<details>\n<summary>{}</summary>\n{inner}</details>\n", escape(title))
        }
        PageBlock::Badges(badges) => {
            let badge = |(kind, text): &(BadgeKind, String)| {
                format!("<span class=\"badge {}\">{}</span>\n", kind.class(), escape(text))
            };
            format!("<p class=\"badges\">\n{}</p>\n", badges.iter().map(badge).collect::<String>())
        }
        PageBlock::Lead(f) => format!("<div class=\"lead\">\n{}</div>\n", figure(f)),
        PageBlock::Cells(viewers) => viewer::cells(viewers),
        PageBlock::Wide(f) => format!("<div class=\"wide\">\n{}</div>\n", figure(f)),
        PageBlock::Figures(f) => figures(f),
    }
}

fn figures(figures: &[FigureBlock]) -> String {
    format!("<div class=\"figures\">\n{}</div>\n", figures.iter().map(figure).collect::<String>())
}

/// Longer fields of a table, in bytes, are broken into lines.
const LONGEST_LINE: usize = 40;

/// A table with its caption, and its text for a paper, a spreadsheet or a page.
fn table(of: &TableBlock) -> String {
    let TableBlock { name, caption, table } = of;
    if table.header.is_empty() {
        return String::new();
    }
    let numeric: Vec<bool> = (0..table.header.len()).map(|column| table.is_numeric(column)).collect();
    let class = |column: usize| if numeric[column] { " class=\"number\"" } else { "" };
    let head = table
        .header
        .iter()
        .enumerate()
        .map(|(c, h)| format!("<th scope=\"col\"{}>{}</th>", class(c), escape(h)));
    let row = |row: &Vec<String>| {
        let of = |c: usize, f: &str| if f.len() > LONGEST_LINE { " class=\"long\"" } else { class(c) };
        let fields = row.iter().enumerate().map(|(c, f)| format!("<td{}>{}</td>", of(c, f), field(f)));
        format!("<tr>{}</tr>\n", fields.collect::<String>())
    };
    let caption = match caption.is_empty() {
        true => String::new(),
        false => format!("<p class=\"caption\">{}</p>\n", inline(caption)),
    };
    format!(
        "<section class=\"table\" id=\"table-{name}\">\n{caption}<div class=\"scroll\" tabindex=\"0\" \
         role=\"region\" aria-label=\"{name}\"><table>\n<thead><tr>{}</tr></thead>\n<tbody>\n{}</tbody>\n\
         </table></div>\n{}</section>\n",
        head.collect::<String>(),
        table.rows.iter().map(row).collect::<String>(),
        sources(of)
    )
}

/// The table as LaTeX, Markdown and CSV, for copying.
fn sources(of: &TableBlock) -> String {
    let TableBlock { name, caption, table } = of;
    let files = format!("tables/{name}.tex, .md, .csv");
    if table.rows.len() > CARRIED_ROWS {
        return format!("<p class=\"files\">{files}</p>\n");
    }
    let forms = [
        ("LaTeX", to_latex(table, name, caption)),
        ("Markdown", table.to_markdown()),
        ("CSV", table.to_csv()),
    ];
    let form = |(form, text): &(&str, String)| {
        format!(
            "<details class=\"source\"><summary>{form}</summary><pre tabindex=\"0\">{}</pre></details>\n",
            escape(text)
        )
    };
    format!(
        "<div class=\"sources\">\n{}<span class=\"files\">{files}</span></div>\n",
        forms.iter().map(form).collect::<String>()
    )
}

/// A field; outcomes are words in colour.
fn field(text: &str) -> String {
    match text {
        "pass" | "fail" | "underpowered" | "invalid" => format!("<span class=\"{text}\">{text}</span>"),
        _ => escape(text),
    }
}

fn figure(f: &FigureBlock) -> String {
    let title = escape(&f.title);
    let picture = match &f.picture {
        PictureFile::Png(png) => {
            format!("<img alt=\"{title}\" src=\"data:image/png;base64,{}\">", base64::encode(png))
        }
        // Inside an HTML page the name space is implied.
        PictureFile::Svg(svg) => svg.replace(" xmlns=\"http://www.w3.org/2000/svg\"", ""),
    };
    let caption = inline(&f.caption);
    format!("<figure>{picture}<figcaption><b>{title}</b> {caption}</figcaption></figure>\n")
}

/// Text with its `code`.
fn inline(text: &str) -> String {
    let parts = text.split('`').enumerate();
    let part = |(place, part): (usize, &str)| match place % 2 {
        0 => escape(part),
        _ => format!("<code>{}</code>", escape(part)),
    };
    parts.map(part).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::table::Table;

    fn page(rows: usize) -> String {
        let mut table = Table::new(&["cell", "ratio"]);
        (0..rows).for_each(|_| table.push(vec!["a&b".into(), "1.2 [1.1, 1.3]".into()]));
        let blocks = vec![
            PageBlock::Heading(2, "How fast?".into()),
            PageBlock::Folded(
                "More".into(),
                vec![PageBlock::Table(TableBlock::new("speed", "Speed.", table))],
            ),
            PageBlock::Heading(2, "Cost".into()),
        ];
        to_html(&Document { title: "x".into(), blocks })
    }

    #[test]
    fn a_table_can_be_taken_elsewhere() {
        let html = page(2);
        for text in [
            "<a href=\"#how-fast-\">",
            "<h2 id=\"how-fast-\">",
            "a\\&amp;b",
            "\\toprule",
            "a&amp;b,\"1.2 [1.1, 1.3]\"".replace('"', "&quot;").as_str(),
        ] {
            assert!(html.contains(text), "{text}\n{html}");
        }
        let long = page(CARRIED_ROWS + 1);
        assert!(!long.contains("toprule") && long.contains("tables/speed.tex"));
    }
}
