"""Study of the source paper: its chamber equations checked by the energy balance, its figures, claims, a report."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import cumulative_trapezoid

import pneudrive as pn
from pneudrive.batching import in_processes
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.characterise import Characterisation, characterise_recordings
from pneudrive.describe.tables.friction import friction_laws
from pneudrive.errors import PneudriveWarning
from pneudrive.figures import MEASURED, MODEL, THIN, Axis, Band, Figure, Line, Look, Markers, Panel, Rule, ramp, thin
from pneudrive.report import page
from pneudrive.report.page import Blocks, Paragraph, Report, Topic, figure_of, plural, sections_of, sentence
from pneudrive.report.recordings import motion_figures, recovered, recovered_part
from pneudrive.rig import SimulatedRig, shipped_rigs, sweep
from pneudrive.studies.bracha import figure as bracha
from pneudrive.studies.bracha.figure import SEED, Claim, PaperFigure, judge
from pneudrive.views import ShownFigure

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.rig.description import RigDescription, Source


FULL_STROKE = Path(__file__).with_name("full_stroke.toml")
ENERGY_BALANCE, AS_PRINTED = "energy-balance", "as-printed"
TURN_S = 0.6
#: Time within which every outward stroke ends, s.
STROKE_S = 2.0
SAMPLE_RATE = "10 kHz"
RTOL = 1e-8


@dataclass(frozen=True)
class ChamberComparison:
    """Results of one stroke out and back with both chamber laws, in SI with absolute pressures.

    Attributes
    ----------
    runs : dict of xarray.Dataset
        Law -> trajectory.
    stroke_time_s : dict of float
        Law -> time of the first arrival at the far stop; NaN if the stop is not reached.
    energy_residual_j : dict of float
        Law -> largest error of the energy balance of chamber a.
    stroke_work_j : float
        Supply pressure times swept volume, the reference of the residual.
    """

    runs: dict[str, xr.Dataset]
    stroke_time_s: dict[str, float]
    energy_residual_j: dict[str, float]
    stroke_work_j: float

    def largest_difference(self, name: str) -> float:
        """Return the largest difference of one variable between the two laws, in its unit."""
        printed, balanced = (self.runs[law][name].to_numpy() for law in (AS_PRINTED, ENERGY_BALANCE))
        return float(np.abs(printed - balanced).max())


def compare_chamber_laws() -> ChamberComparison:
    """Simulate the drive of ``full_stroke.toml`` out and back, with the valve fully open, with both chamber laws."""
    drive = pn.Drive.load(FULL_STROKE)
    command = [(0.0, 1.0), (TURN_S, -1.0)]
    with warnings.catch_warnings():  # as-printed breaks the energy balance, as intended here
        warnings.simplefilter("ignore", PneudriveWarning)
        runs = {
            law: stroke(drive.replace({"cylinder.chamber_law": law}), command, 2 * TURN_S, rtol=RTOL)
            for law in (ENERGY_BALANCE, AS_PRINTED)
        }
    c = drive.cylinder
    return ChamberComparison(
        runs=runs,
        stroke_time_s={law: _arrival(run, c.stroke_m) for law, run in runs.items()},
        energy_residual_j={law: energy_residual(run, drive, printed=law == AS_PRINTED) for law, run in runs.items()},
        stroke_work_j=drive.supply_pressure_pa * c.area_a_m2 * c.stroke_m,
    )


def stroke(drive: pn.Drive, command: list[tuple[float, float]], duration_s: float, **options: Any) -> xr.Dataset:  # noqa: ANN401
    """Simulate a drive from the near stop, with the supply pressure in chamber b."""
    start = f"position = 0 mm, pressure_b = {drive.supply_pressure_pa} Pa abs"
    return pn.simulate(drive, command, duration_s, initial=start, sample_rate=SAMPLE_RATE, **options)


def stroke_out(drive: pn.Drive) -> float:
    """Return the time (s) of the stroke out with the valve fully open."""
    return _arrival(stroke(drive, [(0.0, 1.0)], STROKE_S), drive.cylinder.stroke_m)


def _arrival(run: xr.Dataset, stroke_m: float) -> float:
    there = np.flatnonzero(run.position.to_numpy() >= stroke_m)
    return float(run.time[int(there[0])]) if there.size else math.nan


def energy_residual(run: xr.Dataset, drive: pn.Drive, *, printed: bool) -> float:
    """Return the largest error (J) of the energy balance of chamber a.

      residual = U - U_0 - int (h m_dot - p V_dot + Q) dt

    with the internal energy U = p V / (k - 1) and the enthalpy h = k / (k - 1) R T of an ideal gas.

    The residual is computed from a finished trajectory, and is therefore also available for a law without a ledger.
    The wall area of the chamber law is used, so that a difference in wall area does not count as an error.
    """
    c, gas = drive.cylinder, drive.gas
    k, r = gas.heat_capacity_ratio, gas.gas_constant_j_kg_k
    inlet = drive.supply.temperature_k or drive.ambient.temperature_k
    wall = c.wall_temperature_k or drive.ambient.temperature_k
    x, v, p, t, flow = (
        run[name].to_numpy() for name in ("position", "velocity", "pressure_a", "temperature_a", "mass_flow_a")
    )
    faces = 0.25 * c.bore_m**3 if printed else 0.5 * c.bore_m**2
    assert c.heat_transfer_w_m2_k is not None  # the drives of the study state it
    heat = c.heat_transfer_w_m2_k * math.pi * (c.bore_m * x + faces) * (wall - t)
    power = k / (k - 1) * r * np.where(flow > 0.0, inlet, t) * flow - p * c.area_a_m2 * v + heat
    got = cumulative_trapezoid(power, run.time.to_numpy(), initial=0.0)
    held = p * (c.dead_volume_m3.a + c.area_a_m2 * x) / (k - 1)
    return float(np.abs(held - held[0] - got).max())


#: Energy error up to which energy counts as conserved, as a fraction of the stroke's energy.
CLOSED = 1e-3
#: Changes that test the influences named in the conclusions: two ambient temperatures 40 K apart, argon instead of air.
WARMER = {"ambient.temperature": "313.15 K"}
COLDER = {"ambient.temperature": "273.15 K"}
ARGON = {"gas.heat_capacity_ratio": 1.667, "gas.gas_constant": "208.13 J/(kg K)"}
#: Factor on the valve's conductance that represents a small connector.
NARROW = 0.5
#: Tubes on both sides that represent long lines.
LONG = {"tubing": {side: {"length": "5 m", "diameter": "4 mm"} for side in "ab"}}
#: Relative reduction of the speed that counts as significant.
SIGNIFICANT = 0.2
#: A controller counts as clearly better if its error divided by that of a usual controller is below this ratio.
BETTER = 0.5


def general_claims(chambers: ChamberComparison, figures: Mapping[int, PaperFigure]) -> tuple[Claim, ...]:
    """Check the sentences that do not belong to a single figure.

    Parameters
    ----------
    chambers : ChamberComparison
        Comparison of the printed equations with the energy balance.
    figures : mapping of PaperFigure
        Figures by number. Figures 6 and 9 give the effects of speed and of a stop on friction.

    Returns
    -------
    tuple of Claim
    """
    drive = pn.Drive.load(FULL_STROKE)
    work, lost = chambers.stroke_work_j, chambers.energy_residual_j
    usual, warm, cold, argon = (stroke_out(drive.replace(change)) for change in ({}, WARMER, COLDER, ARGON))
    heat, gas = abs(warm - cold) / usual, abs(argon - usual) / usual
    curve = figures[6].columns["friction_settled_n"]
    speed, stop = curve.max() / curve.min() - 1, figures[9].quantities["largest_share"]
    half = f"{NARROW * drive.valve.conductance_m3_s_pa} m^3/(s Pa)"
    slower, longer = (1.0 - usual / stroke_out(drive.replace(one)) for one in ({"valve.conductance": half}, LONG))
    least, most = min(speed, stop), max(heat, gas)
    # Largest error of the drive of figure 2 along the sine R2 under a usual and a predictive controller, m.
    along = (pn.control.run(bracha.slow_drive(), law=law, reference="R2") for law in ("pid", "nmpc"))
    usual_law, predictive = (float(run.score["max_error_m"]) for run in along)
    verdicts = {
        "balance": judge(lost[AS_PRINTED] < CLOSED * work, part=lost[ENERGY_BALANCE] < CLOSED * work),
        "influences": judge(min(heat, gas) > 0.01 and least > most, part=least > 0.01),
        "connectors": judge(min(slower, longer) > SIGNIFICANT, part=max(slower, longer) > SIGNIFICANT),
        "predictive": judge(predictive < BETTER * usual_law, part=predictive < usual_law),
    }
    numbers = {
        "work_j": work,
        "balanced_j": lost[ENERGY_BALANCE],
        "printed_j": lost[AS_PRINTED],
        "heat_share": heat,
        "gas_share": gas,
        "speed_share": speed,
        "stop_share": stop,
        "slower_share": slower,
        "longer_share": longer,
        "predictive_m": predictive,
        "usual_m": usual_law,
    }
    return bracha.claims_of("general", verdicts, numbers)


# --- The nine figures of the source paper.


def paper_figures(runs: Mapping[str, Campaign]) -> dict[int, PaperFigure]:
    """Return all figures of the paper.

    Parameters
    ----------
    runs : mapping of Campaign
        Finished campaign of each experiment.

    Returns
    -------
    dict of PaperFigure
        Figures by their number in the paper.
    """
    figures = [
        *bracha.stick_slip_figures(),
        *bracha.rig_figures(runs),
        bracha.figure_5(runs["cycle"]),
        bracha.figure_6(runs["speed"]),
        bracha.figure_8(runs["pressure"]),
        bracha.figure_9(runs["stops"]),
    ]
    return {figure.number: figure for figure in sorted(figures, key=lambda figure: figure.number)}


# --- Pictures of the source paper's figures 4 to 9.


#: Travel after a stop shown in figure 9, m.
SHOWN_M = 3e-3


def rig(data: PaperFigure) -> Figure:
    """Draw figures 4 and 7: the rig with its stated values."""
    assert data.rig is not None
    identity, envelope = data.rig
    assert identity.stiffness_n_m is not None  # simulated rigs state it
    range_n, error_n = identity.limits["force_n"][1], identity.accuracy["force_n"]
    low, high = (1e-5 * (p - identity.ambient_pressure_pa) for p in envelope.pressure_pa)
    return page.sketch(
        "rig",
        [identity.chambers],
        low_mm=1e3 * envelope.position_m[0],
        high_mm=1e3 * envelope.position_m[1],
        speed_mm_s=1e3 * envelope.speed_m_s,
        acceleration=envelope.acceleration_m_s2,
        jerk=envelope.jerk_m_s3,
        sensor=f"±{range_n:.0f} N, u = {error_n:.2g} N, {1e-6 * identity.stiffness_n_m:.3g} N/µm",
        bore_mm=2e3 * math.sqrt(identity.area_a_m2 / math.pi),
        mass=identity.mass_beyond_sensor_kg,
        served=f"{max(low, 0.0):.2g} to {high:.3g} bar gauge",
    )


def cycle(data: PaperFigure) -> Figure:
    """Draw figure 5: friction after a turn, over the whole stroke and over its start."""
    c = data.columns
    marks = [
        Markers(c["time_s"], c["friction_n"], "every sample", THIN, size=1.2),
        Line(c["time_s"], c["friction_smoothed_n"], "moving average of 5", width=0.8),
        Line(c["time_s"], c["friction_mean_n"], "mean of the rest of the stroke", MODEL),
    ]
    low = float(np.quantile(c["friction_n"][c["friction_n"].size // 10 :], 0.001))
    force = Axis("friction / N", low=low - 0.5, high=1.05 * data.quantities["peak_n"] + 0.6)
    start = Panel(marks, "the first 6 s", Axis("time after the turn / s", low=0.0, high=6.0))
    return figure_of("paper-cycle", [Panel(marks), start], y=force)


def over_speed(data: PaperFigure) -> Figure:
    """Draw figure 6: friction over speed on linear and logarithmic axes, and friction minus its true value below."""
    c, settled = data.columns, Look("blue", "-", "x")
    speed, true = c["speed_m_s"], c["friction_true_n"]
    above = [
        Markers(speed, c["friction_n"], "force, as in the paper", size=3.5),
        Line(speed, c["air_n"], "part of the air", Look("orange", ":")),
        Markers(speed, c["friction_settled_n"], "seal, settled samples", settled, size=3.5),
        Line(speed, true, "seal, true in each cycle", THIN, 0.8),
    ]
    below = [
        Band(speed, c["low_n"] - true, c["high_n"] - true, "95 % band"),
        Rule(y=0.0),
        Markers(speed, c["friction_settled_n"] - true, look=settled, size=3.5),
    ]
    linear, logarithmic, label = "speed / (mm/s)", Axis("speed / (mm/s)", "log"), "seal − true / mN"
    panels = [
        Panel(above, "linear axis, as in the paper", linear),
        Panel(above, "logarithmic axis", logarithmic),
        Panel(below, "", linear, label),
        Panel(below, "", logarithmic, label),
    ]
    return figure_of("paper-speed", panels)


def over_pressure(data: PaperFigure) -> Figure:
    """Draw figure 8: the sensor's force at each pressure, and its parts, seal and air."""
    c, panels = data.columns, []
    bar = c["gauge_pa"] / 1e5
    parts = (
        ("friction_n", "force sensor, as in the paper"),
        ("seal_n", "part of the seal"),
        ("air_n", "part of the air"),
    )
    for name, title in parts:
        curves = [
            Markers(c["speed_m_s"], values, f"{bar[i]:.1f} bar", ramp(i, bar.size), size=2.5, filled=True, joined=True)
            for i, values in enumerate(c[name])
        ]
        panels.append(Panel(curves, title))
    return figure_of("paper-pressure", panels)


