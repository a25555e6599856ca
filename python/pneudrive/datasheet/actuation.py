"""The valves of a drive as one signal u: 1 and -1 move the piston out and back, 0 shuts the valves.

A switching valve has only the commands of its positions. To hold a state, it is replaced by a proportional valve with
the same paths, fully open to one side or the other.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe.circuit import Circuit

#: Keys of a switching valve that a proportional one does not have.
_TIMES = ("time_on", "time_off", "travel_share", "pwm_frequency", "pwm_model", "normally", "centre")
#: Keys of the paths of a valve with five ports from its supply, and to its exhaust.
_SIZES, _EXHAUST = ("conductance", "nominal_flow", "kv", "cv"), "exhaust_"
LOCK = "rod-lock"
#: Position of a valve that keeps its position.
_KEPT = "position"


@dataclass(frozen=True)
class Actuation:
    """Commands of all valves for the two directions of the piston.

    Attributes
    ----------
    out, back : dict
        Valve -> its command for motion towards the end of chamber b, and of chamber a.
    is_switched : bool
        Whether a valve has positions only, so that u is 1 or -1.
    has_shares : bool
        Whether commands between 0 and full opening are those of the drive itself.
    held : dict
        Switching valve -> its command -> the command of the proportional valve that holds its position.
    """

    out: dict[str, float]
    back: dict[str, float]
    is_switched: bool = False
    has_shares: bool = True
    held: Mapping[str, Mapping[float, float]] = field(default_factory=dict)

    def commands(self, u: float) -> dict[str, float]:
        """Return the command of each valve; an empty dict leaves switching valves at rest.

        Raises
        ------
        CommandError
            A switching valve has no such command.
        """
        if self.is_switched and u == 0.0:
            return {}
        if self.is_switched and abs(u) != 1.0:
            raise CommandError(
                f"command = {u:g}: {' and '.join(self.held)} is on or off",
                rule="the commands of a switching valve are its two directions, 1 and -1",
            )
        full = self.out if u >= 0.0 else self.back
        return {name: abs(u) * value for name, value in full.items()}

    @property
    def of_held(self) -> Actuation:
        """Commands of the drive whose switching valves are replaced by proportional ones."""

        def seen(commands: dict[str, float]) -> dict[str, float]:
            return {name: self.held[name][value] if name in self.held else value for name, value in commands.items()}

        return Actuation(seen(self.out), seen(self.back), has_shares=self.has_shares)


def held_tables(circuit: Circuit) -> dict[str, Any]:
    """Return the tables of a circuit with proportional valves in place of its switching valves."""
    tables = circuit.to_dict()
    parts = dict(tables["components"])
    for name in circuit.commandable:
        if circuit.components[name].kind in HELD:
            parts[name] = _proportional(circuit.components[name].kind, circuit.components[name].plain())
    starts = {
        name: dict(table) if isinstance(table, dict) else table for name, table in tables.get("initial", {}).items()
    }
    for name in circuit.commandable:
        if isinstance(starts.get(name), dict):
            starts[name].pop(_KEPT, None)
    starts = {name: table for name, table in starts.items() if table != {}}
    return tables | {"components": parts} | ({"initial": starts} if "initial" in tables else {})


#: Kind of a switching valve -> kind of the proportional valve with the same paths.
HELD = {
    "valve/switching-2/2": "valve/proportional-3/2",
    "valve/switching-3/2": "valve/proportional-3/2",
    "valve/switching-5/2": "valve/proportional-5/3",
    "valve/switching-5/3": "valve/proportional-5/3",
    "valve/impulse-5/2": "valve/proportional-5/3",
}


def _proportional(kind: str, table: dict[str, Any]) -> dict[str, Any]:
    """Return the table of the proportional valve with the paths of a switching valve."""
    out = {key: value for key, value in table.items() if key not in _TIMES} | {"kind": HELD[kind]}
    if HELD[kind] != "valve/proportional-5/3":
        return out
    supply, exhaust = path_of(table, exhaust=False), path_of(table, exhaust=True)
    out = {key: value for key, value in out.items() if not key.startswith(_EXHAUST) and key not in _SIZES}
    paths = {"4": (supply, exhaust), "2": (supply, exhaust)}
    if supply == exhaust:
        return out | supply
    from pneudrive.describe.components import component

    c, c_exhaust = (component({"kind": "fitting"} | path) for path in (supply, exhaust))
    points = []
    for opening in (-1.0, 0.0, 1.0):
        point: dict[str, Any] = {"opening": opening}
        for port, sign in zip(paths, (1.0, -1.0), strict=True):
            for way, path, towards in (("supply", c, sign), ("exhaust", c_exhaust, -sign)):
                size = path.numbers(1e5)["conductance"] if opening == towards else 0.0
                point |= {f"{way}_{port}": f"{size!r} m3/(s Pa)"}
                point |= {f"{way}_{port}_critical_pressure_ratio": path.numbers(1e5)["critical_pressure_ratio"]}
        points.append(point)
    return out | {"flow_table": points, "flow_shape": "straight"}


def path_of(table: Mapping[str, Any], *, exhaust: bool) -> dict[str, Any]:
    """Return size and shape of a path of a valve.

    The exhaust has the values of the supply unless other values are given.
    """
    shape = {key: table[key] for key in ("critical_pressure_ratio", "subsonic_index", "linear_above") if key in table}
    out = {key: table[key] for key in _SIZES if key in table} | shape
    own = {key.removeprefix(_EXHAUST): value for key, value in table.items() if key.startswith(_EXHAUST)}
    if exhaust and own:
        sized = any(key in own for key in _SIZES)
        out = {key: value for key, value in out.items() if not (sized and key in _SIZES)} | own
    return out


def positions_of(kind: str, table: Mapping[str, Any]) -> dict[float, float]:
    """Return the commands to try for a valve, each with the command of the proportional valve that replaces it."""
    if kind == LOCK:
        return {0.0: 0.0}  # open
    if kind.startswith("valve/proportional"):
        return {1.0: 1.0, -1.0: -1.0}
    if kind == "valve/switching-5/3":
        return {1.0: 1.0, -1.0: -1.0} | ({0.0: 0.0} if table.get("centre", "closed") == "closed" else {})
    if kind == "valve/impulse-5/2":
        return {1.0: 1.0, -1.0: -1.0}
    on, off = (1.0, 0.0) if kind == "valve/switching-2/2" else (1.0, -1.0)
    return {0.0: on, 1.0: off} if table.get("normally") == "open" else {0.0: off, 1.0: on}


def shut_up_to(valve: Any, side: float) -> tuple[float, bool]:  # noqa: ANN401 - a component
    """Return the size of the command up to which a proportional valve is shut on a side, 1 or -1.

    The second value states whether its flow begins there without slope, as that of a smooth table does.
    """
    core = valve.core(0.0)
    points = core.get("points", ())
    shut = (side * point[0] for point in points if not any(point[1::2]))
    is_smooth = bool(len(points)) and core["choices"].get("flow_shape") == "smooth"
    return max(core["numbers"].get("overlap", 0.0), 0.0, *shut), is_smooth
