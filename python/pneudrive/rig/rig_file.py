"""TOML files of rigs that are not simulated; each error gives file, line, value, rule and remedy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from pydantic import Field, PrivateAttr, StrictBool, model_validator

from pneudrive import units
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.keys import WrongValueError, wrong
from pneudrive.describe.marks import (
    Angle,
    Between,
    Bounds,
    Mark,
    PressureBetween,
    Quantity,
    Reads,
    StatedPressure,
    absolute,
)
from pneudrive.describe.tables.geometry import PistonTable
from pneudrive.errors import Problems, RigError, nearest
from pneudrive.rig.interface import Envelope, Identity
from pneudrive.signals.force_calibration import ForceCalibration, of_quantities

if TYPE_CHECKING:
    from collections.abc import Callable

    from typing_extensions import Self

#: Channel as a user writes it -> name and SI unit of the channel of an `Identity`.
CHANNELS = {
    "position": ("position_m", "m"),
    "force": ("force_n", "N"),
    "pressure_a": ("pressure_a_pa", "Pa"),
    "pressure_b": ("pressure_b_pa", "Pa"),
    "temperature": ("temperature_k", "K"),
}
POSITIVE, NOT_NEGATIVE = Bounds(above=0.0), Bounds(at_least=0.0)


MaybeStiffness = Annotated[float | None, Quantity("N/m", bounds=POSITIVE)]
Mass = Annotated[float, Quantity("kg", bounds=NOT_NEGATIVE)]


@dataclass(frozen=True)
class Channels(Mark):
    """Annotation of a table with values by channel.

    Parameters
    ----------
    marks : dict
        Key of a channel -> its name in an `Identity`, and the annotation of its value.
    """

    marks: dict[str, tuple[str, Mark]]

    def read(self, given: object) -> dict[str, Any]:
        """Convert and check."""
        if not isinstance(given, dict):
            raise WrongValueError(f"{given!r} is not a table")
        problems, out = Problems(), {}
        for key, value in given.items():
            with problems.caught():
                if key not in self.marks:
                    raise wrong(key, f"{key} is not a known key", remedy=nearest(key, self.marks))
                name, mark = self.marks[key]
                out[name] = mark.read_at(key, value)
        problems.tell()
        return out


def _channels(mark: Callable[[str], Mark], **others: tuple[str, Mark]) -> Channels:
    return Channels({key: (name, mark(unit)) for key, (name, unit) in CHANNELS.items()} | others)


def _amount(si_unit: str) -> Quantity:
    return Quantity(si_unit, bounds=NOT_NEGATIVE)


def _range(si_unit: str) -> Mark:
    return PressureBetween() if si_unit == "Pa" else Between(si_unit)


_FREQUENCIES = _channels(lambda _: Quantity("1/s", bounds=POSITIVE))


class IdentityTable(PistonTable):
    """``[identity]``: identity of the rig and calibration of its sensors. Areas are given by bore, or directly."""

    table_name: ClassVar[str] = "identity"
    name: str
    ambient_pressure: Annotated[units.Pressure, StatedPressure(gauge_allowed=False)] = units.Pressure(
        Identity.ambient_pressure_pa, gauge=False
    )
    mass_beyond_sensor_kg: Mass = 0.0
    incline_rad: Angle = 0.0
    stiffness_n_m: MaybeStiffness = None
    chambers: Literal["open", "common", "separate", "held"] = "held"
    pressure_measured_at: Literal["chamber", "regulator"] = "chamber"
    accuracy: Annotated[dict[str, float], _channels(_amount, bore=("bore_m", _amount("m")))] = Field(
        default_factory=dict
    )
    limits: Annotated[dict[str, Any], _channels(_range)] = Field(default_factory=dict, alias="range")
    resolution: Annotated[dict[str, float], _channels(_amount)] = Field(default_factory=dict)
    bandwidth_hz: Annotated[dict[str, float], _FREQUENCIES] = Field(default_factory=dict)
    calibration: Annotated[dict[str, str], _channels(lambda _: Reads(str))] = Field(default_factory=dict)
    force_calibration: Annotated[ForceCalibration | None, Reads(of_quantities)] = None
    labels: dict[str, Annotated[str, Reads(str)]] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _areas_once(self) -> Self:
        self.areas()  # raises an error if they are wrong
        return self

    def made(self) -> Identity:
        """Return the table as the identity of a rig."""
        found = self.stored()
        ambient = found.pop("ambient_pressure").value_pa
        for key in ("kind", "bore_m", "rod_diameter_m"):
            found.pop(key, None)
        found["area_a_m2"], found["area_b_m2"] = self.areas()
        found["limits"] = {
            name: absolute(ends, ambient) if name.startswith("pressure") else ends for name, ends in self.limits.items()
        }
        return Identity(**found, ambient_pressure_pa=ambient)


class LimitsTable(Described):
    """``[limits]``: limits of the rig."""

    table_name: ClassVar[str] = "limits"
    position_m: Annotated[tuple[float, float], Between("m", "mm")]
    speed_m_s: Annotated[float, Quantity("m/s", bounds=POSITIVE)]
    acceleration_m_s2: Annotated[float, Quantity("m/s^2", bounds=POSITIVE)]
    jerk_m_s3: Annotated[float, Quantity("m/s^3", bounds=POSITIVE)]
    force_n: Annotated[float, Quantity("N", bounds=POSITIVE)]
    pressure_pa: Annotated[tuple[units.Pressure, units.Pressure], PressureBetween()]
    separate_pressures: StrictBool = False
    temperature_k: Annotated[tuple[float, float], Between("K", "degC")]
    supply_pressure: Annotated[units.Pressure | None, StatedPressure()] = None
    expected_friction_n: Annotated[float, _amount("N")] = 0.0
    home_m: Annotated[float | None, Quantity("m", "mm")] = None

    @model_validator(mode="after")
    def _home_inside(self) -> Self:
        low, high = self.position_m
        if self.home_m is not None and not low <= self.home_m <= high:
            raise wrong("limits.home", "limits.home lies outside limits.position")
        return self

    def made(self, ambient_pa: float) -> Envelope:
        """Return the table as the envelope of a rig, pressures absolute."""
        found: dict[str, Any] = {"home_m": self.position_m[0]} | self.stored()
        supply = found.pop("supply_pressure", None)
        found["pressure_pa"] = absolute(self.pressure_pa, ambient_pa)
        return Envelope(**found, supply_pressure_pa=0.0 if supply is None else supply.absolute_pa(ambient_pa))


class RigFile(Described):
    """Base of files of rigs that are not simulated."""

    schema_version: Literal[1] = Field(default=1, alias="schema")
    kind: str = ""
    identity: IdentityTable | None = None
    limits: LimitsTable | None = None
    _folder: Path = PrivateAttr(default=Path())

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a rig file.

        Raises
        ------
        RigError
            The file is not valid; the message gives file, line, value, rule and remedy.
        """
        tables, text = toml.read(path, RigError, "The guides on rigs show examples of rig files.")
        with toml.locating(path, text, RigError):
            file = cls.model_validate(tables)
        file._folder = Path(path).parent
        return file

    def beside(self, name: str | None) -> Path | None:
        """Return the path of a file that this file names. A relative name refers to the folder of this file."""
        return None if name is None else self._folder / Path(name).expanduser()

    def described(self) -> tuple[Identity | None, Envelope | None]:
        """Return identity and limits from the file; None for a missing table."""
        identity = None if self.identity is None else self.identity.made()
        ambient = Identity.ambient_pressure_pa if identity is None else identity.ambient_pressure_pa
        return identity, None if self.limits is None else self.limits.made(ambient)
