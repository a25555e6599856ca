"""Export of sliding friction: a curve over speed, the law of another tool fitted to the curve, and its limitations.

Simscape, Translational Friction [mathworks-friction]::

  F = sqrt(2 e) (F_brk - F_C) exp(-(v/v_St)^2) v/v_St + F_C tanh(v/v_C) + f v
  v_St = sqrt(2) v_brk,  v_C = v_brk/10

Modelica Standard Library 4, MassWithStopAndFriction [modelica-mass-with-stop-and-friction]::

  F = F_Coulomb + F_prop v + F_Stribeck exp(-fexp |v|)                                                  v > 0

Both laws are linear in their forces at a given speed scale. For each of many scales, the forces are found by
non-negative least squares. The best scale is refined between its neighbours.

Structured text (IEC 61131-3): the friction curve as one function of a PLC, for feed-forward.

Between the lowest and the highest speed, the curve is a cubic spline over ln v. Its knots are equally spaced in ln v.
The interval of a speed is therefore found without a search::

  u = (ln |v| - ln v_low)/h,   k = trunc(u),   d = u - k
  F = sign(v) (c0 + c1 d + c2 d^2 + c3 d^3)                                                         [N]

Below the lowest speed, F = F(v_low) v/v_low, so that the curve passes zero without a jump. Above the highest speed, the
curve continues as a straight line with its last slope.

"""

from __future__ import annotations

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from pneudrive.arrays import Array, ArrayPair, Interval, Keyed, NamedNumbers, Pair, by_name
from pneudrive.describe import Drive
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.files.provenance import GivenNumber, values
from pneudrive.describe.marks import Quantity
from pneudrive.describe.tables.friction import Friction
from pneudrive.errors import DescriptionError, FitError, nearest
from pneudrive.files.content import rendered, spreadsheet_text
from pneudrive.identify.identified import number_table, sentence, sentences
from pneudrive.repr_tables import Shown
from pneudrive.simulation.trajectory import write_whole

# --- Sliding friction for export: a curve over the measured speeds, and the dependences that it does not contain.

#: Number of speeds of a curve, uniform in the logarithm.
POINTS = 400


#: Value of the exported law in a table: a number in SI or a word, unit, both bounds (NaN if missing), source, note.
Entry: TypeAlias = tuple[float | str, str, float, float, str, str]


@dataclass(frozen=True, eq=False, repr=False)
class SlidingCurve(Shown):
    """Steady friction over speed at given pressures.

    Attributes
    ----------
    title : str
    law, shape : str
        Law and shape of its Stribeck curve in pneudrive.
    speed_m_s, friction_n : ndarray, shape (n,)
        Ascending speeds, uniform in the logarithm.
    gauge_a_pa, gauge_b_pa : float
        Gauge pressures of the curve.
    entries : dict
        Name -> `Entry`: the parameters of the law in pneudrive.
    lost : tuple of str
        Effects of quantities other than speed, which the law of another tool does not include.
    unwritten : tuple of str
        Parts of the friction law that `entries` does not contain.
    """

    title: str
    law: str
    shape: str
    speed_m_s: Array
    friction_n: Array
    gauge_a_pa: float
    gauge_b_pa: float
    entries: dict[str, Entry]
    lost: tuple[str, ...]
    unwritten: tuple[str, ...] = ()


def speeds_over(between: object, source: str) -> Array:
    """Return the speeds of a curve between two limits, in m/s. If a limit is missing, the error names the `source`.

    Raises
    ------
    FitError
        The limits are missing, not positive, or not ascending.
    """
    if not isinstance(between, (list, tuple)):
        raise FitError.of("identify.no_speeds", source=source)
    low, high = (float(end) for end in between)
    if not 0.0 < low < high:
        raise FitError.of("identify.speeds", low=low, high=high)
    return np.geomspace(low, high, POINTS)


