//! `Platform`: kinematics of a platform on legs.

use circuit::Platform;
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray2};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A platform of a circuit.
#[pyclass(name = "Platform", frozen)]
pub struct PyPlatform {
    platform: Platform<f64>,
    name: String,
    legs: Vec<String>,
}

impl PyPlatform {
    pub fn new(name: &str, platform: &Platform<f64>, legs: &[&str]) -> Self {
        let legs = legs.iter().map(|leg| (*leg).to_owned()).collect();
        PyPlatform { platform: platform.clone(), name: name.into(), legs }
    }
}

/// Rows of coordinates, checked.
fn rows(table: &PyReadonlyArray2<'_, f64>, n: usize) -> PyResult<Vec<Vec<f64>>> {
    if table.as_array().ncols() != n {
        let message = format!("a row has {} numbers; this platform has {n} legs", table.as_array().ncols());
        return Err(PyValueError::new_err(message));
    }
    Ok(table.as_array().rows().into_iter().map(|row| row.to_vec()).collect())
}

#[pymethods]
impl PyPlatform {
    /// Returns its name in the circuit.
    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    /// Returns the names of its coordinates, as its states have them.
    #[getter]
    fn coordinates(&self) -> Vec<&'static str> {
        self.platform.kind.names().iter().map(|[name, _]| *name).collect()
    }

    /// Returns the names of the components at its legs.
    #[getter]
    fn legs(&self) -> Vec<String> {
        self.legs.clone()
    }

    /// Returns joints on the frame or places of the carriages at x = 0, joints in the axes of the platform, and
    /// directions of hinges or carriages, m.
    #[getter]
    fn joints(&self) -> [Vec<[f64; 3]>; 3] {
        let own = &self.platform.geometry;
        [own.frame.clone(), own.platform.clone(), own.directions.clone()]
    }

    /// Returns masses, kg, places, m, moments of inertia, kg m2, and the acceleration of gravity with the opposite sign,
    /// m/s2, by name. Those of each leg are in its order.
    #[getter]
    fn masses(&self) -> Vec<(&'static str, Vec<f64>)> {
        let own = &self.platform.geometry;
        vec![
            ("lift", own.lift.to_vec()),
            ("mass", vec![own.mass]),
            ("centre", own.centre.to_vec()),
            ("inertia", own.inertia.to_vec()),
            ("payload", vec![own.payload]),
            ("payload_at", own.payload_at.to_vec()),
            ("rods", own.rods.clone()),
            ("rod_centre", vec![own.rod_centre]),
            ("barrel", vec![own.barrel]),
            ("barrel_centre", vec![own.barrel_centre]),
            ("leg_inertia", vec![own.leg_inertia]),
        ]
    }

    /// Returns the mechanism at rows of coordinates and of their rates: arrays by name, one entry for each row.
    fn evaluate<'py>(
        &self,
        py: Python<'py>,
        q: PyReadonlyArray2<'py, f64>,
        u: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let n = self.legs.len();
        let (q, u) = (rows(&q, n)?, rows(&u, n)?);
        if q.len() != u.len() {
            return Err(PyValueError::new_err("coordinates and rates have one length"));
        }
        let each: Vec<_> = q.iter().zip(&u).map(|(q, u)| self.platform.evaluate(q, u)).collect();
        let out = PyDict::new(py);
        let put = |name: &str, shape: &[usize], of: &dyn Fn(&circuit::Evaluated) -> Vec<f64>| {
            let values = PyArray1::from_vec(py, each.iter().flat_map(of).collect());
            let shape: Vec<usize> = std::iter::once(each.len()).chain(shape.iter().copied()).collect();
            out.set_item(name, values.reshape(shape)?)
        };
        put("positions", &[n], &|own| own.positions.clone())?;
        put("velocities", &[n], &|own| own.velocities.clone())?;
        put("accelerations", &[n], &|own| own.accelerations.clone())?;
        put("jacobian", &[n, n], &|own| own.jacobian.clone())?;
        put("mass", &[n, n], &|own| own.mass.clone())?;
        put("forces", &[n], &|own| own.forces.clone())?;
        put("frame", &[4, 3], &|own| own.frame.concat())?;
        put("twist", &[6, n], &|own| own.twist.clone())?;
        Ok(out)
    }

    /// Returns the coordinates for rows of leg positions, m, and the largest residual of each, m. The search of a row
    /// begins at the row `near`, or above the frame.
    #[pyo3(signature = (x, near=None))]
    fn locate<'py>(
        &self,
        py: Python<'py>,
        x: PyReadonlyArray2<'py, f64>,
        near: Option<PyReadonlyArray2<'py, f64>>,
    ) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyArray1<f64>>)> {
        let n = self.legs.len();
        let x = rows(&x, n)?;
        let near = near.map(|near| rows(&near, n)).transpose()?;
        if near.as_ref().is_some_and(|near| near.len() != x.len()) {
            return Err(PyValueError::new_err("positions and poses near them have one length"));
        }
        let found = x.iter().enumerate().map(|(i, x)| {
            let near = near.as_ref().map(|near| &near[i][..]);
            self.platform.locate(x, near)
        });
        let (q, residuals): (Vec<_>, Vec<_>) = found.unzip();
        let q = PyArray1::from_vec(py, q.concat()).reshape([x.len(), n])?;
        Ok((q.into_any(), PyArray1::from_vec(py, residuals)))
    }
}
