"""The state in which a circuit starts: what is given of it, and what the rest follows from."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive import units
from pneudrive.describe.base import Bounds, Quantity, StatedPressure, within, wrong
from pneudrive.errors import DescriptionError, Problems, nearest

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

    from pneudrive.describe.components import Component
    from pneudrive.describe.connections import Joint, Port, Wiring
    from pneudrive.describe.parts import Ambient

PRESSURE, TEMPERATURE, POSITION, VELOCITY = "pressure_pa", "temperature_k", "position_m", "velocity_m_s"
#: Start values by the last part of their name in the core: their key, and how they are written.
_MARKS: dict[str, tuple[str, Quantity | StatedPressure]] = {
    PRESSURE: ("pressure", StatedPressure()),
    TEMPERATURE: ("temperature", Quantity("K", "K", Bounds(above=0.0))),
    POSITION: ("position", Quantity("m", "mm")),
    VELOCITY: ("velocity", Quantity("m/s", "mm/s")),
    "contact_age_s": ("contact_age", Quantity("s", "s", Bounds(at_least=0.0))),
}


class Starts:
    """The start values of a circuit.

    Parameters
    ----------
    names : sequence of str
        As the core has them: ``left.position_m``, ``left.a.pressure_pa``, ``tank.pressure_pa``.
    components : mapping
    wiring : Wiring
    ambient : Ambient
    """

    def __init__(
        self, names: Sequence[str], components: Mapping[str, Component], wiring: Wiring, ambient: Ambient
    ) -> None:
        self.names, self.components, self.wiring, self.ambient = names, components, wiring, ambient
        self.places: dict[str, Joint] = {}  # what a start of gas belongs to -> its joint
        self.keys = {_key(name): name for name in names}  # as users write them
        for name in names:
            of, _, last = name.rpartition(".")
            if last == PRESSURE:
                self.keys[of] = name
                self._place(of)

    def _place(self, of: str) -> None:
        """Find the joint to whose gas a start belongs, which may be named by each of its ports."""
        for port, joint in self.wiring.at.items():
            if of == port.id or (of == port.component and port.holds == "volume"):
                self.places[of] = joint
                for other in joint.ports:
                    for last in (PRESSURE, TEMPERATURE):
                        self.keys.setdefault(_key(f"{other.id}.{last}"), f"{of}.{last}")
                    self.keys.setdefault(other.id, f"{of}.{PRESSURE}")
                return

    def values(self, *given: Mapping[str, Any]) -> tuple[dict[str, float], list[str]]:
        """Return all start values in SI, and what of them was assumed.

        Parameters
        ----------
        *given : mapping
            Tables as users write them, nested or with dotted keys; a later one replaces values of an earlier one.

        Raises
        ------
        DescriptionError
            An unknown key, or a value that does not fit.
        """
        known: dict[str, float] = {}
        problems = Problems()
        for key, value in (entry for table in given for entry in _flat(table)):
            with problems.caught():
                name = self.keys.get(key)
                if name is None:
                    own = [_key(one) for one in self.names]
                    raise wrong(f"initial.{key}", f"{key} is no start value", remedy=nearest(key, own))
                known[name] = self._read(key, name, value)
        problems.tell()
        notes: list[str] = []
        out = dict(known)
        for name in self.names:
            if name not in out:
                of, _, last = name.rpartition(".")
                if last == PRESSURE:
                    out[name] = self._pressure(of, known, notes)
                else:
                    moves = last in (POSITION, VELOCITY)
                    out[name] = self._moved(of, last, known) if moves else self._otherwise(of, last)
        return out, notes

    def _read(self, key: str, name: str, given: object) -> float:
        of, _, last = name.rpartition(".")
        try:
            value = _written(last)[1].read(given)
        except DescriptionError as error:
            raise within(error, key, "initial.") from None
        if isinstance(value, units.Pressure):
            absolute = value.absolute_pa(self.ambient.pressure_pa)
            if not absolute > 0.0:
                raise wrong(f"initial.{key}", f"{key} = {value} is below vacuum", rule="gauge + ambient > 0")
            return absolute
        stroke = self._stroke(of) if last == POSITION else None
        if stroke is not None and not 0.0 <= value <= stroke:
            what = f"{key} = {value * 1e3:g} mm lies outside the stroke"
            raise wrong(f"initial.{key}", what, rule=f"0 mm <= position <= {of}.stroke = {stroke * 1e3:g} mm")
        return value

    def _stroke(self, of: str) -> float | None:
        return getattr(self.components.get(of), "stroke_m", None)

    def _otherwise(self, of: str, last: str) -> float:
        """Mid stroke, at rest, ambient temperature, a fresh contact."""
        if last == TEMPERATURE:
            return self.ambient.temperature_k
        return 0.5 * (self._stroke(of) or 0.0) if last == POSITION else 0.0

    def _moved(self, of: str, last: str, known: Mapping[str, float]) -> float:
        """Return position or velocity of a mass: one without a stroke goes along with what it is coupled to."""
        found = [of]
        for name in found:  # grows as it is looked at
            if f"{name}.{last}" in known:
                return known[f"{name}.{last}"]
            if self._stroke(name) is not None and f"{name}.{last}" in self.names:
                return self._otherwise(name, last)
            for port in self.wiring.ports(name):
                joint = self.wiring.at.get(port) if port.kind == "axis" else None
                found += [one.component for one in joint.ports if one.component not in found] if joint else []
        return self._otherwise(of, last)

    def _pressure(self, of: str, known: Mapping[str, float], notes: list[str]) -> float:
        """Return the pressure to which gas has settled: the one given or held nearest by, over what is always open."""
        if of not in self.places:
            notes = []  # of a cell within a component: what is said of the joint holds for it
        starts = {joint: name for name, joint in self.places.items() if f"{name}.{PRESSURE}" in known}
        held: Port | None = None
        for joint in self._reached(self.places.get(of) or self._before(of)):
            if joint in starts:
                value = known[f"{starts[joint]}.{PRESSURE}"]
                notes.append(f"{of} starts at {_bar(value)}, as {starts[joint]} does")
                return value
            held = held or next((port for port in joint.ports if port.holds in ("pressure", "set")), None)
        if held is None:
            return self.ambient.pressure_pa
        (stated,) = self.components[held.component].pressures()
        value = stated.absolute_pa(self.ambient.pressure_pa)
        notes.append(f"{of} starts at {_bar(value)}, as {held.component} has it")
        return value

    def _before(self, cell: str) -> Joint | None:
        """Return the joint at the first port of the component that a cell lies within, if gas can always pass to it."""
        own = cell.rpartition(".")[0]
        if own not in self.components or not self.components[own].entry["open"]:
            return None
        return next((joint for port, joint in self.wiring.at.items() if port.component == own), None)

    def _reached(self, first: Joint | None) -> Iterator[Joint]:
        """Give the joints to which gas can always pass, nearest first; it goes up to constant pressure, not past."""
        always = {name for name, one in self.components.items() if one.entry["open"]}
        found = [] if first is None else [first]
        for joint in found:  # grows as it is looked at
            yield joint
            if not joint.is_constant:
                found += [other for other in dict.fromkeys(self.wiring.across(joint, always)) if other not in found]


def _key(name: str) -> str:
    """Return a start value's name without the unit, as users write it."""
    of, _, last = name.rpartition(".")
    return f"{of}.{_written(last)[0]}"


def _written(last: str) -> tuple[str, Quantity | StatedPressure]:
    """Return the key and the annotation of a start value; what is not listed is a pure number."""
    return _MARKS.get(last, (last, Quantity("")))


def _flat(table: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        full = f"{before}{key}"
        if isinstance(value, dict):
            yield from _flat(value, f"{full}.")
        else:
            yield full, value


def _bar(value: float) -> str:
    return f"{value * 1e-5:.6g} bar abs"