def curve_of_drive(
    drive: Drive,
    speeds_m_s: Interval | None,
    gauge_a_pa: float | None = None,
    gauge_b_pa: float | None = None,
) -> SlidingCurve:
    """Return the steady curve of a drive's friction law over given speeds.

    Raises
    ------
    FitError
        The range of speeds is missing.
    """
    numbers = {key: value for key, value in values(drive).items() if key.startswith("friction.")}
    numbers |= _numbers_of_lists(drive.friction, "friction")
    given = {f"friction.{key}" for key, _ in _written(drive.friction)}
    entries: dict[str, Entry] = {}
    for key, value in numbers.items():
        if key not in given:  # a default value: left out if the drive rejects its key
            try:
                drive.replace({key: value.mark.show(value.si) if isinstance(value.mark, Quantity) else value.si})
            except DescriptionError as error:
                if error.key == key:
                    continue
        origin = drive.provenance.get(key)
        ends = origin.bounds_si(value.mark) if origin is not None else (np.nan, np.nan)
        unit = getattr(value.mark, "si_unit", "") or "1"
        entries[key.removeprefix("friction.")] = value.si, unit, *ends, origin.source if origin else "", ""
    speed = speeds_over(speeds_m_s, "drive")
    return curve_of_friction(drive.friction, drive.name, speed, (gauge_a_pa or 0.0, gauge_b_pa or 0.0), entries)


def _numbers_of_lists(part: Described, path: str) -> Iterator[tuple[str, GivenNumber]]:
    """Yield numbers in lists, which are not in `values`, by dotted name: ``friction.position.harmonics.0.period``."""
    for name, field in type(part).model_fields.items():
        value, here = getattr(part, name), f"{path}.{field.alias or name}"
        if isinstance(value, Described) and name != "formula":
            yield from _numbers_of_lists(value, here)
        for i, one in enumerate(value if isinstance(value, tuple) else ()):
            if isinstance(one, Described):
                yield from ((f"{here}.{i}.{key}", number) for key, number in values(one).items())


def _written(friction: Friction) -> Iterator[tuple[str, Any]]:
    """Yield the values that a friction table states, including those in lists, with dotted names."""
    return toml.leaves(friction.to_dict(), is_inner=lambda value: isinstance(value, dict | list))


def curve_of_friction(
    friction: Friction, title: str, speed: Array, gauges_pa: Pair, entries: dict[str, Entry]
) -> SlidingCurve:
    """Return the steady curve of a friction law at some speeds and gauge pressures of the chambers."""
    sides = [steady_friction(friction.core(), sign * speed, *gauges_pa) for sign in (1.0, -1.0)]
    at = {"a": gauges_pa[0] / 1e5, "b": gauges_pa[1] / 1e5, "position": 0.0}
    at |= {"reference": friction.temperature.reference_k} if friction.temperature else {}
    at |= {"slid": friction.wear.slid_m} if friction.wear else {}
    tables = [key for key, table in friction.to_dict().items() if key != "law" and isinstance(table, (dict, list))]
    lost = [sentences("not_exported").get(key, f"friction.{key}").format(**at) for key in tables]
    rest = {key: str(w) for key, w in _written(friction) if key not in entries and not key.startswith("law.")}
    entries = entries | {key: (word, "", np.nan, np.nan, "", "") for key, word in rest.items()}
    unwritten = () if friction.formula is None else (f"the formulas of law {friction.law}",)
    if friction.law not in ("coulomb", "stribeck"):
        lost.append(sentence("not_exported", "presliding", law=friction.law))
    exponent = friction.parameters.get("stribeck_exponent", 2.0)
    shape = friction.stribeck_shape or f"exp(-(v/vs)^{exponent:g})"
    curve = 0.5 * (sides[0] + sides[1])
    return SlidingCurve(title, friction.law, shape, speed, curve, *gauges_pa, entries, tuple(lost), unwritten)


def steady_friction(
    core: Keyed, velocity_m_s: Array, gauge_a_pa: float, gauge_b_pa: float, position_m: float = 0.0
) -> Array:
    """Return the steady friction of a law in N, against the motion, at velocities, gauge pressures and a position.

    Parameters
    ----------
    core : mapping
        Law in the core's form, from `Friction.core`.
    velocity_m_s : ndarray, shape (n,)
    gauge_a_pa, gauge_b_pa, position_m : float
    """
    from pneudrive import _core

    more = {key: value for key, value in core.items() if key not in ("law", "parameters", "pressure")} or None
    v = np.ascontiguousarray(velocity_m_s, dtype=float)
    law = core["law"], core["parameters"]
    force = _core.steady_friction(*law, v, gauge_a_pa, gauge_b_pa, core.get("pressure"), more, position_m)
    return force * np.sign(v)


# --- Conversions: parameters of the other tool, and deviation of its curve from that of pneudrive.

