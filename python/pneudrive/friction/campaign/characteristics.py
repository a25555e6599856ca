"""All characteristics of a campaign folder, computed by one function."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pneudrive.arrays import Plain, attributes_of, by_name, evenly
from pneudrive.batching import many_objects
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.estimate.estimates import Estimate, mean_estimate, one_thread
from pneudrive.friction.campaign import curves as campaign_curves
from pneudrive.friction.campaign import trends
from pneudrive.friction.campaign.points import CurvePoints, points_of
from pneudrive.friction.campaign.reading import CampaignData, Loop, read_campaign, read_each, reading_of, reversal_loop
from pneudrive.friction.campaign.result import CampaignCharacteristics, Ranges
from pneudrive.friction.campaign.statements import statements
from pneudrive.friction.campaign.stops import dwell_law
from pneudrive.friction.campaign.stops.stop import find_stops
from pneudrive.friction.characterisation import Characterisation, characterise_recordings
from pneudrive.friction.friction_map import ALL_RECORDINGS, BOTH, LEVELS, TABLES, assemblies_of
from pneudrive.friction.sentences import sentence
from pneudrive.friction.strokes import SAMPLE_CHOICES, SampleChoice, Settled
from pneudrive.identify.identified import Dependences
from pneudrive.identify.static.fit import GroupFits, fit_groups
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.signals.load import recordings_in

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    import xarray as xr

    from pneudrive.identify.static.result import FrictionFit
    from pneudrive.signals.layout import AnyLayout
    from pneudrive.signals.recording import Recording


STEPS = 3  # cycles, models, stops
SHOWN_CONDITIONS, SHOWN_SPEEDS = 2, 3  # of loops


def campaign_friction(
    campaign: Campaign | str | Path,
    protocol: SampleChoice | None = None,
    processes: int | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> CampaignCharacteristics:
    """Characterise the friction of a campaign: curves, effects and stops.

    Parameters
    ----------
    campaign : Campaign or path-like
        An open campaign or its folder.
    protocol : SampleChoice, optional
        Selection of samples: ``Settled()`` (default) or ``SourcePaper()``.
    processes : int, optional
        Number of processes that read the cycles; None: one for each processor.
    progress : callable, optional
        Called as ``progress(done, total, task)``.
    cancel : object with ``is_set()``, optional
        Ends the call once it is set.

    Returns
    -------
    CampaignCharacteristics

    Raises
    ------
    CampaignError
        If the folder is not a campaign, or no cycle can be used.
    Cancelled
        If the flag was set.
    """
    watch = Watch(progress, cancel)
    opened = campaign if isinstance(campaign, Campaign) else Campaign.open(campaign)
    choice = protocol if protocol is not None else Settled()
    task = f"steps of {opened.path.name}"
    watch.tell(0, STEPS, f"{task} (cycles)")
    reading = read_campaign(opened, choice, processes)
    watch.tell(1, STEPS, f"{task} (models)")
    with one_thread():
        found = _characterise(reading, choice)
        watch.tell(2, STEPS, f"{task} (stops)")
        stops, lost = find_stops(opened, processes, reading.files)
        dwell, said = dwell_law.fit_dwell(stops, opened.identity.ambient_pressure_pa)
        skipped, statements_ = (*found.skipped, *lost), (*found.statements, *said)
        found = replace(found, stops=stops, dwell=dwell, skipped=skipped, statements=statements_)
    watch.tell(STEPS, STEPS, task)
    return found


def characterise(
    recordings: Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset,
    layout: AnyLayout = None,
    protocol: SampleChoice | None = None,
) -> xr.Dataset:
    """Return the friction map of recordings or of a campaign.

    Parameters
    ----------
    recordings
        One or several recordings, files or trajectories of ``pn.simulate``; a folder with recordings and
        ``layout.toml``; or the folder of a campaign.
    layout
        Layout of the recordings, or its file. None: ``layout.toml`` next to each recording. Not used for a campaign.
    protocol
        Selection of samples: ``Settled()`` (default) or ``SourcePaper()``.

    Returns
    -------
    xarray.Dataset
        One dimension ``row`` (recording or cycle, speed level, direction); every variable has its unit. The map of
        a campaign has further columns: the 95 % band and the levels of the plan.

    Raises
    ------
    RecordingError, LayoutError, CampaignError
        If a file, recording or folder cannot be used.
    """
    if isinstance(recordings, str | Path) and Path(recordings).is_dir():
        files = recordings_in(Path(recordings))
        if not files:
            return campaign_friction(recordings, protocol).friction_map
        recordings = files
    return characterise_recordings(recordings, layout, protocol).friction_map


def recorded_characteristics(found: Characterisation) -> CampaignCharacteristics | None:
    """Return curves, effects and statements from recordings, in the form of a campaign without a plan.

    Parameters
    ----------
    found : Characterisation
        Result of ``characterise_recordings``.

    Returns
    -------
    CampaignCharacteristics or None
        Contains the friction map of the recordings. None if only some of the recordings were kept in memory.
    """
    if len(found.stroke_uses) > len(found.results):
        return None
    with one_thread():
        reduced = _characterise(reading_of(found), SAMPLE_CHOICES[found.protocol]())
    return replace(reduced, friction_map=found.friction_map)


@many_objects()
def _characterise(reading: CampaignData, choice: SampleChoice) -> CampaignCharacteristics:
    points, fits = campaign_curves.fitted(points_of(reading), reading.tares)
    rig, parts = reading.identity, {}
    if fits is not None:
        separated = rig.pressure_measured_at == "chamber"
        curves = campaign_curves.curves_of(fits, contains_air=not separated)
        ambient_pa, assemblies = rig.ambient_pressure_pa, fits.points.assemblies.items()
        pressures = [trends.pressure_effects(ambient_pa, fits, *assembly) for assembly in assemblies]
        parts |= {
            "curves": curves,
            "air": campaign_curves.air_shares(fits, curves, separated=separated),
            "asymmetry": campaign_curves.asymmetries(fits),
            "drift": trends.drift_of(fits),
            "repeatability": trends.repeatability(fits),
            "pressure": tuple(effects for effects in pressures if effects is not None),
            "sources": campaign_curves.sources(fits, reading.gain, rig.force_calibration),
        }
    if points is not None:
        parts["stick_slip"], parts["stick_slip_thresholds"] = campaign_curves.stick_slip(points)
        parts |= {"position": trends.position_dependence(points), "loops": _loops(reading, points, choice)}
    cycles, sliding = _cycles(reading, points), reading.sliding
    measured = {"speed_m_s": np.abs(sliding["velocity_m_s"]), "temperature_k": sliding["temperature_k"]}
    for side in "ab":
        measured[f"gauge_{side}_pa"] = sliding[f"pressure_{side}_pa"] - rig.ambient_pressure_pa
    ranges = {}  # lowest and highest measured values
    for name, values in measured.items():
        ranges[name] = tuple(float(end.reduce(values, axis=None, initial=np.nan)) for end in (np.fmin, np.fmax))
    found = CampaignCharacteristics(
        **attributes_of(reading, "name", "about", "identity", "skipped"),
        folder=reading.source,
        protocol=choice.name,
        cycles=cycles,
        flags=dict(Counter(flag for flags in cycles["flags"].to_list() for flag in flags)),
        zero=campaign_curves.sensor_zero(reading.tares),
        ranges=Ranges(**ranges),
        friction_map=campaign_curves.friction_map(reading, points, fits, choice.name),
        stops=cycles.select(),
        **parts,
    )
    return replace(found, statements=statements(found, reading, points, fits))


def _loops(reading: CampaignData, points: CurvePoints, choice: SampleChoice) -> tuple[Loop, ...]:
    """Return friction loops without offset, at several speeds of each of the first `SHOWN_CONDITIONS` conditions."""
    files, chosen = {file.cycle.key: file for file in reading.files}, list[int]()
    for index in range(SHOWN_CONDITIONS if files else 0):
        rows = np.flatnonzero((points["curve"] == index) & (points["set_speed_m_s"] > 0))
        levels = np.unique(points["level"][rows])
        for level in levels[evenly(levels.size, SHOWN_SPEEDS)] if levels.size else ():
            chosen.append(int(rows[points["level"][rows] == level][0]))
    loops = read_each([files[points["key"][i]] for i in chosen], reversal_loop, reading.identity, choice)
    pairs = zip(loops, points["offset_n"][chosen].tolist(), strict=True)
    return tuple(replace(loop, friction_n=loop.friction_n - offset) for loop, offset in pairs if isinstance(loop, Loop))


#: Columns of `SUMMARY` with forces, and their values and reason for a cycle without both directions.
FORCES = ("friction_n", "offset_n", "stderr_n")
NO_POINT = (np.nan, np.nan, np.nan, "")
SUMMARY: dict[str, str] = TABLES["summary"]  # columns of the cycles of a campaign -> their types


def _cycles(reading: CampaignData, points: CurvePoints | None) -> pl.DataFrame:
    """Return a summary of all cycles that were read, in the order in which they were run."""
    types = {name: pl.List(pl.String) if kind == "List" else getattr(pl, kind) for name, kind in SUMMARY.items()}
    point_of = {}
    if points is not None:
        columns = (points[name] for name in ("key", "friction_n", "offset_n", "friction_stderr_n", "reason"))
        point_of = {key: values for key, *values in zip(*columns, strict=True)}
    rows = []
    for cycles in (reading.sliding, reading.tares):
        found = cycles.columns | {"began_s": cycles["elapsed_s"], "speed_m_s": cycles.over_sides("velocity_m_s")}
        for i, (key, condition) in enumerate(zip(cycles["key"], cycles["condition"], strict=True)):
            row = {name: values[i] for name, values in found.items() if name in SUMMARY} | vars(condition)
            *forces, reason = point_of.get(key, NO_POINT)
            row |= by_name(FORCES, forces)
            row["flags"] = [*row["flags"], *filter(None, [reason])]
            rows.append(row)
    return pl.DataFrame(rows, schema=types).sort("index", maintain_order=True)


# --- Measured effects of direction, position, stops and temperature, as tables of a drive's friction.
#
#   F(v, x, ...) = s (1 + slope (x - x0) + waves) [levels(v) + Fd(age)] + viscous v
#
# The factors of direction s and of position act on the levels, Coulomb and breakaway force. The curves are means of
# both directions over the common range and also contain the viscous part. The age of the contact is that of the drive's
# law. A stop of duration t leaves Fd = B psi(t), sliding leaves Fd(L/|v|), and after a restart the age falls as
# exp(-travel/L).
#
# Friction laws are fitted to the map of a campaign with these effects: one fit for each set of mounting, seal and
# drive.

#: Largest relaxed fraction of the friction at the start of a hold that bristles of a drive allow.
MOST_RELAXED = 0.99

Part = tuple[str, Plain, dict[str, Estimate]]
"""Key in [friction], entries of its table that are not estimates, and its estimates by name."""


# --- direction and position ----------------------------------------------------------------------------------------


def _direction(
    found: CampaignCharacteristics, viscous_n_s_m: float, levels: tuple[str, str, str], notes: list[str]
) -> Iterator[Part]:
    """Yield the factors on dry friction in +x and -x: 1 plus or minus half the relative difference of directions."""
    own, shares = [one for one in found.asymmetry if one.condition.levels == levels], []
    both = {curve.condition: curve for curve in found.curves if curve.direction == BOTH}
    for one in own:
        curve = both[one.condition]
        level = float(np.mean((curve.friction_n - viscous_n_s_m * curve.speed_m_s)[curve.measured]))
        if one.basis == "tare" and level > 0.0:
            shares.append(one.mean.scaled(1.0 / level, "1"))
    if own and not shares:
        notes.append(sentence("modifier.no_tare"))
    if not shares:
        return
    # Mean of the shares, weighted by the inverse of their variances.
    weights = np.array([1.0 / max(share.stderr, 1e-300) ** 2 for share in shares])
    value = float(weights @ [share.value for share in shares] / weights.sum())
    freedom = max(share.degrees_of_freedom for share in shares)
    mean = Estimate.of(value, float(weights.sum() ** -0.5), freedom, "1")
    if mean.differs:
        positive = Estimate(1.0 + mean.value, 1.0 + mean.low, 1.0 + mean.high, mean.stderr, "1")
        negative = Estimate(1.0 - mean.value, 1.0 - mean.high, 1.0 - mean.low, mean.stderr, "1")
        yield "direction", {}, {"positive": positive, "negative": negative}


def _position(found: CampaignCharacteristics, viscous_n_s_m: float, levels: tuple[str, str, str]) -> Iterator[Part]:
    """Yield trend and waves of dry friction over position, scaled so that their mean over the common range is 1."""
    curves = [curve for curve in found.curves if curve.direction == BOTH and curve.condition.levels == levels]
    own = [one for one in found.position if curves and one.levels == curves[0].condition.title]
    if not own:
        return
    pattern = max(own, key=lambda one: (one.condition is None, one.cycles))
    viscous = [viscous_n_s_m * curve.speed_m_s / curve.friction_n for curve in curves]
    level = 1.0 - float(np.mean(np.concatenate(viscous)))  # share of the levels in the reference of the pattern
    away = pattern.position_m - (middle := float(pattern.position_m.mean()))
    shape = np.zeros(away.size)
    for wave in pattern.harmonics:
        phase = 2.0 * np.pi * away / wave.wavelength_m
        shape += wave.cosine.value * np.cos(phase) + wave.sine.value * np.sin(phase)
    scale = 1.0 / (level - float(shape.mean()))  # the constant of the drive's factor is one
    # a trend is not the mean over speeds but that of the most informative cycles: their fraction is arbitrary
    spread = scale**2 * float(np.std(np.concatenate(viscous))) * abs(pattern.trend_per_m.value)
    slope = pattern.trend_per_m.scaled(scale).widened(spread)
    harmonics = [
        {
            "period": f"{wave.wavelength_m:.6g} m",
            "amplitude": round(scale * wave.amplitude.value, 6),
            "phase": f"{-float(np.arctan2(wave.sine.value, wave.cosine.value)):.6g} rad",
        }
        for wave in pattern.harmonics
    ]
    if harmonics or slope.differs:
        table: Plain = {"reference": f"{middle:.6g} m"} | ({"harmonics": harmonics} if harmonics else {})
        yield "position", table, {"slope": slope} if slope.differs else {}


# --- stops ---------------------------------------------------------------------------------------------------------


def _contact_age(
    series: dwell_law.DwellSeries | None, ambient_pa: float, notes: list[str]
) -> dwell_law.ContactAge | None:
    """Fit the ageing of the contact by the best law of breakaway growth that a drive file supports."""
    if series is None:
        return None
    if not series.laws or series.slope is None:
        notes.append(sentence("modifier.no_law"))
        return None
    law = next((law for law in series.laws if law.form.growth), None)
    if law is None or not series.slope.differs:
        return None
    return dwell_law.fit_contact_age(series.stops, law.form, law.shape.get("m", law.form.exponent), ambient_pa)


def _dwell(age: dwell_law.ContactAge, notes: list[str]) -> Iterator[Part]:
    table: Plain = {"growth": age.form.growth}
    estimates = {"increment": age.increment, "time": age.time}
    if age.distance is None:
        notes.append(sentence("modifier.no_distance"))
        table["distance"] = f"{age.distance_m:.6g} m"
    else:
        estimates["distance"] = age.distance
    if age.together:
        notes.append(sentence("modifier.together"))
    if age.form.growth == "saturating":
        table["exponent"] = age.exponent
    if age.share_a_pa or age.share_b_pa:
        table["pressure"] = {"a": f"{age.share_a_pa:.6g} 1/Pa", "b": f"{age.share_b_pa:.6g} 1/Pa"}
    yield "dwell", table, estimates


def _relaxation(stops: pl.DataFrame, notes: list[str]) -> Iterator[Part]:
    """Yield the relaxed fraction and the time constant of a held force, if one time constant describes its decay."""
    differs = (pl.col("relaxation_n_low") > 0.0) | (pl.col("relaxation_n_high") < 0.0)
    held = stops.filter(pl.col("relaxation_n").is_not_nan(), differs)
    if len(held) < dwell_law.FEWEST_STOPS:
        return
    of_one_time = held.filter(relaxation_form="exponential")
    if len(of_one_time) <= len(held) / 2:
        notes.append(sentence("modifier.not_exponential"))
        return
    amplitude = of_one_time["relaxation_amplitude_n"].to_numpy()
    shares = amplitude / (of_one_time["relaxation_held_n"].to_numpy() + amplitude)
    shares = shares[(shares > 0.0) & (shares < MOST_RELAXED)]
    if shares.size < dwell_law.FEWEST_STOPS:
        return
    time = mean_estimate(np.log(of_one_time["relaxation_time_s"].to_numpy()), "1")
    middle, low, high = (float(np.exp(end)) for end in (time.value, time.low, time.high))
    notes.append(sentence("modifier.bristles"))
    table: Plain = {"distance": f"{dwell_law.ASSUMED_DISTANCE_M:.6g} m"}
    yield "relaxation", table, {"share": mean_estimate(shares, "1"), "time": Estimate(middle, low, high, np.nan, "s")}


def _temperature(found: CampaignCharacteristics, viscous_n_s_m: float) -> Iterator[Part]:
    """Yield the change of friction with temperature, relative to the mean dry friction."""
    per_kelvin = None if found.drift is None else found.drift.per_kelvin
    if per_kelvin is None or not per_kelvin.differs:
        return
    sliding = found.cycles.filter(pl.all_horizontal(pl.col("friction_n", "temperature_k").is_finite()))
    level = float((sliding["friction_n"] - viscous_n_s_m * sliding["speed_m_s"]).to_numpy().mean())
    kelvin = float(sliding["temperature_k"].to_numpy().mean())
    if level > 0.0:
        yield "temperature", {"reference": f"{kelvin:.6g} K"}, {"levels": per_kelvin.scaled(1.0 / level, "1/K")}


ALL = "all cycles"  # the group of a campaign without levels
NO_POINTS = ("stick_slip", "speed_ripple", "force_swing", "saturated", "unpaired", "outlier", "negative_friction")


def fit_campaign(found: CampaignCharacteristics) -> tuple[GroupFits, list[str]]:
    """Fit friction laws to the map of a campaign, and add the friction modifiers that the campaign measured.

    Parameters
    ----------
    found : CampaignCharacteristics

    Returns
    -------
    dict of dict of FrictionFit, list of str
        Group -> law -> fit, and the failures. A group is a set of mounting, seal and drive, or
        ``all cycles`` in a campaign without levels. Friction may depend on pressure if the campaign has several
        pressures.
    """
    with one_thread():
        table = found.friction_map
        names = [ALL if name == ALL_RECORDINGS else name for name in assemblies_of(table)]
        fits, problems = fit_groups(table, names, NO_POINTS)
        for group, by_law in fits.items():
            part = table.isel(row=np.flatnonzero(np.array(names) == group))
            fits[group] = {law: with_dependences(fit, found, part) for law, fit in by_law.items()}
        return fits, problems


def with_dependences(fit: FrictionFit, found: CampaignCharacteristics, part: xr.Dataset) -> FrictionFit:
    """Return a fit with the friction modifiers that the campaign measured. `part` has the fitted rows of the map.

    Only significant effects are modifiers. Notes list the other effects, and effects that a drive file cannot describe.
    Rows of several sets of mounting, seal and drive have no common modifiers, and a note reports this.
    """
    source, sets = f"campaign {found.name}", set(zip(*(part[name].to_numpy().tolist() for name in LEVELS), strict=True))
    if len(sets) > 1:
        return replace(fit, dependences=Dependences(source, (sentence("modifier.averaged"),)))
    viscous, levels = fit.values["viscous"] if "viscous" in fit.determined else 0.0, sets.pop()
    notes: list[str] = []
    held = [one for one in found.dwell if one.conditions and not one.released and one.conditions[0].levels == levels]
    series = max(held, key=lambda one: len(one.stops), default=None)
    with one_thread():
        age = _contact_age(series, found.identity.ambient_pressure_pa, notes)
    parts = [
        *_direction(found, viscous, levels, notes),
        *_position(found, viscous, levels),
        *(() if age is None else _dwell(age, notes)),
        *(() if series is None else _relaxation(series.stops, notes)),
        *_temperature(found, viscous),
    ]
    # The drift over the sliding distance is measured per decade, without a limit. ``[friction.wear]`` decays
    # exponentially to the friction after run-in, to which the parameters of the law belong. A logarithmic drift
    # determines neither this friction nor the run-in distance.
    per_decade = None if found.drift is None else found.drift.per_decade_of_travel
    if per_decade is not None and per_decade.differs:
        notes.append(sentence("modifier.run_in", slope=per_decade.value))
    estimates = {f"friction.{key}.{name}": one for key, _, own in parts for name, one in own.items()}
    tables = {}  # in the form of a drive file: numbers, or texts with a unit
    for key, table, own in parts:
        written = {n: round(e.value, 6) if e.unit == "1" else f"{e.value:.6g} {e.unit}" for n, e in own.items()}
        tables[key] = table | written
    slow, fast = found.ranges.speed_m_s
    sliding = {} if age is None else {"breakaway": age.sliding_n(slow), "coulomb": age.sliding_n(fast)}
    ends = {name: [one.value, one.low, one.high] for name, one in estimates.items()}
    measured = Dependences(source, tuple(notes), sliding, ends, tables)
    is_of_both = fit.provenance["direction"] == "both"
    return replace(fit, dependences=measured if is_of_both else measured.without("direction"))
