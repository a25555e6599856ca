"""Simulation and score of a platform under control. Each leg is an axis with its own controller."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, replace
from math import comb
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from pneudrive import units
from pneudrive.control.loop import MEANINGS, provenance_of, run_axes
from pneudrive.control.mismatch import MismatchOrFile, mismatched, read_mismatch
from pneudrive.control.motion import POWERS, Reference, speed_shares
from pneudrive.control.pose.path import PosePath, PoseScore, Tracked, pose_path
from pneudrive.control.scores import LAST_S, air_of
from pneudrive.control.setup import Setup, SetupOrFile, read_setup, told
from pneudrive.control.tuning import ControllerOrFile, Tuning, supply_of, tune
from pneudrive.describe.circuit import Circuit
from pneudrive.errors import CommandError, warn
from pneudrive.estimate.estimates import rms
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.platforms import platform as platform_of
from pneudrive.platforms.kinematics import LEAST_SINGULAR_VALUE, pose_columns
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.simulation.simulate import Run, positive, whole_number

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    import xarray as xr

    from pneudrive.arrays import Array, Columns, NamedNumbers, Plain
    from pneudrive.platforms import LegDynamics, Platform


# --- Legs of a platform as axes: circuit and controller of each, its reference and its preview, and checks of a path.

#: Knot spacing of a leg's reference, and its extension beyond the run for the prediction horizon of a controller, s.
KNOT_S, BEYOND_S = 5e-3, 0.1
#: Half step of the finite differences for jerk and load rate, s. Their relative error is 1e-6 at 2 Hz.
STEP_S = 1e-4
#: Fraction of a leg's force acting on another leg, above which independent controllers may oscillate (measured).
MOST_COUPLED = 0.4
#: Law that takes the inertia of all legs into account, and a ratio: inertia of the heaviest motion of all legs over the
#: mass of one leg. Above this ratio, model errors reduce the bandwidth by the cube root of the ratio (measured).
DECOUPLING, HEAVIEST = "inversion", 12.0


class Demands(NamedTuple):
    """Motion, force and load of n legs at m knots of a path, in SI. Arrays without a stated shape have (m, n).

    Attributes
    ----------
    times_s : ndarray, shape (m,)
    legs : LegDynamics
        Motion, force without friction, and moving mass of each leg.
    jerks_m_s3 : ndarray
    loads_n, load_rates_n_s : ndarray
        External force m_i a_i - F_i in +x, without air and friction, and its rate.
    couplings : ndarray, shape (m, n, n)
        Fraction of the force of leg j that acts on leg i as a load; zero for i = j.
    inertias_kg : ndarray, shape (m, n, n)
        Force on leg i for each m/s2 of leg j while the other legs do not accelerate.
    singular_values : ndarray, shape (m,)
        Smallest singular value at each pose.
    """

    times_s: Array
    legs: LegDynamics
    jerks_m_s3: Array
    loads_n: Array
    load_rates_n_s: Array
    couplings: Array
    inertias_kg: Array
    singular_values: Array

    @property
    def coupling(self) -> float:
        """Largest fraction of a leg's force that acts on another leg."""
        return float(np.abs(self.couplings).max())


def demands(platform: Platform, path: PosePath, duration_s: float) -> Demands:
    """Return motion, force and load of each leg along a path, by inverse dynamics.

    Raises
    ------
    CommandError
        An arm does not reach a pose.
    """
    times = np.arange(0.0, duration_s + BEYOND_S + KNOT_S, KNOT_S)
    around = [platform.dynamics(*path.at(times + shift)) for shift in (0.0, -STEP_S, STEP_S)]
    own, before, behind = around
    if not np.all(np.isfinite(own.positions_m)):
        row, leg = np.argwhere(~np.isfinite(own.positions_m))[0]
        raise CommandError(f"{platform.legs[leg].name} does not reach the path at t = {times[row]:.4g} s")
    loads = [one.masses_kg * one.accelerations_m_s2 - one.forces_n for one in around]
    return Demands(
        times,
        own,
        (behind.accelerations_m_s2 - before.accelerations_m_s2) / (2.0 * STEP_S),
        loads[0],
        (loads[2] - loads[1]) / (2.0 * STEP_S),
        own.couplings * (1.0 - np.eye(len(platform.legs))),
        np.linalg.pinv(own.couplings / own.masses_kg[..., None]).astype(float),
        platform.singular_values(path.at(times)[0])[:, -1],
    )


