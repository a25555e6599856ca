"""Conversions: parameters of the other tool, and deviation of its curve from that of pneudrive.

Simscape, Translational Friction [mathworks-friction]:

  F = sqrt(2 e) (F_brk - F_C) exp(-(v/v_St)^2) v/v_St + F_C tanh(v/v_C) + f v
  v_St = sqrt(2) v_brk,  v_C = v_brk/10

Modelica Standard Library 4, MassWithStopAndFriction [modelica-mass-with-stop-and-friction]:

  F = F_Coulomb + F_prop v + F_Stribeck exp(-fexp |v|)                                                  v > 0

Both are linear in their forces at a given speed scale. For each of many scales, the forces are found by non-negative
least squares. The best scale is refined between its neighbours.

The friction curve as one function of a PLC (IEC 61131-3, structured text), for a feed-forward.

Between the lowest and the highest speed, the curve is a cubic spline over u = ln v with evenly spaced knots. The
interval is then found without a search:

  u = (ln |v| - ln v_low)/h,   k = trunc(u),   d = u - k
  F = sign(v) (c0 + c1 d + c2 d^2 + c3 d^3)                                                         [N]

Below the lowest speed, F = F(v_low) v/v_low, so that it passes zero without a jump. Above the highest speed, it
continues as a straight line with its last slope.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import FitError, nearest
from pneudrive.repr_tables import Shown
from pneudrive.simulation.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from pneudrive.identify.static.friction_curve import SlidingCurve

    Array = NDArray[np.float64]

SCALES = 121
#: Range of speed scales, as a factor below and above the measured speeds.
BEYOND = 30.0


@dataclass(frozen=True)
class ToolParameter:
    """Parameter of the other tool, by its name there; SI."""

    name: str
    value: float
    unit: str
    meaning: str


@dataclass(frozen=True, eq=False, repr=False)
class Exported(Shown):
    """Converted friction law.

    Attributes
    ----------
    tool : str
    parameters : tuple of ToolParameter
        Empty if the tool has the same parameters.
    curve : SlidingCurve
        Curve of pneudrive.
    converted_n : ndarray, shape (n,)
        Curve of the other tool at the same speeds.
    lost : tuple of str
        Effects that the other law lacks.
    suffix : str
        Suffix of the file.
    text : str
        Content of the file.
    """

    tool: str
    parameters: tuple[ToolParameter, ...]
    curve: SlidingCurve
    converted_n: Array
    lost: tuple[str, ...]
    suffix: str
    text: str

    @property
    def worst_n(self) -> float:
        """Greatest deviation from the curve of pneudrive, N."""
        return float(np.abs(self.converted_n - self.curve.friction_n).max())

    @property
    def worst_percent(self) -> float:
        """Greatest deviation relative to the friction at the same speed, %."""
        return 100.0 * float(np.abs(self.converted_n / self.curve.friction_n - 1.0).max())

    def value(self, name: str) -> float:
        """Return the value of one parameter, SI."""
        return {parameter.name: parameter.value for parameter in self.parameters}[name]

    def remarks(self) -> list[str]:
        """Return sentences on accuracy, range and losses of the conversion."""
        return _remarks(self.curve, self.converted_n, self.lost)

    def write(self, path: str | Path) -> Path:
        """Write the file.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        target = Path(path)
        with whole(target) as temporary:
            temporary.write_text(self.text, encoding="utf-8")
        return target


def _remarks(curve: SlidingCurve, converted: Array, lost: tuple[str, ...]) -> list[str]:
    error = np.abs(converted - curve.friction_n)
    worst = int(error.argmax())
    share = 100.0 * float((error / np.abs(curve.friction_n)).max())
    low, high = 1e3 * curve.speed_m_s[[0, -1]]
    where = f"holds from {low:.4g} to {high:.4g} mm/s; outside it is extrapolated"
    if converted is curve.friction_n:
        said = f"parameters of pneudrive: law {curve.law}, Stribeck curve {curve.shape}"
    else:
        said = (
            f"greatest deviation from pneudrive's curve (law {curve.law}, {curve.shape}): {error[worst]:.3g} N at "
            f"{1e3 * curve.speed_m_s[worst]:.4g} mm/s, {share:.3g} % of friction at most"
        )
    return [where, said, *(f"lost: {text}" for text in lost)]


