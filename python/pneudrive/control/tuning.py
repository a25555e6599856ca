"""Tuning: the controller file, gains of a law from the description of a drive, and the linear model of the drive."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias, TypeVar

from pydantic import Field, model_validator

from pneudrive import _core, own_code, units
from pneudrive.arrays import Keyed, NamedNumbers, Pair, Plain, attributes_of
from pneudrive.control import setup as instrumentation
from pneudrive.control.own_law import OWN, OwnLaw, is_own, own_law
from pneudrive.datasheet.equilibrium import full_speeds
from pneudrive.describe import Circuit
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import PREFIX
from pneudrive.describe.marks import Bounds, Choice, Quantity, Reads
from pneudrive.errors import CommandError, DescriptionError, invalid, nearest, warn, within, wrong
from pneudrive.own_code import split
from pneudrive.repr_tables import Shown
from pneudrive.simulation.simulate import require
from pneudrive.simulation.start import DriveOrCircuit
from pneudrive.simulation.trajectory import write_whole
from pneudrive.views import VALUE, ShownValue, View, Viewed

_Read = TypeVar("_Read")
#: Defaults of a controller file: sampling period, s, hold band, m, and delay before holding, s (assumed).
PERIOD_S, BAND_M, AFTER_S = 1e-3, 30e-6, 20e-3


class HoldBand(Described):
    """Band for holding. Once the reference rests and the error stays in the band, the drive is kept at rest."""

    table_name = "hold"
    band_m: Annotated[float, Quantity("m", "um", Bounds(above=0.0))] = Field(
        default=BAND_M, description="error below which it begins"
    )
    after_s: Annotated[float, Quantity("s", "ms", Bounds(at_least=0.0))] = Field(
        default=AFTER_S, description="how long the error has to be within the band"
    )


def _hold(given: Any) -> HoldBand | None:  # noqa: ANN401 - of any type
    if given is False or given is None:
        return None
    if isinstance(given, HoldBand):
        return given
    if not isinstance(given, dict):
        raise DescriptionError(f"{given!r} is not a table", remedy='Write [hold] band = "30 um", or hold = false.')
    return HoldBand.model_validate(given)  # type: ignore[return-value]


def _numbers(table: str) -> Reads:
    def read(given: Any) -> Plain:  # noqa: ANN401 - of any type
        if not isinstance(given, dict):
            raise DescriptionError(f"{given!r} is not a table", remedy=f"Write [{table}], then a line for each number.")
        return dict(given)

    return Reads(read)


_Factor = Annotated[float, Quantity("", bounds=Bounds(at_least=0.1, at_most=10.0))]


class Factors(Described):
    """Factors of a law's gains, 0.1 to 10. The core defines which gain each factor multiplies.

    Examples
    --------
    >>> Factors(gain=2.0).values
    (2.0, 1.0, 1.0)
    """

    table_name = "factors"
    gain: _Factor = Field(default=1.0, description="k_p of pid and fuzzy, the bandwidth of others")
    damping: _Factor = Field(default=1.0, description="T_d of pid and fuzzy; width, band or move penalty of others")
    filter: _Factor = Field(default=1.0, description="filter time of pid and fuzzy")

    @property
    def values(self) -> tuple[float, float, float]:
        """The three factors in the core's order."""
        return self.gain, self.damping, self.filter

    @property
    def changed(self) -> tuple[float, ...]:
        """The three factors; empty if all are 1."""
        return () if set(self.values) == {1.0} else self.values


#: Tables of older controller files that are accepted because they have no effect.
REMOVED_TABLES = {"nmpc": {"predictor": "model"}, "observer": {"kind": "kalman"}, "fuzzy": {"inference": "sugeno"}}


class LawWord(Choice):
    """Annotation of a field that names a controller, by its key or by the name of code, ``mine.py:Law``."""

    def read(self, given: object) -> str:
        """Check the name of a controller or of code, and return it."""
        if isinstance(given, str) and (given == "own" or own_code.split(given) is not None):
            return given
        return super().read(given)


