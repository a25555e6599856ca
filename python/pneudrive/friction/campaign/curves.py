"""Curves of friction over speed from the cycles of a campaign, with a band for all sources of uncertainty.

The module also finds effects of air, direction and stick-slip, the zero of the sensor, and the sources of uncertainty.

A moving piston pumps air through ports, lines and regulators. The pressure falls in the growing chamber and rises in
the other chamber. The resulting force opposes the motion like friction and rises with speed. If pressures are measured
in the chambers, this force is known and subtracted. If pressures are measured at the regulator, it is unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Columns, Ints, Row
from pneudrive.estimate.estimates import NORMAL_95, Estimate, rms
from pneudrive.estimate.mixed import MixedModel, RandomEffect
from pneudrive.friction.bins import known_mean
from pneudrive.friction.campaign import result, smooth
from pneudrive.friction.campaign.points import NAMES, OUTLIER, SAME_SPEED, STICK_SLIP, CurvePoints, shares_of
from pneudrive.friction.campaign.reading import GROWING, OF_SIDES, WAYS, CampaignData, CycleTable, Gain
from pneudrive.friction.friction_map import AMBIENT, BOTH, COLUMNS, HOUR_S, LEVEL_COLUMNS, LEVELS, columns_to_dataset
from pneudrive.friction.level import unseen_n
from pneudrive.friction.sentences import sentence
from pneudrive.signals.force_calibration import ForceCalibration

if TYPE_CHECKING:
    import xarray as xr


FEWEST = 4  # cycles
OF_SLIPS = ("period_s", "step_m")
BETWEEN = 24  # speeds of a curve between the measured ones
EXCLUDED = {"speed_m_s": float, "friction_n": float, "reason": str}  # columns of excluded points, and their types
#: Lower limit of the standard error at a speed, as a fraction of the standard error from its cycles alone. It applies
#: even if neighbouring speeds and other pressures seem to determine the curve better (assumed).
OWN_SHARE = 0.8


@dataclass(frozen=True, eq=False)
class Fits:
    """The fitted models from which the curves are computed.

    Attributes
    ----------
    points : CurvePoints
    friction : CurveFit
        Fit of friction, which is half the difference of the force balances in +x and -x.
    offset : CurveFit
        Fit of the offset, which is half the sum of these balances. Zero runs are included.
    block_kind : str
        Groups with a common deviation: block, day, or "" without groups.
    doubtful : tuple of int
        Points that are possible outliers. The curves are averages of fits with and without them.
    """

    points: CurvePoints
    friction: smooth.CurveFit
    offset: smooth.CurveFit
    block_kind: str
    doubtful: tuple[int, ...] = ()

    @cached_property
    def bands(self) -> tuple[Row, ...]:
        """Curves with all components of their bands, in the order of the conditions.

        ``number`` is the index of the curve in the models. ``index`` is the index of its condition in the points. Other
        entries have shape (m,). ``cycles`` is the number of cycles at each ``speed_m_s``; it is 0 between the measured
        speeds. ``value_n``, ``low_n`` and ``high_n`` are friction and its statistical 95 % interval. ``offset_n`` is
        half the sum of both directions, and ``offset_half_n`` half the width of its interval. Further entries come from
        `systematic`.
        """
        points, found = self.points, []
        for number, index in enumerate(sorted(set(points["curve"][points.use].tolist()))):
            # Speeds of the curve: the measured ones, and between them others without cycles.
            members = points.use & (points["curve"] == index)
            levels = [members & (points["level"] == k) for k in np.unique(points["level"][members])]
            measured = np.array([points["speed_m_s"][level].mean() for level in levels])
            between = np.geomspace(measured[0], measured[-1], BETWEEN + 2)[1:-1]
            between = between[np.abs(between[:, None] / measured - 1.0).min(axis=1) > SAME_SPEED / 2.0]
            counts = [points.count[level].sum() for level in levels]
            speed = np.concatenate([measured, between])
            order = np.argsort(speed)
            speed, cycles = speed[order], np.array([*counts, *[0] * between.size], dtype=np.int64)[order]
            value, low, high = by_chance(self, self.friction, number, speed, cycles)
            offset = self.offset.at(number, speed).predict()
            band = {"number": number, "index": index, "speed_m_s": speed, "cycles": cycles}
            band |= {"value_n": value, "low_n": low, "high_n": high}
            band |= {"offset_n": offset.mean, "offset_half_n": offset.half_width()}
            found.append(band | systematic(self, value, offset.mean, index))
        return tuple(found)

    @property
    def level_n(self) -> float:
        """Mean friction of the points, in N."""
        return self.points["friction_n"][self.points.use].mean()

    @property
    def scale_n(self) -> float:
        """Change in friction, in N, for one unit of the model's response, at mean friction."""
        return self.level_n if self.friction.data.logarithmic else 1.0

    @property
    def has_zero(self) -> bool:
        """Whether zero runs determine the zero of the force sensor."""
        return bool((self.offset.data.curve < 0).any())