def best_scale(
    curve: SlidingCurve, columns: Callable[[float], Array], lowest: float, highest: float
) -> tuple[float, Array]:
    """Return the scale between two limits and the non-negative weights of its columns that best fit a curve.

    Parameters
    ----------
    curve : SlidingCurve
    columns : callable
        Scale -> array of shape (n, k) at the curve's speeds.
    lowest, highest : float

    Returns
    -------
    float, ndarray of shape (k,)
    """
    from scipy.optimize import fminbound, nnls

    def away(log_scale: float) -> float:
        return float(nnls(columns(float(np.exp(log_scale))), curve.friction_n)[1])

    grid = np.linspace(np.log(lowest), np.log(highest), SCALES)
    distances = [away(float(g)) for g in grid]
    k = int(np.argmin(distances))
    ends = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, SCALES - 1)]))
    refined = float(fminbound(away, *ends, xtol=1e-10))  # type: ignore[arg-type]
    scale = float(np.exp(refined if away(refined) <= distances[k] else grid[k]))
    return scale, nnls(columns(scale), curve.friction_n)[0]


def simscape_columns(speed: Array, v_brk: float) -> Array:
    """Return the columns of F_brk - F_C, F_C and f in Simscape's formula."""
    v_st, v_c = np.sqrt(2.0) * v_brk, v_brk / 10.0
    stribeck = np.sqrt(2.0 * np.e) * np.exp(-((speed / v_st) ** 2)) * speed / v_st
    return np.column_stack([stribeck, np.tanh(speed / v_c), speed])


def _simscape(curve: SlidingCurve) -> Exported:
    speed = curve.speed_m_s
    v_brk, (excess, coulomb, viscous) = best_scale(
        curve, lambda v: simscape_columns(speed, v), speed[0] / BEYOND, speed[-1]
    )
    parameters = (
        ToolParameter("brkwy_frc", float(excess + coulomb), "N", "Breakaway friction force"),
        ToolParameter("brkwy_vel", v_brk, "m/s", "Breakaway friction velocity"),
        ToolParameter("Col_frc", float(coulomb), "N", "Coulomb friction force"),
        ToolParameter("visc_coef", float(viscous), "N*s/m", "Viscous friction coefficient"),
    )
    lost = (
        *curve.lost,
        "sticking: the block's force is a steep slope through zero speed, so a loaded piston creeps",
        "dwell and presliding: the block has no history",
    )
    converted = simscape_columns(speed, v_brk) @ np.array([excess, coulomb, viscous])
    text = [
        f"% {curve.title}: Translational Friction block of Simscape (the gas actuators of Simscape Fluids have no",
        "% separate friction: put the block in parallel). Written by pneudrive.",
        *(f"% {remark}" for remark in _remarks(curve, converted, lost)),
        *(f"{p.name} = {p.value!r};  % {p.unit}, {p.meaning}" for p in parameters),
        "% set_param(block, " + ", ".join(f"'{p.name}', num2str({p.name}, 17)" for p in parameters) + ")",
    ]
    return Exported("simscape", parameters, curve, converted, lost, ".m", "\n".join(text) + "\n")


def modelica_columns(speed: Array, fexp: float) -> Array:
    """Return the columns of F_Coulomb, F_Stribeck and F_prop in Modelica's formula."""
    return np.column_stack([np.ones_like(speed), np.exp(-fexp * speed), speed])


#: Number of points of the table, which the library interpolates linearly.
TABLE_POINTS = 40


