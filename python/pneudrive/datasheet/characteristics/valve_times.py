"""Times of a switching valve, on a virtual test stand with a small volume at its outlet."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.datasheet.characteristic import Axis, ResultValue, characteristic, number
from pneudrive.datasheet.strokes import first_passage
from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.datasheet.plant import HeldDrive

    Array = NDArray[np.float64]
    from pneudrive.datasheet.characteristic import Found

SHARE = 0.1  # of the change of the pressure at the outlet
VOLUME_M3 = 1e-5
REST_S, RATE_HZ = 0.5, 1e5  # between the commands; samples


@characteristic(
    "valve-times",
    algorithm="virtual test stand: reservoir, valve, volume",
    standard="form of ISO 12238",
    x="time",
    y="outlet_pressure",
    held=False,
)
def _times(plant: HeldDrive, share: float = SHARE, volume: float = VOLUME_M3) -> Found:
    """Times of the valve.

    From the command on, and off, until the pressure of 10 cm3 at the outlet has changed by 10 % of its way to the end.

    Settings
    --------
    share
        of the change
    volume
        at the outlet, m3
    """  # noqa: D401 - a title
    table = plant.circuit.components[plant.valve].plain()
    if "time_on" not in table:
        raise CommandError(
            f"{plant.valve} is a {table['kind']}",
            rule="times are those of a switching valve, with time_on and time_off",
            remedy="For a proportional valve, use bode.",
        )
    time, pressure = _run(plant, table, volume)
    on, off = time < REST_S, time >= REST_S
    rise, fall = pressure[on], pressure[off]
    up = first_passage(time[on], rise, rise[0] + share * (rise[-1] - rise[0]))
    down = first_passage(time[off], -fall, -fall[0] + share * (fall[0] - fall[-1])) - REST_S
    shown = np.unique(np.r_[np.linspace(0, time.size - 1, 800).astype(int)])
    axes = {"time": Axis(time[shown], "s", "time from the command on")}
    return axes, {
        "outlet_pressure": ResultValue(("time",), pressure[shown], "Pa", "absolute pressure at the outlet"),
        "time_on": number(up, "s", f"from the command on to {100.0 * share:g} % of the rise at the outlet"),
        "time_off": number(down, "s", f"from the command off to {100.0 * share:g} % of the fall"),
    }


def _run(plant: HeldDrive, table: dict[str, Any], volume: float) -> tuple[Array, Array]:
    """Command the valve on and off; return times and the pressure of a volume at its working port."""
    ports = [port["name"] for port in plant.circuit.components[plant.valve].entry["ports"]]
    outlet = "4" if "4" in ports else "2"
    other = [f"valve.{port}" for port in ports if port in ("2", "4") and port != outlet]
    circuit = type(plant.circuit).model_validate(
        {
            "name": "times of a valve",
            "ambient": plant.circuit.to_dict().get("ambient", {}),
            "components": {
                "supply": {"kind": "reservoir", "pressure": f"{plant.supply_pa!r} Pa abs"},
                "valve": table,
                "volume": {"kind": "tank", "volume": f"{volume!r} m3"},
            },
            "connections": ["supply -> valve.1", f"valve.{outlet} -> volume"],
            "plugged": other,
        }
    )
    run = circuit.simulate({"valve": f"0 s: 1, {REST_S} s: 0"}, 2.0 * REST_S, sample_rate=RATE_HZ)
    return run.time.to_numpy(), run["volume.pressure"].to_numpy()
