"""Numbers of one stroke, with the same definitions for trajectories and recordings."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.arrays import Array, Columns, Keyed, NamedNumbers, rows_of
from pneudrive.constants import ANR_DENSITY_KG_M3
from pneudrive.errors import CommandError, package_table
from pneudrive.signals.motion import straight_line
from pneudrive.simulation.trajectory import columns as columns_of
from pneudrive.views import ShownValue, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Sequence

    import xarray as xr

    from pneudrive.describe.drive import Drive

#: Fractions of the travel: end of the dead time, begin and end of the rise time, and `time_99` (conventions).
DEPARTED, RISEN_FROM, RISEN_TO, NEARLY = 0.002, 0.1, 0.9, 0.99
#: Half width of the settling band, as a fraction of the travel (convention).
BAND = 0.01
#: Fraction of the stroke: a piston that stops closer to the cover has arrived, even without an impact.
ARRIVED = 1e-3
#: Fraction of the sampling interval within which a start time counts as lying on a sample (rounding).
SAME_TIME = 1e-6
LITRE = 1e-3  # m3
LAST_SAMPLES = 6  # whose slope is the end speed where no velocity was measured

#: Quantity of a stroke -> unit and meaning.
STROKE_MEANING: dict[str, tuple[str, str]] = package_table(__file__, "stroke_meaning.toml")


@dataclass(frozen=True, repr=False)
class StrokeNumbers(Viewed):
    """Numbers of one stroke in SI; NaN if an event did not occur or was not measured.

    Attributes
    ----------
    direction : int
        1 towards the end of chamber b, -1 towards the end of chamber a.
    stroke_time, time_99, dead_time, rise_time, settling_time : float
        See `STROKE_MEANING`.
    overshoot, way, mean_speed, top_speed, end_speed, end_energy, peak_pressure_a, peak_pressure_b : float
        See `STROKE_MEANING`. Speeds are positive.
    begin_within : float
        Largest time (s) between the command and the start of the counted times. It is the sample interval if only the
        samples show the command. The true times from the command are longer by at most this value.
    """

    direction: int
    stroke_time: float
    time_99: float
    dead_time: float
    rise_time: float
    settling_time: float
    overshoot: float
    way: float
    mean_speed: float
    top_speed: float
    end_speed: float
    end_energy: float
    peak_pressure_a: float
    peak_pressure_b: float
    begin_within: float = 0.0

    def to_dict(self) -> NamedNumbers:
        """Return the numbers by name, without the direction and `begin_within`."""
        return {name: value for name, value in asdict(self).items() if name in STROKE_MEANING}

    def view(self) -> View:
        """Return a view of the known numbers."""
        known = {name: value for name, value in self.to_dict().items() if not math.isnan(value)}
        rows = [ShownValue(name, name, "value", value, STROKE_MEANING[name][0]) for name, value in known.items()]
        late = f"times from the command may be longer by up to {self.begin_within:.3g} s, the interval of the samples"
        title = f"stroke towards the end of chamber {'b' if self.direction > 0 else 'a'}"
        return View(title, rows, notes=(late,) if self.begin_within else ())


def stroke_of(
    run: xr.Dataset, drive: Drive, begin_s: float = 0.0, end_s: float = math.inf, within_s: float = 0.0
) -> StrokeNumbers:
    """Return the numbers of one stroke of a simulated drive.

    Parameters
    ----------
    run : xarray.Dataset
        From `pneudrive.simulate` of a drive.
    drive : Drive
        Simulated drive, for its stroke and its masses.
    begin_s, end_s : float
        Time of the command that starts the stroke, and of the next command.
    within_s : float
        `begin_within` of the result.

    Returns
    -------
    StrokeNumbers

    Raises
    ------
    CommandError
        There are fewer than three samples between the times.

    Examples
    --------
    >>> import pneudrive as pn
    >>> from pneudrive.datasheet.strokes import stroke_of
    >>> drive = pn.Drive.load("catalogue:reference")
    >>> start = {"position": "50 mm", "pressure_a": "3 bar abs", "pressure_b": "3 bar abs"}
    >>> run = pn.simulate(drive, "0 s: 0.6", "1 s", initial=start)
    >>> round(stroke_of(run, drive).stroke_time, 4)
    0.2084
    """
    stroke, impacts = drive.cylinder.stroke_m, run.attrs["impacts"]
    found = stroke_numbers(columns_of(run), stroke, moving_mass(drive), begin_s, end_s, impacts)
    return replace(found, begin_within=within_s)


def moving_mass(drive: Drive) -> float:
    """Return the mass (kg) that moves with the piston."""
    return drive.cylinder.moving_mass_kg + drive.carried.mass_kg


def stroke_numbers(
    columns: Keyed,
    stroke_m: float,
    mass_kg: float = math.nan,
    begin_s: float = 0.0,
    end_s: float = math.inf,
    impacts: Sequence[Keyed] = (),
    direction: int = 0,
) -> StrokeNumbers:
    """Return the numbers of one stroke from columns of a trajectory or a recording.

    Parameters
    ----------
    columns : mapping
        ``time_s`` and ``position_m`` (from 0 at the end of chamber a) have shape (n,), as do ``velocity_m_s``,
        ``pressure_a_pa`` and ``pressure_b_pa`` if they are known. With the velocity, times are interpolated by the
        cubic between two samples, otherwise by a straight line.
    stroke_m : float
        Stroke of the cylinder.
    mass_kg : float
        Moving mass with its load.
    begin_s, end_s : float
        Time of the command that starts the stroke, and of the next command. A start between samples is interpolated.
    impacts : sequence of mappings
        Contacts with the ends from a simulation; contacts of other strokes are ignored. Without `impacts`, the
        piston touches the end when the position reaches the end.
    direction : int
        Direction of the command: 1 towards the end of chamber b, -1 towards the end of chamber a. 0: direction of the
        piston.

    Returns
    -------
    StrokeNumbers

    Raises
    ------
    CommandError
        There are fewer than three samples between the times.
    """
    part = _samples(columns, begin_s, end_s)
    t, x, v = part["time_s"], part["position_m"], part.get("velocity_m_s")
    direction = direction or (1 if x[-1] >= x[0] else -1)
    s = direction * (x - x[0])  # way done
    room = stroke_m - x[0] if direction > 0 else x[0]
    end = "b" if direction > 0 else "a"
    hits = [one for one in impacts if begin_s <= one["time_s"] < end_s and one["end"] == end]
    contact = hits[0]["time_s"] if hits else math.nan
    speed = max((one["speed_m_s"] for one in hits), default=math.nan)  # a piston that rebounds may come faster
    arrived = not math.isnan(contact) or s.max() >= room - ARRIVED * stroke_m
    way = room if arrived else float(s[-1])
    if way <= ARRIVED * stroke_m:  # it rests where it was: nothing of a stroke happened
        arrived, contact, speed, way = False, *[math.nan] * 3
    rate = None if v is None else direction * v
    if arrived and math.isnan(contact):
        contact = first_passage(t, s, min(room, s.max()), rate)
        last = int(np.searchsorted(t, contact))
        if rate is not None:
            speed = float(rate[max(last - 1, 0)])
        else:  # the slope of a straight line through the last samples before the contact
            own = slice(max(last - LAST_SAMPLES, 0), last)
            speed = straight_line(t[own], s[own])[0] if last > 1 else math.nan
    done = {share: first_passage(t, s, share * way, rate) for share in (DEPARTED, RISEN_FROM, RISEN_TO, NEARLY)}
    lasting = (contact if contact == contact else done[NEARLY]) - begin_s
    outside = np.flatnonzero(np.abs(s - s[-1]) > BAND * way)
    peaks = [float(np.max(part.get(name, math.nan))) for name in ("pressure_a_pa", "pressure_b_pa")]
    return StrokeNumbers(
        direction=direction,
        stroke_time=contact - begin_s,
        time_99=done[NEARLY] - begin_s,
        dead_time=done[DEPARTED] - begin_s,
        rise_time=done[RISEN_TO] - done[RISEN_FROM],
        settling_time=float(t[min(outside[-1] + 1, t.size - 1)] - begin_s) if outside.size else 0.0 * way,
        overshoot=float(max(s.max() - way, 0.0)),
        way=way,
        mean_speed=way / lasting if lasting > 0.0 else math.nan,
        top_speed=float(np.max(np.gradient(s, t) if rate is None else rate)),
        end_speed=speed,
        end_energy=0.5 * mass_kg * speed**2,
        peak_pressure_a=peaks[0],
        peak_pressure_b=peaks[1],
    )


def _samples(columns: Keyed, begin_s: float, end_s: float) -> Columns:
    """Return the samples of a stroke. The first one is at its beginning, interpolated if necessary."""
    every = {name: np.asarray(values, dtype=float) for name, values in columns.items() if np.ndim(values)}
    time = every["time_s"]
    keep = (time >= begin_s) & (time <= end_s)
    if keep.sum() < 3:
        what = f"a stroke from {begin_s:g} s to {end_s:g} s has {keep.sum()} samples"
        raise CommandError(what, rule="a stroke needs at least 3 samples", remedy="Sample more often.")
    part = rows_of(every, keep)
    k = int(np.argmax(keep))
    if k == 0 or time[k] - begin_s <= SAME_TIME * (time[k] - time[k - 1]):
        return part
    first = {name: np.interp(begin_s, time, values) for name, values in every.items()}
    if "velocity_m_s" in every:
        from scipy.interpolate import CubicHermiteSpline

        t, x, v = (every[name][k - 1 : k + 1] for name in ("time_s", "position_m", "velocity_m_s"))
        first["position_m"] = CubicHermiteSpline(t, x, v)(begin_s)
    return {name: np.r_[first[name], values] for name, values in part.items()}


def first_passage(t: Array, x: Array, level: float, rate: Array | None = None) -> float:
    """Return the first time at which x rises to a level; NaN if it never does.

    Parameters
    ----------
    t, x : ndarray
        Times, which must rise, and positions, with the shape (n,).
    level : float
    rate : ndarray, optional
        x', used for the cubic interpolation of the time between two samples.

    Examples
    --------
    >>> times = np.array([0.0, 1.0, 2.0])
    >>> round(first_passage(times, times**2, 2.25, 2.0 * times), 9)
    1.5
    """
    reached = np.flatnonzero(x >= level)
    if not reached.size:
        return math.nan
    k = int(reached[0])
    if k == 0:
        return float(t[0])
    h, low, rise = t[k] - t[k - 1], x[k - 1], x[k] - x[k - 1]
    if rate is None:
        return float(t[k - 1] + h * (level - low) / rise)
    a, b = h * rate[k - 1] - rise, rise - h * rate[k]

    def value(u: float) -> float:  # cubic of Hermite
        return low + u * rise + u * (1.0 - u) * (a * (1.0 - u) + b * u) - level

    from scipy.optimize import brentq

    return float(t[k - 1] + h * brentq(value, 0.0, 1.0, xtol=1e-12))


def litres_anr(mass_kg: float, density_kg_m3: float = ANR_DENSITY_KG_M3) -> float:
    """Return a mass as litres at the standard reference atmosphere, ISO 8778: 100 kPa, 20 degC, 65 % humidity.

    The gas is air. For another gas, see `Gas.anr_density_kg_m3`.

    Examples
    --------
    >>> litres_anr(1.185e-3)
    1.0
    """
    return mass_kg / density_kg_m3 / LITRE
