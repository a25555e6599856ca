"""Check of a drive for control: differences to the model of the controllers, and limits of accuracy."""

from __future__ import annotations

import json
import math
from typing import TYPE_CHECKING, Any

from pneudrive.errors import DescriptionError, warn

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.control.setup import Setup
    from pneudrive.control.tuned import Tuning
    from pneudrive.describe.circuit import Circuit

#: Samples of a law in a period of the mass on its air, below which it is told to be slow (assumed).
LEAST_SAMPLES = 40
MOST_OF_FORCE = 0.85  # fraction of the supply's force for weight and friction above which a warning is given (assumed)
#: Rates that differ by a smaller share are equal.
EQUAL_DECAY = 0.01
_DOUBLE_ACTING = ("cylinder/rodless", "cylinder/through-rod", "cylinder/single-rod")
_CROSSED = ("valve/proportional-5/3", "valve/switching-5/3")
#: Numbers that change the motion and that no law knows: kind -> how a key begins -> what it is.
_UNKNOWN = {
    "cylinder/": {"cushion_": "cushion", "leakage": "leakage"},
    "valve/proportional": {"stroke_time": "stroke_time"},
    "reservoir/": {"amplitude": "amplitude"},
}


def check_axis(belief: Circuit, plant: Mapping[str, Any]) -> None:
    """Refuse a circuit that the laws cannot model.

    Parameters
    ----------
    belief : Circuit
    plant : dict
        What the core makes of it: ``cylinder`` and ``valves`` are names of components.

    Raises
    ------
    DescriptionError
        The cylinder is single-acting or a tandem, or ports 4 and 2 of its 5/3 valve do not lead to chambers a and b.
    """
    form = json.loads(belief.core_json())
    kinds = {one["name"]: one["kind"] for one in form["components"]}
    cylinder, valves = plant["cylinder"], plant["valves"]
    ends = {cylinder, *valves, *(name for name, kind in kinds.items() if kind.startswith("reservoir"))}
    if kinds[cylinder] not in _DOUBLE_ACTING:
        rule = f"laws have a model of {', '.join(_DOUBLE_ACTING)}"
        raise DescriptionError(f"{cylinder} is a {kinds[cylinder]}", where=belief.name, rule=rule)
    for port, chamber in (("4", "a"), ("2", "b")) if kinds[valves[0]] in _CROSSED else ():
        found = _chambers(form["joints"], f"{valves[0]}.{port}", cylinder, ends)
        if f"{cylinder}.{chamber}" not in found:
            to = " and ".join(sorted(found)) or "no chamber"
            rule = "port 4 leads to chamber a and port 2 to chamber b: then a command above 0 moves the piston in +x"
            remedy = f'Connect "{valves[0]}.4 -> {cylinder}.a" and "{valves[0]}.2 -> {cylinder}.b".'
            raise DescriptionError(f"{valves[0]}.{port} leads to {to}", where=belief.name, rule=rule, remedy=remedy)


def check_valves(belief: Circuit) -> None:
    """Refuse valves whose flow is a table: laws know one conductance.

    Parameters
    ----------
    belief : Circuit

    Raises
    ------
    DescriptionError
        A valve has a ``flow_table``.
    """
    for one in json.loads(belief.core_json())["components"]:
        if one["kind"].startswith("valve/") and one.get("points"):
            rule = "laws have a model of valves of one conductance"
            remedy = "Describe it by conductance, overlap and leakage in place of the table."
            raise DescriptionError(f"{one['name']} has a flow_table", where=belief.name, rule=rule, remedy=remedy)


def unknown_numbers(belief: Circuit) -> list[str]:
    """Return the parts of cylinder, valves and supply that no law models, ``cylinder.cushion`` for instance."""
    each = json.loads(belief.core_json())["components"]
    return [
        f"{one['name']}.{what}"
        for one in each
        for kind, known in _UNKNOWN.items()
        for begin, what in known.items()
        if one["kind"].startswith(kind)
        and any(key.startswith(begin) and value > 0.0 for key, value in one["numbers"].items())
    ]


def _chambers(joints: list[list[str]], port: str, cylinder: str, ends: set[str]) -> set[str]:
    """Return the chambers that a port leads to, through all components except ends and the ambient."""
    left, reached = [joint for joint in joints if port in joint], []
    while left:
        joint = left.pop()
        if joint in reached or "ambient" in joint:
            continue
        reached.append(joint)
        through = {_component(one) for one in joint} - ends
        left += [other for other in joints if any(_component(one) in through for one in other)]
    return {one for joint in reached for one in joint if _component(one) == cylinder}


