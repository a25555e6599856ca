"""Sonic conductance of a valve from datasheet values.

ISO 6358 describes a flow path by C and b. Datasheets also state a nominal flow, Kv or Cv. Each function states its
assumptions; `docs/guide/valve-flow.md` gives their accuracy.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from pneudrive import _core, constants
from pneudrive.arrays import Keyed, Plain
from pneudrive.errors import invalid, wrong

WATER_DENSITY_KG_M3 = 1000.0  # in the definition of Kv [iec60534-1]
BAR_PA = 1.0e5
# Kv of a path with Cv = 1: one US gallon per minute at 1 psi, in m3/h at 1 bar
KV_PER_CV = 3.785411784e-3 * 60.0 * math.sqrt(BAR_PA / 6894.757293168361)


def conductance_from_nominal_flow(flow_m3_s_anr: float, b: float, m: float) -> float:
    """Return C in m3/(s Pa) from the flow at 6 bar gauge before and 5 bar gauge after the valve, at 20 degC.

    q = C p1 [1 - ((r - b)/(1 - b))^2]^m with p1 = 7 bar, r = 6/7. Gauge pressure and flow both refer to the 100 kPa of
    the reference atmosphere [iso6358-2013, iso8778-2003]. Catalogues that print C, b and the nominal flow agree with
    this formula within 1 l/min [smc-eus11-83].
    """
    upstream, downstream = 6.0 * BAR_PA + constants.ANR_PRESSURE_PA, 5.0 * BAR_PA + constants.ANR_PRESSURE_PA
    return flow_m3_s_anr / (upstream * _core.flow_ratio(downstream / upstream, b, m))


def conductance_from_kv(kv_m3_h: float) -> float:
    """Return C in m3/(s Pa) from Kv, the flow of water in m3/h at 1 bar [iec60534-1].

    The effective area is assumed to be the same for water and for choked air: A = Kv sqrt(rho_water / (2 * 1 bar)) and
    C = A psi / (rho_0 sqrt(R T_0)). Kv = 1 m3/h gives 3.9 dm3/(s bar). In catalogues that print both Cv and C, C is 8 %
    less to 18 % more than this result [smc-eus11-83].
    """
    area = kv_m3_h / 3600.0 * math.sqrt(WATER_DENSITY_KG_M3 / (2.0 * BAR_PA))
    choked = _core.choked_flow_factor(constants.AIR_HEAT_CAPACITY_RATIO) / math.sqrt(
        constants.AIR_GAS_CONSTANT_J_KG_K * constants.ANR_TEMPERATURE_K
    )
    return area * choked / constants.ANR_DENSITY_KG_M3


#: Critical pressure ratio of a valve whose datasheet states a flow but not b (assumed), and the reason. Published
#: values of catalogue valves lie between 0.13 and 0.44.
USUAL_RATIO, USUAL_RATIO_SAID = 0.3, "usual for valves: the size is given without critical_pressure_ratio"


#: Alternative keys for the size of a flow path, and prefix of the keys for the exhaust path.
FLOW_KEYS, EXHAUST = ("conductance", "nominal_flow", "kv", "cv"), "exhaust_"
#: Prefix of the keys for the size of a flow control's needle. In a drive file, these keys have no prefix.
NEEDLE = "needle_"


def conductance_key(key: str) -> str:
    """Return the conductance key of the flow path whose size the given key states. Other keys do not change.

    Examples
    --------
    >>> conductance_key("needle_kv"), conductance_key("conductance"), conductance_key("volume")
    ('needle_conductance', 'conductance', 'volume')
    """
    size = next((size for size in FLOW_KEYS if key.endswith(size)), "")
    return f"{key.removesuffix(size)}conductance" if size else key


def without_other_sizes(old: Keyed, own: Iterable[str], optional: str = "") -> Plain:
    """Return the old values without the sizes of flow paths for which the new keys `own` contain a size.

    Keys with and without the prefix `optional` belong to the same flow path.
    """
    sized = {conductance_key(key).removeprefix(optional) for key in own}
    return {k: v for k, v in old.items() if k in own or conductance_key(k).removeprefix(optional) not in sized}


def size_given(sizes: Sequence[float | None], keys: Sequence[str], of: str) -> None:
    """Check that the size of a flow path is given exactly once.

    Parameters
    ----------
    sizes : sequence of float or None
        Sizes in the order of `FLOW_KEYS`.
    keys : sequence of str
        Keys of the sizes in the table.
    of : str
        Prefix of the keys: the table and a dot, or empty.

    Raises
    ------
    DescriptionError
        The size is missing, or given more than once.
    """
    given = [key for key, value in zip(keys, sizes, strict=True) if value is not None]
    if not given:
        raise wrong(f"{of}{keys[0]}", f"{of}{keys[0]} is missing", rule=f"exactly one of {', '.join(keys)}")
    if len(given) > 1:
        raise invalid(f"{of}{given[-1]}", "describe.flow-twice", count=len(given), given=", ".join(given))


def check_shape(table: str, critical_pressure_ratio: float, linear_above: float) -> None:
    """Check that the flow of a path becomes linear at a pressure ratio, `linear_above`, above the critical one.

    Raises
    ------
    DescriptionError
    """
    if not critical_pressure_ratio < linear_above:
        other = f"{table}.critical_pressure_ratio = {critical_pressure_ratio:g}"
        raise wrong(f"{table}.linear_above", f"{table}.linear_above = {linear_above:g} must exceed {other}")


def conductance_of(sizes: Sequence[float | None], b: float, m: float) -> float:
    """Return C in m3/(s Pa) from the given size. `sizes` are in the order of `FLOW_KEYS`."""
    c, flow, kv, cv = sizes
    if c is not None:
        return c
    if flow is not None:
        return conductance_from_nominal_flow(flow, b, m)
    return conductance_from_kv(kv if kv is not None else (cv or 0.0) * KV_PER_CV)


def path_of(table: Keyed, *, exhaust: bool) -> Plain:
    """Return size and shape of a flow path of a valve.

    The exhaust path has the values of the supply path unless other values are given.
    """
    shape = {key: table[key] for key in ("critical_pressure_ratio", "subsonic_index", "linear_above") if key in table}
    out = {key: table[key] for key in FLOW_KEYS if key in table} | shape
    own = {key.removeprefix(EXHAUST): value for key, value in table.items() if key.startswith(EXHAUST)}
    if exhaust and own:
        sized = any(key in own for key in FLOW_KEYS)
        out = {key: value for key, value in out.items() if not (sized and key in FLOW_KEYS)} | own
    return out
