//! A drive that runs: its inputs are set, it is advanced and read, saved and put back, and linearised.

use super::Drive;
use super::drive::{COLUMNS, openings};
use crate::circuit::Circuit;
use crate::net::Net;
use crate::part::InputId;
use crate::run::{Error, Look, advance, budget};
use crate::specification::Initial;
use math::{Dual, Real};
use ode::{NoOutput, Options, Statistics, Stepper, System};
use physics::Bounds;

/// What can be set while a drive runs.
#[derive(Clone, Copy, Debug)]
pub struct Settable {
    pub name: &'static str,
    pub unit: &'static str,
    pub bounds: Bounds,
    pub meaning: &'static str,
}

const fn settable(name: &'static str, unit: &'static str, bounds: Bounds, meaning: &'static str) -> Settable {
    Settable { name, unit, bounds, meaning }
}

const OPENING: Bounds = physics::within(0.0, 1.0);
/// The inputs of a drive: the command, then those of `Drive::inputs`.
pub const INPUTS: [Settable; 8] = [
    settable("command", "1", physics::within(-1.0, 1.0), "valve command"),
    settable("opening_supply_a", "1", OPENING, "opening of the edge from supply to chamber a"),
    settable("opening_a_exhaust", "1", OPENING, "opening of the edge from chamber a to exhaust"),
    settable("opening_supply_b", "1", OPENING, "opening of the edge from supply to chamber b"),
    settable("opening_b_exhaust", "1", OPENING, "opening of the edge from chamber b to exhaust"),
    settable("load_force_n", "N", physics::any(), "external force in +x"),
    settable("supply_pressure_pa", "Pa", physics::above(0.0), "absolute pressure of the supply"),
    settable("supply_temperature_k", "K", physics::above(0.0), "temperature of the supply"),
];
const COMMAND: usize = 0;
const EDGES: std::ops::RangeInclusive<usize> = 1..=4;

/// Bytes of a session begin with this, and the version of their form.
const MAGIC: &[u8; 8] = b"pnd-ses\x01";

/// Directions of one pass of a linearisation.
const DIRECTIONS: usize = 8;
type Seeded = Dual<f64, DIRECTIONS>;

/// x' = A x + B u, y = C x + D u about the present state: rows one after the other.
#[derive(Clone, Debug)]
pub struct Linear {
    pub a: Vec<f64>,
    pub b: Vec<f64>,
    pub c: Vec<f64>,
    pub d: Vec<f64>,
    /// The state, its rates, and the outputs there.
    pub state: Vec<f64>,
    pub rates: Vec<f64>,
    pub outputs: Vec<f64>,
}

/// A running drive.
#[derive(Clone)]
pub struct Session {
    drive: Drive,
    stepper: Stepper<f64, Circuit<f64>>,
    ids: [InputId; INPUTS.len() - 1],
    values: [f64; INPUTS.len()],
    /// (time, input, value), by time; what comes first is last.
    schedule: Vec<(f64, usize, f64)>,
    net: Net<f64>,
    state: Vec<f64>,
    row: Vec<f64>,
    /// `row` is of the present state and inputs.
    is_read: bool,
    failed: Option<String>,
    rtol: f64,
    /// Of the description and the tolerance.
    mark: u64,
}

