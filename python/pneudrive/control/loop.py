"""Control of a drive along a reference: feasibility by inverse dynamics, suitability of controllers, and runs."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive import _core
from pneudrive.arrays import Array, NamedNumbers, Pair, Plain, attributes_of
from pneudrive.control.mismatch import OF_VALVE, Mismatch, MismatchOrFile, mismatched, read_mismatch
from pneudrive.control.motion import NEVER, beyond_stroke, check_reach, named_or_read, rounded_up
from pneudrive.control.scores import air_of, score_of
from pneudrive.control.setup import CHANNEL_UNITS, Setup, SetupOrFile, read_setup, ready_setups, told
from pneudrive.control.tuning import Controller, ControllerOrFile, Plant, Tuning, laws, supply_of, tune
from pneudrive.describe.system import System
from pneudrive.errors import CommandError, PneudriveError, SimulationError, warn
from pneudrive.files.inputs import INPUTS, inputs_of
from pneudrive.platforms import is_platform
from pneudrive.progress import UNWATCHED, Flag, Progress, Watch
from pneudrive.simulation.simulate import Run, made_from, positive, require, whole_number
from pneudrive.simulation.trajectory import meaning
from pneudrive.views import VALUE, Finding, ShownValue, State, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    import xarray as xr

    from pneudrive.control.motion import Reference, ReferenceOrFile
    from pneudrive.control.own_law import RunningLaw
    from pneudrive.describe import Circuit
    from pneudrive.simulation.start import DriveOrCircuit, StartState


#: Fraction of each limit up to which a reference counts as feasible (assumed).
SHARE = 0.85
_PERIODS = 3.0  # periods of a sine that are checked, with the first one
_SEEN_S = 0.2  # behind the last move
_TRIES = 8  # margin of a suggested factor


class Demand(NamedTuple):
    """Largest demands of a reference on a drive.

    Attributes
    ----------
    valve_share : float
        Largest required opening as a fraction of the full opening; infinite if no opening gives the required force.
    valve_at_s : float
        Time at which the largest opening is required.
    valve_exceeded_s : float
        Total time in which the full opening does not suffice.
    force_share : float
        Largest pressure force as a fraction of the force with one chamber at supply and one at ambient pressure.
    speed_share : float
        Largest speed as a fraction of the steady speed at full opening in its direction.
    lowest_pressure_pa, highest_pressure_pa : float
        Pressures in the chambers, absolute.
    """

    valve_share: float
    valve_at_s: float
    valve_exceeded_s: float
    force_share: float
    speed_share: float
    lowest_pressure_pa: float
    highest_pressure_pa: float


@dataclass(frozen=True, repr=False)
class Feasibility(Viewed):
    """Whether a drive can follow a reference.

    Attributes
    ----------
    reference : Reference
    demand : Demand
        Demand of the unslowed reference.
    factor : float or None
        Smallest stretching of the time axis at which the reference needs at most 85 % of valve, force and speed. 1:
        feasible as given. None: no factor helps, for instance because the reference leaves the stroke.
    stroke_m : float
    speeds_m_s : pair of float
        Steady speeds of the drive at full opening in +x and in -x.
    left_out : tuple of str
        Components that the model does not include, see `Plant`. The fractions ignore the effect of these components.
    """

    reference: Reference
    demand: Demand
    factor: float | None
    stroke_m: float
    speeds_m_s: Pair
    left_out: tuple[str, ...] = ()

    @property
    def is_feasible(self) -> bool:
        """Whether the unslowed reference stays within the stroke and uses at most 85 % of each limit.

        False if the model leaves out components, because the limits may then be lower.
        """
        return self.factor == 1.0 and not self.left_out

    def view(self) -> View:
        """Return a view: positions, the fraction of each limit, and whether the drive can follow."""
        reach, own = self.reference.reach(self.speeds_m_s), self.demand
        low, high = (1e-5 * p for p in (own.lowest_pressure_pa, own.highest_pressure_pa))
        speed = f"{reach.fastest_m_s:.3g} m/s at {reach.at_s:.3g} s, {_percent(own.speed_share)} of the drive's"
        force = f"{_percent(own.force_share)} of the supply's; pressures {low:.3g} .. {high:.3g} bar abs"
        valve = f"{_percent(own.valve_share)} of its opening at {own.valve_at_s:.3g} s"
        if own.valve_exceeded_s:
            valve += f"; more than the full opening for {1e3 * own.valve_exceeded_s:.2g} ms in all"
        positions = f"{1e3 * reach.lowest_m:g} .. {1e3 * reach.highest_m:g} mm of {1e3 * self.stroke_m:g} mm"
        texts = {"positions": positions}
        if self.reference.points_missed_m is not None:
            texts["points missed by"] = f"{1e6 * self.reference.points_missed_m:.3g} um at most"
        if self.left_out:
            texts["left out"] = ", ".join(self.left_out)
        texts |= {"largest speed": speed, "valve": valve, "force": force}
        rows = [ShownValue(name, name, VALUE, text) for name, text in texts.items()]
        passed: State = "open" if self.left_out else "good"
        shares = zip(rows[-3:], (own.speed_share, own.valve_share, own.force_share), strict=True)
        leading = [replace(row, state="bad" if share > SHARE else passed) for row, share in shares]
        limit = f"{100.0 * SHARE:.0f} % of each limit"
        model = f"{limit} of a model without {', '.join(self.left_out)}" if self.left_out else limit
        beyond = beyond_stroke(self.reference, self.stroke_m)
        if self.is_feasible:
            verdict = f"yes: the reference needs at most {limit}"
        elif self.factor == 1.0:
            verdict = f"not decided: at most {model} is needed; pneudrive control run shows the error with these parts"
        elif beyond is not None:
            verdict = f"no: {beyond[0]}; {beyond[1]}"
        elif self.factor is None:
            verdict = f"no: at any speed, the reference needs more than {model}"
        else:
            slower = self.reference.stretched(self.factor)
            as_text = "" if slower.pieces else f", as {slower.text}"  # polynomials have no text
            slowed = f"slowed by a factor of {rounded_up(self.factor):g}{as_text}, the reference needs at most {model}"
            verdict = f"no: {slowed}; pneudrive control run shows the error at full speed"
        state = passed if self.factor == 1.0 else "bad"
        findings = [Finding(f"Feasible: {verdict}", state)]
        return View(self.reference.text, rows, state=state, leading=leading, findings=findings)


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share < 1e3 else "more than 100 %"


def _asked(tuning: Tuning, reference: Reference) -> tuple[Demand, float | None]:
    """Return the demands of a reference, and the smallest factor of time that makes the reference feasible, or None."""
    seen_s = (
        _PERIODS / reference.frequency_hz if reference.is_sine else reference.duration_s - reference.rest_s + _SEEN_S
    )
    form = json.dumps(tuning.core())
    demand, factor = _core.control_feasibility(form, json.dumps(reference.core()), seen_s, SHARE)
    share = reference.reach(tuning.speeds_m_s).share
    slowed = None if factor is None or share > NEVER else max(factor, share / SHARE)
    return Demand(**demand, speed_share=share), slowed


def feasibility(tuning: Tuning, reference: Reference) -> Feasibility:
    """Return the demands of a reference on a drive, and the slowdown that makes the reference feasible.

    The demands follow from inverse dynamics. The piston of the controller's model follows the reference exactly. The
    gas is simulated with the valve opening that produces the required force.

    Parameters
    ----------
    tuning : Tuning
        From `pneudrive.control.tune`.
    reference : Reference

    Examples
    --------
    >>> import pneudrive as pn
    >>> tuning = pn.control.tune(pn.Drive.load("catalogue:reference"))
    >>> found = pn.control.feasibility(tuning, pn.control.reference("250 mm; 1 s: 400 mm in 0.1 s"))
    >>> found.is_feasible, found.factor > 1.0
    (False, True)
    """
    require(tuning, "plant", "tuning", "pn.control.tune(drive)")
    require(reference, "is_sine", "reference", 'pn.control.reference("250 mm; 1 s: 280 mm in 0.3 s")')
    demand, factor = _asked(tuning, reference)
    if beyond_stroke(reference, tuning.plant.stroke_m) is not None:
        factor = None
    for _ in range(_TRIES):  # after slowing and rounding, its peaks are between other steps
        if factor is None or factor == 1.0:
            break
        _, more = _asked(tuning, reference.stretched(factor))
        if more is None or more == 1.0:
            break
        factor *= more
    return Feasibility(reference, demand, factor, *tuning.reach, tuple(tuning.plant.left_out))


# --- Choice of a controller: each is tried on the drive as described and with half of its mass.

#: Reference of the trial, largest error as a fraction of its travel, and factors on the mass (assumed).
ALONG, MOST, MASSES = "R3", 0.1, {"as described": 1.0, "with half of its mass": 0.5}
BASELINES = ("pid", "fuzzy")
#: Additional dead time: longest tried value, s, number of bisections, and value that a controller should tolerate, s
#: (assumed).
LONGEST_LAG_S, HALVINGS, ENOUGH_LAG_S = 8e-3, 5, 1e-3
#: Advice for determining the parameters of a valve.
FIND_DELAY = """pneudrive identify DRIVE RECORDING --sensor "command: delay = free" identifies it from a recording."""
SLOWER = f"Measure the dead time of the valve with its electronics. {FIND_DELAY}"
FIND_SHAPE = "pneudrive identify DRIVE RECORDING --free valve.overlap,valve.leakage identifies overlap and leakage."
CYCLE = "limit-cycle"


def suitability(drive: DriveOrCircuit, setup: SetupOrFile = "real") -> View:
    """Try each controller on a drive along the reference R3, with the described mass and with half of it.

    Parameters
    ----------
    drive : Drive or Circuit
    setup : Setup, str or path-like
        Sensors and converter.

    Returns
    -------
    View
        Whether each controller suits the drive, with the reason. Suitable controllers come first, in ascending order
        of their errors.
    """
    valves = [one.kind for one in drive.circuit.components.values() if one.kind.startswith("valve/")]
    unfit = "" if valves == ["valve/proportional-5/3"] else "; cannot be exported for these valves"
    tried = []
    for law in laws():
        trials = {of: _trial(drive, Controller(law=law), setup, {"moving_mass": mass}) for of, mass in MASSES.items()}
        faults = [f"{of} it {fault}" for of, (_, fault) in trials.items() if fault]
        error_m = max(error_m for error_m, _ in trials.values())
        export = unfit or ("; exported as an FMU only" if law == "nmpc" else "")
        reason = faults[0] if faults else f"errors up to {1e3 * error_m:.3g} mm{export}"
        tried.append((bool(faults), error_m, law, reason))
    rows = [
        ShownValue(f"{law}.{name}", law, name, text)
        for has_failed, _, law, reason in sorted(tried)
        for name, text in (
            ("suits", "does not suit" if has_failed else "suits"),
            ("because", f"a baseline: {reason}" if law in BASELINES and not has_failed else reason),
        )
    ]
    title = f"Each controller along {ALONG}, as described and with half of the mass, simulated; smallest error first"
    return View(title, rows, state="bad" if all(has_failed for has_failed, *_ in tried) else "good")


def _trial(
    drive: DriveOrCircuit,
    controller: Tuning | Controller,
    setup: SetupOrFile,
    deviations: Mapping[str, float | str],
) -> tuple[float, str]:
    """Run a drive that deviates from its description. Return the largest error (m) and the fault, if any."""
    mismatch = Mismatch.model_validate(deviations)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            prepared = prepare(drive, None, ALONG, setup=setup, controller=controller, mismatch=mismatch)
            told = run_prepared(prepared, seed=1).provenance
        except PneudriveError as error:
            return float("inf"), f"cannot run: {error.what}"
    reach, error_m = prepared.reference.reach(), told["score"]["max_error_m"]
    if told["score"]["lost"]:
        return error_m, f"loses the reference (error {1e3 * error_m:.3g} mm)"
    if any(event["kind"] == CYCLE for event in told["events"]):
        return error_m, "oscillates"
    misses = error_m > MOST * (reach.highest_m - reach.lowest_m)
    return error_m, f"misses the reference by {1e3 * error_m:.3g} mm" if misses else ""


def view_of_lag(drive: DriveOrCircuit, tuning: Tuning, setup: SetupOrFile) -> View | None:
    """Return the additional dead time that the controller tolerates, and the effect of valve parameters given as zero.

    Parameters
    ----------
    drive : Drive or Circuit
    tuning : Tuning
    setup : Setup, str or path-like
        Sensors and converter.

    Returns
    -------
    View or None
        The additional dead time is found by bisection with runs along R3. Parameters that are zero are set to the
        unfavourable end of their range in the spread `standard`. None if the valve has no spool.
    """
    ranges = read_mismatch("standard")[0].ranges
    law, valve = tuning.law, tuning.plant.valves[0]
    numbers = tuning.belief.core_parts[valve]["numbers"]
    if "overlap" not in numbers:
        return None
    low_s, high_s = 0.0, LONGEST_LAG_S
    for _ in range(HALVINGS):
        middle_s = 0.5 * (low_s + high_s)
        _, fault = _trial(drive, tuning, setup, {"delay": f"{numbers['delay'] + middle_s} s"})
        low_s, high_s = (low_s, middle_s) if fault else (middle_s, high_s)
    text = f"{law} tolerates {1e3 * low_s:.2g} ms more dead time than described along {ALONG}."
    findings = [Finding(text) if low_s >= ENOUGH_LAG_S else Finding(text, "open", SLOWER)]
    texts = {key: f"{ranges[name][1]:g}" for name, key in OF_VALVE.items() if numbers[key] == 0.0}
    if "delay" in texts:
        texts["delay"] += " s"
    if texts.pop("frequency", None):  # a slow spool costs most
        texts["spool_frequency"] = f"{ranges['spool_frequency_hz'][0]:g} Hz"
    if texts:
        errors = [f"{1e3 * _trial(drive, tuning, setup, each)[0]:.3g} mm" for each in ({}, texts)]
        listed = ", ".join(map(" ".join, texts.items()))
        cost = (
            f"{valve}: the largest error along {ALONG} is {errors[0]}, and {errors[1]} with {listed} instead of zero."
        )
        findings.append(Finding(cost, "open", f"Take them from the data sheet. {FIND_SHAPE}"))
    return View(f"{law} with a valve that is slower than described or not ideal, simulated", findings=findings)


# --- A drive under control along a reference. The core runs the sampled loop; this module prepares and labels it.

MOST_SAMPLES = 20_000_000
RTOL = 1e-5
#: A warning is given if a reference misses its points by more than this distance, m, or the sensor's step (assumed).
LEAST_MISSED_M = 1e-5
#: Meaning of the columns that only a run under control has.
MEANINGS = {
    "reference_m": "reference position",
    "command": "command of the law, as it leaves the converter",
    "estimated_velocity_m_s": "velocity, estimated by the law's observer",
    "disturbance_n": "force that the law's model does not explain, estimated by its observer",
    "holds": "1 while the law holds the drive at rest",
    "step_time_s": "time that a step of the law took on this machine",
    "least_step_time_s": "shortest time of this step in repeated runs on this machine",
}


class Prepared(NamedTuple):
    """All inputs that determine a run under control, except its seed.

    `plant` is the simulated drive as described. `core_json`, `start` and `setup` have the deviations of the mismatch.
    `warnings` list inputs without effect, or with an unexpected effect.
    """

    circuit: Circuit
    tuning: Tuning
    plant: Plant
    reference: Reference
    setup: Setup
    setup_name: str
    start: NamedNumbers
    duration_s: float
    core_json: str
    deviations: NamedNumbers
    mismatch: str = ""
    warnings: tuple[str, ...] = ()
    step_repeats: int = 1


def run(
    drive: DriveOrCircuit,
    law: object = None,
    *,
    reference: ReferenceOrFile,
    setup: SetupOrFile | None = None,
    duration: str | float | None = None,
    seed: int = 1,
    controller: ControllerOrFile | Tuning | None = None,
    believes: DriveOrCircuit | None = None,
    mismatch: MismatchOrFile | None = None,
    initial: StartState = None,
    allow_code: str | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate a drive under control along a reference. Supplied controllers and the drive use the same equations.

    Parameters
    ----------
    drive : Drive or Circuit
        Drive to simulate.
    law : str or object, optional
        A name in `pneudrive.control.laws`, by default ``"nmpc"``; the gains of this law follow from the drive. A custom
        law is a class, or an object of a class, with ``inputs``, a list of names in `pneudrive.control.signals`, and
        ``step(t, sample, preview)``, which returns the command. If the law has ``start(model, period)``, this method is
        called before a run. ``"mine.py:Law"`` names such a class.
    reference : Reference, str or path-like
        See `pneudrive.control.reference`; or the name of a standard reference, ``"R1"`` to ``"R6"``.
    setup : Setup, str or path-like, optional
        Sensors, converter and computer: ``"ideal"``, ``"real"``, ``"cheap"``, or a TOML file. Default: the setup of
        the controller, otherwise ``"real"``.
    duration : str or float, optional
        ``"12 s"``, or a number of seconds. Default for a sine: the longer of 16 s and four periods. Default for
        moves: until 2 s after the last move.
    seed : int
        Seed of all noise. Runs with the same seed have bit-identical results, except for step times.
    controller : Controller, Tuning, str or path-like, optional
        Instead of `law`: a controller, its TOML file, or the result of `pneudrive.control.tune`.
    believes : Drive or Circuit, optional
        Drive that the law assumes; by default the drive of the controller file, or `drive`.
    mismatch : Mismatch, str or path-like, optional
        Deviation of the simulated drive from `drive`: ``"all"``, ``"mass+30"`` or another name in
        `pneudrive.control.ready_mismatches`, or a TOML file.
    initial : Initial, dict or str, optional
        Start state. Default: at rest at the reference's first position, with both pressures near the mean of supply and
        ambient pressure and in balance.
    allow_code : str, optional
        SHA-256 of the file of a custom law; required if only the controller file names this law.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimension time, one entry for each sample of the law; position, velocity, pressure_a, pressure_b, reference,
        command, estimated_velocity, disturbance, holds, step_time, least_step_time, each with ``units`` and
        ``long_name``. Its ``attrs`` hold score (a dict, see `pneudrive.control.Score`), events (reported by the
        supervisor: time_s, kind, value, unit, text), law_failure (if a custom law failed and another law took
        over), law, gains, factors, period_s, samples, setup, mismatch, deviations, seed, reference, motion,
        air, belief_hash, points_missed_m (for a reference made of points), and the attributes of the description as in
        `pneudrive.simulate`.

    Raises
    ------
    CommandError
        The reference, the duration or the seed is not valid, or the drive cannot follow the reference.
    DescriptionError
        A file is not valid, or the law cannot command the drive.
    SimulationError
        The simulation cannot continue, or a custom law fails (`OwnLawError`). The message gives time and state.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:reference")
    >>> run = pn.control.run(drive, "inversion", reference="250 mm; 0.1 s: 260 mm in 0.2 s", duration="0.5 s")
    >>> run.sizes["time"], run.disturbance.attrs["units"], run.attrs["score"]["lost"]
    (501, 'N', False)
    """
    told: Plain = {"setup": setup, "duration": duration, "controller": controller, "believes": believes}
    prepared = prepare(drive, law, reference, **told, mismatch=mismatch, initial=initial, allow_code=allow_code)
    return run_prepared(prepared, seed, Watch(progress, cancel)).dataset()