def fitted(points: CurvePoints | None, tares: CycleTable) -> tuple[CurvePoints | None, Fits | None]:
    """Return the points with outliers marked, and the models (None with too few points of F(v)).

    Outliers are cycles that differ much from all others (a failed sensor). In a large campaign, no outliers are sought,
    and neighbouring repeats are merged into one point of the models.
    """
    if points is None:
        return None, None
    condensed = points.condensed()
    fits = _fit_points(condensed, tares)
    if fits is None or condensed is not points:
        return points, fits
    rows = np.flatnonzero(points.use)
    found, readings = smooth.wild_cycles(fits.friction.data)
    if found:
        reason = points["reason"].copy()
        reason[rows[found]] = OUTLIER
        points = points.having(reason=reason)
        fits = _fit_points(points, tares)
    if fits is not None and readings:
        left = np.flatnonzero(points.use)
        among = [np.searchsorted(left, rows[some]) for some in readings]
        doubtful = tuple(rows[readings[-1]].tolist())
        fits = replace(fits, friction=smooth.with_doubt(fits.friction, among), doubtful=doubtful)
    return points, fits


def _fit_points(points: CurvePoints, tares: CycleTable) -> Fits | None:
    use = points.use
    if use.sum() < FEWEST:
        return None
    curve = np.unique(points["curve"][use], return_inverse=True)[1].ravel()
    # Effects of blocks or days are separated from the levels if a level was run in several.
    blocks, kind = None, ""
    for name in ("block", "day"):
        shares = shares_of(points.labels(name, np.flatnonzero(use)))
        if any((shares[members[use]] > 0.0).any(axis=0).sum() > 1 for members in points.assemblies.values()):
            blocks, kind = shares, name
            break
    alike = (points["speed_m_s"][use], curve, points["order"][use], points.count[use])
    friction = smooth.CurveData(points["friction_n"][use], points["friction_stderr_n"][use] ** 2, *alike, blocks=blocks)
    better = smooth.fit_friction(replace(friction, drift=smooth.determines_drift(friction)))
    # Zero runs are observations of the zero alone, without a curve.
    zero, ones = (tares["standing_n"], tares["standing_stderr_n"] ** 2), np.ones(len(tares))
    of_tares = (*zero, np.nan * ones, np.full(len(tares), -1), tares["order"], ones)
    of_points = (points["offset_n"][use], points["offset_stderr_n"][use] ** 2, *alike)
    columns: list[Any] = [np.concatenate(both) for both in zip(of_points, of_tares, strict=True)]
    offset = smooth.CurveData(*columns)
    drifts = smooth.determines_drift(offset) or bool((offset.curve < 0).sum() > 1)
    return Fits(points, better, smooth.fit_curves(replace(offset, drift=drifts)), kind)