/// FNV-1a.
fn mark_of(bytes: impl IntoIterator<Item = u8>) -> u64 {
    bytes
        .into_iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn refuse<T>(message: impl Into<String>) -> Result<T, Error> {
    Err(Error::Specification(message.into()))
}

impl Session {
    /// A drive at `initial`, its valve shut, everything else as described. `json` is its description.
    pub fn new(drive: &Drive, json: &str, initial: &Initial, rtol: f64) -> Self {
        let (mut circuit, y) = drive.start(initial, 0.0);
        let ids = drive.inputs();
        let mut values = [0.0; INPUTS.len()];
        for (value, id) in values[1..].iter_mut().zip(ids) {
            *value = circuit.input(id);
        }
        let mark = mark_of(
            json.bytes().chain(rtol.to_bits().to_le_bytes()).chain(env!("CARGO_PKG_VERSION").bytes()),
        );
        Session {
            net: circuit.work(),
            stepper: Stepper::new(circuit, 0.0, &y, Options { rtol, ..Options::default() }),
            drive: drive.clone(),
            ids,
            values,
            schedule: Vec::new(),
            row: vec![0.0; drive.columns().len()],
            state: y,
            is_read: false,
            failed: None,
            rtol,
            mark,
        }
    }

    pub fn time(&self) -> f64 {
        self.stepper.time(0)
    }

    pub fn statistics(&self) -> Statistics {
        self.stepper.statistics(0)
    }

    /// Why it cannot go on, if it cannot.
    pub fn failed(&self) -> Option<&str> {
        self.failed.as_deref()
    }

    /// What an input is set to; the command is not a number while edges are set by themselves.
    pub fn input(&self, input: usize) -> f64 {
        self.values[input]
    }

    fn check(&self, input: usize, value: f64) -> Result<(), Error> {
        let Settable { name, unit, bounds, .. } = INPUTS[input];
        if value.is_finite() && bounds.contain(value) {
            return Ok(());
        }
        refuse(format!("{name} = {value} {unit} is out of bounds: it must be {bounds}"))
    }

    fn alive(&self) -> Result<(), Error> {
        match &self.failed {
            Some(reason) => refuse(format!("the session cannot go on: {reason}")),
            None => Ok(()),
        }
    }

    /// Sets an input from now on.
    pub fn set(&mut self, input: usize, value: f64) -> Result<(), Error> {
        self.check(input, value)?;
        self.alive()?;
        self.put(input, value);
        Ok(())
    }

    fn put(&mut self, input: usize, value: f64) {
        let circuit = self.stepper.system_mut();
        if input == COMMAND {
            self.drive.set_command(circuit, 0, value);
            self.values[EDGES].copy_from_slice(&openings(value));
        } else {
            circuit.set_input(self.ids[input - 1], 0, value);
            if EDGES.contains(&input) {
                self.values[COMMAND] = f64::NAN;
            }
        }
        self.values[input] = value;
        self.is_read = false;
    }

    /// Sets an input at times to come: the integration ends on each of them exactly.
    pub fn schedule(&mut self, input: usize, times: &[f64], values: &[f64]) -> Result<(), Error> {
        self.alive()?;
        if times.len() != values.len() {
            return refuse(format!(
                "{} times and {} values: there must be one value for each time",
                times.len(),
                values.len()
            ));
        }
        for (&time, &value) in times.iter().zip(values) {
            self.check(input, value)?;
            if !(time.is_finite() && time >= self.time()) {
                return refuse(format!(
                    "t = {time} s has passed: it must be finite and not before the present, {} s",
                    self.time()
                ));
            }
        }
        self.schedule.extend(times.iter().zip(values).map(|(&time, &value)| (time, input, value)));
        // Stable, and from the last to the first: of entries at one time the one given last holds.
        self.schedule.reverse();
        self.schedule.sort_by(|one, other| other.0.total_cmp(&one.0));
        Ok(())
    }

    /// Goes on until a time, s.
    pub fn advance(&mut self, until: f64, look: &mut Look<'_>) -> Result<(), Error> {
        self.alive()?;
        if !(until.is_finite() && until >= self.time()) {
            return refuse(format!(
                "until = {until} s must be finite and not before the present, {} s",
                self.time()
            ));
        }
        self.is_read = false;
        let due = self.schedule.iter().filter(|entry| entry.0 <= until).count();
        self.stepper.allow(budget(until - self.time(), due + 1, self.rtol));
        loop {
            let next = self.schedule.last().copied().filter(|entry| entry.0 <= until);
            match advance(&mut self.stepper, next.map_or(until, |entry| entry.0), &mut NoOutput, look) {
                Err(Error::Stopped(message)) => {
                    self.failed = Some(message.clone());
                    return Err(Error::Stopped(message));
                }
                other => other?,
            }
            let Some((_, input, value)) = next else { return Ok(()) };
            self.schedule.pop();
            self.put(input, value);
        }
    }

    /// A column of the drive at the present state and inputs.
    pub fn read(&mut self, column: usize) -> f64 {
        if !self.is_read {
            let circuit = self.stepper.system();
            self.state.copy_from_slice(self.stepper.state());
            circuit.settle(&mut self.state);
            let at = (self.stepper.time(0), self.values[COMMAND]);
            self.drive.row(circuit, at, &self.state, &mut self.net, &mut self.row);
            self.is_read = true;
        }
        self.row[column]
    }

    /// The whole session as bytes; a failed one has none.
    pub fn save(&self) -> Result<Vec<u8>, Error> {
        self.alive()?;
        let Some(stepper) = self.stepper.save() else { return refuse("the session cannot go on") };
        let circuit = self.stepper.system();
        let mut words = vec![self.mark, self.schedule.len() as u64, u64::from(circuit.has_met())];
        words.extend(self.values.map(f64::to_bits));
        circuit.clone().change_modes(|mode| words.push(mode.to_bits()));
        words.extend(stepper);
        for &(time, input, value) in &self.schedule {
            words.extend([time.to_bits(), input as u64, value.to_bits()]);
        }
        let mut bytes = MAGIC.to_vec();
        bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        bytes.extend(mark_of(bytes.iter().copied()).to_le_bytes());
        Ok(bytes)
    }

    /// Puts the session back to where bytes were saved, bit for bit; one that has failed too.
    pub fn restore(&mut self, bytes: &[u8]) -> Result<(), Error> {
        let Some(rest) = bytes.strip_prefix(MAGIC) else {
            return refuse("these bytes are no session, or one of another version of their form");
        };
        let (words, _) = rest.as_chunks::<8>();
        let words: Vec<u64> = words.iter().map(|word| u64::from_le_bytes(*word)).collect();
        let whole = rest.len().is_multiple_of(8)
            && words.last() == Some(&mark_of(bytes[..bytes.len() - 8].iter().copied()));
        if !whole || words.len() < 4 {
            return refuse("these bytes of a session are damaged");
        }
        if words[0] != self.mark {
            return refuse(
                "these bytes are of a session of another drive, another tolerance or another version of pneudrive",
            );
        }
        let mut n_modes = 0;
        self.stepper.system().clone().change_modes(|_| n_modes += 1);
        let (values, rest) = words[3..words.len() - 1].split_at_checked(INPUTS.len()).unwrap_or_default();
        let (modes, rest) = rest.split_at_checked(n_modes).unwrap_or_default();
        let (stepper, entries) = rest.split_at_checked(self.stepper.words()).unwrap_or_default();
        let (entries, left) = entries.as_chunks::<3>();
        let fits = left.is_empty() && entries.len() as u64 == words[1];
        if stepper.is_empty() || !fits || entries.iter().any(|entry| entry[1] >= INPUTS.len() as u64) {
            return refuse("these bytes of a session are damaged");
        }
        let number = |word: &u64| f64::from_bits(*word);
        let circuit = self.stepper.system_mut();
        *circuit = self.drive.circuit().clone();
        if words[2] != 0 {
            circuit.meet(0);
        }
        for (id, value) in self.ids.into_iter().zip(&values[1..]) {
            circuit.set_input(id, 0, number(value));
        }
        let mut modes = modes.iter();
        circuit.change_modes(|mode| *mode = modes.next().map_or(0.0, number));
        self.values = std::array::from_fn(|i| number(&values[i]));
        self.stepper.restore(stepper);
        self.schedule =
            entries.iter().map(|[t, input, value]| (number(t), *input as usize, number(value))).collect();
        (self.failed, self.is_read) = (None, false);
        Ok(())
    }

    /// The names and units of the states.
    pub fn state_names(&self) -> &[String] {
        self.stepper.system().state_names()
    }

    /// The exact derivatives of rates and outputs by the states and by some inputs. Outputs are the columns but time
    /// and command.
    pub fn linearise(&self, inputs: &[usize]) -> Result<Linear, Error> {
        self.alive()?;
        let u = self.values[COMMAND];
        if inputs.contains(&COMMAND) && (u == 0.0 || u.is_nan()) {
            return refuse(if u == 0.0 {
                "command = 0: the valve is shut, and its flow has one slope towards extending and another towards retracting. \
                 Set a small command in one direction, or linearise by the openings of the edges"
            } else {
                "the edges of the valve are set by themselves: there is no command to differentiate by. Linearise by their openings"
            });
        }
        let (circuit, n) = (self.stepper.system(), self.stepper.system().n_states());
        let mut y0 = self.stepper.state().to_vec();
        circuit.settle(&mut y0);
        let columns: Vec<usize> = (0..self.row.len())
            .filter(|&i| COLUMNS.get(i).is_none_or(|name| !["time_s", "command"].contains(name)))
            .collect();
        let directions = n + inputs.len();
        let lifted = Circuit::<Seeded>::gather(&[circuit]);
        let (mut dy, mut row) = (vec![Seeded::zero(); y0.len()], vec![Seeded::zero(); self.row.len()]);
        let mut slopes = vec![vec![0.0; directions]; n + columns.len()];
        for first in (0..directions).step_by(DIRECTIONS) {
            let seeded = |value: f64, direction: usize| Dual {
                re: value,
                eps: std::array::from_fn(|k| f64::from(u8::from(first + k == direction))),
            };
            let mut circuit = lifted.clone();
            let mut values = self.values.map(Seeded::c);
            if let Some(k) = inputs.iter().position(|&input| input == COMMAND) {
                values[EDGES].copy_from_slice(&openings(seeded(u, n + k)));
            }
            for (k, &input) in inputs.iter().enumerate() {
                // An edge moves with the command and by itself.
                values[input] += seeded(0.0, n + k);
            }
            for (id, value) in self.ids.into_iter().zip(&values[1..]) {
                circuit.set_input(id, 0, *value);
            }
            let y: Vec<Seeded> = y0.iter().enumerate().map(|(i, &value)| seeded(value, i)).collect();
            let mut net = circuit.work::<Seeded>();
            circuit.rhs(Seeded::zero(), &y, &mut dy, &mut net);
            self.drive.row(&circuit, (self.time(), u), &y, &mut net, &mut row);
            let numbers = dy[..n].iter().chain(columns.iter().map(|&column| &row[column]));
            for (slopes, number) in slopes.iter_mut().zip(numbers) {
                let pass = first..directions.min(first + DIRECTIONS);
                slopes[pass.clone()].copy_from_slice(&number.eps[..pass.len()]);
            }
        }
        let part = |rows: std::ops::Range<usize>, of: std::ops::Range<usize>| {
            slopes[rows].iter().flat_map(|row| row[of.clone()].to_vec()).collect::<Vec<_>>()
        };
        let all = n + columns.len();
        Ok(Linear {
            a: part(0..n, 0..n),
            b: part(0..n, n..directions),
            c: part(n..all, 0..n),
            d: part(n..all, n..directions),
            state: y0[..n].to_vec(),
            rates: dy[..n].iter().map(|rate| rate.re).collect(),
            outputs: columns.iter().map(|&column| row[column].re).collect(),
        })
    }
}
