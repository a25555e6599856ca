"""Simulated recordings: recovered friction against the ground truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.identify.base import shown_in
from pneudrive.identify.static.model import unit_of
from pneudrive.numbers import with_u
from pneudrive.report import style
from pneudrive.report.topics import Topic

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.report.page import Section
    from pneudrive.report.study import Fits

SAME_PRESSURE_PA = 100.0
SHOWN_ERRORS = 4.0  # standard errors to either side


@dataclass(frozen=True)
class Recovered:
    """Friction of simulated recordings and their ground truth; arrays of one length, SI."""

    speed_m_s: np.ndarray
    gauge_pa: np.ndarray
    friction_n: np.ndarray
    stderr_n: np.ndarray
    expanded_n: np.ndarray
    true_n: np.ndarray

    @property
    def inside(self) -> int:
        """Number of values within their U (k = 2)."""
        return int(np.sum(np.abs(self.friction_n - self.true_n) <= self.expanded_n))

    @property
    def within_statistics(self) -> int:
        """Number of values within two statistical standard errors."""
        return int(np.sum(np.abs(self.friction_n - self.true_n) <= 2 * np.nan_to_num(self.stderr_n)))


def recovered(found: Characterisation) -> Recovered | None:
    """Return friction with the ground truth of each simulated recording; None without one."""
    rows = []
    for result in found.results:
        truth = result.recording.truth
        if truth is None or "friction_n" not in truth or len(result.levels) != 1:
            continue
        level = result.levels[0]
        ambient = result.recording.ambient_pressure_pa
        gauge = max(truth["pressure_a_pa"], truth["pressure_b_pa"]) - ambient
        values = (level.friction_n, level.stderr_n, level.expanded_n, truth["friction_n"])
        rows.append((truth["speed_m_s"], gauge, *values))
    return Recovered(*np.array(rows, dtype=float).T) if rows else None


def section(found: Characterisation, fits: Fits) -> Section | None:
    """Return the section on recovered friction and parameters; None without simulated recordings."""
    pairs = recovered(found)
    if pairs is None:
        return None
    topic, rows = Topic("recordings", "recovered"), parameter_rows(found, fits)
    ends = [f"{value:.2f}" for value in (pairs.expanded_n.min(), pairs.expanded_n.max())]
    counts = {"all": pairs.true_n.size, "inside": pairs.inside, "within": pairs.within_statistics}
    worst = 1e3 * float(np.max(np.abs(pairs.friction_n - pairs.true_n)))
    return topic.section(
        topic.text(**counts, reach=" to ".join(dict.fromkeys(ends)), worst=worst),
        topic.picture("recovered", draw(pairs)),
        topic.table(rows) if rows else None,
        synthetic=True,
    )


def parameter_rows(found: Characterisation, fits: Fits) -> list[tuple[str, str, str, str, str]]:
    """Return true and recovered value of each parameter of the fit that covers all recordings."""
    fit = next(iter(fits.values()), {}).get("stribeck") if fits else None
    truth = next((r.truth for r in found.recordings if r.truth), None)
    if fit is None or truth is None or truth["law"] != "stribeck":
        return []
    known = dict(truth["parameters"]) | (truth["pressure"] or {})
    rows = []
    for name in fit.free:
        single = name.removesuffix("b") if name.endswith("_ab") else name
        if single not in known or name not in fit.intervals:
            continue
        size, unit = shown_in(unit_of(name))
        value, expanded, true = (
            v / size for v in (fit.parameters[single], fit.expanded_uncertainty(name), known[single])
        )
        low, high = (bound / size for bound in fit.intervals[name])
        inside = "yes" if abs(value - true) <= expanded else "no"
        shown = single.replace("_", " ") + (" and b" if name.endswith("_ab") else "")
        interval = f"{low:.4g} … {high:.4g} {unit}".strip()
        rows.append((shown, f"{true:.4g} {unit}".strip(), with_u(value, expanded, unit), interval, inside))
    return rows


def draw(pairs: Recovered) -> Figure:
    """Draw curves over speed, and errors with their statistical part."""
    figure = style.new_figure(3.0)
    left, right = figure.subplots(1, 2)
    gauges = np.unique(pairs.gauge_pa.round(-2))
    right.axhspan(-2, 2, color=style.BAND, lw=0, label="two standard errors")
    for index, gauge in enumerate(gauges[:8]):
        look = style.ramp(index, min(gauges.size, 8))
        chosen = np.flatnonzero(np.abs(pairs.gauge_pa - gauge) < SAME_PRESSURE_PA)
        chosen = chosen[np.argsort(pairs.speed_m_s[chosen])]
        speed = pairs.speed_m_s[chosen] * 1e3
        left.plot(speed, pairs.true_n[chosen], linestyle=look.linestyle, color=look.color, lw=0.9)
        label = f"{gauge / 1e5:.2g} bar"
        left.plot(speed, pairs.friction_n[chosen], look.marker, color=look.color, mfc="white", ms=3.2, label=label)
        with np.errstate(divide="ignore", invalid="ignore"):
            error = (pairs.friction_n[chosen] - pairs.true_n[chosen]) / pairs.stderr_n[chosen]
        error = np.clip(error, -SHOWN_ERRORS, SHOWN_ERRORS)  # one further off is drawn on the frame
        right.plot(speed, error, look.marker, color=look.color, mfc="white", ms=3.2)
    right.axhline(0, color=style.BLACK, lw=0.8)
    for axis in (left, right):
        style.logarithmic(axis)
        axis.set_xlabel("speed / (mm/s)")
    left.set_ylabel("friction / N")
    right.set_ylim(-SHOWN_ERRORS, SHOWN_ERRORS)
    right.set_ylabel("error / standard error")
    right.legend(loc="lower right")
    left.legend(title="gauge pressure", title_fontsize=7, ncols=2)
    return figure
