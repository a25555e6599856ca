"""The campaign protocol as a TOML file: factors, order, preparations and checks, one class for each table."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import ConfigDict, Field, PrivateAttr, model_validator

from pneudrive import units
from pneudrive.arrays import Plain
from pneudrive.describe import marks
from pneudrive.describe.base import Described
from pneudrive.describe.files import toml
from pneudrive.describe.marks import POSITIVE, Bounds, Mark, Percent, Quantity, Reads, StatedPressure, Whole
from pneudrive.errors import DescriptionError, ProtocolError, nearest, wrong
from pneudrive.files.bounds import within
from pneudrive.rig.interface import Sampling

#: Significant digits of the levels between the ends of a range. The name of a level can state four digits exactly.
DIGITS = 4
SPACINGS = ("log", "linear")
AMBIENT = units.Pressure(0.0, gauge=True)


class Pair(NamedTuple):
    """Pressures in both chambers, absolute or gauge as stated."""

    a: units.Pressure
    b: units.Pressure

    @property
    def name(self) -> str:
        """Text for the key of a cycle: ``a0.5/b0.5`` in bar gauge, or ``a1.5abs`` for a pressure stated as absolute."""
        a, b = (f"{p.value_pa / 1e5:.6g}{'' if p.gauge else 'abs'}" for p in self)
        return f"a{a}/b{b}"

    def absolute_pa(self, ambient_pa: float) -> tuple[float, float]:
        """Return both pressures as absolute pressures, in Pa."""
        return self.a.absolute_pa(ambient_pa), self.b.absolute_pa(ambient_pa)


#: Chambers open to ambient.
VENTED = Pair(AMBIENT, AMBIENT)


def _average(given: object) -> int:
    """Read the number of samples of a moving average; ``"none"`` means 1."""
    if given == "none":
        return 1
    if isinstance(given, bool) or not isinstance(given, int) or given < 1:
        raise DescriptionError(f"{given!r} is not a number of samples", remedy='Write 5, or "none".')
    Bounds(bound="samples").beyond(given, given)
    return given


@dataclass(frozen=True, order=True)
class AxisPosition:
    """A position: absolute in m, or as a fraction of the used range."""

    value: float
    relative: bool

    def at(self, low_m: float, high_m: float) -> float:
        """Return the position in m, for a used range from `low_m` to `high_m`."""
        return low_m + self.value * (high_m - low_m) if self.relative else self.value

    def __str__(self) -> str:
        """Return the value as users write it."""
        return units.write_share(self.value) if self.relative else units.write(self.value, "m", "mm")

    @property
    def name(self) -> str:
        """Text for the key of a cycle: ``x50pc`` or ``x120mm``."""
        return "x" + str(self).replace(" %", "pc").replace(" ", "")


def _position(given: object) -> AxisPosition:
    """Read a position: a length (``"120 mm"``) or a fraction (``"50 %"``)."""
    fraction = units.share_of(given)
    if fraction is not None:
        if not 0.0 <= fraction <= 1.0:
            raise DescriptionError(f'"{given}" lies outside the range', rule="0 % to 100 %")
        return AxisPosition(fraction, relative=True)
    if not isinstance(given, str):
        raise DescriptionError(f"{given!r} has no unit", remedy='Write "50 %" or "120 mm".')
    try:
        return AxisPosition(units.parse(given, "m"), relative=False)
    except DescriptionError as error:
        raise DescriptionError(error.what, rule=error.rule, remedy='Write "50 %" or "120 mm".') from None


def _positions(given: object) -> tuple[AxisPosition, AxisPosition]:
    """Read a range of positions, ``"10 mm .. 290 mm"`` or ``"5 % .. 95 %"``."""
    low, high = map(_position, units.split_range(given, '10 mm .. 290 mm" or "5 % .. 95 %'))
    if low.relative == high.relative and not low.value < high.value:
        raise DescriptionError(f'range "{given}" is empty', rule="the first end must lie below the second")
    return low, high


def _pair(given: object) -> Pair:
    """Read ``{ a = ..., b = ... }``, a pressure in each chamber."""
    if not isinstance(given, dict) or set(given) != {"a", "b"}:
        raise DescriptionError(f"{given!r} is not a pair of pressures", remedy="Write { a = ..., b = ... }.")
    return Pair(*(PRESSURE.read(given[chamber]) for chamber in "ab"))


PRESSURE = StatedPressure()
_OF_POSITION: Plain = {"type": "string", "x-unit": "m or %"}
#: Annotations of fields: a moving average, a position, a range of positions, and a pressure in each chamber.
AVERAGE = Reads(
    _average,
    lambda count: "none" if count == 1 else count,
    {"anyOf": [{"type": "integer", "minimum": 1}, {"const": "none"}]},
)
POSITION = Reads(_position, str, _OF_POSITION)
POSITIONS = Reads(_positions, lambda ends: f"{ends[0]} .. {ends[1]}", _OF_POSITION | {"pattern": r"^.+ \.\. .+$"})
PAIR = Reads(
    _pair,
    lambda pair: {"a": str(pair.a), "b": str(pair.b)},
    marks.table_schema({"a": PRESSURE.schema(), "b": PRESSURE.schema()}, ["a", "b"]),
)


@dataclass(frozen=True)
class ListOf(Mark):
    """Annotation of a field that takes one value, a list, or a range with a count. The field stores all values.

    Parameters
    ----------
    mark : Mark
        Annotation of each value.
    spacing : str
        Default spacing of a range, ``log`` or ``linear``. Empty: ranges are not allowed.
    sorts : bool
        Whether to store the values in ascending order, otherwise in the given order.
    only_list : bool
        Whether even a single value must be given as a list.
    """

    mark: Mark
    spacing: str = ""
    sorts: bool = True
    only_list: bool = False

    def read(self, given: object) -> tuple[Any, ...]:
        """Convert and check the values."""
        if self.spacing and isinstance(given, dict):
            return self._range(given)
        if self.only_list and (not isinstance(given, list) or not given):
            raise DescriptionError(f"{given!r} is not a list of pairs", remedy="Write [{ a = ..., b = ... }, ...].")
        entries = given if isinstance(given, list) else [given]
        if not entries:
            raise DescriptionError("the list is empty")
        Bounds(bound="count").beyond(f"{len(entries)} entries", len(entries))
        values = [self.mark.read(entry) for entry in entries]
        twice = [value for value, count in Counter(values).items() if count > 1]
        if twice:
            raise DescriptionError(f"{self.mark.show(twice[0])} occurs twice", remedy="Use `repeats` for repetitions.")
        return tuple(sorted(values) if self.sorts else values)

    def _range(self, given: Plain) -> tuple[Any, ...]:
        """Read ``{ from, to, count, spacing }``."""
        keys = ["from", "to", "count", "spacing"]
        for key in given:
            if key not in keys:
                raise DescriptionError(f"'{key}' is not known here", remedy=nearest(key, keys))
        for key in keys[:3]:
            if key not in given:
                raise DescriptionError(f"'{key}' is missing", remedy="Write { from = ..., to = ..., count = ... }.")
        spacing = given.get("spacing", self.spacing)
        if spacing not in SPACINGS:
            raise DescriptionError(f"spacing = {spacing!r} is not known", remedy=nearest(str(spacing), SPACINGS))
        count = Whole(at_least=2).read(given["count"])
        low, high = (self.mark.read(given[key]) for key in ("from", "to"))
        if isinstance(self.mark, Quantity):
            return spaced(low, high, count, spacing, self.mark)
        if low.gauge != high.gauge:
            raise DescriptionError(f"the range {given['from']!r} to {given['to']!r} mixes abs and gauge")
        values = spaced(low.value_pa, high.value_pa, count, spacing, Quantity("Pa", "bar"))
        return tuple(units.Pressure(value, low.gauge) for value in values)

    def show(self, value: tuple[Any, ...]) -> list[Any]:
        """Return all levels in the form in which users write them."""
        return [self.mark.show(level) for level in value]

    def named(self, value: tuple[Any, ...]) -> tuple[Any, ...]:
        """Return each level as a quantity with its unit."""
        return tuple(map(self.mark.named, value))

    def schema(self) -> Plain:
        """Return the JSON schema of the forms in which users write levels."""
        entry = self.mark.schema()
        if isinstance(self.mark, Quantity):
            entry.pop("description")
        several = {"type": "array", "items": entry, "minItems": 1}
        if self.only_list:
            return several | {"x-unit": "Pa"}
        count = {"type": "integer", "minimum": 2}
        keys = {"from": entry, "to": entry, "count": count, "spacing": {"enum": list(SPACINGS)}}
        ranges = [marks.table_schema(keys, ["from", "to", "count"])] if self.spacing else []
        return {"anyOf": [entry, several, *ranges], "x-unit": entry["x-unit"]}


def spaced(low: float, high: float, count: int, spacing: str, mark: Quantity) -> tuple[float, ...]:
    """Return `count` levels from `low` to `high`. The ends are exact; the levels between have `DIGITS` digits.

    Examples
    --------
    >>> spaced(1e-3, 0.1, 3, "log", Quantity("m/s", "mm/s"))
    (0.001, 0.01, 0.1)
    """
    if not low < high:
        raise DescriptionError("the range is empty", rule="`from` must lie below `to`")
    if spacing == "log" and not low > 0.0:
        raise DescriptionError("a logarithmic range must start above zero", remedy='Write spacing = "linear".')
    unit = mark.written or mark.si_unit
    factor, offset = units.converter(unit, mark.si_unit)
    begin, end = (math.log(low), math.log(high)) if spacing == "log" else (low, high)
    inner = []
    for index in range(1, count - 1):
        fraction = index / (count - 1)
        value = (1.0 - fraction) * begin + fraction * end
        value = math.exp(value) if spacing == "log" else value
        inner.append(units.parse(f"{(value - offset) / factor:.{DIGITS}g} {unit}", mark.si_unit))
    out = (low, *inner, high)
    if any(not a < b for a, b in pairwise(out)):
        what = f"{count} levels do not differ in their first {DIGITS} significant digits"
        raise DescriptionError(what, remedy="Lower the count.")
    return out


LASTS, MAY_LAST = Bounds(above=0.0, bound="seconds"), Bounds(at_least=0.0, bound="seconds")
SPEED = Quantity("m/s", "mm/s", POSITIVE)

Speed = Annotated[float, SPEED]
Duration = Annotated[float, Quantity("s", "s", LASTS)]
DurationOrZero = Annotated[float, Quantity("s", "s", MAY_LAST)]
Minutes = Annotated[float, Quantity("s", "min", LASTS)]
Count = Annotated[int, Whole()]
CountOrNone = Annotated[int, Whole(at_least=0)]
MaybeSpeed = Annotated[float | None, SPEED]
MaybeDuration = Annotated[float | None, Quantity("s", "s", LASTS)]
MaybeDistance = Annotated[float | None, Quantity("m", "mm", POSITIVE)]
MaybePressures = Annotated[tuple[units.Pressure, ...] | None, ListOf(PRESSURE, "linear", sorts=False)]


class ProtocolTable(Described):
    """Base of the tables of a protocol. The docstring of a field is its description in the schema."""

    model_config = ConfigDict(use_attribute_docstrings=True)


class Speeds(ProtocolTable):
    """Speeds of the sweep, with strokes out and back at each speed."""

    table_name = "speed"
    list_m_s: Annotated[tuple[float, ...] | None, ListOf(SPEED, "log")] = None
    """one speed or a list; instead of from, to and count"""
    from_m_s: MaybeSpeed = None
    """lowest speed"""
    to_m_s: MaybeSpeed = None
    """highest speed"""
    count: Annotated[int | None, Whole(at_least=2)] = None
    """number of speeds, both ends included"""
    spacing: Literal["log", "linear"] = "log"
    """spacing of the speeds; those between the ends are rounded to 4 significant digits"""
    order: Literal["ascending", "descending", "up-and-down"] = "ascending"
    """order of the speeds; up-and-down measures each speed twice"""
    settled_time_s: DurationOrZero = 1.0
    """minimum total time at constant speed in each direction, reached by repeated strokes; 0 s: one stroke each"""
    most_strokes: Count = 20
    """largest number of these strokes"""
    return_speed_m_s: Speed = 0.1
    """speed of the return stroke if only one direction is measured"""

    @model_validator(mode="after")
    def _in_one_form(self) -> Speeds:
        ends = {"from": self.from_m_s, "to": self.to_m_s, "count": self.count}
        stated = [name for name, value in ends.items() if value is not None]
        if self.list_m_s is not None:
            if stated:
                raise wrong(f"speed.{stated[0]}", f"speed.list and speed.{stated[0]} cannot be given together")
            return self
        missing = [name for name in ends if name not in stated]
        if missing:
            raise wrong(
                f"speed.{missing[0]}",
                f"speed.{missing[0]} is missing",
                rule="give either list, or from, to and count",
                remedy='Write list = ["1 mm/s", ...], or from = "1 mm/s", to = "450 mm/s", count = 20.',
            )
        try:
            _ = self.levels_m_s
        except DescriptionError as error:
            raise wrong("speed.to", f"speed: {error.what}", rule=error.rule, remedy=error.remedy) from None
        return self

    @property
    def levels_m_s(self) -> tuple[float, ...]:
        """All speeds, ascending."""
        if self.list_m_s is not None:
            return self.list_m_s
        ends: Any = (self.from_m_s, self.to_m_s, self.count)  # without a list all are given
        return spaced(*ends, spacing=self.spacing, mark=SPEED)


class Pressures(ProtocolTable):
    """Pressures in the chambers, stated in one of three ways. If none is stated, both are open to ambient."""

    table_name = "pressure"
    both: MaybePressures = None
    """the same pressure in both chambers"""
    a: MaybePressures = None
    """chamber a; with b: every combination"""
    b: MaybePressures = None
    """chamber b"""
    pairs: Annotated[tuple[Pair, ...] | None, ListOf(PAIR, sorts=False, only_list=True)] = None
    """`[{ a = ..., b = ... }, ...]`"""
    settling_s: DurationOrZero = 5.0
    """wait after the rig has set a new pressure"""

    @model_validator(mode="after")
    def _in_one_form(self) -> Pressures:
        grid = self.a is not None or self.b is not None
        if (self.both is not None) + grid + (self.pairs is not None) > 1:
            raise wrong("pressure", "give only one: pressure.both, pressure.a with pressure.b, or pressure.pairs")
        if grid and (self.a is None or self.b is None):
            name = "a" if self.a is None else "b"
            raise wrong("pressure", f"pressure.{name} is missing", remedy=f'Add {name} = "0 bar gauge" for ambient.')
        return self

    @property
    def levels(self) -> tuple[Pair, ...]:
        """All pairs (a, b) in the given order. The pressure of chamber b changes fastest."""
        if self.pairs is not None:
            return self.pairs
        if self.both is not None:
            return tuple(Pair(p, p) for p in self.both)
        if self.a is not None and self.b is not None:
            return tuple(Pair(a, b) for a in self.a for b in self.b)
        return (VENTED,)


class Preconditioning(ProtocolTable):
    """Strokes that bring the contact to the same state before every stop."""

    table_name = "stop.preconditioning"
    strokes: CountOrNone = 3
    """full strokes out and back"""
    speed_m_s: Speed = 0.1
    """speed of these strokes and of every return stroke"""


class Stops(ProtocolTable):
    """Stops in the middle of a move: preconditioning strokes, an uninterrupted stroke, and the interrupted stroke."""

    table_name = "stop"
    durations_s: Annotated[tuple[float, ...], ListOf(Quantity("s", "s", MAY_LAST), "log")]
    """duration of the stop, a list or { from, to, count, spacing }; 0 s: no stop"""
    axis: Literal["held", "released", "both"] = "held"
    """held (the axis keeps its position), released (it moves until the force is zero), or both as a factor"""
    restart_speed_m_s: Annotated[tuple[float, ...], ListOf(SPEED, "log")] = (0.01,)
    """speed after the stop; a value or a list"""
    approach_speed_m_s: MaybeSpeed = None
    """speed before the stop; absent: the restart speed"""
    position: Annotated[tuple[AxisPosition, ...], ListOf(POSITION)] = Field(
        (AxisPosition(0.5, relative=True),),
        description='positions; a value or a list: "50 %" of the range, or "120 mm"',
    )
    approach_m: MaybeDistance = None
    """length of the move before the stop; absent: from the end of the range"""
    recovery_m: MaybeDistance = None
    """length of the move after the stop; absent: to the end of the range"""
    preconditioning: Preconditioning = Preconditioning()
    """table, see its own keys"""
    reference_strokes: CountOrNone = 1
    """uninterrupted strokes before the stop, over the same distance at the restart speed"""

    @property
    def released(self) -> tuple[bool, ...]:
        """States of the axis during the stops: False (held), True (released) or both."""
        return {"held": (False,), "released": (True,), "both": (False, True)}[self.axis]


class HardFactor(ProtocolTable):
    """Mounting, seal or drive, changed by hand between blocks. A run-in follows each change of seal or drive."""

    levels: Annotated[list[str], Field(min_length=1)]
    """names of the levels"""
    ask: str = ""
    """text of the request to the operator; {level} is replaced by the level"""
    time_s: Minutes = 1200.0
    """time of a change"""

    @model_validator(mode="after")
    def _distinct(self) -> HardFactor:
        within("count", len(self.levels), f"levels has {len(self.levels)} entries", DescriptionError)
        for index, level in enumerate(self.levels):
            if not level.strip() or level in self.levels[:index]:
                raise wrong("levels", f"levels: {level!r} is empty or occurs twice", rule="levels must differ")
        return self


class Order(ProtocolTable):
    """Order in which the points are run."""

    table_name = "order"
    kind: Literal["as-given", "randomised", "interleaved"] = Field(
        default="as-given",
        description="as-given: nested by pressure, then repeat, then speed; randomised: each repeat shuffled by the "
        "seed; interleaved: levels taken alternately from the lower and the upper half",
    )
    replicates: Count = 1
    """number of times that all blocks are run, each set up again; 2 or more separate the effects of level and block"""


class WarmUp(ProtocolTable):
    """Strokes before the points of each block."""

    table_name = "warm_up"
    cycles: CountOrNone = 10
    """strokes out and back before each block"""
    speed_m_s: Speed = 0.1
    """speed of these strokes"""
    run_in_cycles: CountOrNone = 0
    """additional strokes with a new seal or drive: in the first block and after a change"""


class SamplingTable(ProtocolTable):
    """Spacing of the samples. All samples are stored unfiltered."""

    table_name = "sampling"
    samples_per_stroke: Annotated[int, Whole(at_least=2, bound="samples")] = 5000
    """number of samples, evenly spaced in time over each stroke; the paper has about 5000 per cycle [bracha]"""
    burst_rate_hz: Annotated[float, Quantity("1/s", "Hz", marks.NOT_NEGATIVE)] = 5000.0
    """lowest sampling rate around each reversal and restart; 0 Hz: no bursts"""
    burst_before_s: DurationOrZero = 0.05
    """duration of a burst before the end of a move"""
    burst_after_s: DurationOrZero = 0.2
    """duration of a burst after the start of a move"""
    hold_rate_hz: Annotated[float, Quantity("1/s", "Hz", POSITIVE)] = 20.0
    """rate while the axis rests"""


class KnownWeight(ProtocolTable):
    """A weight that the operator hangs on the force sensor, with the drive uncoupled, to check the sensor's gain."""

    table_name = "before_block.known_weight"
    mass_kg: Annotated[float, Quantity("kg", "kg", POSITIVE)]
    """mass; the force is m g"""
    time_s: Duration = 10.0
    """duration of the recording with the weight"""
    change_s: Minutes = 120.0
    """time to attach the weight, and to remove it"""


