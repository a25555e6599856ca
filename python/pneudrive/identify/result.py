"""The fit of a sliding law: estimates with covariance, prediction, application to a drive."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.characterise.spread import student
from pneudrive.errors import FitError
from pneudrive.identify.intervals import WithIntervals
from pneudrive.identify.model import UNITS, FrictionModel, Observations, at_conditions, unit_of
from pneudrive.show import Shown

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import ArrayLike, NDArray

    from pneudrive.describe import Drive
    from pneudrive.identify.diagnose import Undetermined
    from pneudrive.identify.export import Exported

    Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Prediction(Shown):
    """Friction predicted at given speeds, N; arrays of the shape of the speeds.

    Attributes
    ----------
    friction_n : ndarray
        The law at its estimates.
    lower_n, upper_n : ndarray
        Interval of the wanted probability (Student's t, first order).
    stderr_n : ndarray
        Standard error.
    """

    friction_n: Array
    lower_n: Array
    upper_n: Array
    stderr_n: Array


@dataclass(frozen=True, repr=False)
class FrictionFit(WithIntervals, Shown):
    """Parameters of a sliding law with their uncertainty.

    Attributes
    ----------
    law : str
        Law that was asked for. Where the data cannot carry it, `model` is the smaller law that was fitted.
    parameters : dict
        Name as in the drive file -> value in SI; NaN where the data do not determine it in number.
    free : tuple of str
        Order of `covariance`.
    covariance : ndarray, shape (p, p)
        Statistical covariance of the free parameters; directions that the data do not determine are left out of it.
    intervals : dict
        Free parameter that the data determine -> (lower, upper), statistical, 95 %; nothing else has one.
    systematic : dict
        Free parameter -> standard uncertainty from what all rows share (sensor gain, pressure, area).
    undetermined : tuple of Undetermined
        Plain statements on what the data cannot determine, and what to measure.
    notes : tuple of str
        What was left out or assumed.
    statistics : dict
        values, degrees_of_freedom, scale (1: the standard errors are right), variance, scatter_n
        (between levels, beyond their standard errors), rms_n, outlying,
        fit_percent, aicc, bic.
    provenance : dict
        Version, hash of the values, options.
    model : FrictionModel
    observations : Observations or None
        The values that were fitted (None when read from a file).
    weights : ndarray or None
        Huber weight of each value.
    """

    law: str
    parameters: dict[str, float]
    free: tuple[str, ...]
    covariance: Array
    intervals: dict[str, tuple[float, float]]
    systematic: dict[str, float]
    undetermined: tuple[Undetermined, ...]
    notes: tuple[str, ...]
    statistics: dict[str, float]
    provenance: dict[str, object]
    model: FrictionModel
    observations: Observations | None = field(default=None, repr=False, compare=False)
    weights: Array | None = field(default=None, repr=False, compare=False)

    @property
    def standard_errors(self) -> dict[str, float]:
        """Statistical standard error of each free parameter that the data determine (first order)."""
        every = zip(self.free, np.sqrt(np.diag(self.covariance)).tolist(), strict=True)
        return {name: error for name, error in every if name in self.intervals}

    @property
    def correlation(self) -> Array:
        """Correlation matrix of the free parameters, shape (p, p), in the order of `free`."""
        from pneudrive.identify.correlation import correlation

        return correlation(self)

    def correlated(self) -> list[str]:
        """Return which parameters change together beyond 0.9, and what would separate them, in sentences."""
        from pneudrive.identify.correlation import correlated

        return correlated(self)

    @property
    def determined(self) -> tuple[str, ...]:
        """Names of `parameters` that the data determine (a fixed exponent is not among them)."""
        lost = {s.parameter for s in self.undetermined}
        fixed = {"stribeck_exponent"} if "stribeck_exponent" not in self.free else set()
        return tuple(n for n, value in self.parameters.items() if n not in lost | fixed and np.isfinite(value))

    def expanded_uncertainty(self, name: str) -> float:
        """Return U = 2 sqrt(statistical^2 + systematic^2) of one free parameter (k = 2).

        Raises
        ------
        FitError
            The parameter was not free, or the data do not determine it.
        """
        self._known(name)
        if name not in self.intervals:
            raise FitError(f"{name} has no uncertainty: the data do not determine it")
        return 2.0 * float(np.hypot(self.standard_errors[name], self.systematic[name]))

    def predict(
        self,
        speed_m_s: ArrayLike,
        gauge_a_pa: ArrayLike = 0.0,
        gauge_b_pa: ArrayLike = 0.0,
        *,
        stderr_n: ArrayLike | None = None,
        probability: float = 0.95,
    ) -> Prediction:
        """Friction at given speeds with an interval.

        Parameters
        ----------
        speed_m_s : array_like
            Speeds in m/s; the sign is ignored, friction is that which opposes the motion.
        gauge_a_pa, gauge_b_pa : array_like
            Gauge pressures, broadcast with the speeds; without effect where the fit does not depend on pressure.
        stderr_n : array_like, optional
            None: interval of the law itself. Values: interval of a new mean with this standard error, to which the
            scatter between levels is added and which is scaled as the residuals of the fit were.
        probability : float
            Of the interval.

        Returns
        -------
        Prediction
        """
        speed, a, b = np.broadcast_arrays(*(np.asarray(x, dtype=float) for x in (speed_m_s, gauge_a_pa, gauge_b_pa)))
        flat = np.abs(speed).ravel()
        if not np.isfinite(flat).all() or (flat <= 0.0).any():
            raise FitError(
                "friction is predicted at speeds that are finite and not zero",
                value=f"speed_m_s = {np.asarray(speed_m_s)}",
                rule="the laws describe steady sliding only",
            )
        data = at_conditions(flat, a.ravel(), b.ravel())
        theta = np.array([self.free_values()[n] for n in self.free])
        q = self.model.internal(theta)
        value, jac = self.model.value_and_jacobian(q, data)
        # by the natural parameters, in which the covariance is stated
        natural = np.linalg.solve(self.model.natural_jacobian(q).T, jac.T).T
        variance = np.einsum("ij,jk,ik->i", natural, self.covariance, natural)
        if stderr_n is not None:
            new = np.broadcast_to(stderr_n, speed.shape).ravel() ** 2 + self.statistics["scatter_n"] ** 2
            variance = variance + self.statistics["variance"] * new
        stderr = np.sqrt(np.maximum(variance, 0.0))
        reach = student(int(self.statistics["degrees_of_freedom"]), probability) * stderr
        value, stderr, reach = (x.reshape(speed.shape) for x in (value, stderr, reach))
        return Prediction(value, value - reach, value + reach, stderr)

    def apply(self, drive: Drive) -> Drive:
        """Return a new drive whose friction has the determined parameters of this fit.

        What the data do not determine, and what a sliding measurement never sees (bristles), stays as it is.

        Parameters
        ----------
        drive : Drive

        Returns
        -------
        Drive

        Raises
        ------
        FitError
            If the drive's law lacks a determined parameter.

        Warns
        -----
        PneudriveWarning
            A breakaway force that the data do not determine lies below the fitted Coulomb force, or the other way
            round: it is set to that limit.
        """
        from pneudrive.identify.apply import apply_to_drive

        return apply_to_drive(self, drive)

    def export(
        self,
        to: str,
        out: str | Path | None = None,
        *,
        gauge_a_pa: float | None = None,
        gauge_b_pa: float | None = None,
        speeds_m_s: tuple[float, float] | None = None,
    ) -> Exported:
        """Give the parameters in another tool's form of the law.

        Parameters
        ----------
        to : str
            ``simscape``, ``modelica`` or ``csv``.
        out : path-like, optional
            File to write.
        gauge_a_pa, gauge_b_pa : float, optional
            Gauge pressures at which the curve is taken; the middle of the measured ones if nothing is said.
        speeds_m_s : tuple of float, optional
            Lowest and highest speed over which it shall hold; the measured ones if nothing is said.

        Returns
        -------
        Exported
            Parameters, greatest deviation of the other tool's curve, and what is lost.

        Raises
        ------
        FitError
            Another tool, or a fit that does not say which speeds were measured.
        """
        from pneudrive.identify.export import curve_of_fit, export

        done = export(curve_of_fit(self, gauge_a_pa, gauge_b_pa, speeds_m_s), to)
        if out is not None:
            done.write(out)
        return done

    def statements(self) -> list[str]:
        """Return what cannot be determined in sentences, one for all parameters that share reason and remedy."""
        shared: dict[tuple[str, str], list[str]] = {}
        for s in self.undetermined:
            shared.setdefault((s.reason, s.remedy), []).append(s.parameter)
        return [
            f"{', '.join(names)} cannot be determined: {reason}. Remedy: {remedy}."
            for (reason, remedy), names in shared.items()
        ]

    def to_toml(self, path: str | Path) -> None:
        """Write the fit with covariance and provenance; :meth:`from_toml` reads it back."""
        from pneudrive.identify.files import write_fit

        write_fit(self, path)

    @staticmethod
    def from_toml(path: str | Path) -> FrictionFit:
        """Read a fit that :meth:`to_toml` wrote (without the fitted values)."""
        from pneudrive.identify.files import read_fit

        return read_fit(path)

    def free_values(self) -> dict[str, float]:
        """Parameters by the names in `free` too: a coefficient that both chambers share is there under its own."""
        shared = {n: self.parameters[n.removesuffix("b")] for n in self.free if n.endswith("_ab")}
        return dict(self.parameters) | shared

    def _known(self, name: str) -> None:
        if name not in self.free:
            raise FitError(f"{name} is no free parameter of this fit", rule="free parameters: " + ", ".join(self.free))

    def __str__(self) -> str:
        """Return a table of parameters with intervals, then what cannot be determined and the notes."""
        s = self.statistics
        lines = [
            f"{self.law} friction from {s['values']:.0f} values "
            f"(directions: {self.provenance['direction']}, rms {s['rms_n']:.3g} N, fit {s['fit_percent']:.1f} %, "
            f"residuals {s['scale']:.2g} times their standard errors)"
        ]
        for name, value in self.free_values().items():
            if name not in self.free and name in UNITS and UNITS[name].startswith("N/Pa"):
                continue
            lines.append("  " + _line(self, name, value))
        lines += [f"  ! {statement}" for statement in self.statements()]
        lines += [f"  note: {note}" for note in self.notes]
        return "\n".join(lines)


#: Units in which people read the parameters: factor from SI, name.
_SHOWN = {"m/s": (1e3, "mm/s"), "N/Pa": (1e5, "N/bar"), "N/Pa2": (1e10, "N/bar2"), "1": (1.0, "")}


def shown(unit: str) -> tuple[float, str]:
    """Factor and name of the unit in which people read what is stored in `unit`."""
    return _SHOWN.get(unit, (1.0, unit))


def _line(fit: FrictionFit, name: str, value: float) -> str:
    factor, unit = shown(unit_of(name))
    if not np.isfinite(value):
        return f"{name:<18} not determined"
    text = f"{name:<18} {factor * value:10.4g} {unit:<6}"
    if name not in fit.free:
        return f"{text} fixed"
    if name not in fit.intervals:
        return f"{text} not determined"
    lower, upper = fit.intervals[name]
    text += f" 95 %: {factor * lower:.4g} .. {factor * upper:.4g}"
    if fit.systematic[name] > 0.0:
        text += f", U(k=2) {factor * fit.expanded_uncertainty(name):.2g}"
    return text
