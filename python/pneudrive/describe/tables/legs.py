"""Checks of platforms: a cylinder at each leg, in the direction of the leg, and possible moments of inertia."""

from __future__ import annotations

from math import degrees
from typing import TYPE_CHECKING, Any

from pneudrive.describe.connections import is_platform
from pneudrive.describe.keys import wrong

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from pneudrive.describe.connections import Port, Wiring
    from pneudrive.errors import DescriptionError, Problems

AXES = "xyz"


def check_platforms(wiring: Wiring, components: Mapping[str, Any], keys: Mapping[str, str], problems: Problems) -> None:
    """Add the faults of platforms to `problems`.

    Parameters
    ----------
    wiring : Wiring
    components : mapping
    keys : mapping
        Component -> its key in the file.
    problems : Problems
    """
    for name, own in components.items():
        if not is_platform(own.entry):
            continue
        for port in wiring.ports(name):
            with problems.caught():
                _check_mover(wiring, port, components)
            told = {getattr(one, "key", None) for one in problems.found.values()}
            for problem in _inclined(wiring, port, components, keys):
                if problem.key not in told:  # copies have one table
                    problems.add(problem)
        moments = [getattr(own, f"inertia_{axis}_kg_m2", 0.0) for axis in AXES]
        for axis, moment in zip(AXES, moments, strict=True):
            others = [other for other in AXES if other != axis]
            most = sum(moments) - moment
            if moment > most * (1.0 + 1e-12):
                what = f"{name}.inertia.{axis} = {moment:g} kg m2 is impossible"
                rule = f"{axis} <= {' + '.join(others)} = {most:g} kg m2"
                remedy = "Give the moments of inertia about axes through the centre of mass."
                problems.add(wrong(f"{_table(keys[name])}.inertia", what, rule=rule, remedy=remedy))


def _movers(wiring: Wiring, port: Port, components: Mapping[str, Any]) -> list[str]:
    """Return the components at a leg that have an axis of their own."""
    names = [one.component for one in wiring.at[port].ports if one.component in components] if port in wiring.at else []
    return [name for name in names if any(one["name"] == "position_m" for one in components[name].entry["outputs"])]


def _check_mover(wiring: Wiring, port: Port, components: Mapping[str, Any]) -> None:
    joint = wiring.at.get(port)
    if joint is None:
        return  # reported with the connections
    links = [one for one in joint.ports if sum(port.kind == "axis" for port in wiring.ports(one.component)) == 2]
    movers, leg = _movers(wiring, port, components), f"leg {port.name} of {port.component}"
    if not movers and not links:
        remedy = f'Join the rod of a cylinder, for instance "leg_{port.name}.rod -> {port.id}".'
        raise wrong(joint.key, f"{leg} has no cylinder", rule="a cylinder or a slide moves each leg", remedy=remedy)
    if len(movers) > 1:
        remedy = f"Join {movers[-1]} to another leg, or put a coupling between {' and '.join(movers[-2:])}."
        raise wrong(
            joint.key, f"{' and '.join(movers)} both move {leg}", rule="one cylinder for each leg", remedy=remedy
        )


def _inclined(
    wiring: Wiring, port: Port, components: Mapping[str, Any], keys: Mapping[str, str]
) -> Iterator[DescriptionError]:
    for name in _movers(wiring, port, components):
        angle = getattr(components[name], "incline_rad", None) or 0.0
        if angle != 0.0:
            rule = f"leg {port.name} of {port.component} has the direction of its two joints"
            what = f"{name}.incline = {degrees(angle):g} deg"
            yield wrong(f"{_table(keys[name])}.incline", what, rule=rule, remedy="Leave out incline.")


def _table(key: str) -> str:
    """Return the key of a component's table, also of a copy."""
    return key.partition(".copies")[0]
