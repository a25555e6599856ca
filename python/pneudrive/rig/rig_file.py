"""TOML files of rigs that are not simulated; each error gives file, line, value, rule and remedy."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, StrictBool, create_model, model_validator
from typing_extensions import Self

from pneudrive import own_code, units
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import NOT_NEGATIVE, POSITIVE, Between, Mark, PressureBetween, Quantity, Reads, absolute
from pneudrive.describe.tables.parts import PistonTable
from pneudrive.errors import RigError, nearest, wrong
from pneudrive.rig.interface import WORDS, Envelope, Identity, Rig, missing_verbs
from pneudrive.signals.force_calibration import ForceCalibration, of_quantities

#: Channel in a rig file -> name and SI unit of the channel in an `Identity`.
CHANNELS: dict[str, tuple[str, str]] = WORDS["channels"]


def _channels(mark: Callable[[str], Mark], **others: tuple[str, Mark]) -> Reads:
    """Return the annotation of a table with one value per channel.

    Values are stored under the channel names of `Identity`.

    Parameters
    ----------
    mark : callable
        Function of the SI unit of a channel. It returns the annotation of the values of this channel.
    **others
        Further keys -> name in `Identity`, and annotation.
    """
    marks = {key: (name, mark(unit)) for key, (name, unit) in CHANNELS.items()} | others
    fields: Any = {name: (Annotated[Any, mark], Field(None, alias=key)) for key, (name, mark) in marks.items()}
    table = create_model("Channels", __base__=Described, **fields)

    def read(given: Any) -> dict[str, Any]:  # noqa: ANN401 - checked by the table
        values = table.model_validate(given).stored()
        return {marks[key][0]: values[marks[key][0]] for key in given}

    return Reads(read)


def _amount(si_unit: str) -> Quantity:
    return Quantity(si_unit, bounds=NOT_NEGATIVE)


def _range(si_unit: str) -> Mark:
    return PressureBetween() if si_unit == "Pa" else Between(si_unit)


_FREQUENCIES = _channels(lambda _: Quantity("1/s", bounds=POSITIVE))


class IdentityTable(PistonTable):
    """``[identity]``: identity of the rig and calibration of its sensors.

    Piston areas are stated directly, or by the bore.
    """

    table_name = "identity"
    name: str
    ambient_pressure: Annotated[units.Pressure, marks.StatedPressure(gauge_allowed=False)] = units.Pressure(
        Identity.ambient_pressure_pa, gauge=False
    )
    mass_beyond_sensor_kg: Annotated[float, _amount("kg")] = 0.0
    incline_rad: marks.Angle = 0.0
    stiffness_n_m: Annotated[float | None, Quantity("N/m", bounds=POSITIVE)] = None
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
    labels: dict[str, marks.Text] = Field(default_factory=dict)

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

    table_name = "limits"
    position_m: Annotated[tuple[float, float], Between("m", "mm")]
    speed_m_s: Annotated[float, Quantity("m/s", bounds=POSITIVE)]
    acceleration_m_s2: Annotated[float, Quantity("m/s^2", bounds=POSITIVE)]
    jerk_m_s3: Annotated[float, Quantity("m/s^3", bounds=POSITIVE)]
    force_n: Annotated[float, Quantity("N", bounds=POSITIVE)]
    pressure_pa: Annotated[tuple[units.Pressure, units.Pressure], PressureBetween()]
    separate_pressures: StrictBool = False
    temperature_k: Annotated[tuple[float, float], Between("K", "degC")]
    supply_pressure: marks.MaybePressure = None
    expected_friction_n: Annotated[float, _amount("N")] = 0.0
    home_m: Annotated[float | None, Quantity("m", "mm")] = None

    @model_validator(mode="after")
    def _home_inside(self) -> Self:
        low, high = self.position_m
        if self.home_m is not None and not low <= self.home_m <= high:
            raise wrong("limits.home", "limits.home is outside limits.position")
        return self

    def made(self, ambient_pa: float) -> Envelope:
        """Return the table as the envelope of a rig, with absolute pressures."""
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
        start = "The guides on rigs show examples of rig files."
        file = toml.load(cls.model_validate, path, RigError, start=start)
        file._folder = Path(path).parent
        return file

    def beside(self, name: str) -> Path:
        """Return the path of a file named in this rig file. A relative name refers to the folder of this rig file."""
        return self._folder / Path(name).expanduser()

    def described(self) -> tuple[Identity | None, Envelope | None]:
        """Return identity and limits from the file; None for a missing table."""
        identity = None if self.identity is None else self.identity.made()
        ambient = Identity.ambient_pressure_pa if identity is None else identity.ambient_pressure_pa
        return identity, None if self.limits is None else self.limits.made(ambient)


# --- Loading of rigs by name, file or address: one registry for every kind.

RIGS = Path(__file__).with_name("rigs")

#: Kind -> ``module:function``, called as function(source, seed, pace), that makes such a rig. A kind is the scheme of
#: an address, ``kind = "..."`` at the top of a TOML file, or ``folder``. Modules are imported at first use.
LOADERS: dict[str, str] = {
    "simulated": "pneudrive.rig.simulated:load_session",
    "opc-ua": "pneudrive.rig.opcua.client:load_opcua",
    "opc.tcp": "pneudrive.rig.opcua.client:load_opcua",
    "replay": "pneudrive.campaign.replay:load_replay",
    "folder": "pneudrive.campaign.replay:load_replay",
}
CODE = "code"
#: Kinds that a file may name, because they only read data. Other kinds run code, or move an axis and log in.
ONLY_DATA = ("simulated", "replay", "folder")


def shipped_rigs() -> dict[str, Path]:
    """Return the files of the simulated rigs that come with the package, by name."""
    default = {"default": RIGS.with_name("default.toml")}
    return default | {path.stem: path for path in sorted(RIGS.glob("*.toml"))}


def load_rig(
    source: str | Path = "default",
    seed: int = 0,
    pace: float | None = None,
    *,
    found_in: str | None = None,
    allow_code: str | None = None,
) -> Rig:
    """Open a rig by its name, file, address or code.

    Parameters
    ----------
    source : str or Path
        Name of a shipped rig (`shipped_rigs`), a rig file (TOML with its ``kind``), a folder of recordings, or an
        address such as ``opc.tcp://127.0.0.1:4840``. Custom code is ``own_rig.py:make_rig`` or
        ``package.module:Class``, called without arguments.
    seed : int
        Seed of all random numbers of a simulated rig; other rigs ignore it.
    pace : float, optional
        Speed of a simulated rig or a replay relative to real time: 1 is real time; None is as fast as possible.
    found_in : str, optional
        File that names `source`, if the user has not named it. Only a simulated rig or a replay is then allowed: rigs
        that run code, move an axis or log in must be named by the user.
    allow_code : str, optional
        SHA-256 of a file of custom code that may run although only a file, not the user, names it.

    Returns
    -------
    Rig

    Raises
    ------
    RigError
        The rig does not exist, or a file must not name it.
    DescriptionError
        The rig file is not valid.
    """
    text = str(source)
    kind, name = _kind(text)
    if kind == CODE:
        if found_in is None:
            return _own_rig(name, own_code.load(name, RigError))
        return _own_rig(name, own_code.load_allowed(name, allow_code, found_in, "--rig", RigError))
    if found_in is not None and kind not in ONLY_DATA:
        raise RigError.of("rig.only-a-file", where=found_in, rig=text)
    if kind not in LOADERS:
        raise RigError(f"rigs of kind {kind!r} are not known", where=text, remedy=nearest(kind, LOADERS))
    module, _, function = LOADERS[kind].partition(":")
    return getattr(import_module(module), function)(name, seed, pace)


def _own_rig(source: str, make: Callable[[], Any]) -> Rig:
    """Call custom code, a function or class, without arguments, and check that it returns a rig."""
    rig: Rig = own_code.guarded(source, RigError, make)
    if missing := missing_verbs(rig, Rig):
        raise RigError.of("rig.returned", source=source, type=type(rig).__name__, missing=", ".join(missing))
    return rig


def must_be_named(source: str) -> bool:
    """Return whether a rig must be named by the user, not only by a file."""
    try:
        return _kind(source)[0] not in ONLY_DATA
    except RigError:
        return False


def _kind(text: str) -> tuple[str, str]:
    """Return the kind of a rig, and its full name, address, file or folder."""
    scheme, separator, rest = text.partition(":")
    if separator and rest.startswith("//"):
        return scheme, text
    known = shipped_rigs()
    path = known.get(text, Path(text))
    if path.is_dir():
        return "folder", str(path)
    if path.is_file() and path.suffix == ".toml":
        tables, _ = toml.read(path, RigError, "The guides on rigs show examples of rig files.")
        return str(tables.get("kind", "simulated")), str(path)
    if own_code.split(text) is not None:
        return CODE, text
    raise RigError.of("rig.no-rig", rig=text, remedy=nearest(text, known))
