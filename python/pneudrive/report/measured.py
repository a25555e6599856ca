"""What was measured: the rig with its signs, sensors, files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.topics import Topic
from pneudrive.report.words import by_seal, plural, seal_of

if TYPE_CHECKING:
    from collections.abc import Iterator

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characterise.characterisation import Characterisation
    from pneudrive.characterise.recording import Recording
    from pneudrive.report.page import Section

# Channel -> (words, factor from SI, unit)
CHANNELS = {
    "position_m": ("position", 1e3, "mm"),
    "force_n": ("force", 1.0, "N"),
    "pressure_a_pa": ("pressure a", 1e-5, "bar gauge"),
    "pressure_b_pa": ("pressure b", 1e-5, "bar gauge"),
}


def section(found: Characterisation) -> Section:
    """Rig, sensors and files."""
    topic, first = Topic("recordings", "measured"), found.recordings[0]
    strokes = sum(len(r.strokes) for r in found.results)
    counts = {"recordings": plural(len(found.results), "recording"), "seals": plural(len(by_seal(found)), "seal")}
    areas = {"area_a": first.area_a_m2 * 1e4, "area_b": first.area_b_m2 * 1e4}
    return topic.section(
        topic.text(**counts, strokes=strokes),
        topic.picture("rig", draw_rig(first), **areas),
        topic.table(_sensors(found.recordings), "sensors"),
        topic.table(_files(found), "files"),
        *topic.listed(topic.say("left_out", name=name, why=why) for name, why in found.skipped),
    )


def is_open(recording: Recording, side: str) -> bool:
    """Whether a chamber was open to ambient: its pressure is exactly that."""
    values = getattr(recording, f"pressure_{side}_pa")
    return bool(np.ptp(values) == 0 and abs(values[0] - recording.ambient_pressure_pa) < 1.0)


def draw_rig(recording: Recording) -> Figure:
    """Sketch of cylinder, piston, force sensor and servo or hand, with signs."""
    from matplotlib.patches import FancyBboxPatch, Rectangle

    figure = style.new_figure(2.0)
    axis = figure.subplots()
    axis.set_axis_off()
    axis.set_xlim(0, 100)
    axis.set_ylim(-9, 25)
    wall = {"facecolor": "#cfcfcf", "edgecolor": style.BLACK, "lw": 0.8}
    for x, y, w, h in (
        (38, 0, 56, 1.4),
        (38, 18.6, 56, 1.4),
        (92.6, 0, 1.4, 20),
        (38, 0, 1.4, 8.4),
        (38, 11.6, 1.4, 8.4),
    ):
        axis.add_patch(Rectangle((x, y), w, h, **wall))
    axis.add_patch(Rectangle((62, 1.4), 5, 17.2, facecolor="#8f8f8f", edgecolor=style.BLACK, lw=0.8))
    for y in (1.4, 16.8):
        axis.add_patch(Rectangle((63.6, y), 1.8, 1.8, facecolor=style.BLACK))
    axis.add_patch(Rectangle((27, 9.1), 35, 1.8, **wall))  # rod or carriage through which the rig acts
    axis.add_patch(
        FancyBboxPatch((19, 6.6), 8, 6.8, boxstyle="round,pad=0.2", facecolor="white", edgecolor=style.BLACK)
    )
    axis.text(23, 10, "force\nsensor", ha="center", va="center", fontsize=7)
    axis.add_patch(Rectangle((4, 5), 12, 10, **wall))
    axis.text(10, 10, "rig", ha="center", va="center")
    axis.plot([16, 19], [10, 10], color=style.BLACK, lw=3)
    _chamber(axis, recording, "a", 50.5)
    _chamber(axis, recording, "b", 80)
    _arrow(axis, (28.5, 13.6), (36.5, 13.6), "F > 0", above=True)
    _arrow(axis, (70.5, 4.2), (63.2, 4.2), "", above=True)
    axis.text(71.2, 4.2, "friction, when v > 0", va="center", fontsize=7)
    _arrow(axis, (38, -4.6), (70, -4.6), "x, v > 0", above=False)
    axis.plot([38, 38], [-6, -3.2], color=style.BLACK, lw=0.8)
    if recording.incline_rad:
        axis.text(
            96, -4.6, f"inclined by {np.degrees(recording.incline_rad):.3g}°", ha="right", va="center", fontsize=7
        )
    return figure


def _chamber(axis: Axes, recording: Recording, side: str, x: float) -> None:
    state = "open to ambient" if is_open(recording, side) else f"p_{side} measured"
    if not is_open(recording, side) and np.ptp(getattr(recording, f"pressure_{side}_pa")) == 0:
        state = f"p_{side} stated"
    axis.text(x, 14.6, f"chamber {side}", ha="center", va="center", fontweight="bold", fontsize=7.5)
    axis.text(x, 12.4, state, ha="center", va="center", fontsize=7)
    axis.plot([x, x], [20, 22.6], color=style.BLACK, lw=1.0)
    axis.text(x + 1, 22, "port", fontsize=6.5, va="center")


def _arrow(axis: Axes, start: tuple[float, float], end: tuple[float, float], text: str, *, above: bool) -> None:
    axis.annotate("", xy=end, xytext=start, arrowprops={"arrowstyle": "-|>", "color": style.BLACK, "lw": 1.1})
    middle = (start[0] + end[0]) / 2
    axis.text(middle, start[1] + (1.6 if above else -1.8), text, ha="center", va="center", fontsize=7.5)


def _sensors(recordings: tuple[Recording, ...]) -> Iterator[tuple]:
    """Range of each channel over all recordings, and the accuracy that was stated."""
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
    yield "sampling", "samples a second, mean of each recording", min(rates), max(rates)


def _files(found: Characterisation) -> Iterator[tuple]:
    for result in found.results:
        r = result.recording
        where = f"{r.source.parent.name}/{r.source.name}" if r.source else "simulated" if r.synthetic else "from Python"
        diameter = np.sqrt(4 * max(r.area_a_m2, r.area_b_m2) / np.pi) * 1e3
        labels = (seal_of(r), r.labels.get("run", ""), r.sha256[:16] if r.sha256 else None)
        yield where, *labels, len(r), len(result.strokes), r.time_s[-1] - r.time_s[0], diameter
