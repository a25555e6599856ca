"""The friction curve as one function of a PLC (IEC 61131-3, structured text), for a feed-forward.

Between the lowest and the highest speed, the curve is a cubic spline over u = ln v with evenly spaced knots. The
interval is then found without a search:

  u = (ln |v| - ln v_low)/h,   k = trunc(u),   d = u - k
  F = sign(v) (c0 + c1 d + c2 d^2 + c3 d^3)                                                         [N]

Below the lowest speed, F = F(v_low) v/v_low, so that it passes zero without a jump. Above the highest speed, it
continues as a straight line with its last slope.
"""

from __future__ import annotations

from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.identify.static.friction_curve import SlidingCurve

    Array = NDArray[np.float64]

#: Numbers of intervals that are tried; each divides the 399 of a curve.
INTERVALS = (19, 57, 133, 399)
#: Relative deviation that is allowed at the curve's speeds; midway between knots it is a quarter larger at most.
ACCURACY = 5e-7
#: By so much the deviation falls from the last but one number of intervals to the last, at which there is none at the
#: curve's speeds: the error of a cubic spline falls with the fourth power of the interval.
FALL = 3.0**4


def spline_of(curve: SlidingCurve) -> tuple[Array, Array]:
    """Return the coefficients of the shortest spline that is accurate enough, and its values at the curve's speeds.

    Returns
    -------
    coefficients : ndarray, shape (intervals, 4)
        c0 to c3 of each interval, over the length of the interval.
    friction_n : ndarray, shape (n,)

    Raises
    ------
    FitError
        No spline is accurate enough: the curve has a kink.
    """
    from scipy.interpolate import CubicSpline

    last = curve.speed_m_s.size - 1
    before = worst = np.inf
    for intervals in INTERVALS:
        knots = np.arange(0, last + 1, last // intervals)
        spline = CubicSpline(np.arange(intervals + 1), curve.friction_n[knots])
        friction = spline(np.linspace(0.0, intervals, last + 1))
        before, worst = worst, float(np.abs(friction / curve.friction_n - 1.0).max())
        if max(worst, before / FALL if intervals == last else 0.0) < ACCURACY:
            return spline.c[::-1].T.copy(), friction
    raise FitError(
        "the curve has a kink that a spline does not follow",
        value=f"deviation of {before / FALL:.1e}",
        rule=f"below {ACCURACY:g} of the friction",
        remedy="Choose a narrower range of speeds.",
    )


def structured_text(curve: SlidingCurve, remarks: list[str], coefficients: Array) -> str:
    """Return the function as structured text.

    Parameters
    ----------
    curve : SlidingCurve
    remarks : list of str
        On its range, accuracy and losses.
    coefficients : ndarray, shape (intervals, 4)
    """
    low, high = float(curve.speed_m_s[0]), float(curve.speed_m_s[-1])
    intervals = len(coefficients)
    step = np.log(high / low) / intervals
    table = ",\n    ".join(", ".join(_real(value) for value in row) for row in coefficients)
    said = "\n".join(f"   {one.replace('*)', '* )')}" for one in (f"{curve.title}. Written by pneudrive.", *remarks))
    at = [f"{gauge / 1e5:.6g} bar" for gauge in (curve.gauge_a_pa, curve.gauge_b_pa)]
    values = {
        "low": low,
        "high": high,
        "below": coefficients[0, 0] / low,
        "end_force": coefficients[-1].sum(),
        "slope": coefficients[-1] @ [0.0, 1.0, 2.0, 3.0] / step / high,
        "shift": -np.log(low),
        "step": step,
    }
    template = Template(Path(__file__).with_name("friction.st").read_text(encoding="utf-8"))
    return template.substitute(
        {name: _real(value) for name, value in values.items()},
        remarks=said,
        gauge_a=at[0],
        gauge_b=at[1],
        table=table,
        last=intervals - 1,
        last_number=4 * intervals - 1,
    )


def _real(value: float) -> str:
    """Return a number as IEC 61131-3 writes it, with a point.

    Examples
    --------
    >>> _real(3.0), _real(-2e-7)
    ('3.0', '-2.0E-7')
    """
    mantissa, e, exponent = repr(float(value)).partition("e")
    return (mantissa if "." in mantissa else f"{mantissa}.0") + (f"E{int(exponent)}" if e else "")
