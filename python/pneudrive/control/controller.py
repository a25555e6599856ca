"""Controller file: a law, its period, its gains, its model of the drive, and its holding."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_validator

from pneudrive import _core, own_code, units
from pneudrive.control.setup import BuiltInLaw, ControlLimits, MotionComplete, OnFault, Supervision
from pneudrive.describe.base import Described
from pneudrive.describe.keys import WrongValueError, wrong
from pneudrive.describe.marks import Bounds, Length, Quantity, Reads

#: Of a controller whose file says nothing; both assumed.
PERIOD_S, BAND_M, AFTER_S = 1e-3, 30e-6, 20e-3


class HoldBand(Described):
    """Holding: after the reference has stopped and the error stays in the band, the force of the air is kept."""

    table_name: ClassVar[str] = "hold"
    band_m: Length = Field(default=BAND_M, description="error below which it begins")
    after_s: Annotated[float, Quantity("s", "ms", Bounds(at_least=0.0))] = Field(
        default=AFTER_S, description="how long the error has to be within the band"
    )

    def core(self) -> dict[str, float]:
        """Return it in the core's form, SI."""
        return {"band_m": self.band_m, "after_s": self.after_s}


def _hold(given: Any) -> HoldBand | None:  # noqa: ANN401 - of any type
    if given is False or given is None:
        return None
    if isinstance(given, HoldBand):
        return given
    if not isinstance(given, dict):
        raise WrongValueError(f"{given!r} is not a table", remedy='Write [hold] band = "30 um", or hold = false.')
    return HoldBand.model_validate(given)  # type: ignore[return-value]


def _numbers(table: str) -> Reads:
    def read(given: Any) -> dict[str, Any]:  # noqa: ANN401 - of any type
        if not isinstance(given, dict):
            raise WrongValueError(f"{given!r} is not a table", remedy=f"Write [{table}], then a line for each number.")
        return dict(given)

    return Reads(read)


_Factor = Annotated[float, Quantity("", bounds=Bounds(at_least=0.1, at_most=10.0))]


class Factors(Described):
    """Factors of a law's gains, 0.1 to 10. The core defines which gain each of them multiplies.

    Examples
    --------
    >>> Factors(gain=2.0).values
    (2.0, 1.0, 1.0)
    """

    table_name: ClassVar[str] = "factors"
    gain: _Factor = Field(default=1.0, description="k_p of pid and fuzzy, the bandwidth of others")
    damping: _Factor = Field(default=1.0, description="T_d of pid and fuzzy, what makes others calmer")
    filter: _Factor = Field(default=1.0, description="filter time of pid and fuzzy")

    @property
    def values(self) -> tuple[float, float, float]:
        """The three in the core's order."""
        return self.gain, self.damping, self.filter


#: Factors that change nothing.
USUAL_FACTORS = Factors()


#: Removed tables of a controller file: key, the values that change nothing, and what to do about others.
REMOVED_TABLES = {
    "nmpc": ("predictor", "model", "The predictor circuit was removed. Leave the table out: the model is used."),
    "observer": ("kind", "kalman", "The observers levant and lugre were removed. Leave the table out: kalman is used."),
    "fuzzy": ("inference", "sugeno", "The inference mamdani was removed. Leave the table out: sugeno is used."),
}


class LawWord(BuiltInLaw):
    """Annotation of a field for a controller: its key, or the name of code, ``mine.py:Law``."""

    def read(self, given: object) -> str:
        """Check the word."""
        if isinstance(given, str) and (given == "own" or own_code.split(given) is not None):
            return given
        return super().read(given)


class Controller(Described):
    """A controller as its file describes it.

    Gains and valve parameters have units. `pneudrive.control.tune` reads them, because the core lists them by
    controller and valves. Values that are left out are derived from the drive.

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
    drive: str | None = Field(default=None, description="what the law believes; absent: the drive it is run on")
    adaptation: bool = Field(
        default=True, strict=True, description="it learns friction, mass and valve of its drive while it runs"
    )
    factors: Factors = USUAL_FACTORS
    gains: Annotated[dict[str, Any], _numbers("gains")] = Field(default_factory=dict)
    valves: Annotated[dict[str, Any], _numbers("valves")] = Field(default_factory=dict)
    hold: Annotated[HoldBand | None, Reads(_hold)] = Field(default=HoldBand(), description="false: it never holds")
    limits: ControlLimits = ControlLimits()
    motion: MotionComplete = MotionComplete()
    on_fault: OnFault = OnFault()

    @model_validator(mode="before")
    @classmethod
    def _without_removed_tables(cls, given: Any) -> Any:  # noqa: ANN401 - of any type
        if not isinstance(given, dict):
            return given
        for table, (key, usual, remedy) in REMOVED_TABLES.items():
            numbers = given.get(table, {key: usual})
            if numbers != {key: usual}:
                raise wrong(table, f"the table [{table}] is not known", remedy=remedy)
        return {key: value for key, value in given.items() if key not in REMOVED_TABLES}

    @property
    def supervision(self) -> Supervision:
        """Its supervisor."""
        return Supervision(self.limits, self.motion, self.on_fault)


def gain_quantity(unit: str) -> Quantity:
    """Return the annotation of a gain with a unit of the core; bounds are the core's."""
    return Quantity(units.si_name(unit))
