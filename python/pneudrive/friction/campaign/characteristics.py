"""All characteristics of a campaign folder, computed by one function."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from pneudrive.arrays import Plain, attributes_of, by_name, evenly
from pneudrive.batching import many_objects
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.estimate.estimates import CHANCE, NORMAL_95, Estimate, mean_estimate, one_thread, student
from pneudrive.friction.campaign import curves as campaign_curves
from pneudrive.friction.campaign import trends
from pneudrive.friction.campaign.points import NEGATIVE, OUTLIER, CurvePoints, points_of, suspicions
from pneudrive.friction.campaign.reading import CampaignData, Loop, read_campaign, read_each, reading_of, reversal_loop
from pneudrive.friction.campaign.result import AirShare, Asymmetry, CampaignCharacteristics, Ranges
from pneudrive.friction.campaign.stops import dwell_law
from pneudrive.friction.campaign.stops.stop import find_stops
from pneudrive.friction.characterisation import Characterisation, characterise_recordings
from pneudrive.friction.friction_map import ALL_RECORDINGS, BOTH, LEVELS, PA_PER_BAR, TABLES, assemblies_of
from pneudrive.friction.sentences import NAMED, Statement, named, say, sentence
from pneudrive.friction.strokes import SAMPLE_CHOICES, SampleChoice, Settled
from pneudrive.identify.identified import Dependences
from pneudrive.identify.static.fit import GroupFits, fit_groups
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.signals.load import recordings_in
from pneudrive.signals.motion import straight_line

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
        The call ends once this flag is set.

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
    """Return friction loops without offset, at several speeds, for the first `SHOWN_CONDITIONS` conditions."""
    files, chosen = {file.cycle.key: file for file in reading.files}, list[int]()
    for index in range(SHOWN_CONDITIONS if files else 0):
        rows = np.flatnonzero((points["curve"] == index) & (points["set_speed_m_s"] > 0))
        levels = np.unique(points["level"][rows])
        for level in levels[evenly(levels.size, SHOWN_SPEEDS)] if levels.size else ():
            chosen.append(int(rows[points["level"][rows] == level][0]))
    loops = read_each([files[points["key"][i]] for i in chosen], reversal_loop, reading.identity, choice)
    pairs = zip(loops, points["offset_n"][chosen].tolist(), strict=True)
    return tuple(replace(loop, friction_n=loop.friction_n - offset) for loop, offset in pairs if isinstance(loop, Loop))


#: Columns of `SUMMARY` that hold forces; values of these columns and of the reason in a cycle without both directions.
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


# --- Selection of the statements (sentences.toml) on effects that the campaign determines or does not determine.

SERVICE_BAR = (3.0, 10.0)  # gauge pressures at which such drives are used (assumed)
FEW_LEVELS = 5  # speeds: fewer do not show the shape of a curve
LAST_SHARE = 0.25  # of the campaign's time: last part over which friction still changes
LEAVES = 2.0  # quantiles of 95 % beyond which a cycle differs from its curve
ROUNDING = 1e-12  # of the friction: least scatter, because data without noise have none
KIND_TOLD = 0.05  # least probability for a statement on the form of scatter


def statements(
    found: CampaignCharacteristics, reading: CampaignData, points: CurvePoints | None, fits: campaign_curves.Fits | None
) -> tuple[Statement, ...]:
    """Return statements on the determined and undetermined effects."""
    said = [*_data(found, reading, points)]
    if fits is None:
        return (*said, say("curve.none"))
    said += [*_curves(found, reading, fits), *_scatter(found, reading, fits), *_drift(found, fits)]
    said += [*_directions(found, reading), *_pressures(found), *_along_stroke(found), *_unsteady(found)]
    return tuple(said)


def _data(found: CampaignCharacteristics, reading: CampaignData, points: CurvePoints | None) -> Iterator[Statement]:
    if found.skipped:
        several = named((f"{s.key or s.file}: {s.reason}" for s in found.skipped), "; ")
        yield say("data.skipped", count=len(found.skipped), named=several)
    if found.flags:
        yield say("data.flags", counts=", ".join(f"{flag} in {n}" for flag, n in sorted(found.flags.items())))
    sliding, keys = reading.sliding, reading.sliding["key"]
    single = ~sliding.moves.all(axis=1)
    if points is not None and single.any():
        yield say("data.unpaired", count=single.sum(), keys=named(keys[single]))
    used, recorded = (np.nansum(sliding[name], axis=1).astype(int) for name in ("strokes", "strokes_recorded"))
    if (some := used < recorded).any():
        numbers = {"used": used[some].sum(), "recorded": recorded[some].sum()}
        yield say("data.strokes", count=some.sum(), keys=named(keys[some]), **numbers)
    if points is not None and (bad := points["reason"] == NEGATIVE).any():
        yield say("data.negative", negative=bad.sum(), count=len(points), keys=named(points["key"][bad]))
    yield from suspicions(reading.sliding, reading.identity.accuracy, reading.identity.ambient_pressure_pa)
    if reading.notes:
        yield say("data.notes", notes=named(reading.notes, "; "))
    if found.synthetic:
        yield say("data.synthetic")
    slowest, fastest = found.ranges.speed_m_s
    if np.isfinite(slowest):
        a, b = ([p / PA_PER_BAR for p in span] for span in (found.ranges.gauge_a_pa, found.ranges.gauge_b_pa))
        yield say("range.measured", slowest=1e3 * slowest, fastest=1e3 * fastest, a=_span(a, "g"), b=_span(b, "g"))
        if (highest := max(a + b)) < SERVICE_BAR[0]:
            yield say("range.below_service", highest=highest, service=SERVICE_BAR)


def _curves(found: CampaignCharacteristics, reading: CampaignData, fits: campaign_curves.Fits) -> Iterator[Statement]:
    """Return statements on the curves and on the accuracy of the force sensor."""
    points, known, gain = fits.points, found.identity.force_calibration, reading.gain
    measured = {c.condition: int(c.measured.sum()) for c in found.curves}
    poor = [c.label(found.identity.ambient_pressure_pa) for c, n in measured.items() if n < FEW_LEVELS]
    if poor:
        yield say("curve.few_speeds", few=FEW_LEVELS, conditions="; ".join(poor))
    place = 1e3 * points.pattern["position_m"][points.pattern["common"]]
    relative = fits.friction.relative
    open_kind = KIND_TOLD < relative < 1.0 - KIND_TOLD
    kind = "curve.mean" if open_kind else "curve.mean_relative" if relative > 0.5 else "curve.mean_in_newton"
    yield say(kind, first_mm=place[0], last_mm=place[-1])
    if points["assumed"].any():
        yield say("curve.accuracy_assumed" if "force_n" in found.identity.accuracy else "curve.accuracy_not_stated")
    largest = np.abs(points["force_n"]).max()
    if known is not None and 0.0 < known.largest_n < largest:
        yield say("curve.beyond_calibration", largest=largest, known=known)
    if gain.cycles:
        percent = {"measured": 100 * gain.measured, "expanded": 200 * gain.measured_stderr, "taken": 100 * gain.error}
        yield say(gain.sentence, **percent)


def _scatter(found: CampaignCharacteristics, reading: CampaignData, fits: campaign_curves.Fits) -> Iterator[Statement]:
    """Return statements on the scatter of the cycles, and on good or suspect cycles that differ from their curve."""
    repeat = found.repeatability
    assert repeat is not None
    is_once, used = repeat.basis == "smooth curve", fits.points.at(fits.points.use)
    kind = "within" if repeat.between is None else "within_and_between"
    kind = "strokes_only" if is_once and not reading.files else kind  # strokes of recordings are repeated, no speed
    numbers = {"fewest": used["strokes"].min(), "stderr": used["friction_stderr_n"].max()}
    yield say(f"repeatability.{kind}", r=repeat, kind=fits.block_kind, **numbers)
    # Points without repeats: their narrow band comes from neighbouring points.
    if is_once and reading.files:
        yield say("repeatability.nothing_repeated")
    elif repeat.basis == "sentinels":
        shares = []  # width of the band at a point measured once, over the 95 % scatter of a single cycle
        for curve in (c for c in found.curves if c.direction == BOTH):
            once = curve.cycles == 1
            cycle_n = campaign_curves.deviation_n(fits, "cycle", curve.friction_n[once])
            shares.append((curve.high_n - curve.low_n)[once] / (2.0 * NORMAL_95 * cycle_n))
        share = np.concatenate(shares)
        if share.size and np.median(share) < 1.0:
            count = sum(kinds.count("sentinel") for kinds in fits.points.labels("kind", np.arange(len(fits.points))))
            narrow = {"narrow": (share < 1.0).sum(), "points": share.size, "least": share.min()}
            yield say("repeatability.measured_once", sentinels=count, **narrow)
    if fits.friction.data.blocks is None:
        several = any(np.ptp(reading.sliding[name]) > 0 for name in ("day", "block"))
        yield say("repeatability.one_block_each" if several else "repeatability.one_block")
    points, pure = fits.points, trends.pure_scatter(fits)
    if pure is not None:
        data, single = fits.friction.data, pure[0]
        rest = data.y - fits.friction.drift.mean - fits.friction.steady()
        scatter = np.hypot(single.value / np.sqrt(data.count), np.sqrt(data.noise))
        off = np.abs(rest) / np.maximum(scatter, ROUNDING * np.abs(points["friction_n"]).max())
        far = np.flatnonzero(off > student(single.degrees_of_freedom) * LEAVES)
        if far.size:
            keys = points["key"][points.use]
            worst = far[np.argsort(-off[far])].tolist()
            several = named(f"{keys[i]} {off[i]:.2g}" for i in worst)
            yield say("curve.leaves", count=far.size, named=several)
    if fits.doubtful:
        keys = named(points["key"][list(fits.doubtful)])
        yield say("curve.doubtful", count=len(fits.doubtful), keys=keys)


def _drift(found: CampaignCharacteristics, fits: campaign_curves.Fits) -> Iterator[Statement]:
    drift = found.drift
    assert drift is not None
    if not fits.friction.data.drift:
        yield say("drift.not_carried" if np.ptp(fits.points["order"]) > 0.0 else "drift.no_order")
        return
    yield say("drift.moved", moved=np.ptp(drift.drift_n), drift=drift, share=100.0 * drift.spread_n / fits.level_n)
    last = drift.time_s >= drift.time_s[0] + (1.0 - LAST_SHARE) * np.ptp(drift.time_s)
    if last.sum() >= NAMED:
        # From a line: a single cycle at either end is chance.
        slope, _ = straight_line(drift.time_s[last], drift.drift_n[last])
        change = slope * np.ptp(drift.time_s[last])
        if abs(change) > np.mean((drift.high_n - drift.low_n)[last]) / 2.0:
            yield say("drift.still_changing", change=change, share=100 * LAST_SHARE)
    effects = {"time": drift.per_hour, "travel (run-in)": drift.per_decade_of_travel, "temperature": drift.per_kelvin}
    for cause, effect in effects.items():
        if effect is not None:
            yield say("drift.effect", cause=cause, effect=effect)
    # Causes that change together cannot be separated.
    seen = trends.causes(fits)
    changing = {name: column for name, column in seen.items() if np.ptp(column) > 0 and name != "interrupted"}
    for a, b in combinations(changing, 2):
        if abs(r := np.corrcoef(changing[a], changing[b])[0, 1]) > trends.TOGETHER:
            yield say("drift.together", first=a.title(), second=b, r=r)
    if drift.interrupted is not None:
        yield say("drift.interrupted", effect=drift.interrupted)
    else:
        yield say("drift.never_interrupted")


def _directions(found: CampaignCharacteristics, reading: CampaignData) -> Iterator[Statement]:
    """Return statements on the zeros of the sensors and on the difference of the directions."""
    for chamber, zero in reading.pressure_zeros.items():
        if zero["tares"]:
            yield say("zero.pressure", chamber=chamber, zero=zero, expanded=2 * zero["stderr_pa"])
        for fault, tares in zero["unusable"].items():
            if tares:
                several = named(f"{key}: {value:+.3g} Pa" for key, value in tares.items())
                yield say(fault, chamber=chamber, count=len(tares), named=several)
    if found.zero.basis != "tare":
        yield say("direction.no_tare")
        return
    if found.zero.per_hour is not None:
        yield say("zero.drift", effect=found.zero.per_hour)
    for kind, differs in (("differs", True), ("equal", False)):
        group = [a for a in found.asymmetry if (a.mean.p < CHANCE) == differs]
        if group:
            values = [a.mean.value for a in group]
            half = max((a.mean.high - a.mean.low) / 2.0 for a in group)
            ends = " to ".join(dict.fromkeys(f"{v:.3g}" for v in (min(values), max(values))))
            yield say(f"direction.{kind}", where=_where(found, group), values=ends, half=half)


def _pressures(found: CampaignCharacteristics) -> Iterator[Statement]:
    """Return statements on the effects of the chamber pressures, and on the force of the air."""
    for effect in found.pressure:
        prefix = f"{effect.levels}: " if effect.levels else ""
        separate = {"a", "b"} <= effect.slopes.keys()
        yield say("pressure.effect" if separate else "pressure.not_separate", prefix=prefix, effect=effect)
        if separate and effect.interaction is None:
            yield say("pressure.not_crossed", prefix=prefix)
    if not found.pressure:
        pairs = {(c.condition.pressure_a_pa, c.condition.pressure_b_pa) for c in found.curves}
        yield say("pressure.one_pair" if len(pairs) == 1 else "pressure.no_common_speed")
    if not (shares := found.air):
        return
    where, speed = f"At {_where(found, shares)}", 1e3 * max(s.speed_m_s[-1] for s in shares)
    if shares[0].separated:
        air = _span([s.air_n[-1] for s in shares])
        total = _span([s.total_n[-1] for s in shares])
        half = max((s.air_high_n[-1] - s.air_low_n[-1]) / 2.0 for s in shares)
        yield say("air.separated", where=where, speed=speed, air=air, half=half, total=total)
    else:
        yield say("air.bound", where=where, speed=speed, air=_span([s.air_bound_n[-1] for s in shares]))


def _where(found: CampaignCharacteristics, results: Sequence[AirShare | Asymmetry]) -> str:
    """Return the condition of the results as text; for several conditions, return their number."""
    label = results[0].condition.label(found.identity.ambient_pressure_pa)
    return label if len(results) == 1 else f"{len(results)} conditions"


def _span(values: Sequence[float], form: str = ".2f") -> str:
    ends = (format(round(v, 2) + 0.0, form) for v in (min(values), max(values)))  # no "-0.00"
    return " to ".join(dict.fromkeys(ends))


def _along_stroke(found: CampaignCharacteristics) -> Iterator[Statement]:
    whole = [p for p in found.position if p.condition is None]
    if not whole:
        yield say("position.none")
    for p in whole:
        prefix = f"{p.levels}: " if p.levels else ""
        yield say("position.trend", prefix=prefix, trend=p.trend_per_m.scaled(100))
        strong = [h for h in p.harmonics if h.amplitude.p < CHANCE]
        if strong:
            waves = (f"{100 * h.amplitude.value:.2g} % at {1e3 * h.wavelength_m:.3g} mm" for h in strong)
            yield say("position.waves", prefix=prefix, waves=", ".join(waves))


def _unsteady(found: CampaignCharacteristics) -> Iterator[Statement]:
    """Return statements on the start of stick-slip, and on cycles that are excluded from F(v)."""
    for threshold in found.stick_slip_thresholds:
        if threshold.low_m_s > 0.0:
            condition = threshold.condition.label(found.identity.ambient_pressure_pa)
            yield say("stick-slip.threshold", condition=condition, threshold=threshold)
    points = [p for c in found.curves if c.direction == BOTH for p in c.excluded.iter_rows()]
    off = [f"{friction:.3g} N at {1e3 * speed:.3g} mm/s" for speed, friction, reason in points if reason == OUTLIER]
    if off:
        yield say("data.outliers", count=len(off), values=named(off))
    excluded = sorted((1e3 * speed, reason) for speed, _, reason in points if reason not in {OUTLIER, NEGATIVE})
    if excluded:
        slowest, fastest = excluded[0][0], excluded[-1][0]
        at = f"{slowest:.3g}" if fastest - slowest < 0.01 * slowest else f"{slowest:.3g} to {fastest:.3g}"
        reasons = ", ".join(sorted({why for _, why in excluded}))
        yield say("stick-slip.excluded", count=len(excluded), speeds=at, reasons=reasons)


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

#: Largest relaxed fraction that a drive's bristle model allows, relative to friction at the start of the hold.
MOST_RELAXED = 0.99

Part = tuple[str, Plain]
"""Key in [friction], and the table of this key. Measured values in the table are estimates."""

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
        yield "direction", {"positive": positive, "negative": negative}


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
        yield "position", table | ({"slope": slope} if slope.differs else {})


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
    if age.distance is None:
        notes.append(sentence("modifier.no_distance"))
        table["distance"] = f"{age.distance_m:.6g} m"
    if age.together:
        notes.append(sentence("modifier.together"))
    if age.form.growth == "saturating":
        table["exponent"] = age.exponent
    if age.share_a_pa or age.share_b_pa:
        table["pressure"] = {"a": f"{age.share_a_pa:.6g} 1/Pa", "b": f"{age.share_b_pa:.6g} 1/Pa"}
    measured = {"increment": age.increment, "time": age.time, "distance": age.distance}
    yield "dwell", table | {name: estimate for name, estimate in measured.items() if estimate is not None}


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
    table: Plain = {"distance": f"{dwell_law.ASSUMED_DISTANCE_M:.6g} m", "share": mean_estimate(shares, "1")}
    yield "relaxation", table | {"time": Estimate(middle, low, high, np.nan, "s")}


def _temperature(found: CampaignCharacteristics, viscous_n_s_m: float) -> Iterator[Part]:
    """Yield the change of friction with temperature, relative to the mean dry friction."""
    per_kelvin = None if found.drift is None else found.drift.per_kelvin
    if per_kelvin is None or not per_kelvin.differs:
        return
    sliding = found.cycles.filter(pl.all_horizontal(pl.col("friction_n", "temperature_k").is_finite()))
    level = float((sliding["friction_n"] - viscous_n_s_m * sliding["speed_m_s"]).to_numpy().mean())
    kelvin = float(sliding["temperature_k"].to_numpy().mean())
    if level > 0.0:
        yield "temperature", {"reference": f"{kelvin:.6g} K", "levels": per_kelvin.scaled(1.0 / level, "1/K")}


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
    If the rows have several sets of mounting, seal and drive, no modifiers are added, and a note reports this.
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
    ends, tables = {}, dict(parts)  # tables in the form of a drive file: numbers, or texts with a unit
    for key, table in parts:
        for name, e in ((name, e) for name, e in table.items() if isinstance(e, Estimate)):
            ends[f"friction.{key}.{name}"] = [e.value, e.low, e.high]
            table[name] = round(e.value, 6) if e.unit == "1" else f"{e.value:.6g} {e.unit}"
    slow, fast = found.ranges.speed_m_s
    sliding = {} if age is None else {"breakaway": age.sliding_n(slow), "coulomb": age.sliding_n(fast)}
    measured = Dependences(source, tuple(notes), sliding, ends, tables)
    is_of_both = fit.provenance["direction"] == "both"
    return replace(fit, dependences=measured if is_of_both else measured.without("direction"))