def check_path(platform: Platform, tunings: list[Tuning], needs: Demands) -> Plain:
    """Return the smallest margins of a path, and reject a path that a leg cannot follow.

    Returns
    -------
    dict
        Smallest ``singular_value``, and the largest fractions of the available force and speed that a leg needs,
        ``force_share`` and ``speed_share``.

    Raises
    ------
    CommandError
        A pose is nearly singular, or a leg leaves its stroke, is too fast, or needs more force than the supply gives.
        The message names time, leg and margin.
    """
    row = int(np.argmin(needs.singular_values))
    if needs.singular_values[row] < LEAST_SINGULAR_VALUE:
        smallest = {"at_s": needs.times_s[row], "size": needs.singular_values[row], "least": LEAST_SINGULAR_VALUE}
        raise CommandError.of("control.singular", platform=platform.name, **smallest)
    if needs.coupling > MOST_COUPLED and tunings[0].law != DECOUPLING:
        said = f"up to {100.0 * needs.coupling:.0f} % of the force of a leg of {platform.name} acts on another leg"
        warn(f"{said}: controllers of single legs may oscillate; {DECOUPLING} controls the legs together")
    most = {"force_share": 0.0, "speed_share": 0.0}
    for i, tuning in enumerate(tunings):
        name, stroke = platform.legs[i].name, tuning.plant.stroke_m
        x, v = needs.legs.positions_m[:, i], needs.legs.velocities_m_s[:, i]
        out, back = tuning.speeds_m_s
        cylinder = tuning.belief.core_parts[tuning.plant.cylinder]
        viscous = float(((cylinder["friction"] or {}).get("parameters") or {}).get("viscous", 0.0))
        friction = tuning.plant.coulomb_n * np.sign(v) + viscous * v
        force, (area_a, area_b) = needs.legs.forces_n[:, i] + friction, platform.legs[i].areas_m2
        gauge = supply_of(tuning.belief.core_json())[0] - platform.ambient_pa
        low, high = -gauge * area_b, gauge * area_a
        limits = (
            ("position", "mm", 1e3 * x, 0.0, 1e3 * stroke, "Make the path smaller, or move it."),
            ("velocity", "m/s", v, -back, out, "Make the path slower, or take a larger valve."),
            ("force", "N", force, low, high, "Make the path slower, or take a larger cylinder or a higher pressure."),
        )
        for what, unit, values, least, largest, remedy in limits:
            margins = np.minimum(values - least, largest - values)
            if margins.min() < 0.0:
                at = int(np.argmin(margins))
                where = f"{values[at]:.4g} {unit} at t = {needs.times_s[at]:.4g} s"
                outside, rule = f"{-margins[at]:.3g} {unit} outside", f"{least:.4g} {unit} to {largest:.4g} {unit}"
                said = f"the path requires a {what} of {where} from {name}"
                raise CommandError(said, value=outside, rule=rule, remedy=remedy)
        most["speed_share"] = max(most["speed_share"], float(speed_shares(v, (out, back)).max()))
        most["force_share"] = max(most["force_share"], float(np.maximum(force / high, force / low).max()))
    return {"singular_value": float(needs.singular_values[row]), **most}


def leg_reference(needs: Demands, leg: int, text: str) -> tuple[Reference, Plain]:
    """Return the reference of a leg, with polynomials of degree 7 between knots, and its preview for the core."""
    h = float(needs.times_s[1] - needs.times_s[0])
    own = needs.legs
    ends = np.stack([own.positions_m, own.velocities_m_s, own.accelerations_m_s2, needs.jerks_m_s3])[:, :, leg]
    scaled = ends * np.array([1.0, h, h**2 / 2.0, h**3 / 6.0])[:, None]
    # Values of the powers and of their derivatives over the factorials at the end of a piece.
    binomials = np.array([[comb(n, k) for n in range(8)] for k in range(4)], dtype=float)
    low = scaled[:, :-1]
    high = np.linalg.solve(binomials[:, 4:], scaled[:, 1:] - binomials[:, :4] @ low)
    begins = needs.times_s[:-1]
    rest = np.zeros((begins.size, POWERS - len(low) - len(high)))
    rows = np.column_stack([begins, np.full_like(begins, h), low.T, high.T, rest])
    made = Reference(text, float(needs.legs.positions_m[0, leg]), pieces=tuple(rows.tolist()))
    efforts = np.stack([needs.legs.masses_kg[:, leg], needs.loads_n[:, leg], needs.load_rates_n_s[:, leg]], axis=1)
    others = np.stack([needs.couplings[:, leg], needs.inertias_kg[:, leg]], axis=-1)
    return made, {"period_s": h, "rows": efforts.tolist(), "others": others.tolist()}


