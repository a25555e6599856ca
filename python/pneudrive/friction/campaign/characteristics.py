"""All characteristics of a campaign folder, computed by one function."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.batching import many_objects
from pneudrive.campaign.storage.folder import Campaign
from pneudrive.estimate.threads import one_thread
from pneudrive.friction.campaign.curves import (
    air_shares,
    asymmetries,
    bands_of,
    curves_of,
    cycle_terms,
    fit_points,
    sensor_zero,
    sources,
    stick_slip_points,
    thresholds,
)
from pneudrive.friction.campaign.cycles import SHOWN_CONDITIONS, Loop
from pneudrive.friction.campaign.files import friction_map
from pneudrive.friction.campaign.points import CurvePoints, condensed, points_of, suspicions
from pneudrive.friction.campaign.reading import CampaignData, read_campaign, reading_of
from pneudrive.friction.campaign.result import CampaignCharacteristics, CycleResult, Ranges
from pneudrive.friction.campaign.statements import statements
from pneudrive.friction.campaign.stops.dwell_law import fit_dwell
from pneudrive.friction.campaign.stops.stop import find_stops
from pneudrive.friction.campaign.trends import (
    causes,
    drift_of,
    position_dependence,
    pressure_effects,
    pure_scatter,
    repeatability,
)
from pneudrive.friction.motion import SAMPLE_CHOICES, Settled
from pneudrive.progress import Watch
from pneudrive.signals.load import recordings_in

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    import xarray as xr

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.friction.motion import SampleChoice
    from pneudrive.progress import Flag
    from pneudrive.signals.layout import Layout
    from pneudrive.signals.recording import Recording

STEPS = 3  # cycles, models, stops
MEANS = ("friction_n", "offset_n", "stderr_n")


def campaign_friction(
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
        found = _characterise(reading, choice)
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
        Recordings, files or trajectories (what ``pn.simulate`` returns), or one of them; a folder with recordings and
        ``layout.toml``; or the folder of a campaign.
    layout
        Layout or its file for the reading of recordings. None: ``layout.toml`` next to each recording. Not used for a
        campaign.
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
    from pneudrive.friction.characterisation import characterise_recordings

    if isinstance(recordings, str | Path) and Path(recordings).is_dir():
        files = recordings_in(Path(recordings))
        if not files:
            return campaign_friction(recordings, protocol).friction_map
        recordings = files
    return characterise_recordings(recordings, layout, protocol).friction_map


def recorded_characteristics(found: Characterisation) -> CampaignCharacteristics | None:
    """Return curves, effects and statements of recordings, as of a campaign without a plan.

    Parameters
    ----------
    found : Characterisation
        Result of ``characterise_recordings``.

    Returns
    -------
    CampaignCharacteristics or None
        With the friction map of the recordings; None if only some of the recordings were kept in memory.
    """
    if len(found.stroke_uses) > len(found.results):
        return None
    with one_thread():
        reduced = _characterise(reading_of(found), SAMPLE_CHOICES[found.protocol]())
    return replace(reduced, friction_map=found.friction_map)


@many_objects()
def _characterise(reading: CampaignData, choice: SampleChoice) -> CampaignCharacteristics:
    points = points_of(reading)
    large = points is not None and points.is_large
    fitted = condensed(points) if points is not None and large else points
    fits = fit_points(fitted, reading.tares, condensed=large) if fitted is not None else None
    if fits is not None and not large:
        points = fits.points  # outliers are known now; a campaign that was condensed for its fits stays so
    rig, why, pure, bands, parts = reading.identity, None, None, (), {}
    terms = None if points is None else cycle_terms(points, fits)
    if fits is not None:
        bands, separated = bands_of(fits), rig.pressure_measured_at == "chamber"
        parts["curves"] = curves_of(fits, bands, contains_air=not separated)
        parts["air"] = air_shares(fits, bands, separated=separated)
        parts["asymmetry"] = asymmetries(fits, bands)
    parts["zero"] = sensor_zero(reading.tares)
    if fits is not None:
        why, pure = causes(fits), pure_scatter(fits)
        parts["drift"] = drift_of(fits, why)
        parts["repeatability"] = repeatability(fits, pure)
        parts["pressure"] = pressure_effects(fits, rig.ambient_pressure_pa)
        parts["sources"] = sources(fits, bands, reading.gain, rig.force_calibration)
    if points is not None:
        parts["position"] = position_dependence(points)
        parts["stick_slip"] = stick_slip_points(points)
        parts["stick_slip_thresholds"] = thresholds(points)
        parts["loops"] = _loops(reading, points)
    cycles = _cycles(reading, points)
    found = CampaignCharacteristics(
        name=reading.name,
        folder=reading.source,
        identity=rig,
        protocol=choice.name,
        cycles=cycles,
        skipped=reading.skipped,
        flags=dict(Counter(flag for cycle in cycles for flag in cycle.flags)),
        ranges=_ranges(reading),
        friction_map=friction_map(reading, points, fits, terms, choice.name),
        **parts,
    )
    doubts = suspicions(reading.sliding, rig.accuracy, rig.ambient_pressure_pa)
    return replace(found, statements=statements(found, reading, doubts, points, fits, bands, why, pure))


def _loops(reading: CampaignData, points: CurvePoints) -> tuple[Loop, ...]:
    """Return the loops, without offset, of the slowest, a middle and the fastest cycle of the first conditions."""
    loops = []
    for index in range(len(points.conditions[:SHOWN_CONDITIONS])):
        shown: dict[int, int] = {}  # level -> its first cycle with a loop
        for i in np.flatnonzero(points["curve"] == index).tolist():
            if points["key"][i] in reading.loops:
                shown.setdefault(int(points["level"][i]), i)
        for _, i in sorted(shown.items()):
            loop = reading.loops[points["key"][i]]
            loops.append(replace(loop, friction_n=loop.friction_n - float(points["offset_n"][i])))
    return tuple(loops)


def _with_stops(
    found: CampaignCharacteristics, opened: Campaign, reading: CampaignData, processes: int | None
) -> CampaignCharacteristics:
    """Add the results of the stops, if any."""
    if not any(file.head.cycle.kind == "stop" for file in reading.files):
        return found
    stops, lost = find_stops(opened, processes, reading.files)
    dwell, said = fit_dwell(stops, opened.identity.ambient_pressure_pa)
    skipped, statements_ = (*found.skipped, *lost), (*found.statements, *said)
    return replace(found, stops=stops, dwell=dwell, skipped=skipped, statements=statements_)


def _cycles(reading: CampaignData, points: CurvePoints | None) -> tuple[CycleResult, ...]:
    """Return a summary of all cycles that were read."""
    place = {key: i for i, key in enumerate(points["key"])} if points is not None else {}
    found = []
    for cycles in (reading.sliding, reading.tares):
        speeds = cycles.over_sides("velocity_m_s").tolist()
        names = ("index", "key", "kind", "block", "repeat", "day", "condition", "travel_m", "temperature_k")
        columns = {name: cycles[name].tolist() for name in names}
        for row, (key, speed, began, flags) in enumerate(
            zip(cycles["key"], speeds, cycles["elapsed_s"].tolist(), cycles["flags"], strict=True)
        ):
            i, means, reason = place.get(key), [float("nan")] * 3, ""
            if points is not None and i is not None:
                reason = points["reason"][i]
                means = [float(points[name][i]) for name in ("friction_n", "offset_n", "friction_stderr_n")]
            own = {name: values[row] for name, values in columns.items()}
            raised = (*flags, *([reason] if reason else []))
            found.append(
                CycleResult(speed_m_s=speed, began_s=began, **own, **dict(zip(MEANS, means, strict=True)), flags=raised)
            )
    return tuple(sorted(found, key=lambda cycle: cycle.index))


def _ranges(reading: CampaignData) -> Ranges:
    """Return the lowest and highest measured values."""
    cycles, ambient = reading.sliding, reading.identity.ambient_pressure_pa

    def span(values: np.ndarray) -> tuple[float, float]:
        known = values[np.isfinite(values)]
        return (float(known.min()), float(known.max())) if known.size else (float("nan"), float("nan"))

    return Ranges(
        speed_m_s=span(np.abs(cycles["velocity_m_s"])),
        gauge_a_pa=span(cycles["pressure_a_pa"] - ambient),
        gauge_b_pa=span(cycles["pressure_b_pa"] - ambient),
        temperature_k=span(cycles["temperature_k"]),
    )
