"""Study of the tubes between valve and cylinder: speed and stroke time of a drive over their length and bore."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.constants import ANR_DENSITY_KG_M3, ANR_TEMPERATURE_K
from pneudrive.describe.tables.valve_flow import path_of
from pneudrive.errors import CommandError, DescriptionError, PneudriveWarning
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.simulation.simulate import positive, simulate
from pneudrive.simulation.trajectory import TABLE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import xarray as xr

    from pneudrive.describe import Drive
    from pneudrive.describe.tables.parts import Gas

LENGTHS, DIAMETERS = ("0.5 m", "1 m", "2 m", "5 m"), ("4 mm", "6 mm", "8 mm")
SAMPLES = 1000.0  # m/s; gives the expected time of a stroke
PATIENCE = (1.0, 4.0, 16.0, 64.0)  # durations of the runs over the expected time; a slower drive does not arrive
SETTLED_S = 5.0  # after that the flow through a line is steady
VACUUM = 1e-4  # pressure behind a valve with choked flow, over that before the line


def lines(
    drive: Drive,
    lengths: Sequence[str | float] = LENGTHS,
    diameters: Sequence[str | float] = DIAMETERS,
    *,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> xr.Dataset:
    """Simulate full strokes of a drive with tubes of several lengths and bores at both chambers.

    Every tube has ``kind = "tube"`` (steady, an empirical formula). Flow controls of the drive stay.

    Parameters
    ----------
    drive : Drive
        The tubes of this study replace its `[tubing]`, if it has any.
    lengths, diameters : sequence of str or float
        Quantities, or numbers in m.
    progress, cancel : optional
        See `pneudrive.progress.Watch`.

    Returns
    -------
    xarray.Dataset
        Dimensions diameter and length (m). Variables vent_conductance, vent_speed, stroke_time_out, stroke_time_back,
        mean_speed, end_speed. NaN if the piston does not arrive. ``attrs["without_tubes"]`` and
        ``attrs["as_described"]`` hold the same values for the drive without tubes and with the described ones.

    Raises
    ------
    CommandError
        A length or a diameter is not a positive length.
    DescriptionError
        `drive` is not a `Drive`.
    Cancelled
        `cancel` was set.

    Examples
    --------
    >>> import pneudrive as pn
    >>> study = pn.lines(pn.Drive.load("catalogue:reference"), ["1 m"], ["4 mm"])
    >>> round(float(study.vent_speed[0, 0]), 3)
    2.297
    """
    import numpy as np
    import xarray as xr

    if not hasattr(drive, "tubing"):
        remedy = "Describe it as a drive file: [supply], [valve], [cylinder], [friction]."
        raise DescriptionError(f"the table of tubes needs a drive, but got a {type(drive).__name__}", remedy=remedy)
    long, wide = _metres(lengths, "length"), _metres(diameters, "diameter")
    rows: list[dict[str, float]] = []
    for diameter, length in Watch(progress, cancel).each([(d, n) for d in wide for n in long], "tubes"):
        tube = {"length": units.UnitFloat(length, "m", "m"), "diameter": units.UnitFloat(diameter, "m", "mm")}
        rows.append(_row(_with_tubes(drive, {"a": tube, "b": tube})))
    attrs = {"title": drive.name, "without_tubes": _row(_with_tubes(drive, None))}
    if drive.tubing:
        attrs["as_described"] = _row(drive)
    variables = {
        name: (("diameter", "length"), np.reshape([row[name] for row in rows], (len(wide), -1)), about)
        for name, about in ((name, {"units": unit, "long_name": text}) for name, (unit, text) in TABLE["tubes"].items())
    }
    axes = {
        "diameter": ("diameter", wide, {"units": "m", "long_name": "inner diameter of the tubes"}),
        "length": ("length", long, {"units": "m", "long_name": "length of each tube"}),
    }
    return xr.Dataset(variables, axes, attrs)


def _metres(given: Sequence[str | float], what: str) -> list[float]:
    """Return different lengths in m, increasing."""
    if isinstance(given, str) or not given:
        raise CommandError(f"{what} = {given!r} is not a list of quantities", remedy='For instance ["0.5 m", "2 m"].')
    return sorted({positive(one, "m", what) for one in given})


def _with_tubes(drive: Drive, tubing: dict[str, Any] | None) -> Drive:
    tables = {key: table for key, table in drive.to_dict().items() if key not in ("tubing", "provenance", "friction")}
    return type(drive).model_validate(tables | ({"tubing": tubing} if tubing else {}) | {"friction": drive.friction})


def _row(drive: Drive) -> dict[str, float]:
    """Return the results of one drive by variable, in the order of the table."""
    conductance = _vent_conductance(drive)
    mean_k = math.sqrt(ANR_TEMPERATURE_K * drive.ambient.temperature_k)  # C is that at the temperature of ISO 6358
    flow = ANR_DENSITY_KG_M3 * drive.gas.gas_constant_j_kg_k * mean_k  # times C/A: speed at choked flow
    speed = conductance * flow / drive.cylinder.area_b_m2
    out, end_speed = _stroke(drive, speed, 1)
    back, _ = _stroke(drive, speed, -1)
    return dict(
        zip(TABLE["tubes"], (conductance, speed, out, back, drive.cylinder.stroke_m / out, end_speed), strict=True)
    )


def _vent_conductance(drive: Drive) -> float:
    """Return the sonic conductance C of the exhaust path of chamber b with the valve open, from its steady flow.

    The pressure after the valve is so low that the flow is choked. Unit: m3/(s Pa).
    """
    parts, pressure = drive.circuit.components, drive.supply_pressure_pa
    lines = {name: parts[name] for name in ("flow_control_b", "tube_b") if name in parts}
    edge = {"kind": "fitting"} | path_of(parts["valve"].plain(), exhaust=True)
    way = [*((name, "2", "1") for name in lines), ("edge", "1", "2")]
    flow = steady_flow({"edge": edge, **lines}, way, pressure, VACUUM * pressure, drive.gas)
    return flow / (ANR_DENSITY_KG_M3 * pressure)


def steady_flow(
    parts: Mapping[str, Any], way: Sequence[tuple[str, str, str]], before_pa: float, behind_pa: float, gas: Gas
) -> float:
    """Return the steady mass flow through components in series between two pressures, kg/s.

    The pressures between the components are found by a simulation until they are constant.

    Parameters
    ----------
    parts : mapping
        Components by name, or their tables.
    way : sequence of (str, str, str)
        Each component with the ports by which the gas enters and leaves, in the direction of the flow.
    before_pa, behind_pa : float
        Pressures at both ends, absolute. The gas before the path has the temperature of ISO 6358.
    gas : Gas
    """
    from pneudrive.describe import Ambient, Circuit

    temperature = units.UnitFloat(ANR_TEMPERATURE_K, "K", "K")
    upstream = {"kind": "reservoir", "pressure": f"{before_pa!r} Pa abs", "temperature": temperature}
    leaves = ["upstream", *(f"{name}.{last}" for name, _, last in way)]
    enters = [*(f"{name}.{first}" for name, first, _ in way), "ambient"]
    stand = Circuit(
        gas=gas,
        ambient=Ambient(pressure=units.Pressure(behind_pa, gauge=False)),
        components={"upstream": upstream, **parts},
        connections=tuple(f"{one} -> {other}" for one, other in zip(leaves, enters, strict=True)),
    )
    run = stand.simulate(None, SETTLED_S, sample_rate=1.0 / SETTLED_S)
    return abs(float(run["upstream.mass_flow"][-1]))


def _stroke(drive: Drive, speed: float, direction: int) -> tuple[float, float]:
    """Return the time of a full stroke from rest, s, and the speed at its end, m/s.

    NaN if the piston does not arrive.
    """
    import warnings

    import numpy as np

    stroke = drive.cylinder.stroke_m
    supply = f"{drive.supply_pressure_pa!r} Pa abs"
    start = {"position": "0 mm", "pressure_b": supply}
    if direction < 0:
        start = {"position": units.UnitFloat(stroke, "m", "mm"), "pressure_a": supply}
    expected = 2.0 * stroke / speed
    for times in PATIENCE:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", PneudriveWarning)  # the study ignores cushions and impacts
            run = simulate(drive, float(direction), times * expected, initial=start, sample_rate=SAMPLES / expected)
        for impact in run.attrs["impacts"]:
            if impact["end"] == ("b" if direction > 0 else "a"):
                return impact["time_s"], impact["speed_m_s"]
        x = run.position.to_numpy() if direction > 0 else stroke - run.position.to_numpy()
        there = np.flatnonzero(x >= stroke)
        if there.size:  # too slow to count as an impact
            return float(run.time[there[0]]), abs(float(run.velocity[there[0]]))
    return math.nan, math.nan