class Controller(Described):
    """A controller as its file describes it.

    Gains and valve parameters have units. `pneudrive.control.tune` reads them, because their keys depend on the
    controller and the valves. Missing values are derived from the drive.

    Examples
    --------
    >>> controller = Controller(law="nmpc", gains={"bandwidth": "80 rad/s"}, hold=False)
    >>> controller.period_s, controller.hold
    (0.001, None)
    """

    schema_version: Literal[1] = Field(default=1, alias="schema")
    law: Annotated[str, LawWord(tuple(_core.control_laws()))] = Field(description="a law, or code: mine.py:Law")
    period_s: Annotated[float, Quantity("s", "ms", Bounds(above=0.0))] = Field(
        default=PERIOD_S, description="time between two samples"
    )
    drive: str | None = Field(default=None, description="drive that the law assumes; absent: the drive of the run")
    setup: str | None = Field(default=None, description="instrumentation: ideal, real, cheap or a file; absent: real")
    adaptation: bool = Field(
        default=True, strict=True, description="it learns friction, mass and valve of its drive while it runs"
    )
    factors: Factors = Factors()
    gains: Annotated[dict[str, Any], _numbers("gains")] = Field(default_factory=dict)
    valves: Annotated[dict[str, Any], _numbers("valves")] = Field(default_factory=dict)
    hold: Annotated[HoldBand | None, Reads(_hold)] = Field(default=HoldBand(), description="false: it never holds")
    limits: instrumentation.ControlLimits = instrumentation.ControlLimits()
    motion: instrumentation.MotionComplete = instrumentation.MotionComplete()
    on_fault: instrumentation.OnFault = instrumentation.OnFault()

    @model_validator(mode="before")
    @classmethod
    def _without_removed_tables(cls, given: Any) -> Any:  # noqa: ANN401 - of any type
        if not isinstance(given, dict):
            return given
        return {key: table for key, table in given.items() if key not in REMOVED_TABLES or table != REMOVED_TABLES[key]}

    def core(self, law: str, belief: Circuit, **numbers: Any) -> Plain:  # noqa: ANN401 - numbers by key, or factors
        """Return the controller in the core's form, in SI, with its ``gains``, ``valves`` and ``factors``."""
        hold = None if self.hold is None else [self.hold.band_m, self.hold.after_s]
        form = {"law": law, "period_s": self.period_s, "gains": {}, "hold": hold, "adaptation": self.adaptation}
        form |= {table: each for table, each in numbers.items() if each}
        return form | {"belief": json.loads(belief.core_json())}


#: A controller, or its TOML file.
ControllerOrFile: TypeAlias = Controller | str | Path


def gain_quantity(unit: str) -> Quantity:
    """Return the annotation of a gain with a unit of the core. The core checks the bounds of the gain."""
    return Quantity(units.si_name(unit))


class TunedGain(NamedTuple):
    """A gain of a law.

    Attributes
    ----------
    key : str
        Key in a controller file.
    unit : str
        SI unit; ``"1"`` for a number without a unit.
    value : float
    meaning, rule : str
        Meaning of the gain, and the rule that determines it.
    given : bool
        Whether the value is given, instead of determined by the rule.
    """

    key: str
    unit: str
    value: float
    meaning: str
    rule: str
    given: bool

    @property
    def quantity(self) -> str | float:
        """Value with its unit, as in a controller file."""
        return gain_quantity(self.unit).show(self.value)

    def __str__(self) -> str:
        """Return the rounded value with its unit."""
        return f"{self.value:.4g} {'' if self.unit == '1' else self.unit}".rstrip()


