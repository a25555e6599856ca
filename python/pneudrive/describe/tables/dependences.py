"""Friction modifiers: pressure, age, relaxation, position, direction, side load, temperature, wear."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from pneudrive.arrays import Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Bounds, EachChamber, Length, PerChamber, Position, Quantity
from pneudrive.errors import invalid, wrong

Duration = Annotated[float, Quantity("s", "s", POSITIVE)]
_Factor = Annotated[float, Quantity("", bounds=POSITIVE)]
#: largest number of harmonics; more harmonics would fit the noise of a recording
MOST_HARMONICS = 4
#: largest number of points; each costs time at every evaluation
MOST_POINTS = 50


class Acting(Described):
    """Table of a friction modifier."""

    def core(self) -> Plain:
        """Return the table in the core's form, in SI. Values for each chamber have the keys ``KEY_a`` and ``KEY_b``."""
        out: Plain = {}
        for name, field in type(self).model_fields.items():
            value, key = getattr(self, name), field.alias or name
            if isinstance(value, PerChamber):
                out |= {f"{key}_{chamber}": one for chamber, one in value._asdict().items()}
            elif isinstance(value, tuple):
                out[key] = [one.core() for one in value]
            else:
                out[name] = value
        return out


class SealPressure(Acting):
    """Pressure dependence of friction, for any law: additional friction per gauge pressure in each chamber, N/Pa."""

    table_name: ClassVar[str] = "friction.pressure"
    coulomb_n_pa: Annotated[PerChamber, EachChamber("N/Pa", "N/bar")] = PerChamber(0.0, 0.0)
    breakaway_n_pa: Annotated[PerChamber, EachChamber("N/Pa", "N/bar")] = PerChamber(0.0, 0.0)


class Dwell(Acting):
    """Friction that grows with the age of the contact, for any law. The contact ages at rest; sliding renews it."""

    table_name: ClassVar[str] = "friction.dwell"
    growth: Literal["saturating", "log", "hyperbolic"]
    increment_n: Annotated[float, Quantity("N", "N", NOT_NEGATIVE)]
    time_s: Duration
    exponent: Annotated[float, Quantity("", bounds=Bounds(above=0.0, below=2.0))] = 0.4
    distance_m: Length
    pressure_per_pa: Annotated[PerChamber, EachChamber("1/Pa", "%/bar")] = Field(
        default=PerChamber(0.0, 0.0), alias="pressure"
    )

    @model_validator(mode="after")
    def _exponent_of_saturating_alone(self) -> Dwell:
        if "exponent" in self.model_fields_set and self.growth != "saturating":
            raise invalid("friction.dwell.exponent", "describe.exponent-without-effect", growth=self.growth)
        return self


class Relaxation(Acting):
    """Relaxation of the elastic bristle force at rest, for laws with bristles. Sliding renews the bristles."""

    table_name: ClassVar[str] = "friction.relaxation"
    share: marks.Fraction
    time_s: Duration
    distance_m: Length


class Harmonic(Acting):
    """One harmonic of friction along the stroke."""

    table_name: ClassVar[str] = "friction.position.harmonics"
    period_m: Length
    amplitude: Annotated[float, Quantity("", bounds=Bounds(above=-1.0, below=1.0))]
    phase_rad: Annotated[float, Quantity("rad", "deg")] = 0.0


class PositionPoint(Acting):
    """Measured factor on friction at a position of the stroke."""

    table_name: ClassVar[str] = "friction.position.table"
    position_m: Position
    factor: _Factor


