"""From a campaign folder to its characteristics: one call, one result."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.bulk import many_objects
from pneudrive.campaign.folder import Campaign
from pneudrive.friction.campaign.curves.curves import Points, curves_of, fit_points, points_of
from pneudrive.friction.campaign.cycles.reading import CampaignData, read_campaign
from pneudrive.friction.campaign.effects.air import air_shares
from pneudrive.friction.campaign.effects.budget import sources
from pneudrive.friction.campaign.effects.drift import causes, drift_of, repeatability
from pneudrive.friction.campaign.effects.loops import loops
from pneudrive.friction.campaign.effects.position import position_dependence
from pneudrive.friction.campaign.effects.pressure import pressure_effects
from pneudrive.friction.campaign.effects.stick_slip import stick_slip_points, thresholds
from pneudrive.friction.campaign.effects.zero import asymmetries, sensor_zero
from pneudrive.friction.campaign.result import CampaignCharacteristics, CycleResult, Ranges
from pneudrive.friction.campaign.statements import statements
from pneudrive.friction.campaign.stops.dwell_law import fit_dwell
from pneudrive.friction.campaign.stops.stop import find_stops
from pneudrive.friction.campaign.table import friction_map
from pneudrive.friction.campaign.threads import one_thread
from pneudrive.friction.reduction.settling import Settled
from pneudrive.watch import Watch

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pneudrive.friction.reduction.settling import SampleChoice
    from pneudrive.signals.layout import Layout
    from pneudrive.signals.recording import Recording
    from pneudrive.watch import Flag

STEPS = 3  # cycles, models, stops


def characteristics(
    campaign: Campaign | str | Path,
    protocol: SampleChoice | None = None,
    processes: int | None = None,
    progress: Callable[[float, float, str], None] | None = None,
    cancel: Flag | None = None,
) -> CampaignCharacteristics:
    """Characterise a campaign.

    Parameters
    ----------
    campaign : Campaign or path-like
        An open campaign or its folder.
    protocol : SampleChoice, optional
        Selection of samples: ``Settled()`` (default) or ``SourcePaper()``.
    processes : int, optional
        Number of processes that read the cycles; None: one for each processor.
    progress : callable, optional
        Called as ``progress(done, total, task)``.
    cancel : object with ``is_set()``, optional
        Ends the call once it is set.

    Returns
    -------
    CampaignCharacteristics

    Raises
    ------
    CampaignError
        If the folder is not a campaign, or no cycle can be used.
    Cancelled
        If the flag was set.
    """
    watch = Watch(progress, cancel)
    opened = campaign if isinstance(campaign, Campaign) else Campaign.open(campaign)
    choice = protocol if protocol is not None else Settled()
    task = f"steps of {opened.path.name}"
    watch.tell(0, STEPS, f"{task} (cycles)")
    reading = read_campaign(opened, choice, processes)
    watch.tell(1, STEPS, f"{task} (models)")
    with one_thread():
        found = _characterise(opened, choice, reading)
        watch.tell(2, STEPS, f"{task} (stops)")
        found = _with_stops(found, opened, reading, processes)
    watch.tell(STEPS, STEPS, task)
    return found


def characterise(
    recordings: Sequence[Recording | str | Path | xr.Dataset] | Recording | str | Path | xr.Dataset,
    layout: Layout | str | Path | None = None,
    protocol: SampleChoice | None = None,
) -> xr.Dataset:
    """Return the friction map of recordings or of a campaign.

    Parameters
    ----------
    recordings
        Recordings, files or trajectories (what ``pn.simulate`` returns), or one of them; or the folder of a campaign.
    layout
        How files are read: a layout, its file, None for ``layout.toml`` beside each recording; unused for a campaign.
    protocol
        Selection of samples: ``Settled()`` (default) or ``SourcePaper()``.

    Returns
    -------
    xarray.Dataset
        One dimension ``row`` (recording or cycle, speed level, direction); every variable has its unit. The map of
        a campaign has further columns: its 95 % band and the levels of the plan.

    Raises
    ------
    RecordingError, LayoutError, CampaignError
        If a file, recording or folder cannot be used.
    """
    if isinstance(recordings, str | Path) and Path(recordings).is_dir():
        return characteristics(recordings, protocol).friction_map
    from pneudrive.friction.recording.characterisation import characterise_recordings

    return characterise_recordings(recordings, layout, protocol).friction_map


@many_objects()
def _characterise(opened: Campaign, choice: SampleChoice, reading: CampaignData) -> CampaignCharacteristics:
    points = points_of(reading)
    fits = fit_points(reading, points) if points is not None else None
    if points is not None and fits is not None and len(fits.points) == len(points):
        points = fits.points  # outliers are known now; a campaign that was condensed for its fits stays so
    cycles = _cycles(reading, points)
    found = CampaignCharacteristics(
        name=str(opened.about.get("name", opened.path.name)),
        folder=opened.path,
        identity=opened.identity,
        protocol=choice.name,
        cycles=cycles,
        skipped=reading.skipped,
        flags=dict(Counter(flag for cycle in cycles for flag in cycle.flags)),
        friction_map=friction_map(reading, points, fits, choice.name),
        zero=sensor_zero(reading),
        ranges=_ranges(reading),
    )
    why = None
    if points is not None:
        files = {file.head.cycle.key: file for file in reading.files}
        found = replace(
            found,
            position=position_dependence(points),
            stick_slip=stick_slip_points(points),
            stick_slip_thresholds=thresholds(points),
            loops=loops(points, files, opened.identity),
        )
    if fits is not None:
        why = causes(reading, fits)
        found = replace(
            found,
            curves=curves_of(fits, contains_air=opened.identity.pressure_measured_at != "chamber"),
            sources=sources(fits, reading.gain, reading.identity.force_calibration),
            asymmetry=asymmetries(fits),
            air=air_shares(reading, fits),
            pressure=pressure_effects(reading, fits),
            drift=drift_of(reading, fits, why),
            repeatability=repeatability(fits),
        )
    return replace(found, statements=statements(found, reading, points, fits, why))


def _with_stops(
    found: CampaignCharacteristics, opened: Campaign, reading: CampaignData, processes: int | None
) -> CampaignCharacteristics:
    """Add the results of the stops, if there are any."""
    if not any(head.cycle.kind == "stop" for head in reading.heads):
        return found
    stops, lost = find_stops(opened, processes, reading.files)
    dwell, said = fit_dwell(stops, opened.identity.ambient_pressure_pa)
    skipped, statements_ = (*found.skipped, *lost), (*found.statements, *said)
    return replace(found, stops=stops, dwell=dwell, skipped=skipped, statements=statements_)


def _cycles(reading: CampaignData, points: Points | None) -> tuple[CycleResult, ...]:
    """Return a summary of all cycles that were read."""
    days = reading.days()
    first = min((head.began_s for head in reading.heads), default=0.0)
    place = {d.head.cycle.key: i for i, d in enumerate(points.reduced.data)} if points is not None else {}
    found = []
    for d in sorted((*reading.sliding, *reading.tares), key=lambda d: d.head.index):
        cycle, i = d.head.cycle, place.get(d.head.cycle.key)
        speeds = [abs(side.velocity_m_s) for side in d.sides.values()]
        means, reason = [float("nan")] * 3, ""
        if points is not None and i is not None:
            reduced, reason = points.reduced, points.reasons[i]
            means = [float(v[i]) for v in (reduced.friction_n, reduced.offset_n, reduced.friction_stderr_n)]
        found.append(
            CycleResult(
                index=d.head.index,
                key=cycle.key,
                kind=cycle.kind,
                block=cycle.block,
                repeat=cycle.repeat,
                day=days[cycle.key],
                condition=d.condition,
                speed_m_s=float(np.mean(speeds)) if speeds else float("nan"),
                began_s=d.head.began_s - first,
                travel_m=reading.travel_m[cycle.key],
                temperature_k=d.temperature_k,
                friction_n=means[0],
                offset_n=means[1],
                stderr_n=means[2],
                flags=(*d.flags, *([reason] if reason else [])),
            )
        )
    return tuple(found)


def _ranges(reading: CampaignData) -> Ranges:
    """Return the lowest and highest measured values."""
    sides = [side for d in reading.sliding for side in d.sides.values()]
    ambient = reading.identity.ambient_pressure_pa
    temperatures = [d.temperature_k for d in reading.sliding if np.isfinite(d.temperature_k)]

    def span(values: list[float]) -> tuple[float, float]:
        return (min(values), max(values)) if values else (float("nan"), float("nan"))

    return Ranges(
        speed_m_s=span([abs(s.velocity_m_s) for s in sides]),
        gauge_a_pa=span([s.pressure_a_pa - ambient for s in sides]),
        gauge_b_pa=span([s.pressure_b_pa - ambient for s in sides]),
        temperature_k=span(temperatures),
    )
