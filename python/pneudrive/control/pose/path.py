"""Path of a platform's pose: a sine, circle, square or moves for each coordinate."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from pydantic import TypeAdapter

from pneudrive.arrays import Array, Keyed, Plain
from pneudrive.control.motion import NUMBER, REST_S, SINE_PERIODS, SINE_S, Reference, ReferenceMove, moves_of_text
from pneudrive.control.scores import LOST_M, event_table, run_title
from pneudrive.describe.files import toml
from pneudrive.errors import DescriptionError, PneudriveError, invalid, nearest, wrong
from pneudrive.platforms import Platform
from pneudrive.repr_tables import Card, Shown
from pneudrive.views import Finding, ShownTable, ShownValue, View, Viewed

FORMS = (
    '"sine 30 mm 0.5 Hz around 470 mm", "circle 5 deg 0.5 Hz", "square 20 mm 0.5 Hz in 0.2 s", or moves, '
    '"450 mm; 1 s: 470 mm in 0.3 s; 2 s: 450 mm in 0.3 s; every 3 s"'
)
_WAVE = re.compile(
    rf"(sine|circle|square)\s+({NUMBER})\s+({NUMBER})(?:\s+in\s+({NUMBER}))?(?:\s+around\s+({NUMBER}))?",
    re.IGNORECASE,
)
_EVERY = re.compile(rf";\s*every\s+({NUMBER})\s*$", re.IGNORECASE)


class CoordinatePath(NamedTuple):
    """Motion of one coordinate.

    Attributes
    ----------
    kind : str
        sine, circle, square or moves.
    centre : float
        First value, m or rad; for a sine and a circle, the mean.
    period_s : float
        Infinite for moves that are not repeated.
    moves : tuple of ReferenceMove
        Moves of a period, also of a square.
    amplitude : float
        Amplitude of a sine or a circle, m or rad.
    leads : bool
        Whether this is the first coordinate of a circle or a square, which leads the second by a quarter of a period.
    """

    kind: str
    centre: float
    period_s: float = math.inf
    moves: tuple[ReferenceMove, ...] = ()
    amplitude: float = 0.0
    leads: bool = False

    def at(self, times_s: Array) -> Array:
        """Return the coordinate and two derivatives as rows. A sine reaches its full amplitude within a period."""
        if not self.amplitude:
            last = 0 if math.isinf(self.period_s) else int(times_s.max(initial=0.0) / self.period_s)
            shifts = [0.0, *(k * self.period_s for k in range(1, last + 1))]
            moves = tuple(move._replace(begin_s=move.begin_s + shift) for shift in shifts for move in self.moves)
            return Reference("", self.centre, moves).at(times_s).T[:3]
        b, b1, b2, _ = Reference("", 0.0, (ReferenceMove(0.0, self.period_s, 1.0),)).at(times_s).T
        w = 2.0 * math.pi / self.period_s
        angle = w * times_s + (0.5 * math.pi if self.leads else 0.0)
        s, s1, s2 = np.sin(angle), w * np.cos(angle), -w * w * np.sin(angle)
        grown = np.stack([b * s, b1 * s + b * s1, b2 * s + 2.0 * b1 * s1 + b * s2])
        return self.amplitude * grown + np.array([[self.centre], [0.0], [0.0]])

    def leading(self) -> CoordinatePath:
        """Return this coordinate of a circle or a square, a quarter of a period earlier."""
        earlier = (move._replace(begin_s=move.begin_s - 0.25 * self.period_s) for move in self.moves[1:])
        return self._replace(moves=tuple(earlier), leads=True)


@dataclass(frozen=True, repr=False)
class PosePath(Shown):
    """Path of the pose of a platform over time.

    Attributes
    ----------
    text : str
        Name of the file, or the texts of the coordinates.
    coordinates : tuple of str
    lines : tuple of CoordinatePath
    """

    text: str
    coordinates: tuple[str, ...]
    lines: tuple[CoordinatePath, ...]

    @property
    def period_s(self) -> float | None:
        """Longest period of a coordinate, or None if nothing is repeated."""
        periods = [line.period_s for line in self.lines if not math.isinf(line.period_s)]
        return max(periods, default=None)

    @property
    def duration_s(self) -> float:
        """Default duration of a run: the longer of 16 s and four periods, or until 2 s after the last move."""
        if self.period_s is not None:
            return max(SINE_S, SINE_PERIODS * self.period_s)
        return max((line.moves[-1].end_s for line in self.lines if line.moves), default=0.0) + REST_S

    def at(self, times_s: Array) -> Array:
        """Return coordinates (m, rad) and two derivatives at times (s), with the shape (3, times, coordinates)."""
        times = np.ascontiguousarray(times_s, dtype=float)
        return np.stack([line.at(times) for line in self.lines], axis=-1)

    def _card(self) -> Card:
        rows = [(key, str(line)) for key, line in zip(self.coordinates, self.lines, strict=True)]
        return Card(f"Path of a pose, {self.text}", rows=rows)


def pose_path(given: PosePath | Mapping[str, str] | str | Path, platform: Platform) -> PosePath:
    """Read the path of a pose.

    Parameters
    ----------
    given : PosePath, mapping, str or path-like
        A TOML file or a mapping with one text for each coordinate: a sine ``"sine 30 mm 0.5 Hz around 470 mm"``; a
        circle of two coordinates, ``"circle 5 deg 0.5 Hz"`` at each; a square of two coordinates with blended edges,
        ``"square 20 mm 0.5 Hz in 0.2 s"`` at each; moves, ``"450 mm; 1 s: 470 mm in 0.3 s; every 2 s"``. The default of
        a coordinate or a centre is its value with all legs at mid stroke.
    platform : Platform

    Raises
    ------
    DescriptionError
        The file or a line is not valid; the message gives file, line, value, rule and remedy.
    """
    if isinstance(given, PosePath):
        return given
    text: str | None = None
    if isinstance(given, (str, Path)):
        remedy = 'For instance heave = "sine 30 mm 0.5 Hz around 470 mm".'
        if Path(given).suffix.lower() != ".toml":
            raise DescriptionError.of("control.not_of_platform", given=given, remedy=remedy)
        tables, text = toml.read(str(given), start=remedy)
        name = str(given)
    else:
        tables = dict(given)
        name = "; ".join(f"{key}: {line}" for key, line in given.items())
    with toml.locating(name, text):
        tables.pop("schema", None)
        unknown = next((key for key in tables if key not in platform.coordinates), None)
        if unknown is not None:
            names = {"of": platform.name, "coordinates": ", ".join(platform.coordinates)}
            remedy = nearest(unknown, platform.coordinates)
            raise invalid(unknown, "control.coordinate", key=unknown, **names, remedy=remedy)
        lines, key = {}, ""
        try:
            for key, unit, home in zip(platform.coordinates, platform.units, platform.home, strict=True):
                lines[key] = _line(tables.get(key), unit, float(home))
        except PneudriveError as error:
            raise wrong(key, f"{key}: {error.what}", rule=error.rule, remedy=f"Give {FORMS}.") from None
        for kind in ("circle", "square"):
            keys = [key for key, line in lines.items() if line.kind == kind]
            if len(keys) not in (0, 2):
                raise invalid(keys[0], "control.pair", key=keys[0], kind=kind, count=len(keys))
            lines |= {key: lines[key].leading() for key in keys[:1]}
        return PosePath(name, platform.coordinates, tuple(lines.values()))


def _line(given: object, unit: str, home: float) -> CoordinatePath:
    """Read the text of one coordinate, whose unit is m or rad."""
    from pneudrive import units

    if given is None:
        return CoordinatePath("moves", home)
    if not isinstance(given, str):
        raise DescriptionError(f"{given!r} is not a text")
    text = given.strip()
    wave = _WAVE.fullmatch(text)
    if wave is not None:
        kind = wave[1].lower()
        amplitude, frequency = units.parse(wave[2], unit), units.parse(wave[3], "1/s")
        for name, value in (("amplitude", amplitude), ("frequency", frequency)):
            if not value > 0.0:
                raise DescriptionError(f"the {name} is {value:g}", rule="greater than 0")
        centre = home if wave[5] is None else units.parse(wave[5], unit)
        edge = 0.0 if wave[4] is None else units.parse(wave[4], "s")
        longest = 0.25 / frequency
        if (kind == "square") != (wave[4] is not None) or (kind == "square" and not 0.0 < edge <= longest):
            raise DescriptionError.of("control.edges", text=text, longest=longest)
        if kind != "square":
            return CoordinatePath(kind, centre, 1.0 / frequency, amplitude=amplitude)
        corners = (0.0, -amplitude), (longest, amplitude), (3.0 * longest, -amplitude)
        moves = tuple(ReferenceMove(begin_s, edge, centre + to) for begin_s, to in corners)
        return CoordinatePath(kind, centre, 1.0 / frequency, moves)
    every, period = _EVERY.search(text), math.inf
    if every is not None:
        text, period = text[: every.start()], units.parse(every[1], "s")
    read = moves_of_text(text, unit)
    if every is not None and not any(move.end_s <= period and move.to_m == read.start_m for move in read.moves[-1:]):
        raise DescriptionError(f'"{given}" cannot be repeated', rule="moves must end at the start, within the period")
    return CoordinatePath("moves", read.start_m, period, read.moves)


# --- Score of a platform along a path of its pose.


@dataclass(frozen=True)
class Tracked:
    """Error of one coordinate or leg: reference minus actual value, in m or rad.

    Attributes
    ----------
    unit : str
        m or rad.
    rmse, max_error : float
        RMS and largest absolute error.
    amplitude : float
        Half of the range of the reference.
    """

    unit: str
    rmse: float
    max_error: float
    amplitude: float

    @property
    def percent(self) -> float:
        """RMS error in percent of the amplitude; NaN if the reference is at rest."""
        return 100.0 * self.rmse / self.amplitude if self.amplitude > 0.0 else math.nan

    def error(self) -> str:
        """Return the RMS error in percent of the amplitude, or with its unit for a reference at rest."""
        return self._written(self.rmse) if np.isnan(self.percent) else f"{self.percent:.3g} %"

    def shown(self, name: str) -> list[ShownValue]:
        """Return RMS error, its fraction of the amplitude, and largest error, with units."""
        share = "" if np.isnan(self.percent) else f"{self.percent:.3g} %"
        rmse, largest = self._written(self.rmse), self._written(self.max_error)
        texts = {"RMSE": rmse, "of amplitude": share, "largest error": largest}
        return [ShownValue(f"{name}.{quantity}", name, quantity, text) for quantity, text in texts.items()]

    def _written(self, value: float) -> str:
        return f"{1e6 * value:.3g} um" if self.unit == "m" else f"{np.degrees(1e3 * value):.3g} mdeg"


@dataclass(frozen=True, repr=False)
class PoseScore(Viewed):
    """Score of a platform along a path. A periodic path is scored in its last 4 s or its last period.

    Attributes
    ----------
    coordinates, legs : dict
        Name -> `Tracked`.
    air_per_cycle_anr_m3 : float or None
        Air from the reservoirs in a period, as volume at the standard reference atmosphere; None without a period.
    air_anr_m3_s : float
    saturated_share : float
        Fraction of the samples with the command at its limit; the largest of all legs.
    stops_hit : int
        Legs that reached an end of their stroke.
    singular_value, force_share, speed_share : float
        Smallest singular value along the path, and the largest fractions of the available force and speed.
    payload_spread : dict
        Payload -> name of a coordinate -> `Tracked`, if several payloads were run.
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
    payload_spread: dict[str, dict[str, Tracked]] = field(default_factory=dict)

    @property
    def lost(self) -> str:
        """Coordinate or leg with the largest error, in words, if this error exceeds 20 mm; otherwise empty."""
        errors = {name: one.max_error for name, one in {**self.coordinates, **self.legs}.items() if one.unit == "m"}
        name = max(errors, key=lambda key: errors[key])
        return f"{name} is up to {1e3 * errors[name]:.3g} mm from its reference" if errors[name] > LOST_M else ""

    def to_dict(self) -> Plain:
        """Return all measures by name."""
        return asdict(self)

    @classmethod
    def read(cls, score: Keyed) -> PoseScore:
        """Read the score in the attributes of a run.

        Parameters
        ----------
        score : dict
            As `to_dict` returns it.
        """
        return TypeAdapter(cls).validate_python(score)

    def view(self, about: Keyed | None = None) -> View:
        """Return errors of coordinates and legs, effort, and the spread over payloads.

        Parameters
        ----------
        about : mapping, optional
            Provenance of the run: its title and its events.
        """
        air = f"{1e3 * self.air_anr_m3_s:.3g} l/s ANR"
        if self.air_per_cycle_anr_m3 is not None:
            air += f", {1e3 * self.air_per_cycle_anr_m3:.3g} l ANR per cycle"
        effort = {
            "air": air,
            "smallest singular value": f"{self.singular_value:.3g}",
            "largest force": f"{100.0 * self.force_share:.0f} % of the supply's",
            "largest speed": f"{100.0 * self.speed_share:.0f} % of a leg's",
            "saturated": f"{100.0 * self.saturated_share:.2g} %",
        }
        findings = [Finding(f"Lost: {self.lost}.", "bad")] if self.lost else []
        findings.append(Finding(f"Stops hit: {self.stops_hit}.", "bad" if self.stops_hit else "good"))
        tracked = [*self.coordinates.items(), *self.legs.items()]
        rows = [value for name, one in tracked for value in one.shown(name)]
        return View(
            "Score of a pose, simulated" if about is None else run_title(about),
            rows,
            state="bad" if self.stops_hit or self.lost else "good",
            leading=tuple(ShownValue(key, "run", key, text) for key, text in effort.items()),
            findings=findings,
            tables=(*self._spread(), *event_table(() if about is None else about["events"])),
        )

    def _spread(self) -> Iterator[ShownTable]:
        """Yield the table of the RMS errors of each payload, and their range over the payloads."""
        each = list(self.payload_spread.items())
        if each:
            rows = [(payload, *(one.error() for one in own.values())) for payload, own in each]
            ends = {name: [own[name].rmse for _, own in each] for name in self.coordinates}
            ranges = (replace(one, rmse=max(ends[name]) - min(ends[name])).error() for name, one in each[0][1].items())
            yield ShownTable("Errors over the payloads.", ("payload", *self.coordinates), (*rows, ("spread", *ranges)))

    def to_csv(self) -> str:
        """Return RMS and largest error (m or rad), and RMS in percent of amplitude, of coordinates and legs as CSV."""
        lines = ["name,unit,rmse,max_error,amplitude,percent"]
        for name, one in [*self.coordinates.items(), *self.legs.items()]:
            lines.append(f"{name},{one.unit},{one.rmse!r},{one.max_error!r},{one.amplitude!r},{one.percent!r}")
        return "\n".join([*lines, ""])
