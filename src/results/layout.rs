//! The arrays of a record by what they hold, with the names of their axes: what `docs/record-layout.md`
//! documents and the Python package names axes by.

use super::record::Record;

/// The numbers of moments along the axis `moment`: count, mean, and the sums of second, third and fourth
/// powers of deviations from the mean.
pub const MOMENTS: [&str; 5] = ["n", "mean", "m2", "m3", "m4"];

/// The planes of an image along the axis `statistic`.
pub const STATISTICS: [&str; 2] = ["mean", "std_error"];

/// What a guide's plane has in every point, along the axis `guide`.
pub const GUIDE: [&str; 3] = ["importance", "growth_x", "growth_z"];

/// What is stored of every bin, along the axis `count`.
pub const BIN_ROWS: [&str; 3] = ["observed", "mass", "bound"];

/// One kind of array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayLayout {
    /// What the file's name ends in, before `.npy`.
    pub what: &'static str,
    /// The names of its axes, the fastest last.
    pub axes: &'static [&'static str],
}

/// Every kind of array: of a run of an estimator, then of a sampler.
pub const LAYOUT: [ArrayLayout; 8] = [
    ArrayLayout { what: "observables", axes: &["batch", "observable", "band", "moment"] },
    ArrayLayout { what: "costs", axes: &["batch", "counter"] },
    ArrayLayout { what: "pixels", axes: &["statistic", "row", "column", "band"] },
    ArrayLayout { what: "spread", axes: &["batch", "band", "moment"] },
    ArrayLayout { what: "guide", axes: &["band", "row", "column", "guide"] },
    ArrayLayout { what: "coarse", axes: &["count", "bin"] },
    ArrayLayout { what: "fine", axes: &["count", "bin"] },
    ArrayLayout { what: "serial", axes: &["count", "group", "next_group"] },
];

/// The layout of the array at `path`; none where no kind of array ends so.
pub fn layout_of(path: &str) -> Option<ArrayLayout> {
    let what = path.strip_suffix(".npy")?.rsplit(['.', '/']).next()?;
    LAYOUT.into_iter().find(|layout| layout.what == what)
}

/// Every array that a record names, in the record's order.
pub fn arrays(record: &Record) -> Vec<&str> {
    let runs = record.cells.iter().flat_map(|cell| &cell.runs);
    let of_runs = runs.flat_map(|run| {
        let image = run.image.iter().flat_map(|image| [&*image.pixels, &*image.spread]);
        let guide = run.guide.iter().map(|guide| &*guide.array);
        [&*run.moments, &*run.costs].into_iter().chain(image).chain(guide)
    });
    let of_samplers = record.samplers.iter().flat_map(|run| {
        [Some(&run.coarse), run.fine.as_ref(), run.serial.as_ref()].into_iter().flatten()
    });
    of_runs.chain(of_samplers.map(String::as_str)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::record::EstimatorRun;
    use super::super::sample;
    use super::super::store::Stored;
    use super::*;

    /// The lengths that the names of axes promise in a run; none for those that the run itself sets.
    fn length(stored: &Stored, run: &EstimatorRun, axis: &str) -> Option<usize> {
        match axis {
            "observable" => Some(run.observables.len()),
            "band" => Some(stored.record.bands.len()),
            "moment" => Some(MOMENTS.len()),
            "counter" => Some(run.cost.len()),
            "statistic" => Some(STATISTICS.len()),
            "row" => run.image.as_ref().map(|image| image.height),
            "column" => run.image.as_ref().map(|image| image.width),
            _ => None,
        }
    }

    #[test]
    fn the_axes_of_every_array_have_the_lengths_that_they_name() {
        let stored = sample::stored(0.5);
        let mut seen = Vec::new();
        for run in stored.record.cells.iter().flat_map(|cell| &cell.runs) {
            let image = run.image.iter().flat_map(|image| [&image.pixels, &image.spread]);
            for path in [&run.moments, &run.costs].into_iter().chain(image) {
                let layout = layout_of(path).unwrap_or_else(|| panic!("{path} has no layout"));
                let shape = &stored.arrays[path].shape;
                assert_eq!(shape.len(), layout.axes.len(), "{path}");
                for (axis, found) in layout.axes.iter().zip(shape) {
                    let promised = length(&stored, run, axis).unwrap_or(*found);
                    assert_eq!(*found, promised, "axis {axis} of {path}");
                }
                seen.push(layout.what);
            }
        }
        for what in ["observables", "costs", "pixels", "spread"] {
            assert!(seen.contains(&what), "{what}: {seen:?}");
        }
    }

    #[test]
    fn a_record_names_every_array_that_it_has_and_each_has_a_layout() {
        let stored = sample::stored(0.5);
        let mut named = arrays(&stored.record);
        named.sort_unstable();
        assert_eq!(named, stored.arrays.keys().map(String::as_str).collect::<Vec<_>>());
        assert!(named.iter().all(|path| layout_of(path).is_some()), "{named:?}");
        assert_eq!(layout_of("samplers/000.serial.npy").map(|layout| layout.axes.len()), Some(3));
        assert_eq!(layout_of("cells/000/000.cells.npy"), None);
        assert_eq!(layout_of("record.json"), None);
    }
}
