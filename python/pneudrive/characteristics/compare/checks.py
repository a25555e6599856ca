"""Whether two campaigns can be compared at all: what rig and protocol should share."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import ZERO_CELSIUS_K

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from pneudrive.characteristics.result import CampaignCharacteristics

#: Shares by which values may differ, and differences that do no harm (assumed).
STIFFNESS_SHARE, AREA_SHARE, MASS_SHARE, RATE_SHARE = 0.1, 0.005, 0.1, 0.25
AMBIENT_PA, TEMPERATURE_K = 2000.0, 3.0


@dataclass(frozen=True)
class Check:
    """Something about rig or protocol that both campaigns should share.

    Attributes
    ----------
    what, first, second : str
    comparable : bool
    consequence : str
        What follows where it differs.
    """

    what: str
    first: str
    second: str
    comparable: bool
    consequence: str = ""


def checks_of(
    first: CampaignCharacteristics, second: CampaignCharacteristics, about: dict[str, Any], other: dict[str, Any]
) -> Iterator[Check]:
    """Hold rigs and protocols of two campaigns against each other."""
    yield from _rigs(first, second)
    yield from _protocols(first, second, about, other)


def _check(what: str, words: Sequence[str], comparable: bool, consequence: str) -> Check:
    return Check(what, words[0], words[1], comparable, consequence)


def _rigs(first: CampaignCharacteristics, second: CampaignCharacteristics) -> Iterator[Check]:
    a, b = both = first.identity, second.identity
    made = ["simulated" if i.synthetic else "real" for i in both]
    yield _check("data", made, a.synthetic == b.synthetic, "a simulated rig against a real one")
    names = (a.name, b.name)
    yield _check("rig", names, a.name == b.name, "other sensors: their gains may differ by what is stated")
    stiff = [f"{i.stiffness_n_m:.3g} N/m" if i.stiffness_n_m else "not told" for i in both]
    same = _near(a.stiffness_n_m, b.stiffness_n_m, STIFFNESS_SHARE)
    yield _check("stiffness", stiff, same, "stick-slip starts at other speeds, breakaway peaks are cut otherwise")
    for side in ("a", "b"):
        areas = [getattr(i, f"area_{side}_m2") for i in both]
        words = [f"{1e4 * v:.4g} cm²" for v in areas]
        same = _near(areas[0], areas[1], AREA_SHARE)
        yield _check(f"area {side}", words, same, "another bore: friction scales with it")
    masses = [i.mass_beyond_sensor_kg for i in both]
    same = _near(masses[0], masses[1], MASS_SHARE)
    words = [f"{m:.3g} kg" for m in masses]
    yield _check("mass beyond the sensor", words, same, "inertia adds to breakaway peaks otherwise")
    chambers = (a.chambers, b.chambers)
    yield _check("chambers", chambers, a.chambers == b.chambers, "the air pushes otherwise at high speed")
    places = (a.pressure_measured_at, b.pressure_measured_at)
    yield _check("pressure measured at", places, places[0] == places[1], "the air is in one curve, not in the other")
    ambient = [i.ambient_pressure_pa for i in both]
    same = abs(ambient[0] - ambient[1]) < AMBIENT_PA
    words = [f"{p / 1e5:.4g} bar abs" for p in ambient]
    yield _check("ambient pressure", words, same, "equal gauge pressures are no equal pressures")


def _protocols(
    first: CampaignCharacteristics, second: CampaignCharacteristics, about: dict[str, Any], other: dict[str, Any]
) -> Iterator[Check]:
    chosen = (first.protocol, second.protocol)
    yield _check("samples that count", chosen, chosen[0] == chosen[1], "means are taken over other parts of a stroke")
    filters = [_filter(x) for x in (about, other)]
    yield _check("filter", filters, filters[0] == filters[1], "peaks are cut otherwise: do not compare breakaway")
    warm = [sum(found.ranges.temperature_k) / 2.0 - ZERO_CELSIUS_K for found in (first, second)]
    if all(np.isfinite(warm)):
        same = abs(warm[0] - warm[1]) < TEMPERATURE_K
        words = [f"{t:.1f} °C" for t in warm]
        yield _check("temperature", words, same, "grease and seal soften when warm: part of a difference may be that")
    rates = [_rate(found) for found in (first, second)]
    if all(np.isfinite(rates)):
        same = _near(rates[0], rates[1], RATE_SHARE)
        yield _check("samples at restarts", [f"{r:.3g} Hz" for r in rates], same, "sharp peaks are cut otherwise")


def _near(a: float | None, b: float | None, share: float) -> bool:
    if a is None or b is None:
        return a is b
    return abs(a - b) <= share * max(abs(a), abs(b))


def _filter(about: dict[str, Any]) -> str:
    stated = about.get("filter")
    average = stated.get("average", 1) if isinstance(stated, dict) else 1
    return "none" if average == 1 else f"moving average of {average}"


def _rate(found: CampaignCharacteristics) -> float:
    known = [s.sample_rate_hz for s in found.stops if np.isfinite(s.sample_rate_hz)]
    return float(np.median(known)) if known else float("nan")