def prepare(
    drive: DriveOrCircuit,
    law: object,
    along: ReferenceOrFile,
    *,
    setup: SetupOrFile | None = None,
    duration: str | float | None = None,
    controller: ControllerOrFile | Tuning | None = None,
    believes: DriveOrCircuit | None = None,
    mismatch: MismatchOrFile | None = None,
    initial: StartState = None,
    allow_code: str | None = None,
) -> Prepared:
    """Read and check all inputs that determine a run, except its seed, and warn.

    Arguments and errors are those of `run`.
    """
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    if is_platform(drive.circuit):
        raise CommandError(f"{drive.circuit.name} has a platform", remedy="Call pn.control.run_pose.")
    if believes is not None:
        require(believes, "core_json", "believes", 'pn.Drive.load("drive.toml")')
    if isinstance(controller, Tuning):
        tuning = controller
        for name in (name for name, one in (("law", law), ("believes", believes)) if one is not None):
            raise CommandError.of("control.beside_tuning", name=name, law=tuning.law, drive=tuning.belief.name)
    else:
        tuning = tune(drive, law, setup=setup, controller=controller, believes=believes, allow_code=allow_code)
    read, name = read_setup(tuning.setup if setup is None else setup)
    parts = {f"sensors.{name}": getattr(read.sensors, name) for name in CHANNEL_UNITS} | {"computer": read.computer}
    for key, part in parts.items():  # with a jitter of one period or more, samples could change their order
        if part is not None and not part.jitter_s < tuning.period_s:
            jitter = {"jitter_ms": 1e3 * part.jitter_s, "period_ms": 1e3 * tuning.period_s}
            raise CommandError.of("control.jitter", name=key, **jitter)
    circuit = drive.circuit
    to_follow = named_or_read(along, *tuning.reach)
    is_another = tuning.belief.core_json() != circuit.core_json()
    plant = tune(drive, setup=read).plant if is_another else tuning.plant
    check_reach(to_follow, min(plant.stroke_m, tuning.plant.stroke_m), tuning.speeds_m_s)
    seconds = to_follow.duration_s if duration is None else positive(duration, "s", "duration")
    samples = seconds / tuning.period_s
    if not 1.0 <= round(samples) <= MOST_SAMPLES:
        what = f"duration = {seconds:g} s at a period of {1e3 * tuning.period_s:g} ms gives {samples:.3g} samples"
        raise CommandError(what, rule=f"1 to {MOST_SAMPLES:.0e} samples")
    names, given = circuit.start_names, dict(drive.circuit_values(initial))
    usual = plant.at_rest(float(to_follow.at([0.0])[0, 0]))
    taken = {names.get(key) for key in given}
    start = circuit.core_initial({key: value for key, value in usual.items() if names[key] not in taken} | given)
    prepared = Prepared(circuit, tuning, plant, to_follow, read, name, start, seconds, circuit.core_json(), {})
    unseen = ""
    if mismatch is not None:
        own, called = read_mismatch(mismatch)
        wide = next((key for key, (low, high) in own.ranges.items() if low < high), None)
        if wide is not None:
            raise CommandError.of("control.spread", name=called, key=wide)
        drawn = own.drawn(0, 0)
        prepared = deviating(prepared, own, drawn)._replace(mismatch=called)
        unseen = next(iter(drawn.keys() - prepared.deviations.keys()), "").removesuffix("_b")
    warnings = tuple(_warnings(prepared, unseen))
    for said in warnings:
        warn(said)
    return prepared._replace(warnings=warnings)


