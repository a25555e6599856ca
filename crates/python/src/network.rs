//! `Circuit`: components and joints; `components`: all kinds of component.

use crate::convert::{Teller, options, parse, run_to_dict, to_python, watched};
use crate::friction::refused;
use crate::session::PySession;
use crate::shooting::{Asked, shot_to_dict};
use circuit::{
    Assembly, ComponentKind, Extra, Holds, Network, PortKind, Shooting, Stroke, formula_kind, kinds,
    specification,
};
use numpy::PyReadonlyArray2;
use ode::Options;
use physics::Parameter;
use pyo3::exceptions::{PyIndexError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use std::collections::BTreeMap;
use std::sync::OnceLock;

/// A circuit of components, assembled from its description in SI (JSON).
#[pyclass(name = "Circuit", frozen)]
pub struct PyCircuit {
    json: String,
    spec: specification::Circuit,
    network: Network,
    /// The same circuit with its balances, made on first use.
    accounted: OnceLock<Network>,
}

impl PyCircuit {
    pub fn network(&self) -> &Network {
        &self.network
    }

    pub fn accounted(&self) -> Result<&Network, circuit::Error> {
        if let Some(known) = self.accounted.get() {
            return Ok(known);
        }
        let made = Network::assemble(&self.spec, true)?;
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
    #[new]
    fn new(json: String) -> PyResult<Self> {
        let spec: specification::Circuit = parse(&json)?;
        let network = Network::assemble(&spec, false).map_err(to_python)?;
        Ok(PyCircuit { json, spec, network, accounted: OnceLock::new() })
    }

    /// Returns name, unit, bounds as text and meaning of each input.
    #[getter]
    fn inputs(&self) -> Vec<(&str, &'static str, String, &'static str)> {
        let inputs = self.network.assembly().variables.inputs.iter();
        inputs.map(|own| (&*own.name, own.unit, own.bounds.to_string(), own.meaning)).collect()
    }

    /// Returns the names of the outputs.
    #[getter]
    fn columns(&self) -> Vec<String> {
        self.network.assembly().columns().to_vec()
    }

    /// Returns the names of the start values.
    #[getter]
    fn start_names(&self) -> Vec<&str> {
        self.network.start_names()
    }

    /// Returns the names of the start values of segments of `shoot`, including inner states of friction.
    #[getter]
    fn segment_names(&self) -> Vec<String> {
        self.network.assembly().start_names()
    }

    /// Returns gas joints whose volume belongs to no component: the first port of each, and the volume of its
    /// ports, m3.
    #[getter]
    fn joint_volumes(&self) -> Vec<(String, f64)> {
        self.network.joint_volumes().to_vec()
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

    /// Returns name and unit of each state.
    #[getter]
    fn states(&self) -> Vec<(String, &'static str)> {
        self.network.assembly().circuit.state_names().to_vec()
    }

    /// Returns warnings about this description.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.network.warnings().to_vec()
    }

    /// Returns the keys in references.bib of the laws and methods in use.
    #[getter]
    fn citations(&self) -> Vec<&'static str> {
        self.network.citations().to_vec()
    }

    /// Returns a session at a start given by name, or at the state of another session.
    fn start(&self, start: Start, rtol: f64) -> PyResult<PySession> {
        let options = Options { rtol, ..Options::default() };
        let assembly = self.network.assembly();
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
        Ok(PyMembers { template: self.network.assembly().clone(), each })
    }

    /// As `Drive.shoot`, under the commands of one input. Parameters are numbers of components, such as
    /// "left.bore" or "left.friction.parameters.coulomb".
    #[pyo3(signature = (command, asked, look=None))]
    fn shoot<'py>(
        &self,
        py: Python<'py>,
        command: &str,
        asked: Asked<'py>,
        look: Teller<'py>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let asked = Shooting::from(asked);
        let shot =
            watched(py, look, |interrupted| self.network.shoot(&self.json, command, &asked, interrupted))?;
        shot_to_dict(py, &asked, shot, self.network.assembly().start_names())
    }

    /// Runs from a start under plans. A plan has an input, times, and a value from each time on.
    #[pyo3(signature = (plans, duration, sample_rate, start, rtol, ledger=false, budget=None, look=None, arrays=true))]
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
        arrays: bool,
    ) -> PyResult<Bound<'py, PyDict>> {
        let network = if ledger { self.accounted().map_err(to_python)? } else { &self.network };
        let commands = plans.iter().map(|(_, times, _)| times.len()).sum();
        let options = options(rtol, duration, commands, network.assembly().circuit.n_states(), budget);
        let run = watched(py, look, |interrupted| {
            network.simulate(&plans, (duration, sample_rate), &start, options, interrupted)
        })?;
        let mut warnings = network.warnings().to_vec();
        warnings.extend(network.impact_warnings(&run.impacts));
        let cylinders: Vec<Option<String>> =
            run.impacts.iter().map(|impact| network.cylinder(impact.axis).map(Into::into)).collect();
        let out = run_to_dict(py, network.assembly().columns(), run, arrays)?;
        let impacts = out.get_item("impacts")?.expect("impacts of a run").cast_into::<PyList>()?;
        for (impact, cylinder) in impacts.iter().zip(cylinders) {
            impact.set_item("cylinder", cylinder)?;
        }
        out.set_item("warnings", warnings)?;
        out.set_item("citations", network.citations())?;
        Ok(out)
    }
}

