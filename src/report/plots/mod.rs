//! The plots of a record: what each shows, from the record and its timing alone.

use std::collections::BTreeSet;

use super::document::{Block, FigureBlock, Picture};
use super::few_bands;
use super::plot::{Plot, panels};
use crate::error::Result;
use crate::results::pictures::Wanted;
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::{RecordFolder, Stored};
use crate::verify::comparisons::EfficiencyRow;

/// Error against time and rays.
mod convergence;
/// What was drawn from samplers, and what was expected.
mod goodness;
/// Exitance by distance.
mod profiles;
/// Efficiency along the axes of a sweep.
mod ratios;
/// Means as passes add up.
mod running;
/// Means by wavelength, and their colour.
mod spectra;

/// One picture of one or more plots, one above the other.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Its files' stem under `plots/`, unique on its page.
    pub name: String,
    /// What it shows, in a few words.
    pub title: String,
    /// How to read it.
    pub caption: String,
    /// What is drawn.
    pub content: Content,
}

/// What is drawn.
#[derive(Clone, Debug, PartialEq)]
pub enum Content {
    /// Plots.
    Plots(Vec<Plot>),
    /// Names with their 8-bit sRGB colours.
    Swatches(Vec<(String, [u8; 3])>),
}

/// Plots under one heading.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// The heading.
    pub heading: String,
    /// What is said of all of them.
    pub text: String,
    /// The plots.
    pub drawn: Vec<Drawn>,
    /// Whether they stand side by side.
    pub are_small: bool,
}

/// Every section that this record has plots for, in the order of the page.
pub fn sections(stored: &Stored, rows: &[EfficiencyRow], wanted: &[Wanted]) -> Vec<Section> {
    let sections = [
        ratios::section(stored, rows),
        running::section(stored, wanted),
        profiles::section(stored),
        spectra::section(stored),
        convergence::section(stored),
        goodness::section(stored),
    ];
    let mut sections: Vec<Section> =
        sections.into_iter().filter(|section| !section.drawn.is_empty()).collect();
    let mut taken = BTreeSet::new();
    for drawn in sections.iter_mut().flat_map(|section| &mut section.drawn) {
        // Names of estimators may differ in what no file name has.
        while !taken.insert(drawn.name.clone()) {
            drawn.name += "-2";
        }
    }
    sections
}

impl Section {
    /// Writes the pictures and their numbers into `plots/`.
    ///
    /// # Errors
    /// I/O.
    pub fn write(&self, folder: &RecordFolder) -> Result<()> {
        for drawn in &self.drawn {
            folder.write_view(&drawn.path(), drawn.to_svg().as_bytes())?;
            let Content::Plots(plots) = &drawn.content else { continue };
            for (number, plot) in plots.iter().enumerate() {
                let part = if number == 0 { String::new() } else { format!("-{}", number + 1) };
                let path = format!("plots/{}{part}.csv", drawn.name);
                folder.write_view(&path, plot.to_csv().as_bytes())?;
            }
        }
        Ok(())
    }

    /// What the page shows.
    pub fn blocks(&self) -> Vec<Block> {
        let mut blocks = vec![Block::Heading(2, self.heading.clone())];
        if !self.text.is_empty() {
            blocks.push(Block::Text(self.text.clone()));
        }
        let figures: Vec<FigureBlock> = self.drawn.iter().map(Drawn::figure).collect();
        let pictures = match self.are_small {
            true => vec![Block::Figures(figures)],
            false => figures.into_iter().map(Block::Wide).collect(),
        };
        match self.drawn.len() > MOST_OPEN {
            true => blocks.push(Block::Folded(format!("All {} plots", self.drawn.len()), pictures)),
            false => blocks.extend(pictures),
        }
        blocks
    }
}

/// Most plots of a section that are seen at once.
const MOST_OPEN: usize = 12;

impl Drawn {
    fn path(&self) -> String {
        format!("plots/{}.svg", self.name)
    }

    fn to_svg(&self) -> String {
        match &self.content {
            Content::Plots(plots) => panels(plots),
            Content::Swatches(colours) => spectra::swatches(colours),
        }
    }

    fn figure(&self) -> FigureBlock {
        FigureBlock {
            path: self.path(),
            picture: Picture::Svg(self.to_svg()),
            title: self.title.clone(),
            caption: self.caption.clone(),
        }
    }
}

/// Indices of the bands that have plots of their own.
fn shown_bands(stored: &Stored) -> Vec<usize> {
    few_bands(stored.record.bands.len())
}

/// The estimators of a cell, without second arms of one.
fn runs(cell: &Cell) -> impl Iterator<Item = &EstimatorRun> {
    cell.runs.iter().filter(|run| run.control_of.is_none())
}

/// Parts of a title that say something, joined.
fn joined(parts: &[&str]) -> String {
    parts.iter().filter(|part| !part.is_empty()).copied().collect::<Vec<_>>().join(", ")
}

/// The name of a band in a title; nothing where there is only one.
fn band_name(stored: &Stored, band: usize) -> &str {
    if stored.record.bands.len() == 1 { "" } else { &stored.record.bands[band].name }
}
