"""Selection of the statements (sentences.toml) on effects that a campaign determines or does not determine."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from pneudrive.estimate.estimates import CHANCE, NORMAL_95, student
from pneudrive.friction.campaign.curves import Fits, deviation_n
from pneudrive.friction.campaign.points import NEGATIVE, OUTLIER, CurvePoints, suspicions
from pneudrive.friction.campaign.reading import CampaignData
from pneudrive.friction.campaign.result import AirShare, Asymmetry, CampaignCharacteristics
from pneudrive.friction.campaign.trends import TOGETHER, causes, pure_scatter
from pneudrive.friction.friction_map import BOTH, PA_PER_BAR
from pneudrive.friction.sentences import NAMED, Statement, named, say
from pneudrive.signals.motion import straight_line

SERVICE_BAR = (3.0, 10.0)  # gauge pressures at which such drives are used (assumed)
FEW_LEVELS = 5  # speeds: fewer do not show the shape of a curve
LAST_SHARE = 0.25  # of the campaign's time: last part over which friction still changes
LEAVES = 2.0  # quantiles of 95 % beyond which a cycle differs from its curve
ROUNDING = 1e-12  # of the friction: least scatter, because data without noise have none
KIND_TOLD = 0.05  # least probability for a statement on the form of scatter


def statements(
    found: CampaignCharacteristics, reading: CampaignData, points: CurvePoints | None, fits: Fits | None
) -> tuple[Statement, ...]:
    """Return statements on the determined and undetermined effects."""
    said = [*_data(found, reading, points)]
    if fits is None:
        return (*said, say("curve.none"))
    said += [*_curves(found, reading, fits), *_scatter(found, reading, fits), *_drift(found, fits)]
    said += [*_directions(found, reading), *_pressures(found), *_position(found), *_unsteady(found)]
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


def _curves(found: CampaignCharacteristics, reading: CampaignData, fits: Fits) -> Iterator[Statement]:
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


def _scatter(found: CampaignCharacteristics, reading: CampaignData, fits: Fits) -> Iterator[Statement]:
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
            cycle_n = deviation_n(fits, "cycle", curve.friction_n[once])
            shares.append((curve.high_n - curve.low_n)[once] / (2.0 * NORMAL_95 * cycle_n))
        share = np.concatenate(shares)
        if share.size and np.median(share) < 1.0:
            count = sum(kinds.count("sentinel") for kinds in fits.points.labels("kind", np.arange(len(fits.points))))
            narrow = {"narrow": (share < 1.0).sum(), "points": share.size, "least": share.min()}
            yield say("repeatability.measured_once", sentinels=count, **narrow)
    if fits.friction.data.blocks is None:
        several = any(np.ptp(reading.sliding[name]) > 0 for name in ("day", "block"))
        yield say("repeatability.one_block_each" if several else "repeatability.one_block")
    points, pure = fits.points, pure_scatter(fits)
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


def _drift(found: CampaignCharacteristics, fits: Fits) -> Iterator[Statement]:
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
    changing = {name: column for name, column in causes(fits).items() if np.ptp(column) > 0 and name != "interrupted"}
    for a, b in combinations(changing, 2):
        if abs(r := np.corrcoef(changing[a], changing[b])[0, 1]) > TOGETHER:
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


def _position(found: CampaignCharacteristics) -> Iterator[Statement]:
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
