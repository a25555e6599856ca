"""A run of a circuit along a recorded motion, as a trajectory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive import __version__
from pneudrive.describe.circuit import Circuit
from pneudrive.identify.follow.doubts import check_readings
from pneudrive.identify.follow.driven import DrivenCircuit
from pneudrive.identify.follow.fit import FollowFit, read_follow_fit
from pneudrive.identify.follow.motion import driven_recordings

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.signals.layout import Layout
    from pneudrive.signals.recording import Recording


def simulate_motion(
    circuit: FollowFit | Circuit | str | Path,
    recording: str | Path | Recording,
    *,
    layout: Layout | str | Path | None = None,
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Simulate a circuit whose piston follows the position of a recording.

    The run starts with the measured pressures at the temperature of the walls. The motion has no compliance.

    Parameters
    ----------
    circuit : FollowFit, Circuit or path
        Path of a circuit, or of a fit along motions.
    recording : path or Recording
    layout : Layout or path, optional

    Returns
    -------
    dict, dict
        Columns of the trajectory in SI, by name; provenance for `pneudrive.simulation.trajectory.save_columns`.

    Raises
    ------
    RecordingError, LayoutError, DescriptionError, FitError
        Input is not valid.
    """
    known = read_follow_fit(circuit) if isinstance(circuit, str | Path) else circuit
    described = known.circuit if isinstance(known, FollowFit) else known
    described = described if isinstance(described, Circuit) else Circuit.load(circuit)  # type: ignore[arg-type]
    driven, (record,) = DrivenCircuit(described), driven_recordings([recording], layout)
    check_readings(driven, [record])
    provenance = {
        "title": described.name,
        "description_hash": described.description_hash,
        "version": __version__,
        "motion": record.name,
        "motion_sha256": record.recording.sha256,
        "assumed": described.assumed(),
    }
    return driven.trajectory(record), provenance