class PositionDependence(Acting):
    """Friction along the stroke, for any law: factor [1 + slope (x - reference) + harmonics] times a tabulated one.

    The tabulated factor is interpolated between its points by a monotone cubic. Beyond the points, it is constant.
    """

    table_name: ClassVar[str] = "friction.position"
    points: tuple[PositionPoint, ...] = Field(default=(), alias="table")
    harmonics: tuple[Harmonic, ...] = ()
    slope_per_m: Annotated[float, Quantity("1/m", "%/m")] = Field(default=0.0, alias="slope")
    reference_m: Position = 0.0

    @model_validator(mode="after")
    def _waves_and_points_fit(self) -> PositionDependence:
        key = "friction.position.harmonics"
        if len(self.harmonics) > MOST_HARMONICS:
            raise wrong(key, f"{key} has {len(self.harmonics)} entries", rule=f"at most {MOST_HARMONICS}")
        total = sum(abs(wave.amplitude) for wave in self.harmonics)
        if total >= 1.0:
            raise invalid(key, "describe.amplitudes-too-large", key=key, total=total)
        key = "friction.position.table"
        if len(self.points) == 1 or len(self.points) > MOST_POINTS:
            raise wrong(key, f"{key} has {len(self.points)} entries", rule=f"2 to {MOST_POINTS}")
        for before, after in pairwise(self.points):
            if after.position_m <= before.position_m:
                after_mm, before_mm = 1e3 * after.position_m, 1e3 * before.position_m
                raise invalid(key, "describe.positions-not-rising", key=key, after_mm=after_mm, before_mm=before_mm)
        return self

    def core(self) -> Plain:
        """Return the table in the core's form."""
        out = super().core()
        return out if self.points else {key: value for key, value in out.items() if key != "table"}

    @classmethod
    def __get_pydantic_json_schema__(cls, schema: Any, handler: Any) -> Plain:  # noqa: ANN401 - pydantic's own
        """Return the JSON schema with the harmonics inline, because the schema cannot refer to the friction table."""
        out = super().__get_pydantic_json_schema__(schema, handler)
        one = Harmonic.model_json_schema(by_alias=True)
        out["properties"]["harmonics"] = {"type": "array", "items": one, "maxItems": MOST_HARMONICS}
        point = PositionPoint.model_json_schema(by_alias=True)
        out["properties"]["table"] = {"type": "array", "items": point, "minItems": 2, "maxItems": MOST_POINTS}
        return out


class DirectionDependence(Acting):
    """Friction that depends on the direction, for any law: factors on the amplitudes for v > 0 and v < 0."""

    table_name: ClassVar[str] = "friction.direction"
    positive: _Factor = 1.0
    negative: _Factor = 1.0


class SideLoad(Acting):
    """Lateral force on a guide, for any law. The guide adds coefficient * |force| to the friction."""

    table_name: ClassVar[str] = "friction.side_load"
    force_n: marks.Force
    coefficient: Annotated[float, Quantity("", bounds=NOT_NEGATIVE)]


class TemperatureDependence(Acting):
    """Friction that depends on the temperature of the contact, for any law. Friction itself heats the contact."""

    table_name: ClassVar[str] = "friction.temperature"
    reference_k: marks.Temperature
    viscous_per_k: Annotated[float, Quantity("1/K", "%/K", NOT_NEGATIVE)] = Field(default=0.0, alias="viscous")
    levels_per_k: Annotated[float, Quantity("1/K", "%/K")] = Field(default=0.0, alias="levels")
    resistance_k_w: Annotated[float, Quantity("K/W", "K/W", NOT_NEGATIVE)] = 0.0
    time_s: Duration = 60.0


class Wear(Acting):
    """Friction that changes with the sliding distance s, for any law.

    The factor is 1 + run_in exp(-s/run_in_distance) + rate s.
    """

    table_name: ClassVar[str] = "friction.wear"
    run_in: Annotated[float, Quantity("", bounds=Bounds(above=-1.0))] = 0.0
    run_in_distance_m: Length = 1000.0
    rate_per_m: Annotated[float, Quantity("1/m", "%/km")] = Field(default=0.0, alias="rate")
    slid_m: Annotated[float, Quantity("m", "m", NOT_NEGATIVE)] = 0.0


#: Friction modifiers by their keys; relaxation needs a law with bristles.
DEPENDENCES: dict[str, type[Described]] = {
    "pressure": SealPressure,
    "dwell": Dwell,
    "relaxation": Relaxation,
    "position": PositionDependence,
    "direction": DirectionDependence,
    "side_load": SideLoad,
    "temperature": TemperatureDependence,
    "wear": Wear,
}
