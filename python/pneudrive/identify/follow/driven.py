"""Circuit whose piston follows a recorded motion, as a function of the free parameters, and its recordings."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from pneudrive import _core
from pneudrive.arrays import Array, ArrayPair, Bools, Columns, Interval, NamedNumbers, Plain
from pneudrive.describe.circuit import Circuit
from pneudrive.describe.tables.parts import piston_areas
from pneudrive.errors import CommandError, FitError, RecordingError, nearest
from pneudrive.identify.identified import number_table, stated
from pneudrive.signals.layout import AnyLayout
from pneudrive.signals.load import load_recordings
from pneudrive.signals.motion import NOISE_FACTOR, noise_level
from pneudrive.signals.recording import Recording

MOST_GRID = 4500  # times at which pressures are compared
COARSEST_S = 0.1  # largest step of these times, unless the recording has fewer samples
TOLERANCE = 1e-4  # largest distance of the straight lines from the measured positions, of the travel
AT_REST_S, AT_REST = 0.5, 0.002  # first seconds in which the travel is below this share: the start is at rest
OPEN_CHANGE, OPEN_VOLUME = 0.03, 1.1  # relative change of a pressure below which a chamber is open; ratio of volumes


@dataclass(frozen=True, eq=False)
class DrivenRecording:
    """A recording of a driven piston.

    Attributes
    ----------
    recording : Recording
    nodes : tuple of ndarray
        Times and positions of the nodes. Between nodes, the velocity is constant.
    grid_s : ndarray
        Times at which pressures are compared, from 0.
    pressures_pa : ndarray
        Measured pressures a and b at these times, shape (2, n).
    positions_m : ndarray
        Positions at these times.
    noise_pa : ndarray
        Standard deviation of both pressures, from noise and resolution.
    at_rest : bool
        Whether the recording begins at rest.
    """

    recording: Recording
    nodes: ArrayPair
    grid_s: Array
    pressures_pa: Array
    positions_m: Array
    noise_pa: Array
    at_rest: bool

    @property
    def name(self) -> str:
        """Name of the recording."""
        return self.recording.name

    @property
    def ranges_pa(self) -> Array:
        """Highest minus lowest value of each pressure."""
        return np.ptp(self.pressures_pa, axis=1)

    def within(self, part: Interval) -> Bools:
        """Return a mask of the comparison times within a time span in s."""
        return (self.grid_s >= part[0]) & (self.grid_s <= part[1])

    def is_open(self, volumes: Array) -> bool:
        """Return whether the chambers are open: pressures stay constant while the volumes, shape (2, n), change."""
        steady = self.ranges_pa / self.pressures_pa.mean(axis=1)
        ratio = volumes.max(axis=1) / volumes.min(axis=1)
        return bool((steady < OPEN_CHANGE).all() and (ratio > OPEN_VOLUME).any())


#: One or several recordings, or their files.
MotionRecordings: TypeAlias = "str | Path | Recording | Iterable[str | Path | Recording]"


def check_follow(follow: str) -> None:
    """Reject a value of the argument `follow` other than ``"motion"``."""
    if follow != "motion":
        raise CommandError(f"follow = {follow!r} is not known", rule='the only value is "motion"')


def driven_recordings(recordings: MotionRecordings, layout: AnyLayout = None) -> list[DrivenRecording]:
    """Read one or several recordings of a driven piston: time, position, both pressures, and a force if measured.

    Raises
    ------
    RecordingError, LayoutError
        A file cannot be read, or a channel is missing.
    """
    items = [recordings] if isinstance(recordings, str | Path | Recording) else list(recordings)
    files = [item for item in items if not isinstance(item, Recording)]
    read = iter(load_recordings(files, layout)) if files else iter(())
    return [driven_recording(item if isinstance(item, Recording) else next(read)) for item in items]


def driven_recording(recording: Recording) -> DrivenRecording:
    """Return a prepared recording: nodes of the motion, comparison times, pressures and noise.

    Raises
    ------
    RecordingError
        Too few samples are left.
    """
    values = [recording.time_s, recording.position_m, recording.pressure_a_pa, recording.pressure_b_pa]
    keep = np.all([np.isfinite(value) for value in values], axis=0)
    keep &= np.r_[True, np.diff(recording.time_s) > 0.0]
    recording = recording.at(keep)
    time, position = recording.time_s - recording.time_s[0], recording.position_m
    if time.size < 100:
        raise RecordingError(f"{time.size} samples are left", where=recording.name, rule="at least 100")
    pressures = np.array([recording.pressure_a_pa, recording.pressure_b_pa])
    usual = np.median(np.diff(time))
    stride = max(int(np.ceil(time.size / MOST_GRID)), int(COARSEST_S / usual), 1)
    noise = np.array([max(noise_level(pressure), _step(pressure) / np.sqrt(12.0), 1.0) for pressure in pressures])
    travel = np.ptp(position)
    kept = straight_lines(time, position, max(TOLERANCE * travel, NOISE_FACTOR * noise_level(position)))
    begins = position[time <= AT_REST_S]
    return DrivenRecording(
        recording,
        (time[kept], position[kept]),
        time[::stride],
        pressures[:, ::stride],
        position[::stride],
        noise,
        bool(np.ptp(begins) < AT_REST * travel),
    )


def _step(values: Array) -> float:
    steps = np.abs(np.diff(values))
    steps = steps[steps > 0.0]
    return float(steps.min()) if steps.size else 0.0


def straight_lines(time_s: Array, position_m: Array, tolerance_m: float) -> NDArray[np.intp]:
    """Return indices of samples between which straight lines follow the motion within a tolerance (Douglas-Peucker)."""
    keep = np.zeros(time_s.size, dtype=bool)
    keep[[0, -1]] = True
    parts = [(0, time_s.size - 1)]
    while parts:
        a, b = parts.pop()
        if b - a < 2:
            continue
        slope = (position_m[b] - position_m[a]) / (time_s[b] - time_s[a])
        inside = slice(a + 1, b)
        off = np.abs(position_m[inside] - position_m[a] - slope * (time_s[inside] - time_s[a]))
        worst = int(np.argmax(off))
        if off[worst] > tolerance_m:
            at = a + 1 + worst
            keep[at] = True
            parts += [(a, at), (at, b)]
    return np.flatnonzero(keep)


RTOL = 1e-5
SIDES = ("a", "b")
#: Natural frequency of the moving mass on the driving machine, rad/s: high, so that the motion has no compliance.
STIFF_RAD_S = 4000.0
#: Start values of a wall if the circuit states none (assumed): J/K, m2 (held), and W/(m2 K).
WALL = {"wall_capacity": 5e3, "wall_outer_area": 1.0, "wall_outer_heat_transfer": 30.0}
#: Start value of a leak: this fraction of the gas leaks in this time, s (assumed).
LEAK_SHARE, LEAK_TIME_S = 0.01, 100.0
#: Groups of parameters: short name -> meaning; and units of parameters.
GROUPS, UNITS = number_table("groups"), number_table("circuit_units")


class Number(NamedTuple):
    """A free positive parameter: component and key in the circuit, unit and start value."""

    component: str
    key: str
    unit: str
    start: float
    side: str = ""  # chamber that it acts on; empty: both, or not known

    @property
    def name(self) -> str:
        """Name in a fit file."""
        return f"{self.component}.{self.key}"


class DrivenCircuit:
    """A circuit with one piston between two chambers. The motion of the piston is prescribed.

    Parameters
    ----------
    circuit : Circuit
        Contains one component of the kind ``piston`` or ``cylinder/...``. A ``motor`` at its rod is the driving
        machine; if missing, it is added.
    """

    def __init__(self, circuit: Circuit) -> None:
        self.form: Plain = json.loads(circuit.core_json())
        self.parts = {part["name"]: part for part in self.form["components"]}
        pistons = [n for n, p in self.parts.items() if p["kind"] == "piston" or p["kind"].startswith("cylinder/")]
        if len(pistons) != 1:
            raise FitError(**stated("readings", "pistons", count=len(pistons)))
        self.piston = pistons[0]
        kind, numbers = (self.parts[self.piston][key] for key in ("kind", "numbers"))
        self.stroke_m = numbers["stroke"]
        if "area_a" in numbers:
            self.areas_m2 = numbers["area_a"], numbers["area_b"]
        else:
            self.areas_m2 = piston_areas(kind.partition("/")[2], numbers["bore"], numbers.get("rod_diameter", 0.0))
        self.tanks = {side: self._neighbour(side, "tank") for side in SIDES}
        self.machine = self._machine(numbers["moving_mass"])
        self.wall_k = {side: self._wall_k(side) for side in SIDES}
        names = _core.Circuit(json.dumps(self.form)).start_names
        self.starts = {side: self._start(side, names) for side in SIDES}

    def _joint(self, port: str) -> list[str]:
        return next((joint for joint in self.form["joints"] if port in joint), [])

    def _neighbour(self, end: str, kind: str) -> str | None:
        """Return the component of a kind at a port of the piston."""
        names = [port.partition(".")[0] for port in self._joint(f"{self.piston}.{end}")]
        return next((name for name in names if name in self.parts and self.parts[name]["kind"] == kind), None)

    def _machine(self, mass_kg: float) -> str:
        """Make the motor at the rod stiff, and return its name. Add a motor if the circuit has none."""
        name = self._neighbour("rod", "motor")
        if name is None:
            name = "machine"
            self._add(name, "motor", {"velocity": 0.0}, f"{self.piston}.rod")
        stiffness = mass_kg * STIFF_RAD_S**2
        self.parts[name]["numbers"] |= {"stiffness": stiffness, "damping": 2.0 * mass_kg * STIFF_RAD_S}
        return name

    def _add(self, name: str, kind: str, numbers: NamedNumbers, *ends: str) -> None:
        """Add a component with its ports 1 and 2 joined to `ends`."""
        part = {"name": name, "kind": kind, "numbers": numbers, "choices": {}, "friction": None}
        self.form["components"].append(part)
        self.parts[name] = part
        for place, end in enumerate(ends, 1):
            joint = self._joint(end) or [end]
            joint.append(f"{name}.{place}")
            if joint not in self.form["joints"]:
                self.form["joints"].append(joint)

    def _wall_k(self, side: str) -> float:
        tank = self.tanks[side]
        given = None if tank is None else self.parts[tank]["numbers"].get("wall_temperature")
        return self.form["ambient"]["temperature_k"] if given is None else given

    def _start(self, side: str, names: Sequence[str]) -> str:
        for name in (self.tanks[side], f"{self.piston}.{side}"):
            if name is not None and f"{name}.pressure_pa" in names:
                return name
        raise FitError(**stated("readings", "no_gas", side=side))

    def numbers_of(self, asked: Sequence[str]) -> list[Number]:
        """Return the free parameters of groups and names, and add missing components and keys to the circuit.

        Raises
        ------
        FitError
            A name is not known, or does not belong to this circuit.
        """
        found: dict[str, Number] = {}
        for name in asked:
            kind, _, side = name.partition("_")
            if name not in GROUPS:
                component, _, key = name.removeprefix("components.").rpartition(".")
                if component not in self.parts or not self.parts[component]["numbers"].get(key, 0.0) > 0.0:
                    every = [(part, one["numbers"]) for part, one in self.parts.items()]
                    positive = [f"{part}.{key}" for part, own in every for key, v in own.items() if v > 0.0]
                    raise FitError(f"{name} cannot be free", remedy=nearest(name, [*GROUPS, *positive]))
                numbers = [self._number(component, key)]
            elif kind == "leak":
                numbers = [self._leak(side)]
            else:
                numbers = [number for one in side or SIDES for number in self._of_chamber(name, one)]
            found |= {number.name: number for number in numbers}
        return list(found.values())

    def _of_chamber(self, name: str, side: str) -> list[Number]:
        kind, tank = name.partition("_")[0], self.tanks[side]
        own = tank or self.piston
        if kind == "volumes":
            return [self._number(own, "volume" if tank else f"dead_volume_{side}")]
        if kind == "heat":  # the coefficient if the circuit states it, otherwise the factor on its law
            is_stated = "heat_transfer" in self.parts[own]["numbers"]
            return [self._number(own, "heat_transfer" if is_stated else "heat_transfer_scale", 1.0)]
        if tank is None:
            remedy = "describe the dead volume as a tank at the piston's port"
            raise FitError(f"{name}: chamber {side} has no tank", remedy=remedy)
        if kind == "barrel":
            return [self._number(self.piston, f"perimeter_{side}", 0.3)]
        capacity, _, transfer = (self._number(tank, key, start) for key, start in WALL.items())
        return [capacity, transfer]

    def _leak(self, side: str) -> Number:
        """Return the leak past the piston or to the ambient air, existing or added."""
        ends = (f"{self.piston}.{side or 'a'}", "ambient" if side else f"{self.piston}.b")
        possible = {"ambient", f"{self.piston}.a", f"{self.piston}.b"}
        for name in (name for name, part in self.parts.items() if part["kind"] == "leak"):
            if possible & {*self._joint(f"{name}.1"), *self._joint(f"{name}.2")} == {*ends}:
                break
        else:
            name = f"leak_{side}" if side else "leak"
            self._add(name, "leak", {}, *ends)
        # assumed start: 1 % of the gas at 5 bar leaks to the ambient air in 100 s
        volume = self.stroke_m * max(self.areas_m2) + sum(self._dead(side) for side in SIDES)
        usual = LEAK_SHARE * volume / LEAK_TIME_S / (5e5 * self.form["gas"]["gas_constant_j_kg_k"])
        return self._number(name, "coefficient", usual)

    def _dead(self, side: str) -> float:
        tank = self.tanks[side]
        numbers = self.parts[tank or self.piston]["numbers"]
        return numbers["volume"] if tank else numbers.get(f"dead_volume_{side}", 0.0)

    def _number(self, component: str, key: str, start: float | None = None) -> Number:
        numbers = self.parts[component]["numbers"]
        if not numbers.get(key):
            if start is None:
                raise FitError(f"{component}.{key} is zero", remedy="give a start value in the circuit file")
            numbers[key] = start
        side = next((s for s in SIDES if component in (self.tanks[s], f"leak_{s}") or key.endswith(f"_{s}")), "")
        return Number(component, key, UNITS.get(key, ""), numbers[key], side)

    @property
    def is_coupled(self) -> bool:
        """Whether gas can pass from one chamber to the other."""
        reach = [{p.partition(".")[0] for p in self._joint(f"{self.piston}.{side}")} for side in SIDES]
        plain = {n for n, p in self.parts.items() if p["kind"] == "tank" or n in ("leak_a", "leak_b", self.piston)}
        return bool((reach[0] | reach[1]) - plain)

    def values_form(self, numbers: Sequence[Number], values: Sequence[float] | Array) -> str:
        """Return the core's form of the circuit with these values."""
        for number, value in zip(numbers, values, strict=True):
            self.parts[number.component]["numbers"][number.key] = float(value)
        return json.dumps(self.form)

    def heat_w_k(self, side: str) -> float | None:
        """Return the heat transfer from gas to wall in W/K, at the wall of the dead volume and both end faces.

        It is defined for a chamber with a tank and a constant coefficient; otherwise, None is returned.
        """
        tank = self.tanks[side]
        numbers = self.parts[tank or self.piston]["numbers"]
        faces = 2.0 * self.areas_m2[SIDES.index(side)]
        if tank is None or "heat_transfer" not in numbers:
            return None
        return numbers["heat_transfer"] * (numbers.get("wall_area", 0.0) + faces)

    def volumes_m3(self, position_m: Array) -> Columns:
        """Return the volume of each chamber at these positions."""
        a, b = self.areas_m2
        return {"a": self._dead("a") + a * position_m, "b": self._dead("b") + b * (self.stroke_m - position_m)}

    def run(
        self, form: str, record: DrivenRecording, start: Array, until: float, columns: Sequence[str] = ()
    ) -> Columns:
        """Return columns of a run along a recording, at its comparison times up to `until`.

        Parameters
        ----------
        form : str
            From `values_form`.
        record : DrivenRecording
        start : ndarray, shape (4,)
            Pressures a and b in Pa, temperatures a and b in K, at the first sample.
        until : float
            Time in s at which the run ends.
        columns : sequence of str
            Default: all columns of the core except the time.
        """
        core = _core.Circuit(form)
        nodes_t, nodes_x = record.nodes
        velocities = np.diff(nodes_x) / np.diff(nodes_t)
        state = {f"{self.piston}.position_m": float(nodes_x[0]), f"{self.piston}.velocity_m_s": float(velocities[0])}
        for place, side in enumerate(SIDES):
            state[f"{self.starts[side]}.pressure_pa"] = float(start[place])
            state[f"{self.starts[side]}.temperature_k"] = float(start[2 + place])
        session = core.start(state, RTOL)
        name = f"{self.machine}.velocity_m_s"
        session.set(name, float(velocities[0]))
        inside = nodes_t[1:-1] < until
        session.schedule(name, nodes_t[1:-1][inside].tolist(), velocities[1:][inside].tolist())
        times = record.grid_s[record.grid_s <= until]
        names = list(columns) or [name for name in core.columns if name != "time_s"]
        return session.record(float(times[-1]), times, names)["columns"]