def stop(data: PaperFigure) -> Figure:
    """Draw figure 9: friction over time during a stop, friction over travel at the restart, and peaks over speed."""
    c = data.columns
    time_s = c["time_s"]
    around = c["friction_n"][(time_s > -1.0) & (time_s < time_s[-1] - 1.0)]  # without the turns
    low, high = float(around.min()), float(around.max())
    span = high - low
    ends: dict[str, Any] = {"low": low - 0.35 * span, "high": high + 0.1 * span}
    top = int(np.argmax(c["friction_n"]))
    travel = np.abs(c["position_m"] - c["position_m"][int(np.searchsorted(c["time_s"], 1.0))])
    after, dots = slice(max(top - 40, 0), None), Look("black", "-", ".")

    def through(x: np.ndarray, part: slice, size: float) -> list[Any]:
        friction, running = c["friction_n"][part], c["running_n"][part]
        return [Markers(x, friction, "", dots, size=size, joined=True), Line(x, running, "uninterrupted", MODEL)]

    increment, width = c["increment_n"], c["increment_width_n"]
    peaks = Markers(c["speed_m_s"], increment, "", MEASURED, increment - width, increment + width, filled=True)
    near = Axis("travel from the stop / mm", low=-0.02 * SHOWN_M, high=SHOWN_M)
    panels = [
        Panel(
            through(c["time_s"], slice(None), 1.5),
            "",
            "time since the stop / s",
            Axis("force against motion / N", **ends),
        ),
        Panel(through(travel[after], after, 2.0), "", near, Axis("", **ends)),
        Panel([peaks], "", Axis("speed of the restart / (mm/s)", "log"), Axis("peak above uninterrupted / N", low=0.0)),
    ]
    return figure_of("paper-stop", panels)