/// Circuits of one topology with different numbers.
#[pyclass(name = "Members", frozen)]
pub struct PyMembers {
    template: Assembly,
    each: Vec<Assembly>,
}

#[pymethods]
impl PyMembers {
    fn __len__(&self) -> usize {
        self.each.len()
    }

    /// Number of members that were analysed separately because their parts differ.
    #[getter]
    fn analysed(&self) -> usize {
        let own = |each: &&Assembly| !each.circuit.shares_analysis(&self.template.circuit);
        self.each.iter().filter(own).count()
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

/// Strokes of a symbol: each has a word, points and numbers.
fn strokes<'py>(py: Python<'py>, strokes: &[Stroke]) -> PyResult<Vec<Bound<'py, PyAny>>> {
    let mut out = Vec::new();
    add_strokes(py, strokes, ([0.0, 0.0], false), &mut out)?;
    Ok(out)
}

/// Adds the strokes, optionally mirrored and then moved.
fn add_strokes<'py>(
    py: Python<'py>,
    strokes: &[Stroke],
    (by, mirrored): ([f64; 2], bool),
    out: &mut Vec<Bound<'py, PyAny>>,
) -> PyResult<()> {
    let place = |[x, y]: [f64; 2]| [by[0] + if mirrored { -x } else { x }, by[1] + y];
    let places = |points: &[[f64; 2]]| points.iter().copied().map(place).collect::<Vec<_>>();
    for stroke in strokes {
        out.push(match *stroke {
            Stroke::Line(points) => ("line", places(points)).into_pyobject(py)?.into_any(),
            Stroke::Dashed(points) => ("dashed", places(points)).into_pyobject(py)?.into_any(),
            Stroke::Arc(centre, radius, [from, to]) => {
                let angles = if mirrored { [180.0 - to, 180.0 - from] } else { [from, to] };
                ("arc", place(centre), radius, angles).into_pyobject(py)?.into_any()
            }
            Stroke::Dot(centre, radius) => ("dot", place(centre), radius).into_pyobject(py)?.into_any(),
            Stroke::Triangle(corners) => ("triangle", places(&corners)).into_pyobject(py)?.into_any(),
            Stroke::Head(corners) => ("head", places(&corners)).into_pyobject(py)?.into_any(),
            Stroke::Text(at, text) => ("text", place(at), text).into_pyobject(py)?.into_any(),
            Stroke::Moved(own, at, flipped) => {
                add_strokes(py, own, (place(at), mirrored != flipped), out)?;
                continue;
            }
        });
    }
    Ok(())
}

/// Returns every kind of component: its ports, parameters, choices, inputs and outputs.
#[pyfunction]
pub fn components(py: Python<'_>) -> PyResult<Vec<Bound<'_, PyDict>>> {
    kinds().into_iter().map(|kind| kind_entry(py, kind)).collect()
}

/// Returns the entry, as in `components`, of a kind with a formula (JSON), with `warnings`.
///
/// Raises ValueError as `formula_law`.
#[pyfunction]
pub fn formula_component<'py>(py: Python<'py>, kind: &str, json: &str) -> PyResult<Bound<'py, PyDict>> {
    let made = formula_kind(kind, &parse(json)?)
        .ok_or_else(|| PyValueError::new_err(format!("no component \"{kind}\" takes a formula")))?;
    let (kind, warnings) = made.map_err(|refusal| refused(&refusal))?;
    let entry = kind_entry(py, kind)?;
    entry.set_item("warnings", warnings)?;
    Ok(entry)
}

