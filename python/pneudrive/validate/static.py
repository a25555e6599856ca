"""Validation of a friction law against measured sliding friction: a friction map or the curves of a campaign."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.estimate.estimates import NORMAL_95
from pneudrive.identify.static.friction_curve import steady_friction
from pneudrive.lazy_names import upper
from pneudrive.simulation.trajectory import columns_in
from pneudrive.validate.metrics import Metrics, metrics
from pneudrive.views import Viewed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.views import View

    Array = NDArray[np.float64]

OF_MAPS = ("friction_n", "velocity_m_s", "balance_n")
#: Flag of a row of a map that knows one direction only.
UNPAIRED = "unpaired"
#: Target (assumed, as those of free runs).
STATIC_FIT_PERCENT = 98.0


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Measured friction of one condition against the law.

    Attributes
    ----------
    condition : str
    direction : int
        +1, -1, or 0 for the mean of both.
    speed_m_s, friction_n, low_n, high_n : ndarray, shape (m,)
        Measured values with their 95 % band.
    model_n : ndarray, shape (m,)
        Friction of the law at these speeds and pressures.
    """

    condition: str
    direction: int
    speed_m_s: Array
    friction_n: Array
    low_n: Array
    high_n: Array
    model_n: Array

    @property
    def inside(self) -> float:
        """Fraction of the points with the law within their 95 % band."""
        return float(np.mean((self.model_n >= self.low_n) & (self.model_n <= self.high_n)))

    @property
    def metrics(self) -> Metrics:
        """Metrics of this condition."""
        return metrics(self.friction_n, self.model_n)


@dataclass(frozen=True, eq=False, repr=False)
class FrictionValidation(Viewed):
    """Validation of a friction law against measured sliding friction."""

    drive: Drive
    source: Path
    curves: tuple[FrictionCurve, ...]
    synthetic: bool

    @cached_property
    def metrics(self) -> Metrics:
        """Metrics over all points."""
        measured = np.concatenate([c.friction_n for c in self.curves])
        return metrics(measured, np.concatenate([c.model_n for c in self.curves]))

    @property
    def inside(self) -> float:
        """Fraction of all points with the law within their 95 % band."""
        sizes = np.array([c.speed_m_s.size for c in self.curves])
        return float(np.average([c.inside for c in self.curves], weights=sizes))

    @property
    def met(self) -> bool:
        """Whether the target is reached."""
        return self.metrics.fit_percent > STATIC_FIT_PERCENT

    def write(self, folder: str | Path) -> list[Path]:
        """Write friction.csv, with a row for each measured point, into an existing folder."""
        import polars as pl

        from pneudrive.simulation.trajectory import check_target, write_frame

        target = check_target(Path(folder) / "friction.csv", (".csv",))
        names = ("condition", "direction", "speed_m_s", "friction_n", "low_n", "high_n", "model_n")
        write_frame(pl.concat(pl.DataFrame({n: getattr(c, n) for n in names}) for c in self.curves), target)
        return [target]

    def view(self) -> View:
        """Return the agreement over all conditions and for each, with its figure."""
        return upper("friction_view")(self)

    def report(self, folder: str | Path) -> Path:
        """Write the page of the validation into an existing folder."""
        return upper("write_friction_report")(self, folder)


def is_friction(path: str | Path) -> bool:
    """Return whether a path is a friction map or a campaign folder, not a recording of a drive.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    """
    path = Path(path)
    return path.is_dir() or (path.suffix in (".parquet", ".csv") and len(columns_in(path, OF_MAPS)) == len(OF_MAPS))


def validate_friction(drive: Drive, path: str | Path) -> FrictionValidation:
    """Compare the steady curve of a drive's friction law with measured friction.

    Parameters
    ----------
    drive : Drive
    path : path-like
        Friction map (map.parquet, map.csv) or campaign folder.

    Raises
    ------
    RecordingError, CampaignError
        The data cannot be read, or contain no sliding friction.
    """
    path = Path(path)
    curves = _of_campaign(drive, path) if path.is_dir() else _of_map(drive, path)
    if not curves:
        raise RecordingError("the data contain no sliding friction", where=str(path))
    return FrictionValidation(drive, path, tuple(curves), False)


