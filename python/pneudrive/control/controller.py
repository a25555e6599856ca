"""Controller file: a law, its period, its gains, what it believes of the drive, and how it stands still."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field

from pneudrive import _core, own_code, units
from pneudrive.control.supervision import ControlLimits, MotionComplete, OnFault, Supervision
from pneudrive.describe.base import Bounds, Described, Length, Quantity, WrongValueError
from pneudrive.describe.marks import Choice, Reads

#: Of a controller whose file says nothing; both assumed.
PERIOD_S, BAND_M, AFTER_S = 1e-3, 30e-6, 20e-3


class HoldBand(Described):
    """Standing still: once the reference stands and the error stays in the band, the force of the air is kept."""

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


class LawWord(Choice):
    """Annotation of a field for a law: a word, or the name of code, ``mine.py:Law``."""

    def read(self, given: object) -> str:
        """Check the word."""
        if isinstance(given, str) and (given == "own" or own_code.split(given) is not None):
            return given
        return super().read(given)


class Controller(Described):
    """A controller as its file describes it.

    Gains, and numbers of the observer and of several or switching valves, have their units; they are read by
    `pneudrive.control.tune`, because the core lists them by law, observer and valves. Those that are left out follow
    from the drive.

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
    adaptation: bool = Field(default=True, description="it learns friction, mass and valve of its drive while it runs")
    gains: Annotated[dict[str, Any], _numbers("gains")] = Field(default_factory=dict)
    valves: Annotated[dict[str, Any], _numbers("valves")] = Field(default_factory=dict)
    observer: Annotated[dict[str, Any], _numbers("observer")] = Field(
        default_factory=dict, description="kind: kalman or lugre, and its numbers"
    )
    hold: Annotated[HoldBand | None, Reads(_hold)] = Field(default=HoldBand(), description="false: it never holds")
    limits: ControlLimits = ControlLimits()
    motion: MotionComplete = MotionComplete()
    on_fault: OnFault = OnFault()

    @property
    def supervision(self) -> Supervision:
        """Its supervisor."""
        return Supervision(self.limits, self.motion, self.on_fault)


def gain_quantity(unit: str) -> Quantity:
    """Return the annotation of a gain with a unit of the core; bounds are the core's."""
    return Quantity(units.si_name(unit))
