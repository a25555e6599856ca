"""Files of fits of every kind, sources of an export, and differences between two of them."""

from __future__ import annotations

from math import isfinite
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.describe.all_values import values_of
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.describe.files.load import OF_A_CIRCUIT
from pneudrive.describe.files.provenance import values
from pneudrive.errors import DescriptionError, FitError, nearest
from pneudrive.estimate.estimates import Estimate
from pneudrive.identify.dynamic.presliding import Presliding
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.static.result import FrictionFit, LawFit
from pneudrive.identify.volume import VolumeFit

if TYPE_CHECKING:
    from pathlib import Path

    import numpy as np
    from numpy.typing import NDArray

    Array = NDArray[np.float64]

AnyFit = FrictionFit | LawFit | DriveFit | VolumeFit | Presliding
KINDS: dict[str, type[AnyFit]] = {kind.KIND: kind for kind in (FrictionFit, LawFit, DriveFit, VolumeFit, Presliding)}


def read_fit(path: str | Path) -> AnyFit:
    """Read a fit of any kind.

    Raises
    ------
    FitError
        The file does not exist, is not TOML, or is not a complete fit.
    """
    content, _ = toml.read(path, FitError, "pneudrive fit and pneudrive identify write a fit.toml.")
    kind = str(content.get("kind", FrictionFit.KIND))
    if kind not in KINDS:
        raise FitError("the file is not a fit", where=str(path), value=f'kind = "{kind}"', remedy=nearest(kind, KINDS))
    return KINDS[kind].from_toml(path)


def read_source(path: str | Path) -> AnyFit | Drive:
    """Read the source of an export: a fit.toml, or a drive file.

    Raises
    ------
    FitError, DescriptionError
        The file is neither of them, or not valid.
    """
    if str(path).startswith("catalogue:"):
        return Drive.load(path)
    tables, _ = toml.read(path, FitError, "pneudrive fit writes a fit.toml.")
    if any(key in tables for key in OF_A_CIRCUIT):
        raise DescriptionError(
            "the file describes a circuit, but friction is exported from a fit or a drive",
            where=str(path),
            remedy="Export the whole circuit with --to fmu or --to c, or give the fit or the drive file.",
        )
    is_drive = "kind" not in tables and ("friction" in tables or "drive" in tables)
    return Drive.load(path) if is_drive else read_fit(path)


class Changed(NamedTuple):
    """One value that differs.

    Attributes
    ----------
    key : str
        Name in the drive file, or in the fit.
    before, after : str
        Values with their units; empty where one side lacks the value.
    interval_before, interval_after : str
        95 % intervals. Empty without an interval.
    change : float or None
        (after - before) / |before|, from the numbers in SI; None where one is not known, or `before` is 0.
    """

    key: str
    before: str
    after: str
    interval_before: str
    interval_after: str
    change: float | None


def differences(before: Drive | AnyFit, after: Drive | AnyFit) -> list[Changed]:
    """Return the values that differ in number or interval, in the order of the first source.

    Parameters
    ----------
    before, after : Drive, or fit of any kind
        Both drives, or both fits of one kind; from `pneudrive.identify.files.read_source`.

    Raises
    ------
    FitError
        They are not of one kind.

    Examples
    --------
    >>> drive = Drive.load("catalogue:reference")
    >>> (one,) = differences(drive, drive.replace({"load.mass": "2 kg"}))
    >>> one.key, one.after
    ('load.mass', '2 kg')
    """
    kinds = ["drive" if isinstance(one, Drive) else one.TITLE for one in (before, after)]
    if kinds[0] != kinds[1]:
        raise FitError(
            "only results of one kind can be compared",
            value=f"a {kinds[0]} and a {kinds[1]}",
            rule="two drives, or two fits of one kind",
        )
    old, new = _values(before), _values(after)
    pairs = {key: (old.get(key, _ABSENT), new.get(key, _ABSENT)) for key in {**old, **new}}
    return [
        Changed(key, old_text, new_text, old_ends, new_ends, _change(old_si, new_si))
        for key, ((old_text, old_ends, old_si), (new_text, new_ends, new_si)) in pairs.items()
        if (old_text, old_ends) != (new_text, new_ends)
    ]


def curve_differences(
    before: FrictionFit, after: FrictionFit, speed_m_s: Array, gauge_a_pa: float = 0.0, gauge_b_pa: float = 0.0
) -> list[Estimate]:
    """Return the difference between the laws of two fits, with 95 % intervals, N.

    The two fits are taken as independent. The intervals do not contain common errors of the sensors.

    Parameters
    ----------
    before, after : FrictionFit
        The difference is `after` less `before`.
    speed_m_s : ndarray, shape (n,)
    gauge_a_pa, gauge_b_pa : float
        Gauge pressures of the chambers.
    """
    sides = []
    for fit in (before, after):
        said = fit.predict(speed_m_s, gauge_a_pa, gauge_b_pa)
        freedom = fit.statistics["degrees_of_freedom"]
        pairs = zip(said.friction_n.tolist(), said.stderr_n.tolist(), strict=True)
        sides.append([Estimate.of(value, stderr, freedom) for value, stderr in pairs])
    return [new - old for old, new in zip(*sides, strict=True)]


def common(before: FrictionFit, after: FrictionFit, name: str) -> tuple[float, float]:
    """Return the range of a condition that both fits have measured.

    If there is no common range, the lower end is above the upper end.

    Parameters
    ----------
    before, after : FrictionFit
    name : str
        ``"speed_m_s"``, ``"gauge_a_pa"`` or ``"gauge_b_pa"``.
    """
    (low, high), (other_low, other_high) = (fit.provenance[name] for fit in (before, after))
    return max(low, other_low), min(high, other_high)


def _change(before: float | None, after: float | None) -> float | None:
    return None if before is None or after is None or before == 0.0 else (after - before) / abs(before)


#: Text, interval and number of a value that one side lacks.
_ABSENT = ("", "", None)


def _values(source: Drive | AnyFit) -> dict[str, tuple[str, str, float | None]]:
    """Return text, interval and number in SI of each value."""
    if isinstance(source, Drive):
        ends = {key: " … ".join(one.interval) for key, one in source.provenance.items()}
        numbers = {key: one.si for key, one in values(source).items()}
        return {one.key: (str(one.value), ends.get(one.key, ""), numbers.get(one.key)) for one in values_of(source)}
    known = {name: value for name, value in source.values.items() if isfinite(value)}
    return {
        name: (
            (f"{number} {unit}" if number else state).strip(),
            state.replace(" .. ", " … ") if name in source.intervals else "",
            known.get(name),
        )
        for name, number, unit, state, *_ in source.rows()
    }
