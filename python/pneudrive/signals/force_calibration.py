"""Calibration of a force sensor as a curve of readings over force, and its remaining uncertainties.

The curve corrects the reading of the sensor. The remaining error is systematic: it is equal in all cycles,
and does not average out. Limits of a certificate are treated as those of a rectangular distribution [gum2008].
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import ConfigDict, Field, Strict

from pneudrive.arrays import Array
from pneudrive.describe.base import Described
from pneudrive.describe.marks import NOT_NEGATIVE, Accuracy, Quantity, Text
from pneudrive.errors import DescriptionError

RECTANGULAR = float(np.sqrt(3.0))
PLAUSIBLE_GAIN = (0.5, 2.0)  # reading over force: outside this range, units or columns were swapped


_Number = Annotated[float, Strict(), Field(allow_inf_nan=False)]
_NotNegative = Annotated[_Number, Field(ge=0.0)]


@dataclass(frozen=True)
class ForceCalibration:
    """Calibration of a force sensor. Forces are in N, with the sign of the sensor.

    Attributes
    ----------
    reference_n, shown_n : tuple of float
        Two or more points of the certificate, both increasing: force of the standard, and reading of the sensor. The
        curve is piecewise linear, and extrapolated from its end segments. Empty: `gain` and `zero_n` apply.
    gain, zero_n : float
        Reading = gain * force + zero, if no points are given.
    u_gain : float
        Relative standard uncertainty of the gain or, with points, of the reference forces.
    u_zero_n : float
        Standard uncertainty of the zero. Runs that measure the zero remove this uncertainty.
    range_n : float
        Largest force of the calibration; 0: largest force of the points.
    linearity_n : float
        Largest error of the curve, plus or minus.
    hysteresis_n : float
        Largest difference of readings at the same force between increasing and decreasing force. The limits of the
        error are plus and minus half this difference.
    creep_n : float
        Largest change of the reading under the constant largest force, plus or minus. It is proportional to the force.
    certificate, date : str
    """

    __pydantic_config__: ClassVar = ConfigDict(extra="forbid")
    reference_n: tuple[_Number, ...] = ()
    shown_n: tuple[_Number, ...] = ()
    gain: _Number = 1.0
    zero_n: _Number = 0.0
    u_gain: _NotNegative = 0.0
    u_zero_n: _NotNegative = 0.0
    range_n: _NotNegative = 0.0
    linearity_n: _NotNegative = 0.0
    hysteresis_n: _NotNegative = 0.0
    creep_n: _NotNegative = 0.0
    certificate: str = ""
    date: str = ""

    def __post_init__(self) -> None:
        """Reject an impossible curve."""
        reference, shown = np.array(self.reference_n), np.array(self.shown_n)
        if reference.size != shown.size or reference.size == 1:
            raise DescriptionError.of("signals.points-unequal", size=reference.size, size2=shown.size)
        if reference.size and (self.gain, self.zero_n) != (1.0, 0.0):
            raise DescriptionError("force calibration: points cannot be combined with gain or zero", remedy="Keep one.")
        if reference.size and not ((np.diff(reference) > 0).all() and (np.diff(shown) > 0).all()):
            raise DescriptionError.of("signals.points-do-not-rise")
        slopes = np.diff(shown) / np.diff(reference) if reference.size else np.array([self.gain])
        if not ((slopes > PLAUSIBLE_GAIN[0]) & (slopes < PLAUSIBLE_GAIN[1])).all():
            worst = float(slopes[np.argmax(np.abs(slopes - 1.0))])
            raise DescriptionError.of("signals.implausible-gain", worst=worst, ends=PLAUSIBLE_GAIN)
        if self.creep_n > 0.0 and self.largest_n == 0.0:
            raise DescriptionError("force calibration: creep needs a range", remedy='range = "100 N"')

    @property
    def largest_n(self) -> float:
        """Largest force of the calibration, 0 if unknown."""
        return self.range_n or max((abs(v) for v in self.reference_n), default=0.0)

    def force_n(self, shown_n: Array | float) -> Array:
        """Return the force for a reading of the sensor.

        Parameters
        ----------
        shown_n : ndarray or float

        Returns
        -------
        ndarray
            Force in N, same shape.

        Examples
        --------
        >>> float(ForceCalibration(gain=1.01, zero_n=0.5).force_n(101.5))
        100.0
        """
        if not self.reference_n:
            return (np.asarray(shown_n, dtype=float) - self.zero_n) / self.gain
        from scipy.interpolate import interp1d

        curve = interp1d(self.shown_n, self.reference_n, fill_value="extrapolate")  # pyright: ignore[reportArgumentType]
        return curve(shown_n)

    def applied(self) -> ForceCalibration:
        """Return a calibration for forces that the curve has already corrected. It contains only the uncertainties."""
        return replace(self, reference_n=(), shown_n=(), gain=1.0, zero_n=0.0, range_n=self.largest_n)

    def doubts(self, difference_n: float, sum_n: float) -> dict[str, tuple[float, float, float]]:
        """Return the remaining uncertainties of the certificate.

        Parameters
        ----------
        difference_n, sum_n : float
            Half the difference and half the sum of the forces in both directions.

        Returns
        -------
        dict
            Source -> standard uncertainties of the force, of half the difference and of half the sum, in N. Hysteresis
            remains in the difference: the force is approached from below in one direction, and from above in the other.
        """
        creep = self.creep_n / RECTANGULAR / self.largest_n if self.creep_n else 0.0
        line, turn = self.linearity_n / RECTANGULAR, self.hysteresis_n / 2.0 / RECTANGULAR
        most = max(abs(difference_n), abs(sum_n))
        gain = (self.u_gain * most, self.u_gain * abs(difference_n), self.u_gain * abs(sum_n))
        return {
            "gain": gain,
            "linearity": (line, line, line),
            "hysteresis": (turn, turn, turn),
            "creep": (creep * most, creep * abs(difference_n), creep * abs(sum_n)),
            "zero": (self.u_zero_n, 0.0, self.u_zero_n),
        }

    def words(self) -> str:
        """Return certificate and date as text."""
        return ", ".join(part for part in (self.certificate, self.date) if part) or "calibration"


_Newton = Annotated[float, Quantity("N")]
_NewtonLimit = Annotated[float, Quantity("N", bounds=NOT_NEGATIVE)]


class ForceCalibrationTable(Described):
    """``[force_calibration]``: the certificate of a force sensor."""

    reference_n: tuple[_Newton, ...] = ()
    shown_n: tuple[_Newton, ...] = ()
    gain: Annotated[float, Quantity("")] = 1.0
    zero_n: _Newton = 0.0
    u_gain: Annotated[Accuracy, Field(alias="gain_uncertainty")] = 0.0
    u_zero_n: Annotated[_NewtonLimit, Field(alias="zero_uncertainty")] = 0.0
    range_n: _NewtonLimit = 0.0
    linearity_n: _NewtonLimit = 0.0
    hysteresis_n: _NewtonLimit = 0.0
    creep_n: _NewtonLimit = 0.0
    certificate: str = ""
    date: Text = ""  # TOML has a type for dates


def of_quantities(table: object) -> ForceCalibration:
    """Read a force calibration from a table of quantities with units, as in TOML files.

    Raises
    ------
    DescriptionError
        A key is unknown, or a value or the calibration is not valid.
    """
    return ForceCalibration(**ForceCalibrationTable.model_validate(table).stored())