def fit_response(fits: Fits, y: Array, stderr: Array, *, drift: bool) -> smooth.CurveFit:
    """Fit curves to another result of the same cycles, with scatter that is constant in newton.

    Parameters
    ----------
    fits : Fits
        The models of friction, whose order, curves and blocks are used.
    y, stderr : ndarray, shape (n,)
        The other result of each cycle and its standard error.
    drift : bool
        Whether the result may drift like friction.
    """
    use, like = fits.points.use, fits.friction.data
    data = replace(like, y=y[use], noise=stderr[use] ** 2, logarithmic=False)
    return smooth.fit_curves(data if drift else replace(data, drift=False, blocks=None))


def systematic(fits: Fits, friction_n: Array, half_sum_n: Array, condition: Ints | int) -> Columns:
    """Return standard uncertainties in N, shape (m,), that all points of a condition have in common.

    They refer to `friction_n` and `half_sum_n`, half the difference and half the sum of both directions, at one
    condition or at the condition of each point. They are NaN at a condition without points of F(v).

    ``gain_n`` is the sensor error that is proportional to friction. ``hysteresis_n`` is the sensor error that is not.
    ``position_n`` is the uncertainty of friction over the part of the stroke that the mean does not cover.
    ``friction_u_n`` combines these three. It holds for the mean state of the campaign.

    ``state_n`` is the deviation of friction from the mean state. It applies to a single cycle, not to the mean curve.
    ``zero_n`` is the zero of the force sensor. ``direction_u_n`` applies to friction of one direction. It contains the
    zero and, without zero runs, the whole half sum.
    """
    points, pattern = fits.points, fits.points.pattern
    # The common range stands for the whole stroke: relative uncertainty of friction, and that of half the sum, N.
    common = pattern["common"]
    of_bins = (pattern[name][common] for name in ("friction", "offset_n"))
    unseen, unseen_offset_n = (unseen_n(values, common.mean()) for values in of_bins)
    used = points.at(points.use)
    count = np.bincount(used["curve"], minlength=len(points.conditions))
    with np.errstate(invalid="ignore"):
        names = ("u_gain_n", "friction_n", "u_hysteresis_n", "u_offset_n")
        gain, level, hysteresis, zero = (np.bincount(used["curve"], used[n], count.size) / count for n in names)
    spread, size = fits.friction.drift.mean.std(), np.abs(friction_n)
    ones = np.ones(size.size)
    terms = {
        "gain_n": (gain / np.maximum(np.abs(level), 1e-12))[condition] * size,
        "hysteresis_n": hysteresis[condition] * ones,
        "position_n": unseen * size,
        "state_n": spread * (size if fits.friction.data.logarithmic else ones),
        "zero_n": np.hypot(zero[condition], unseen_offset_n) * ones,
    }
    terms["friction_u_n"] = np.sqrt(terms["gain_n"] ** 2 + terms["hysteresis_n"] ** 2 + terms["position_n"] ** 2)
    return terms | {"direction_u_n": terms["zero_n"] if fits.has_zero else np.hypot(terms["zero_n"], half_sum_n)}


def curves_of(fits: Fits, *, contains_air: bool) -> tuple[result.Curve, ...]:
    """Return the curves of all conditions: for both directions together (half the difference), for +x and for -x."""
    points, curves = fits.points, list[result.Curve]()
    for band in fits.bands:
        out = points.at((points["curve"] == band["index"]) & ~points.use)
        excluded = pl.DataFrame({name: out[name].tolist() for name in EXCLUDED}, schema=EXCLUDED)
        value = band["value_n"]
        for direction in (BOTH, 1, -1):
            centre, below, above, u = value, value - band["low_n"], band["high_n"] - value, band["friction_u_n"]
            if direction != BOTH:
                centre = value + direction * band["offset_n"] if fits.has_zero else value
                u = np.hypot(u, band["direction_u_n"])
                below, above = np.hypot(below, band["offset_half_n"]), np.hypot(above, band["offset_half_n"])
            curve = result.Curve(
                condition=points.conditions[band["index"]],
                direction=direction,
                speed_m_s=band["speed_m_s"],
                friction_n=centre,
                low_n=centre - np.hypot(below, NORMAL_95 * u),
                high_n=centre + np.hypot(above, NORMAL_95 * u),
                stderr_n=(below + above) / (2.0 * NORMAL_95),
                u_systematic_n=u,
                cycles=band["cycles"],
                excluded=excluded.sort("speed_m_s", maintain_order=True),
                contains_air=contains_air,
                complete=fits.friction.data.drift,
            )
            curves.append(curve)
    return tuple(curves)


