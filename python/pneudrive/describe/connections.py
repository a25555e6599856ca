"""Connections between the components of a circuit: conversion of chains of ports to joints, and check of the joints.

In `a -> b -> c`, the chain enters a component with two ports at the first port and leaves at the second. Exhausts and
optional ports are skipped. Any other port must be named. `a.4 .. b.12` is a pilot line: the pressure of a.4 acts on
port 12 of b, without flow.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple

from pneudrive.errors import Problems, invalid, nearest, wrong

ARROW = "->"
PILOT_LINE = ".."
AMBIENT = "ambient"
MOST_NAMED = 5  # components of an isolated group in a message


class Part(NamedTuple):
    """Data of a component before the check of its circuit."""

    entry: Mapping[str, Any] | None  # entry of its kind in the core, if the kind is known
    key: str  # key in the file
    pressure: str = ""  # pressure of a reservoir, for messages

    @property
    def table(self) -> str:
        """Key of the component's table. Copies share the key of one table."""
        return self.key.partition(".copies")[0]


class Port(NamedTuple):
    """Port of a component of a circuit."""

    component: str
    name: str
    kind: str  # "gas", "axis", "pilot" (senses a pressure without flow), or "ambient" of the ambient air
    #: Role of the port. "volume": gas with its own state; "pressure": constant pressure; "set": regulated pressure;
    #: "motion": an axis with commanded motion; "": a restriction, or any other axis
    holds: str
    exhaust: bool
    optional: bool

    @property
    def id(self) -> str:
        """Port as users write it: component and name."""
        return f"{self.component}.{self.name}".rstrip(".")

    @property
    def is_single(self) -> bool:
        """Whether only one connection may name the port, because its thread accepts one fitting.

        Pilot lines are not counted as connections.
        """
        return self.kind == "gas" and self.holds in ("", "set")

    @property
    def is_pilot(self) -> bool:
        """Whether only a pilot line may be connected to the port."""
        return self.kind == "pilot"


#: The ambient air, as an end of a connection.
AIR = Port(AMBIENT, "", AMBIENT, "", exhaust=False, optional=False)


@dataclass(eq=False)
class Joint:
    """Ports that share their gas or their motion, in the order in which connections name them."""

    ports: list[Port] = field(default_factory=list)
    ambient: bool = False  # open to the ambient air
    key: str = ""  # key of the connection that made the joint
    is_refused: bool = False

    def __str__(self) -> str:
        return ", ".join([port.id for port in self.ports] + [AMBIENT] * self.ambient)

    @property
    def holders(self) -> list[Port]:
        """Ports of components that fix the pressure."""
        return [port for port in self.ports if port.holds == "pressure"]

    @property
    def is_constant(self) -> bool:
        """Whether ambient air or a reservoir fixes the pressure of the joint."""
        return self.ambient or bool(self.holders)

    @property
    def volumes(self) -> list[Port]:
        """Ports of components with a volume."""
        return [port for port in self.ports if port.holds == "volume"]


