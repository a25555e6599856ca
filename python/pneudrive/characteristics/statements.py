"""Sentences on what a campaign's data carry, what they do not carry, and which cycles would make them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.motion import straight_line
from pneudrive.characteristics.basics import BOTH, PA_PER_BAR, Statement
from pneudrive.characteristics.curves import deviation_n
from pneudrive.characteristics.drift import pure_scatter
from pneudrive.characteristics.plausible import NEGATIVE, suspicions
from pneudrive.characteristics.smooth import CARRIED
from pneudrive.estimate.estimates import NORMAL_95, student

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from pneudrive.characteristics.curves import Fits, Points
    from pneudrive.characteristics.drift import Causes
    from pneudrive.characteristics.effects import Drift, Repeatability
    from pneudrive.characteristics.reading import Reading
    from pneudrive.characteristics.result import CampaignCharacteristics
    from pneudrive.estimate.estimates import Estimate

    Array = NDArray[np.float64]

SERVICE_BAR = (3.0, 10.0)  # gauge pressures at which such drives are used (assumed)
CHANCE = 0.05
FEW_LEVELS = 5  # speeds: fewer do not show the shape of a curve
LAST_SHARE = 0.25  # of the campaign's time, over which a change is still going on
LEAVES = 2.0  # quantiles of 95 % beyond which a cycle is named that its curve leaves
KIND_TOLD = 0.05  # probability below which chance is not said to be of a kind
NAMED = 3  # cycles that are named where several share a fate


def statements(
    found: CampaignCharacteristics, reading: Reading, points: Points | None, fits: Fits | None, causes: Causes | None
) -> tuple[Statement, ...]:
    """Say what the data carry and what they do not."""
    said = [*_data(found, reading, points), *_ranges(found)]
    if points is None or fits is None:
        text = "No curve: fewer than four cycles have both directions and are points of F(v)."
        said.append(Statement("curve", text, carried=False, remedy="Add sweeps out and back at several speeds."))
        return tuple(said)
    said += [*_curves(found, reading, fits), *_scatter(found, reading, fits), *_drift(found, fits, causes)]
    said += [*_pressure_zeros(reading), *_directions(found), *_pressure(found), *_air(found)]
    said += [*_position(found), *_stick_slip(found)]
    return tuple(said)


def _data(found: CampaignCharacteristics, reading: Reading, points: Points | None) -> Iterator[Statement]:
    if found.skipped:
        named = "; ".join(f"{s.key or s.file}: {s.reason}" for s in found.skipped[:NAMED])
        more = f"; and {len(found.skipped) - NAMED} more" if len(found.skipped) > NAMED else ""
        text = f"{len(found.skipped)} cycle(s) could not be used: {named}{more}."
        yield Statement("data", text, carried=False, remedy="Repeat these cycles.")
    if found.flags:
        counts = ", ".join(f"{flag} in {number}" for flag, number in sorted(found.flags.items()))
        yield Statement("data", f"Cycles with flags: {counts}.")
    if points is not None and points.unpaired:
        keys = ", ".join(d.head.cycle.key for d in points.unpaired[:NAMED])
        text = f"{len(points.unpaired)} cycle(s) have one direction only ({keys}): they are in the map, in no curve."
        yield Statement("data", text, carried=False, remedy="Repeat them out and back.")
    yield from suspicions(reading, points)
    if reading.notes:
        yield Statement("data", f"On reading the folder: {'; '.join(reading.notes[:NAMED])}.")
    if found.synthetic:
        yield Statement("data", "Synthetic: a simulated rig made these data.")


def _ranges(found: CampaignCharacteristics) -> Iterator[Statement]:
    speed, a, b = found.ranges.speed_m_s, found.ranges.gauge_a_pa, found.ranges.gauge_b_pa
    if not np.isfinite(speed[0]):
        return
    text = (
        f"Measured at {1e3 * speed[0]:.3g} to {1e3 * speed[1]:.3g} mm/s, {_bar(a)} bar gauge in chamber a and "
        f"{_bar(b)} in chamber b; outside of that everything is extrapolation."
    )
    yield Statement("range", text)
    highest = max(a[1], b[1]) / PA_PER_BAR
    if highest < SERVICE_BAR[0]:
        yield Statement(
            "range",
            f"The highest pressure, {highest:.2g} bar gauge, lies below the {SERVICE_BAR[0]:g} to {SERVICE_BAR[1]:g} "
            "bar (assumed) at which such drives are used: friction in service is extrapolation.",
            carried=False,
            remedy="Add sweeps at service pressure, on both sides and on one.",
        )


def _bar(span: tuple[float, float]) -> str:
    low, high = (round(p / PA_PER_BAR, 2) + 0.0 for p in span)
    return f"{low:g}" if low == high else f"{low:g} to {high:g}"


def _curves(found: CampaignCharacteristics, reading: Reading, fits: Fits) -> Iterator[Statement]:
    measured = {c.condition: int(c.measured.sum()) for c in found.curves}
    poor = [c.label(found.identity.ambient_pressure_pa) for c, n in measured.items() if n < FEW_LEVELS]
    if poor:
        text = f"Fewer than {FEW_LEVELS} speeds at {'; '.join(poor)}: the curve's shape between them is hardly known."
        yield Statement("curve", text, carried=False, remedy="Add speeds, evenly spaced in their logarithm.")
    reduced = fits.points.reduced
    place = reduced.position_m[reduced.common]
    yield Statement(
        "curve",
        f"F(v) is the mean over positions {1e3 * place[0]:.4g} to {1e3 * place[-1]:.4g} mm, in the mean state of the "
        f"campaign; {_chance(fits.friction.relative)}.",
    )
    if any(d.assumed for d in reduced.data):
        known = "force_n" in found.identity.accuracy
        text = "is assumed" if known else "is not stated: 0.2 % of the largest force is assumed for its gain"
        yield Statement(
            "curve",
            f"The accuracy of the force sensor {text}.",
            carried=False,
            remedy="State the accuracy and the limits of a calibration in rig.json, or hang a known weight on it.",
        )
    known = found.identity.force_calibration
    largest = max(abs(side.force_n) for d in reduced.data for side in d.sides.values())
    if known is not None and 0.0 < known.largest_n < largest:
        yield Statement(
            "curve",
            f"Forces of up to {largest:.3g} N lie beyond the {known.largest_n:.3g} N to which the force sensor was "
            "calibrated: its curve was continued.",
            carried=False,
            remedy="Calibrate the force sensor over the forces of the campaign.",
        )
    gain = reading.gain
    if gain.cycles and gain.plausible:
        yield Statement(
            "curve",
            f"Known weights show a gain error of the force sensor of {100 * gain.measured:.2g} % "
            f"(±{200 * gain.measured_stderr:.2g} %); {100 * gain.error:.2g} % are taken out"
            f"{', though the stated accuracy does not allow so much' if gain.surprising else ''}.",
        )
    elif gain.cycles:
        yield Statement(
            "curve",
            f"Known weights show a force that is off by {100 * gain.measured:.0f} %: no gain is so wrong, and nothing "
            "was corrected.",
            carried=False,
            remedy="Check weight_n of the cycles, and that nothing else carried the weight.",
        )


def _chance(relative: float) -> str:
    if KIND_TOLD < relative < 1.0 - KIND_TOLD:
        return (
            "whether cycles scatter in newton or in proportion to friction these data leave open: the band holds both"
        )
    return f"cycles scatter {'in proportion to friction' if relative > 0.5 else 'in newton'}"


def _scatter(found: CampaignCharacteristics, reading: Reading, fits: Fits) -> Iterator[Statement]:
    repeat = found.repeatability
    if repeat is not None and repeat.within is not None:
        within = repeat.within
        text = (
            f"A cycle repeats within {within.value:.2g} N (standard deviation, from {repeat.basis}; 95 %: "
            f"{within.low:.2g} .. {within.high:.2g})"
        )
        if repeat.between is not None:
            text += f"; between {fits.block_kind}s {repeat.between.value:.2g} N"
        yield Statement("repeatability", text + ".")
        yield from _once(found, repeat, fits)
    yield from _left(fits)
    if fits.blocks is None:
        several = len(set(reading.days().values())) > 1 or len({head.cycle.block for head in reading.heads}) > 1
        text = (
            "Each mounting, seal and drive was measured in one block and on one day: what another mounting or day "
            "would change cannot be told from what the level itself changes"
            if several
            else "One block, one day: what another mounting or day would change is unknown"
        )
        remedy = "Repeat part of the campaign in another block, on another day."
        yield Statement("repeatability", f"{text}; it is not in the band.", carried=False, remedy=remedy)


def _once(found: CampaignCharacteristics, repeat: Repeatability, fits: Fits) -> Iterator[Statement]:
    """Say where the points themselves were not repeated, and the band is narrow because neighbours count."""
    remedy = "Repeat each point at least twice"
    if repeat.basis == "smooth curve":
        text = "Nothing was repeated: how much cycles scatter is taken from how smooth the curves are."
        yield Statement("repeatability", text, carried=False, remedy=f"{remedy}, or add sentinels.")
    elif repeat.basis == "sentinels":
        share = _of_single_cycles(found, fits)
        if share.size and np.median(share) < 1.0:
            count = sum(d.head.cycle.kind == "sentinel" for some in fits.points.members for d in some)
            text = (
                f"Each speed and pressure was measured once. At {(share < 1.0).sum()} of {share.size} points the band "
                f"is narrower than single cycles scatter (down to {share.min():.2g} of it), because neighbouring "
                f"speeds and other pressures count too; {count} sentinels tell the scatter. Where a curve "
                "bends between neighbouring speeds, or where the Stribeck speed moves with pressure, the band may be "
                "too narrow."
            )
            yield Statement("repeatability", text, carried=False, remedy=f"{remedy}, above all where the curve falls.")


def _of_single_cycles(found: CampaignCharacteristics, fits: Fits) -> Array:
    """Width of the band at each point that was measured once, over that of the 95 % scatter of a single cycle."""
    shares = [np.zeros(0)]
    for curve in found.curves:
        if curve.direction == BOTH:
            once = curve.measured & (curve.cycles == 1)
            scatter = NORMAL_95 * deviation_n(fits, "cycle", curve.friction_n[once])
            shares.append((curve.high_n - curve.low_n)[once] / (2.0 * scatter))
    return np.concatenate(shares)


def _left(fits: Fits) -> Iterator[Statement]:
    """Say where a curve leaves good cycles by more than cycles scatter, and which cycles are in doubt."""
    pure, points = pure_scatter(fits), fits.points
    if pure is not None:
        data = fits.friction.data
        off = np.abs(fits.rest()) / np.hypot(pure.estimate.value / np.sqrt(data.count), np.sqrt(data.noise))
        far = np.flatnonzero(off > student(pure.estimate.degrees_of_freedom) * LEAVES)
        if far.size:
            cycles = [d for d, use in zip(points.reduced.data, points.use, strict=True) if use]
            named = ", ".join(
                f"{cycles[i].head.cycle.key} by {off[i]:.2g} times" for i in far[np.argsort(-off[far])][:NAMED].tolist()
            )
            text = (
                f"The curves leave {far.size} cycle(s) by more than repeated cycles scatter ({named} the standard "
                "deviation): either these cycles are off, or the curve bends more sharply than its points show."
            )
            yield Statement("curve", text, carried=False, remedy="Repeat these cycles, and add speeds beside them.")
    if fits.doubtful:
        keys = ", ".join(points.reduced.data[i].head.cycle.key for i in fits.doubtful[:NAMED])
        text = (
            f"{len(fits.doubtful)} cycle(s) lie off what the others say, not beyond doubt ({keys}): the band holds "
            "both that they count and that they do not."
        )
        yield Statement("curve", text, carried=False, remedy="Repeat these cycles.")


def _drift(found: CampaignCharacteristics, fits: Fits, causes: Causes | None) -> Iterator[Statement]:
    drift = found.drift
    if drift is None:
        return
    if fits.drift_share >= CARRIED:
        yield Statement(
            "drift",
            "Time and speed went together: a drift cannot be told from the curve, and is not in the band.",
            carried=False,
            remedy="Repeat a reference speed every few cycles (sentinels), or randomise the order.",
        )
        return
    level = float(fits.points.reduced.friction_n[fits.points.use].mean())
    yield Statement(
        "drift",
        f"Friction drifted by {np.ptp(drift.drift_n):.2g} N over the campaign (told by {drift.basis}). The curves and "
        "their bands are those of the mean state of the campaign; in its other states friction differs from them by "
        f"{drift.spread_n:.2g} N, {100.0 * drift.spread_n / level:.2g} % (standard deviation).",
    )
    yield from still_changing(drift)
    for effect, name in (
        (drift.per_hour, "time"),
        (drift.per_decade_of_travel, "travel (run-in)"),
        (drift.per_kelvin, "temperature"),
    ):
        if effect is not None:
            yield Statement("drift", f"Effect of {name}: {_interval(effect)}; {_verdict(effect)}.")
    for a, b, r in causes.together if causes is not None else ():
        yield Statement(
            "drift",
            f"{a.title()} and {b} went together (correlation {r:+.2f}): which of them acts cannot be told.",
            carried=False,
            remedy="Spread the campaign so that they part: pauses at temperature, travel without time.",
        )
    if drift.interrupted is not None:
        effect = drift.interrupted
        yield Statement("drift", f"After an interruption friction differs by {_interval(effect)}; {_verdict(effect)}.")
    else:
        yield Statement(
            "drift",
            "Continuous against interrupted operation cannot be compared: too few cycles follow a rest, or all do.",
            carried=False,
            remedy="Put rests of minutes before some of the cycles.",
        )


def still_changing(drift: Drift) -> Iterator[Statement]:
    """Say where friction has not come to rest when the campaign ends."""
    last = drift.time_s >= drift.time_s[0] + (1.0 - LAST_SHARE) * np.ptp(drift.time_s)
    if last.sum() < NAMED:
        return
    # Of a line: a single cycle at either end is chance.
    slope, _ = straight_line(drift.time_s[last], drift.drift_n[last])
    change = slope * float(np.ptp(drift.time_s[last]))
    reach = float(np.mean((drift.high_n - drift.low_n)[last])) / 2.0
    if abs(change) > reach:
        yield Statement(
            "drift",
            f"Friction still changes at the end, by {change:+.2g} N over the last {100 * LAST_SHARE:.0f} % of time: "
            "what it comes to is not known.",
            carried=False,
            remedy="Add warm-up cycles, and repeat the campaign when the reference speed no longer drifts.",
        )


def _directions(found: CampaignCharacteristics) -> Iterator[Statement]:
    ambient = found.identity.ambient_pressure_pa
    if found.zero.basis != "tare":
        yield Statement(
            "direction",
            "Without tare cycles the zero of the force sensor cannot be told from a difference between the "
            "directions: curves of one direction hold all of it as uncertainty.",
            carried=False,
            remedy="Add tare cycles (axis released) before and after each block.",
        )
        return
    drift = found.zero.per_hour
    if drift is not None:
        yield Statement("zero", f"The force sensor's zero drifts by {_interval(drift)}; {_verdict(drift)}.")
    differ = [a for a in found.asymmetry if a.mean.p < CHANCE]
    same = [a for a in found.asymmetry if a.mean.p >= CHANCE]
    for group, text in (
        (differ, "friction differs between the directions"),
        (same, "friction is the same in both directions, as far as told"),
    ):
        if len(group) == 1:
            label = group[0].condition.label(ambient)
            yield Statement("direction", f"At {label} {text}: half the difference is {_interval(group[0].mean)}.")
        elif group:
            low, high = min(a.mean.value for a in group), max(a.mean.value for a in group)
            half = max((a.mean.high - a.mean.low) / 2.0 for a in group)
            yield Statement(
                "direction",
                f"At {len(group)} conditions {text}: half the difference is {low:.3g} to {high:.3g} N (95 %: "
                f"±{half:.2g} N at most).",
            )


def _pressure_zeros(reading: Reading) -> Iterator[Statement]:
    for chamber, zero in reading.pressure_zeros.items():
        sensor = f"The pressure sensor of chamber {chamber}"
        if zero.tares:
            text = (
                f"{sensor} shows {zero.mean_pa:+.3g} Pa (±{2 * zero.stderr_pa:.2g} Pa) beside ambient pressure in "
                f"{zero.tares} tare(s) with open chambers: taken off all cycles as its zero."
            )
            yield Statement("zero", text)
        for bad, what in (
            (zero.far, "is off ambient pressure by more than its accuracy explains"),
            (zero.unsteady, "was not steady"),
        ):
            if bad:
                named = ", ".join(f"{key}: {value:+.3g} Pa" for key, value in list(bad.items())[:NAMED])
                text = f"{sensor} {what} in {len(bad)} tare(s) ({named}): no zero is taken from them."
                remedy = "Check that the chambers were open, ambient_pressure_pa, and the sensor; then repeat the tare."
                yield Statement("zero", text, carried=False, remedy=remedy)


def _pressure(found: CampaignCharacteristics) -> Iterator[Statement]:
    for effect in found.pressure:
        prefix = f"{effect.levels}: " if effect.levels else ""
        separate = bool(effect.slope_a and effect.slope_b)
        remedy = "" if separate else "Add cycles with pressure in one chamber only, and with unequal pressures."
        yield Statement("pressure", prefix + effect.statement, carried=separate, remedy=remedy)
        if separate and effect.interaction is None:
            yield Statement(
                "pressure",
                f"{prefix}Whether the effects of both pressures add cannot be tested.",
                carried=False,
                remedy="Cross the pressures: at least two values in a with two in b.",
            )
    if not found.pressure:
        pairs = {(c.condition.pressure_a_pa, c.condition.pressure_b_pa) for c in found.curves}
        why = (
            "one pressure pair only" if len(pairs) == 1 else "no speed was measured at all pressure pairs with repeats"
        )
        text = f"The effect of pressure cannot be told: {why}."
        yield Statement("pressure", text, carried=False, remedy="Cross the same speeds with several pressure pairs.")


def _air(found: CampaignCharacteristics) -> Iterator[Statement]:
    ambient = found.identity.ambient_pressure_pa
    shares = found.air
    if not shares:
        return
    speed = 1e3 * max(s.speed_m_s[-1] for s in shares)
    where = f"At {shares[0].condition.label(ambient)}" if len(shares) == 1 else f"At {len(shares)} conditions"
    if shares[0].separated:
        values = [float(s.air_n[-1]) for s in shares]
        half = max(float(s.air_high_n[-1] - s.air_low_n[-1]) / 2.0 for s in shares)
        yield Statement(
            "air",
            f"{where} and {speed:.3g} mm/s the air takes {_span(values)} N (95 %: ±{half:.2g} N at most) of "
            f"{_span([float(s.total_n[-1]) for s in shares])} N; the rest is the seal.",
        )
        return
    yield Statement(
        "air",
        f"{where} pressures were measured at the regulator: air and seal cannot be separated. If the seal's friction "
        f"does not fall as speed rises, at most {_span([float(s.air_bound_n[-1]) for s in shares])} N at "
        f"{speed:.3g} mm/s are air.",
        carried=False,
        remedy="Measure pressure in the chambers, or repeat the fast sweeps with open ports.",
    )


def _span(values: list[float]) -> str:
    low, high = (f"{round(v, 2) + 0.0:.2f}" for v in (min(values), max(values)))  # no "-0.00"
    return low if low == high else f"{low} to {high}"


def _position(found: CampaignCharacteristics) -> Iterator[Statement]:
    overall = next((p for p in found.position if p.condition is None), None)
    if overall is None:
        text = "Friction over position cannot be told: too few cycles."
        yield Statement("position", text, carried=False, remedy="Add sweeps that settle over most of the stroke.")
        return
    trend = overall.trend_per_m
    text = f"Along x friction changes by {100 * trend.value:.2g} %/m (95 %: {100 * trend.low:.2g} .. "
    yield Statement("position", f"{text}{100 * trend.high:.2g}); {_verdict(trend)}.")
    strong = [h for h in overall.harmonics if h.amplitude.p < CHANCE]
    if strong:
        waves = ", ".join(f"{100 * h.amplitude.value:.2g} % at {1e3 * h.wavelength_m:.3g} mm" for h in strong)
        yield Statement("position", f"Friction varies over position: amplitude {waves}.")


def _stick_slip(found: CampaignCharacteristics) -> Iterator[Statement]:
    ambient = found.identity.ambient_pressure_pa
    for threshold in found.stick_slip_thresholds:
        if threshold.low_m_s > 0.0:
            yield Statement("stick-slip", f"At {threshold.condition.label(ambient)}: {threshold.text}.")
    all_excluded = [p for c in found.curves if c.direction == 0 for p in c.excluded]
    off = [p for p in all_excluded if p.reason == "outlier"]
    if off:
        values = ", ".join(f"{p.friction_n:.3g} N at {1e3 * p.speed_m_s:.3g} mm/s" for p in off[:NAMED])
        text = f"{len(off)} cycle(s) lie far off all others and were not counted: {values}."
        yield Statement("data", text, carried=False, remedy="Look at these cycles, and repeat them.")
    excluded = [p for p in all_excluded if p.reason not in {"outlier", NEGATIVE}]
    if excluded:
        speeds = sorted(1e3 * p.speed_m_s for p in excluded)
        reasons = ", ".join(sorted({p.reason for p in excluded}))
        at = f"{speeds[0]:.3g}" if speeds[-1] - speeds[0] < 0.01 * speeds[0] else f"{speeds[0]:.3g} to {speeds[-1]:.3g}"
        count = "1 cycle at" if len(excluded) == 1 else f"{len(excluded)} cycles at"
        are = "is no point" if len(excluded) == 1 else "are no points"
        yield Statement(
            "stick-slip",
            f"{count} {at} mm/s {are} of F(v) ({reasons}): shown, not counted.",
            carried=False,
            remedy="Measure these speeds on a stiffer rig, or fit them by simulating the rig.",
        )


def _interval(e: Estimate) -> str:
    return f"{e.value:.3g} {e.unit} (95 %: {e.low:.3g} .. {e.high:.3g})"


def _verdict(e: Estimate) -> str:
    return f"beyond chance (p = {e.p:.2g})" if e.p < CHANCE else f"not beyond chance (p = {e.p:.2g})"
