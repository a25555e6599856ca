"""Supervisor of a law: limits, the rule for a complete motion, reactions to faults. It is not a safety function.

Values that are not in the controller file are assumed, like all other thresholds of the supervisor.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

from pydantic import Field

from pneudrive import _core
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.keys import WrongValueError
from pneudrive.describe.marks import Between, Bounds, Choice, Length, PressureBetween, Quantity
from pneudrive.errors import nearest

_SECONDS = Quantity("s", "ms", Bounds(above=0.0))


#: Removed controllers, and what to use in place of each.
REMOVED_LAWS = {"pva": 'The controller "pva" was removed. Use "inversion", or "pid" as a baseline.'}


def law_remedy(word: str) -> str:
    """Return the remedy for a word that does not name a controller."""
    return REMOVED_LAWS.get(word) or nearest(word, _core.control_laws())


class BuiltInLaw(Choice):
    """Annotation of a field for a controller of pneudrive."""

    def read(self, given: object) -> str:
        """Check the word."""
        if given not in self.choices:
            raise WrongValueError(f"{given!r} is not known", remedy=law_remedy(str(given)))
        return str(given)


class SupplyReaction(Choice):
    """Annotation of a reaction to a low supply."""

    def read(self, given: object) -> str:
        """Check the word."""
        if given == "slow":
            remedy = 'References are no longer slowed. Use "tell", "stop" or "block", or a slower reference.'
            raise WrongValueError('the reaction "slow" was removed', remedy=remedy)
        return super().read(given)


class ControlLimits(Described):
    """Limits of a drive under control. A reference beyond them is refused, and a drive beyond them is stopped."""

    table_name: ClassVar[str] = "limits"
    position: Annotated[tuple[float, float] | None, Between("m", "mm")] = Field(
        default=None, description="positions that it may reach; absent: its stroke"
    )
    speed_m_s: Annotated[float | None, Quantity("m/s", "m/s", Bounds(above=0.0))] = Field(
        default=None, description="largest speed; absent: none"
    )
    pressure: Annotated[Any, PressureBetween()] = Field(default=None, description="of the chambers; absent: none")
    stop_deceleration_m_s2: Annotated[float, Quantity("m/s^2", "m/s2", Bounds(above=0.0))] = Field(
        default=10.0, description="of stop ramps; the default is assumed"
    )


class MotionComplete(Described):
    """Rule for a complete motion, and the time after which an incomplete one is reported."""

    table_name: ClassVar[str] = "motion"
    tolerance_m: Length = Field(default=1e-4, description="error within which it has settled; assumed")
    settled_for_s: Annotated[float, _SECONDS] = Field(default=0.05, description="for how long; assumed")
    timeout_s: Annotated[float, _SECONDS] = Field(
        default=2.0, description="time to move by 1 mm, or to settle; assumed"
    )


class OnFault(Described):
    """Reaction to a fault: it is reported, the drive is stopped by a ramp, or the valve is shut."""

    table_name: ClassVar[str] = "on_fault"
    position: Annotated[str, Choice(("stop", "block"))] = Field(
        default="block", description="position sensor lost; block: a ramp stops a moving drive first"
    )
    pressure: Annotated[str, Choice(("model", "stop", "block"))] = Field(
        default="model", description="pressure sensor lost; block: a ramp stops a moving drive first"
    )
    valve: Annotated[str, Choice(("tell", "stop", "block"))] = Field(
        default="block", description="valve does not answer"
    )
    supply: Annotated[str, SupplyReaction(("tell", "stop", "block"))] = Field(
        default="block", description="supply has fallen; block: only when it no longer fills a chamber"
    )
    law: Annotated[str | None, BuiltInLaw(tuple(_core.control_laws()))] = Field(
        default=None, description="replaces a failed controller; absent: inversion, except for custom controllers"
    )


class Supervision(NamedTuple):
    """The supervisor of a controller."""

    limits: ControlLimits = ControlLimits()
    motion: MotionComplete = MotionComplete()
    on_fault: OnFault = OnFault()

    def lines(self) -> list[str]:
        """Return its tables as lines of a controller file, without default values."""
        lines = []
        for table, usual in zip(self, USUAL, strict=True):
            if table != usual:
                given = [f"{key} = {toml.value_text(value)}" for key, value in table.to_dict().items()]
                lines += ["", f"[{table.table_name}]", *given]
        return lines

    def core(self, ambient_pa: float) -> dict[str, Any]:
        """Return the supervisor in the core's form, SI, pressures absolute; None for the default one."""
        if self == USUAL:
            return {}
        limits, motion, fault = self
        pressure = limits.pressure
        made = {
            "position_m": limits.position,
            "speed_m_s": limits.speed_m_s,
            "pressure_pa": None if pressure is None else [own.absolute_pa(ambient_pa) for own in pressure],
            "stop_deceleration_m_s2": limits.stop_deceleration_m_s2,
            "motion": [motion.tolerance_m, motion.settled_for_s, motion.timeout_s],
            "on_position": fault.position,
            "on_pressure": fault.pressure,
            "on_valve": fault.valve,
            "on_supply": fault.supply,
            "standby": fault.law,
        }
        return {"supervision": made}


#: Of a controller that says nothing of it.
USUAL = Supervision()


def told(events: list[tuple[float, str, float]]) -> list[dict[str, Any]]:
    """Return the events of a supervisor as records of time_s, kind, value, its unit, and text."""
    known = {key: (unit, text) for key, unit, text in _core.control_events()} if events else {}
    return [
        {"time_s": time, "kind": kind, "value": value, "unit": known[kind][0], "text": known[kind][1]}
        for time, kind, value in events
    ]