def friction_map(
    reading: CampaignData,
    points: CurvePoints | None,
    fits: Fits | None,
    protocol: str,
) -> xr.Dataset:
    """Return the map, one row per cycle and direction, in the order of the campaign."""
    cycles, edges, ambient_pa = reading.sliding, reading.edges_m, reading.identity.ambient_pressure_pa
    count, moves, known = len(cycles), cycles.moves, np.isfinite(cycles["balance_n"])
    columns: dict[str, np.ndarray] = {name: cycles[name] for name in COLUMNS if name in OF_SIDES}
    bands = [name for name in LEVEL_COLUMNS if name.endswith("_n")]
    columns |= {name: np.full((count, 2), np.nan) for name in ("offset_n", "stderr_n", "u_systematic_n", *bands)}
    columns["direction"] = np.tile(WAYS, (count, 1))
    columns["balance_n"] = known_mean(cycles["balance_n"], axis=2)
    columns["friction_n"] = WAYS * columns["balance_n"]
    columns["position_from_m"] = edges[known.argmax(axis=2)]
    columns["position_to_m"] = edges[known.shape[2] - known[:, :, ::-1].argmax(axis=2)]
    reason = np.full(count, "unpaired", dtype=object)
    if points is not None:
        both = moves.all(axis=1)
        reason[both] = points["reason"]
        for name, value in _paired(points, fits, edges[1] - edges[0]).items():
            columns[name][both] = value
    raised = zip(cycles["flags"], (why.replace("-", "_").replace(" ", "_") for why in reason), strict=True)
    flags = [",".join(dict.fromkeys(filter(None, [*flags, why]))) for flags, why in raised]
    of_cycle = {name: cycles[name] for name in ("temperature_k", "kind", "block", "repeat", "began_s")}
    of_cycle |= {name: [getattr(c, name) for c in cycles["condition"]] for name in LEVELS}
    of_cycle |= {"recording": cycles["key"], "flags": flags, AMBIENT: np.full(count, ambient_pa)}
    columns |= {name: np.tile(np.array(values)[:, None], 2) for name, values in of_cycle.items()}
    rows = {name: values[moves] for name, values in columns.items()}
    order = np.lexsort((-rows["direction"], rows["recording"].astype(str), rows["began_s"]))
    found = columns_to_dataset({name: values[order] for name, values in rows.items()}, {**COLUMNS, **LEVEL_COLUMNS})
    found.attrs |= {"title": "friction map of a campaign", "protocol": protocol, AMBIENT: ambient_pa}
    found.attrs["synthetic"] = reading.identity.synthetic
    return found


