"""Tanks: fixed volumes with a leak, connected to a line directly or through a tube.

Tanks describe tests of leakage, discharge and charging.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from pneudrive.arrays import Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described, DescribedFile
from pneudrive.describe.components import Component, component, within_component
from pneudrive.describe.files import toml
from pneudrive.describe.system import core_part
from pneudrive.describe.tables import valve_flow
from pneudrive.describe.tables.parts import Ambient, Gas
from pneudrive.errors import invalid, wrong

#: Kind of component of a tank's tube.
TUBE = "tube/distributed"
#: Critical pressure ratio of a leak (assumed).
LEAK_RATIO = 0.2


class FixedVolume(Described):
    """Fixed volume with the heat transfer and leakage of its wall.

    The heat flow through the whole wall is `heat_transfer` times the temperature difference between wall and gas: 0 is
    adiabatic, a large value isothermal. `leakage` is the sonic conductance of the leak into the ambient air; its
    critical pressure ratio is assumed to be 0.2. The wall has ambient temperature by default. The gas starts at the
    temperature of the wall by default.
    """

    volume_m3: Annotated[float, marks.Quantity("m^3", "dm3", marks.POSITIVE)] = Field(alias="value")
    heat_transfer_w_k: Annotated[float, marks.Quantity("W/K", "W/K", marks.NOT_NEGATIVE)] = 0.5
    leakage_m3_s_pa: Annotated[float, marks.Quantity("m^3/(s Pa)", "dm3/(s bar)", marks.NOT_NEGATIVE)] = 0.0
    wall_temperature_k: marks.MaybeTemperature = None
    start_temperature_k: marks.MaybeTemperature = None


class TankLine(Described):
    """Flow path between the volume and gas of constant pressure: a nozzle, a tube, a valve (ISO 6358).

    `pressure` and `temperature` are those of the gas on the side away from the volume. The default is ambient air.
    """

    conductance_m3_s_pa: Annotated[float, marks.Quantity("m^3/(s Pa)", "dm3/(s bar)", marks.POSITIVE)]
    critical_pressure_ratio: marks.Fraction
    subsonic_index: Annotated[float, marks.Quantity("", bounds=marks.Bounds(above=0.0, at_most=2.0))] = 0.5
    linear_above: marks.Fraction = 0.999
    pressure: marks.MaybePressure = None
    temperature_k: marks.MaybeTemperature = None

    @model_validator(mode="after")
    def _in_order(self) -> TankLine:
        valve_flow.check_shape("line", self.critical_pressure_ratio, self.linear_above)
        return self

    def core(self, ambient: Ambient) -> Plain:
        """Return the line in the core's form, with pressure and temperature on the side away from the volume."""
        out = ambient.core() | self.stored()
        if self.pressure is not None:
            out.pop("pressure")
            out["pressure_pa"] = marks.absolute_above_vacuum(self.pressure, ambient.pressure_pa, "line.pressure")
        return out


def _tube(table: object) -> object:
    """Read the table of the tube as a distributed tube, which models pressure waves."""
    if not isinstance(table, dict):
        return table
    if table.get("kind", TUBE) != TUBE:
        raise wrong("tube.kind", f"tube.kind = {table['kind']!r}", rule=f'the tube of a tank must be a "{TUBE}"')
    with within_component("tube", table, above=""):
        return component(table | {"kind": TUBE})


class Tank(DescribedFile):
    """Fixed volume on a line. Without a line, the volume is closed. A tube may connect line and volume.

    Examples
    --------
    >>> tank = Tank.model_validate({"volume": {"value": "2 dm3"}})
    >>> tank.volume.volume_m3
    0.002
    """

    name: str = "unnamed tank"
    gas: Gas = Gas()
    ambient: Ambient = Ambient()
    volume: FixedVolume
    line: TankLine | None = None
    tube: Annotated[Component | None, BeforeValidator(_tube)] = None
    labels: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _tube_on_a_line(self) -> Tank:
        if self.tube is not None and self.line is None:
            raise invalid("tube", "describe.tube-without-line")
        return self

    @classmethod
    def load(cls, source: str | Path) -> Tank:
        """Read a tank from a TOML file.

        Raises
        ------
        DescriptionError
            The file is not valid; the message gives file, line, value, rule and remedy.
        """
        return toml.load(cls.model_validate, source)

    def replace(self, changes: Plain) -> Tank:
        """Return a checked tank with some values changed: ``{"line.conductance": "2 dm3/(s bar)"}``."""
        tables = self.to_dict()
        for key, value in changes.items():
            toml.put(tables, key, value)
        return type(self).model_validate(tables)

    @property
    def start_temperature_k(self) -> float:
        """Temperature in K of the gas at the start of a recording."""
        return self.volume.start_temperature_k or self.wall_temperature_k

    @property
    def wall_temperature_k(self) -> float:
        """Temperature in K of the wall of the volume."""
        return self.volume.wall_temperature_k or self.ambient.temperature_k

    def expanded(self, leakage_m3_s_pa: float) -> Plain:
        """Return the circuit of the tank in the core's form: volume, tube, line, far side of the line, and leak.

        Parameters
        ----------
        leakage_m3_s_pa : float
            Sonic conductance of the leak; 0: the circuit has no leak.
        """
        volume, tube, wall_k = self.volume, self.tube, self.wall_temperature_k
        # Conductance of the whole wall: a coefficient, W/(m2 K), on a wall of 1 m2.
        wall = {"wall_temperature": wall_k, "wall_area": 1.0, "heat_transfer": volume.heat_transfer_w_k}
        components = [core_part("volume", "tank", {"volume": volume.volume_m3} | wall)]
        joints, at_volume = [], ["volume.1"]
        if self.line is not None:
            line = self.line.core(self.ambient)
            other = {key: line.pop(key) for key in ("pressure_pa", "temperature_k")}
            components += [core_part("line", "fitting", line), core_part("other_side", "reservoir", other)]
            joints.append(["other_side.1", "line.1"])
            at_volume.append("line.2" if tube is None else "tube.2")
        if tube is not None:
            components.append({"name": "tube", "kind": TUBE, "numbers": tube.numbers(self.ambient.pressure_pa)})
            joints.append(["line.2", "tube.1"])
        if leakage_m3_s_pa > 0.0:
            numbers = {"conductance": leakage_m3_s_pa, "critical_pressure_ratio": LEAK_RATIO}
            components.append(core_part("leak", "fitting", numbers))
            joints.append(["leak.2", "ambient"])
            at_volume.append("leak.1")
        return {
            "gas": self.gas.core(),
            "ambient": self.ambient.core(),
            "components": components,
            "joints": [*joints, at_volume],
        }
