"""The result of a dynamic identification: values of a drive with what is known of them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.characterise.spread import intervals_of_draws
from pneudrive.errors import FitError, nearest, warn
from pneudrive.identify.intervals import Intervals, WithIntervals
from pneudrive.numbers import places, plain
from pneudrive.show import Shown
from pneudrive.units import readable

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.describe import Drive
    from pneudrive.identify.diagnose import Undetermined
    from pneudrive.identify.dynamic.fit import Solved
    from pneudrive.identify.export import Exported

    Array = NDArray[np.float64]


#: What the numbers after "model ±" are.
MODEL_ERROR_WORDS = (
    "95 %: what the noise leaves; model ±: how far the value moves as each number that was held is off by 1 % (assumed)"
)


@dataclass(frozen=True)
class Series:
    """One channel of one recording beside the model, its sensor included; SI, shape (n,)."""

    time_s: Array
    measured: Array
    model: Array


@dataclass(frozen=True, repr=False)
class DriveFit(WithIntervals, Shown):
    """Values of a drive's description with their uncertainty.

    Attributes
    ----------
    values : dict
        Name as in the drive file -> value in SI (pressures absolute), at the last point of the search.
    units : dict
        Name -> unit, of values and sensors.
    sensors : dict
        ``position.offset [recording]``, ``pressure_a.gain``, ... -> value in SI.
    free : tuple of str
        Order of `covariance`: values, then sensors.
    covariance : ndarray, shape (p, p)
        SI, first order, with the residuals' own variance and correlation in time; directions that the recordings do not
        determine are left out of it.
    intervals : dict
        Value or sensor that the recordings determine -> (lower, upper), 95 %: what the noise of the sensors leaves.
        Nothing has one where the search did not converge.
    model_errors : dict
        Value or sensor -> floor for model error: how far it moves where each number that was held is off by 1 %, in
        quadrature (`pneudrive.identify.dynamic.model_error`).
    sources : dict
        Name -> names of the recordings that it comes from.
    undetermined : tuple of Undetermined
        What the recordings do not determine, why, and what to record.
    notes : tuple of str
        What was left out, held or assumed.
    statistics : dict
        samples, iterations, cost, gap; ``rms.CHANNEL``, ``noise.CHANNEL`` in SI, ``fit_percent.CHANNEL``.
    converged : bool
        False where the search was interrupted or stopped early: the values are the best so far.
    fits : bool
        False where residuals are larger than the noise of a channel from sample to sample: the model lacks something.
    provenance : dict
        Version, hash of the drive, recordings with their hashes, options.
    start : Drive
        The drive that the search started from.
    series : dict
        Recording -> channel -> `Series`.
    """

    values: dict[str, float]
    units: dict[str, str]
    sensors: dict[str, float]
    free: tuple[str, ...]
    covariance: Array
    intervals: dict[str, tuple[float, float]]
    sources: dict[str, tuple[str, ...]]
    undetermined: tuple[Undetermined, ...]
    notes: tuple[str, ...]
    statistics: dict[str, float]
    converged: bool
    provenance: dict[str, Any]
    start: Drive = field(repr=False)
    fits: bool = True
    model_errors: dict[str, float] = field(default_factory=dict)
    series: dict[str, dict[str, Series]] = field(repr=False, compare=False, default_factory=dict)
    solved: Solved | None = field(repr=False, compare=False, default=None)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Standard error of each free value and sensor that has an interval, SI."""
        every = zip(self.free, np.sqrt(np.maximum(np.diag(self.covariance), 0.0)).tolist(), strict=True)
        return {name: error for name, error in every if name in self.intervals}

    @property
    def correlation(self) -> Array:
        """Correlation matrix in the order of `free`; 0 beside what is not determined at all."""
        spread = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        spread[spread == 0.0] = np.inf
        out = self.covariance / np.outer(spread, spread)
        np.fill_diagonal(out, 1.0)
        return out

    @property
    def determined(self) -> tuple[str, ...]:
        """Names of `values` that the recordings determine."""
        lost = {u.parameter for u in self.undetermined}
        return tuple(name for name in self.values if name not in lost)

    @property
    def state(self) -> str:
        """How the search ended, in words."""
        if not self.converged:
            return "not converged: the best so far, without intervals"
        return "converged" if self.fits else "converged, but the model does not fit"

    def statements(self) -> list[str]:
        """Return what cannot be determined, in sentences."""
        return [str(u) for u in self.undetermined]

    def sensors_of(self, recording: str) -> dict[str, dict[str, float]]:
        """Return what the fit found of the sensors of a recording, as `pn.validate` takes it.

        Parameters
        ----------
        recording : str
            Its name. Of one that was not in the fit: what is common to all, and the mean of each offset and delay.

        Returns
        -------
        dict
            Channel -> offset, gain, lag or delay -> SI.
        """
        known = [str(r["name"]) for r in self.provenance.get("recordings", [])]
        lost = {u.parameter for u in self.undetermined}
        found: dict[tuple[str, str], list[float]] = {}
        for name, value in self.sensors.items():
            plain_name, _, which = name.partition(" [")
            if name not in lost and (not which or which == f"{recording}]" or recording not in known):
                channel, _, kind = plain_name.rpartition(".")
                found.setdefault((channel, kind), []).append(value)
        out: dict[str, dict[str, float]] = {}
        for (channel, kind), values in found.items():
            out.setdefault(channel, {})[kind] = float(np.mean(values))
        return out

    def profile(self, names: Sequence[str] | None = None) -> dict[str, tuple[float, float]]:
        """95 % intervals by profile likelihood: each value is held, all others are fitted again.

        Parameters
        ----------
        names : sequence of str, optional
            Free values; all of them where nothing is said. Each takes a few fits.

        Returns
        -------
        dict
            Name -> (lower, upper), SI; infinite where the recordings set no bound.
        """
        from pneudrive.identify.dynamic.fit import profile_of

        return profile_of(self._search(), self._asked(names))

    def bootstrap(
        self, count: int = 1000, *, seed: int = 0, names: Sequence[str] | None = None
    ) -> dict[str, tuple[float, float]]:
        """95 % intervals by block bootstrap: blocks of the recordings are drawn with replacement.

        Each draw is answered by one Gauss-Newton step.

        Parameters
        ----------
        count : int
            Draws.
        seed : int
        names : sequence of str, optional
            Free values; all of them where nothing is said.

        Returns
        -------
        dict
            Name -> (lower, upper), SI.
        """
        from pneudrive.identify.dynamic.fit import bootstrap_of

        found = intervals_of_draws(self.free, bootstrap_of(self._search(), count, seed))
        kept = Intervals(found, self.undetermined)
        return {name: kept[name] for name in self._asked(names) if name in kept}

    def apply(self, drive: Drive | None = None) -> Drive:
        """Return a drive with the determined values of this fit, each with its interval and its recordings.

        What the recordings do not determine stays as it is.

        Parameters
        ----------
        drive : Drive, optional
            The drive from which the search started where nothing is said.

        Raises
        ------
        FitError, DescriptionError
            The drive lacks a value, or refuses the mixture of fitted and kept values.
        """
        from pneudrive.identify.identified import Identified, apply_identified

        if not self.converged:
            warn("the search did not converge: the drive gets its best values so far, without intervals")
        kept = self.determined
        found = Identified(
            values={n: self.values[n] for n in kept},
            intervals={n: self.intervals[n] for n in kept if n in self.intervals},
            model_errors=self.model_errors,
            sources={n: self.sources[n] for n in kept},
            fit=str(self.provenance.get("fit_hash", "")),
        )
        return apply_identified(found, self.start if drive is None else drive)

    def export(
        self,
        to: str,
        out: str | Path | None = None,
        *,
        speeds_m_s: tuple[float, float],
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
    ) -> Exported:
        """Give the friction of `apply()` in another tool's form of the law.

        Parameters
        ----------
        to : str
            ``simscape``, ``modelica`` or ``csv``.
        out : path-like, optional
            File to write.
        speeds_m_s : tuple of float
            Lowest and highest speed over which it shall hold.
        gauge_a_pa, gauge_b_pa : float, optional
            Gauge pressures at which the curve is taken; 0 if nothing is said.

        Raises
        ------
        FitError
            An unknown tool, no such speeds, or a law that cannot be converted.
        """
        from pneudrive.identify.export import curve_of_drive, export

        done = export(curve_of_drive(self.apply(), speeds_m_s, gauge_a_pa, gauge_b_pa), to)
        if out is not None:
            done.write(out)
        return done

    def to_toml(self, path: str | Path) -> None:
        """Write the fit with intervals, covariance, what is not determined, provenance, and `start`."""
        from pneudrive.identify.dynamic.files import write_fit

        write_fit(self, path)

    @classmethod
    def from_toml(cls, path: str | Path) -> DriveFit:
        """Read what `to_toml` wrote: all but series and the linearised problem, so no profile and no bootstrap.

        Raises
        ------
        FitError
            The file cannot be read, or is no fit of a drive.
        """
        from pneudrive.identify.dynamic.files import read_fit

        return read_fit(path)

    def _search(self) -> Solved:
        if self.solved is None:
            raise FitError("this fit was read from a file, without the problem that it solved", remedy="Fit again.")
        if not self.converged:
            raise FitError(
                "the search did not converge: nothing has an interval", remedy="Fit again from these values."
            )
        return self.solved

    def _asked(self, names: Sequence[str] | None) -> list[str]:
        for name in names or ():
            if name not in self.free:
                raise FitError(f"{name} was not free in this fit", remedy=nearest(name, self.free))
        return list(self.values) if names is None else list(names)

    def __str__(self) -> str:
        """Return a table of values with intervals, then what is not determined and the notes."""
        s = self.statistics
        recordings = self.provenance.get("recordings", [])
        seconds = sum(float(r["seconds"]) for r in recordings)
        lines = [f"{len(recordings)} recording(s), {seconds:.4g} s, {s['samples']:.0f} samples; {self.state}"]
        shown = {**self.values, **self.sensors}
        width = max(map(len, shown))
        lines += [f"  {name:<{width}} {self._line(name, value)}" for name, value in shown.items()]
        for key, rms in s.items():
            if key.startswith("rms."):
                channel = key.removeprefix("rms.")
                unit = self.units[channel]
                factor, unit = readable(unit)
                lines.append(
                    f"  residuals of {channel}: {plain(rms / factor)} {unit}, fit {s[f'fit_percent.{channel}']:.2f} %"
                )
        lines += [f"  ! {statement}" for statement in self.statements()]
        if self.intervals and self.model_errors:
            lines.append(f"  {MODEL_ERROR_WORDS}")
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)

    def _line(self, name: str, value: float) -> str:
        factor, unit = readable(self.units[name])
        interval = self.intervals.get(name)
        if interval is None:
            lost = any(u.parameter == name for u in self.undetermined)
            return f"{plain(value / factor, 5):>13} {unit:<12}" + (" not determined" if lost else "")
        lower, upper = (end / factor for end in interval)
        digits = places(0.5 * (upper - lower))
        text = f"{value / factor:>13.{digits}f} {unit:<12} 95 %: {lower:.{digits}f} .. {upper:.{digits}f}"
        if name in self.model_errors:
            text += f"; model ± {plain(self.model_errors[name] / factor, 2)}"
        return text
