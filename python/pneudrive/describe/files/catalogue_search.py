"""Parts of the catalogue by kind and size: bore, stroke, flow."""

from __future__ import annotations

from fnmatch import fnmatchcase
from typing import TYPE_CHECKING

from pneudrive import units
from pneudrive.describe.files.catalogue import entries
from pneudrive.describe.keys import wrong
from pneudrive.describe.tables.valve_flow import FLOW_KEYS, conductance_of
from pneudrive.errors import nearest

if TYPE_CHECKING:
    from pneudrive.describe.files.catalogue import Entry

CONDUCTANCE, NOMINAL_FLOW = "m^3/(s Pa)", "m^3/s ANR"
#: Critical pressure ratio where a part states none (assumed: of a fitting), and the usual subsonic index.
ASSUMED_B, USUAL_INDEX = 0.3, 0.5
#: Values count as equal within this share.
NEAR = 1e-3


def find_parts(
    kind: str | None = None, bore: str | None = None, stroke: str | None = None, flow: str | None = None
) -> list[Entry]:
    """Return the parts that fit, by name.

    Parameters
    ----------
    kind : str, optional
        Kind of component, the beginning of one, or a pattern: ``"valve"``, ``"cylinder/rodless"``, ``"*5/3"``.
    bore, stroke : str, optional
        A length, or a range: ``"25 mm"``, ``"20 mm .. 40 mm"``. A part without a fixed stroke is made to order and fits
        any stroke.
    flow : str, optional
        Sonic conductance or nominal flow, or a range of one: ``"1 dm3/(s bar) .. 3 dm3/(s bar)"``, ``"500 l/min ANR ..
        800 l/min ANR"``. For a flow control, this is the needle when fully open.

    Raises
    ------
    DescriptionError
        A quantity cannot be read, or no part is of this kind.

    Examples
    --------
    >>> [one.name for one in find_parts("cylinder", bore="25 mm")]
    ['parker-osp-p25', 'smc-c55-25', 'smc-cd85n25', 'smc-cm2y-25', 'smc-cy1b25h', 'smc-cy1b25l', 'smc-mgpm25']
    """
    found = [entry for entry in entries().values() if not entry.is_drive]
    if kind is not None:
        kinds = sorted({one.kind for one in found})
        found = [one for one in found if one.kind.startswith(kind) or fnmatchcase(one.kind, kind)]
        if not found:
            raise wrong("kind", f'the catalogue has no part of the kind "{kind}"', remedy=nearest(kind, kinds))
    for key, given in (("bore", bore), ("stroke", stroke)):
        if given is not None:
            low, high = _range(key, given, "m")
            found = [one for one in found if _is_to_order(one, key) or _fits(_length(one, key), low, high)]
    if flow is not None:
        unit = NOMINAL_FLOW if "ANR" in flow else CONDUCTANCE
        low, high = _range("flow", flow, unit)
        found = [one for one in found if _fits(_flow(one, unit), low, high)]
    return sorted(found, key=lambda one: one.name)


def _range(key: str, given: str, unit: str) -> tuple[float, float]:
    if ".." in given:
        return units.parse_range(given, unit)
    value = units.parse(given, unit)
    if not value > 0.0:
        raise wrong(key, f'{key}: "{given}" is out of bounds', rule="greater than 0")
    return value, value


def _fits(value: float | None, low: float, high: float) -> bool:
    return value is not None and (1.0 - NEAR) * low <= value <= (1.0 + NEAR) * high


def _is_to_order(entry: Entry, key: str) -> bool:
    """Return whether a cylinder is available with any stroke (its data sheet gives none)."""
    is_given = any(value.key == key and value.source is not None for value in entry.values)
    return key == "stroke" and entry.kind.startswith("cylinder/") and not is_given


def _length(entry: Entry, key: str) -> float | None:
    return next((units.parse(value.value, "m") for value in entry.values if value.key == key), None)


def _flow(entry: Entry, unit: str) -> float | None:
    """Return the sonic conductance of a part, or its nominal flow. None if the part does not state a flow."""
    own = {value.key: value.value for value in entry.values}
    before = next((before for before in ("", "needle_") if any(before + key in own for key in FLOW_KEYS)), None)
    if before is None:
        return None
    b, m = own.get("critical_pressure_ratio", ASSUMED_B), own.get("subsonic_index", USUAL_INDEX)
    written = (CONDUCTANCE, NOMINAL_FLOW, "Kv", "Cv")
    sizes = [
        units.parse(own[before + key], of) if before + key in own else None
        for key, of in zip(FLOW_KEYS, written, strict=True)
    ]
    conductance = conductance_of(sizes, b, m)
    return conductance if unit == CONDUCTANCE else conductance / conductance_of((None, 1.0, None, None), b, m)
