"""Validation of a circuit along recorded motions: only start and delay of each recording are fitted."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.describe.circuit import Circuit
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError
from pneudrive.identify.compared import FittedData, comparison_figure
from pneudrive.identify.follow.driven import DrivenCircuit, driven_recordings
from pneudrive.identify.follow.fit import (
    POOR,
    FollowFit,
    FollowRecord,
    check_readings,
    described_circuit,
    follow_record,
    hold_values,
    open_recordings,
    other_readings,
    poor_fit,
)
from pneudrive.lazy_names import upper
from pneudrive.progress import Watch
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.signals.recording import Recording
from pneudrive.simulation.trajectory import whole
from pneudrive.validate.closure import Closure, close_balance
from pneudrive.validate.metrics import HELD_OUT, MADE, NONE_HELD_OUT, badge_of, held_out_notes
from pneudrive.views import LeadingValue, ShownFigure, ShownValue, View, Viewed

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable, Sequence

    from pneudrive.identify.follow.problem import FollowSolution
    from pneudrive.identify.follow.regulator import RegulatorFit
    from pneudrive.progress import Flag
    from pneudrive.signals.layout import Layout


PRESSURE, CLOSURE = 0.01, 0.01  # targets: shares of the ranges of pressure and force (assumed)
LATE_S = 0.05  # delay of the pressures that is named as a difference of clocks, if its interval excludes 0


@dataclass(frozen=True, eq=False, repr=False)
class MotionValidation(Viewed):
    """A circuit compared with recordings of its driven piston.

    Attributes
    ----------
    circuit : Circuit
    records : tuple of FollowRecord
        Recordings with closed chambers: residuals, start and delay.
    closures : tuple of Closure
        Force balance of each recording with a force.
    open : tuple of str
        Recordings whose chambers are open: their pressures are not compared.
    doubts : tuple of str
        Likely causes of differences.
    solution : FollowSolution or None
    badges : dict
        Recording -> ``made the fit``, ``held out``, or empty if it is not known.
    """

    circuit: Circuit
    records: tuple[FollowRecord, ...]
    closures: tuple[Closure, ...]
    open: tuple[str, ...]
    doubts: tuple[str, ...]
    solution: FollowSolution | None = field(default=None, repr=False)
    badges: dict[str, str] = field(default_factory=dict)

    @property
    def verdicts(self) -> tuple[tuple[bool, str], ...]:
        """Whether each target is met, with a sentence; pressures of recordings that were held out, if there are any."""
        found = []
        for record in self.records:
            if self.badges.get(record.name) == MADE and HELD_OUT in [self.badges[r.name] for r in self.records]:
                continue
            badge = f" ({self.badges[record.name]})" if self.badges.get(record.name) else ""
            for side, share in zip("ab", record.rms, strict=True):
                words = f"{record.name}{badge}, chamber {side}: rms {100 * share:.2f} % of the range (target 1 %)"
                found.append((share <= PRESSURE, words))
        for closure in self.closures:
            words = f"{closure.name}, force: closes within {100 * closure.share:.2f} % of the range (target 1 %)"
            found.append((closure.share <= CLOSURE, words))
        return tuple(found)

    def view(self) -> View:
        """Return verdicts, start and delay of each recording, force balances, and measured and simulated pressures."""
        return upper("motion_view")(self)

    def report(self, folder: str | Path) -> Path:
        """Write the page of the validation into an existing folder."""
        return upper("motion_page")(self, folder)

    def write(self, folder: str | Path) -> list[Path]:
        """Write validation.toml into an existing folder."""
        tables: dict[str, Any] = {
            "kind": "motion-validation",
            "verdicts": [{"met": met, "text": text} for met, text in self.verdicts],
            "doubts": list(self.doubts),
            "open": list(self.open),
            "recordings": [
                {"name": r.name, "badge": self.badges.get(r.name, ""),
                 "rms_percent": [100.0 * v for v in r.rms], "delay_s": list(r.delay_s),
                 "temperature_a_k": list(r.temperature_a_k), "temperature_b_k": list(r.temperature_b_k)}
                for r in self.records
            ],
            "closures": [
                {"name": c.name, "rms_n": c.rms_n, "percent": 100.0 * c.share, "offset_n": c.offset_n,
                 "gains": {name: [g.value, g.low, g.high] for name, g in c.gains.items()}}
                | ({} if c.delay is None else {"delay_s": [c.delay.value_s, c.delay.half_width_s]})
                | ({} if c.recorded is None else {"percent_as_recorded": 100.0 * c.recorded.share})
                for c in self.closures
            ],
        }  # fmt: skip
        target = Path(folder) / "validation.toml"
        with whole(target) as temporary:
            temporary.write_text(toml.write(tables), encoding="utf-8")
        return [target]


def validate_motion(
    circuit: FollowFit | Circuit | str | Path,
    recordings: str | Path | Recording | Iterable[str | Path | Recording],
    *,
    layout: Layout | str | Path | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> MotionValidation:
    """Compare a circuit with recordings of its driven piston, and the measured forces with each other.

    Start pressures, start temperatures and the delay of the pressures are fitted in each recording. All other numbers
    are held. Recordings with open chambers test the force balance only.

    Parameters
    ----------
    circuit : FollowFit, Circuit or path
    recordings : path or Recording, or several
    layout : Layout or path, optional
    progress, cancel
        See `pneudrive.progress.Watch`.

    Returns
    -------
    MotionValidation

    Raises
    ------
    RecordingError, LayoutError, DescriptionError, FitError
        Input is not valid.
    """
    watch = Watch(progress, cancel)
    recordings = [recordings] if isinstance(recordings, str | Path | Recording) else list(recordings)
    described, fit = described_circuit(circuit)
    fitted = {} if fit is None else fit.hashes
    records, driven = driven_recordings(recordings, layout), DrivenCircuit(described)
    if not records:
        raise CommandError("no recording is given")
    doubts = check_readings(driven, records)
    idle = open_recordings(driven, records)
    used = [record for record in records if record not in idle]
    solution, found = None, ()
    if used:
        solution = hold_values(described, used, watch)
        found = tuple(follow_record(solution, at) for at in range(len(used)))
        doubts += [*poor_fit(solution), *other_readings(solution), *_late(found)]
    forces = [record.recording for record in records if np.ptp(record.recording.force_n) > 0.0]
    closures = tuple(close_balance(force) for force in forces)
    badges = {r.name: badge_of(r.name, r.recording.sha256 or "", fitted) for r in records}
    notes = tuple(held_out_notes(badges[record.name] for record in found))
    return MotionValidation(
        described, found, closures, tuple(r.name for r in idle), (*notes, *doubts), solution, badges
    )


def _late(records: tuple[FollowRecord, ...]) -> list[str]:
    """Return the loggers whose clock differs from that of the position."""
    return [
        f"{r.name}: the pressures come {abs(r.delay_s[0]):.3f} ± {r.delay_s[1]:.3f} s "
        f"{'after' if r.delay_s[0] > 0 else 'before'} the position: the clocks of the loggers differ"
        for r in records
        if abs(r.delay_s[0]) > max(LATE_S, r.delay_s[1]) and max(r.rms) < POOR
    ]


# --- Validation of the fit of a pressure regulator against further runs.


@dataclass(frozen=True)
class RegulatorRun:
    """One run: rms of measured minus simulated pressure in Pa and relative to its range, badge, and both pressures."""

    name: str
    rms_pa: float
    share: float
    badge: str
    fitted: FittedData = field(repr=False)


@dataclass(frozen=True, eq=False, repr=False)
class RegulatorValidation(Viewed):
    """The fit of a regulator compared with runs; all values are held, and each run starts at its first pressure."""

    fit: RegulatorFit
    runs: tuple[RegulatorRun, ...]

    @property
    def notes(self) -> list[str]:
        """Sentences on the runs that were held out, and on the residual of the fit itself."""
        made = all(run.badge == MADE for run in self.runs)
        rms = self.fit.statistics["rms"]
        return [*(NONE_HELD_OUT,) * made, f"the fit itself has an rms of {100 * rms:.2f} % of the range"]

    def view(self) -> View:
        """Return the residual of each run, and measured and simulated pressures."""
        rows = []
        for run in self.runs:
            cells = {"rms": (run.rms_pa, "Pa"), "rms, % of the range": (100 * run.share, "")}
            cells |= {"recording": (run.badge, "")} if run.badge else {}
            rows += [ShownValue(f"{run.name}.{name}", run.name, name, *cell) for name, cell in cells.items()]
        worst = max(self.runs, key=lambda run: run.share)
        figure = comparison_figure({run.name: run.fitted for run in self.runs})
        return View(
            f"{self.fit.name} against {len(self.runs)} runs",
            tuple(rows),
            notes=tuple(self.notes),
            leading=(LeadingValue(ShownValue("worst", worst.name, f"largest rms, {worst.name}", worst.rms_pa, "Pa")),),
            figures=(ShownFigure("runs", "Measured and simulated pressures, and their difference.", figure),),
        )

    def report(self, folder: str | Path) -> Path:
        """Write the page of the validation into an existing folder."""
        return upper("view_report")(self.view()).write(folder)

    def write(self, folder: str | Path) -> list[Path]:
        """Write validation.toml into an existing folder."""
        runs = [{"name": r.name, "rms_pa": r.rms_pa, "percent": 100.0 * r.share, "badge": r.badge} for r in self.runs]
        target = Path(folder) / "validation.toml"
        with whole(target) as temporary:
            tables = {"kind": "regulator-validation", "notes": self.notes, "runs": runs}
            temporary.write_text(toml.write(tables), encoding="utf-8")
        return [target]


def validate_regulator(
    fit: RegulatorFit, recordings: str | Path | Sequence[str | Path], *, layout: Layout | str | Path | None = None
) -> RegulatorValidation:
    """Compare the fit of a regulator with runs of its command and pressure.

    Parameters
    ----------
    fit : RegulatorFit
    recordings : path or sequence of path
    layout : Layout or path, optional
        Of the kind ``fixed-volume``.

    Raises
    ------
    RecordingError, LayoutError
        A recording cannot be read.
    """
    files = [recordings] if isinstance(recordings, str | Path) else list(recordings)
    runs, fitted = [], dict.fromkeys(fit.recordings, "") | fit.hashes
    for record in read_volume_recordings(files, layout):
        model = fit.simulate(record)
        rms, span = float(np.sqrt(np.mean((record.pressure_pa - model) ** 2))), float(np.ptp(record.pressure_pa)) or 1.0
        data = FittedData("time_s", "pressure_pa", record.time_s, record.pressure_pa, model)
        runs.append(RegulatorRun(record.name, rms, rms / span, badge_of(record.name, record.sha256, fitted), data))
    return RegulatorValidation(fit, tuple(runs))
