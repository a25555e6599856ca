"""Score of a run under control: error of the drive along its reference, and the effort."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.control.motion import ReferenceMove, moves_of, ways_of
from pneudrive.describe.tables.parts import anr_density_kg_m3
from pneudrive.errors import CommandError, package_table
from pneudrive.estimate.estimates import rms
from pneudrive.simulation.trajectory import attributes
from pneudrive.views import VALUE, Finding, ShownTable, ShownValue, State, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping

    import xarray as xr

    from pneudrive.arrays import Array, Keyed, NamedNumbers, Pair, Plain
    from pneudrive.describe.circuit import Circuit

#: Initial time that is scored separately, and final time of a sine that is scored, s.
FIRST_S, LAST_S = 4.0, 4.0
REST_S, HUNTING_S = 0.2, 0.6  # ends of a dwell in which rest and hunting are measured
ROUNDING_S = 1e-9  # rounding of times that are sums
LEAST_DWELL = 2  # least samples of a dwell: the next move may begin at the end of one
LONG_DWELL_S = 10.0  # hunting is measured after this time, in dwells that last longer
BANDS_M = {"settling_100_um_s": 1e-4, "settling_500_um_s": 5e-4, "settling_1000_um_s": 1e-3}
SLIP_M_S = 1e-3  # speed above which a motion in a dwell counts as a slip
LOST_M = 0.02  # a run with a larger error is lost


@dataclass(frozen=True, repr=False)
class Score(Viewed):
    """Score of a run; error is reference minus position.

    None marks a measure that does not apply to the reference. A time is infinite if its event never occurs.

    Attributes
    ----------
    rmse_m, max_error_m : float
        RMS and largest absolute error: for moves, in the whole run; for a sine, in its last 4 s or last period.
    first_rmse_m, first_max_error_m : float
        RMS and largest absolute error in the first 4 s.
    settling_100_um_s, settling_500_um_s, settling_1000_um_s : float or None
        Longest time from the end of a move until the error stays within 0.1, 0.5 or 1 mm.
    rest_error_m : float or None
        Mean absolute error in the last 0.2 s before the next move; the largest of all moves.
    hunting_m : float or None
        Largest peak-to-peak position in the last 0.6 s before the next move. In a rest longer than 10.6 s, the span
        begins 10 s after the end of the move.
    slips : int or None
        Number of times that the speed rose above 1 mm/s in the spans of `hunting_m`.
    overshoot_m : float or None
        Largest overshoot beyond the end of a move, or beyond a reversal within it.
    iae_m_s, itae_m_s2 : float
        Integrals of the absolute error, and of time times the absolute error.
    valve_travel_per_s : float
        Sum of the absolute changes of the command, per second.
    saturated_share : float
        Fraction of the samples with the command at its limit.
    air_anr_m3_s, exergy_w : float or None
        Air from the reservoirs per second, as volume at the standard reference atmosphere (ANR), and its exergy
        relative to the ambient. None: the dataset does not contain them.
    peak_pressure_rate_pa_s : float
        Largest change of a chamber's pressure from one sample to the next, per second.
    step_median_s, step_999_s, step_worst_s : float
        Computing time of a step of the law on this machine: median, 99.9 %, worst. The times differ from run to run.
    step_undisturbed_s : float
        Longest step, with the shortest time of each step over repeated runs. Without repeats: `step_worst_s`.
    lost : bool
        Whether the error exceeded 20 mm.
    """

    rmse_m: float
    max_error_m: float
    first_rmse_m: float
    first_max_error_m: float
    settling_100_um_s: float | None
    settling_500_um_s: float | None
    settling_1000_um_s: float | None
    rest_error_m: float | None
    hunting_m: float | None
    slips: int | None
    overshoot_m: float | None
    iae_m_s: float
    itae_m_s2: float
    valve_travel_per_s: float
    saturated_share: float
    air_anr_m3_s: float | None
    exergy_w: float | None
    peak_pressure_rate_pa_s: float
    step_median_s: float
    step_999_s: float
    step_worst_s: float
    step_undisturbed_s: float
    lost: bool

    def to_dict(self) -> Plain:
        """Return all measures by name."""
        return asdict(self)

    def view(self) -> View:
        """Return the applicable measures, as text with their units."""
        return view_of_score({"score": self.to_dict()})


#: Measure -> its title in tables, factor from SI to the unit in tables, and this unit.
SHOWN: dict[str, tuple[str, float, str]] = package_table(__file__, "measures.toml")

#: Measures that are shown for a spread.
SPREAD_SHOWN = ("max_error_m", "settling_100_um_s", "rest_error_m", "hunting_m")

THOUSAND, _LARGER = 1e3, {"um": "mm", "ms": "s", "us": "ms"}


def written(name: str, value: float | None) -> str:
    """Return a measure with its unit as text; empty if it does not apply to the reference.

    Examples
    --------
    >>> written("rmse_m", 2.5e-5), written("max_error_m", 0.0043), written("settling_100_um_s", math.inf)
    ('25 um', '4.3 mm', 'never')
    """
    _, factor, unit = SHOWN[name]
    if value is None:
        return ""
    if not math.isfinite(value):
        return "never"
    if factor * value >= THOUSAND and unit in _LARGER:
        factor, unit = factor / THOUSAND, _LARGER[unit]
    return f"{factor * value:.3g} {unit}"


#: Measures that are shown first.
LEADING = ("rmse_m", "max_error_m", "settling_100_um_s", "rest_error_m", "air_anr_m3_s")


def view_of_score(about: Keyed) -> View:
    """Return a view of score and events of a run under control without figures. `about` is the run's provenance."""
    score = Score(**about["score"])
    texts = {name: written(name, getattr(score, name)) for name in SHOWN}
    motion = about.get("motion", {})
    window = f" (last {_last_s(motion):g} s)" if motion.get("kind") == "sine" else ""
    titles = {name: SHOWN[name][0] + window * (name in ("rmse_m", "max_error_m")) for name in SHOWN}
    values = {name: ShownValue(name, titles[name], VALUE, text) for name, text in texts.items() if text}
    states: dict[str, State] = {"max_error_m": "bad"} if score.lost else {}
    findings = [Finding(f"Lost: an error exceeded {1e3 * LOST_M:g} mm.", "bad")] if score.lost else []
    if "law_failure" in about:
        findings.append(Finding(f"{about['law_failure']} Another controller took over.", "bad"))
    return View(
        run_title(about) if "law" in about else "Score, simulated",
        tuple(values.values()),
        state="bad" if findings else "open" if about.get("events") else "good",
        leading=[replace(values[name], state=states.get(name, "good")) for name in LEADING if name in values],
        findings=findings,
        tables=tuple(event_table(about.get("events") or ())),
    )