def _paired(points: CurvePoints, fits: Fits | None, width_m: float) -> dict[str, np.ndarray]:
    """Return the map columns of cycles with both directions, for bins of width `width_m` (shape (n, 1) or (n, 2))."""
    friction, offset = points["friction_n"][:, None], points["offset_n"][:, None]
    # Budget of each cycle: noise and scatter; systematic uncertainty, with the deviation from the mean state of the
    # campaign; further variance of a single direction (half the sum of both, zero). NaN without a curve.
    stderr, u, one_sided = points["friction_stderr_n"], np.nan * points["friction_n"], np.nan * points["friction_n"]
    own = u  # offset from the drifting zero of the force sensor; 0 without zero runs
    if fits is not None:
        cycle, block = (deviation_n(fits, name, points["friction_n"]) for name in ("cycle", "block"))
        shared = systematic(fits, points["friction_n"], points["offset_n"], points["curve"])
        scatter = np.hypot(points["offset_stderr_n"], fits.offset.fit.most_probable_sd("cycle"))
        u = np.hypot(shared["friction_u_n"], np.hypot(shared["state_n"], block))
        one_sided = scatter**2 + shared["direction_u_n"] ** 2
        stderr, own = np.hypot(stderr, cycle), np.zeros(len(points))
        if fits.has_zero:
            zero = fits.offset.fit.contrast(np.eye(fits.offset.data.kept.size)[0]).value
            order = fits.offset.data.order
            at = np.argsort(order, kind="stable")
            own = points["offset_n"] - zero - np.interp(points["order"], order[at], fits.offset.drift.mean[at])
    own = friction + WAYS * own[:, None]
    stderr, u, one_sided = (values[:, None] for values in (stderr, u, one_sided))
    half = NORMAL_95 * np.hypot(stderr, u)
    half_direction = NORMAL_95 * np.sqrt(stderr**2 + u**2 + one_sided)
    common = points.pattern["position_m"][points.pattern["common"]]
    return {
        "balance_n": WAYS * friction + offset,
        "friction_n": friction,
        "offset_n": offset,
        "stderr_n": stderr,
        "u_systematic_n": u,
        "friction_low_n": friction - half,
        "friction_high_n": friction + half,
        "friction_direction_n": own,
        "friction_direction_low_n": own - half_direction,
        "friction_direction_high_n": own + half_direction,
        "air_n": points["air_n"][:, None],
        "position_from_m": common[:1, None] - width_m / 2.0,
        "position_to_m": common[-1:, None] + width_m / 2.0,
    }


def by_chance(
    fits: Fits, fit: smooth.CurveFit, number: int, speed_m_s: Array, cycles: Ints
) -> tuple[Array, Array, Array]:
    """Return the values of a curve and the bounds of the statistical 95 % interval, in N.

    Neighbouring speeds and other pressures contribute, so the interval may be narrower than one from the cycles at this
    point alone. `OWN_SHARE` limits this reduction. Between the measured speeds, the number of cycles is interpolated.
    """
    curve = fit.at(number, speed_m_s).predict()
    half = curve.half_width()
    value, low, high = curve.mean, curve.mean - half, curve.mean + half
    if fit.data.logarithmic:
        value, low, high = np.exp(value), np.exp(low), np.exp(high)
    known, u = cycles > 0, np.log(speed_m_s)
    among = np.interp(u, u[known], cycles[known])
    least = OWN_SHARE * NORMAL_95 * deviation_n(fits, "cycle", value) / np.sqrt(among)
    return value, np.minimum(low, value - least), np.maximum(high, value + least)


def deviation_n(fits: Fits, source: str, friction_n: Array) -> Array:
    """Return the standard deviation, in N, that a random source adds to a single cycle at this friction."""
    fit = fits.friction
    sd = fit.fit.most_probable_sd(source) * fits.scale_n
    relative = fit.relative if source == "cycle" else float(fit.data.logarithmic)
    return sd * np.sqrt(relative * (friction_n / fits.level_n) ** 2 + 1.0 - relative)