class BeforeBlock(ProtocolTable):
    """Checks before the points of a block. A check whose key is absent is not made."""

    table_name = "before_block"
    tare_s: MaybeDuration = None
    """duration of a zero run of the force sensor: at rest, force released, vented"""
    known_weight: KnownWeight | None = None
    """table, see its own keys"""
    leak_check_s: MaybeDuration = None
    """duration of a leak check: at rest under the highest pressures of the protocol, supply shut"""
    blank_stroke_m_s: MaybeSpeed = None
    """speed of a vented stroke out and back, before and after the block"""


class Sentinel(ProtocolTable):
    """Control runs: strokes at a reference speed, repeated during a block and at both of its ends, to show drift."""

    table_name = "sentinel"
    speed_m_s: Speed
    """speed of the strokes out and back"""
    every: Count = 10
    """number of points between two control runs"""
    pressure: marks.MaybePressure = None
    """pressures of control runs; absent: the first pair of the protocol"""


class Filter(ProtocolTable):
    """Filters of the analysis; the files keep every raw sample."""

    table_name = "filter"
    average: Annotated[int, AVERAGE] = Field(default=1, description='moving average over this many samples, or "none"')
    ignore_initial: Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=50.0))] = 0.05
    """fraction of the samples at the beginning of each stroke that is ignored [bracha]"""


