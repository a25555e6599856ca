"""Choice of a controller for a drive: each is tried on the drive as described and with half of its mass."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.control.loop import prepare, run_prepared
from pneudrive.control.mismatch import Mismatch
from pneudrive.control.tuning import laws
from pneudrive.errors import PneudriveError

if TYPE_CHECKING:
    from pathlib import Path

    from pneudrive.control.setup import Setup
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive

#: Reference of the trial, the fraction of its way that the error may reach, and the masses that are tried (assumed).
ALONG, MOST, MASSES = "R3", 0.1, (1.0, 0.5)
BASELINES = ("pid", "fuzzy")
CYCLE = "limit-cycle"


class Suitability(NamedTuple):
    """Result of a controller on a drive.

    Attributes
    ----------
    law : str
    suits : bool
    max_error_m : float
        Largest error of the trials; infinite if one failed.
    reason : str
    """

    law: str
    suits: bool
    max_error_m: float
    reason: str


def suitability(drive: Drive | Circuit, setup: Setup | str | Path = "real", *, seed: int = 1) -> list[Suitability]:
    """Try each controller on a drive along R3, as described and with half of its mass; the best one comes first.

    Parameters
    ----------
    drive : Drive or Circuit
    setup : Setup, str or path-like
        Sensors and converter.
    seed : int
        Seed of the noise.
    """
    found = [_tried(drive, law, setup, seed) for law in laws()]
    return sorted(found, key=lambda one: (not one.suits, one.law in BASELINES, one.max_error_m))


def _tried(drive: Drive | Circuit, law: str, setup: Setup | str | Path, seed: int) -> Suitability:
    worst = 0.0
    for mass in MASSES:
        of = "as described" if mass == 1.0 else f"with {mass:g} of its mass"
        mismatch = None if mass == 1.0 else Mismatch.model_validate({"moving_mass": mass})
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                prepared = prepare(drive, law, ALONG, setup=setup, mismatch=mismatch)
                run = run_prepared(prepared, seed)
        except PneudriveError as error:
            return Suitability(law, False, float("inf"), f"{of}: {error.what}")
        score, events = run.provenance["score"], run.provenance["events"]
        reach = prepared.reference.reach()
        worst = max(worst, float(score["max_error_m"]))
        if score["lost"]:
            return Suitability(law, False, worst, f"{of} it is lost")
        if any(event["kind"] == CYCLE for event in events) and law not in BASELINES:
            return Suitability(law, False, worst, f"{of} it oscillates")
        if worst > MOST * (reach.highest_m - reach.lowest_m):
            return Suitability(law, False, worst, f"{of} it misses by {1e3 * worst:.3g} mm")
    reason = f"errors up to {1e3 * worst:.3g} mm"
    return Suitability(law, True, worst, f"a baseline: {reason}" if law in BASELINES else reason)
