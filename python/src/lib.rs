//! What the Python package takes from Rust: the program, checked records, OpenEXR files, tests of means and
//! ratios of efficiency. Arrays cross as bytes of little-endian f64, so that no copy of numpy's interface is
//! needed; `scatterproof/*.py` wraps each function for arrays.

use std::ffi::OsString;
use std::path::PathBuf;

use pyo3::create_exception;
use pyo3::exceptions::{PyOSError, PyValueError};
use pyo3::prelude::*;
use scatterproof::cli;
use scatterproof::error::Error;
use scatterproof::experiment::Registry;
use scatterproof::results::exr_file::write_parts;
use scatterproof::results::layout::{self, layout_of};
use scatterproof::results::record::SCHEMA_VERSION;
use scatterproof::results::store::RecordFolder;
use scatterproof::stats::efficiency::{JackknifeBlock, Values, compare};
use scatterproof::stats::hypothesis::{Estimate, critical_value};
use scatterproof::stats::moments::Moments;

create_exception!(_core, RecordError, PyOSError, "What is on disk is no usable record.");

/// An error of the library with its exit code: bad input is a `ValueError`.
fn raised(error: &Error) -> PyErr {
    match error {
        Error::Input(_) => PyValueError::new_err(error.to_string()),
        _ => RecordError::new_err(error.to_string()),
    }
}

/// Little-endian f64.
fn numbers(bytes: &[u8]) -> PyResult<Vec<f64>> {
    let (each, rest) = bytes.as_chunks::<8>();
    if !rest.is_empty() {
        return Err(PyValueError::new_err("bytes of float64 are needed"));
    }
    Ok(each.iter().map(|x| f64::from_le_bytes(*x)).collect())
}

/// Rows of `n, mean, m2, m3, m4`.
fn moments(bytes: &[u8]) -> PyResult<Vec<Moments>> {
    let numbers = numbers(bytes)?;
    let (rows, rest) = numbers.as_chunks::<5>();
    if !rest.is_empty() {
        return Err(PyValueError::new_err("moments are rows of five numbers"));
    }
    Ok(rows.iter().map(|row| Moments::from_array(*row)).collect())
}

/// Runs the program with these arguments, the first of which is its name, and returns its exit code.
#[pyfunction]
fn main(py: Python<'_>, arguments: Vec<OsString>) -> u8 {
    py.detach(|| cli::exit_code_of(&Registry::builtin(), arguments))
}

/// Reads a record and checks version, checksums and shapes; raises what is wrong with it.
#[pyfunction]
fn check(py: Python<'_>, folder: PathBuf) -> PyResult<()> {
    py.detach(|| RecordFolder::new(folder).read()).map(|_| ()).map_err(|error| raised(&error))
}

/// The names of the axes of the array at a path of a record; none for an unknown kind of array.
#[pyfunction]
fn axes(path: &str) -> Option<Vec<&'static str>> {
    layout_of(path).map(|layout| layout.axes.to_vec())
}

/// Writes planes of float32 as an OpenEXR file.
#[pyfunction]
fn write_exr(
    path: PathBuf,
    width: usize,
    height: usize,
    channels: Vec<(String, Vec<f32>)>,
) -> PyResult<()> {
    if let Some((name, _)) = channels.iter().find(|(_, plane)| plane.len() != width * height) {
        return Err(PyValueError::new_err(format!("channel {name} is not {width} x {height}")));
    }
    write_parts(&path, (width, height), vec![("image".into(), channels)], &[]).map_err(|e| raised(&e))
}

/// The moments of values, in the order of the values.
#[pyfunction]
fn moments_of(values: &[u8]) -> PyResult<[f64; 5]> {
    let mut sum = Moments::default();
    numbers(values)?.into_iter().for_each(|x| sum.push(x));
    Ok(sum.to_array())
}

/// Mean, standard error and degrees of freedom of independent batches.
#[pyfunction]
fn estimate(batches: &[u8]) -> PyResult<(f64, f64, f64)> {
    let batches = moments(batches)?;
    if batches.len() < 2 {
        return Err(PyValueError::new_err("an error needs two batches or more"));
    }
    let Estimate { value, std_error, dof } = Estimate::of_batches(&batches);
    Ok((value, std_error, dof))
}

/// An estimate as Python has it.
type Triple = (f64, f64, f64);