class Conditions(ProtocolTable):
    """Conditions for measuring. If one is not met, the campaign waits."""

    table_name = "conditions"
    supply_pressure: marks.MaybePressure = None
    """lowest supply pressure"""
    temperature_k: Annotated[tuple[float, float] | None, marks.Between("K", "degC")] = Field(
        default=None, description='range, "15 degC .. 30 degC"'
    )
    force_share: Annotated[float, Percent(bounds=Bounds(above=0.0, at_most=100.0))] = 0.9
    """fraction of the range of the force sensor at which a cycle is stopped"""


class Tightened(ProtocolTable):
    """Limits in addition to those of the rig; the tighter limit applies."""

    table_name = "limits"
    speed_m_s: MaybeSpeed = None
    """highest speed"""
    acceleration_m_s2: Annotated[float | None, Quantity("m/s^2", "m/s2", POSITIVE)] = None
    """highest acceleration that a move may reach"""
    force_n: Annotated[float | None, Quantity("N", "N", POSITIVE)] = None
    """largest force in either direction"""
    pressure: marks.MaybePressure = None
    """highest pressure in either chamber"""
    time_s: Duration = 28800.0
    """duration of the campaign above which the plan has a note"""


class Range(ProtocolTable):
    """Part of the stroke that the campaign uses."""

    table_name = "position"
    range: Annotated[tuple[AxisPosition, AxisPosition] | None, POSITIONS] = Field(
        None,
        description='"20 mm .. 280 mm", or "5 % .. 95 %" of the rig\'s range; absent: the range without the margin',
    )
    margin_m: Annotated[float, Quantity("m", "mm", marks.NOT_NEGATIVE)] = 1e-3
    """distance from the ends of the rig's range if `range` is absent"""


