"""Result of a dynamic identification: values of a drive with their uncertainty."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from pneudrive.describe.drive import Drive
from pneudrive.errors import warn
from pneudrive.identify.base import HASH_DIGITS, Fit, FitFile
from pneudrive.identify.dynamic.sensors import CHANNELS
from pneudrive.identify.identified import apply_identified
from pneudrive.identify.static.friction_curve import SlidingCurve, curve_of_drive
from pneudrive.numbers import plain
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from numpy.typing import NDArray

    from pneudrive.identify.dynamic.search import Solved

    Array = NDArray[np.float64]


#: Start of the note.
KEPT = "apply keeps the start value of "


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class DriveFit(Fit):
    """Values of a drive's description with their uncertainty.

    Attributes
    ----------
    values : dict
        Name in the drive file -> value in SI (pressures absolute), at the last point of the search.
    units : dict
        Name -> unit, of values and sensors.
    sensors : dict
        ``position.offset [recording]``, ``pressure_a.gain``, ... -> value in SI.
    free : tuple of str
        Order of `covariance`: values, then sensors.
    covariance : ndarray, shape (p, p)
        SI, first order, with variance and autocorrelation of the residuals, without directions that the recordings do
        not determine.
    intervals : dict
        Value or sensor that the recordings determine -> (lower, upper), 95 %, from the noise of the sensors. Empty if
        the search did not converge.
    model_errors : dict
        Value or sensor -> lower limit of the model error: its change for errors of 1 % in each held number, in
        quadrature (`pneudrive.identify.dynamic.assemble`).
    sources : dict
        Name -> names of its recordings.
    undetermined : tuple of Undetermined
        Undetermined values, each with reason and remedy.
    notes : tuple of str
        Notes on omissions, held values and assumptions.
    statistics : dict
        samples, iterations, cost, gap; ``rms.CHANNEL``, ``noise.CHANNEL`` in SI, ``fit_percent.CHANNEL``.
    converged : bool
        False if the search was interrupted or stopped early: the values are the best so far.
    fits : bool
        False if residuals are larger than the noise of a channel from sample to sample: the model is incomplete.
    provenance : dict
        Version, hash of the drive, recordings with their hashes, options.
    start : Drive
        Drive with the start values of the search.
    """

    KIND: ClassVar[str] = "drive"
    TITLE: ClassVar[str] = "fit of a drive"
    GROUPS: ClassVar[tuple[str, ...]] = ("values", "sensors")
    HEAD: ClassVar[str] = (
        "# Identified drive. SI units, pressures absolute; intervals are 95 %, for noise only; model_error is how\n"
        "# far a value moves as each number that was held is off by 1 %."
    )

    sensors: dict[str, float]
    start: Drive = field(repr=False)
    fits: bool = True
    solved: Solved | None = field(repr=False, default=None)

    @property
    def state(self) -> str:
        """Reason for which the search ended."""
        if not self.converged:
            return "not converged: the best so far, without intervals"
        return "converged" if self.fits else "converged, but the model does not fit"

    def sensors_of(self, recording: str) -> dict[str, dict[str, float]]:
        """Return the fitted errors of the sensors of a recording, in the form for `pn.validate`.

        Parameters
        ----------
        recording : str
            Name of the recording. Another one gets common values, and the mean of each offset and delay.

        Returns
        -------
        dict
            Channel -> offset, gain, lag or delay -> SI.
        """
        lost = {u.parameter for u in self.undetermined}
        found: dict[tuple[str, str], list[float]] = {}
        for name, value in self.sensors.items():
            plain_name, _, which = name.partition(" [")
            if name not in lost and (not which or which == f"{recording}]" or recording not in self.recordings):
                channel, _, kind = plain_name.rpartition(".")
                found.setdefault((channel, kind), []).append(value)
        out: dict[str, dict[str, float]] = {}
        for (channel, kind), values in found.items():
            out.setdefault(channel, {})[kind] = float(np.mean(values))
        return out

    def apply(self, drive: Drive | None = None) -> Drive:
        """Return a drive with the determined values of this fit, each with its interval and its recordings.

        The drive is unchanged if the recordings determine no value.

        Parameters
        ----------
        drive : Drive, optional
            Default: the drive of the start of the search.

        Raises
        ------
        FitError, DescriptionError
            The drive lacks a value, or the combination of fitted and kept values is not valid.

        Warns
        -----
        PneudriveWarning
            The search did not converge; undetermined values keep those of the drive, with what this mixture predicts.
        """
        if not self.converged:
            warn("the search did not converge: the drive gets the best values so far, without intervals")
        if self.determined:
            warn_of_mixture(self.notes, set(self.values) - {*self.determined}, same_start=drive in (None, self.start))
        return apply_identified(
            self.identified_as({n: n for n in self.determined}), self.start if drive is None else drive
        )

    def curve(
        self,
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
        speeds_m_s: tuple[float, float] | None = None,
    ) -> SlidingCurve:
        """Return the curve of the friction of `apply()`; see `curve_of_drive`."""
        return curve_of_drive(self.apply(), speeds_m_s, gauge_a_pa, gauge_b_pa)

    def _groups(self) -> tuple[dict[str, float], ...]:
        return self.values, self.sensors

    def _first(self) -> dict[str, Any]:
        return super()._first() | {"fits": self.fits}

    def _last(self) -> dict[str, Any]:
        return {"drive": self.start.to_dict()}

    @classmethod
    def _fields(cls, file: FitFile) -> dict[str, Any]:
        sensors = file.groups[1] if len(file.groups) > 1 else {}
        return super()._fields(file) | {
            "sensors": {name: entry.value for name, entry in sensors.items()},
            "start": Drive.model_validate(file.content["drive"]),
            "fits": bool(file.content.get("fits", True)),
        }

    @property
    def profiled(self) -> tuple[str, ...]:
        """Values of the drive, without those of its sensors."""
        return tuple(self.values)

    def _title(self) -> str:
        recordings = self.provenance.get("recordings", [])
        seconds = sum(float(r["seconds"]) for r in recordings)
        samples = self.statistics["samples"]
        return f"{len(recordings)} recording(s), {seconds:.4g} s, {samples:.0f} samples; {self.state}"

    def _residual_lines(self) -> list[str]:
        lines = []
        for key, rms in self.statistics.items():
            what, _, channel = key.partition(".")
            if what == "rms":
                factor, unit = readable(meaning(CHANNELS[channel])[1])
                fit = self.statistics[f"fit_percent.{channel}"]
                lines.append(f"residuals of {channel}: {plain(rms / factor)} {unit}, fit {fit:.2f} %")
        return lines


def fit_hash(provenance: Mapping[str, Any], values: Mapping[str, float]) -> str:
    """Return a hash of the recordings, options and values of a fit."""
    text = json.dumps({"provenance": dict(provenance), "values": dict(values)}, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:HASH_DIGITS]


def warn_of_mixture(notes: Sequence[str], kept: Collection[str], *, same_start: bool) -> None:
    """Warn of start values that are combined with fitted ones; include the error of this mixture if it is known.

    Parameters
    ----------
    notes : sequence of str
        Notes of the fit.
    kept : collection of str
        Undetermined values.
    same_start : bool
        Whether the kept values are those of the start of the search.
    """
    note = next((note for note in notes if note.startswith(KEPT)), None)
    if note is not None and same_start:
        warn(note)
    elif kept:
        warn(
            f"the recordings do not determine {', '.join(sorted(kept))}, so that the fitted values are combined with "
            "values outside the fit: run `pneudrive validate` on the result"
        )
