//! A page as blocks: one content, written as Markdown here and as HTML in `html`.

use super::markup::without_html;
use super::table::Table;

/// One page of a report.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Document {
    /// Title of the page.
    pub title: String,
    /// Its blocks, from the top.
    pub blocks: Vec<PageBlock>,
}

/// A part of a page.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PageBlock {
    /// A heading of level 2 or 3.
    Heading(u8, String),
    /// A paragraph of plain text.
    Text(String),
    /// Unordered list.
    List(Vec<String>),
    /// Preformatted lines, such as a command.
    Code(String),
    /// A table with its name and caption.
    Table(TableBlock),
    /// Short outcomes at the head of the page.
    Badges(Vec<(BadgeKind, String)>),
    /// The picture at the head of the page.
    Lead(FigureBlock),
    /// Pictures side by side.
    Figures(Vec<FigureBlock>),
    /// One picture as wide as the page.
    Wide(FigureBlock),
    /// A viewer that compares the pictures of a cell.
    Viewer(ViewerBlock),
    /// Such viewers of several cells, of which one is shown at a time.
    Cells(Vec<ViewerBlock>),
    /// Folded blocks under a title.
    Folded(String, Vec<PageBlock>),
}

/// What a badge says, for its colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BadgeKind {
    /// As claimed.
    Good,
    /// A claim fails.
    Bad,
    /// Not decided.
    Open,
}

impl BadgeKind {
    /// The style of the outcome that it stands for.
    pub(crate) fn class(self) -> &'static str {
        match self {
            BadgeKind::Good => "pass",
            BadgeKind::Bad => "fail",
            BadgeKind::Open => "underpowered",
        }
    }
}

/// A table that can be used outside the page.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct TableBlock {
    /// Unique on its page; the stem of its files under `tables/`: lower-case words joined by `-`.
    pub name: String,
    /// What it shows and how to read it, in one or two sentences.
    pub caption: String,
    /// Rows and columns.
    pub table: Table,
}

impl TableBlock {
    /// A named table with its caption.
    pub(crate) fn new(name: impl Into<String>, caption: impl Into<String>, table: Table) -> TableBlock {
        TableBlock { name: name.into(), caption: caption.into(), table }
    }
}

/// The file of a picture.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum PictureFile {
    /// Bytes of a PNG file.
    Png(Vec<u8>),
    /// Text of an SVG file.
    Svg(String),
}

/// One picture with its caption.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct FigureBlock {
    /// Path relative to the page.
    pub path: String,
    /// File that is shown.
    pub picture: PictureFile,
    /// Short description.
    pub title: String,
    /// Caption.
    pub caption: String,
}

/// The pictures of one cell, in a viewer that compares them.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct ViewerBlock {
    /// The cell's label; empty without a sweep.
    pub cell: String,
    /// One tone-mapped PNG per estimator; none where the page shows them above.
    pub figures: Vec<FigureBlock>,
    /// The input of the page's script, as JSON; none where the page has no more room.
    pub data: Option<String>,
}

impl Document {
    /// Every table that has columns, in the order of the page.
    pub(crate) fn tables(&self) -> Vec<&TableBlock> {
        fn inside<'a>(blocks: &'a [PageBlock], tables: &mut Vec<&'a TableBlock>) {
            for block in blocks {
                match block {
                    PageBlock::Table(table) if !table.table.header.is_empty() => tables.push(table),
                    PageBlock::Folded(_, blocks) => inside(blocks, tables),
                    _ => (),
                }
            }
        }
        let mut tables = Vec::new();
        inside(&self.blocks, &mut tables);
        tables
    }

    /// The page as Markdown; pictures are separate files.
    pub(crate) fn to_markdown(&self) -> String {
        let blocks: String = self.blocks.iter().map(|block| format!("\n{}", markdown(block))).collect();
        format!("# {}\n{blocks}", self.title)
    }
}

/// A text as a file name or an anchor: ASCII letters and digits in lower case, else `-`.
pub(crate) fn slug(text: &str) -> String {
    let letters =
        text.chars().map(|c| if c.is_ascii_alphanumeric() { c.to_ascii_lowercase() } else { '-' });
    letters.collect()
}

fn markdown(block: &PageBlock) -> String {
    match block {
        PageBlock::Heading(level, text) => {
            format!("{} {}\n", "#".repeat(usize::from(*level)), without_html(text))
        }
        PageBlock::Text(text) => format!("{}\n", without_html(text)),
        PageBlock::List(items) => {
            items.iter().map(|item| format!("- {}\n", without_html(item))).collect()
        }
        PageBlock::Code(code) => format!("```\n{code}\n```\n"),
        PageBlock::Table(t) if t.caption.is_empty() => t.table.to_markdown(),
        PageBlock::Table(t) => format!("{}\n\n{}", without_html(&t.caption), t.table.to_markdown()),
        PageBlock::Figures(figures) => each(figures),
        PageBlock::Wide(f) | PageBlock::Lead(f) => figure(f),
        PageBlock::Badges(badges) => {
            let badges: Vec<String> = badges.iter().map(|(_, text)| format!("**{text}**")).collect();
            format!("{}\n", badges.join(", "))
        }
        PageBlock::Viewer(viewer) => each(&viewer.figures),
        PageBlock::Cells(viewers) => {
            let cell =
                |viewer: &ViewerBlock| format!("### {}\n\n{}", viewer.cell, each(&viewer.figures));
            viewers.iter().map(cell).collect::<Vec<_>>().join("\n")
        }
        PageBlock::Folded(title, blocks) => {
            let blocks: Vec<String> = blocks.iter().map(markdown).collect();
            format!("**{}**\n\n{}", without_html(title), blocks.join("\n"))
        }
    }
}

fn each(figures: &[FigureBlock]) -> String {
    figures.iter().map(figure).collect::<Vec<_>>().join("\n")
}

fn figure(f: &FigureBlock) -> String {
    let [title, caption] = [&f.title, &f.caption].map(|text| without_html(text));
    format!("![{title}]({})\n{title}: {caption}\n", f.path.replace(' ', "%20"))
}