@dataclass(frozen=True, repr=False)
class Plant(Shown):
    """Linear model of a drive at mid-stroke, with both chambers at the mean of supply and ambient pressure.

    Attributes
    ----------
    natural_frequency_rad_s : float
        Natural frequency of the moving mass on the air springs of both shut chambers.
    damping_ratio : float
        Damping ratio of this oscillation, from viscous friction.
    speed_m_s : float
        Steady speed at full opening with choked exhaust.
    force_rate_n_s : float
        Rate of the force of the filling chamber at full opening: ``k p A^2/V`` times the speed. p is the pressure of
        the supply, A and V are mean area and volume of the chambers. The emptying chamber adds about half of this rate.
    lag_s : float
        Delay of a command: dead time of the valve, lag of its spool, and half a sampling period.
    coulomb_n : float
    stroke_m : float
    rest_pressures_pa : list of float
        Absolute pressures of chambers a and b, near the mean of supply and ambient, at which the piston rests.
    cylinder : str
        Name of the cylinder.
    valves : list of str
        Names of the valves in the order of their commands.
    left_out : list of str
        Components, and parts of cylinder and valve, that the law does not model. The volume of tubes at the chambers is
        modelled.
    pressure_decay_1_s : list of float
        Rates at which the pressures of both shut chambers decay by leakage and heat, at mid-stroke.
    least_force_shares : list of float
        Fractions of the available force that overcome weight and static friction in +x and against it, at mid-stroke.
    """

    natural_frequency_rad_s: float
    damping_ratio: float
    speed_m_s: float
    force_rate_n_s: float
    lag_s: float
    coulomb_n: float
    stroke_m: float
    rest_pressures_pa: list[float]
    cylinder: str
    valves: list[str]
    left_out: list[str]
    pressure_decay_1_s: list[float]
    least_force_shares: list[float]

    def at_rest(self, position_m: float) -> dict[str, str]:
        """Return start values of the cylinder at a position, with the piston in balance."""
        ends = zip("ab", self.rest_pressures_pa, strict=True)
        pressures = {f"{self.cylinder}.{end}.pressure": f"{pressure!r} Pa abs" for end, pressure in ends}
        return {f"{self.cylinder}.position": f"{position_m!r} m"} | pressures

    def rows(self) -> list[tuple[str, str]]:
        """Return the name and the value of each number, with its unit."""
        hertz = self.natural_frequency_rad_s / 6.283185307179586
        return [
            ("natural frequency", f"{self.natural_frequency_rad_s:.3g} rad/s ({hertz:.3g} Hz)"),
            ("damping ratio", f"{self.damping_ratio:.3g}{': no viscous friction' * (not self.damping_ratio)}"),
            ("speed at full opening, exhaust choked", f"{self.speed_m_s:.3g} m/s"),
            ("force rate of the filling chamber", f"{1e-3 * self.force_rate_n_s:.3g} kN/s, k p A^2/V times this speed"),
            ("lag of the command", f"{1e3 * self.lag_s:.3g} ms"),
            ("Coulomb friction", f"{self.coulomb_n:.3g} N"),
            ("stroke", f"{1e3 * self.stroke_m:g} mm"),
        ]