def deviating(prepared: Prepared, mismatch: Mismatch, drawn: NamedNumbers) -> Prepared:
    """Return the inputs of a run whose drive deviates by the sampled values of a mismatch."""
    core_json, volume, setup, true = mismatched(prepared.core_json, prepared.plant, prepared.setup, mismatch, drawn)
    return prepared._replace(core_json=core_json, start=prepared.start | volume, setup=setup, deviations=true)


def _warnings(prepared: Prepared, unseen: str) -> Iterator[str]:
    """Yield warnings of a run: inputs without effect, or with an unexpected effect. Reject switches outside the stroke.

    `unseen` is the name of a deviation of pressure sensors, if the setup has no pressure sensors.
    """
    along, setup, stroke_m = prepared.reference, prepared.setup, prepared.plant.stroke_m
    least = max(setup.sensors.position.resolution_m or 0.0, LEAST_MISSED_M)
    if along.points_missed_m is not None and along.points_missed_m > least:
        missed = f"the curve of the reference misses its points by up to {1e3 * along.points_missed_m:.3g} mm"
        yield f"{along.text}: {missed}; errors refer to the curve"
    if setup.switches is not None:
        low_m, high_m = setup.switches.low_m, setup.switches.high_m
        said = f"setup: switches from {1e3 * low_m:g} mm to {1e3 * high_m:g} mm"
        if not (low_m < stroke_m and high_m > 0.0):
            rule = f"their range must include a part of the stroke, 0 mm to {1e3 * stroke_m:g} mm"
            raise CommandError(said, rule=rule)
        reach = along.reach()
        if not low_m <= reach.lowest_m <= reach.highest_m <= high_m:
            leads = f"{1e3 * reach.lowest_m:g} mm to {1e3 * reach.highest_m:g} mm"
            yield f"{said}: the reference goes from {leads}; beyond a switch, only commands that lead back are allowed"
    if unseen:
        yield f"mismatch {prepared.mismatch}: {unseen} has no effect: the setup has no pressure sensors"
    yield from setup.short_of(supply_of(prepared.core_json)[0], prepared.circuit.ambient.pressure_pa)
    end_s = prepared.duration_s
    for name, entries in (("disturbances", setup.disturbances), ("faults", setup.faults)):
        late = [one.at_s for one in entries if one.at_s >= end_s]
        if late:
            yield f"{name}: the entry at {min(late):g} s has no effect, because the run ends at {end_s:g} s"