def run_title(about: Keyed) -> str:
    """Return a headline: law, drive, reference, setup and seed of a run under control."""
    model = f", with a model of {about['model']}," if about.get("model") else ""
    loaded = f", payload {about['payload']}" if about.get("payload") else ""
    named = f"{about['law']}{model} on {about['title']} along {about['reference']}"
    return f"{named}, setup {about['setup']}, seed {about['seed']}{loaded}, simulated"


def event_table(events: Iterable[Keyed]) -> Iterator[ShownTable]:
    """Yield the table of the events of a run, with the leg of a platform; no table without events."""
    rows = [
        (
            f"{event['time_s']:.3f} s",
            f"{event['leg']}, {event['kind']}" if "leg" in event else event["kind"],
            f"{event['text']} {event['value']:.4g} {'' if event['unit'] == '1' else event['unit']}".rstrip(),
        )
        for event in events
    ]
    if rows:
        yield ShownTable("Events.", ("time", "event", "meaning"), rows)


def score(run: xr.Dataset) -> Score:
    """Score a run under control.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.control.run`.

    Raises
    ------
    CommandError
        The dataset is not a complete run under control.
    """
    said = attributes(run) if hasattr(run, "attrs") else {}
    motion = said.get("motion")
    if not isinstance(motion, dict) or not all(name in run for name in SCORED):
        raise CommandError.of("control.no_run")
    named, time = {name: run[name].to_numpy() for name in SCORED}, run["time"].to_numpy()
    samples = said.get("samples", len(time))
    if len(time) != samples:
        raise CommandError.of("control.part_of_run", count=len(time), samples=samples)
    return score_of(time, named, motion, said.get("air"))


#: Variables of a run that its score needs.
SCORED = ("position", "velocity", "pressure_a", "pressure_b", "reference", "command", "step_time", "least_step_time")