@dataclass(frozen=True, repr=False)
class Tuning(Viewed):
    """A controller with all its gains, tuned for its model of the drive.

    Attributes
    ----------
    controller : Controller
        Controller as its file describes it.
    gains : tuple of TunedGain
    plant : Plant
    belief : Circuit
        Model of the drive that the controller assumes.
    source : str
        File or catalogue name of the assumed drive, if the controller file names it.
    limits : tuple of str
        Limitations of the controller, as sentences.
    own : OwnLaw or None
        Custom law, or None. A custom law has no gains here.
    valves : tuple of TunedGain
        Parameters of several valves, or of a switching valve.
    setup : Setup, str or path-like
        Instrumentation for which the limits are stated.
    """

    controller: Controller
    gains: tuple[TunedGain, ...]
    plant: Plant
    belief: Circuit
    source: str = ""
    limits: tuple[str, ...] = ()
    own: OwnLaw | None = None
    valves: tuple[TunedGain, ...] = ()
    setup: instrumentation.SetupOrFile = "real"

    @property
    def law(self) -> str:
        """Name of the law."""
        return self.controller.law if self.own is None else self.own.name

    @property
    def period_s(self) -> float:
        """Time between two samples, in s."""
        return self.controller.period_s

    @cached_property
    def speeds_m_s(self) -> Pair:
        """Steady speeds of the assumed drive at full opening and mid-stroke in +x and in -x; 0 without motion.

        If the steady-state solver does not find a speed, the speed with choked exhaust is returned instead.
        """
        return full_speeds(self.belief, self.plant.speed_m_s)

    @property
    def reach(self) -> tuple[float, Pair]:
        """Limits of a reference: stroke (m) and `speeds_m_s`."""
        return self.plant.stroke_m, self.speeds_m_s

    @property
    def drive(self) -> Circuit:
        """Drive that the controller assumes. The attribute keeps this name because custom laws read it."""
        return self.belief

    @property
    def numbers(self) -> tuple[TunedGain, ...]:
        """Gains of the law and parameters of its valves."""
        return (*self.gains, *self.valves)

    def core(self) -> Plain:
        """Return the controller in the core's form, in SI."""
        word, controller = self.law if self.own is None else OWN, self.controller
        gains, valves = ({one.key: one.value for one in own} for own in (self.gains, self.valves))
        form = controller.core(word, self.belief, gains=gains, valves=valves, factors=controller.factors.changed)
        limits, motion, fault = controller.limits, controller.motion, controller.on_fault
        ambient_pa = self.belief.ambient.pressure_pa
        rules = {
            "position_m": limits.position,
            "pressure_pa": limits.pressure and [own.absolute_pa(ambient_pa) for own in limits.pressure],
            **attributes_of(limits, "speed_m_s", "stop_deceleration_m_s2"),
            "motion": [motion.tolerance_m, motion.settled_for_s, motion.timeout_s],
            **{f"on_{key}": getattr(fault, key) for key in ("position", "pressure", "valve", "supply")},
        }
        given = {key: value for key, value in rules.items() if value is not None}
        return form | {"supervision": given, "standby": fault.law}

    def to_toml(self, folder: str | Path = "") -> str:
        """Return the text of a controller file for a folder, with meaning and rule of each gain."""
        controller, word = self.controller, self.law
        if self.own is not None:
            module, name = split(word) or ("", OWN)
            word = f"{_seen_from(folder, module)}:{name}" if module.endswith(".py") else word if module else name
        lines = ["schema = 1", f'law = "{word}"', f'period = "{units.write(self.period_s, "s", "ms")}"']
        lines += ["hold = false"] * (controller.hold is None) + ["adaptation = false"] * (not controller.adaptation)
        if self.source:
            lines.append(f"drive = {toml.value_text(_seen_from(folder, self.source))}")
        if not isinstance(self.setup, instrumentation.Setup):
            lines.append(f"setup = {toml.value_text(_seen_from(folder, str(self.setup)))}")
        if controller.factors.changed:
            lines.append(f"factors = {toml.value_text(controller.factors.to_dict())}  # of {_factored(self.law)}")
        for name, numbers in (("gains", self.gains), ("valves", self.valves)):
            lines += ["", f"[{name}]"] if numbers or name == "gains" else []
            for one in numbers:
                rule = "given" if one.given else one.rule
                lines.append(f"{one.key} = {toml.value_text(one.quantity)}  # {one.meaning}: {rule}")
        if controller.hold is not None:
            usual, entries = "  # assumed" * (controller.hold == HoldBand()), controller.hold.with_defaults().items()
            lines += ["", "[hold]", *(f"{key} = {toml.value_text(value)}{usual}" for key, value in entries)]
        for table in (controller.limits, controller.motion, controller.on_fault):
            if table != type(table)():
                lines += ["", *toml.blocks(table.to_dict(), table.table_name)]
        return "\n".join([*lines, ""])

    def save(self, path: str | Path) -> Path:
        """Write a controller file. Paths in the file are relative to its folder.

        The file does not name a drive or a setup that was given as an object. Add its file as ``drive`` or ``setup``.

        Raises
        ------
        CommandError
            The file cannot be written.
        """
        return write_whole(Path(path), self.to_toml(Path(path).parent))

    def view(self) -> View:
        """Return the gains with their rules, the assumed drive, and the limits."""
        rows = [
            ShownValue(f"{gain.key}.{name}", gain.key, name, text)
            for gain in self.numbers
            for name, text in (
                (VALUE, str(gain)),
                ("meaning", gain.meaning),
                ("follows from", "given" if gain.given else gain.rule),
            )
        ]
        out, back = self.speeds_m_s
        of_plant = [*self.plant.rows(), ("steady speed at full opening", f"{out:.3g} m/s out, {back:.3g} m/s back")]
        rows += [ShownValue(name, name, "assumed drive, near mid-stroke", text) for name, text in of_plant]
        title = f"{self.law} for {self.belief.name}, every {1e3 * self.period_s:g} ms"
        factors = " ".join(f"{factor:g}" for factor in self.controller.factors.values)
        given = (f"given factors {factors} of {_factored(self.law)}",) if self.controller.factors.changed else ()
        return View(title, tuple(rows), notes=(*given, *self.limits))