def run_prepared(prepared: Prepared, seed: int, watch: Watch = UNWATCHED) -> Run:
    """Simulate a prepared run. Return its columns without labels, with provenance and score."""
    seed = whole_number("seed", seed, 0)
    circuit, tuning, motion = prepared.circuit, prepared.tuning, prepared.reference.core()
    ambient_pa, seconds = circuit.ambient.pressure_pa, prepared.duration_s
    setup = prepared.setup.core(seed, ambient_pa) | {"step_repeats": prepared.step_repeats}
    watch.look()
    own = None if tuning.own is None else tuning.own.begin(tuning, motion)
    axes = [(tuning.core(), motion, setup)]
    (columns,), _, mass_kg = run_axes(prepared.core_json, prepared.start, axes, [], seconds, watch, own)
    events = told(columns.pop("events", []))
    named = {meaning(column)[0]: values for column, values in columns.items()}
    air = air_of(mass_kg, supply_of(prepared.core_json), circuit)
    model, reference = tuning.belief.name, prepared.reference
    made = {
        "points_missed_m": reference.points_missed_m,
        "model": None if model == circuit.name else model,
        "law_failure": None if own is None or own.failure is None else str(own.failure),  # the standby law took over
        **provenance_of(circuit, tuning, (prepared.setup, prepared.setup_name), reference.text, seed),
        "factors": tuning.controller.factors.to_dict(),
        "belief_hash": tuning.belief.description_hash,
        **attributes_of(prepared, "mismatch", "deviations"),
        "motion": motion,
        "air": air,
        "score": score_of(named["time"], named, motion, air).to_dict(),
        "events": events,
        "samples": len(named["time"]),
    }
    return Run(columns, {key: value for key, value in made.items() if value is not None}, MEANINGS)