fn known(estimate: Triple) -> Estimate {
    let (value, std_error, dof) = estimate;
    Estimate { value, std_error, dof }
}

/// The difference a - b with its error and degrees of freedom, and the statistic and p-value of Welch's test.
#[pyfunction]
fn welch(a: Triple, b: Triple) -> (f64, f64, f64, f64, f64) {
    let difference = known(a).minus(&known(b));
    let test = difference.test_zero();
    (difference.value, difference.std_error, difference.dof, test.statistic, test.p_value)
}

/// The same of two runs on the same streams, batch by batch.
#[pyfunction]
fn paired(a: &[u8], b: &[u8]) -> PyResult<(f64, f64, f64, f64, f64)> {
    let (a, b) = (moments(a)?, moments(b)?);
    if a.len() != b.len() || a.len() < 2 || a.iter().zip(&b).any(|(a, b)| a.n != b.n) {
        return Err(PyValueError::new_err(
            "pairs need as many batches, of as many values, on both sides",
        ));
    }
    let difference = Estimate::of_differences(&a, &b);
    let test = difference.test_zero();
    Ok((difference.value, difference.std_error, difference.dof, test.statistic, test.p_value))
}

/// A ratio with its interval.
type Interval = (f64, f64, f64);

/// Variance times cost of the baseline over the candidate's, then the ratio of variances and of costs, each with
/// its interval; whether the first may be quoted; the kurtosis of both.
#[pyfunction]
#[pyo3(signature = (baseline, baseline_costs, candidate, candidate_costs, of_variances, confidence))]
fn efficiency(
    baseline: &[u8],
    baseline_costs: &[u8],
    candidate: &[u8],
    candidate_costs: &[u8],
    of_variances: bool,
    confidence: f64,
) -> PyResult<([Interval; 3], bool, [f64; 2])> {
    let blocks = |values: &[u8], costs: &[u8]| -> PyResult<Vec<JackknifeBlock>> {
        let (values, costs) = (moments(values)?, numbers(costs)?);
        if values.len() != costs.len() {
            return Err(PyValueError::new_err("one cost for every block is needed"));
        }
        let pairs = values.into_iter().zip(costs);
        Ok(pairs.map(|(moments, cost)| JackknifeBlock { moments, cost }).collect())
    };
    if !(confidence > 0.0 && confidence < 1.0) {
        return Err(PyValueError::new_err("a confidence is between 0 and 1"));
    }
    let values = if of_variances { Values::Variances } else { Values::Scores };
    let (a, b) = (blocks(baseline, baseline_costs)?, blocks(candidate, candidate_costs)?);
    let found = compare(&a, &b, values).map_err(|reason| PyValueError::new_err(reason.to_string()))?;
    let ratios = [found.work, found.variance, found.cost].map(|ratio| {
        let (low, high) = ratio.interval(confidence);
        (ratio.ratio(), low, high)
    });
    Ok((ratios, found.is_resolved(&found.work, confidence), [found.a.kurtosis, found.b.kurtosis]))
}

/// The two-sided critical value of Student's distribution at a level.
#[pyfunction]
fn student(level: f64, dof: f64) -> f64 {
    critical_value(level, dof)
}

/// The compiled part of the package `scatterproof`.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("SCHEMA_VERSION", SCHEMA_VERSION)?;
    module.add("MOMENTS", layout::MOMENTS)?;
    module.add("STATISTICS", layout::STATISTICS)?;
    module.add("GUIDE", layout::GUIDE)?;
    module.add("BIN_ROWS", layout::BIN_ROWS)?;
    module.add("RecordError", module.py().get_type::<RecordError>())?;
    module.add_function(wrap_pyfunction!(main, module)?)?;
    module.add_function(wrap_pyfunction!(check, module)?)?;
    module.add_function(wrap_pyfunction!(axes, module)?)?;
    module.add_function(wrap_pyfunction!(write_exr, module)?)?;
    module.add_function(wrap_pyfunction!(moments_of, module)?)?;
    module.add_function(wrap_pyfunction!(estimate, module)?)?;
    module.add_function(wrap_pyfunction!(welch, module)?)?;
    module.add_function(wrap_pyfunction!(paired, module)?)?;
    module.add_function(wrap_pyfunction!(efficiency, module)?)?;
    module.add_function(wrap_pyfunction!(student, module)?)
}
