"""Simulated trajectories as recordings, so that the analysis of rigs applies to simulations."""

from __future__ import annotations

import hashlib
import sys
from typing import TYPE_CHECKING, TypeGuard

import numpy as np

from pneudrive.errors import RecordingError
from pneudrive.signals.recording import CHANNELS, Recording
from pneudrive.simulation.trajectory import columns_in, meaning, read_columns

if TYPE_CHECKING:
    from collections.abc import Iterable
    from pathlib import Path

    import xarray as xr
    from numpy.typing import NDArray

# Columns that identify a trajectory file; other files lack some.
COLUMNS = ("time_s", "position_m", "velocity_m_s", "friction_force_n", "pressure_a_pa", "pressure_b_pa", "command")
#: Those that a recording is made of.
MEASURED = ("time_s", "position_m", "friction_force_n", "pressure_a_pa", "pressure_b_pa")
VARIABLES = tuple(meaning(column)[0] for column in COLUMNS)


def from_trajectory(columns: dict[str, NDArray], name: str, source: Path | None = None) -> Recording:
    """Make a recording from a trajectory's columns.

    The force is the friction force itself, as from an ideal sensor between rig and piston in steady sliding. The areas
    are zero, because the force contains no pressure.
    """
    return recording_of(columns, name, source, digest_of(columns[c] for c in COLUMNS))


def digest_of(columns: Iterable[NDArray]) -> str:
    """Hash the samples of one column after the other; each may come in parts."""
    total = hashlib.sha256()
    for values in columns:
        total.update(np.ascontiguousarray(values).data)
    return total.hexdigest()


def recording_of(columns: dict[str, NDArray], name: str, source: Path | None, sha256: str | None) -> Recording:
    """Return the recording of a trajectory; its hash is known, or not needed for a part of a trajectory."""
    return Recording(
        name=name,
        time_s=columns["time_s"],
        position_m=columns["position_m"],
        force_n=columns["friction_force_n"],
        pressure_a_pa=columns["pressure_a_pa"],
        pressure_b_pa=columns["pressure_b_pa"],
        area_a_m2=0.0,
        area_b_m2=0.0,
        accuracy=dict.fromkeys((*CHANNELS, "area", "alignment_rad"), 0.0),
        source=source,
        sha256=sha256,
        synthetic=True,
    )


def is_run(item: object) -> TypeGuard[xr.Dataset]:
    """Return whether this is a Dataset, without importing xarray."""
    kind = getattr(sys.modules.get("xarray"), "Dataset", None)  # none while another thread imports it
    return kind is not None and isinstance(item, kind)


def from_run(run: xr.Dataset, name: str = "trajectory") -> Recording:
    """Make a recording from a result of ``pn.simulate``.

    Raises
    ------
    RecordingError
        If the Dataset is not a trajectory.
    """
    missing = [v for v in VARIABLES if v not in run.variables]
    if missing:
        raise RecordingError(f"the Dataset is not a trajectory: it lacks {', '.join(missing)}", where=name)
    return from_trajectory({c: run[v].to_numpy() for c, v in zip(COLUMNS, VARIABLES, strict=True)}, name)


def is_trajectory(path: Path) -> bool:
    """Return whether a file has the columns of a trajectory.

    Raises
    ------
    RecordingError
        The file does not exist or is damaged.
    """
    return len(columns_in(path, COLUMNS)) == len(COLUMNS)


def read_trajectory(path: Path, name: str) -> Recording:
    """Read a trajectory file (.parquet, .csv, .nc) as a recording.

    Raises
    ------
    RecordingError
        If it is damaged, or a column does not hold numbers.
    """
    return from_trajectory(read_columns(path, COLUMNS), name, path)