def score_of(time: Array, of: Mapping[str, Array], motion: Keyed, air: NamedNumbers | None = None) -> Score:
    """Return the score of columns over time. `motion` is the reference in the core's form, `air` is from `air_of`."""
    x, command = of["position"], of["command"]
    error = of["reference"] - x
    scored = error[time >= time[-1] - _last_s(motion)]
    first = error[time <= FIRST_S]
    step = float(time[1] - time[0]) if len(time) > 1 else 0.0
    span = max(float(time[-1]), step)
    took = of["step_time"]
    jumps = [np.abs(np.diff(of[name])).max(initial=0.0) for name in ("pressure_a", "pressure_b")]
    start, each, overshoots = motion.get("start_m", 0.0), moves_of(motion), []
    for move, from_m, until in _spans(start, ways_of(motion), float(time[-1])):  # beyond the end of each move
        inside = (time >= move.begin_s) & (time <= until)
        beyond = math.copysign(1.0, move.to_m - from_m) * (x[inside] - move.to_m)
        if beyond.size:
            overshoots.append(max(0.0, float(beyond.max())))
    return Score(
        rmse_m=rms(scored),
        max_error_m=float(np.abs(scored).max()),
        first_rmse_m=rms(first),
        first_max_error_m=float(np.abs(first).max()),
        **_of_moves(time, x, of["velocity"], error, start, each),
        overshoot_m=max(overshoots, default=None),
        iae_m_s=float(np.sum(np.abs(error))) * step,
        itae_m_s2=float(np.sum(time * np.abs(error))) * step,
        valve_travel_per_s=float(np.abs(np.diff(command)).sum()) / span if span else 0.0,
        saturated_share=float(np.mean(np.abs(command) >= 1.0)),
        air_anr_m3_s=air["anr_m3"] / span if air else None,
        exergy_w=air["exergy_j"] / span if air else None,
        peak_pressure_rate_pa_s=float(max(jumps)) / step if step else 0.0,
        step_median_s=float(np.median(took)),
        step_999_s=float(np.quantile(took, 0.999)),
        step_worst_s=float(took.max()),
        step_undisturbed_s=float(of["least_step_time"].max()),
        lost=bool(np.abs(error).max() > LOST_M),
    )


def _last_s(motion: Keyed) -> float:
    """Return the length (s) of the last part of a run, in which RMSE and largest error are scored."""
    return max(LAST_S, 1.0 / motion["frequency_hz"]) if motion["kind"] == "sine" else math.inf


def air_of(mass_kg: float, supply: Pair, circuit: Circuit) -> NamedNumbers:
    """Return volume and exergy of the air, or other gas, drawn from a reservoir.

    Flow exergy of an ideal gas, e = cp (T - T0) - T0 (cp ln(T/T0) - R ln(p/p0)).

    Parameters
    ----------
    mass_kg : float
    supply : tuple of float
        Absolute pressure (Pa) and temperature (K).
    circuit : Circuit
        Circuit with its gas and its ambient.

    Returns
    -------
    dict
        ``mass_kg``, ``anr_m3`` (volume at the standard reference atmosphere), ``exergy_j``.

    Examples
    --------
    >>> import pneudrive as pn
    >>> found = air_of(1.185e-3, (7e5, 293.15), pn.Drive.load("catalogue:reference").circuit)
    >>> round(1e3 * found["anr_m3"], 6), round(found["exergy_j"], 1)
    (1.0, 192.8)
    """
    (p, t), p0, t0 = supply, circuit.ambient.pressure_pa, circuit.ambient.temperature_k
    k, r = circuit.gas.heat_capacity_ratio, circuit.gas.gas_constant_j_kg_k
    cp = k * r / (k - 1.0)
    specific = cp * (t - t0) - t0 * (cp * math.log(t / t0) - r * math.log(p / p0))
    return {"mass_kg": mass_kg, "anr_m3": mass_kg / anr_density_kg_m3(k, r), "exergy_j": mass_kg * specific}


def _spans(start: float, moves: list[ReferenceMove], end_s: float) -> Iterator[tuple[ReferenceMove, float, float]]:
    """Yield each move, its start position, and the time at which the next move begins or the run ends."""
    starts = [start, *(move.to_m for move in moves)]
    ends = [min(move.begin_s, end_s) for move in moves[1:]]
    yield from zip(moves, starts, [*ends, end_s], strict=False)


def _of_moves(
    time: Array,
    x: Array,
    v: Array,
    error: Array,
    start: float,
    moves: list[ReferenceMove],
) -> Plain:
    """Return settling times, error at rest, hunting and slips after the moves."""
    found: dict[str, list[float]] = {name: [] for name in (*BANDS_M, "rest_error_m", "hunting_m", "slips")}
    for move, _, until in _spans(start, moves, float(time[-1])):
        dwell = (time >= move.end_s) & (time <= until)
        if np.count_nonzero(dwell) < LEAST_DWELL:
            continue
        for name, band in BANDS_M.items():
            outside = np.abs(error[dwell]) > band
            last = float(time[dwell][outside][-1]) - move.end_s if outside.any() else 0.0
            found[name].append(math.inf if outside[-1] else last)
        length = until - move.end_s + ROUNDING_S
        if length >= REST_S:
            at_end = dwell & (time >= until - REST_S)
            found["rest_error_m"].append(float(np.abs(error[at_end]).mean()))
        if length >= HUNTING_S:
            begin = min(move.end_s + LONG_DWELL_S, until - HUNTING_S)
            part = dwell & (time >= begin)
            found["hunting_m"].append(float(np.ptp(x[part])))
            fast = np.abs(v[part]) > SLIP_M_S
            begun = fast[1:] & ~fast[:-1]
            found["slips"].append(int(fast[0]) + int(np.sum(begun)))
    out: Plain = {name: max(values, default=None) for name, values in found.items()}
    return out | {"slips": sum(found["slips"]) if found["slips"] else None}
