"""Score of a platform along a path of its pose."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from pneudrive.repr_tables import Card, Shown

if TYPE_CHECKING:
    from collections.abc import Mapping


class Tracked(NamedTuple):
    """Error of one coordinate or leg, reference less actual value; m or rad.

    Attributes
    ----------
    unit : str
        m or rad.
    rmse, max_error : float
        Root of the mean square, and largest size.
    amplitude : float
        Half of the range of the reference.
    """

    unit: str
    rmse: float
    max_error: float
    amplitude: float

    @property
    def percent(self) -> float:
        """Root of the mean square in percent of the amplitude; NaN if the reference stands."""
        return 100.0 * self.rmse / self.amplitude if self.amplitude > 0.0 else float("nan")

    def error(self) -> str:
        """Return the root of the mean square in percent of the amplitude, or with its unit if the reference stands."""
        return self._written(self.rmse) if np.isnan(self.percent) else f"{self.percent:.3g} %"

    def row(self, name: str) -> tuple[str, str, str, str]:
        """Return name and values with units."""
        share = "" if np.isnan(self.percent) else f"{self.percent:.3g} %"
        return name, self._written(self.rmse), share, self._written(self.max_error)

    def _written(self, value: float) -> str:
        return f"{1e6 * value:.3g} um" if self.unit == "m" else f"{np.degrees(1e3 * value):.3g} mdeg"


@dataclass(frozen=True, repr=False)
class PoseScore(Shown):
    """Score of a platform along a path. A path that repeats is scored in its last 4 s or its last period.

    Attributes
    ----------
    coordinates, legs : dict
        Name -> `Tracked`.
    air_per_cycle_anr_m3 : float or None
        Air from the reservoirs in a period, as volume at the standard reference atmosphere; None: nothing repeats.
    air_anr_m3_s : float
    saturated_share : float
        Largest fraction of the samples of a leg with the command at its limit.
    stops_hit : int
        Legs that reached an end of their stroke.
    singular_value, force_share, speed_share : float
        Smallest singular value of the path, and its largest fractions of the force of the supply and of the speed.
    payload_spread : dict
        Payload -> name of a coordinate -> `Tracked`, where several payloads are run.
    """

    coordinates: dict[str, Tracked]
    legs: dict[str, Tracked]
    air_per_cycle_anr_m3: float | None
    air_anr_m3_s: float
    saturated_share: float
    stops_hit: int
    singular_value: float
    force_share: float
    speed_share: float
    payload_spread: dict[str, dict[str, Tracked]]

    def to_dict(self) -> dict[str, Any]:
        """Return all measures by name."""
        return asdict(self) | {
            "coordinates": {name: one._asdict() for name, one in self.coordinates.items()},
            "legs": {name: one._asdict() for name, one in self.legs.items()},
            "payload_spread": {
                payload: {name: one._asdict() for name, one in each.items()}
                for payload, each in self.payload_spread.items()
            },
        }

    @classmethod
    def read(cls, score: Mapping[str, Any]) -> PoseScore:
        """Read the score in the attributes of a run.

        Parameters
        ----------
        score : dict
            As `to_dict` returns it.
        """

        def tracked(each: Mapping[str, Any]) -> dict[str, Tracked]:
            return {name: Tracked(**one) for name, one in each.items()}

        spread = {payload: tracked(each) for payload, each in score["payload_spread"].items()}
        errors = {key: tracked(score[key]) for key in ("coordinates", "legs")}
        return cls(**{**score, **errors, "payload_spread": spread})

    def table(self) -> list[tuple[str, ...]]:
        """Return a row for each coordinate and leg: RMS error, fraction of the amplitude, largest error."""
        each = [*self.coordinates.items(), *self.legs.items()]
        return [("", "RMSE", "of amplitude", "largest error"), *(one.row(name) for name, one in each)]

    def spread(self) -> list[tuple[str, ...]]:
        """Return a row for each payload with the RMS error of each coordinate, and the range over the payloads."""
        if not self.payload_spread:
            return []
        each = list(self.payload_spread.values())
        rows = [("payload", *self.coordinates)]
        rows += [(payload, *(one.error() for one in own.values())) for payload, own in self.payload_spread.items()]
        ends = [[own[name].rmse for own in each] for name in self.coordinates]
        ranges = (
            each[0][name]._replace(rmse=max(own) - min(own)) for name, own in zip(self.coordinates, ends, strict=True)
        )
        return [*rows, ("spread", *(one.error() for one in ranges))]

    def notes(self) -> list[str]:
        """Return the other measures as sentences."""
        air = f"air {1e3 * self.air_anr_m3_s:.3g} l/s ANR"
        if self.air_per_cycle_anr_m3 is not None:
            air += f", {1e3 * self.air_per_cycle_anr_m3:.3g} l ANR per cycle"
        return [
            air,
            f"smallest singular value {self.singular_value:.3g}, largest force {100.0 * self.force_share:.0f} % of the "
            f"supply's, largest speed {100.0 * self.speed_share:.0f} % of a leg's",
            f"saturated {100.0 * self.saturated_share:.2g} %, stops hit: {self.stops_hit}",
        ]

    def to_csv(self) -> str:
        """Return RMS and largest error, m or rad, and RMS in percent of the amplitude, of each coordinate and leg."""
        lines = ["name,unit,rmse,max_error,amplitude,percent"]
        for name, one in [*self.coordinates.items(), *self.legs.items()]:
            lines.append(f"{name},{one.unit},{one.rmse!r},{one.max_error!r},{one.amplitude!r},{one.percent!r}")
        return "\n".join([*lines, ""])

    def _card(self) -> Card:
        head, *rows = self.table()
        return Card("score of a pose, simulated", head, rows, self.notes())