SCALES = 121
#: Factor by which the search for speed scales extends beyond the measured speeds.
BEYOND = 30.0
#: Number of points of a table of Modelica, which the library interpolates linearly.
TABLE_POINTS = 40
#: Candidate numbers of intervals of a spline. Each divides the 399 intervals of a curve.
INTERVALS = (19, 57, 133, 399)
#: Allowed relative deviation at the speeds of the curve. Midway between knots, the deviation is at most a quarter
#: larger.
ACCURACY = 5e-7
#: Deviation with 133 intervals divided by that with 399 intervals. The error of a cubic spline is proportional to the
#: fourth power of the interval. With 399 intervals, the deviation is zero at the speeds of the curve.
FALL = 3.0**4


@dataclass(frozen=True, eq=False, repr=False)
class Exported(Shown):
    """Converted friction law.

    Attributes
    ----------
    tool : str
    parameters : dict
        Name in the tool -> value in SI. Empty if the tool has the same parameters.
    curve : SlidingCurve
        Curve of pneudrive.
    converted_n : ndarray, shape (n,)
        Curve of the other tool at the same speeds.
    lost : tuple of str
        Effects that the other law does not include.
    text : str
        Content of the file.
    """

    tool: str
    parameters: NamedNumbers
    curve: SlidingCurve
    converted_n: Array
    lost: tuple[str, ...]
    text: str = ""

    @property
    def worst_n(self) -> float:
        """Greatest deviation from the curve of pneudrive, in N."""
        return float(np.abs(self.converted_n - self.curve.friction_n).max())

    @property
    def worst_percent(self) -> float:
        """Greatest deviation relative to the friction at the same speed, in %."""
        return 100.0 * float(np.abs(self.converted_n / self.curve.friction_n - 1.0).max())

    def remarks(self) -> list[str]:
        """Return sentences on accuracy, range and losses of the conversion."""
        curve = self.curve
        low, high = 1e3 * curve.speed_m_s[[0, -1]]
        said = f"parameters of pneudrive: law {curve.law}, Stribeck curve {curve.shape}"
        if self.converted_n is not curve.friction_n:
            worst = 1e3 * curve.speed_m_s[np.abs(self.converted_n - curve.friction_n).argmax()]
            said = (
                f"greatest deviation from pneudrive's curve (law {curve.law}, {curve.shape}): {self.worst_n:.3g} N at "
                f"{worst:.4g} mm/s, {self.worst_percent:.3g} % of friction at most"
            )
        where = f"valid from {low:.4g} to {high:.4g} mm/s; extrapolated outside this range"
        return [where, said, *(f"lost: {text}" for text in self.lost)]

    def write(self, path: str | Path) -> Path:
        """Write the file.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        return write_whole(Path(path), self.text)


def _converted(
    tool: str,
    curve: SlidingCurve,
    converted_n: Array,
    values: Sequence[float] = (),
    **places: Any,  # noqa: ANN401 - for the template
) -> Exported:
    """Return the converted law: parameter values of the tool, and the text from its template."""
    table = number_table("tools")[tool]
    parameters = by_name((name for name, *_ in table["parameters"]), values)
    made = Exported(tool, parameters, curve, converted_n, (*curve.lost, *table["lost"]))
    places |= {"parameters": parameters, "about": table["parameters"], "curve": curve, "remarks": made.remarks()}
    return replace(made, text=rendered(Path(__file__).with_name(f"{tool}.jinja"), {"real": _real}, **places))


def best_scale(
    curve: SlidingCurve, columns: Callable[[float], Array], lowest: float, highest: float
) -> tuple[float, Array]:
    """Return the speed scale between two limits, and the non-negative forces, with which a law fits a curve best.

    Parameters
    ----------
    curve : SlidingCurve
    columns : callable
        Scale -> factors of k forces at the curve's speeds, shape (n, k).
    lowest, highest : float

    Returns
    -------
    float, ndarray of shape (k,)
    """
    from scipy.optimize import fminbound, nnls

    def away(log_scale: float) -> float:
        return float(nnls(columns(np.exp(log_scale)), curve.friction_n)[1])

    grid = np.linspace(np.log(lowest), np.log(highest), SCALES)
    distances = [away(float(g)) for g in grid]
    k = int(np.argmin(distances))
    ends = (float(grid[max(k - 1, 0)]), float(grid[min(k + 1, SCALES - 1)]))
    refined = float(fminbound(away, *ends, xtol=1e-10))  # type: ignore[arg-type]
    scale = float(np.exp(refined if away(refined) <= distances[k] else grid[k]))
    return scale, nnls(columns(scale), curve.friction_n)[0]


def simscape_columns(speed: Array, v_brk: float) -> Array:
    """Return the factors of F_brk - F_C, F_C and f in Simscape's formula at each speed."""
    v_st, v_c = np.sqrt(2.0) * v_brk, v_brk / 10.0
    stribeck = np.sqrt(2.0 * np.e) * np.exp(-((speed / v_st) ** 2)) * speed / v_st
    return np.column_stack([stribeck, np.tanh(speed / v_c), speed])


