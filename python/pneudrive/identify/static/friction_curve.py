"""Sliding friction for export: a curve over the measured speeds, and the dependences that it does not contain."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.base import Described
from pneudrive.describe.files.provenance import values
from pneudrive.describe.marks import Quantity
from pneudrive.errors import DescriptionError, FitError
from pneudrive.identify.sentences import sentences
from pneudrive.repr_tables import Shown

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    from pneudrive.describe.drive import Drive
    from pneudrive.describe.files.provenance import GivenNumber
    from pneudrive.describe.tables.friction import Friction

    Array = NDArray[np.float64]

#: Number of speeds of a curve, uniform in the logarithm.
POINTS = 400


@dataclass(frozen=True)
class CurveEntry:
    """Value of the exported law in a table: a number in SI or a word; NaN for a missing bound."""

    name: str
    value: float | str
    unit: str
    low: float
    high: float
    source: str
    note: str = ""


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
    entries : tuple of CurveEntry
        Parameters in pneudrive.
    lost : tuple of str
        Dependences other than speed, which the law of another tool does not include.
    unwritten : tuple of str
        Parts of the friction without an entry.
    """

    title: str
    law: str
    shape: str
    speed_m_s: Array
    friction_n: Array
    gauge_a_pa: float
    gauge_b_pa: float
    entries: tuple[CurveEntry, ...]
    lost: tuple[str, ...]
    unwritten: tuple[str, ...] = ()


def speeds_over(between: object, source: str) -> Array:
    """Return the speeds of a curve between two limits, m/s; `source` names the object without limits, for messages.

    Raises
    ------
    FitError
        The limits are missing, or not ascending above zero.
    """
    if not isinstance(between, (list, tuple)):
        raise FitError(
            f"a {source} has no range of measured speeds",
            remedy='Give the range of speeds: --speeds "1 mm/s .. 500 mm/s".',
        )
    low, high = (float(end) for end in between)
    if not 0.0 < low < high:
        raise FitError(
            f"the range of speeds from {low:g} to {high:g} m/s is not valid",
            rule="0 < lowest < highest speed",
            remedy='Give another range of speeds: --speeds "1 mm/s .. 500 mm/s".',
        )
    return np.geomspace(low, high, POINTS)


def middle_of(given: float | None, measured: object) -> float:
    """Return the requested pressure, or the middle of the measured ones."""
    if given is None and isinstance(measured, (list, tuple)):
        return 0.5 * (float(measured[0]) + float(measured[1]))
    return given or 0.0


def curve_of_drive(
    drive: Drive,
    speeds_m_s: tuple[float, float] | None,
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
    given = {f"friction.{key}" for key, _ in _leaves(drive.friction.to_dict())}
    entries = []
    for key, value in numbers.items():
        if key not in given and _is_refused(drive, key, value):
            continue
        origin = drive.provenance.get(key)
        ends = origin.bounds_si(value.mark) if origin is not None else (np.nan, np.nan)
        unit = getattr(value.mark, "si_unit", "") or "1"
        entries.append(
            CurveEntry(key.removeprefix("friction."), value.si, unit, *ends, origin.source if origin else "")
        )
    speed = speeds_over(speeds_m_s, "drive")
    return curve_of_friction(drive.friction, drive.name, speed, (gauge_a_pa or 0.0, gauge_b_pa or 0.0), entries)


def _numbers_of_lists(part: Described, path: str) -> Iterator[tuple[str, GivenNumber]]:
    """Yield the numbers in lists, which have no name in `values`: ``friction.position.harmonics.0.period``."""
    for name, field in type(part).model_fields.items():
        value, here = getattr(part, name), f"{path}.{field.alias or name}"
        if isinstance(value, Described) and name != "formula":
            yield from _numbers_of_lists(value, here)
        for i, one in enumerate(value if isinstance(value, tuple) else ()):
            if isinstance(one, Described):
                yield from ((f"{here}.{i}.{key}", number) for key, number in values(one).items())


def _leaves(table: Any, path: str = "") -> Iterator[tuple[str, Any]]:  # noqa: ANN401 - as written
    """Yield the values of a written table by dotted names."""
    for key, value in table.items() if isinstance(table, dict) else enumerate(table):
        if isinstance(value, (dict, list)):
            yield from _leaves(value, f"{path}{key}.")
        else:
            yield f"{path}{key}", value


def _is_refused(drive: Drive, key: str, value: GivenNumber) -> bool:
    """Return whether a default has no effect, because the drive does not have this key."""
    try:
        drive.replace({key: value.mark.show(value.si) if isinstance(value.mark, Quantity) else value.si})
    except DescriptionError as error:
        return error.key == key
    return False


def curve_of_friction(
    friction: Friction, title: str, speed: Array, gauges_pa: tuple[float, float], entries: Sequence[CurveEntry]
) -> SlidingCurve:
    """Return the steady curve of a friction law at some speeds and gauge pressures of the chambers."""
    sides = [steady_friction(friction, sign * speed, *gauges_pa) for sign in (1.0, -1.0)]
    at = {"a": gauges_pa[0] / 1e5, "b": gauges_pa[1] / 1e5, "position": 0.0}
    at |= {"reference": friction.temperature.reference_k} if friction.temperature else {}
    at |= {"slid": friction.wear.slid_m} if friction.wear else {}
    tables = [key for key, table in friction.to_dict().items() if key != "law" and isinstance(table, (dict, list))]
    lost = [sentences("not_exported").get(key, f"friction.{key}").format(**at) for key in tables]
    names = {entry.name for entry in entries}
    rest = [(key, str(w)) for key, w in _leaves(friction.to_dict()) if key not in names and not key.startswith("law.")]
    entries = (*entries, *(CurveEntry(key, word, "", np.nan, np.nan, "") for key, word in rest))
    unwritten = () if friction.formula is None else (f"the formulas of law {friction.law}",)
    if friction.law not in ("coulomb", "stribeck"):
        lost.append(
            f"presliding and the lag of friction behind speed (law {friction.law}): only the steady curve is exported"
        )
    exponent = friction.parameters.get("stribeck_exponent", 2.0)
    shape = friction.stribeck_shape or f"exp(-(v/vs)^{exponent:g})"
    curve = 0.5 * (sides[0] + sides[1])
    return SlidingCurve(title, friction.law, shape, speed, curve, *gauges_pa, entries, tuple(lost), unwritten)


def steady_friction(
    friction: Friction, velocity_m_s: Array, gauge_a_pa: float, gauge_b_pa: float, position_m: float = 0.0
) -> Array:
    """Return the steady friction of a law against the motion, N, at velocities, gauge pressures and a position."""
    from pneudrive import _core

    core = friction.core()
    law, parameters, pressure = core.pop("law"), core.pop("parameters"), core.pop("pressure", None)
    v = np.ascontiguousarray(velocity_m_s, dtype=np.float64)
    force = _core.steady_friction(law, parameters, v, gauge_a_pa, gauge_b_pa, pressure, core or None, position_m)
    return np.asarray(force) * np.sign(v)
