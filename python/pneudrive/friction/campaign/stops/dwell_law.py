"""Breakaway over stop duration and pressure: slope per decade, comparison of laws, limits of the data.

The age of a contact follows from the peaks after stops. The equations are those of a drive's friction::

  dphi/dt = 1 - phi |v|/L      age: the duration of the stop while the piston rests, L/|v| while it slides
  Fd = B (1 + s_a p_a + s_b p_b) psi(phi/tau)

A peak after a stop of duration t therefore exceeds sliding friction at speed v by Fd(t) - Fd(L/v). After the restart,
the excess has fallen to 5 % at the travel for which::

  psi(L/v + (t - L/v) exp(-travel/L)) = psi(L/v) + 0.05 [psi(t) - psi(L/v)]

This gives L for each time constant tau. B and the pressure coefficients are found by least squares, and tau by a scan.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
import polars as pl

from pneudrive.arrays import Array, Row, by_name
from pneudrive.estimate.estimates import Estimate, mean_estimate, student
from pneudrive.estimate.mixed import Scan, refined
from pneudrive.friction.campaign.stops import dwell_models
from pneudrive.friction.campaign.stops.course import BACK
from pneudrive.friction.campaign.stops.dwell_models import durations_of
from pneudrive.friction.campaign.stops.stop import SPOILING
from pneudrive.friction.friction_map import CHAMBERS, LEVELS, TOLD, Condition, classify_pressures, conditions_of
from pneudrive.friction.sentences import Statement, say
from pneudrive.repr_tables import Shown


def inertia_of(stops: pl.DataFrame) -> float:
    """Return the largest contribution of the moving mass to a peak, in N, as the median over the stops."""
    return float(np.median(stops["inertia_n"]))


@dataclass(frozen=True)
class DwellPressure:
    """Effect of the chamber pressures on ageing.

    Attributes
    ----------
    slopes : dict
        Chamber (a, b, or sum if both changed together) -> change of the slope per decade with this pressure, in N/Pa.
    increments : dict
        Chamber -> change of the increment at the reference duration with this pressure, in N/Pa.
    statement : str
    """

    statement: str
    slopes: dict[str, Estimate]
    increments: dict[str, Estimate]


@dataclass(frozen=True, eq=False, repr=False)
class DwellSeries(Shown):
    """Breakaway against stop duration for one set of levels, restart speed and axis (held, released).

    Attributes
    ----------
    levels : str
        Mounting, seal, drive; "" without levels.
    speed_m_s : float
        Speed of the restart.
    released : bool
    conditions : tuple of Condition
    stops : polars.DataFrame
        Stops that were used.
    left_out : int
        Stops of the series that were not used.
    reference_s : float
        Stop duration at which slopes are evaluated.
    slopes : tuple of Estimate
        Slope of the increment at the reference duration, in N per decade, at each condition; estimated without a law.
    mean_slopes : tuple of Estimate
        Mean slope from the shortest to the longest duration, in N per decade, at each condition; estimated without a
        law.
    slope, mean_slope, increment : Estimate or None
        Means over the conditions. The increment applies at the reference duration.
    share : Estimate or None
        `slope` divided by running friction.
    running_n : float
        Mean running friction of both directions. With only one direction, it includes the offset.
    duration_s : ndarray, shape (m,)
        Durations of the curves below.
    increment_n, low_n, high_n : ndarray, shape (C, m)
        Curve without a law, with its pointwise 95 % band, at each condition.
    laws : tuple of DwellLawFit
        Best first; empty with fewer than three durations.
    pressure : DwellPressure or None
    scatter_n, block_n : float
        Standard deviations from stop to stop and of blocks.
    outlying : tuple of str
        Keys of outlying stops, which have less weight.
    curve : DwellCurve or None
    """

    levels: str
    speed_m_s: float
    released: bool
    conditions: tuple[Condition, ...]
    stops: pl.DataFrame
    left_out: int
    reference_s: float
    running_n: float
    slopes: tuple[Estimate, ...] = ()
    mean_slopes: tuple[Estimate, ...] = ()
    slope: Estimate | None = None
    mean_slope: Estimate | None = None
    increment: Estimate | None = None
    share: Estimate | None = None
    duration_s: Array = field(default_factory=lambda: np.zeros(0))
    increment_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    low_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    high_n: Array = field(default_factory=lambda: np.zeros((0, 0)))
    laws: tuple[dwell_models.DwellLawFit, ...] = ()
    pressure: DwellPressure | None = None
    scatter_n: float = np.nan
    block_n: float = np.nan
    outlying: tuple[str, ...] = ()
    curve: dwell_models.DwellCurve | None = None

    @property
    def name(self) -> str:
        """Levels, speed and state of the axis (held, released) as text."""
        held = "released" if self.released else "held"
        parts = [self.levels, f"restart at {1e3 * self.speed_m_s:.3g} mm/s", held]
        return ", ".join(part for part in parts if part)

    def effects(self, named: Callable[[Condition], str]) -> dict[str, Estimate | None]:
        """Return the effects of stops at each condition, and their mean over several conditions."""
        at, found = f"{self.reference_s:g} s", dict[str, Estimate | None]()
        for condition, slope, mean in zip(self.conditions, self.slopes, self.mean_slopes, strict=False):
            found[f"breakaway per decade of stop at {at}, {named(condition)}"] = slope
            found[f"mean breakaway per decade of stop, {named(condition)}"] = mean
        if len(self.conditions) > 1:
            found |= {f"breakaway per decade of stop at {at}": self.slope}
            found |= {"mean breakaway per decade of stop": self.mean_slope}
        found[f"breakaway increment at {at}"] = self.increment
        if self.pressure is not None:
            effects = {"breakaway per decade": self.pressure.slopes, "the increment": self.pressure.increments}
            for on, by_chamber in effects.items():
                found |= {f"effect of {CHAMBERS[key]} on {on}": effect for key, effect in by_chamber.items()}
        return found

    def slope_at(self, duration_s: float) -> tuple[Estimate, ...]:
        """Return the slope in N per decade at another duration and each condition, without a law."""
        if self.curve is None:
            return ()
        return tuple(self.curve.slopes(np.log10([duration_s])).estimates())


#: Assumed sliding distance that renews the contact, if no return to sliding was observed, m.
ASSUMED_DISTANCE_M = 1e-4
FEWEST_STOPS = 3
#: Range of the search for tau: from the shortest stop divided by the first factor to the longest stop times the second.
REACH = (100.0, 1e4)
TIMES, FINE = 60, 64
HALVINGS = 40
SAME_PRESSURE_PA = 100.0


@dataclass(frozen=True)
class ContactAge:
    """Friction that grows with the age of the contact.

    Attributes
    ----------
    form : DwellForm
    exponent : float
        Exponent of the saturating growth.
    increment : Estimate
        B, in N.
    time : Estimate
        tau, in s.
    distance : Estimate or None
        L, in m. None if no return to sliding was observed; `ASSUMED_DISTANCE_M` is then used.
    share_a_pa, share_b_pa : float
        s_a and s_b, in 1/Pa; 0 if not significant.
    together : bool
        Whether both pressures changed together. Half of the effect is then assigned to each chamber.
    """

    form: dwell_models.DwellForm
    exponent: float
    increment: Estimate
    time: Estimate
    distance: Estimate | None
    share_a_pa: float
    share_b_pa: float
    together: bool

    @property
    def distance_m(self) -> float:
        """L in m, measured or assumed."""
        return ASSUMED_DISTANCE_M if self.distance is None else self.distance.value

    def sliding_n(self, speed_m_s: float) -> float:
        """Return the ageing force, in N, in steady sliding at ambient pressure."""
        age = np.array([self.distance_m / speed_m_s])
        return float(self.increment.value * self.form.psi(age, self.time.value, self.exponent)[0])


def fit_contact_age(
    stops: pl.DataFrame, form: dwell_models.DwellForm, exponent: float, ambient_pressure_pa: float
) -> ContactAge | None:
    """Fit the model of contact age to peaks after stops.

    Parameters
    ----------
    stops : polars.DataFrame
        Usable stops of one series.
    form : DwellForm
        Law that gives the growth psi.
    exponent : float
    ambient_pressure_pa : float

    Returns
    -------
    ContactAge or None
        None if friction does not grow with the stop duration.
    """
    gauge = stops.select("pressure_a_pa", "pressure_b_pa").to_numpy() - ambient_pressure_pa
    varied = np.ptp(gauge, axis=0) > SAME_PRESSURE_PA
    together = bool(varied.all() and np.allclose(gauge[:, 0], gauge[:, 1], atol=SAME_PRESSURE_PA))
    pressures = gauge.sum(axis=1, keepdims=True) if together else gauge[:, varied]
    columns = np.column_stack([np.ones(len(stops)), pressures])
    dwell, speed, increment = (stops[name].to_numpy() for name in ("dwell_s", "speed_m_s", "increment_n"))
    back = np.where(stops["recovery_complete"], stops["recovery_m"], np.nan)  # NaN if it was not observed
    seen = np.isfinite(back)

    def lengths(time: float) -> Array:
        """Return the distance L that agrees with the return to sliding after each stop, by bisection on log L."""
        fell, rested, v = back[seen], dwell[seen], speed[seen]
        low, high = np.log(fell) - 12.0, np.log(np.minimum(fell, 0.9 * rested * v))
        for _ in range(HALVINGS):
            length = np.exp(middle := 0.5 * (low + high))
            steady = length / v
            ages = (steady + (rested - steady) * np.exp(-fell / length), steady, rested)
            now, sliding, before = (form.psi(age, time, exponent) for age in ages)
            too_long = now - sliding > BACK * (before - sliding)
            low, high = np.where(too_long, low, middle), np.where(too_long, middle, high)
        return np.exp(0.5 * (low + high))

    def at(times: Array) -> Scan:
        distance = np.full(times.size, ASSUMED_DISTANCE_M)
        if seen.sum() >= FEWEST_STOPS:
            distance = np.array([np.mean(lengths(t)) for t in times])
        shapes = np.column_stack([times, distance])
        aged = np.array([form.psi(dwell, t, exponent) - form.psi(d / speed, t, exponent) for t, d in shapes])
        return Scan(shapes, aged[:, :, None] * columns, increment, freedom)

    freedom = max(len(stops) - columns.shape[1] - 1, 1)
    limits = (dwell.min() / REACH[0], dwell.max() * REACH[1])
    found = refined(at, np.geomspace(*limits, TIMES), FINE)
    b, time = found.coefficient[found.best], float(found.shape[found.best, 0])
    if b[0] <= 0.0:
        return None
    row = np.eye(columns.shape[1])[0]
    spread = np.sqrt(found.scale * np.diag(found.covariance[found.best]))
    clear = np.abs(b) > student(freedom) * spread
    shares = np.zeros(2)
    shares[varied] = np.where(clear, b / b[0], 0.0)[1:]  # one value for both chambers if they changed together
    share_a, share_b = shares.tolist()
    each_length = lengths(time)
    return ContactAge(
        form=form,
        exponent=exponent,
        increment=Estimate(float(b[0]), *found.interval(row), float(spread[0]), "N", freedom),
        time=Estimate(time, *found.shape_interval(0, limits), np.nan, "s"),
        distance=mean_estimate(each_length, "m") if each_length.size >= FEWEST_STOPS else None,
        share_a_pa=share_a,
        share_b_pa=share_b,
        together=together,
    )


#: Stops up to this duration, s, do not determine the time of saturation under any law (assumed: this time is hours to
#: days for elastomers).
LONG_S = 1000.0
RATE_SPREAD, RATE_CORRELATION = 0.2, 0.5


def dwell_statements(series: DwellSeries, stops: pl.DataFrame) -> Iterator[Statement]:
    """Return statements on the values that the stops of a series determine."""
    where = f"Stops ({series.name})"
    flags = Counter(flag for raised in stops["flags"].to_list() for flag in raised if flag in SPOILING)
    if flags:
        kind = next((f"spoiled_{flag}" for flag in ("negative_friction", "undersampled") if flags[flag]), "spoiled")
        counts = ", ".join(f"{flag.replace('_', ' ')} {count}" for flag, count in flags.most_common())
        yield say(f"stops.{kind}", where=where, count=(~stops["usable"]).sum(), stops=len(stops), flags=counts)
    slope = series.slope
    if series.curve is None or slope is None:
        # Stops of one duration determine the increment, but no law.
        usable = stops.filter("usable")
        durations = durations_of(usable["dwell_s"].to_numpy())
        if len(usable) > 1 and durations == 1:
            inertia = inertia_of(usable)
            found = mean_estimate(usable["increment_n"].to_numpy()).widened(inertia)
            kind = "stops.increment_and_mass" if inertia > 0.0 else "stops.increment"
            yield say(kind, where=where, duration=np.median(usable["dwell_s"]), found=found, count=len(usable))
        of = "one duration" if durations == 1 else f"{durations} durations"
        yield say("stops.too_few_durations", where=where, count=len(usable), durations=of)
        return
    durations = dwell_models.most_durations(series.curve.data)
    share = f"; {100 * series.share.value:.2g} % of running friction" if series.share is not None else ""
    numbers = {"slope": slope, "reference": series.reference_s, "stops": len(series.stops), "durations": durations}
    yield say(f"stops.{'slope' if slope.differs else 'slope_not_shown'}", where=where, share=share, **numbers)
    if slope.differs:  # else there is no effect
        yield from _laws(where, series, durations)
    if series.curve.inflation >= dwell_models.CONFOUNDED:
        yield say("stops.drift", where=where)
    rate = series.stops["loading_rate_n_s"].to_numpy()
    known = np.isfinite(rate) & (rate > 0)
    if known.sum() > 5:
        logs, log_stop_s = np.log(rate[known]), series.curve.data["log_s"][known]
        spread = np.subtract(*np.quantile(logs, [0.9, 0.1]))
        together = np.corrcoef(logs, log_stop_s)[0, 1] if spread > 0 and np.ptp(log_stop_s) > 0 else 0.0
        if spread > RATE_SPREAD and abs(together) > RATE_CORRELATION:
            yield say("stops.loading_rate", where=where, together=together)
    effects = {"where": where, "stops": len(series.stops), "inertia": inertia_of(series.stops)}
    for flag in ("long_loading", "inertia", "slow_samples"):
        if count := sum(flag in raised for raised in series.stops["flags"].to_list()):
            yield say(f"stops.{flag}", count=count, **effects)
    yield say("stops.peaks", where=where)


def _laws(where: str, series: DwellSeries, durations: int) -> Iterator[Statement]:
    if not series.laws:
        yield say("stops.no_law", where=where, durations=durations)
        return
    best = series.laws[0]
    if not np.isfinite(best.aicc):
        yield say("stops.laws_not_compared", where=where)
        return
    equal = [law.form.title for law in series.laws[1:] if law.delta < dwell_models.UNCERTAIN]
    refuted = [law.form.title for law in series.laws if law.delta > dwell_models.CONCLUSIVE]
    text = best.form.title + (f"; as good: {', '.join(equal)}" if equal else "")
    text += f"; without support: {', '.join(refuted)}" if refuted else ""
    yield say("stops.laws" if equal else "stops.law", where=where, laws=text)
    longest = np.max(series.stops["dwell_s"].to_numpy())
    open_end = best.name == "log" or any(
        law.form.saturates and law.delta < dwell_models.CONCLUSIVE for law in series.laws
    )
    if best.name != "none" and longest <= LONG_S * 1.01 and open_end:
        yield say("stops.saturation", where=where, longest=longest)


#: Duration at which the slope is evaluated, s: the stop of the source paper [bracha].
REFERENCE_S = 15.0
INSIDE = 1.5  # factor by which the durations must exceed it on both sides
GRID_POINTS = 61


def fit_dwell(stops: pl.DataFrame, ambient_pressure_pa: float) -> tuple[tuple[DwellSeries, ...], list[Statement]]:
    """Fit and describe breakaway over stop duration.

    Parameters
    ----------
    stops : polars.DataFrame
        Result of `find_stops`.
    ambient_pressure_pa : float

    Returns
    -------
    tuple of DwellSeries, list of Statement
        One series for each set of levels, restart speed and axis state (held, released), and statements on determined
        and undetermined values.
    """
    if not len(stops):
        return (), []
    series, statements = [], []
    groups = stops.group_by(*LEVELS, pl.col("speed_m_s").round(6).alias("speed"), "released", maintain_order=True)
    for _, group in sorted(groups, key=lambda pair: pair[0]):
        one = _series(group, ambient_pressure_pa)
        series.append(one)
        statements += dwell_statements(one, group)
    return tuple(series), statements


def _series(stops: pl.DataFrame, ambient: float) -> DwellSeries:
    used = stops.filter("usable")
    conditions = conditions_of(used)
    enough = [c for c in sorted(set(conditions)) if durations_of(used.filter(**vars(c))["dwell_s"].to_numpy()) >= 2]
    used = used.filter([c in enough for c in conditions])
    durations, reference_s = used["dwell_s"].to_list(), REFERENCE_S
    if durations and not min(durations) * INSIDE <= REFERENCE_S <= max(durations) / INSIDE:
        reference_s = float(f"{np.sqrt(min(durations) * max(durations)):.3g}")
    # The mean of both directions removes the offset.
    directions = (used if len(used) else stops).group_by("direction").agg(pl.col("running_n").mean())
    series = DwellSeries(
        levels=conditions_of(stops)[0].title,
        speed_m_s=stops["speed_m_s"][0],
        released=stops["released"][0],
        conditions=tuple(enough),
        stops=used,
        left_out=len(stops) - len(used),
        reference_s=reference_s,
        running_n=float(directions["running_n"].to_numpy().mean()),
    )
    if not len(used):
        return series
    # The relative drift of running friction over half the campaign is also assumed for ageing.
    changes = used.select("began_s", pl.col("running_n") - pl.col("running_n").mean().over("direction"))
    time, running = changes.to_numpy().T
    span_s, slope = np.ptp(time), 0.0
    if span_s != 0:
        slope = np.polyfit((time - time.mean()) / span_s, running, 1)[0]
    drift = abs(slope) / 2.0 / max(abs(series.running_n), 1e-9)
    drift_n = drift * np.ptp(used["increment_n"].to_numpy())
    curve = dwell_models.fit_curve(used, tuple(enough), drift_n)
    return replace(series, **_results(series, curve, ambient)) if curve is not None else series


def _results(series: DwellSeries, curve: dwell_models.DwellCurve, ambient: float) -> Row:
    at = np.log10([series.reference_s])
    low, high = curve.data["log_s"].min(), curve.data["log_s"].max()
    slopes, gains = curve.slopes(at), curve.gains(low, high)
    # Inertia adds to every peak, but less if the contact is softer: at most all of it over the durations.
    u = inertia_of(series.stops) / max(high - low, 0.3) / np.sqrt(12.0)
    grid = np.linspace(low, high, GRID_POINTS)
    shown = curve.values(grid).predict()
    half = shown.half_width()
    ends = {"increment_n": shown.mean, "low_n": shown.mean - half, "high_n": shown.mean + half}
    slope = slopes.mean().estimates()[0].widened(u)
    return {
        "slopes": tuple(e.widened(u) for e in slopes.estimates()),
        "mean_slopes": tuple(e.widened(u) for e in gains.estimates()),
        "slope": slope,
        "mean_slope": gains.mean().estimates()[0].widened(u),
        "increment": curve.values(at).mean().estimates()[0],
        "share": slope.scaled(1.0 / series.running_n, "") if series.running_n > 0 else None,
        "duration_s": 10.0**grid,
        **{name: values.reshape(-1, GRID_POINTS) for name, values in ends.items()},
        "laws": dwell_models.fit_forms(curve, series.reference_s),
        "pressure": _pressure(curve, at, ambient),
        "scatter_n": curve.fit.most_probable_sd("scatter"),
        "block_n": curve.fit.most_probable_sd("block"),
        "outlying": tuple(curve.data["key"][curve.weight < 0.7].tolist()),
        "curve": curve,
    }


def _pressure(curve: dwell_models.DwellCurve, at: Array, ambient: float) -> DwellPressure | None:
    """Fit slopes and increments of the conditions as linear functions of the pressures."""
    gauge = np.array([(c.pressure_a_pa - ambient, c.pressure_b_pa - ambient) for c in curve.conditions])
    if not (np.ptp(gauge, axis=0) > SAME_PRESSURE_PA).any():
        return None
    kind = classify_pressures(gauge)
    names = [] if kind == "line" else [*TOLD.get(kind, ["sum"])]
    away = gauge - gauge.mean(axis=0)
    columns = away[:, [int(name == "b") for name in names]]
    rows = np.linalg.pinv(np.c_[np.ones(len(gauge)), columns])[1:].astype(float)
    found = (by_name(names, one.combine(rows).estimates("N/Pa")) for one in (curve.slopes(at), curve.values(at)))
    return DwellPressure(say(f"stops.pressure_{kind}").text, *found)