def _modelica(curve: SlidingCurve) -> Exported:
    speed = curve.speed_m_s
    scale, weights = best_scale(
        curve, lambda v: modelica_columns(speed, 1.0 / v), speed[0] / BEYOND, BEYOND * speed[-1]
    )
    coulomb, stribeck, viscous = (float(w) for w in weights)
    parameters = (
        ToolParameter("F_prop", viscous, "N.s/m", "Velocity dependent friction"),
        ToolParameter("F_Coulomb", coulomb, "N", "Constant friction: Coulomb force"),
        ToolParameter("F_Stribeck", stribeck, "N", "Stribeck effect"),
        ToolParameter("fexp", 1.0 / scale, "s/m", "Exponential decay"),
    )
    lost = (*curve.lost, "dwell and presliding: the component sticks immediately, without memory")
    converted = modelica_columns(speed, 1.0 / scale) @ weights
    knots, level = friction_table(curve)
    peak = max(level[0], 1e-300)
    rows = "; ".join(f"{v:.6g}, {f:.6g}" for v, f in zip(knots, level, strict=True))
    between = np.abs(np.interp(speed, knots, level) - curve.friction_n).max()
    text = [
        f"// {curve.title}. Written by pneudrive for the Modelica Standard Library 4.",
        *(f"// {remark}" for remark in _remarks(curve, converted, lost)),
        "Modelica.Mechanics.Translational.Components.MassWithStopAndFriction piston(",
        "  // L, m, smin, smax and start values are those of your drive",
        ",\n".join(f"  {p.name}={p.value!r}" for p in parameters) + ");",
        f"// The same curve as a table, within {between:.2g} N between its points; the piston breaks away at",
        f"// peak*f_pos[1,2] = {peak:.6g} N:",
        "Modelica.Mechanics.Translational.Components.SupportFriction friction(",
        f"  f_pos=[{rows}],",
        "  peak=1);",
    ]
    return Exported("modelica", parameters, curve, converted, lost, ".mo", "\n".join(text) + "\n")


def friction_table(curve: SlidingCurve) -> tuple[Array, Array]:
    """Return speeds from 0 and their friction; the value at 0 is that of the lowest measured speed."""
    knots = np.geomspace(curve.speed_m_s[0], curve.speed_m_s[-1], TABLE_POINTS)
    level = np.interp(np.log(knots), np.log(curve.speed_m_s), curve.friction_n)
    return np.r_[0.0, knots], np.r_[level[0], level]


def _csv(curve: SlidingCurve) -> Exported:
    import csv
    import io

    from pneudrive.files.csv_tables import spreadsheet_text

    out = io.StringIO()
    for remark in _remarks(curve, curve.friction_n, curve.unwritten):
        out.write(f"# {remark}\n")
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["name", "value", "unit", "low", "high", "source", "note"])
    for e in curve.entries:
        ends = ["" if np.isnan(end) else repr(float(end)) for end in (e.low, e.high)]
        value = e.value if isinstance(e.value, str) else repr(float(e.value))
        cells = [e.name, value, e.unit, *ends, e.source, e.note]
        table.writerow([spreadsheet_text(cell) for cell in cells])
    return Exported("csv", (), curve, curve.friction_n, curve.unwritten, ".csv", out.getvalue())


def _st(curve: SlidingCurve) -> Exported:
    coefficients, converted = spline_of(curve)
    lost = (*curve.lost, "sticking and presliding: below the lowest speed the force is proportional to the velocity")
    text = structured_text(curve, _remarks(curve, converted, lost), coefficients)
    return Exported("st", (), curve, converted, lost, ".st", text)


#: Tool -> conversion.
TOOLS: dict[str, Callable[[SlidingCurve], Exported]] = {
    "simscape": _simscape,
    "modelica": _modelica,
    "csv": _csv,
    "st": _st,
}


def check_tool(to: str) -> None:
    """Check that a tool is supported.

    Raises
    ------
    FitError
    """
    if to in TOOLS:
        return
    raise FitError(f"the export to {to!r} is not available", remedy=nearest(to, (*TOOLS, "fmu", "c")))


def export(curve: SlidingCurve, to: str) -> Exported:
    """Convert a curve.

    Parameters
    ----------
    curve : SlidingCurve
    to : str
        ``simscape``, ``modelica``, ``csv`` or ``st`` (structured text of a PLC).

    Raises
    ------
    FitError
        The tool is unknown, or the curve is not finite and positive.
    """
    check_tool(to)
    if not (np.isfinite(curve.friction_n).all() and (curve.friction_n > 0.0).all()):
        worst = float(np.min(np.where(np.isfinite(curve.friction_n), curve.friction_n, -np.inf)))
        raise FitError(
            "the curve is not positive over all of its speeds",
            value=f"least value {worst:.3g} N",
            rule="finite and above 0 N",
            remedy="Export over the measured speeds and pressures.",
        )
    return TOOLS[to](curve)


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