def _simscape(curve: SlidingCurve) -> Exported:
    speed = curve.speed_m_s
    v_brk, weights = best_scale(curve, lambda v: simscape_columns(speed, v), speed[0] / BEYOND, speed[-1])
    excess, coulomb, viscous = weights.tolist()
    values = excess + coulomb, v_brk, coulomb, viscous
    return _converted("simscape", curve, simscape_columns(speed, v_brk) @ weights, values)


def modelica_columns(speed: Array, fexp: float) -> Array:
    """Return the factors of F_Coulomb, F_Stribeck and F_prop in Modelica's formula at each speed."""
    return np.column_stack([np.ones_like(speed), np.exp(-fexp * speed), speed])


def _modelica(curve: SlidingCurve) -> Exported:
    speed = curve.speed_m_s
    scale, weights = best_scale(
        curve, lambda v: modelica_columns(speed, 1.0 / v), speed[0] / BEYOND, BEYOND * speed[-1]
    )
    coulomb, stribeck, viscous = weights.tolist()
    knots = np.geomspace(speed[0], speed[-1], TABLE_POINTS)
    level = np.interp(np.log(knots), np.log(speed), curve.friction_n)
    knots, level = np.r_[0.0, knots], np.r_[level[0], level]  # at 0 the friction of the lowest measured speed
    return _converted(
        "modelica",
        curve,
        modelica_columns(speed, 1.0 / scale) @ weights,
        (viscous, coulomb, stribeck, 1.0 / scale),
        rows="; ".join(f"{v:.6g}, {f:.6g}" for v, f in zip(knots, level, strict=True)),
        peak=f"{max(level[0], 1e-300):.6g}",
        between=f"{np.abs(np.interp(speed, knots, level) - curve.friction_n).max():.2g}",
    )


def _csv(curve: SlidingCurve) -> Exported:
    made, out = Exported("csv", {}, curve, curve.friction_n, curve.unwritten), io.StringIO()
    out.writelines(f"# {remark}\n" for remark in made.remarks())
    table = csv.writer(out, lineterminator="\n")
    table.writerow(["name", "value", "unit", "low", "high", "source", "note"])
    for name, (value, unit, low, high, source, note) in curve.entries.items():
        ends = ["" if np.isnan(end) else repr(float(end)) for end in (low, high)]
        written = value if isinstance(value, str) else repr(float(value))
        table.writerow(map(spreadsheet_text, [name, written, unit, *ends, source, note]))
    return replace(made, text=out.getvalue())


def spline_of(curve: SlidingCurve) -> ArrayPair:
    """Return the accurate spline with the fewest intervals: its coefficients, and its values at the curve's speeds.

    Returns
    -------
    coefficients : ndarray, shape (intervals, 4)
        c0 to c3 of each interval, for d in units of the interval length.
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
    raise FitError.of("identify.kink", deviation=before / FALL, accuracy=ACCURACY)


def _structured_text(curve: SlidingCurve) -> Exported:
    coefficients, converted = spline_of(curve)
    low, high = float(curve.speed_m_s[0]), float(curve.speed_m_s[-1])
    step = np.log(high / low) / len(coefficients)
    return _converted(
        "st",
        curve,
        converted,
        table=coefficients.tolist(),
        low=low,
        high=high,
        below=coefficients[0, 0] / low,
        end_force=coefficients[-1].sum(),
        slope=coefficients[-1] @ [0.0, 1.0, 2.0, 3.0] / step / high,
        shift=-np.log(low),
        step=step,
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


#: Tool -> conversion.
TOOLS: dict[str, Callable[[SlidingCurve], Exported]] = {
    "simscape": _simscape,
    "modelica": _modelica,
    "csv": _csv,
    "st": _structured_text,
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
    """Convert a friction curve to the format of another tool.

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
        raise FitError.of("identify.not_positive", worst=worst)
    return TOOLS[to](curve)
