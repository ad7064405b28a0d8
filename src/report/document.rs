//! A page as blocks: one content, written as Markdown here and as HTML in `html`.

use super::table::Table;

/// A page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Document {
    /// Its title.
    pub title: String,
    /// Its blocks, from the top.
    pub blocks: Vec<Block>,
}

/// A part of a page.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// A heading of level 2 or 3.
    Heading(u8, String),
    /// A paragraph of plain text.
    Text(String),
    /// Plain items.
    List(Vec<String>),
    /// Lines as they are: a command.
    Code(String),
    /// A table.
    Table(Table),
    /// Pictures that stand side by side.
    Figures(Vec<FigureBlock>),
    /// One picture over the width of the page.
    Wide(FigureBlock),
}

/// The file of a picture.
#[derive(Clone, Debug, PartialEq)]
pub enum Picture {
    /// PNG.
    Png(Vec<u8>),
    /// SVG.
    Svg(String),
}

/// One picture.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureBlock {
    /// Path relative to the page.
    pub path: String,
    /// What is shown.
    pub picture: Picture,
    /// What it is, in a few words.
    pub title: String,
    /// What it shows.
    pub caption: String,
}

impl Document {
    /// The page as Markdown; pictures stand beside it.
    pub fn to_markdown(&self) -> String {
        let blocks: String = self.blocks.iter().map(|block| format!("\n{}", markdown(block))).collect();
        format!("# {}\n{blocks}", self.title)
    }
}

fn markdown(block: &Block) -> String {
    match block {
        Block::Heading(level, text) => format!("{} {text}\n", "#".repeat(usize::from(*level))),
        Block::Text(text) => format!("{text}\n"),
        Block::List(items) => items.iter().map(|item| format!("- {item}\n")).collect(),
        Block::Code(code) => format!("```\n{code}\n```\n"),
        Block::Table(table) => table.to_markdown(),
        Block::Figures(figures) => figures.iter().map(figure).collect::<Vec<_>>().join("\n"),
        Block::Wide(f) => figure(f),
    }
}

fn figure(f: &FigureBlock) -> String {
    format!("![{}]({})\n{}: {}\n", f.title, f.path.replace(' ', "%20"), f.title, f.caption)
}