def _factored(law: str) -> str:
    """Return the gain that each factor multiplies, in words."""
    return ", ".join(f"{gain} ({factor})" for of, factor, gain in _core.control_factors() if of == law)


def _seen_from(folder: str | Path, source: str) -> str:
    """Return the name of a drive or setup, or the path of a file relative to the folder of a controller file."""
    return source if _is_name(source) else Path(os.path.relpath(source, folder or ".")).as_posix()


def _is_name(source: str) -> bool:
    return source.startswith(PREFIX) or source in instrumentation.ready_setups()


DEFAULT_LAW = "nmpc"
#: Key, unit, value, meaning and rule of a number, as the core lists it.
_Ruled = tuple[str, str, float, str, str]


def laws() -> list[str]:
    """Return the keys of all laws.

    Examples
    --------
    >>> "nmpc" in laws()
    True
    """
    return list(_core.control_laws())


def tune(
    drive: DriveOrCircuit | None,
    law: object = None,
    *,
    setup: instrumentation.SetupOrFile | None = None,
    controller: ControllerOrFile | None = None,
    believes: DriveOrCircuit | None = None,
    allow_code: str | None = None,
) -> Tuning:
    """Return a law with gains that follow from the description of a drive.

    Parameters
    ----------
    drive : Drive or Circuit, or None
        Drive with one cylinder and one reservoir, and with one proportional 5/3 valve, two proportional 3/2 valves,
        four 2/2 switching valves, or one 5/3 switching valve.
        None: the drive in the controller file.
    law : str or object, optional
        A name in `laws`. Default: the law of the controller, otherwise ``"nmpc"``. For custom laws, see
        `pneudrive.control.run`.
    setup : Setup, str or path-like, optional
        Sensors, converter and computer. Default: the setup of the controller file, otherwise ``"real"``. The setup
        affects the stated limits of the controller, not the gains.
    controller : Controller, str or path-like, optional
        A controller, or its TOML file: period, gains that are given and not tuned, holding, and the drive that the law
        assumes.
    believes : Drive or Circuit, optional
        Drive that the law assumes; default: the drive in the controller file, otherwise `drive`.
    allow_code : str, optional
        SHA-256 of the file of a custom law, if only the controller file names it.

    Raises
    ------
    DescriptionError
        A file is not valid, a gain is unknown or out of bounds, or no law can command the drive.
    CommandError
        The law is unknown, or both `law` and a controller with another law are given.

    Examples
    --------
    >>> import pneudrive as pn
    >>> tuning = pn.control.tune(pn.Drive.load("catalogue:reference"), "nmpc")
    >>> [gain.key for gain in tuning.gains]
    ['bandwidth', 'move_penalty']
    """
    read = None if setup is None else instrumentation.read_setup(setup)[0]
    own = own_law(law) if is_own(law) else None
    table, folder, path, text = _table(law if own is None else own, controller)
    if own is None and is_own(table.law):
        own = own_law(_beside(table.law, folder), allow_code=allow_code, found_in=path)
    believed = drive if believes is None else believes
    if believed is None and table.drive is None:
        remedy = 'Name one: --drive DRIVE, or in Python pn.Drive.load("drive.toml").'
        raise CommandError("no drive is named", where=path or None, remedy=remedy)
    with toml.locating(path, text):
        if read is None:
            (read, _), setup = _named("setup", table.setup or "real", folder, instrumentation.read_setup)
        source = ""
        if table.drive is not None and believes is None:
            from pneudrive.describe.files.load import load_described

            believed, source = _named("drive", table.drive, folder, load_described)
        require(believed, "core_json", "drive", 'pn.Drive.load("drive.toml")')
        word = table.law if own is None else OWN
        tuning = _tuned(table, word, believed.circuit)  # type: ignore[union-attr]
    tuning = replace(tuning, source=source, own=own, setup=setup)
    return replace(tuning, limits=tuple(limitations(tuning, read)))