class Wiring:
    """Joints of a circuit.

    Parameters
    ----------
    parts : mapping
        Name of a component -> its data.
    connections : sequence of str
        Chains such as ``"valve.4 -> hose -> cylinder.a"``.
    plugged : sequence of str
        Closed ports.
    templates : mapping
        Name of a table with copies -> names of these copies.
    problems : Problems
        Collects the errors.

    Attributes
    ----------
    joints : list of Joint
    at : dict
        Port -> its joint.
    warnings : list of str
        Warnings that name components whose gas is not connected to a reservoir.
    """

    def __init__(
        self,
        parts: Mapping[str, Part],
        connections: Sequence[str],
        plugged: Sequence[str],
        templates: Mapping[str, Sequence[str]],
        problems: Problems,
    ) -> None:
        self.parts, self.templates, self.problems = parts, templates, problems
        self.warnings: list[str] = []
        self.joints: list[Joint] = []
        self.at: dict[Port, Joint] = {}
        self.named: dict[Port, str] = {}  # port -> connection that names it
        self.meant: set[Port] = set()  # ports that a connection names, even if it is wrong
        before = len(problems.found)
        for number, chain in enumerate(connections):
            self._chain(chain, f"connections.{number}")
        plugs: dict[Port, str] = {}
        for number, text in enumerate(plugged):
            key = f"plugged.{number}"
            with problems.caught():
                name, dot, port = str(text).partition(".")
                self._known(name, str(text), key)
                if not dot:
                    rule = "a plug closes a port"
                    raise wrong(key, f'"{text}" is not a port', rule=rule, remedy='Write "valve.2".')
                if parts[name].entry is not None:
                    found = self._port(name, port, key)
                    if found in self.at:
                        raise invalid(key, "describe.plugged-and-joined", text=text, at=self.at[found])
                    plugs[found] = key
        if len(problems.found) == before:  # otherwise the meant ports are unknown
            self._rest(plugs)
        self._check()

    def ports(self, component: str) -> list[Port]:
        """Return the ports of a component in their order."""
        entry = self.parts[component].entry or {"ports": ()}
        return [Port(component, **port) for port in entry["ports"]]

    def core(self) -> list[list[str]]:
        """Return the joints in the core's form."""
        out = []
        for joint in self.joints:
            ports = [port.id for port in joint.ports]
            out += [[port, AMBIENT] for port in ports] if joint.ambient else [ports]
        return out

    def across(self, joint: Joint, only: Iterable[str] | None = None) -> Iterator[Joint]:
        """Yield the joints that exchange gas with a joint through one component.

        If `only` is given, this component must be one of `only`.
        """
        for port in joint.ports:
            if port.is_single and (only is None or port.component in only):
                for other in self.ports(port.component):
                    if other != port and other.is_single and other in self.at:
                        yield self.at[other]

    # --- reading -----------------------------------------------------------------------------

    def _chain(self, chain: object, key: str) -> None:
        """Join the ports of one connection."""
        with self.problems.caught():
            if not isinstance(chain, str):
                raise wrong(key, f"connection {chain!r} is not a string", remedy='Write "supply -> valve.1".')
            is_line = PILOT_LINE in chain
            if is_line and ARROW in chain:
                raise invalid(key, "describe.chain-and-pilot-line", chain=chain, arrow=ARROW, pilot_line=PILOT_LINE)
            words = [word.strip() for word in chain.split(PILOT_LINE if is_line else ARROW)]
            if len(words) < 2:
                raise invalid(key, "describe.joins-nothing", chain=chain)
            ends: list[tuple[Port | None, Port | None]] = []
            for place, word in enumerate(words):
                with self.problems.caught():
                    ends.append((None, None))
                    ends[-1] = self.element(word, key, first=place == 0, last=place == len(words) - 1)
            self.meant |= {port for both in ends for port in both if port}
            for (_, one), (other, _) in pairwise(ends):
                if one and other:
                    with self.problems.caught():
                        self._join(one, other, chain, key, is_line=is_line)

    def element(self, word: str, key: str, *, first: bool, last: bool) -> tuple[Port | None, Port | None]:
        """Return the ports at which a chain enters and leaves a component; None for a port that does not exist."""
        if word == AMBIENT:
            return AIR, AIR
        name, dot, port = word.partition(".")
        self._known(name, word, key)
        ports = self.ports(name)
        if not ports:
            return None, None
        if dot:
            found = self._port(name, port, key)
            return found, found
        through = [one for one in ports if not (one.exhaust or one.optional or one.is_pilot)]
        if len(through) == 1:
            out = [one for one in ports if one.exhaust]
            if not (first or last) and through[0].is_single and len(out) == 1:  # a silencer before the ambient air
                return through[0], out[0]
            return through[0], through[0]
        if len(through) == 2 and all(one.is_single or one.kind == "axis" for one in through):
            return (None if first else through[0]), (None if last else through[1])
        listed = ", ".join(one.id for one in ports)
        raise wrong(key, f"{name} has {len(ports)} ports; the connection must name one", remedy=f"Ports: {listed}.")

    def _known(self, name: str, word: str, key: str) -> None:
        if name in self.templates:
            copies = ", ".join(self.templates[name])
            raise wrong(key, f"{name} is a table of copies, not a component", remedy=f"Name a copy: {copies}.")
        if name not in self.parts:
            known = [*self.parts, AMBIENT]
            raise wrong(key, f'there is no component "{name}"', remedy=nearest(name, known))

    def _port(self, component: str, name: str, key: str) -> Port:
        kind = (self.parts[component].entry or {}).get("kind")
        for port in self.ports(component):
            if port.name == name:
                return port
        known = ", ".join(port.name for port in self.ports(component))
        raise invalid(key, "describe.no-such-port", component=component, name=name, kind=kind, known=known)

    def _join(
        self,
        one: Port,
        other: Port,
        chain: str,
        key: str,
        *,
        is_line: bool,
    ) -> None:
        ports, ends = (one, other), [one.id, other.id]
        pilots = [port.id for port in ports if port.is_pilot]
        if pilots and not is_line:  # gas would flow through a pilot port
            raise invalid(key, "describe.pilot-port", pilots=pilots, ends=ends, pilot_line=PILOT_LINE)
        if is_line and not pilots:
            raise invalid(key, "describe.no-pilot-port", ends=ends, arrow=ARROW)
        if (one.kind == "axis") != (other.kind == "axis"):
            said = ", ".join(f"{port.id} is {'an axis' if port.kind == 'axis' else port.kind}" for port in ports)
            raise wrong(key, said, rule="a gas port joins a gas port, an axis joins an axis")
        for port in ports:
            if (port.is_pilot if is_line else port.is_single) and port in self.named:
                before = self.named[port]
                remedy = "A pilot port senses one pressure: keep one of the lines." if is_line else None
                raise invalid(key, "describe.joined-twice", port=port.id, before=before, chain=chain, remedy=remedy)
        self.named |= {port: chain for port in ports if port.is_pilot or not is_line}
        self._merge(one, other, key)

    def _merge(self, one: Port, other: Port, key: str) -> None:
        """Merge the joints of two ports. A joint with two pressures or two volumes is reported once."""
        joints = [self._joint(port, key) for port in (one, other)]
        if joints[0] is joints[1]:
            return
        joint, other_joint = sorted(joints, key=self.joints.index)
        joint.ports += other_joint.ports
        joint.ambient |= other_joint.ambient
        self.at |= dict.fromkeys(other_joint.ports, joint)
        self.joints.remove(other_joint)
        held = [port.component for port in joint.holders] + [AMBIENT] * joint.ambient
        full = [port.component if len(self.ports(port.component)) == 1 else port.id for port in joint.volumes]
        if joint.is_refused or len(held) + len(full) < 2:
            return
        joint.is_refused = True
        if len(held) > 1 and AMBIENT in held:
            raise invalid(key, "describe.reservoir-at-ambient", name=held[0], ambient=AMBIENT)
        if len(held) > 1:
            rest = ", ".join(port.id for port in joint.ports if port not in joint.holders)
            at = " and ".join(filter(None, (self.parts[name].pressure for name in held)))
            rest = f"{rest and f' ({rest})'}{at and f' at {at}'}"
            raise invalid(key, "describe.two-pressures", names=" and ".join(held), rest=rest)
        if held:
            raise invalid(key, "describe.pressure-in-volume", name=held[0], full=full[0])
        raise invalid(key, "describe.two-volumes", names=" and ".join(full))

    def _joint(self, port: Port, key: str) -> Joint:
        """Return the joint of a port, or a new joint; each connection to ambient air is a new joint."""
        found = self.at.get(port)
        if found is None:
            found = Joint([] if port is AIR else [port], ambient=port is AIR, key=key)
            self.joints.append(found)
            self.at |= dict.fromkeys(found.ports, found)
        return found

    # --- checking ----------------------------------------------------------------------------

    def _rest(self, plugged: Mapping[Port, str]) -> None:
        """Close plugged ports, connect free exhausts to ambient air, and report other free ports that are required."""
        for port, key in plugged.items():
            self._joint(port, key)
        taken = self.meant | set(self.at)
        left = [port for name in self.parts for port in self.ports(name) if port not in taken]
        nowhere = [port for port in left if not (port.exhaust or port.optional)]
        for port in left:
            key = self.parts[port.component].key
            if port.exhaust:
                self._merge(port, AIR, key)
            elif not port.optional:
                others = [one for one in nowhere if one.component != port.component and one.kind == port.kind]
                rods = [one for one in left if one.kind == "axis" and one.optional]
                if port.is_pilot:
                    problem = invalid(key, "describe.loose-pilot", id=port.id)
                elif is_platform(self.parts[port.component].entry):
                    problem = invalid(key, "describe.loose-leg", id=port.id, rod=rods[0].id if rods else "leg.rod")
                else:
                    joined = f'Join it, for instance "{port.id} {ARROW} {others[0].id}"' if others else "Join it"
                    problem = invalid(key, "describe.loose-port", id=port.id, joined=joined)
                self.problems.add(problem)

    def _check(self) -> None:
        """Check the joints.

        Gas without a reservoir gives a warning. Gas without a reservoir and without a volume gives an error.
        """
        for name in self.parts:
            ports = [port for port in self.ports(name) if port.is_single]
            places = [self.at[port] for port in ports if port in self.at]
            if any(port.kind == "axis" for port in self.ports(name)):
                continue  # a piston separates its ports: equal pressures on both sides are a state like any other
            if len(ports) == len(places) == 2 and (places[0] is places[1] or all(place.ambient for place in places)):
                where = AMBIENT if places[0].ambient else f"{{{places[0]}}}"
                self.problems.add(invalid(places[0].key, "describe.short-circuit", name=name, joint=where))
        for joint in self.joints:
            if not joint.ambient and all(port.is_pilot for port in joint.ports):
                self.problems.add(invalid(joint.key, "describe.pilot-without-gas", joint=joint))
        left = [joint for joint in self.joints if any(port.kind == "gas" for port in joint.ports)]
        if self.problems.found:
            return
        while left:
            group = left[:1]
            for joint in group:  # grows during the loop to all joints with flow between them
                group += [other for other in dict.fromkeys(self.across(joint)) if other not in group]
            left = [joint for joint in left if joint not in group]
            if any(joint.is_constant for joint in group):
                continue
            full = {port.component for joint in group for port in joint.volumes}
            names = [name for name in self.parts if name in full]
            if names:
                rest = ", ..." if len(names) > MOST_NAMED else ""
                listed = f"{', '.join(names[:MOST_NAMED])}{rest}"
                self.warnings.append(f"gas cannot enter or leave, because no reservoir is connected: {listed}")
            else:
                self.problems.add(invalid(group[0].key, "describe.no-gas", joint=group[0]))


def is_platform(entry: Mapping[str, Any] | None) -> bool:
    """Return whether a kind of component is a platform: it has only axis ports, and more than two."""
    ports = entry["ports"] if entry else ()
    return len(ports) > 2 and all(port["kind"] == "axis" for port in ports)