#: Number -> name of the file, and function that draws it.
DRAWINGS = {
    4: ("rig", rig),
    5: ("reversal", cycle),
    6: ("speed", over_speed),
    7: ("rig-under-pressure", rig),
    8: ("pressure", over_pressure),
    9: ("stop", stop),
}


# --- The whole study: campaigns and simulations, checked sentences, and sections of the report.

#: Folder of the campaigns, next to the report.
FOLDER = "campaigns"
#: Speeds and pressures at which the simulated rig's recordings are compared with their truth.
RECOVERY_SPEEDS_M_S = (1e-3, 0.45, 24)  # from, to, number; logarithmic
RECOVERY_GAUGES_PA = (0.0, 0.5e5, 1.0e5, 1.5e5)
RECOVERY_CYCLES = 3


@dataclass(frozen=True)
class Reproduction:
    """Results of the simulated rigs and drives.

    Attributes
    ----------
    figures : dict of PaperFigure
        Figures by number in the source paper.
    rigs : tuple of RigDescription
        Default rig, which made the recordings with known true values, and rigs of the figures.
    found : Characterisation
        Result of simulated recordings with known true values.
    chambers : ChamberComparison
        Comparison of the printed equations with the energy balance.
    claims : tuple of Claim
        All checkable sentences of the paper, with verdicts.
    """

    figures: Mapping[int, PaperFigure]
    rigs: tuple[RigDescription, ...]
    found: Characterisation
    chambers: ChamberComparison
    claims: tuple[Claim, ...]

    def report(self) -> Report:
        """Return the report of the study."""
        parts = sections_of("recordings", {"recovered": recovered_part}, self.found, synthetic=True)
        parts += sections_of(PAGE, PARTS, self, synthetic=True)
        parts += sections_of(PAGE, {"study": provenance}, self, synthetic=False)
        return Report("The source paper's figures from a simulated rig", list(verdict(self, alone=True)), parts)