def _table(law: object, controller: ControllerOrFile | None) -> tuple[Controller, Path, str, str | None]:
    """Return a controller, its folder, and path and text of its file. A given object gives None instead of a text."""
    if controller is None:
        word = OWN if isinstance(law, OwnLaw) else law or DEFAULT_LAW
        if word != OWN and word not in laws():
            raise CommandError(f'there is no law "{word}"', remedy=nearest(str(word), laws()))
        return Controller(law=str(word)), Path(), "", None
    if isinstance(controller, Controller):
        table, path, text = controller, "", None
    else:
        path = str(controller)
        tables, text = toml.read(path, start=f'For instance: schema = 1, then law = "{DEFAULT_LAW}".')
        with toml.locating(path, text):
            table = Controller.model_validate(tables)
    assert isinstance(table, Controller)
    folder, where = Path(path).parent, path or None
    named = law.name if isinstance(law, OwnLaw) else law
    fits = {table.law, _beside(table.law, folder)} | (
        {named} if table.law == OWN and isinstance(law, OwnLaw) else set()
    )
    if named is not None and not {named, _beside(str(named), Path())} & fits:
        raise CommandError.of("control.two_laws", law=named, of_file=table.law, where=where)
    if table.law == OWN and named is None:
        raise CommandError(f'law = "{OWN}" needs a custom law', where=where, remedy="Pass it as the argument law.")
    return table, folder, path, text


def _beside(law: str, folder: Path) -> str:
    """Return the path of custom code as seen from the folder of a controller file; keep other names unchanged."""
    module, name = split(law) or ("", "")
    return f"{os.path.normpath(folder / module)}:{name}" if module.endswith(".py") else law


def _tuned(table: Controller, word: str, belief: Circuit) -> Tuning:
    """Read the given gains of a controller, and derive the other gains from the law's model."""
    for name, part in belief.core_parts.items():  # controllers model each valve by a single conductance
        if part["kind"].startswith("valve/") and part.get("points"):
            raise refused(belief, f"{name}.flow_table", "control.flow_table", valve=name)

    def asked(**numbers: Any) -> tuple[Plain, list[list[_Ruled]]]:  # noqa: ANN401 - see `Controller.core`
        return _core.control_tune(json.dumps(table.core(word, belief, **numbers)), 0.0)

    try:
        plant, ruled = asked()
    except ValueError as error:
        if str(error).startswith("period"):
            raise wrong("period", str(error)) from None
        raise DescriptionError(str(error), where=belief.source_file or belief.name) from None
    plant["left_out"] += check_axis(belief, plant)
    gains = _numbers_of("gains", table.law, table.gains, ruled[0])
    if table.valves and not ruled[1]:
        raise invalid("valves", "control.table_of_valves")
    valves = _numbers_of("valves", "these valves", table.valves, ruled[1])
    given, of_valves = ({one.key: one.value for one in own if one.given} for own in (gains, valves))
    try:
        asked(gains=given, valves=of_valves, factors=table.factors.changed)
    except ValueError as error:  # the message begins with the number, such as "pid.gain =" or "factors.gain ="
        raise wrong(str(error).partition(" ")[0].replace(f"{word}.", "gains."), str(error)) from None
    return Tuning(table, gains, Plant(**plant), belief, valves=valves)