FOLDER = Path(__file__).with_name("protocols")


class Protocol(ProtocolTable):
    """A campaign as its file describes it; immutable. Values are in SI units, pressures abs or gauge as stated.

    Examples
    --------
    >>> protocol = read_protocol("paper-speed")
    >>> protocol.speed.levels_m_s[0]
    0.001
    """

    schema_version: Literal[1] = Field(default=1, alias="schema")
    """version of the file format"""
    name: str = "unnamed protocol"
    """name of the campaign"""
    about: str = ""
    """free text"""
    operator: str = ""
    """name of the person at the rig"""
    seed: Annotated[int, Whole(at_least=0, bound=None)] = 0
    """seed of the order and of a simulated rig"""
    repeats: Count = 1
    """repetitions of every point within each block"""
    directions: Literal["both", "+x", "-x"] = "both"
    """directions of sweeps and stops; x grows as chamber a grows"""
    labels: dict[str, str] = Field(default_factory=dict)
    """free text, kept with every result"""
    speed: Speeds | None = None
    pressure: Pressures = Pressures()
    stop: Stops | None = None
    mounting: HardFactor | None = None
    seal: HardFactor | None = None
    drive: HardFactor | None = None
    order: Order = Order()
    warm_up: WarmUp | None = None
    samples: SamplingTable = Field(default=SamplingTable(), alias="sampling")
    before_block: BeforeBlock = BeforeBlock()
    sentinel: Sentinel | None = None
    filter: Filter = Filter()
    adaptive: dict[str, Any] | None = None
    """key of earlier versions; has no effect"""
    conditions: Conditions = Conditions()
    limits: Tightened = Tightened()
    position: Range = Range()  # pyright: ignore[reportCallIssue] - its validator gives the range
    design: dict[str, Any] | None = None
    """key of earlier versions; has no effect"""
    fraction: dict[str, Any] | None = None
    """key of earlier versions; has no effect"""

    _text: str = PrivateAttr(default="")
    _origin: str = PrivateAttr(default="protocol")

    @model_validator(mode="after")
    def _measures(self) -> Protocol:
        if self.speed is None and self.stop is None:
            raise wrong(
                "speed",
                "the protocol measures nothing: neither [speed] nor [stop] is given",
                remedy='Add [speed] with from = "1 mm/s", to = "450 mm/s", count = 20.',
            )
        shuffled = self.order.kind != "as-given"
        if shuffled and self.speed is not None and "order" in self.speed.model_fields_set:
            raise wrong(
                "speed.order",
                f'speed.order = "{self.speed.order}" and order.kind = "{self.order.kind}" contradict each other',
                remedy='Leave out speed.order, or set [order] kind = "as-given".',
            )
        return self

    @property
    def hard(self) -> dict[str, HardFactor]:
        """Factors that are changed by hand; the first one is the hardest to change."""
        factors = {"drive": self.drive, "seal": self.seal, "mounting": self.mounting}
        return {name: factor for name, factor in factors.items() if factor is not None}

    @cached_property
    def sampling(self) -> Sampling:
        """Sampling of the cycles, as the argument of `Rig.acquire`."""
        return Sampling(**self.samples.stored())

    @property
    def origin(self) -> str:
        """File of the protocol."""
        return self._origin

    @property
    def text(self) -> str:
        """Text of the file, unchanged. It is generated for a protocol without a file."""
        return self._text or toml.write({"schema": self.schema_version} | self.to_dict())

    def fail(
        self,
        key: str,
        what: str,
        *,
        rule: str | None = None,
        remedy: str | None = None,
    ) -> ProtocolError:
        """Return an error that names the line of a key."""
        return toml.located(wrong(key, what, rule=rule, remedy=remedy), self._origin, self._text).turned(ProtocolError)


