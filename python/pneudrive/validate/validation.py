"""Validation of a drive against its recordings: free runs, runs from measured states, stops, conditions, verdicts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Literal, overload

import numpy as np

from pneudrive import __version__
from pneudrive.arrays import Columns, Keyed, NamedNumbers, Plain
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError
from pneudrive.files.inputs import INPUTS, inputs_of, stored_beside
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.dynamic.sensors import Sensor
from pneudrive.identify.follow.driven import check_follow
from pneudrive.identify.follow.fit import FollowFit
from pneudrive.identify.identified import stated
from pneudrive.identify.volume import RegulatorFit
from pneudrive.lazy_names import upper
from pneudrive.progress import Flag, Progress, Watch
from pneudrive.repr_tables import Shown
from pneudrive.signals import drive_recording as drive_files
from pneudrive.signals.drive_recording import NEEDED, OPTIONAL, DriveRecording, Given
from pneudrive.signals.layout import AnyLayout
from pneudrive.signals.recording import Recording
from pneudrive.simulation.simulate import positive, require
from pneudrive.simulation.trajectory import save_columns, write_whole
from pneudrive.validate import balance
from pneudrive.validate.diagnosis import Diagnosis, diagnose
from pneudrive.validate.motion import MotionValidation, RegulatorValidation, validate_motion, validate_regulator
from pneudrive.views import View, Viewed

SCHEMA = 1  # version of the format of validation.toml
HEAD = "# Validation of a drive against recordings. SI; nrmse and share are fractions, fit is in percent."
#: Compared channels, with their names in reports.
CHANNELS = {"position_m": "position", "pressure_a_pa": "pressure a", "pressure_b_pa": "pressure b"}
#: Length of the runs from measured states, s.
WINDOW_S = 0.5
#: Targets (assumed: reached by a good model of a servo drive).
POSITION_FIT_PERCENT, PRESSURE_NRMSE, BREAKAWAY_ERROR = 90.0, 0.03, 0.05
#: The free run deviates from the time after which its error stays above this fraction of the measured span.
OFF_SHARE = 0.1
#: A model moves in the wrong direction if the fit of its free run is negative, and the fit of its runs from measured
#: states is below this value, %.
WAY_PERCENT = 50.0


@dataclass(frozen=True, eq=False)
class ChannelResult:
    """Results of one channel of one recording.

    Attributes
    ----------
    free, restarted : Metrics
        Metrics of the free run and of the runs from measured states.
    off_s : float or None
        Time in s from which the free run deviates; None if it does not.
    whiteness : dict
        Test of the free run's residual for whiteness, see `pneudrive.validate.balance.whiteness`.
    correlated_with : dict
        Signal -> strongest correlation of the free run's residual with this signal.
    """

    free: balance.Metrics
    restarted: balance.Metrics
    off_s: float | None
    whiteness: NamedNumbers
    correlated_with: NamedNumbers


@dataclass(frozen=True, eq=False, repr=False)
class RecordResult(Shown):
    """Results of one recording: its signals, the runs, the results of its channels, and breakaway after stops."""

    signals: balance.Signals
    free: balance.ModelRun
    restarted: balance.ModelRun
    channels: dict[str, ChannelResult]
    breakaways: tuple[balance.RecordedBreakaway, ...]

    @property
    def recording(self) -> DriveRecording:
        """Validated recording."""
        return self.signals.recording


@dataclass(frozen=True)
class Verdict:
    """Verdict on one target: reached value, target, and whether the target is met (None if it was not tested).

    Attributes
    ----------
    what : str
    value, target : float
    text : str
        Sentence with numbers.
    met : bool or None
    """

    what: str
    value: float
    target: float
    text: str
    met: bool | None


@dataclass(frozen=True, eq=False, repr=False)
class Validation(Viewed):
    """Validation of a drive against recordings.

    Attributes
    ----------
    drive : Drive
    records : tuple of RecordResult
    window_s : float
        Length of the runs from measured states, in s.
    fitted : dict
        Recordings from which the drive was fitted: name -> hash. Empty if unknown, or without a fit.
    """

    drive: Drive
    records: tuple[RecordResult, ...]
    window_s: float
    notes: tuple[str, ...]
    fitted: Mapping[str, str]
    _diagnosis: Diagnosis

    def badge(self, record: RecordResult) -> str:
        """Return whether a recording ``made the fit`` or was ``held out``; empty if it is not known."""
        return balance.badge_of(record.recording.name, record.recording.sha256, self.fitted)

    @property
    def synthetic(self) -> bool:
        """Whether all recordings come from simulations."""
        return all(r.recording.synthetic for r in self.records)

    def pooled(self, channels: Sequence[str], *, restarted: bool = False) -> balance.Metrics:
        """Return the metrics over all recordings; for several channels, the metrics of the worst channel."""
        found = []
        for channel in channels:
            runs = [(r.restarted if restarted else r.free)[channel] for r in self.records]
            measured = np.concatenate([getattr(r.signals, channel) for r in self.records])
            found.append(balance.metrics(measured, np.concatenate(runs)))
        return max(found, key=lambda m: np.inf if np.isnan(m.nrmse) else m.nrmse)

    @cached_property
    def verdicts(self) -> tuple[Verdict, ...]:
        """Verdicts on all targets. If recordings were held out of the fit, the verdicts use only these."""
        held_out = tuple(r for r in self.records if self.badge(r) == balance.HELD_OUT)
        if 0 < len(held_out) < len(self.records):
            return replace(self, records=held_out).verdicts
        fit = self.pooled(["position_m"]).fit_percent
        nrmse = self.pooled(["pressure_a_pa", "pressure_b_pa"]).nrmse
        errors = [abs(b.error) for r in self.records for b in r.breakaways]
        error = float(np.mean(errors)) if errors else np.nan
        stops = "not tested, as no recorded stop ends in motion"
        if errors:
            stops = f"mean error {100 * error:.2g} % (target below {100 * BREAKAWAY_ERROR:g} %)"
        position = f"position in the free run: fit {fit:.1f} % (target above {POSITION_FIT_PERCENT:g} %)"
        worse = f"NRMSE {100 * nrmse:.2g} % in the worse chamber (target below {100 * PRESSURE_NRMSE:g} %)"
        rest = f"breakaway{f' after {len(errors)} stops' if errors else ''}: {stops}"
        is_met = error < BREAKAWAY_ERROR if errors else None
        return (
            Verdict("position", fit, POSITION_FIT_PERCENT, position, fit > POSITION_FIT_PERCENT),
            Verdict("pressure", nrmse, PRESSURE_NRMSE, f"pressures in the free run: {worse}", nrmse < PRESSURE_NRMSE),
            Verdict("breakaway", error, BREAKAWAY_ERROR, rest, is_met),
        )

    @cached_property
    def conditions(self) -> list[Plain]:
        """Metrics of free runs and of runs from measured states, for each value of the labels that vary."""
        rows = []
        for key in dict.fromkeys(key for r in self.records for key in r.recording.labels):
            values = sorted({r.recording.labels.get(key, "-") for r in self.records})
            for value in values if len(values) > 1 else ():
                own = replace(self, records=tuple(r for r in self.records if r.recording.labels.get(key, "-") == value))
                row: Plain = {"label": key, "value": value, "recordings": len(own.records)}
                row["position_fit_percent"] = own.pooled(["position_m"]).fit_percent
                row["pressure_nrmse"] = own.pooled(["pressure_a_pa", "pressure_b_pa"]).nrmse
                row["restarted_fit_percent"] = own.pooled(["position_m"], restarted=True).fit_percent
                rows.append(row)
        return rows

    def diagnosis(self) -> Diagnosis:
        """Return the causes that explain the residuals; see `pneudrive.validate.diagnosis`."""
        return self._diagnosis

    def write(self, folder: str | Path) -> list[Path]:
        """Write validation.toml (metrics, verdicts, diagnosis) and run-1.parquet, ... into an existing folder.

        The file of a run has the recording and the model on a uniform time base. Its columns are ``free.position_m`` of
        the free run and ``restarted.position_m`` of the runs from measured states, in SI, with NaN for missing results.
        """
        tables, drive = self.content(), self.drive
        tables["provenance"] = stored_beside(tables["provenance"], Path(folder))
        written = [write_whole(Path(folder) / "validation.toml", "\n".join([HEAD, *toml.sections(tables)]) + "\n")]
        for number, record in enumerate(self.records):
            recording = record.recording
            about: Plain = {"validation of": drive.description_hash, "recording": recording.name}
            about |= {"sha256": recording.sha256, "version": __version__, INPUTS: inputs_of(drive, [recording])}
            written.append(save_columns(run_columns(record), about, Path(folder) / run_name(number)))
        return written

    def content(self) -> Plain:
        """Return the tables of validation.toml: values are in SI, fractions as numbers, fit in percent."""
        drive, diagnosis = self.drive, self.diagnosis()
        identified = {"identified": drive.to_dict()["provenance"]} if drive.provenance else {}
        return {
            "schema": SCHEMA,
            "window_s": self.window_s,
            "synthetic": self.synthetic,
            "notes": list(self.notes),
            "provenance": {"drive": drive.name, "description_hash": drive.description_hash, "version": __version__}
            | identified
            | {INPUTS: inputs_of(drive, [record.recording for record in self.records])},
            "verdict": [vars(verdict) for verdict in self.verdicts],
            "record": [
                _record_table(record) | {"badge": self.badge(record), "run": run_name(at)}
                for at, record in enumerate(self.records)
            ],
            "condition": self.conditions,
            "diagnosis": {
                "left": diagnosis.left,
                "clean": diagnosis.is_clean,
                "why": self.why(),
                "residual_over_noise": {name.replace(" ", "_"): value for name, value in diagnosis.size.items()},
                "culprit": [
                    {"amount": c.amount, "unit": c.cause.unit, "interval": c.interval, "share": c.share, "text": c.text,
                     "remedy": c.cause.remedy, "free": c.free, "what": c.key, "rivals": [*dict(c.rivals)]}
                    for c in diagnosis.culprits
                ],
            },
        }  # fmt: skip

    def view(self) -> View:
        """Return verdicts, agreement of each channel, causes of differences, and measured and modelled channels."""
        return upper("validation_view")(self.content(), lambda number: run_columns(self.records[number]))

    def report(self, folder: str | Path) -> Path:
        """Write the page of the validation into an existing folder."""
        return upper("write_validation_report")(self, folder)

    def why(self) -> list[str]:
        """Return the diagnosis of the residuals in sentences."""
        said = str(self.diagnosis()).splitlines()
        missed = any(v.met is False for v in self.verdicts)
        has_lines = bool(self.drive.tubing or self.drive.flow_control)
        if has_lines:
            said.append("only forces are balanced: the flow through tubes and flow controls is not measured")
        if missed and self.diagnosis().is_clean and not self.diagnosis().culprits:
            left = "tubes, flow controls, valve and supply, " if has_lines else ""
            said.append(
                f"the cause is not part of the balances ({left}presliding, stops, impacts, the initial state), "
                "or small errors add up in the free run"
            )
        return said


@overload
def validate(
    drive: Drive | DriveFit,
    recordings: Given | DriveRecording | Sequence[Given | DriveRecording],
    *,
    follow: None = None,
    layout: AnyLayout = None,
    window_s: float = WINDOW_S,
    sensors: DriveFit | Mapping[str, Sensor | Keyed] | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> Validation: ...
@overload
def validate(
    drive: FollowFit | Circuit | str | Path,
    recordings: str | Path | Recording | Sequence[str | Path | Recording],
    *,
    follow: Literal["motion"],
    layout: AnyLayout = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> MotionValidation: ...
@overload
def validate(
    drive: RegulatorFit, recordings: str | Path | Sequence[str | Path], *, layout: AnyLayout = None
) -> RegulatorValidation: ...
def validate(
    drive: Any,
    recordings: Any,
    *,
    follow: str | None = None,
    layout: AnyLayout = None,
    window_s: float = WINDOW_S,
    sensors: DriveFit | Mapping[str, Sensor | Keyed] | None = None,
    progress: Progress | None = None,
    cancel: Flag | None = None,
) -> Validation | MotionValidation | RegulatorValidation:
    """Validate a drive against its recordings.

    Parameters
    ----------
    drive : Drive or DriveFit
        Drive to validate. A fit is applied to its drive, and the recordings are corrected for its sensor errors.
        Verdicts then come from the recordings that were held out of the fit. `drive` may also be a fit along motions or
        the fit of a regulator.
    recordings
        One or several recordings. Each is a file of ``pneudrive simulate --out``, a foreign file with a layout, a
        result of ``pn.simulate``, or a mapping of SI columns (time_s, command, position_m, pressure_a_pa,
        pressure_b_pa).
    follow : {"motion"}, optional
        With ``"motion"``, the piston of a circuit follows the recorded position, see `pneudrive.validate_motion`.
    layout
        Layout of foreign files. None: ``layout.toml`` next to the file.
    window_s : float
        Length of the runs that start from measured states, in s.
    sensors : DriveFit or mapping, optional
        Known sensor errors, for which the recordings are corrected: a fit, or channel -> offset and gain (``{"offset":
        "0.02 bar"}``), and a delay for the command. A fit has errors for each of its recordings; a new recording gets
        the mean errors.
    progress : callable, optional
        Called as ``progress(done, total, task)``, see `pneudrive.progress.Watch`.
    cancel : object with ``is_set()``, optional
        Once set, the call ends with `Cancelled`.

    Returns
    -------
    Validation
        Free runs from the first measured state, runs with resets to measured states every `window_s`, metrics,
        verdicts. ``diagnosis()`` gives the causes that explain the residuals.

    Raises
    ------
    RecordingError, LayoutError
        A recording cannot be used.
    CommandError
        The window is not positive.

    Examples
    --------
    >>> import pneudrive as pn
    >>> drive = pn.Drive.load("catalogue:reference")
    >>> run = pn.simulate(drive, "0 s: 0.1, 0.3 s: -0.1, 0.6 s: 0", "1 s")
    >>> pn.validate(drive, run).verdicts[0].met
    True
    """
    if isinstance(drive, RegulatorFit):
        return validate_regulator(drive, recordings, layout=layout)
    if follow is not None or isinstance(drive, FollowFit):
        check_follow(follow or "motion")
        return validate_motion(drive, recordings, layout=layout, progress=progress, cancel=cancel)
    fitted: dict[str, str] = {}
    if isinstance(drive, DriveFit):
        fitted = drive.hashes
        drive, sensors = drive.apply(), drive if sensors is None else sensors
    if isinstance(drive, Circuit):
        raise CommandError(**stated("application", "not_a_drive", name=drive.name))
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    window_s = positive(window_s, "s", "window")
    watch = Watch(progress, cancel)
    read = []
    known = [SWITCHES] * (drive.valve.time_on_s is not None)
    if not fitted:  # recordings behind the identified values, without hashes; a file lists at most six
        texts = {origin.source for origin in drive.provenance.values()} - {"not stated"}
        fitted = {name: "" for text in texts for name in text.partition(" and ")[0].split(", ")}
    for recording in drive_files.read_drive_recordings(recordings, layout):
        limits = (drive.cylinder.stroke_m, drive.ambient.pressure_pa, drive.supply_pressure_pa)
        drive_files.check_plausible(recording, *limits)
        own = sensors.sensors_of(recording.name) if isinstance(sensors, DriveFit) else sensors
        without, said = balance.corrected(recording, own)
        read.append(without)
        known += said
    records = tuple(_record(drive, balance.Signals.of(r), window_s) for r in watch.each(read, "recordings simulated"))
    badges = [balance.badge_of(r.name, r.sha256, fitted) for r in read]
    notes = (*balance.held_out_notes(badges), *known, *_notes(records), *drive_files.time_gaps(read))
    diagnosis = diagnose(drive, [record.signals for record in records], progress=progress, cancel=cancel)
    return Validation(drive, records, window_s, notes, fitted, diagnosis)


SWITCHES = "The valve has switching times, but the balances assume immediate switching, so no cause is named."


def _notes(records: Sequence[RecordResult]) -> Iterator[str]:
    """Yield notes on a piston at rest, on a reversed motion, on swapped chambers and on samples without a result.

    Samples without a result are not part of the metrics.
    """
    a, b = "pressure_a_pa", "pressure_b_pa"
    for r in records:
        position, signals = r.channels["position_m"], r.signals
        # Whether the pressures of the free run fit only the other chamber (swapped columns).
        pairs = ((getattr(signals, p), r.free[q]) for p, q in ((a, b), (b, a)))
        crossed = max(balance.metrics(measured, model).nrmse for measured, model in pairs)
        is_crossed = crossed < PRESSURE_NRMSE < max(r.channels[p].free.nrmse for p in (a, b))
        if not drive_files.moves(signals.position_m):
            yield (
                f"{r.recording.name}: the piston does not move, so that the verdicts compare the model with noise. "
                "Record motion in both directions"
            )
        elif position.free.fit_percent < 0.0 and position.restarted.fit_percent < WAY_PERCENT:
            yield (
                f"{r.recording.name}: the model moves in the opposite direction. Check for a reversed sign or "
                "swapped chambers: a command above 0 fills chamber a, which moves the piston towards greater positions"
            )
        elif is_crossed:
            yield f"{r.recording.name}: the pressures fit if the chambers are swapped. Check which column is pressure a"
        for run, words in ((r.free, "free run"), (r.restarted, "runs from measured states")):
            if run.failures:
                lost = int(np.isnan(run["position_m"]).sum())
                where = f"{r.recording.name}, {words}"
                yield f"{where}: no result at {lost} samples, which the metrics leave out: {run.failures[0]}"


def _record(drive: Drive, signals: balance.Signals, window_s: float) -> RecordResult:
    free = balance.run_model(drive, signals)
    every = max(round(window_s / signals.step_s), 2)
    restarted = balance.run_model(drive, signals, range(0, max(signals.time_s.size - every // 2, 1), every))
    stimuli = {"command": signals.command, "direction": signals.direction}
    stimuli |= {words: getattr(signals, channel) for channel, words in CHANNELS.items()}
    channels = {}
    for channel in CHANNELS:
        measured = getattr(signals, channel)
        residual = measured - free[channel]
        beyond = ~(np.abs(residual) <= OFF_SHARE * np.ptp(measured))
        channels[channel] = ChannelResult(
            balance.metrics(measured, free[channel]),
            balance.metrics(measured, restarted[channel]),
            float(signals.time_s[int(np.argmax(beyond))]) if beyond.any() else None,
            balance.whiteness(residual),
            balance.cross_correlations(residual, stimuli),
        )
    return RecordResult(signals, free, restarted, channels, balance.breakaways(drive, signals))


def run_name(number: int) -> str:
    """Return the file name of the run with this number, counted from 0."""
    return f"run-{number + 1}.parquet"


def run_columns(record: RecordResult) -> Columns:
    """Return the columns of a recording and of its runs; see `Validation.write`."""
    signals, recording = record.signals, record.recording
    table = {name: getattr(signals, name) for name in NEEDED}
    for name in (name for name in OPTIONAL if name in recording):
        table[name] = np.interp(signals.time_s, recording.time_s, recording[name])
    for run, words in ((record.free, "free"), (record.restarted, "restarted")):
        table |= {f"{words}.{name}": run[name] for name in CHANNELS}
    return table


def _record_table(record: RecordResult) -> Plain:
    recording = record.recording
    out: Plain = {
        "name": recording.name,
        "source": str(recording.source or ""),
        "sha256": recording.sha256,
        "samples": len(recording),
        "start_s": recording.start_s,
        "duration_s": recording.duration_s,
        "labels": recording.labels,
    }
    for name, channel in record.channels.items():
        out[name] = vars(channel) | {"free": _metrics(channel.free), "restarted": _metrics(channel.restarted)}
    return out | {"breakaway": [vars(b) | {"error": b.error} for b in record.breakaways]}


def _metrics(found: balance.Metrics) -> dict[str, object]:
    return {name: value for name, value in vars(found).items() if np.isfinite(value)}