def reproduce(into: str | Path) -> Reproduction:
    """Run the source paper's experiments on simulated rigs and a drive, and make its figures 1 to 9.

    Parameters
    ----------
    into : path-like
        Folder for the campaigns; finished cycles are not run again.

    Returns
    -------
    Reproduction

    Raises
    ------
    CampaignError, RigError, SimulationError
        The folder cannot be used, or a campaign fails.
    """
    # The campaigns, each in its own process.
    jobs = [(protocol, rig, str(Path(into) / protocol), SEED) for protocol, rig in bracha.EXPERIMENTS.values()]
    runs = dict(zip(bracha.EXPERIMENTS, in_processes(bracha.run_experiment, jobs), strict=True))
    rig = SimulatedRig.default()
    speeds_m_s = np.geomspace(*RECOVERY_SPEEDS_M_S)
    recordings = sweep(rig, speeds_m_s, RECOVERY_GAUGES_PA, count=RECOVERY_CYCLES, seed=SEED)
    found = characterise_recordings(recordings)
    names = dict.fromkeys(name for _, name in bracha.EXPERIMENTS.values())
    rigs = rig.description, *(SimulatedRig.load(shipped_rigs()[name]).description for name in names)
    figures, chamber_laws = paper_figures(runs), compare_chamber_laws()
    claims = tuple(claim for figure in figures.values() for claim in figure.claims)
    claims += general_claims(chamber_laws, figures)
    return Reproduction(figures, rigs, found, chamber_laws, claims)