def law_n(drive: Drive, velocity_m_s: Array, gauge_a_pa: float, gauge_b_pa: float) -> Array:
    """Return the steady friction of the drive's law, N, against the motion, at velocities and gauge pressures."""
    return steady_friction(drive.friction, velocity_m_s, gauge_a_pa, gauge_b_pa, 0.5 * drive.cylinder.stroke_m)


def _model(drive: Drive, direction: int, speed_m_s: Array, gauge_a_pa: float, gauge_b_pa: float) -> Array:
    """Return the law's friction in one direction; for direction 0 the mean of both, as a paired measurement is."""
    signs = (direction,) if direction else (1, -1)
    return np.mean([law_n(drive, sign * speed_m_s, gauge_a_pa, gauge_b_pa) for sign in signs], axis=0)


def _of_map(drive: Drive, path: Path) -> list[FrictionCurve]:
    from pneudrive.friction.friction_map import AMBIENT, read_map

    rows = read_map(path)
    ambient = rows.attrs.get(AMBIENT, drive.ambient.pressure_pa)  # the law counts from the air around the seal
    velocity, friction = rows["velocity_m_s"].to_numpy(), rows["friction_n"].to_numpy()
    band = NORMAL_95 * np.hypot(rows["stderr_n"].to_numpy(), rows["u_systematic_n"].to_numpy())
    flags = rows["flags"].to_numpy()
    stuck, alone = (np.array([word in flag for flag in flags]) for word in ("stick_slip", UNPAIRED))
    good = np.isfinite(friction) & (velocity != 0.0) & ~stuck
    direction_of = np.where(alone, np.sign(velocity), 0.0)  # otherwise friction_n is the mean of both directions
    gauges = [rows[f"pressure_{c}_pa"].to_numpy() - ambient for c in "ab"]
    rounded = np.round(np.column_stack(gauges) / 1e4).astype(int)  # pressures equal to 0.1 bar are one condition
    out = []
    for a, b in np.unique(rounded[good], axis=0):
        for direction in (0, 1, -1):
            mine = good & (rounded == (a, b)).all(axis=1) & (direction_of == direction)
            if not mine.any():
                continue
            order = np.flatnonzero(mine)[np.argsort(np.abs(velocity[mine]))]
            gauge_a, gauge_b = (float(g[order].mean()) for g in gauges)
            speed = np.abs(velocity[order])
            model = _model(drive, direction, speed, gauge_a, gauge_b)
            low, high = friction[order] - band[order], friction[order] + band[order]
            name = f"a {a / 10:g} bar, b {b / 10:g} bar gauge"
            out.append(FrictionCurve(name, direction, speed, friction[order], low, high, model))
    return out


def _of_campaign(drive: Drive, path: Path) -> list[FrictionCurve]:
    from pneudrive.friction.campaign.characteristics import campaign_friction

    found = campaign_friction(path)
    ambient = found.identity.ambient_pressure_pa
    out = []
    signed = {curve.condition for curve in found.curves if curve.direction != 0}
    for curve in found.curves:
        if curve.direction == 0 and curve.condition in signed:
            continue  # the mean, where both directions exist
        at = curve.measured
        speed = curve.speed_m_s[at]
        if not speed.size:
            continue
        gauges = (curve.condition.pressure_a_pa - ambient, curve.condition.pressure_b_pa - ambient)
        model = _model(drive, curve.direction, speed, *gauges)
        values = (curve.friction_n[at], curve.low_n[at], curve.high_n[at])
        out.append(FrictionCurve(curve.condition.label(ambient), curve.direction, speed, *values, model))
    return out
