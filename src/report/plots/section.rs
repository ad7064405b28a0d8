//! Plots under one heading, as blocks of a page and as files.

use crate::error::Result;
use crate::report::document::{FigureBlock, PageBlock, PictureFile};
use crate::report::pictures::few_bands;
use crate::report::plot::slice::SlicePlot;
use crate::report::plot::{Plot, on_paper, panels, pdf, swatches};
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::{RecordFolder, Stored};

/// One picture of one or more plots below each other.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct PlotFigure {
    /// Stem of its files under `plots/`, unique on its page.
    pub name: String,
    /// Short description of the plot.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// Plots of the section, or why there are none.
    pub content: Content,
}

/// Content of a section.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Content {
    /// Plots in order.
    Plots(Vec<Plot>),
    /// Names with their 8-bit sRGB colours.
    Swatches(Vec<(String, [u8; 3])>),
    /// A plane through a body.
    Slice(SlicePlot),
}

/// Plots under one heading.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Section {
    /// Heading of the section.
    pub heading: String,
    /// Text for all of them.
    pub text: String,
    /// Plots with their files.
    pub drawn: Vec<PlotFigure>,
    /// Whether they are placed side by side.
    pub are_small: bool,
}

impl Section {
    /// Writes the pictures and their numbers into `plots/`.
    ///
    /// # Errors
    /// I/O.
    pub(crate) fn write(&self, folder: &RecordFolder) -> Result<()> {
        for drawn in &self.drawn {
            let svg = on_paper(&drawn.to_svg());
            folder.write_view(&drawn.path(), svg.as_bytes())?;
            if let Some(pdf) = pdf::from_svg(&svg) {
                folder.write_view(&format!("plots/{}.pdf", drawn.name), &pdf)?;
            }
            for (number, numbers) in drawn.numbers().iter().enumerate() {
                let part = if number == 0 { String::new() } else { format!("-{}", number + 1) };
                let path = format!("plots/{}{part}.csv", drawn.name);
                folder.write_view(&path, numbers.as_bytes())?;
            }
        }
        Ok(())
    }

    /// The blocks of the page.
    pub(crate) fn blocks(&self) -> Vec<PageBlock> {
        let mut blocks = vec![PageBlock::Heading(2, self.heading.clone())];
        if !self.text.is_empty() {
            blocks.push(PageBlock::Text(self.text.clone()));
        }
        let figures: Vec<FigureBlock> = self.drawn.iter().map(PlotFigure::figure).collect();
        let pictures = match self.are_small {
            true => vec![PageBlock::Figures(figures)],
            false => figures.into_iter().map(PageBlock::Wide).collect(),
        };
        match self.drawn.len() > MOST_OPEN {
            true => blocks.push(PageBlock::Folded(format!("All {} plots", self.drawn.len()), pictures)),
            false => blocks.extend(pictures),
        }
        blocks
    }
}

/// With more plots a section is folded.
const MOST_OPEN: usize = 12;

impl PlotFigure {
    /// A picture of one plot.
    pub(super) fn of(name: String, title: String, caption: String, plot: Plot) -> PlotFigure {
        PlotFigure { name, title, caption, content: Content::Plots(vec![plot]) }
    }

    fn path(&self) -> String {
        format!("plots/{}.svg", self.name)
    }

    /// As CSV, a file for each plot.
    fn numbers(&self) -> Vec<String> {
        match &self.content {
            Content::Plots(plots) => plots.iter().map(Plot::to_csv).collect(),
            Content::Swatches(_) => Vec::new(),
            Content::Slice(slice) => vec![slice.to_csv()],
        }
    }

    fn to_svg(&self) -> String {
        match &self.content {
            Content::Slice(slice) => slice.to_svg(),
            Content::Plots(plots) => panels(plots),
            Content::Swatches(colours) => swatches::to_svg(colours),
        }
    }

    fn figure(&self) -> FigureBlock {
        FigureBlock {
            path: self.path(),
            picture: PictureFile::Svg(self.to_svg()),
            title: self.title.clone(),
            caption: self.caption.clone(),
        }
    }
}

/// Indices of the bands that have plots of their own.
pub(super) fn shown_bands(stored: &Stored) -> Vec<usize> {
    few_bands(stored.record.bands.len())
}

/// The estimators of a cell, without second arms of one.
pub(super) fn runs(cell: &Cell) -> impl Iterator<Item = &EstimatorRun> {
    cell.runs.iter().filter(|run| run.control_of.is_none())
}

/// The parts of a title that are not empty, joined.
pub(super) fn joined(parts: &[&str]) -> String {
    parts.iter().filter(|part| !part.is_empty()).copied().collect::<Vec<_>>().join(", ")
}

/// The mean of an observable in words; that of an image is called `mean` itself.
pub(super) fn mean_of(observable: &str) -> String {
    if observable == "mean" { "image mean".into() } else { format!("mean of {observable}") }
}

/// The name of a band in a title; empty if there is only one band.
pub(super) fn band_name(stored: &Stored, band: usize) -> &str {
    if stored.record.bands.len() == 1 { "" } else { &stored.record.bands[band].name }
}
