"""TOML files about rigs that are not simulated: each complaint names file, line, value, rule and remedy."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.characterise.force_calibration import of_quantities
from pneudrive.describe import toml
from pneudrive.describe.geometry import KINDS, piston_areas
from pneudrive.errors import DescriptionError, Problems, RigError, nearest, together
from pneudrive.rig.interface import Envelope, Identity
from pneudrive.units import parse, parse_pressure, parse_range

if TYPE_CHECKING:
    from collections.abc import Callable, Collection

#: Channel as a user writes it -> name and SI unit of the channel of an `Identity`.
CHANNEL_KEYS = {
    "position": ("position_m", "m"),
    "force": ("force_n", "N"),
    "pressure_a": ("pressure_a_pa", "Pa"),
    "pressure_b": ("pressure_b_pa", "Pa"),
    "temperature": ("temperature_k", "K"),
}
IDENTITY_KEYS = {
    "name", "kind", "bore", "rod_diameter", "area_a", "area_b", "ambient_pressure", "mass_beyond_sensor", "incline",
    "stiffness", "chambers", "pressure_measured_at", "accuracy", "range", "resolution", "bandwidth", "calibration",
    "force_calibration", "labels",
}  # fmt: skip
LIMIT_KEYS = {
    "position", "speed", "acceleration", "jerk", "force", "pressure", "separate_pressures", "temperature",
    "supply_pressure", "expected_friction", "home",
}  # fmt: skip
CHAMBERS = ("open", "common", "separate", "held")
MEASURED_AT = ("chamber", "regulator")


class RigFile:
    """A parsed file; keys are dotted names.

    Parameters
    ----------
    tree : dict
    text : str
        As written, to find lines.
    origin : str
        What a message calls it.
    """

    def __init__(self, tree: dict[str, Any], text: str = "", origin: str = "rig") -> None:
        self.tree, self.text, self.origin = tree, text, origin

    @classmethod
    def load(cls, path: str | Path) -> RigFile:
        """Read a file.

        Raises
        ------
        RigError
            It cannot be read, or is not TOML.
        """
        tree, text = toml.read(path, RigError, "The guides on rigs show what stands in one.")
        return cls(tree, text, str(path))

    @classmethod
    def loads(cls, text: str, origin: str = "rig") -> RigFile:
        """Read TOML text."""
        return cls(toml.parse(text, origin, RigError), text, origin)

    @property
    def folder(self) -> Path:
        """Folder that relative names of other files start from."""
        return Path(self.origin).parent

    def fail(self, what: str, key: str = "", rule: str | None = None, remedy: str | None = None) -> RigError:
        """Build an error at a key's line."""
        line = toml.line_of(self.text, key) if key else None
        shown = self.text.splitlines()[line - 1].strip() if line else None
        return RigError(
            what, where=f"{self.origin}:{line}" if line else self.origin, value=shown, rule=rule, remedy=remedy
        )

    def get(self, key: str) -> Any:  # noqa: ANN401 - whatever the file holds
        """Give what stands at a dotted key, None where nothing does."""
        value: Any = self.tree
        for part in key.split("."):
            if not isinstance(value, dict) or part not in value:
                return None
            value = value[part]
        return value

    def only(self, table: str, known: Collection[str]) -> dict[str, Any]:
        """Give a table ("" is the file's top), empty where it is absent, and refuse keys that are not known."""
        found = self.get(table) if table else self.tree
        if found is None:
            return {}
        if not isinstance(found, dict):
            raise self.fail(f"[{table}] must be a table", table)
        paths = {key: f"{table}.{key}" if table else key for key in found if key not in known}
        if paths:
            raise together(
                [self.fail(f"unknown key '{path}'", path, remedy=nearest(key, known)) for key, path in paths.items()]
            )
        return found

    def said(self, key: str, how: Callable[[Any], Any]) -> Any:  # noqa: ANN401 - whatever `how` gives
        """Read a value, None where it is absent; the unit reader's complaint is put at the key's line."""
        value = self.get(key)
        if value is None:
            return None
        try:
            return how(value)
        except DescriptionError as error:
            raise self.fail(f"{key}: {error.what}", key, error.rule, error.remedy) from None

    def needed(self, key: str, value: Any, example: str) -> Any:  # noqa: ANN401
        """Give the value, or say that the key is missing."""
        if value is None:
            table, _, name = key.rpartition(".")
            raise self.fail(f"{key} is missing", table, remedy=f"{name} = {example}")
        return value

    def string(self, key: str) -> str | None:
        """Read an optional text."""
        value = self.get(key)
        if value is not None and not isinstance(value, str):
            raise self.fail(f"{key} = {value!r} must be a text in quotes", key)
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Read an optional truth value."""
        value = self.get(key)
        if value is not None and not isinstance(value, bool):
            raise self.fail(f"{key} = {value!r} must be true or false", key)
        return default if value is None else value

    def count(self, key: str, default: int, least: int = 0) -> int:
        """Read an optional whole number."""
        value = self.get(key)
        if value is None:
            return default
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            raise self.fail(f"{key} = {value!r} must be a whole number, at least {least}", key)
        return value

    def quantity(self, key: str, unit: str, positive: bool = False) -> float | None:
        """Read an optional quantity in SI."""
        value = self.said(key, lambda text: parse(text, unit))
        if value is not None and (value <= 0.0 if positive else value < 0.0):
            raise self.fail(f"{key} must {'be greater than zero' if positive else 'not be negative'}", key)
        return value

    def pressure(self, key: str, ambient_pa: float) -> float | None:
        """Read an optional pressure, absolute."""
        return self.said(key, lambda text: parse_pressure(text).absolute_pa(ambient_pa))

    def path(self, key: str) -> Path | None:
        """Read an optional file name; a relative one starts from this file's folder."""
        name = self.string(key)
        return None if name is None else self.folder / Path(name).expanduser()

    def choice(self, key: str, choices: Collection[str], default: str) -> str:
        """Read an optional word out of several."""
        value = self.string(key)
        if value is not None and value not in choices:
            raise self.fail(f"{key} = '{value}' is not known", key, remedy=nearest(value, choices))
        return default if value is None else value