def _component(port: str) -> str:
    return port.rpartition(".")[0]


def supply_of(core_json: str) -> tuple[float, float]:
    """Return absolute pressure, Pa, and temperature, K, of the supply of a circuit in the core's form."""
    form = json.loads(core_json)
    numbers = next(one["numbers"] for one in form["components"] if one["kind"].startswith("reservoir"))
    return numbers["pressure"], numbers.get("temperature", form["ambient"]["temperature_k"])


def limitations(tuning: Tuning, setup: Setup) -> tuple[str, ...]:
    """Return the limits of a tuned controller in words; warn where it can hardly work.

    Parameters
    ----------
    tuning : Tuning
    setup : Setup
        Sensors and computer.
    """
    plant, said = tuning.plant, []
    bandwidth = next((gain.value for gain in tuning.gains if gain.key == "bandwidth"), plant.natural_frequency_rad_s)
    late = bandwidth * plant.lag_s
    said.append(
        f"A command acts {1e3 * plant.lag_s:.3g} ms late (dead time of the valve, spool, half a period): "
        f"{late:.2g} rad at {bandwidth:.3g} rad/s. A faster valve or a shorter period allows a larger bandwidth."
    )
    of_valve = plant.lag_s - 0.5 * tuning.period_s
    longest = max(of_valve, 2.0 * math.pi / plant.natural_frequency_rad_s / LEAST_SAMPLES)
    needs = max(plant.least_force_shares)
    if needs > MOST_OF_FORCE:
        warn(
            f"weight and friction take {100.0 * needs:.0f} % of the force of the supply: "
            f"{'the drive cannot move' if needs > 1.0 else 'little is left to move it'} at least one way"
        )
    if tuning.period_s > longest:
        slow = f"period = {1e3 * tuning.period_s:g} ms: a law follows badly or loses the drive"
        of = f"the lag of its valve or 1/{LEAST_SAMPLES} (assumed) of a period of its mass on the air"
        warn(f"{slow} beyond {1e3 * longest:.3g} ms, {of}")
    if setup.computer.time_s > 0.0:
        said.append(f"The computer of the setup adds {1e3 * setup.computer.time_s:.3g} ms that the law does not know.")
    if setup.sensors.pressure_a is None:
        said.append("The setup has no pressure sensors: the law follows the pressures by its model of the drive.")
    said += _unobservable(tuning, measured=setup.sensors.pressure_a is not None)
    supply_pa, _ = supply_of(tuning.belief.core_json())
    said += [f"{short}." for short in setup.short_of(supply_pa, tuning.belief.ambient.pressure_pa)]
    if plant.left_out:
        said.append(
            f"The law knows nothing of {', '.join(plant.left_out)} but the volume of tubes at the chambers: it takes "
            "the valve to stand at the cylinder, at a supply of constant pressure; speed and lag leave them out."
        )
    said.append(f"References up to {plant.speed_m_s:.3g} m/s and within {1e3 * plant.stroke_m:g} mm are accepted.")
    assumed = [gain.key for gain in tuning.numbers if "assumed" in gain.rule and not gain.given]
    if assumed:
        said.append(f"Assumed, not derived from this drive: {', '.join(assumed)}.")
    return tuple(said)


def _unobservable(tuning: Tuning, *, measured: bool) -> list[str]:
    """Return the unobservable quantities of this drive, in words."""
    said = [
        "Not told apart by any observer: a force on the piston, friction that differs between the directions, and "
        "zeros of the sensors; conductance of the valve and supply pressure; mass and force, while nothing "
        "accelerates."
    ]
    if not measured:
        rates = sorted(tuning.plant.pressure_decay_1_s)
        apart = rates[1] - rates[0]
        if apart <= EQUAL_DECAY * rates[1]:
            why = f"both shut chambers return at {rates[1]:.2g} 1/s by leakage and heat"
        else:
            why = f"only their return by leakage and heat, at {rates[0]:.2g} and {rates[1]:.2g} 1/s, tells them apart"
        said.append(f"At rest the position tells the force of the gas, not both pressures: {why}.")
    return said
