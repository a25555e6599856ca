"""Comparability of two campaigns: required common properties of rig and protocol (checks.toml)."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.constants import ZERO_CELSIUS_K
from pneudrive.describe.files.toml import read
from pneudrive.friction.conditions import PA_PER_BAR

if TYPE_CHECKING:
    from collections.abc import Iterator

    from pneudrive.friction.campaign.result import CampaignCharacteristics

TABLE = Path(__file__).with_name("checks.toml")


@dataclass(frozen=True)
class Check:
    """A property of rig or protocol that both campaigns should share.

    Attributes
    ----------
    what, first, second : str
    comparable : bool
    consequence : str
        Consequence of a difference.
    """

    what: str
    first: str
    second: str
    comparable: bool
    consequence: str = ""


def checks_of(
    first: CampaignCharacteristics, second: CampaignCharacteristics, about: dict[str, Any], other: dict[str, Any]
) -> Iterator[Check]:
    """Compare rigs and protocols of two campaigns."""
    one, two = _shared(first, about), _shared(second, other)
    for what, row in read(TABLE)[0].items():
        a, b = one[what], two[what]
        if isinstance(a, float) and isinstance(b, float):
            if not np.isfinite([a, b]).all():
                continue
            same = abs(a - b) <= max(row.get("share", 0.0) * max(abs(a), abs(b)), row.get("by", 0.0))
        else:
            same = a == b
        form = row.get("written", "{}")
        words = ["not stated" if v is None else form.format(v) for v in (a, b)]
        yield Check(what, words[0], words[1], same, row["consequence"])


def _shared(found: CampaignCharacteristics, about: dict[str, Any]) -> dict[str, str | float | None]:
    """Return the compared values; NaN if not measured."""
    rig = found.identity
    rates = [s.sample_rate_hz for s in found.stops if np.isfinite(s.sample_rate_hz)]
    stated = about.get("filter")
    average = stated.get("average", 1) if isinstance(stated, dict) else 1
    return {
        "data": "simulated" if rig.synthetic else "real",
        "rig": rig.name,
        "stiffness": rig.stiffness_n_m or None,
        "area a": 1e4 * rig.area_a_m2,
        "area b": 1e4 * rig.area_b_m2,
        "mass beyond the sensor": rig.mass_beyond_sensor_kg,
        "chambers": rig.chambers,
        "pressure measured at": rig.pressure_measured_at,
        "ambient pressure": rig.ambient_pressure_pa / PA_PER_BAR,
        "samples that count": found.protocol,
        "filter": "none" if average == 1 else f"moving average of {average}",
        "temperature": sum(found.ranges.temperature_k) / 2.0 - ZERO_CELSIUS_K,
        "samples at restarts": float(np.median(rates)) if rates else float("nan"),
    }
