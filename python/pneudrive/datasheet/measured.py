"""Comparison of recordings with simulations, with the same definitions for both."""

from __future__ import annotations

import math
import tempfile
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise, product
from pathlib import Path

import numpy as np

from pneudrive import units
from pneudrive.arrays import Array, Pair, rows_of
from pneudrive.datasheet.characteristics.air import drawn_mass
from pneudrive.datasheet.plant import HeldDrive
from pneudrive.datasheet.strokes import STROKE_MEANING, StrokeNumbers, litres_anr, moving_mass, stroke_numbers
from pneudrive.describe.drive import Drive
from pneudrive.errors import CampaignError, LayoutError, PneudriveError, RecordingError, package_table
from pneudrive.friction.characterisation import characterise_recordings
from pneudrive.friction.friction_map import write_map
from pneudrive.progress import Watch
from pneudrive.signals.drive_recording import VolumeRecording, read_volume_recordings
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import find_layout
from pneudrive.validate.motion import STATIC_FIT_PERCENT, FrictionValidation, is_friction, validate_friction
from pneudrive.validate.validation import RecordResult, Validation, validate
from pneudrive.views import Finding, State

# --- Air of a cycle from a tank that feeds the drive, disconnected from the mains: measured and simulated.
#
#     m = V (p_1 - p_2) / (n R T)       V volume of the tank, m3; T its temperature at rest, that of the room, K;
#                                       p_1, p_2 its pressures at rest before and after n cycles, Pa
#                                       R gas constant of the drive's gas, J/(kg K)
#
# The gas cools during outflow, so the recording must start and end at rest.

KIND = "fixed-volume"
#: Labels of a recording, and an example of each.
LABELS = {"tank_volume": "20 l", "cycles": "25", "half_period": "1 s"}
RESTING = 0.02  # share of the samples at each end whose mean is a pressure at rest
STILL = 5e-4  # largest relative change of the pressure among them


def _air(drive: Drive, recording: VolumeRecording) -> Pair:
    """Return the air (l ANR) of a cycle from a recording of the tank, and from a simulation at the mean tank pressure.

    Raises
    ------
    RecordingError
        A label is missing, or the pressure is not constant at the start and end of the recording.
    """
    volume, half = _label(recording, "tank_volume", "m3"), _label(recording, "half_period", "s")
    cycles = _label(recording, "cycles", "")
    count, ends = max(int(RESTING * recording.pressure_pa.size), 2), []
    where = str(recording.source or recording.name)
    for which, part in (("begins", recording.pressure_pa[:count]), ("ends", recording.pressure_pa[-count:])):
        middle = count // 2
        moved = abs(part[:middle].mean() - part[middle:].mean()) / part.mean()
        if moved > STILL:
            shares = {"moved": 100.0 * moved, "still": 100.0 * STILL, "resting": 100.0 * RESTING}
            raise RecordingError.of("datasheet.not_at_rest", where=where, which=which, **shares)
        ends.append(float(part.mean()))
    before, after = ends
    if after >= before:
        raise RecordingError("the pressure of the tank does not fall", where=where, rule="the drive empties the tank")
    room, density = drive.ambient.temperature_k, drive.gas.anr_density_kg_m3
    mass = volume * (before - after) / (cycles * drive.gas.gas_constant_j_kg_k * room)
    fed = HeldDrive(drive.replace({"supply.pressure": f"{0.5 * (before + after)!r} Pa abs"}))
    return litres_anr(mass, density), litres_anr(drawn_mass(fed, half), density)


def _label(recording: VolumeRecording, key: str, unit: str) -> float:
    where, example = str(recording.source or recording.name), f'[labels] {key} = "{LABELS[key]}" in the layout'
    if key not in recording.labels:
        raise RecordingError.of("datasheet.no_label", where=where, name=key.replace("_", " "), example=example)
    text = recording.labels[key]
    try:
        value = units.parse(text, unit) if unit else float(text)
    except (PneudriveError, ValueError):
        value = np.nan
    if not 0.0 < value < np.inf:
        raise RecordingError.of("datasheet.label", where=where, name=key, text=text, example=example)
    return value


LEAST_WAY = 0.05  # of the stroke: a shorter motion is no stroke
AGREES = 0.05  # relative difference up to which a number without repeats agrees (assumed)
#: Numbers of a stroke that are compared.
COMPARED: tuple[str, ...] = tuple(package_table(__file__, "sheet.toml")["compared"])
LEAST_CHANGES = 50  # of the command in a recording from which a frequency response is taken
SEGMENTS = 8  # parts of such a recording, half overlapping
SYNTHETIC = "synthetic"  # label of recordings of another model
COHERENT = 0.8  # from which on a frequency counts