def read_identity(file: RigFile) -> Identity | None:
    """Read ``[identity]``: which rig this is, and how its sensors are calibrated. None where there is no such table."""
    if "identity" not in file.tree:
        return None
    problems = Problems()
    take = problems.take
    take(file.only, "identity", IDENTITY_KEYS)
    take(lambda: file.needed("identity.name", file.string("identity.name"), '"Bench 3"'))
    ambient = take(file.pressure, "identity.ambient_pressure", 0.0) or Identity.ambient_pressure_pa
    area_a, area_b = take(_areas, file, otherwise=(0.0, 0.0))

    def channels(table: str, read: Callable[[str, str], Any]) -> dict[str, Any]:
        more = ("bore",) if table == "accuracy" else ()
        found = take(file.only, f"identity.{table}", {*CHANNEL_KEYS, *more}, otherwise={})
        names = {**CHANNEL_KEYS, "bore": ("bore_m", "m")}
        return {names[key][0]: take(read, f"identity.{table}.{key}", names[key][1]) for key in found}

    def sensor_range(key: str, unit: str) -> tuple[float, float]:
        return _span(file, key, unit, ambient)

    calibration = take(file.only, "identity.calibration", CHANNEL_KEYS, otherwise={})
    labels = take(lambda: file.only("identity.labels", file.get("identity.labels") or {}), otherwise={})
    found = {
        "mass_beyond_sensor_kg": take(file.quantity, "identity.mass_beyond_sensor", "kg") or 0.0,
        "incline_rad": take(file.said, "identity.incline", lambda text: parse(text, "rad")) or 0.0,
        "stiffness_n_m": take(file.quantity, "identity.stiffness", "N/m", True),
        "accuracy": channels("accuracy", file.quantity),
        "limits": channels("range", sensor_range),
        "resolution": channels("resolution", file.quantity),
        "bandwidth_hz": channels("bandwidth", lambda key, _: file.quantity(key, "1/s", positive=True)),
        "force_calibration": take(file.said, "identity.force_calibration", of_quantities),
        "chambers": take(file.choice, "identity.chambers", CHAMBERS, "held"),
        "pressure_measured_at": take(file.choice, "identity.pressure_measured_at", MEASURED_AT, "chamber"),
    }
    problems.tell()
    return Identity(
        **found,
        name=file.tree["identity"]["name"],
        area_a_m2=area_a,
        area_b_m2=area_b,
        ambient_pressure_pa=ambient,
        calibration={CHANNEL_KEYS[key][0]: str(text) for key, text in calibration.items()},
        labels={key: str(text) for key, text in labels.items()},
    )


