"""The section on the measurement: rig with its signs, sensors, files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report.sketch import draw_sketch
from pneudrive.report.topics import Topic
from pneudrive.report.words import by_seal, plural, seal_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.figure import Figure

    from pneudrive.friction.characterisation import Characterisation
    from pneudrive.report.page import Section
    from pneudrive.signals.recording import Recording

# Channel -> (words, factor from SI, unit)
CHANNELS = {
    "position_m": ("position", 1e3, "mm"),
    "force_n": ("force", 1.0, "N"),
    "pressure_a_pa": ("pressure a", 1e-5, "bar gauge"),
    "pressure_b_pa": ("pressure b", 1e-5, "bar gauge"),
}


def section(found: Characterisation) -> Section:
    """Return the section on rig, sensors and files."""
    topic, first = Topic("recordings", "measured"), found.recordings[0]
    uses = found.stroke_uses.values()
    strokes = {"used": sum(use.used for use in uses), "strokes": sum(use.recorded for use in uses)}
    counts = {"recordings": plural(len(found.results), "recording"), "seals": plural(len(by_seal(found)), "seal")}
    areas = {"area_a": first.area_a_m2 * 1e4, "area_b": first.area_b_m2 * 1e4}
    return topic.section(
        topic.text(**counts, **strokes),
        topic.picture("rig", draw_rig(first), **areas),
        topic.table(_sensors(found.recordings), "sensors"),
        topic.table(_files(found), "files"),
        *topic.listed(topic.say("left_out", name=name, why=why) for name, why in found.skipped),
    )


def is_open(recording: Recording, side: str) -> bool:
    """Return whether a chamber was open to ambient: its pressure equals ambient exactly."""
    values = getattr(recording, f"pressure_{side}_pa")
    return bool(np.ptp(values) == 0 and abs(values[0] - recording.ambient_pressure_pa) < 1.0)


def draw_rig(recording: Recording) -> Figure:
    """Draw cylinder, piston, force sensor and servo or hand, with signs."""
    incline = recording.incline_rad
    states = {side: _state(recording, side) for side in "ab"}
    return draw_sketch("recording", ["inclined"] if incline else [], **states, incline=np.degrees(incline))


def _state(recording: Recording, side: str) -> str:
    if is_open(recording, side):
        return "open to ambient"
    return f"p_{side} {'stated' if np.ptp(getattr(recording, f'pressure_{side}_pa')) == 0 else 'measured'}"


def _sensors(recordings: tuple[Recording, ...]) -> Iterator[tuple]:
    """Return range of each channel over all recordings, and its stated accuracy."""
    for channel, (name, factor, unit) in CHANNELS.items():
        values = [getattr(r, channel) for r in recordings]
        if channel.startswith("pressure"):
            if all(is_open(r, channel[9]) for r in recordings):
                yield name, "open to ambient: not measured", None, None
                continue
            values = [v - r.ambient_pressure_pa for v, r in zip(values, recordings, strict=True)]
        stated = [r.accuracy[channel] * factor for r in recordings if channel in r.accuracy]
        untold = "not stated" if channel == "position_m" else "not stated: assumed (see the budget)"
        accuracy = f"{max(stated):.3g} {unit.split()[0]}" if stated else untold
        said = {r.calibration[channel] for r in recordings if channel in r.calibration}
        if said and (stated or channel != "position_m"):
            accuracy += f" ({'; '.join(sorted(said))})"
        low, high = min(v.min() for v in values) * factor, max(v.max() for v in values) * factor
        yield name, f"{unit}; standard uncertainty {accuracy}", low, high
    rates = [(r.time_s.size - 1) / (r.time_s[-1] - r.time_s[0]) for r in recordings]
    yield "sampling", "samples per second, mean of each recording", min(rates), max(rates)


def _files(found: Characterisation) -> Iterator[tuple]:
    for result in found.results:
        r = result.recording
        where = f"{r.source.parent.name}/{r.source.name}" if r.source else "simulated" if r.synthetic else "from Python"
        diameter = np.sqrt(4 * max(r.area_a_m2, r.area_b_m2) / np.pi) * 1e3
        labels = (seal_of(r), r.labels.get("run", ""), r.sha256[:16] if r.sha256 else None)
        use = found.stroke_uses[r.name]
        strokes = (use.recorded, use.used, use.why or None)
        yield where, *labels, len(r), *strokes, r.time_s[-1] - r.time_s[0], diameter
