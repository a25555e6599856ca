"""Survey of several seals of one friction map, and its cross-validation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, nearest
from pneudrive.identify.diagnose import SAME_PRESSURE_PA
from pneudrive.identify.static.fit import ambient_of, recordings_of
from pneudrive.identify.static.hierarchy import Survey, survey_values
from pneudrive.identify.static.observations import observations

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    import xarray as xr
    from numpy.typing import NDArray

    from pneudrive.identify.static.model import Observations

    Array = NDArray[np.float64]

HELD_OUT = ("pressure", "run")


@dataclass(frozen=True)
class LeftOut:
    """Held-out value with its prediction from all other values.

    Attributes
    ----------
    seal, run : str
    gauge_a_pa, gauge_b_pa : float
    friction_n : float
        Measured friction.
    predicted_n, lower_n, upper_n : float
        Prediction without it.
    """

    seal: str
    run: str
    gauge_a_pa: float
    gauge_b_pa: float
    friction_n: float
    predicted_n: float
    lower_n: float
    upper_n: float

    @property
    def is_inside(self) -> bool:
        """Whether the measured value is within the interval."""
        return self.lower_n <= self.friction_n <= self.upper_n

    @property
    def error(self) -> float:
        """Relative error: predicted friction divided by measured friction, minus 1."""
        return self.predicted_n / self.friction_n - 1.0


def survey(
    friction_map: xr.Dataset,
    seals: str | Sequence[str],
    runs: str | Sequence[str] | None = None,
    *,
    law: str | None = None,
    direction: int | None = None,
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
) -> Survey:
    """Fit each seal of a friction map.

    Scatter, difference of runs and deviation from a straight line are common to all.

    Parameters
    ----------
    friction_map : xarray.Dataset
        As for :func:`fit_friction`.
    seals, runs : str or sequence of str
        Label of each row, or the name of its column. Rows of one seal and run were measured without remounting the
        seal.
    law, direction, ambient_pressure_pa, exclude_flags
        As for :func:`fit_friction`; `law` None is ``stribeck`` if a seal's speeds span a factor of three.

    Returns
    -------
    Survey
        Its ``predict`` returns the friction of a further recording, in the same run or another; ``seals[name].fit`` is
        the fit of one seal.
    """
    groups, of_run, options = _grouped(friction_map, seals, runs, direction, ambient_pressure_pa, exclude_flags)
    return survey_values(groups, of_run, law, options)


def held_out(
    friction_map: xr.Dataset,
    seals: str | Sequence[str],
    runs: str | Sequence[str] | None = None,
    *,
    by: str = "pressure",
    probability: float = 0.9,
    law: str | None = None,
    direction: int | None = None,
    ambient_pressure_pa: float | None = None,
    exclude_flags: Collection[str] = (),
) -> list[LeftOut]:
    """Hold out each pressure of each seal, or each run of seals with several runs, and predict it.

    Held-out values contribute neither to the seal's law nor to the common statistics.

    Parameters
    ----------
    by : str
        ``pressure`` or ``run``.
    probability : float
        Probability of the prediction intervals.
    friction_map, seals, runs, law, direction, ambient_pressure_pa, exclude_flags
        As for :func:`survey`.

    Returns
    -------
    list of LeftOut
    """
    if by not in HELD_OUT:
        raise FitError(f"a survey cannot hold out by {by!r}", remedy=nearest(by, HELD_OUT))
    groups, of_run, _ = _grouped(friction_map, seals, runs, direction, ambient_pressure_pa, exclude_flags)
    out: list[LeftOut] = []
    for seal, data in groups.items():
        if by == "pressure":
            parts = pressure_levels(data)
        else:
            names = np.unique(of_run[seal], return_inverse=True)[1]
            parts = names if names.max() > 0 else np.full(len(data), -1)
        for part in np.unique(parts[parts >= 0]):
            out += _predicted(groups, of_run, seal, parts == part, law, probability)
    return out


def pressure_levels(data: Observations) -> NDArray[np.int64]:
    """Return the index of the pressure level of each value. A level spans 10 %, or 0.1 bar, above its first value."""
    levels: list[tuple[float, float]] = []
    out = np.empty(len(data), dtype=np.int64)
    for i, (a, b) in enumerate(zip(data.gauge_a_pa, data.gauge_b_pa, strict=True)):
        width = max(2.0 * SAME_PRESSURE_PA, 0.1 * max(abs(a), abs(b)))
        near = [k for k, (c, d) in enumerate(levels) if max(abs(a - c), abs(b - d)) < width]
        if not near:
            levels.append((float(a), float(b)))
        out[i] = near[0] if near else len(levels) - 1
    return out


def _predicted(
    groups: Mapping[str, Observations],
    of_run: Mapping[str, Sequence[str]],
    seal: str,
    left: NDArray[np.bool_],
    law: str | None,
    probability: float,
) -> list[LeftOut]:
    """Yield predictions of held-out values of one seal from all others; none if no value of the seal remains."""
    data, runs = groups[seal], np.array(of_run[seal])
    if left.all():
        return []
    rest = survey_values({**groups, seal: data.take(~left)}, {**of_run, seal: runs[~left].tolist()}, law)
    if seal not in rest.seals:
        return []
    out = []
    for i in np.flatnonzero(left):
        known = runs[i] if runs[i] in rest.seals[seal].runs else None
        conditions = {name: getattr(data, name)[i] for name in ("speed_m_s", "gauge_a_pa", "gauge_b_pa")}
        found = rest.predict(seal, **conditions, run=known, probability=probability)
        numbers = (data.friction_n[i], found.friction_n, found.lower_n, found.upper_n)
        at = (float(data.gauge_a_pa[i]), float(data.gauge_b_pa[i]))
        out.append(LeftOut(seal, str(runs[i]), *at, *(float(x) for x in numbers)))
    return out


def _grouped(
    friction_map: xr.Dataset,
    seals: str | Sequence[str],
    runs: str | Sequence[str] | None,
    direction: int | None,
    ambient_pressure_pa: float | None,
    exclude_flags: Collection[str],
) -> tuple[dict[str, Observations], dict[str, list[str]], dict[str, dict[str, object]]]:
    """Return values, runs, and provenance of each seal; unusable rows are left out as in a fit."""
    ambient = ambient_of(friction_map, ambient_pressure_pa, needed=True)
    seal_of, run_of = row_labels(friction_map, seals), row_labels(friction_map, "" if runs is None else runs)
    groups: dict[str, Observations] = {}
    of_run: dict[str, list[str]] = {}
    options: dict[str, dict[str, object]] = {}
    said = "both" if direction is None else f"{direction:+d}"
    for seal in dict.fromkeys(seal_of.tolist()):
        rows = np.flatnonzero(seal_of == seal)
        part = friction_map.isel(row=rows)
        data, _ = observations(part, direction=direction, ambient_pressure_pa=ambient, exclude_flags=exclude_flags)
        recording = part["recording"].to_numpy().astype(str)
        run = dict(zip(recording.tolist(), run_of[rows].tolist(), strict=True))
        names = np.unique(recording)
        groups[seal], of_run[seal] = data, [run[names[g]] for g in data.group]
        options[seal] = {"direction": said, "ambient_pressure_pa": ambient, "recordings": recordings_of(part)}
    return groups, of_run, options


def row_labels(friction_map: xr.Dataset, labels: str | Sequence[str]) -> NDArray[np.str_]:
    """Return the label of each row, from the name of a column or a sequence.

    An empty name gives all rows the same label.
    """
    rows = friction_map.sizes["row"]
    if isinstance(labels, str):
        if not labels:
            return np.full(rows, "")
        if labels not in friction_map:
            known = [str(n) for n, v in friction_map.data_vars.items() if v.dtype.kind in "OUS"]
            raise FitError(f"the friction map has no column {labels!r}", remedy=nearest(labels, known))
        return friction_map[labels].to_numpy().astype(str)
    if len(labels) != rows:
        raise FitError("one label is needed for each row", value=f"{len(labels)} labels, {rows} rows")
    return np.array([str(label) for label in labels])
