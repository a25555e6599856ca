"""Feasibility of a reference by inverse dynamics, and suitability of controllers by simulated trials."""

from __future__ import annotations

import json
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from pneudrive import _core
from pneudrive.control.loop import prepare, run_prepared
from pneudrive.control.mismatch import OF_VALVE, Mismatch, read_mismatch
from pneudrive.control.motion import NEVER, Reference, rounded_up
from pneudrive.control.references import beyond_stroke
from pneudrive.control.tuning import Tuning, laws
from pneudrive.errors import PneudriveError
from pneudrive.simulation.simulate import require
from pneudrive.views import VALUE, Finding, LeadingValue, ShownValue, State, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pneudrive.control.setup import Setup
    from pneudrive.simulation.start import DriveOrCircuit

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
        Largest required opening as a fraction of the full opening; infinite if no opening gives the force.
    valve_at_s : float
    valve_exceeded_s : float
        Time for which the full opening would not suffice.
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
        Components that the model does not include, see `Plant`. The fractions ignore their effect.
    """

    reference: Reference
    demand: Demand
    factor: float | None
    stroke_m: float
    speeds_m_s: tuple[float, float]
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
        shares = (
            ("largest speed", own.speed_share, speed),
            ("valve", own.valve_share, valve),
            ("force", own.force_share, force),
        )
        passed: State = "open" if self.left_out else "good"
        leading = [
            LeadingValue(ShownValue(name, name, VALUE, text), state="bad" if share > SHARE else passed)
            for name, share, text in shares
        ]
        positions = f"{1e3 * reach.lowest_m:g} .. {1e3 * reach.highest_m:g} mm of {1e3 * self.stroke_m:g} mm"
        texts = {"positions": positions}
        if self.reference.points_missed_m is not None:
            texts["points missed by"] = f"{1e6 * self.reference.points_missed_m:.3g} um at most"
        if self.left_out:
            texts["left out"] = ", ".join(self.left_out)
        rows = [ShownValue(name, name, VALUE, text) for name, text in texts.items()]
        state = passed if self.factor == 1.0 else "bad"
        return View(
            self.reference.text,
            (*rows, *(value.value for value in leading)),
            state=state,
            leading=leading,
            findings=(Finding(f"Feasible: {self._verdict()}", state),),
        )

    def _verdict(self) -> str:
        limit = f"{100.0 * SHARE:.0f} % of each limit"
        if self.is_feasible:
            return f"yes: it takes at most {limit}"
        if self.left_out:
            limit += f" of a model without {', '.join(self.left_out)}"
        if self.factor == 1.0:
            return f"not decided: it takes at most {limit}; pneudrive control run shows the error with them"
        beyond = beyond_stroke(self.reference, self.stroke_m)
        if beyond is not None:
            return f"no: {beyond[0]}; {beyond[1]}"
        if self.factor is None:
            return f"no, at no speed: it always takes more than {limit}"
        slower = self.reference.stretched(self.factor)
        written = "" if slower.pieces else f", as {slower.text}"  # polynomials have no text
        kept = f"slowed by a factor of {rounded_up(self.factor):g}{written}, it takes at most {limit}"
        return f"no: {kept}; pneudrive control run shows the error at full speed"


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share < 1e3 else "more than all"


def _asked(tuning: Tuning, reference: Reference) -> tuple[Demand, float | None]:
    """Return the demands of a reference and its smallest time stretching; None if stretching does not help."""
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

    Inverse dynamics: the piston of the controller's model follows the reference exactly, and the gas is simulated with
    the valve opening that produces the required force.

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
ALONG, MOST, MASSES = "R3", 0.1, {"as described": 1.0, "with 0.5 of its mass": 0.5}
BASELINES = ("pid", "fuzzy")
#: Longest tried additional dead time, s, number of bisections, and dead time that a controller should tolerate, s
#: (assumed).
LONGEST_LAG_S, HALVINGS, ENOUGH_LAG_S = 8e-3, 5, 1e-3
#: Advice for determining the parameters of a valve.
FIND_DELAY = """pneudrive identify DRIVE RECORDING --sensor "command: delay = free" finds it in a recording."""
SLOWER = f"Measure the dead time of the valve with its electronics. {FIND_DELAY}"
FIND_SHAPE = "pneudrive identify DRIVE RECORDING --free valve.overlap,valve.leakage finds two of them in a recording."
CYCLE = "limit-cycle"


def suitability(drive: DriveOrCircuit, setup: Setup | str | Path = "real") -> View:
    """Try each controller on a drive along R3, with the described mass and with half of it.

    Parameters
    ----------
    drive : Drive or Circuit
    setup : Setup, str or path-like
        Sensors and converter.

    Returns
    -------
    View
        Whether each controller suits the drive, with the reason; the best one comes first.
    """
    valves = [one.kind for one in drive.circuit.components.values() if one.kind.startswith("valve/")]
    unfit = "" if valves == ["valve/proportional-5/3"] else "; cannot be exported for these valves"
    tried = []
    for law in laws():
        trials = {of: _trial(drive, law, setup, {"moving_mass": mass}) for of, mass in MASSES.items()}
        faults = [f"{of} it {fault}" for of, (_, fault) in trials.items() if fault]
        error_m = max(error_m for error_m, _ in trials.values())
        export = unfit or ("; exported as an FMU only" if law == "nmpc" else "")
        reason = faults[0] if faults else f"errors up to {1e3 * error_m:.3g} mm{export}"
        tried.append((bool(faults), law in BASELINES, error_m, law, reason))
    rows = [
        ShownValue(f"{law}.{name}", law, name, text)
        for has_failed, is_baseline, _, law, reason in sorted(tried)
        for name, text in (
            ("suits", "does not suit" if has_failed else "suits"),
            ("because", f"a baseline: {reason}" if is_baseline and not has_failed else reason),
        )
    ]
    title = f"Each controller along {ALONG}, as described and with half of the mass, simulated; best first"
    return View(title, rows, state="bad" if all(has_failed for has_failed, *_ in tried) else "good")


def _trial(
    drive: DriveOrCircuit,
    controller: Tuning | str,
    setup: Setup | str | Path,
    deviations: Mapping[str, float | str],
) -> tuple[float, str]:
    """Run a drive that deviates from its description; return the largest error, m, and why it failed, or ""."""
    mismatch = Mismatch.model_validate(deviations)
    law, tuning = (controller, None) if isinstance(controller, str) else (None, controller)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            prepared = prepare(drive, law, ALONG, setup=setup, controller=tuning, mismatch=mismatch)
            told = run_prepared(prepared, seed=1).provenance
        except PneudriveError as error:
            return float("inf"), f"cannot run: {error.what}"
    reach, error_m = prepared.reference.reach(), float(told["score"]["max_error_m"])
    if told["score"]["lost"]:
        return error_m, "is lost"
    if any(event["kind"] == CYCLE for event in told["events"]):
        return error_m, "oscillates"
    misses = error_m > MOST * (reach.highest_m - reach.lowest_m)
    return error_m, f"misses by {1e3 * error_m:.3g} mm" if misses else ""


def view_of_lag(drive: DriveOrCircuit, tuning: Tuning, setup: Setup | str | Path) -> View | None:
    """Return the additional dead time that the controller tolerates, and the possible effect of zero valve parameters.

    Parameters
    ----------
    drive : Drive or Circuit
    tuning : Tuning
    setup : Setup, str or path-like
        Sensors and converter.

    Returns
    -------
    View or None
        The margin is found by bisection with runs along R3. Parameters that are zero are set to the unfavourable end of
        their range in the spread `standard`. None if the valve has no spool.
    """
    ranges = read_mismatch("standard")[0].ranges
    law, valve = tuning.law, tuning.plant.valves[0]
    components = json.loads(tuning.belief.core_json())["components"]
    numbers = next(own["numbers"] for own in components if own["name"] == valve)
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
    return View(f"Valve slower than described, or not ideal, {law}, simulated", findings=findings)