def air_shares(fits: Fits, curves: Sequence[result.Curve], *, separated: bool) -> tuple[result.AirShare, ...]:
    """Divide the total drag at each condition into air and seal, if chamber pressures were measured (``separated``)."""
    points = fits.points
    whole: list[tuple[Array, Array, Array]] = []
    # The whole drag, the readings of the force sensor without weight and inertia, drifts like friction.
    total = fit_response(fits, points["friction_n"] + points["air_n"], points["total_stderr_n"], drift=True)
    for band in fits.bands:
        value, low, high = by_chance(fits, total, band["number"], band["speed_m_s"], band["cycles"])
        whole.append(_with_u(value, low, high, systematic(fits, value, value, band["index"])["friction_u_n"]))
    del total  # one model after the other: each needs much memory
    air = fit_response(fits, points["air_n"], points["air_stderr_n"], drift=False) if separated else None
    found, both = [], (curve for curve in curves if curve.direction == BOTH)
    for band, curve, total_n in zip(fits.bands, both, whole, strict=True):
        unknown = np.full(curve.speed_m_s.size, np.nan)
        part = seal = (unknown, unknown, unknown)
        bound = np.maximum(total_n[2] - np.minimum.accumulate(total_n[1]), 0.0) if air is None else unknown
        if air is not None:
            u = float(np.mean(points["u_air_n"][points.use & (points["curve"] == band["index"])]))
            of_air = air.at(band["number"], curve.speed_m_s).predict()
            half = of_air.half_width()
            part = _with_u(of_air.mean, of_air.mean - half, of_air.mean + half, u)
            seal = (curve.friction_n, curve.low_n, curve.high_n)
        found.append(result.AirShare(curve.condition, separated, curve.speed_m_s, *total_n, *part, *seal, bound))
    return tuple(found)


def _with_u(value: Array, low: Array, high: Array, u: Array | float) -> tuple[Array, Array, Array]:
    """Return a value and its 95 % interval, widened by a standard uncertainty."""
    return value, value - np.hypot(value - low, NORMAL_95 * u), value + np.hypot(high - value, NORMAL_95 * u)


CONSTANT = ("force: linearity", "force: hysteresis")  # sources of the force sensor that are equal at all forces


def sources(fits: Fits, gain: Gain, known: ForceCalibration | None) -> tuple[result.UncertaintySource, ...]:
    """List the sources of uncertainty, each as root mean square over the measured points of all curves, in N."""
    # Columns of the bands at the measured points of all curves.
    names = ("low_n", "high_n", "offset_half_n", "gain_n", "hysteresis_n", "position_n", "direction_u_n")
    of = {name: np.concatenate([band[name][band["cycles"] > 0] for band in fits.bands]) for name in names}
    used = fits.points.at(fits.points.use)
    assumed = bool(fits.points["assumed"].any())
    stated = "data" if np.isfinite(gain.stderr) else "assumed" if assumed else "stated"
    random = (c.name for c in fits.friction.fit.model.components if c.name in {"cycle", "drift", "block"})
    chance = ", ".join(("noise within cycles", *random))
    known_to = [name for name in (*GROWING, *CONSTANT) if np.isfinite(used[name][0])]  # that a calibration names
    named = {name: u for name in known_to if (u := rms(used[name])) > 0.0}
    words = "" if known is None else f"{known.words()}: equal in all cycles"
    other, turning = ("force sensor", "sensors") if known is None else ("other sensors", "other sensors")
    grow, turn = (
        float(np.sqrt(max(rms(column) ** 2 - sum(named.get(name, 0.0) ** 2 for name in explained), 0.0)))
        for column, explained in ((of["gain_n"], GROWING), (of["hysteresis_n"], CONSTANT))
    )
    scatter, place = rms(of["high_n"] - of["low_n"]) / (2.0 * NORMAL_95), rms(of["position_n"])
    zero = rms(np.hypot(of["direction_u_n"], of["offset_half_n"] / NORMAL_95))
    rows = [
        ("scatter of the cycles", scatter, "A", "data", f"{chance}; from the mixed model"),
        *((f"force sensor, {name.removeprefix('force: ')}", u, "B", "stated", words) for name, u in named.items()),
        (f"gain of the {other}", grow, "A" if stated == "data" else "B", stated, ""),
        (f"hysteresis of the {turning}", turn, "B", "assumed", "a third of the accuracy"),
        ("mean over position", place, "B", "assumed", "pattern over the part of the stroke not covered"),
        ("zero and asymmetry", zero, "A", "data", "curves of one direction only"),
    ]
    return tuple(result.UncertaintySource(*row) for row in rows)