def leg_circuit(circuit: Circuit, platform: Platform, leg: int, mass_kg: float, load_n: float) -> Circuit:
    """Return the circuit of one leg as a single axis: cylinder, valves, supply, and a load at the rod.

    Parameters
    ----------
    circuit : Circuit
    platform : Platform
    leg : int
    mass_kg, load_n : float
        Mass that the leg moves, and force on it in +x.
    """
    kinds = {name: one["kind"] for name, one in circuit.core_parts.items()}
    joined = [{port.rpartition(".")[0] for port in joint} & kinds.keys() for joint in circuit.wiring.core()]
    names = [one.name for one in platform.legs]

    def reached(name: str, *, ends: str, without: set[str]) -> set[str]:
        found, front = {name}, {name}
        while front:
            inner = {one for one in front if one == name or not kinds[one].startswith(ends)}
            front = set().union(*(joint for joint in joined if joint & inner)) - found - without
            found |= front
        return found

    others = {platform.name, *names} - {names[leg]}
    for other in others - {platform.name}:
        behind = reached(other, ends="valve/", without={platform.name, *names} - {other})
        others |= {one for one in behind if not kinds[one].startswith("reservoir")}
    kept = reached(names[leg], ends="reservoir", without=others)
    own = circuit.components[names[leg]]
    described = float(vars(own)["moving_mass_kg"])
    load = {"kind": "load", "mass": f"{max(mass_kg - described, 0.0)!r} kg", "force": f"{load_n!r} N"}
    components: Plain = {name: one for name, one in circuit.components.items() if name in kept}
    components[f"{names[leg]}_load"] = load
    chains = [chain for chain in circuit.connections if _named(chain) <= kept | {"ambient"}]
    rod = f"{names[leg]}.rod -> {names[leg]}_load"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the circuit has warned already
        return Circuit(
            name=names[leg],
            gas=circuit.gas,
            ambient=circuit.ambient,
            components=components,
            connections=(*chains, rod),
            plugged=tuple(port for port in circuit.plugged if _named(port) <= kept),
            junctions=circuit.junctions,
        )


def _named(chain: str) -> set[str]:
    return {entry.strip().partition(".")[0] for entry in chain.split("->")}


def leg_tunings(
    circuit: Circuit,
    platform: Platform,
    needs: Demands,
    law: str | None,
    setup: SetupOrFile | None,
    controller: ControllerOrFile | None = None,
) -> list[Tuning]:
    """Return a controller for each leg, tuned for mass and load of the leg at the beginning of a path.

    Raises
    ------
    CommandError
        The controller is custom code.
    DescriptionError
        A leg has no cylinder or no valves that a controller can command.
    """
    out: list[Tuning] = []
    heaviest = float((np.linalg.eigvalsh(needs.inertias_kg)[:, -1] / needs.legs.masses_kg.min(axis=1)).max())
    slower = min(1.0, (HEAVIEST / heaviest) ** (1.0 / 3.0))  # relative to the bandwidth for a single leg
    if law is None and controller is None and needs.coupling > MOST_COUPLED:
        law = DECOUPLING
    for i, leg in enumerate(platform.legs):
        own = leg_circuit(circuit, platform, i, float(needs.legs.masses_kg[0, i]), float(needs.loads_n[0, i]))
        tuning = tune(own, law, believes=own, setup=setup, controller=controller)
        if tuning.own is not None:
            raise CommandError.of("control.own_law_of_leg", leg=leg.name, law=tuning.law)
        if tuning.law == DECOUPLING:
            gains = {gain.key: gain for gain in tuning.gains}
            bandwidth = gains["bandwidth"]
            if not bandwidth.given:
                gains["bandwidth"] = bandwidth._replace(value=slower * bandwidth.value)
            tuning = replace(tuning, gains=tuple(gains.values()))
        out.append(tuning)
    return out


# --- A platform under control along a path of its pose: one controller for each leg, one run, one score.

#: Stored columns of each leg, and their names after the name of the leg.
KEPT = ("position_m", "velocity_m_s", "reference_m", "disturbance_n", "holds")


