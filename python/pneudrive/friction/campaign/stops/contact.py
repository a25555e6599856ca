"""The age of a contact from peaks after stops, in the form of a drive's friction.

  dphi/dt = 1 - phi |v|/L      age: the duration of the stop while the piston rests, L/|v| while it slides
  Fd = B (1 + s_a p_a + s_b p_b) psi(phi/tau)

A peak after a stop of duration t therefore exceeds the earlier friction at the speed v by Fd(t) - Fd(L/v). The excess
after a restart has fallen to 5 % at

  psi(L/v + (t - L/v) exp(-travel/L)) = psi(L/v) + 0.05 [psi(t) - psi(L/v)]

This gives L for each time tau. B and the pressure coefficients are found by least squares, and tau by a scan over its
values.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive import _core
from pneudrive.estimate.estimates import Estimate, mean_estimate, student
from pneudrive.estimate.separable import Scan, refined, scan
from pneudrive.friction.campaign.stops.recovery import BACK

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from pneudrive.friction.campaign.stops.dwell_forms import DwellForm
    from pneudrive.friction.campaign.stops.stop import Stop

    Array = NDArray[np.float64]

#: Distance that renews the contact if no return to sliding was observed, m.
ASSUMED_DISTANCE_M = 1e-4
FEWEST_STOPS = 3
#: Times are searched from the shortest stop divided by the first factor to the longest times the second.
REACH = (100.0, 1e4)
TIMES, FINE = 60, 64
HALVINGS = 40
SAME_PRESSURE_PA = 100.0


@dataclass(frozen=True)
class ContactAge:
    """Friction that grows with the age of the contact.

    Attributes
    ----------
    growth : str
        Its name in a drive file.
    exponent : float
        Exponent of the saturating growth.
    increment : Estimate
        B, N.
    time : Estimate
        tau, s.
    distance : Estimate or None
        L, m; None if no return was observed, with `ASSUMED_DISTANCE_M` instead.
    share_a_pa, share_b_pa : float
        s_a and s_b, 1/Pa; 0 if not different from zero beyond chance.
    together : bool
        Both pressures changed together, and each chamber has half of their effect.
    """

    growth: str
    exponent: float
    increment: Estimate
    time: Estimate
    distance: Estimate | None
    share_a_pa: float
    share_b_pa: float
    together: bool

    @property
    def distance_m(self) -> float:
        """L, measured or assumed."""
        return ASSUMED_DISTANCE_M if self.distance is None else self.distance.value

    def sliding_n(self, speed_m_s: float) -> float:
        """Return the force of the age in steady sliding at ambient pressure, N."""
        ratio = np.array([self.distance_m / speed_m_s / self.time.value])
        return float(self.increment.value * _psi(self.growth, ratio, self.exponent)[0])


def fit_contact_age(
    stops: Sequence[Stop], form: DwellForm, exponent: float, ambient_pressure_pa: float
) -> ContactAge | None:
    """Fit the age of the contact to peaks after stops.

    Parameters
    ----------
    stops : sequence of Stop
        Usable ones of one series.
    form : DwellForm
        The law whose growth is used.
    exponent : float
    ambient_pressure_pa : float

    Returns
    -------
    ContactAge or None
        None if friction does not grow with the stops.
    """
    gauge = np.array([(s.condition.pressure_a_pa, s.condition.pressure_b_pa) for s in stops]) - ambient_pressure_pa
    varied = np.ptp(gauge, axis=0) > SAME_PRESSURE_PA
    together = bool(varied.all() and np.allclose(gauge[:, 0], gauge[:, 1], atol=SAME_PRESSURE_PA))
    pressures = gauge.sum(axis=1, keepdims=True) if together else gauge[:, varied]
    columns = np.column_stack([np.ones(len(stops)), pressures])
    dwell = np.array([s.dwell_s for s in stops])
    speed = np.array([s.speed_m_s for s in stops])
    back = np.array([_back(s) for s in stops])
    increment = np.array([s.increment_n for s in stops])

    def at(times: Array) -> Scan:
        distance = np.array([_distance(form.growth, exponent, t, dwell, speed, back) for t in times])
        aged = np.array(
            [
                _psi(form.growth, dwell / t, exponent) - _psi(form.growth, length / speed / t, exponent)
                for t, length in zip(times, distance, strict=True)
            ]
        )
        return scan(np.column_stack([times, distance]), aged[:, :, None] * columns, increment)

    freedom = max(len(stops) - columns.shape[1] - 1, 1)
    limits = (float(dwell.min()) / REACH[0], float(dwell.max()) * REACH[1])
    found = refined(at, np.geomspace(*limits, TIMES), FINE, lambda one: one.rise(freedom))
    rise, best = found.rise(freedom), found.best
    b, time = found.coefficient[best], float(found.shape[best, 0])
    if b[0] <= 0.0:
        return None
    row = np.eye(columns.shape[1])[0]
    spread = np.sqrt(found.scale(freedom) * np.diag(found.covariance[best]))
    clear = np.abs(b) > student(freedom) * spread
    shares = iter(np.where(clear, b / b[0], 0.0)[1:].tolist())
    each = [next(shares)] * 2 if together else [next(shares) if own else 0.0 for own in varied]
    seen = np.isfinite(back)
    lengths = _lengths(form.growth, exponent, time, dwell[seen], speed[seen], back[seen])
    return ContactAge(
        growth=form.growth,
        exponent=exponent,
        increment=Estimate(float(b[0]), *found.interval(row, rise), float(spread[0]), "N", freedom),
        time=Estimate(time, *found.shape_interval(0, rise, limits), float("nan"), "s"),
        distance=mean_estimate(lengths, "m") if lengths.size >= FEWEST_STOPS else None,
        share_a_pa=each[0],
        share_b_pa=each[1],
        together=together,
    )


def _psi(growth: str, ratio: Array, exponent: float) -> Array:
    return _core.dwell_growth(growth, np.asarray(ratio, dtype=float), 1.0, exponent)[:, 0]


def _back(stop: Stop) -> float:
    """Return the travel from the peak to 5 % of the excess; NaN if not observed."""
    seen = stop.recovery is not None and stop.recovery.complete
    return stop.recovery.distance.value if seen else float("nan")  # type: ignore[union-attr]


def _distance(growth: str, exponent: float, time: float, dwell: Array, speed: Array, back: Array) -> float:
    seen = np.isfinite(back)
    if seen.sum() < FEWEST_STOPS:
        return ASSUMED_DISTANCE_M
    return float(np.mean(_lengths(growth, exponent, time, dwell[seen], speed[seen], back[seen])))


def _lengths(growth: str, exponent: float, time: float, dwell: Array, speed: Array, back: Array) -> Array:
    """Return the distance L of each stop from its return to sliding, by bisection on its logarithm."""

    def psi(age: Array) -> Array:
        return _psi(growth, age / time, exponent)

    low, high = np.log(back) - 12.0, np.log(np.minimum(back, 0.9 * dwell * speed))
    for _ in range(HALVINGS):
        length = np.exp(middle := 0.5 * (low + high))
        steady = length / speed
        left = psi(steady + (dwell - steady) * np.exp(-back / length)) - psi(steady)
        too_long = left > BACK * (psi(dwell) - psi(steady))
        low, high = np.where(too_long, low, middle), np.where(too_long, middle, high)
    return np.exp(0.5 * (low + high))