@dataclass(frozen=True)
class ComparedNumber:
    """A number of a stroke, measured and simulated.

    Attributes
    ----------
    stroke : str
        Command and direction of the stroke; for the air of a cycle, its half period.
    name, unit : str
    measured, low, high : float
        Mean of the repeats and its 95 % interval, whose ends are NaN for a single stroke.
    repeats : int
    simulated : float
    agrees : bool
        Whether the simulation is within the interval, or within 5 % of the measured value of a single stroke.
    """

    stroke: str
    name: str
    unit: str
    measured: float
    low: float
    high: float
    repeats: int
    simulated: float
    agrees: bool


@dataclass(frozen=True, eq=False)
class MeasuredResponse:
    """Frequency response of the velocity to the command, measured and simulated.

    Attributes
    ----------
    frequency_hz, measured_m_s, simulated_m_s, coherence : ndarray, shape (n,)
    """

    recording: str
    frequency_hz: Array
    measured_m_s: Array
    simulated_m_s: Array
    coherence: Array


@dataclass(frozen=True, eq=False)
class MeasuredBeside:
    """Results of recordings compared with the simulation.

    Attributes
    ----------
    validation : Validation or None
        Results from recordings of the drive.
    numbers : tuple of ComparedNumber
    responses : tuple of MeasuredResponse
    friction : FrictionValidation or None
        Results from a friction map, a campaign, or recordings of a piston alone.
    synthetic : bool
        Whether all recordings come from simulations.
    names : tuple of str
        File names of the recordings.
    """

    validation: Validation | None = None
    numbers: tuple[ComparedNumber, ...] = ()
    responses: tuple[MeasuredResponse, ...] = ()
    friction: FrictionValidation | None = None
    synthetic: bool = True
    names: tuple[str, ...] = ()

    @property
    def findings(self) -> list[Finding]:
        """Outcomes of the comparison; "open" if nothing was tested."""
        outcomes = [(verdict.met, verdict.text) for verdict in (self.validation.verdicts if self.validation else ())]
        if self.numbers:
            good, count = sum(number.agrees for number in self.numbers), len(self.numbers)
            outcomes.append((good == count, f"{good} of {count} numbers agree with the recordings"))
        if self.friction is not None:
            m = self.friction.metrics
            is_single = math.isnan(m.fit_percent)  # all points equal: nothing that a law could follow
            fit = f"fit {m.fit_percent:.1f} % (target above {STATIC_FIT_PERCENT:g} %)"
            text = f"friction law against measured friction: {'one level only' if is_single else fit}"
            outcomes.append((None if is_single else self.friction.met, f"{text}, largest difference {m.largest:.2g} N"))
        words: dict[bool | None, tuple[str, State]] = {
            True: ("Met", "good"),
            None: ("Not tested", "open"),
            False: ("Not met", "bad"),
        }
        return [Finding(f"{words[met][0]}: {text}.", words[met][1]) for met, text in outcomes]


def beside(drive: Drive, recordings: Sequence[Path], layout: Path | None, watch: Watch) -> MeasuredBeside:
    """Read recordings, simulate their commands, and compute the same numbers from both.

    Recordings of a tank give the air of cycles. They do not change the results of the other recordings.

    Raises
    ------
    RecordingError, LayoutError, CampaignError
        A recording cannot be used.
    """
    stated = None if layout is None else Layout.load(layout)
    layouts = {path: stated or find_layout(path) for path in recordings if not is_friction(path)}
    of_tank = [path for path, own in layouts.items() if own is not None and own.kind == KIND]
    others = [path for path in recordings if path not in of_tank]
    found = _of_drive(drive, others, layout, watch) if others else MeasuredBeside()
    if of_tank:
        tanks = read_volume_recordings(of_tank, layout)
        airs: dict[str, list[Pair]] = defaultdict(list)
        for recording in tanks:
            airs[f"half period {recording.labels['half_period']}"].append(_air(drive, recording))
        pairs = ((cycle, np.array(both).T) for cycle, both in airs.items())
        compared = [_compared(cycle, "air_per_cycle", seen, told, "l ANR") for cycle, (seen, told) in pairs]
        marked = found.synthetic and all(SYNTHETIC in recording.labels for recording in tanks)
        found = replace(found, numbers=(*found.numbers, *compared), synthetic=marked)
    return replace(found, names=tuple(path.name for path in recordings))


