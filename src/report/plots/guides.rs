//! The guide of walks, in a plane through the body.

use super::section::{Content, PlotFigure, Section, band_name, joined, runs, shown_bands};
use crate::report::document::slug;
use crate::report::plot::slice::SlicePlot;
use crate::results::record::{Cell, EstimatorRun};
use crate::results::store::Stored;

/// A picture for each cell, estimator and band whose walks are guided.
pub(super) fn section(stored: &Stored) -> Section {
    let bands = shown_bands(stored);
    let cells = stored.record.cells.iter().enumerate();
    let guided = cells.flat_map(|(index, cell)| runs(cell).map(move |run| (index, cell, run)));
    let of_run = |(index, cell, run): (usize, &Cell, &EstimatorRun)| {
        let of_band = |band: &usize| figure(stored, (index, cell), run, *band);
        bands.iter().filter_map(of_band).collect::<Vec<_>>()
    };
    Section {
        heading: "What guides walks".into(),
        text: "Importance, the light that a photon that scatters at a point will find, in the plane of x and z through \
               the middle of the body. Arrows point to where it grows; the longest are of growth 1 per mean free path."
            .into(),
        drawn: guided.flat_map(of_run).collect(),
        are_small: true,
    }
}

fn figure(
    stored: &Stored,
    (index, cell): (usize, &Cell),
    run: &EstimatorRun,
    band: usize,
) -> Option<PlotFigure> {
    let plane = run.guide.as_ref()?;
    let array = stored.arrays.get(&plane.array)?;
    let [_, rows, columns, 3] = array.shape[..] else { return None };
    let nodes = array.data.as_chunks::<3>().0.get(band * rows * columns..(band + 1) * rows * columns)?;
    if nodes.iter().all(|node| node[0] == 0.0) {
        return None;
    }
    let (x_mm, z_mm) = (plane.x_mm, plane.z_mm);
    Some(PlotFigure {
        name: format!("guide-{index:03}-{}-{}", slug(&run.estimator), band + 1),
        title: joined(&[&cell.title(), &run.estimator, band_name(stored, band)]),
        caption: String::new(),
        content: Content::Slice(SlicePlot { x_mm, z_mm, columns, nodes: nodes.to_vec() }),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::npy::Array;
    use crate::results::record::GuidePlane;
    use crate::results::sample;
    use crate::results::store::guide_path;

    #[test]
    fn guided_runs_have_a_picture_a_band() {
        let mut stored = sample::stored(0.1);
        assert!(section(&stored).drawn.is_empty());
        let bands = stored.record.bands.len();
        let mut data = vec![0.5; bands * 2 * 3 * 3];
        // The last band has no guide.
        data[(bands - 1) * 18..].fill(0.0);
        let array = guide_path(0, 0);
        stored.arrays.insert(array.clone(), Array::new(vec![bands, 2, 3, 3], data));
        let plane = GuidePlane { x_mm: [0.0, 3.0], z_mm: [0.0, 2.0], array };
        stored.record.cells[0].runs[0].guide = Some(plane);
        let section = section(&stored);
        assert_eq!(section.drawn.len(), bands - 1);
        let Content::Slice(slice) = &section.drawn[0].content else { panic!("a slice") };
        assert_eq!((slice.columns, slice.nodes.len()), (3, 6));
    }
}