def read_limits(file: RigFile, ambient_pa: float) -> Envelope | None:
    """Read ``[limits]``: what the rig may be asked to do. None where there is no such table."""
    if "limits" not in file.tree:
        return None
    problems = Problems()
    take = problems.take
    take(file.only, "limits", LIMIT_KEYS)

    def most(key: str, unit: str, example: str) -> float:
        name = f"limits.{key}"
        return file.needed(name, file.quantity(name, unit, positive=True), example)

    def span(key: str, unit: str, example: str) -> tuple[float, float]:
        name = f"limits.{key}"
        file.needed(name, file.get(name), example)
        return _span(file, name, unit, ambient_pa)

    home = take(file.said, "limits.home", lambda text: parse(text, "m"))
    found = {
        "position_m": take(span, "position", "m", '"5 mm .. 295 mm"'),
        "speed_m_s": take(most, "speed", "m/s", '"500 mm/s"'),
        "acceleration_m_s2": take(most, "acceleration", "m/s^2", '"5 m/s2"'),
        "jerk_m_s3": take(most, "jerk", "m/s^3", '"200 m/s3"'),
        "force_n": take(most, "force", "N", '"150 N"'),
        "pressure_pa": take(span, "pressure", "Pa", '"1 bar abs .. 3 bar abs"'),
        "separate_pressures": take(file.flag, "limits.separate_pressures", False),
        "temperature_k": take(span, "temperature", "K", '"15 degC .. 30 degC"'),
        "supply_pressure_pa": take(file.pressure, "limits.supply_pressure", ambient_pa) or 0.0,
        "expected_friction_n": take(file.quantity, "limits.expected_friction", "N") or 0.0,
    }
    low, high = found["position_m"] or (-math.inf, math.inf)
    if home is not None and not low <= home <= high:
        problems.add(file.fail("limits.home lies outside limits.position", "limits.home"))
    problems.tell()
    return Envelope(**found, home_m=low if home is None else home)


def _span(file: RigFile, key: str, unit: str, ambient_pa: float) -> tuple[float, float]:
    from pneudrive.characterise.column_units import pressure_range

    if unit == "Pa":
        return file.said(key, lambda text: pressure_range(text, ambient_pa))
    return file.said(key, lambda text: parse_range(text, unit))


def _areas(file: RigFile) -> tuple[float, float]:
    """Areas of the piston, from its bore or as given."""
    given = [file.quantity(f"identity.{key}", "m^2") for key in ("area_a", "area_b")]
    bore = file.quantity("identity.bore", "m", positive=True)
    if (bore is None) == (None in given):
        raise file.fail("[identity] does not give the areas once", "identity", "either bore, or area_a and area_b")
    if bore is None:
        return given[0] or 0.0, given[1] or 0.0
    kind = file.choice("identity.kind", KINDS, "rodless")
    rod = file.quantity("identity.rod_diameter", "m", positive=True) or 0.0
    if (rod == 0.0) != (kind == "rodless") or rod >= bore:
        raise file.fail("identity.kind, bore and rod_diameter do not fit", "identity", "a rod is smaller than the bore")
    return piston_areas(kind, bore, rod)
