//! Columns of a run without NumPy, and columns as a Parquet file.

use crate::parquet;
use numpy::{PyReadonlyArray1, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyOSError, PyValueError};
use pyo3::prelude::*;
use std::borrow::Cow;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;

/// Samples of one column, as the core holds them.
#[pyclass(name = "Column", frozen)]
pub struct PyColumn(pub Vec<f64>);

#[pymethods]
impl PyColumn {
    fn __len__(&self) -> usize {
        self.0.len()
    }

    fn __getitem__(&self, index: isize) -> PyResult<f64> {
        let place = if index < 0 { index + self.0.len() as isize } else { index };
        let found = usize::try_from(place).ok().and_then(|place| self.0.get(place));
        found.copied().ok_or_else(|| PyIndexError::new_err(format!("a column has no row {index}")))
    }

    /// Returns the least value.
    fn min(&self) -> f64 {
        self.0.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Returns the row of the least value.
    fn argmin(&self) -> usize {
        let least = self.min();
        self.0.iter().position(|value| *value == least).unwrap_or(0)
    }

    /// Returns the row of the greatest value.
    fn argmax(&self) -> usize {
        let greatest = self.max();
        self.0.iter().position(|value| *value == greatest).unwrap_or(0)
    }

    /// Returns the greatest value.
    fn max(&self) -> f64 {
        self.0.iter().copied().fold(f64::NEG_INFINITY, f64::max)
    }
}

/// A column of a file.
#[derive(FromPyObject)]
pub enum Floats<'py> {
    Own(PyRef<'py, PyColumn>),
    Array(PyReadonlyArray1<'py, f64>),
}

impl Floats<'_> {
    fn len(&self) -> usize {
        match self {
            Floats::Own(column) => column.0.len(),
            Floats::Array(array) => array.len(),
        }
    }

    /// Returns the values as a contiguous row. An array with gaps is copied.
    fn values(&self) -> Cow<'_, [f64]> {
        match self {
            Floats::Own(column) => Cow::Borrowed(&column.0),
            Floats::Array(array) => match array.as_slice() {
                Ok(values) => Cow::Borrowed(values),
                Err(_) => Cow::Owned(array.as_array().to_vec()),
            },
        }
    }
}

/// Writes columns of one length, and texts by key, as a Parquet file.
#[pyfunction]
pub fn write_parquet(
    py: Python<'_>,
    path: PathBuf,
    columns: Vec<(String, Floats<'_>)>,
    texts: Vec<(String, String)>,
) -> PyResult<()> {
    if columns.iter().any(|(_, column)| column.len() != columns[0].1.len()) {
        return Err(PyValueError::new_err("columns of a table have one length"));
    }
    let values: Vec<(&str, Cow<'_, [f64]>)> =
        columns.iter().map(|(name, column)| (name.as_str(), column.values())).collect();
    let values: Vec<(&str, &[f64])> = values.iter().map(|(name, values)| (*name, &values[..])).collect();
    let texts: Vec<(&str, &str)> = texts.iter().map(|(key, text)| (key.as_str(), text.as_str())).collect();
    py.detach(|| {
        let mut file = BufWriter::with_capacity(1 << 16, File::create(&path)?);
        parquet::write(&mut file, &values, &texts)?;
        file.flush()
    })
    .map_err(|error: io::Error| match error.raw_os_error() {
        Some(number) => PyOSError::new_err((number, error.to_string())),
        None => PyOSError::new_err(error.to_string()),
    })
}
