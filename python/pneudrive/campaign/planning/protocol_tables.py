"""The tables of a campaign protocol, one class each: SI inside, defaults assumed unless a source is named."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from pneudrive import units
from pneudrive.campaign.planning.protocol_values import (
    AMBIENT,
    BetweenPlaces,
    ListOf,
    MovingAverage,
    Place,
    PlaceMark,
    PressurePair,
    spaced,
)
from pneudrive.describe.base import Described
from pneudrive.describe.keys import wrong
from pneudrive.describe.marks import Between, Percent, Whole
from pneudrive.describe.quantities import Bounds, Quantity, StatedPressure
from pneudrive.errors import DescriptionError
from pneudrive.files.bounds import within

POSITIVE, NOT_NEGATIVE = Bounds(above=0.0), Bounds(at_least=0.0)
LASTS, MAY_LAST = Bounds(above=0.0, bound="seconds"), Bounds(at_least=0.0, bound="seconds")
SPEED, TIME, LENGTH, FORCE, RATE = ("m/s", "mm/s"), ("s", "s"), ("m", "mm"), ("N", "N"), ("1/s", "Hz")
SPEED_MARK = Quantity(*SPEED, POSITIVE)

Speed = Annotated[float, SPEED_MARK]
Time = Annotated[float, Quantity(*TIME, LASTS)]
Distance = Annotated[float, Quantity(*LENGTH, POSITIVE)]
Rate = Annotated[float, Quantity(*RATE, NOT_NEGATIVE)]
Count = Annotated[int, Whole()]
CountOrNone = Annotated[int, Whole(at_least=0)]
MaybeSpeed = Annotated[float | None, SPEED_MARK]
MaybeTime = Annotated[float | None, Quantity(*TIME, LASTS)]
MaybeDistance = Annotated[float | None, Quantity(*LENGTH, POSITIVE)]
MaybeForce = Annotated[float | None, Quantity(*FORCE, POSITIVE)]
MaybePressures = Annotated[tuple[units.Pressure, ...] | None, ListOf(StatedPressure(), "linear", sorts=False)]
MaybePressure = Annotated[units.Pressure | None, StatedPressure()]

Axis = Literal["held", "released"]
Pair = tuple[units.Pressure, units.Pressure]


class Speeds(Described):
    """Speeds of the sweep: out and back at each."""

    table_name: ClassVar[str] = "speed"
    list_m_s: Annotated[tuple[float, ...] | None, ListOf(SPEED_MARK, "log")] = Field(
        default=None, description="one speed or a list; instead of from, to and count"
    )
    from_m_s: MaybeSpeed = Field(default=None, description="lowest speed")
    to_m_s: MaybeSpeed = Field(default=None, description="highest speed")
    count: Annotated[int | None, Whole(at_least=2)] = Field(
        default=None, description="number of speeds, both ends included"
    )
    spacing: Literal["log", "linear"] = Field(
        default="log", description="speeds between the ends, rounded to 4 significant digits"
    )
    order: Literal["ascending", "descending", "up-and-down"] = Field(
        default="ascending", description="order of the speeds; up-and-down measures each speed twice"
    )
    settled_time_s: Annotated[float, Quantity(*TIME, MAY_LAST)] = Field(
        default=1.0,
        description="least time at constant speed in each direction, reached by repeated strokes; 0 s: one stroke each",
    )
    most_strokes: Count = Field(default=20, description="highest number of these repetitions")
    return_speed_m_s: Speed = Field(
        default=0.1, description="speed of the return stroke if only one direction is measured"
    )

    @model_validator(mode="after")
    def _one_form(self) -> Speeds:
        ends = {"from": self.from_m_s, "to": self.to_m_s, "count": self.count}
        given = [name for name, value in ends.items() if value is not None]
        if self.list_m_s is not None:
            if given:
                raise wrong(f"speed.{given[0]}", f"speed.list and speed.{given[0]} exclude each other")
            return self
        missing = [name for name in ends if name not in given]
        if missing:
            raise wrong(
                f"speed.{missing[0]}",
                f"speed.{missing[0]} is missing",
                rule="give either list, or from, to and count",
                remedy='Write list = ["1 mm/s", ...], or from = "1 mm/s", to = "450 mm/s", count = 20.',
            )
        self._spaced()
        return self

    def _spaced(self) -> tuple[float, ...]:
        assert self.from_m_s is not None
        assert self.to_m_s is not None
        assert self.count is not None
        try:
            return spaced(self.from_m_s, self.to_m_s, self.count, self.spacing, SPEED_MARK)
        except DescriptionError as error:
            raise wrong("speed.to", f"speed: {error.what}", rule=error.rule, remedy=error.remedy) from None

    @property
    def levels_m_s(self) -> tuple[float, ...]:
        """All speeds, ascending."""
        return self._spaced() if self.list_m_s is None else self.list_m_s


class Pressures(Described):
    """Pressures in the chambers, in exactly one of three ways; default: both open to ambient."""

    table_name: ClassVar[str] = "pressure"
    both: MaybePressures = Field(default=None, description="the same pressure in both chambers")
    a: MaybePressures = Field(default=None, description="chamber a; with b: every combination")
    b: MaybePressures = Field(default=None, description="chamber b")
    pairs: Annotated[tuple[Pair, ...] | None, ListOf(PressurePair(), sorts=False, only_list=True)] = Field(
        default=None, description="`[{ a = ..., b = ... }, ...]`"
    )
    settling_s: Annotated[float, Quantity(*TIME, MAY_LAST)] = Field(
        default=5.0, description="wait after the rig has set a new pressure"
    )

    @model_validator(mode="after")
    def _one_form(self) -> Pressures:
        grid = self.a is not None or self.b is not None
        if (self.both is not None) + grid + (self.pairs is not None) > 1:
            raise wrong("pressure", "pressure.both, a with b, and pairs exclude each other")
        for given, other, name in ((self.a, self.b, "b"), (self.b, self.a, "a")):
            if given is not None and other is None:
                raise wrong(
                    "pressure", f"pressure.{name} is missing", remedy=f'Add {name} = "0 bar gauge" for ambient.'
                )
        return self

    @property
    def levels(self) -> tuple[Pair, ...]:
        """All pairs (a, b) in the given order; chamber a changes last."""
        if self.pairs is not None:
            return self.pairs
        if self.both is not None:
            return tuple((p, p) for p in self.both)
        if self.a is not None and self.b is not None:
            return tuple((a, b) for a in self.a for b in self.b)
        return ((AMBIENT, AMBIENT),)


class Preconditioning(Described):
    """Strokes that bring the contact to the same state before every stop."""

    table_name: ClassVar[str] = "stop.preconditioning"
    strokes: CountOrNone = Field(default=3, description="full strokes out and back")
    speed_m_s: Speed = Field(default=0.1, description="speed of these strokes and of every return stroke")


class Stops(Described):
    """Stops in the middle of a move: preconditioning strokes, an uninterrupted stroke, the interrupted one."""

    table_name: ClassVar[str] = "stop"
    durations_s: Annotated[tuple[float, ...], ListOf(Quantity(*TIME, MAY_LAST), "log")] = Field(
        description="duration, a list or { from, to, count, spacing }; 0 s: not interrupted"
    )
    axis: Literal["held", "released", "both"] = Field(
        default="held",
        description="held: the axis keeps its position; released: it moves until the force is zero; both: a factor",
    )
    restart_speed_m_s: Annotated[tuple[float, ...], ListOf(SPEED_MARK, "log")] = Field(
        default=(0.01,), description="speed after the stop; a value or a list"
    )
    approach_speed_m_s: MaybeSpeed = Field(default=None, description="speed before the stop; absent: the restart speed")
    position: Annotated[tuple[Place, ...], ListOf(PlaceMark())] = Field(
        default=(Place(0.5, share=True),), description='positions; a value or a list: "50 %" of the range, or "120 mm"'
    )
    approach_m: MaybeDistance = Field(
        default=None, description="length of the move before the stop; absent: from the end of the range"
    )
    recovery_m: MaybeDistance = Field(
        default=None, description="length of the move after the stop; absent: to the end of the range"
    )
    preconditioning: Preconditioning = Field(default=Preconditioning(), description="see below")
    reference_strokes: CountOrNone = Field(
        default=1, description="uninterrupted strokes before the stop, over the same distance at the restart speed"
    )

    @property
    def released(self) -> tuple[bool, ...]:
        """Levels of the release of the force: False, True or both."""
        return {"held": (False,), "released": (True,), "both": (False, True)}[self.axis]


class HardFactor(Described):
    """A factor that is changed by hand, between blocks."""

    levels: Annotated[list[str], Field(min_length=1)] = Field(description="names of the levels")
    ask: str = Field(default="", description="text of the request to the operator; {level} is replaced by the level")
    time_s: Annotated[float, Quantity("s", "min", LASTS)] = Field(default=1200.0, description="time of a change")

    @model_validator(mode="after")
    def _distinct(self) -> HardFactor:
        within("count", len(self.levels), f"{self.table_name}.levels has {len(self.levels)} entries", DescriptionError)
        for index, level in enumerate(self.levels):
            if not level.strip() or level in self.levels[:index]:
                raise wrong(
                    f"{self.table_name}.levels",
                    f"{self.table_name}.levels: {level!r} is empty or occurs twice",
                    rule="levels differ",
                )
        return self


class Mounting(HardFactor):
    """Mounting of the drive on the rig."""

    table_name: ClassVar[str] = "mounting"


class Seal(HardFactor):
    """Seals in the drive; the run-in follows a change."""

    table_name: ClassVar[str] = "seal"


class DriveUnderTest(HardFactor):
    """Drive on the rig; the run-in follows a change."""

    table_name: ClassVar[str] = "drive"


class Order(Described):
    """Order in which the points are run."""

    table_name: ClassVar[str] = "order"
    kind: Literal["as-given", "randomised", "interleaved"] = Field(
        default="as-given",
        description="as-given: pressure, repeat, speed; randomised: each repeat shuffled by the seed; "
        "interleaved: levels taken alternately from the lower and the upper half",
    )
    replicates: Count = Field(
        default=1,
        description="runs of all blocks, each set up again; 2 or more separate the effects of level and block",
    )


class WarmUp(Described):
    """Strokes before the points of each block."""

    table_name: ClassVar[str] = "warm_up"
    cycles: CountOrNone = Field(default=10, description="strokes out and back before each block")
    speed_m_s: Speed = Field(default=0.1, description="their speed")
    run_in_cycles: CountOrNone = Field(
        default=0, description="additional strokes with a new seal or drive: in the first block and after a change"
    )


class SamplingTable(Described):
    """Spacing of the samples; all are kept unfiltered."""

    table_name: ClassVar[str] = "sampling"
    samples_per_stroke: Annotated[int, Whole(at_least=2, bound="samples")] = Field(
        default=5000, description="evenly spaced in time over each stroke; the paper has about 5000 a cycle [bracha]"
    )
    burst_rate_hz: Rate = Field(
        default=5000.0, description="lowest sampling rate around each reversal and restart; 0 Hz: no bursts"
    )
    burst_before_s: Annotated[float, Quantity(*TIME, MAY_LAST)] = Field(
        default=0.05, description="duration of a burst before the end of a move"
    )
    burst_after_s: Annotated[float, Quantity(*TIME, MAY_LAST)] = Field(
        default=0.2, description="duration of a burst after the start of a move"
    )
    hold_rate_hz: Annotated[float, Quantity(*RATE, POSITIVE)] = Field(
        default=20.0, description="rate while the axis rests"
    )


class KnownWeight(Described):
    """A weight that the operator hangs on the force sensor, without the drive, to check the gain of the sensor."""

    table_name: ClassVar[str] = "before_block.known_weight"
    mass_kg: Annotated[float, Quantity("kg", "kg", POSITIVE)] = Field(description="mass; the force is m g")
    time_s: Time = Field(default=10.0, description="duration of its recording")
    change_s: Annotated[float, Quantity("s", "min", LASTS)] = Field(
        default=120.0, description="time to attach the weight, and to remove it"
    )


class BeforeBlock(Described):
    """Checks before the points of a block; absent keys: no check."""

    table_name: ClassVar[str] = "before_block"
    tare_s: MaybeTime = Field(default=None, description="zero of the force sensor: standing, force released, vented")
    known_weight: KnownWeight | None = Field(default=None, description="see below")
    leak_check_s: MaybeTime = Field(
        default=None, description="standing under the highest pressures of the protocol, supply shut"
    )
    blank_stroke_m_s: MaybeSpeed = Field(
        default=None, description="speed of a stroke out and back, vented, before and after the block"
    )


class Sentinel(Described):
    """A reference speed that is repeated to show drift: at both ends of a block and in between."""

    table_name: ClassVar[str] = "sentinel"
    speed_m_s: Speed = Field(description="out and back at this speed")
    every: Count = Field(default=10, description="points between two of them")
    pressure: MaybePressure = Field(default=None, description="pressures; absent: the first pair of the protocol")


class Filter(Described):
    """Filters of the analysis; the files keep every raw sample."""

    table_name: ClassVar[str] = "filter"
    average: Annotated[int, MovingAverage()] = Field(
        default=1, description='moving average over this many samples, or "none"'
    )
    ignore_initial: Annotated[float, Percent(bounds=Bounds(at_least=0.0, below=50.0))] = Field(
        default=0.05, description="fraction of the samples at the beginning of each stroke that is ignored [bracha]"
    )


class Conditions(Described):
    """Conditions for measuring; outside them the campaign waits."""

    table_name: ClassVar[str] = "conditions"
    supply_pressure: MaybePressure = Field(default=None, description="least supply pressure")
    temperature_k: Annotated[tuple[float, float] | None, Between("K", "degC")] = Field(
        default=None, description='range, "15 degC .. 30 degC"'
    )
    force_share: Annotated[float, Percent(bounds=Bounds(above=0.0, at_most=100.0))] = Field(
        default=0.9, description="fraction of the range of the force sensor at which a cycle is stopped"
    )


class Tightened(Described):
    """Limits in addition to those of the rig; the tighter one applies."""

    table_name: ClassVar[str] = "limits"
    speed_m_s: MaybeSpeed = Field(default=None, description="highest speed")
    acceleration_m_s2: Annotated[float | None, Quantity("m/s^2", "m/s2", POSITIVE)] = Field(
        default=None, description="highest acceleration that a move may reach"
    )
    force_n: MaybeForce = Field(default=None, description="highest force, either sign")
    pressure: MaybePressure = Field(default=None, description="highest pressure in either chamber")
    time_s: Time = Field(default=28800.0, description="time of the campaign above which the plan has a note")


class Range(Described):
    """Part of the stroke that is used."""

    table_name: ClassVar[str] = "position"
    range: Annotated[tuple[Place, Place] | None, BetweenPlaces()] = Field(
        default=None,
        description='"20 mm .. 280 mm", or "5 % .. 95 %" of the rig\'s range; absent: the range without the margin',
    )
    margin_m: Annotated[float, Quantity(*LENGTH, NOT_NEGATIVE)] = Field(
        default=1e-3, description="distance from the ends of the rig's range if `range` is absent"
    )


class Fraction(Described):
    """Design points that are run; `pneudrive design` writes this table."""

    table_name: ClassVar[str] = "fraction"
    cells: Annotated[list[str], Field(min_length=1)] = Field(description="names of the design points")

    @model_validator(mode="after")
    def _distinct(self) -> Fraction:
        seen: set[str] = set()
        for cell in self.cells:
            if cell in seen:
                raise wrong("fraction.cells", f"fraction.cells: {cell!r} occurs twice")
            seen.add(cell)
        return self