def _numbers_of(table: str, whose: str, values: Plain, ruled: list[_Ruled]) -> tuple[TunedGain, ...]:
    """Read the numbers of a table of a controller file; missing numbers get the default of the core."""
    known = {key: gain_quantity(unit) for key, unit, *_ in ruled}
    given: NamedNumbers = {}
    for key, value in values.items():
        if key not in known:
            remedy = nearest(key, known) if known else f"Leave the table out, because {whose} has no gains."
            raise wrong(f"{table}.{key}", f"{table}.{key} is not a gain of {whose}", remedy=remedy)
        given[key] = known[key].read_at(f"{table}.{key}", value)
    return tuple(
        TunedGain(key, unit, given.get(key, value), meaning, rule, key in given)
        for key, unit, value, meaning, rule in ruled
    )


def _named(key: str, source: str, folder: Path, load: Callable[[str], _Read]) -> tuple[_Read, str]:
    """Load a drive or setup that a controller file names relative to its folder. Return the object and its path."""
    path = source if _is_name(source) else str(folder / source)
    try:
        return load(path), path
    except DescriptionError as error:
        raise error if error.where else within(error, key) from None  # the file or the name does not exist


# --- Limits of a tuned controller.

#: Samples per period of the natural frequency below which a controller is reported as slow (assumed).
LEAST_SAMPLES = 40
MOST_OF_FORCE = 0.85  # fraction of the supply's force for weight and friction above which a warning is given (assumed)


def limitations(tuning: Tuning, setup: instrumentation.Setup) -> Iterator[str]:
    """Yield the limits of a tuned controller in words. Warn if the controller will hardly work.

    Parameters
    ----------
    tuning : Tuning
    setup : Setup
        Sensors and computer.
    """
    plant = tuning.plant
    bandwidth = next((gain.value for gain in tuning.gains if gain.key == "bandwidth"), plant.natural_frequency_rad_s)
    late = bandwidth * plant.lag_s
    yield (
        f"A command acts {1e3 * plant.lag_s:.3g} ms late (dead time of the valve, spool, half a period): "
        f"{late:.2g} rad of phase at {bandwidth:.3g} rad/s. A faster valve or a shorter period allows more bandwidth."
    )
    of_valve = plant.lag_s - 0.5 * tuning.period_s
    longest = max(of_valve, 2.0 * math.pi / plant.natural_frequency_rad_s / LEAST_SAMPLES)
    needs = max(plant.least_force_shares)
    if needs > MOST_OF_FORCE:
        warn(
            f"weight and friction take {100.0 * needs:.0f} % of the force of the supply: "
            f"{'the drive cannot move' if needs > 1.0 else 'little is left for motion'} in at least one direction"
        )
    if tuning.period_s > longest:
        slow = f"period = {1e3 * tuning.period_s:g} ms is too long: above {1e3 * longest:.3g} ms, control is poor"
        of = f"the larger of the valve's lag and 1/{LEAST_SAMPLES} (assumed) of a period of the mass on its air spring"
        warn(f"{slow} or unstable ({of})")
    if setup.computer.time_s > 0.0:
        yield f"The computer of the setup adds {1e3 * setup.computer.time_s:.3g} ms, which the law ignores."
    if setup.sensors.pressure_a is None:
        yield "The setup has no pressure sensors: the law computes the pressures with its model of the drive."
        yield "At rest, the position determines the force of the gas, but not both pressures."
    yield (
        "No observer can separate a force on the piston from a difference of friction between the directions and from "
        "zeros of the sensors, valve conductance from supply pressure, or, at constant speed, mass from force."
    )
    supply_pa, _ = supply_of(tuning.belief.core_json())
    yield from (f"{short}." for short in setup.short_of(supply_pa, tuning.belief.ambient.pressure_pa))
    if plant.left_out:
        yield (
            f"The law does not model {', '.join(plant.left_out)}, except the volume of tubes at the chambers: it "
            "assumes a valve at the cylinder and a constant supply pressure. Speed and lag do not include these parts."
        )
    yield f"References within {1e3 * plant.stroke_m:g} mm and up to the steady speed are accepted."
    assumed = [gain.key for gain in tuning.numbers if "assumed" in gain.rule and not gain.given]
    if assumed:
        yield f"Assumed, not derived from this drive: {', '.join(assumed)}."


# --- Drives that the controllers can model.