def _of_drive(drive: Drive, recordings: Sequence[Path], layout: Path | None, watch: Watch) -> MeasuredBeside:
    """Return the results of recordings of a drive, or of friction; see `beside`."""
    if any(is_friction(path) for path in recordings):
        if len(recordings) > 1:
            raise CampaignError.of("datasheet.together")
        return MeasuredBeside(friction=validate_friction(drive, recordings[0]), synthetic=False)
    try:
        validated = validate(drive, list(recordings), layout=layout, progress=watch.tell)
    except (RecordingError, LayoutError) as error:
        try:  # recordings of a piston alone: pressure, position and force, from which friction follows
            alone = characterise_recordings(list(recordings), layout, progress=watch.tell)
        except PneudriveError:
            raise error from None
        with tempfile.TemporaryDirectory() as folder:
            friction = validate_friction(drive, write_map(alone.friction_map, Path(folder) / "map.parquet"))
        return MeasuredBeside(friction=friction, synthetic=alone.synthetic)
    # Strokes with the same command count as repeats.
    groups: dict[str, list[tuple[StrokeNumbers, StrokeNumbers]]] = defaultdict(list)
    for record in validated.records:
        for command, seen, simulated in strokes_of(drive, record):
            groups[f"command {command:+.3g}"].append((seen, simulated))
    numbers = []
    for (stroke, pairs), name in product(groups.items(), COMPARED):
        measured, model = (np.array([getattr(pair[side], name) for pair in pairs]) for side in (0, 1))
        known = np.isfinite(measured)
        if (known & np.isfinite(model)).any():  # otherwise the simulation does not do what was measured
            known &= np.isfinite(model)
        if known.any():
            numbers.append(_compared(stroke, name, measured[known], model[known], STROKE_MEANING[name][0]))
    responses = tuple(filter(None, map(response_of, validated.records)))
    marked = all(SYNTHETIC in record.recording.labels for record in validated.records)
    return MeasuredBeside(validated, tuple(numbers), responses, synthetic=validated.synthetic or marked)


def _compared(stroke: str, name: str, seen: Array, told: Array, unit: str) -> ComparedNumber:
    from scipy.stats import t

    mean, model, n = float(seen.mean()), float(told.mean()), seen.size
    reach = math.nan
    if n > 1:
        reach = float(t.ppf(0.975, n - 1) * seen.std(ddof=1) / math.sqrt(n))
    close = abs(model - mean) <= AGREES * abs(mean)
    agrees = close or (n > 1 and abs(model - mean) <= reach)
    return ComparedNumber(stroke, name, unit, mean, mean - reach, mean + reach, n, model, bool(agrees))


def strokes_of(drive: Drive, record: RecordResult) -> Iterable[tuple[float, StrokeNumbers, StrokeNumbers]]:
    """Yield command, measured and simulated numbers of each stroke of a recording."""
    signals = record.signals
    time, command = signals.time_s, signals.command
    edges = np.flatnonzero(np.r_[True, np.diff(command) != 0.0, True])
    if edges.size - 2 > LEAST_CHANGES:
        return
    names = ("position_m", "pressure_a_pa", "pressure_b_pa")
    both = {name: getattr(signals, name) for name in names}, {name: record.free[name] for name in names}
    size, mass = drive.cylinder.stroke_m, moving_mass(drive)
    for begin, end in pairwise(edges):
        seen, model = (rows_of({"time_s": time} | columns, slice(begin, end)) for columns in both)
        moves = end - begin >= 5 and not np.ptp(seen["position_m"]) < LEAST_WAY * size
        if moves and np.isfinite(model["position_m"]).all():
            measured = stroke_numbers(seen, size, mass, time[begin])
            simulated = stroke_numbers(model, size, mass, time[begin], direction=measured.direction)
            yield float(command[begin]), measured, simulated


def response_of(record: RecordResult) -> MeasuredResponse | None:
    """Return the frequency response of a recording with a continually changing command, by averaged spectra.

    Return None for other recordings.
    """
    from scipy.signal import coherence, csd, welch

    signals = record.signals
    if np.count_nonzero(np.diff(signals.command)) < LEAST_CHANGES:
        return None
    rate, size = 1.0 / signals.step_s, 2 * signals.time_s.size // (SEGMENTS + 1)
    velocity = np.gradient(signals.position_m, signals.step_s)
    model = np.gradient(record.free["position_m"], signals.step_s)
    if not np.isfinite(model).all():
        return None
    f, power = welch(signals.command, rate, nperseg=size)
    share = coherence(signals.command, velocity, rate, nperseg=size)[1]
    seen, told = (
        np.abs(csd(signals.command, one, rate, nperseg=size)[1]) / np.maximum(power, 1e-300)
        for one in (velocity, model)
    )
    keep = (share >= COHERENT) & (f > 0.0)
    if not keep.any():
        return None
    return MeasuredResponse(record.recording.name, f[keep], seen[keep], told[keep], share[keep])
