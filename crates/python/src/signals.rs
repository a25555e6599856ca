//! Samples of a motion.

use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use signals::Bins;
use std::ops::Range;

/// Returns the samples at which a motion reverses by at least `least`, including the extremes at both ends.
#[pyfunction]
pub fn turning_points<'py>(
    py: Python<'py>,
    values: PyReadonlyArray1<'py, f64>,
    least: f64,
) -> PyResult<Bound<'py, PyArray1<i64>>> {
    let values = values.as_slice()?;
    let points = py.detach(|| ::signals::turning_points(values, least));
    Ok(PyArray1::from_vec(py, points.into_iter().map(|place| place as i64).collect()))
}

/// Returns the mean of the chosen values in each of a number of equal position bins, over ranges of samples.
#[pyfunction]
pub fn bin_means<'py>(
    py: Python<'py>,
    position: PyReadonlyArray1<'py, f64>,
    values: PyReadonlyArray1<'py, f64>,
    chosen: Option<PyReadonlyArray1<'py, bool>>,
    stretches: Vec<(usize, usize)>,
    bins: (f64, f64, usize),
) -> PyResult<Bound<'py, PyArray1<f64>>> {
    let (position, values) = (position.as_slice()?, values.as_slice()?);
    let chosen = chosen.as_ref().map(|chosen| chosen.as_slice()).transpose()?;
    let n = position.len();
    let is_alike = values.len() == n && chosen.is_none_or(|chosen| chosen.len() == n);
    if !is_alike || stretches.iter().any(|(begin, end)| begin > end || *end > n) {
        return Err(PyValueError::new_err("columns have one length, and stretches lie within them"));
    }
    let stretches: Vec<Range<usize>> = stretches.into_iter().map(|(begin, end)| begin..end).collect();
    let (low, high, count) = bins;
    let bins = Bins { low, high, count };
    let means = py.detach(|| ::signals::bin_means(position, values, chosen, &stretches, bins));
    Ok(PyArray1::from_vec(py, means))
}