#: Longest lag of a command that a controller predicts, s (assumed: slow valves need 0.1 s).
MOST_LAG_S = 0.2
_DOUBLE_ACTING = ("cylinder/rodless", "cylinder/through-rod", "cylinder/single-rod")
_CROSSED = ("valve/proportional-5/3", "valve/switching-5/3")
#: Parameters that change the motion but that no controller models: kind of component -> prefix of a key -> effect.
_UNKNOWN = {
    "cylinder/": {"cushion_": "cushion", "leakage": "leakage"},
    "valve/proportional": {"stroke_time": "stroke_time"},
    "reservoir/": {"amplitude": "amplitude"},
}


def check_axis(belief: Circuit, plant: Keyed) -> list[str]:
    """Reject a circuit that the controllers cannot model.

    Parameters
    ----------
    belief : Circuit
    plant : dict
        The core's model of the drive; ``cylinder`` and ``valves`` are names of components.

    Returns
    -------
    list of str
        Parts of cylinder, valves and supply that controllers do not model, such as ``cylinder.cushion``.

    Raises
    ------
    DescriptionError
        The cylinder is single-acting or a tandem, or ports 4 and 2 of its 5/3 valve do not lead to chambers a and b.
    """
    kinds = {name: one["kind"] for name, one in belief.core_parts.items()}
    joints = belief.wiring.core()
    cylinder, valves = plant["cylinder"], plant["valves"]
    ends = {cylinder, *valves, *(name for name, kind in kinds.items() if kind.startswith("reservoir"))}
    if kinds[cylinder] not in _DOUBLE_ACTING:
        raise refused(belief, f"{cylinder}.kind", "control.no-model", name=cylinder, kind=kinds[cylinder])
    if plant["lag_s"] > MOST_LAG_S:
        raise refused(belief, f"{valves[0]}.delay", "control.late", lag=plant["lag_s"], most=MOST_LAG_S)
    for port, chamber in (("4", "a"), ("2", "b")) if kinds[valves[0]] in _CROSSED else ():
        found = _chambers(joints, f"{valves[0]}.{port}", cylinder, ends)
        if f"{cylinder}.{chamber}" not in found:
            to = " and ".join(sorted(found)) or "no chamber"
            names = {"valve": valves[0], "port": port, "to": to, "cylinder": cylinder}
            raise refused(belief, "", "control.crossed", **names)
    return [
        f"{name}.{what}"
        for name, one in belief.core_parts.items()
        for kind, known in _UNKNOWN.items()
        for begin, what in known.items()
        if one["kind"].startswith(kind)
        and any(key.startswith(begin) and value > 0.0 for key, value in one["numbers"].items())
    ]


def refused(belief: Circuit, key: str, message: str, **values: object) -> DescriptionError:
    """Return an error with the line of a component's key, or of the connections, in the file of a drive or circuit."""
    file = belief.source_file
    if not Path(file).is_file():
        return DescriptionError.of(message, where=belief.name, **values)
    tables, text = toml.read(file)
    place = f"components.{key}" if "components" in tables else key
    return toml.located(invalid(place if key else "connections", message, **values), file, text)


def _chambers(joints: list[list[str]], port: str, cylinder: str, ends: set[str]) -> set[str]:
    """Return the chambers to which a port leads. The search does not pass through `ends` and the ambient."""
    front, reached = [joint for joint in joints if port in joint], list[list[str]]()
    while front := [joint for joint in front if "ambient" not in joint and joint not in reached]:
        reached += front
        through = {_component(one) for joint in front for one in joint} - ends
        front = [joint for joint in joints if any(_component(one) in through for one in joint)]
    return {one for joint in reached for one in joint if _component(one) == cylinder}


def _component(port: str) -> str:
    return port.rpartition(".")[0]


def supply_of(core_json: str) -> Pair:
    """Return absolute pressure (Pa) and temperature (K) of the supply of a circuit in the core's form."""
    form = json.loads(core_json)
    numbers = next(one["numbers"] for one in form["components"] if one["kind"].startswith("reservoir"))
    return numbers["pressure"], numbers.get("temperature", form["ambient"]["temperature_k"])
