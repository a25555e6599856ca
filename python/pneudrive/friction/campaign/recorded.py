"""Recordings as a campaign without a plan: each speed level of each recording is a cycle.

Set speeds and pressures are the measured ones: pressures that differ by less than 0.1 bar are one condition. Labels
give seal, mounting and drive; each label of a run is a block. The order of the recordings in time is not known.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.estimate.groups import levels
from pneudrive.friction.bins import Grid, grid_of
from pneudrive.friction.campaign.reading import CampaignData, common_edges
from pneudrive.friction.campaign.sensors import Gain
from pneudrive.friction.conditions import LEVELS, Condition, Skipped
from pneudrive.friction.cycle import CycleData, CyclePlan, cycle_of
from pneudrive.friction.strokes import stroke_rows
from pneudrive.rig.interface import SHARED, Identity

if TYPE_CHECKING:
    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.level import Level, RecordingResult
    from pneudrive.signals.recording import Recording

SAME_PA = 1e4  # mean pressures of recordings that differ by less are one condition
STEP_PA = 1e3  # to which the pressure of a condition is rounded


def reading_of(found: Characterisation, name: str = "recordings") -> CampaignData:
    """Return the speed levels of recordings as cycles of a campaign.

    Parameters
    ----------
    found : Characterisation
        Recordings whose samples are kept.
    name : str
        Title of the result.
    """
    members = [(result, level) for result in found.results for level in result.levels]
    plans = _plans(members)
    edges = common_edges([r.recording.position_m for r in found.results])
    sliding = [
        _cycle(result, level, plan, grid_of(edges)) for (result, level), plan in zip(members, plans, strict=True)
    ]
    return CampaignData(
        name=name,
        source=next((r.source.parent for r in found.recordings if r.source is not None), Path()),
        identity=_identity(found.recordings[0], name),
        files=(),
        sliding=tuple(data for data in sliding if data.sides),
        tares=(),
        gain=Gain(),
        pressure_zeros={},
        skipped=tuple(Skipped(key, "", why) for key, why in found.skipped),
        notes=(),
        edges_m=edges,
        loops={},
        several=len({plan.block for plan in plans}) > 1,
    )


def _cycle(result: RecordingResult, level: Level, plan: CyclePlan, grid: Grid) -> CycleData:
    """Bring the strokes of a level to the bins of position that all levels share."""
    kept = set(map(id, level.strokes))
    used = {d: [stroke for stroke in side.used if id(stroke) in kept] for d, side in level.sides.items()}
    rows = {d: stroke_rows(result, strokes, grid) for d, strokes in used.items() if strokes}
    sides = {d: replace(level.sides[d], used=tuple(used[d])) for d, own in rows.items() if np.isfinite(own).any()}
    return replace(cycle_of(result, plan, grid, sides, rows), flags=dict(result.recording.flags))


def _identity(recording: Recording, name: str) -> Identity:
    return Identity(
        name=name,
        **{field: getattr(recording, field) for field in SHARED},
        stiffness_n_m=recording.stiffness_n_m,
        accuracy=dict(recording.accuracy),
        limits=dict(recording.limits),
        calibration=dict(recording.calibration),
        force_calibration=recording.force_calibration,
        synthetic=recording.synthetic,
    )


def _plans(members: list[tuple[RecordingResult, Level]]) -> list[CyclePlan]:
    """Return the plan of each level: its key, condition and block."""
    gauges = [level.gauge_pa for _, level in members]
    pressures = {side: _joined(np.array([gauge[side] for gauge in gauges])) for side in "ab"}
    runs = list(dict.fromkeys(level.run for _, level in members))
    plans = []
    for i, (result, level) in enumerate(members):
        recording = result.recording
        set_pa = {side: recording.ambient_pressure_pa + float(pressures[side][i]) for side in "ab"}
        labels = {name: recording.labels.get(name, "") for name in LEVELS}
        plans.append(
            CyclePlan(
                key=recording.name if len(result.levels) == 1 else f"{recording.name}#{level.index + 1}",
                kind="sweep",
                index=i + 1,
                block=runs.index(level.run) + 1,
                repeat=1,
                condition=Condition(set_pa["a"], set_pa["b"], **labels),
            )
        )
    return plans


def _joined(gauge_pa: np.ndarray) -> np.ndarray:
    """Return for each pressure the rounded mean of those that differ by less than `SAME_PA`."""
    level = levels(gauge_pa, SAME_PA)
    means = np.bincount(level, gauge_pa) / np.bincount(level)
    return STEP_PA * np.round(means / STEP_PA)[level]