def run_pose(
    circuit: Circuit,
    law: str | None = None,
    *,
    reference: PosePath | Mapping[str, str] | str | Path,
    setup: SetupOrFile | None = None,
    duration: str | float | None = None,
    seed: int = 1,
    controller: ControllerOrFile | None = None,
    payload: str | Sequence[str] | None = None,
    mismatch: MismatchOrFile | None = None,
    dynamics: str = "full",
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate a platform under control along a path of its pose. Controllers and platform use the same equations.

    Each leg has a controller. The path gives the controller position, velocity, acceleration and jerk of the leg. The
    inverse dynamics of the described platform give moving mass, load and rate of the load. The controllers of
    ``"inversion"`` use the inertia that couples the legs, so that together they control the pose of the platform.

    Parameters
    ----------
    circuit : Circuit
        Circuit with one platform, and with a cylinder and valves at each leg.
    law : str, optional
        A name in `pneudrive.control.laws`; default: ``"nmpc"``, or ``"inversion"`` if the legs are strongly coupled.
    reference : PosePath, mapping, str or path-like
        See `pneudrive.control.pose.pose_path`.
    setup, duration, controller, progress, cancel : optional
        See `pneudrive.control.run`.
    seed : int
        Seed of all noise, and of the random values of a mismatch with ranges.
    payload : str or sequence of str, optional
        Mass at ``payload_at`` of the platform, such as ``"2 kg"``. No controller knows this mass. The platform is run
        with each of several payloads. The dataset is from the first payload; the score has the spread over payloads.
    mismatch : Mismatch, str or path-like, optional
        Deviation of each leg from its description. Each leg gets its own random value from each range.
    dynamics : str
        ``"full"``, or ``"constant"``. With ``"constant"``, the controllers use mass and load of each leg at the start
        of the path.

    Returns
    -------
    xarray.Dataset
        Dimension time; coordinates of the platform and of each leg with their references, pressures and commands, such
        as ``tripod.heave``, ``tripod.heave_reference``, ``leg_1.position``. Its ``attrs`` hold score (a dict, see
        `PoseScore`) and events of each leg.

    Raises
    ------
    CommandError
        An argument is not valid, or a leg cannot follow the path. The message names time, leg and margin.
    DescriptionError
        The path is not valid, or a leg has no cylinder with valves.
    SimulationError
        The run cannot continue.

    Examples
    --------
    >>> import pneudrive as pn
    >>> circuit = pn.Circuit.load("examples/tripod.toml")
    >>> run = pn.control.run_pose(circuit, "inversion", reference={"heave": "450 mm; 0.1 s: 455 mm in 0.3 s"})
    >>> run.attrs["score"]["stops_hit"]
    0
    """
    seed = whole_number("seed", seed, 0)
    if dynamics not in ("full", "constant"):
        raise CommandError(f'dynamics = "{dynamics}"', rule='"full" or "constant"')
    platform = platform_of(circuit)
    path = pose_path(reference, platform)
    seconds = path.duration_s if duration is None else positive(duration, "s", "duration")
    needs = demands(platform, path, seconds)
    tunings = leg_tunings(circuit, platform, needs, law, setup, controller)
    read, setup_name = read_setup(tunings[0].setup)
    margins = check_path(platform, tunings, needs)
    legs = _Legs(circuit, platform, path, needs, tunings, read, seconds, dynamics == "full")
    payloads = [payload] if payload is None or isinstance(payload, str) else list(payload)
    watch = Watch(progress, cancel)
    runs = [legs.run(own, mismatch, seed, watch) for own in payloads]
    scores = [legs.score(columns, mass_kg, margins) for columns, mass_kg, _ in runs]
    spread = {str(own): one.coordinates for own, one in zip(payloads, scores, strict=True)} if len(runs) > 1 else {}
    score = replace(scores[0], payload_spread=spread)
    columns, _, events = runs[0]
    shared = provenance_of(circuit, tunings[0], (read, setup_name), path.text, seed)
    provenance = shared | {
        "gains": {one.belief.name: {gain.key: gain.value for gain in one.gains} for one in tunings},
        "dynamics": dynamics,
        "payload": str(payloads[0] or ""),
        INPUTS: inputs_of(circuit),
        "score": score.to_dict(),
        "events": events,
    }
    return Run(columns, provenance, MEANINGS).dataset()


@dataclass(frozen=True)
class _Legs:
    """Platform and controllers along a path, ready to run."""

    circuit: Circuit
    platform: Platform
    path: PosePath
    needs: Demands
    tunings: list[Tuning]
    setup: Setup
    seconds: float
    is_full: bool

    def run(
        self, payload: str | None, mismatch: MismatchOrFile | None, seed: int, watch: Watch
    ) -> tuple[Columns, float, list[Plain]]:
        """Return columns, consumed air (kg) and events of one run with a payload."""
        loaded = json.loads(self.circuit.core_json())
        if payload is not None:
            numbers = next(one["numbers"] for one in loaded["components"] if one["name"] == self.platform.name)
            numbers["payload"] = numbers.get("payload", 0.0) + units.parse(payload, "kg")
        core_json = json.dumps(loaded, sort_keys=True)
        ambient_pa = self.circuit.ambient.pressure_pa
        axes = []
        start: NamedNumbers = {}
        for i, tuning in enumerate(self.tunings):
            setup = self.setup
            if mismatch is not None:
                own, _ = read_mismatch(mismatch)
                drawn = own.drawn(seed, i)
                if i > 0:  # the supply is one for all legs
                    drawn = {key: value for key, value in drawn.items() if not key.startswith("supply")}
                core_json, volume, setup, _ = mismatched(core_json, tuning.plant, setup, own, drawn)
                start |= volume
            motion, efforts = leg_reference(self.needs, i, self.path.text)
            form = motion.core() | ({"efforts": efforts} if self.is_full else {})
            own_setup = setup.core(seed, ambient_pa) | {"step_repeats": 1, "member": i}
            axes.append((tuning.core(), form, own_setup))
        outputs = [name for names in pose_columns(self.platform) for name in names]
        given: dict[str, str] = {}  # at rest on the path, each piston in balance
        for tuning, x in zip(self.tunings, self.needs.legs.positions_m[0].tolist(), strict=True):
            given |= tuning.plant.at_rest(x)
        begun = self.circuit.core_initial(given) | start
        each, poses, mass_kg = run_axes(core_json, begun, axes, outputs, self.seconds, watch)
        columns = {"time_s": each[0]["time_s"]}
        columns |= zip(outputs, map(np.ascontiguousarray, poses.T), strict=True)
        for (key, unit), wanted in zip(self._coordinates(), self.path.at(columns["time_s"])[0].T, strict=True):
            columns[f"{self.platform.name}.{key}_reference_{unit}"] = np.ascontiguousarray(wanted)
        events = []
        for i, (leg, tuning, own) in enumerate(zip(self.platform.legs, self.tunings, each, strict=True)):
            columns |= {f"{leg.name}.{key}": own[key] for key in KEPT}
            needed = np.interp(columns["time_s"], self.needs.times_s, self.needs.legs.forces_n[:, i])
            columns[f"{leg.name}.required_force_n"] = needed
            columns |= {f"{leg.name}.{end}.pressure_pa": own[f"pressure_{end}_pa"] for end in "ab"}
            commands = [f"{name}.command" for name in tuning.plant.valves]
            columns |= {name: own[name] for name in commands if name in own} or {commands[0]: own["command"]}
            events += [{"leg": leg.name} | event for event in told(own["events"])]
        return columns, mass_kg, events

    def score(self, columns: Mapping[str, Array], mass_kg: float, margins: Plain) -> PoseScore:
        """Return the score of a run along the path."""
        time, period = columns["time_s"], self.path.period_s
        scored = time >= (0.0 if period is None else time[-1] - max(LAST_S, period) + 0.5 * time[1])

        def tracked(name: str, of: str, unit: str) -> Tracked:
            wanted = columns[f"{of}_{unit}"][scored]
            error = wanted - columns[f"{name}_{unit}"][scored]
            return Tracked(unit, rms(error), float(np.abs(error).max()), 0.5 * float(np.ptp(wanted)))

        own, legs = self.platform.name, {leg.name: leg.stroke_m for leg in self.platform.legs}
        reached = ((columns[f"{leg}.position_m"], stroke_m) for leg, stroke_m in legs.items())
        hit = [x.min() <= 0.0 or x.max() >= stroke_m for x, stroke_m in reached]
        commands = [columns[f"{valve}.command"] for tuning in self.tunings for valve in tuning.plant.valves]
        supply = supply_of(self.tunings[0].belief.core_json())
        air = air_of(mass_kg, supply, self.circuit)["anr_m3"] / self.seconds
        return PoseScore(
            coordinates={
                key: tracked(f"{own}.{key}", f"{own}.{key}_reference", unit) for key, unit in self._coordinates()
            },
            legs={leg: tracked(f"{leg}.position", f"{leg}.reference", "m") for leg in legs},
            air_per_cycle_anr_m3=None if period is None else air * period,
            air_anr_m3_s=air,
            saturated_share=max(float(np.mean(np.abs(command) >= 1.0)) for command in commands),
            stops_hit=int(sum(hit)),
            **margins,
        )

    def _coordinates(self) -> list[tuple[str, str]]:
        return list(zip(self.platform.coordinates, self.platform.units, strict=True))