def read_protocol(source: str | Path) -> Protocol:
    """Read a protocol from a TOML file, or a ready protocol by its name.

    Parameters
    ----------
    source : path-like
        A file, or a name that `ready_protocols` lists; a file of that name takes precedence.

    Raises
    ------
    ProtocolError
        If the file is invalid; the message names file, line, value, rule and remedy.
    """
    path = Path(source)
    ready = ready_protocols()
    if not path.exists() and str(source) in ready:
        path = ready[str(source)]
    elif not path.exists() and path.parent == Path() and path.suffix != ".toml":
        raise ProtocolError(f"there is no protocol '{source}'", remedy=f"{nearest(str(source), ready)} Or name a file.")
    _, text = toml.read(path, ProtocolError, f"Ready protocols: {', '.join(ready)}.")
    return parse_protocol(text, str(path))


def parse_protocol(text: str, origin: str = "protocol") -> Protocol:
    """Read a protocol from TOML text; `origin` names it in messages.

    Raises
    ------
    ProtocolError
        As for `read_protocol`.
    """
    tables = toml.parse(text, origin, ProtocolError)
    with toml.locating(origin, text, ProtocolError):
        protocol = Protocol.model_validate(tables)
    protocol._text, protocol._origin = text, origin
    return protocol


def ready_protocols() -> dict[str, Path]:
    """Return name -> file of each ready protocol."""
    return {path.stem: path for path in sorted(FOLDER.glob("*.toml"))}


def protocol_schema() -> Plain:
    """Return the JSON schema (draft 2020-12) of a protocol."""
    schema = Protocol.model_json_schema(by_alias=True)
    measured = [{"required": ["speed"]}, {"required": ["stop"]}]
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "anyOf": measured}
