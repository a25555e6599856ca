"""Adding, joining and removing components of a circuit in the drawing, as changes of its TOML text."""

from __future__ import annotations

import re
from copy import copy
from itertools import count, pairwise
from typing import Any, Literal

import tomlkit
from pydantic import StrictStr

from pneudrive.arrays import Plain
from pneudrive.describe.circuit import Circuit
from pneudrive.describe.connections import AMBIENT, ARROW, PILOT_LINE, Part, Port, Wiring
from pneudrive.describe.kinds import component_kinds
from pneudrive.errors import CommandError, package_table
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.workspace import Workspace

ASSUMED = "Assumed initial values."


#: Kind -> initial values of a component.
STARTERS = package_table(__file__, "starters.toml")


def kinds() -> Plain:
    """Return the kinds that can be added, with their titles."""
    every = component_kinds()
    return {"kinds": [(one, every[one]["title"]) for one in STARTERS]}


def restructured(
    workspace: Workspace,
    path: StrictStr,
    text: StrictStr,
    act: Literal["open", "add", "join", "cut", "remove"],
    one: StrictStr = "",
    other: StrictStr = "",
    kind: StrictStr = "",
) -> Plain:
    """Return the text of a circuit after a change of its structure, and the component to show.

    Parameters
    ----------
    workspace : Workspace
    path, text : str
        Name of the description, and its text in the page.
    act : str
        ``"add"`` a component of `kind` at the port `one`, ``"join"`` the ports `one` and `other`, ``"cut"`` the lines
        of the port `one`, ``"remove"`` the component `one`, or ``"open"`` a drive as a circuit.
    one, other, kind : str

    Raises
    ------
    CommandError
        The request is not valid, or the description is not a circuit.
    DescriptionError
        The text before the change is not valid.
    """
    described = described_at(workspace, path, text)
    if act == "open":
        return {"text": described.circuit.to_toml(), "chosen": ""}
    if not isinstance(described, Circuit):
        raise CommandError("a drive has a fixed structure", remedy="Open it as a circuit first.")
    change = CircuitText(text, described.wiring)
    chosen = ""
    match act:
        case "add":
            chosen = change.add(kind, one)
        case "join":
            change.join(one, other)
        case "cut":
            change.cut(one)
        case "remove":
            change.remove(one)
    return {"text": change.written(), "chosen": chosen}