# --- The report of the study: verdict, sections, provenance.

PAGE = Path(__file__).with_name("page.toml")


def verdict(made: Reproduction, *, alone: bool) -> Iterator[str]:
    """Yield the results as a few lines, or as one line."""
    topic, (errors, _, expanded) = Topic(PAGE, "verdict"), np.abs(recovered(made.found))
    first = topic.say("paper", count=count_verdicts(made.claims))
    truth = topic.say("recovered", inside=np.sum(errors <= expanded), all=errors.size)
    if not alone:
        yield f"{first}; {truth}."
        return
    yield f"{first}."
    yield f"{truth[:1].upper()}{truth[1:]}, U with k = 2."
    yield topic.say("slip", **bracha.readable(made.figures[2].quantities))
    c = made.chambers
    yield topic.say(
        "chambers",
        stroke_percent=100 * (c.stroke_time_s[AS_PRINTED] / c.stroke_time_s[ENERGY_BALANCE] - 1),
        temperature_k=c.largest_difference("temperature_b"),
        residual_j=c.energy_residual_j[AS_PRINTED],
        work_j=c.stroke_work_j,
    )


def count_verdicts(claims: Sequence[Claim]) -> str:
    """Return, as text, the numbers of sentences that hold, hold in part, and do not hold.

    Examples
    --------
    >>> from pneudrive.studies.bracha.figure import Claim
    >>> count_verdicts([Claim("figure 1", "It moves", "holds", "it does")])
    '1 of 1 sentence that can be checked holds, 0 hold in part, 0 do not hold'
    """
    whole, part, none = (sum(c.verdict == v for c in claims) for v in ("holds", "holds in part", "does not hold"))
    words = {"hold": "holds" if whole == 1 else "hold", "do": "does" if none == 1 else "do"}
    sentences = plural(len(claims), "sentence")
    return Topic(PAGE, "verdict").say("count", whole=whole, sentences=sentences, part=part, none=none, **words)


def paper(topic: Topic, made: Reproduction) -> Blocks:
    """Show all verdicts and figures 4 to 9. The section on stick-slip has figures 1 to 3."""
    unchecked, claims, figures = Topic(bracha.TEXTS, "unchecked").texts, made.claims, made.figures
    failed = any(c.verdict == "does not hold" for c in claims)
    yield topic.text()
    yield Paragraph(sentence(count_verdicts(claims)), "fails" if failed else "holds")
    yield topic.table((c.place, f"“{c.said}”", sentence(c.found), c.verdict) for c in claims)
    yield from topic.listed((f"“{said}”: {why}." for said, why in unchecked.items()), "unchecked")
    yield from topic.listed(
        (f"Figure {f.number}: {f.texts['assumed']}." for f in figures.values() if "assumed" in f.texts), "assumed"
    )
    yield topic.text("campaigns")
    yield topic.text("holds", "note")
    for number, (name, drawing) in DRAWINGS.items():
        f = figures[number]
        caption = topic.say("caption", number=number, title=f.texts["title"], measured=sentence(f.measured))
        yield ShownFigure(f"paper-{number}-{name}", caption, drawing(f))


