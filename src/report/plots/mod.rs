//! The plots of a record: what each shows, from the record and its timing alone.

use std::collections::BTreeSet;

use crate::results::pictures::Wanted;
use crate::results::store::Stored;
use crate::verify::comparisons::EfficiencyRow;

pub(crate) use section::Section;

/// Error against time and rays.
mod convergence;
/// Observed and expected counts of samplers.
mod goodness;
/// What guides walks.
mod guides;
/// Exitance by distance.
mod profiles;
/// Efficiency along the axes of a sweep.
mod ratios;
/// Running means.
mod running;
/// Plots under one heading.
mod section;
/// Means by wavelength, and their colour.
mod spectra;

/// Every section that this record has plots for, in the order of the page.
pub(crate) fn sections(stored: &Stored, rows: &[EfficiencyRow], wanted: &[Wanted]) -> Vec<Section> {
    let sections = [
        ratios::section(stored, rows),
        running::section(stored, wanted),
        profiles::section(stored),
        spectra::section(stored),
        convergence::section(stored),
        guides::section(stored),
        goodness::section(stored),
    ];
    let mut sections: Vec<Section> =
        sections.into_iter().filter(|section| !section.drawn.is_empty()).collect();
    let mut taken = BTreeSet::new();
    for drawn in sections.iter_mut().flat_map(|section| &mut section.drawn) {
        // Names of estimators may differ only in characters that file names do not keep.
        while !taken.insert(drawn.name.clone()) {
            drawn.name += "-2";
        }
    }
    sections
}