class CircuitText:
    """Text of a valid circuit, for step-by-step changes of its structure. Comments and order are kept.

    Parameters
    ----------
    text : str
    wiring : Wiring
        Wiring of the circuit.
    """

    def __init__(self, text: str, wiring: Wiring) -> None:
        self.document, self.wiring = tomlkit.parse(text), copy(wiring)
        self.wiring.parts = self.parts = dict(wiring.parts)
        if "connections" not in self.document:
            raise CommandError("this file has no list of connections", remedy="Edit the text instead.")

    @property
    def _chains(self) -> Any:  # noqa: ANN401 - an array of tomlkit
        return self.document["connections"]

    def ports(self, name: str) -> list[Port]:
        """Return the ports of a component."""
        if name not in self.parts:
            raise CommandError(f'there is no component "{name[:80]}"')
        return self.wiring.ports(name)

    def _ends(self, chain: str) -> list[tuple[Any, Any]]:
        """Return the ports at which a chain enters and leaves each of its components."""
        words = _words(chain)
        last = len(words) - 1
        return [self.wiring.element(word, "", first=at == 0, last=at == last) for at, word in enumerate(words)]

    def _port(self, text: str) -> Port:
        name, _, port = text.partition(".")
        found = next((one for one in self.ports(name) if one.name == port), None)
        if found is None:
            raise CommandError(f"{text[:80]} is not a port")
        return found

    def add(self, kind: str, at: str) -> str:
        """Add a component at a port and return its name. It is put into the line of this port if gas passes it."""
        if kind not in STARTERS:
            raise CommandError(f"{kind[:80]!r} cannot be added here", rule=", ".join(STARTERS))
        port = self._port(at)
        stem = re.sub(r"[^a-z_]", "_", kind.partition("/")[0])
        taken = {*self.parts, *self.document["components"]}  # type: ignore[misc]
        name = next(one for number in count(1) if (one := f"{stem}_{number}" if number > 1 else stem) not in taken)
        self.parts[name] = Part(component_kinds()[kind], name)
        own = [one for one in self.ports(name) if not one.is_pilot and one.kind == port.kind]
        if not own:
            raise CommandError(f"{kind} has no port for {port.kind}", remedy=f"Choose another port than {at}.")
        through = [one for one in own if not (one.exhaust or one.optional)]
        place = next(self._places(port), None)
        self._open(at)
        if place is not None and (_is_passed(through) or (port.is_single and [one.holds for one in own] == ["volume"])):
            number, word = place
            words = _words(self._chains[number])
            self._chains[number] = f" {ARROW} ".join([*words[: word + 1], name, *words[word + 1 :]])
        elif place is not None and port.is_single:
            raise CommandError.of("web.joined", port=at)
        else:
            self._chains.append(f"{at} {ARROW} {(through or own)[0].id}")
        table = tomlkit.table()
        table.comment(ASSUMED)
        table["kind"] = kind
        for key, value in STARTERS[kind].items():
            table[key] = value
            if isinstance(value, dict):
                table[key] = tomlkit.inline_table()
                table[key].update(value)  # type: ignore[union-attr]
        table.add(tomlkit.nl())
        self.document["components"][name] = table  # type: ignore[index]
        return name

    def _places(self, port: Port) -> Any:  # noqa: ANN401 - pairs of numbers
        """Yield, for each line of a port, the index of the chain and of the component before the line."""
        for number, chain in enumerate(self._chains):
            if PILOT_LINE not in chain:
                for word, ((_, left), (right, _)) in enumerate(pairwise(self._ends(str(chain)))):
                    if port in (left, right):
                        yield number, word

    def join(self, one: str, other: str) -> None:
        """Join two ports."""
        ends = [self._port(one), self._port(other)]
        if ends[0] == ends[1]:
            raise CommandError(f"{one} cannot be joined to itself")
        for end in (one, other):
            self._open(end)
        mark = PILOT_LINE if any(end.is_pilot for end in ends) else ARROW
        self._chains.append(f"{one} {mark} {other}")

    def _open(self, at: str) -> None:
        """Remove the opening to the ambient air that `written` added to a port."""
        for number in reversed(range(len(self._chains))):
            if _words(self._chains[number]) == [at, AMBIENT]:
                del self._chains[number]

    def cut(self, at: str) -> None:
        """Remove the lines of a port."""
        port = self._port(at)
        for number in reversed(range(len(self._chains))):
            chain = str(self._chains[number])
            ends = self._ends(chain)
            cuts = [word for word, ((_, left), (right, _)) in enumerate(pairwise(ends)) if port in (left, right)]
            if cuts:
                self._put(number, chain, [0, *(word + 1 for word in cuts), len(ends)])

    def _put(self, number: int, chain: str, bounds: list[int]) -> None:
        """Divide a chain between some of its components.

        A remaining part with a single component is dropped, because it joins nothing.
        """
        mark, words = PILOT_LINE if PILOT_LINE in chain else ARROW, _words(chain)
        parts = [words[low:high] for low, high in pairwise(bounds)]
        kept = [f" {mark} ".join(part) for part in parts if len(part) > 1]
        if kept:
            self._chains[number] = kept[0]
            for at, one in enumerate(kept[1:], start=1):
                self._chains.insert(number + at, one)
        else:
            del self._chains[number]

    def remove(self, name: str) -> None:
        """Remove a component. The lines at both sides of a component of two ports become one line."""
        self.ports(name)
        for number in reversed(range(len(self._chains))):
            chain = str(self._chains[number])
            words = _words(chain)
            at = [place for place, word in enumerate(words) if word.partition(".")[0] == name]
            if not at:
                continue
            is_inside = len(at) == 1 and 0 < at[0] < len(words) - 1
            if is_inside and words[at[0]] == name:
                self._chains[number] = f" {ARROW} ".join(word for word in words if word != name)
            else:
                self._put(number, chain, sorted({0, *at, *(place + 1 for place in at), len(words)}))
        components: Any = self.document["components"]
        if name in components:
            del components[name]
        else:
            table = next(one for one in components.values() if name in one.get("copies", ()))
            table["copies"].remove(name)
        initial: Any = self.document.get("initial", {})
        for key in [one for one in initial if one.partition(".")[0] == name]:
            del initial[key]
        del self.parts[name]

    def written(self) -> str:
        """Return the text.

        Ports that need a line, but have none, are plugged, or opened to the ambient air if gas flows through the
        component. A plug at a restriction would make a joint without any gas volume.
        """
        if not len(self._chains):
            raise CommandError("no connection would remain", remedy="Remove the file instead.")
        ends = [end for chain in self._chains for both in self._ends(str(chain)) for end in both]
        named = {end.id for end in ends if isinstance(end, Port)}
        before = [str(one) for one in self.document.get("plugged", ())]
        every = [one for name in self.parts for one in self.ports(name)]
        needed = {one.id: one for one in every if one.kind == "gas" and _is_needed(one)}
        plugged = [one for one in before if one not in named and one.partition(".")[0] in self.parts]
        for one, port in needed.items():
            if one in named or one in plugged:
                continue
            if _is_passed([each for each in self.ports(port.component) if _is_needed(each)]):
                self._chains.append(f"{one} {ARROW} {AMBIENT}")
            else:
                plugged.append(one)
        if plugged != before:
            if plugged:
                self.document["plugged"] = plugged
            else:
                del self.document["plugged"]
        return tomlkit.dumps(self.document)


def _is_needed(port: Port) -> bool:
    """Return whether a port must be joined or plugged."""
    return not (port.exhaust or port.optional or port.is_pilot)


def _is_passed(needed: list[Port]) -> bool:
    """Return whether gas flows through a component with these ports without being stored."""
    return len(needed) == 2 and all(one.is_single for one in needed)


def _words(chain: object) -> list[str]:
    mark = PILOT_LINE if PILOT_LINE in str(chain) else ARROW
    return [word.strip() for word in str(chain).split(mark)]