def stick_slip(topic: Topic, made: Reproduction) -> Blocks:
    """Show figures 1 to 3 as a table, over time, and in the phase plane."""
    rows, motions = [], []
    for f in (made.figures[number] for number in (1, 2, 3)):
        law = topic.say(str(f.number))
        rows.append({"figure": str(f.number), "friction": law, **f.quantities})
        time, position, velocity = (f.columns[name] for name in ("time_s", "position_m", "velocity_m_s"))
        motions.append((f"figure {f.number}: {law}", time, position, velocity, f.quantities["mean_speed_m_s"]))
    over_time, phases = motion_figures(motions)
    yield topic.text()
    yield topic.table(rows)
    yield topic.figure("stick-slip-time", over_time)
    yield topic.figure("stick-slip-phase", phases)


def chambers(topic: Topic, made: Reproduction) -> Blocks:
    """Show the errors of equations (2) and (3) of the paper, with numbers and curves over time."""
    compared, laws = made.chambers, (ENERGY_BALANCE, AS_PRINTED)
    gas = {side: [compared.runs[law][f"temperature_{side}"] for law in laws] for side in "ab"}
    rows = (
        ("time of the stroke out, s", *(f"{compared.stroke_time_s[law]:.4f}" for law in laws)),
        *(
            (f"gas in chamber {side}, K", *(f"{float(t.min()):.0f} … {float(t.max()):.0f}" for t in runs))
            for side, runs in gas.items()
        ),
        ("energy created in chamber a, J", *(f"{compared.energy_residual_j[law]:.1f}" for law in laws)),
        ("largest difference of position, mm", None, f"{1e3 * compared.largest_difference('position'):.1f}"),
        ("largest difference of pressure a, bar", None, f"{1e-5 * compared.largest_difference('pressure_a'):.2f}"),
        ("largest difference of temperature b, K", None, f"{compared.largest_difference('temperature_b'):.0f}"),
    )
    residual = compared.energy_residual_j[AS_PRINTED]
    # Position and its difference, pressures and temperatures over time.
    balanced, printed = (compared.runs[law] for law in laws)
    part = thin(balanced.time)
    time = balanced.time[part]

    def lines(name: str) -> list[Line]:
        own, other = balanced[name][part], printed[name][part]
        return [Line(time, own, "energy balance", MEASURED), Line(time, other, "as printed", MODEL)]

    quantities = (("pressure", "pressure {} / bar abs"), ("temperature", "gas temperature {} / K"))
    panels = [
        Panel(lines("position"), y="position / mm"),
        Panel([Line(time, (printed.position - balanced.position)[part])], y="difference / mm"),
        *(Panel(lines(f"{name}_{side}"), y=label.format(side)) for name, label in quantities for side in "ab"),
    ]
    yield topic.text()
    yield topic.table(rows)
    yield topic.figure("chamber-laws", figure_of("paper-chambers", panels))
    yield topic.text("energy", "note", residual_j=residual, work_j=compared.stroke_work_j)


#: Parts of the study's report by the key of their section.
PARTS = {"paper": paper, "stick-slip": stick_slip, "chambers": chambers}


def provenance(topic: Topic, made: Reproduction) -> Blocks:
    """Show the software, the values of the default rig, differing values of other rigs, drive values, and sources."""
    runs = made.chambers.runs
    base: dict[str, Source] = {}
    cited = (key for run in runs.values() for key in run.attrs["citations"])
    laws = (friction_laws()[name]["source"] for name in ("lugre", "stribeck"))
    solver = ("solver of the simulations", str(runs[ENERGY_BALANCE].attrs["solver"]))
    yield topic.text("validity")
    yield topic.table([*page.software(), solver, ("seed of the simulated sensors", str(SEED))], "software")
    for name, sources in {rig.name: rig.sources for rig in made.rigs}.items():
        own = {key: source for key, source in sources.items() if source != base.get(key)}
        yield topic.text("values", rig=f"{name[0].lower()}{name[1:]}", only=topic.say("only") if base else "")
        yield topic.table((key, s.value, s.source, s.reason) for key, s in own.items())
        base = base or sources
    yield topic.text("drives")
    for path in (bracha.SLOW_DRIVE, FULL_STROKE):
        yield Paragraph(path.read_text(encoding="utf-8").strip(), "code")
    yield from topic.listed(page.references(dict.fromkeys(["bracha", *cited, *laws])), "sources")
