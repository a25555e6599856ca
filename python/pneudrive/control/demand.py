"""Whether a drive can follow a reference: the inverse of its model, run along the reference."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from pneudrive import _core
from pneudrive.control.motion import rounded_up
from pneudrive.control.references import beyond_stroke
from pneudrive.repr_tables import Card, Shown
from pneudrive.simulation.simulate import require

if TYPE_CHECKING:
    from pneudrive.control.motion import Reference
    from pneudrive.control.tuning import Tuning

#: Share of each limit up to which a reference is taken for feasible (assumed).
SHARE = 0.85
_PERIODS = 3.0  # periods of a sine that are checked, with the first one
_SEEN_S = 0.2  # behind the last move
_TRIES = 8  # margin of a suggested factor


class Demand(NamedTuple):
    """Largest demands of a reference on a drive.

    Attributes
    ----------
    valve_share : float
        Opening, of the full one; infinite where no opening gives the force.
    valve_at_s : float
    force_share : float
        Force of the air, of that at supply pressure against ambient.
    speed_share : float
        Of the steady speed at full opening.
    spool_rate_per_s : float
        Change of the opening in a second.
    lowest_pressure_pa, highest_pressure_pa : float
        In the chambers, absolute.
    """

    valve_share: float
    valve_at_s: float
    force_share: float
    speed_share: float
    spool_rate_per_s: float
    lowest_pressure_pa: float
    highest_pressure_pa: float


@dataclass(frozen=True, repr=False)
class Feasibility(Shown):
    """Whether a drive can follow a reference.

    Attributes
    ----------
    reference : Reference
    demand : Demand
        What it takes as it is.
    factor : float or None
        Least factor in time with which it takes at most 85 % of valve, force and speed; 1: as it is. None: none helps,
        for instance because it leaves the stroke.
    slowed : Demand or None
        What it takes then.
    stroke_m, speed_m_s : float
        Of the drive.
    left_out : tuple of str
        What the model does not know of the drive, see `Plant`: what it takes is in no share.
    """

    reference: Reference
    demand: Demand
    factor: float | None
    slowed: Demand | None
    stroke_m: float
    speed_m_s: float
    left_out: tuple[str, ...] = ()

    @property
    def is_feasible(self) -> bool:
        """Whether the unslowed reference stays within the stroke and uses at most 85 % of each limit."""
        return self.factor == 1.0

    def rows(self) -> list[tuple[str, str]]:
        """Return name and value with unit of each number."""
        reach, own = self.reference.reach(), self.demand
        low, high = (1e-5 * p for p in (own.lowest_pressure_pa, own.highest_pressure_pa))
        rows = [
            ("positions", f"{1e3 * reach.lowest_m:g} .. {1e3 * reach.highest_m:g} mm of {1e3 * self.stroke_m:g} mm"),
            (
                "largest speed",
                f"{reach.fastest_m_s:.3g} m/s at {reach.at_s:.3g} s, {100.0 * own.speed_share:.0f} % of the drive's",
            ),
            ("valve", f"{_percent(own.valve_share)} of its opening at {own.valve_at_s:.3g} s"),
            ("force", f"{_percent(own.force_share)} of the supply's; pressures {low:.3g} .. {high:.3g} bar abs"),
        ]
        if self.reference.points_missed_m is not None:
            rows.append(("points missed by", f"{1e6 * self.reference.points_missed_m:.3g} um at most"))
        without = [("left out", ", ".join(self.left_out))] if self.left_out else []
        return [*rows, *without, ("feasible", self._verdict())]

    def _verdict(self) -> str:
        limit = f"{100.0 * SHARE:.0f} % of each limit"
        if self.is_feasible:
            unknown = f"as far as the model goes, which leaves out {', '.join(self.left_out)}: "
            return f"yes{', ' + unknown if self.left_out else ': '}it takes at most {limit}"
        beyond = beyond_stroke(self.reference, self.stroke_m)
        if beyond is not None:
            return f"no: {beyond[0]}; {beyond[1]}"
        if self.factor is None:
            return f"no, however slow: it never takes less than {limit}"
        slower = self.reference.stretched(self.factor)
        written = "" if slower.pieces else f", as {slower.text}"  # polynomials have no text
        return f"no: {limit} would be kept if it were slower by {rounded_up(self.factor):g}{written}"

    def _card(self) -> Card:
        return Card(self.reference.text, rows=self.rows())


def _percent(share: float) -> str:
    return f"{100.0 * share:.0f} %" if share < 1e3 else "more than all"


def _asked(form: str, reference: Reference) -> tuple[dict[str, float], tuple[float, dict[str, float]] | None]:
    """Return the demands of a reference, the least factor in time, and the demands at this factor."""
    seen_s = (
        _PERIODS / reference.frequency_hz if reference.is_sine else reference.duration_s - reference.rest_s + _SEEN_S
    )
    return _core.control_feasibility(form, json.dumps(reference.core()), seen_s, SHARE)


def feasibility(tuning: Tuning, reference: Reference) -> Feasibility:
    """Return the demands of a reference on a drive, and how far it must be slowed.

    The inverse of the controller's model is run along the reference. The piston is at the reference. The gas is
    simulated under the opening that produces the required force.

    Parameters
    ----------
    tuning : Tuning
        From `pneudrive.control.tune`.
    reference : Reference

    Examples
    --------
    >>> import pneudrive as pn
    >>> tuning = pn.control.tune(pn.Drive.load("catalogue:reference"))
    >>> found = pn.control.feasibility(tuning, pn.control.reference("250 mm; 1 s: 400 mm in 0.1 s"))
    >>> found.is_feasible, found.factor > 1.0
    (False, True)
    """
    require(tuning, "plant", "tuning", "pn.control.tune(drive)")
    require(reference, "is_sine", "reference", 'pn.control.reference("250 mm; 1 s: 280 mm in 0.3 s")')
    plant, form = tuning.plant, json.dumps(tuning.core())
    told, slowed = _asked(form, reference)
    if beyond_stroke(reference, plant.stroke_m) is not None:
        slowed = None
    factor, taken = (None, None) if slowed is None else slowed
    for _ in range(_TRIES):  # after slowing and rounding, its peaks are between other steps
        if factor is None or factor == 1.0:
            break
        taken, more = _asked(form, reference.stretched(factor))
        if more is None or more[0] == 1.0:
            break
        factor *= more[0]
    return Feasibility(
        reference,
        Demand(**told),
        factor,
        None if taken is None else Demand(**taken),
        plant.stroke_m,
        plant.speed_m_s,
        tuple(plant.left_out),
    )