def run_axes(
    core_json: str,
    start: NamedNumbers,
    axes: Sequence[tuple[Any, Any, Any]],
    outputs: list[str],
    seconds: float,
    watch: Watch,
    own: RunningLaw | None = None,
) -> tuple[list[Plain], Array, float]:
    """Run axes of one circuit under control. Return the columns of each axis, the outputs, and the consumed air (kg).

    Parameters
    ----------
    core_json : str
        Circuit in the core's form.
    start : mapping
    axes : sequence of tuple
        Controller, motion and instrumentation of each axis in the core's form.
    outputs : list of str
        Further columns of the circuit.
    seconds : float
    watch : Watch
    own : RunningLaw, optional
        Custom law; only for a single axis.
    """
    try:
        return _core.control_run(
            System(core_json).compiled(),
            start,
            [(json.dumps(law), json.dumps(motion), json.dumps(setup)) for law, motion, setup in axes],
            outputs,
            seconds,
            RTOL,
            lambda t: watch.tell(t, seconds, "seconds simulated"),
            None if own is None else (own.call, own.signals),
        )
    except ValueError as error:
        raise CommandError(f"the run cannot begin: {error}") from None
    except RuntimeError as error:
        if own is not None and own.failure is not None:
            raise own.failure from own.failure.__cause__
        raise SimulationError(str(error)) from None
    finally:
        if own is not None and own.stopped is not None:
            raise own.stopped


def provenance_of(
    circuit: Circuit,
    tuning: Tuning,
    setup: tuple[Setup, str],
    reference: str,
    seed: int,
) -> Plain:
    """Return the entries of provenance that are common to runs of an axis and of a platform."""
    read, name = setup
    assumed = [f"setup {name}: {read.about}"] if name in ready_setups() else []
    return made_from(circuit, RTOL) | {
        "law": tuning.law,
        "gains": {gain.key: gain.value for gain in tuning.gains},
        "period_s": tuning.period_s,
        "setup": name,
        "seed": seed,
        "reference": reference,
        "simulated": "yes",
        "citations": list(circuit.cited),
        "assumed": [*circuit.assumed(), *assumed, "thresholds and times of the supervisor"],
        "labels": dict(circuit.labels),
        INPUTS: inputs_of(tuning.belief),
    }