fn kind_entry<'py>(py: Python<'py>, kind: &ComponentKind) -> PyResult<Bound<'py, PyDict>> {
    let table = |items: &[(&str, Bound<'_, PyAny>)]| {
        let out = PyDict::new(py);
        items.iter().try_for_each(|(key, value)| out.set_item(key, value))?;
        PyResult::Ok(out)
    };
    let any = |value: &str| value.into_pyobject(py).map(Bound::into_any);
    let ports = kind.ports.iter().map(|port| {
        let out = table(&[("name", any(port.name)?)])?;
        let kind = match port.kind {
            PortKind::Gas => "gas",
            PortKind::Axis => "axis",
            PortKind::Pilot => "pilot",
        };
        out.set_item("kind", kind)?;
        let holds = match port.holds {
            Holds::Nothing => "",
            Holds::Volume => "volume",
            Holds::Pressure => "pressure",
            Holds::Set => "set",
            Holds::Motion => "motion",
        };
        out.set_item("holds", holds)?;
        out.set_item("exhaust", port.exhaust)?;
        out.set_item("optional", port.optional)?;
        PyResult::Ok(out)
    });
    let number = |own: &Parameter| {
        let out = table(&[("key", any(own.key)?), ("unit", any(own.unit)?), ("meaning", any(own.meaning)?)])?;
        out.set_item("rule", own.bounds.to_string())?;
        out.set_item("lower", own.bounds.lower)?;
        out.set_item("upper", own.bounds.upper)?;
        out.set_item("open", own.bounds.open)?;
        out.set_item("open_above", own.bounds.open_above)?;
        out.set_item("default", own.default)?;
        PyResult::Ok(out)
    };
    let parameters = kind.parameters.iter().map(|own| {
        let out = number(&own.parameter)?;
        out.set_item("assumed", own.assumed)?;
        out.set_item("follows", own.follows)?;
        out.set_item("unless", own.unless)?;
        out.set_item("within", own.within)?;
        out.set_item("only", own.only)?;
        out.set_item("was", own.was)?;
        PyResult::Ok(out)
    });
    let choices = kind.choices.iter().map(|own| {
        let out = table(&[("name", any(own.name)?), ("meaning", any(own.meaning)?)])?;
        out.set_item("options", own.options)?;
        out.set_item("default", own.options[0])?;
        PyResult::Ok(out)
    });
    let variables = |variables: &'static [(&str, &str, &str)]| {
        let each = variables.iter().map(|&(name, unit, meaning)| {
            table(&[("name", any(name)?), ("unit", any(unit)?), ("meaning", any(meaning)?)])
        });
        each.collect::<PyResult<Vec<_>>>()
    };
    let out = table(&[("kind", any(kind.key)?), ("title", any(kind.title)?), ("doc", any(kind.text)?)])?;
    out.set_item("sources", kind.sources)?;
    out.set_item("ports", ports.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("parameters", parameters.collect::<PyResult<Vec<_>>>()?)?;
    out.set_item("choices", choices.collect::<PyResult<Vec<_>>>()?)?;
    for key in ["formula", "points"] {
        out.set_item(key, py.None())?;
    }
    if let Extra::Formula(role) = kind.extra {
        let names = role.variables.iter().chain(role.constants).map(|own| {
            table(&[("name", any(own.name)?), ("unit", any(own.unit)?), ("meaning", any(own.meaning)?)])
        });
        let formula = table(&[("output", any(role.output.0)?), ("unit", any(role.output.1)?)])?;
        formula.set_item("names", names.collect::<PyResult<Vec<_>>>()?)?;
        out.set_item("formula", formula)?;
    } else if let Extra::Points(own) = kind.extra {
        let points = PyDict::new(py);
        points.set_item("key", own.key)?;
        points.set_item("optional", own.optional)?;
        points.set_item("columns", own.columns.iter().map(number).collect::<PyResult<Vec<_>>>()?)?;
        points.set_item("most", Extra::MOST_POINTS)?;
        out.set_item("points", points)?;
    }
    out.set_item("open", kind.open)?;
    out.set_item("discrete", kind.discrete)?;
    let friction = if kind.needs_friction { "needed" } else { "optional" };
    out.set_item("friction", if kind.friction { friction } else { "" })?;
    out.set_item("inputs", variables(kind.inputs)?)?;
    out.set_item("outputs", variables(kind.outputs)?)?;
    let symbol = PyDict::new(py);
    symbol.set_item("strokes", strokes(py, kind.symbol.strokes)?)?;
    let when = kind.symbol.when.iter().map(|(option, own)| Ok((option, strokes(py, own)?)));
    symbol.set_item("when", when.collect::<PyResult<Vec<_>>>()?)?;
    symbol.set_item("ports", kind.symbol.ports)?;
    out.set_item("symbol", symbol)?;
    Ok(out)
}
