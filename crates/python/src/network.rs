//! `Circuit`: components and joints.

use crate::convert::{Table, Teller, options, parse, run_to_dict, to_python, watched};
use crate::platform::PyPlatform;
use crate::session::PySession;
use crate::shooting::{Asked, shot_to_dict};
use circuit::{ALONG, Assembly, Names, Network, Record, specification};
use numpy::{PyArray1, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use ode::Options;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;
use std::sync::{Arc, OnceLock};

/// A circuit of components, assembled from its description in SI (JSON).
#[pyclass(name = "Circuit", frozen)]
pub struct PyCircuit {
    json: String,
    spec: specification::Circuit,
    names: Arc<Names>,
    pub network: Network,
    /// The same circuit with its balances, made on first use.
    accounted: OnceLock<Network>,
}

/// Names in the form of Python.
pub type ShortNames = (String, Vec<(String, String)>, bool);

/// Returns the names in the form of the core.
pub fn called(names: Option<ShortNames>) -> Names {
    names.map(|(of, table, only)| Names { of, table, only }).unwrap_or_default()
}

impl PyCircuit {
    pub fn accounted(&self) -> Result<&Network, circuit::Error> {
        if let Some(known) = self.accounted.get() {
            return Ok(known);
        }
        let made = Network::called(&self.spec, true, self.names.clone())?;
        Ok(self.accounted.get_or_init(|| made))
    }
}

/// Start of a session.
#[derive(FromPyObject)]
enum Start {
    Named(BTreeMap<String, f64>),
    State(Vec<f64>),
}

#[pymethods]
impl PyCircuit {
    /// `names` is optional. It has the component whose name is left out, short and full names in their order, and
    /// whether columns without a short name are left out.
    #[new]
    #[pyo3(signature = (json, names=None))]
    fn new(json: String, names: Option<ShortNames>) -> PyResult<Self> {
        let spec: specification::Circuit = parse(&json)?;
        let names = Arc::new(called(names));
        let network = Network::called(&spec, false, names.clone()).map_err(to_python)?;
        Ok(PyCircuit { json, spec, names, network, accounted: OnceLock::new() })
    }

    /// Returns name, unit, bounds as text and meaning of each input.
    #[getter]
    fn inputs(&self) -> Vec<(&str, &'static str, String, &'static str)> {
        let inputs = self.network.assembly.variables.inputs.iter();
        inputs.map(|own| (&*own.name, own.unit, own.bounds.to_string(), own.meaning)).collect()
    }

    /// Returns the names of the outputs.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.network.assembly.columns().to_vec()
    }

    /// Returns the names of the start values.
    #[getter]
    fn start_names(&self) -> Vec<&str> {
        self.network.assembly.given_names()
    }

    /// Returns the names of the start values of segments of `shoot`, including inner states of friction.
    #[getter]
    fn segment_names(&self) -> Vec<String> {
        self.network.assembly.start_names()
    }

    /// Returns gas joints whose volume belongs to no component: the first port of each, and the volume of its
    /// ports, m3.
    #[getter]
    fn joint_volumes(&self) -> Vec<(String, f64)> {
        self.network.joint_volumes.to_vec()
    }

    /// Returns the end stops of each cylinder: stiffness, N/m, damping, N s/m, and damping depth, m. They are
    /// described, or derived from the circuit and the highest start pressure, Pa absolute. Derived end stops
    /// also have their design load: mass, kg, speed, m/s, and force, N, within a depth, m.
    fn end_stops(&self, start: f64) -> BTreeMap<&str, ([f64; 3], [f64; 4])> {
        let each = self.network.end_stops(start);
        each.map(|(name, stop, taken)| {
            let stop = [stop.stiffness, stop.damping, stop.damping_depth];
            (name, (stop, [taken.mass, taken.speed, taken.force, taken.depth]))
        })
        .collect()
    }

    /// Returns the platforms of the circuit.
    #[getter]
    fn platforms(&self) -> Vec<PyPlatform> {
        let each = self.network.assembly.platforms();
        each.map(|(name, platform, legs)| PyPlatform::new(name, platform, &legs)).collect()
    }

    /// Returns name and unit of each state.
    #[getter]
    fn states(&self) -> Vec<(String, &'static str)> {
        self.network.assembly.circuit.state_names().to_vec()
    }

    /// Returns warnings about this description.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.network.warnings.to_vec()
    }

    /// Returns the keys in references.bib of the laws and methods in use.
    #[getter]
    fn citations(&self) -> Vec<&'static str> {
        self.network.citations.to_vec()
    }

    /// Returns a session at a start given by name, or at the state of another session.
    fn start(&self, start: Start, rtol: f64) -> PyResult<PySession> {
        let options = Options { rtol, ..Options::default() };
        let assembly = &self.network.assembly;
        let session = match start {
            Start::Named(start) => assembly.session(&start, options),
            Start::State(state) => assembly.session_from(&state, options),
        };
        let session = session.map_err(to_python)?;
        Ok(PySession::new(session.of_description(&self.json)))
    }

    /// Creates members of this topology that differ in the named numbers, one row of values for each.
    fn members(&self, names: Vec<String>, values: PyReadonlyArray2<'_, f64>) -> PyResult<PyMembers> {
        let mut members = self.network.members(&self.json, &names).map_err(to_python)?;
        let each = values.as_array();
        let each = each.rows().into_iter().map(|row| members.member(&row.to_vec()));
        let each = each.collect::<Result<Vec<_>, _>>().map_err(to_python)?;
        Ok(PyMembers { each })
    }

    /// Runs segments with derivatives under the commands of one input, if any. Parameters are numbers of components, such as
    /// "left.bore" or "left.friction.parameters.coulomb".
    #[pyo3(signature = (command, asked, look=None))]
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        command: Option<&str>,
        asked: Asked<'py>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let asked = asked.under(command);
        let shot = watched(py, look, |interrupted| self.network.shoot(&self.json, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot)
    }

    /// Returns pressure, Pa, and temperature, K, in chambers a and b (four columns) at states in the form of `states`.
    fn chambers<'py>(&self, py: Python<'py>, states: PyReadonlyArray2<'py, f64>) -> PyResult<Table<'py>> {
        let states = states.as_array();
        let n = self.network.assembly.circuit.n_states();
        if states.ncols() != n {
            let message = format!("states have {} columns; this circuit has {n} states", states.ncols());
            return Err(PyValueError::new_err(message));
        }
        let driven = self.network.driven().map_err(to_python)?;
        let gas = driven.gas(states.rows().into_iter().map(|row| row.to_vec()));
        PyArray1::from_vec(py, gas).reshape([states.nrows(), 4])
    }

    /// Returns forces, steady friction and pressure rates along a measured record: columns by name. `openings` has
    /// a row for each sample: supply to a, a to exhaust, supply to b, b to exhaust.
    #[allow(clippy::too_many_arguments)]
    fn along<'py>(
        &self,
        py: Python<'py>,
        times: PyReadonlyArray1<'py, f64>,
        position: PyReadonlyArray1<'py, f64>,
        velocity: PyReadonlyArray1<'py, f64>,
        pressure_a: PyReadonlyArray1<'py, f64>,
        pressure_b: PyReadonlyArray1<'py, f64>,
        openings: PyReadonlyArray2<'py, f64>,
        temperatures: [f64; 2],
    ) -> PyResult<Bound<'py, PyDict>> {
        let shares: Vec<[f64; 4]> =
            openings.as_array().rows().into_iter().map(|row| std::array::from_fn(|i| row[i])).collect();
        let record = Record {
            times: times.as_slice()?,
            position: position.as_slice()?,
            velocity: velocity.as_slice()?,
            pressure: [pressure_a.as_slice()?, pressure_b.as_slice()?],
            openings: &shares,
            temperature: temperatures,
        };
        let n = record.times.len();
        if [record.position, record.velocity, record.pressure[0], record.pressure[1]]
            .iter()
            .any(|column| column.len() != n)
            || shares.len() != n
            || openings.as_array().ncols() != 4
        {
            return Err(PyValueError::new_err(
                "the columns of a record must have one length, and openings four columns",
            ));
        }
        let driven = self.network.driven().map_err(to_python)?;
        let rows = py.detach(|| driven.along(&record)).map_err(to_python)?;
        let out = PyDict::new(py);
        for (i, name) in ALONG.iter().enumerate() {
            let column = rows.iter().skip(i).step_by(ALONG.len()).copied().collect();
            out.set_item(*name, PyArray1::from_vec(py, column))?;
        }
        Ok(out)
    }

    /// Runs from a start under plans: an input, times and the values from each of them on.
    #[pyo3(signature = (plans, duration, sample_rate, start, rtol, ledger=false, budget=None, look=None))]
    #[allow(clippy::too_many_arguments)] // The seam: named in Python, checked there.
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        plans: Vec<(String, Vec<f64>, Vec<f64>)>,
        duration: f64,
        sample_rate: f64,
        start: BTreeMap<String, f64>,
        rtol: f64,
        ledger: bool,
        budget: Option<u64>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let network = if ledger { self.accounted().map_err(to_python)? } else { &self.network };
        let commands = plans.iter().map(|(_, times, _)| times.len()).sum();
        let options = options(rtol, duration, commands, network.assembly.circuit.n_states(), budget);
        let run = watched(py, look, |interrupted| {
            network.simulate(&plans, (duration, sample_rate), &start, options, interrupted)
        })?;
        let mut warnings = network.warnings.to_vec();
        warnings.extend(network.impact_warnings(&run.impacts));
        let cylinders: Vec<Option<String>> =
            run.impacts.iter().map(|impact| network.cylinder(impact.axis).map(Into::into)).collect();
        let out = run_to_dict(py, network.assembly.columns(), run)?;
        let impacts = out.get_item("impacts")?.expect("impacts of a run").cast_into::<PyList>()?;
        for (impact, cylinder) in impacts.iter().zip(cylinders) {
            if cylinder.as_ref() != Some(&self.names.of) {
                impact.set_item("cylinder", cylinder)?;
            }
        }
        out.set_item("warnings", warnings)?;
        out.set_item("citations", &network.citations)?;
        Ok(out)
    }
}

/// Circuits of one topology with different numbers.
#[pyclass(name = "Members", frozen)]
pub struct PyMembers {
    each: Vec<Assembly>,
}

#[pymethods]
impl PyMembers {
    fn __len__(&self) -> usize {
        self.each.len()
    }

    /// Returns a session of one member at a start given by name.
    fn start(&self, member: usize, start: BTreeMap<String, f64>, rtol: f64) -> PyResult<PySession> {
        let Some(own) = self.each.get(member) else {
            return Err(PyIndexError::new_err(format!("there are {} members", self.each.len())));
        };
        let options = Options { rtol, ..Options::default() };
        Ok(PySession::new(own.session(&start, options).map_err(to_python)?))
    }
}
