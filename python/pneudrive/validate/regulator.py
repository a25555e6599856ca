"""Validation of the fit of a pressure regulator against further runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.files import toml
from pneudrive.repr_tables import Card, Shown
from pneudrive.signals.drive_recording import read_volume_recordings
from pneudrive.simulation.trajectory import whole
from pneudrive.validate.held_out import MADE, NONE_HELD_OUT, badge_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from pneudrive.identify.follow.regulator import RegulatorFit
    from pneudrive.signals.layout import Layout


@dataclass(frozen=True)
class RegulatorRun:
    """One run: rms of measured minus simulated pressure in Pa and relative to its range, and its badge."""

    name: str
    rms_pa: float
    share: float
    badge: str


@dataclass(frozen=True, eq=False, repr=False)
class RegulatorValidation(Shown):
    """The fit of a regulator compared with runs; all values are held, and each run starts at its first pressure."""

    fit: RegulatorFit
    runs: tuple[RegulatorRun, ...]

    @property
    def notes(self) -> list[str]:
        """Sentences on the runs that were held out, and on the residual of the fit itself."""
        made = all(run.badge == MADE for run in self.runs)
        return [*(NONE_HELD_OUT,) * made, f"the fit itself has an rms of {100 * self.fit.rms:.2f} % of the range"]

    def __str__(self) -> str:
        """Return the residual of each run as text."""
        card = self._card()
        return "\n".join([card.title, *(f"  {name}: {text}" for name, text in card.rows), *map(str, card.notes)])

    def _card(self) -> Card:
        rows = []
        for run in self.runs:
            badge = f", {run.badge}" if run.badge else ""
            rows.append((run.name, f"rms {run.rms_pa / 1e5:.3g} bar, {100 * run.share:.2f} % of the range{badge}"))
        return Card(f"{self.fit.name} against {len(rows)} runs", rows=rows, notes=self.notes)

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
    fitted = {name: fit.sha256.get(name, "") for name in fit.runs}
    runs = []
    for record in read_volume_recordings(files, layout):
        rms = float(np.sqrt(np.mean((record.pressure_pa - fit.simulate(record)) ** 2)))
        span = float(np.ptp(record.pressure_pa)) or 1.0
        runs.append(RegulatorRun(record.name, rms, rms / span, badge_of(record.name, record.sha256, fitted)))
    return RegulatorValidation(fit, tuple(runs))