def stick_slip(
    points: CurvePoints,
) -> tuple[tuple[result.StickSlipPoint, ...], tuple[result.StickSlipThreshold, ...]]:
    """Return the conditions and speeds with unsteady sliding, and the threshold speed of each condition.

    Sliding is unsteady below the threshold. The threshold is stated as an interval between two measured speeds.
    """
    found, thresholds = [], []
    for index, condition in enumerate(points.conditions):
        top, steady = 0.0, list[float]()
        for level, speed in enumerate(points.level_speeds_m_s.tolist()):  # speeds ascend
            here = points.at((points["curve"] == index) & (points["level"] == level))
            if not len(here):
                continue
            reasons = here["reason"].tolist()
            share = float(np.isin(reasons, NAMES).mean())
            if share:
                slipping = here["stick_slip"] == 1.0
                ripple = np.nan_to_num([here["ripple"], here["piston_ripple"]]).max(axis=0)
                period, step = (float(np.median(here[n][slipping])) if slipping.any() else np.nan for n in OF_SLIPS)
                medians = (float(np.median(ripple)), period, step, float(np.median(here["swing_n"])))
                found.append(result.StickSlipPoint(condition, speed, share, ripple.size, *medians))
            # An uneven speed may come from the axis or its encoder, and is therefore not sufficient evidence.
            if np.isin(reasons, STICK_SLIP).mean() > 0.5:
                top = speed
            elif share <= 0.5:
                steady.append(speed)
        if not top and not steady:
            continue
        above = min((v for v in steady if v > top), default=np.inf)
        mixed = [v for v in steady if v < top]
        kind = "none" if top == 0.0 else "between" if np.isfinite(above) else "all"
        text = sentence(f"threshold.{kind}", low=1e3 * top, high=1e3 * above)
        if mixed and kind == "between":
            text += sentence("threshold.mixed", speeds=", ".join(f"{1e3 * v:.3g}" for v in mixed))
        thresholds.append(result.StickSlipThreshold(condition, top, above, text))
    return tuple(found), tuple(thresholds)


FEWEST_TARES = 3  # least number of tares for a drift


def sensor_zero(tares: CycleTable) -> result.SensorZero:
    """Return the zero of the force sensor in each zero run, and the drift of the zero."""
    time, zero, stderr = (tares[name] for name in ("elapsed_s", "standing_n", "standing_stderr_n"))
    drift: Estimate | None = None
    if len(tares) >= FEWEST_TARES and np.ptp(time) > 0:
        x = np.column_stack([np.ones(time.size), (time - time.mean()) / HOUR_S])
        scale = max(float(np.std(zero)), float(stderr.mean()), 1e-9)
        model = MixedModel(zero, x, stderr**2, (RandomEffect("tare", np.eye(time.size), scale),))
        drift = model.fit().contrast(np.array([0.0, 1.0]), "N/h")
    return result.SensorZero(time, zero, stderr, drift, "tare" if len(tares) else "not measured")


def asymmetries(fits: Fits) -> tuple[result.Asymmetry, ...]:
    """Return half the difference of friction between the directions at each condition."""
    found = []
    for band in fits.bands:
        measured, basis = band["cycles"] > 0, "tare"
        speed = band["speed_m_s"][measured]
        (mean,) = fits.offset.at(band["number"], speed).mean().estimates()
        mean = mean.widened(float(np.mean(band["zero_n"][measured])))
        if not fits.has_zero:  # the mean includes the zero, and no statement on symmetry is possible
            mean, basis = replace(mean, p=np.nan), "not separable"
        found.append(result.Asymmetry(fits.points.conditions[band["index"]], speed, mean, basis))
    return tuple(found)
