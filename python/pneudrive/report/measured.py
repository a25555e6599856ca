"""What was measured: the rig with its signs, sensors, files."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pneudrive.report import style
from pneudrive.report.page import Items, Picture, Section, Table, Text
from pneudrive.report.words import by_seal, plural, seal_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from pneudrive.characterise import Characterisation, Recording

# Channel -> (words, factor from SI, unit)
CHANNELS = {
    "position_m": ("position", 1e3, "mm"),
    "force_n": ("force", 1.0, "N"),
    "pressure_a_pa": ("pressure a", 1e-5, "bar gauge"),
    "pressure_b_pa": ("pressure b", 1e-5, "bar gauge"),
}


def section(found: Characterisation) -> Section:
    """Rig, sensors and files."""
    first = found.recordings[0]
    blocks = [
        Text(
            f"{plural(len(found.results), 'recording')} of {plural(len(by_seal(found)), 'seal')}, "
            f"{sum(len(r.strokes) for r in found.results)} strokes. All pressures below are gauge where nothing else "
            "is said. The sketch gives the signs that all figures use."
        ),
        Picture("rig", rig_caption(first), draw_rig(first)),
        _sensors(found.recordings),
        _files(found),
    ]
    left_out = tuple(f"{name} was not counted: {why}." for name, why in found.skipped)
    if left_out:
        blocks.append(Items(left_out))
    return Section("measured", "What was measured", tuple(blocks), synthetic=found.synthetic)


def rig_caption(recording: Recording) -> str:
    """Say the force balance in words and symbols."""
    return (
        "The rig, not to scale. x grows as chamber a grows; the rig's force F on the piston counts in +x; friction "
        "opposes motion. Balance = F + (p_a − p_amb) A_a − (p_b − p_amb) A_b − m a − weight; half the difference of "
        "both directions at equal position is friction, half their sum is the offset. A_a = "
        f"{recording.area_a_m2 * 1e4:.4g} cm², A_b = {recording.area_b_m2 * 1e4:.4g} cm²."
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


def _sensors(recordings: tuple[Recording, ...]) -> Table:
    """Range of each channel over all recordings, and the accuracy that was stated."""
    rows = []
    for channel, (name, factor, unit) in CHANNELS.items():
        shown, values = recordings, [getattr(r, channel) for r in recordings]
        if channel.startswith("pressure"):
            if all(is_open(r, channel[9]) for r in shown):
                rows.append((name, "–", "–", "open to ambient: not measured"))
                continue
            values = [v - r.ambient_pressure_pa for v, r in zip(values, shown, strict=True)]
        low, high = min(v.min() for v in values) * factor, max(v.max() for v in values) * factor
        stated = {r.accuracy[channel] * factor for r in recordings if channel in r.accuracy}
        accuracy = f"{max(stated):.3g} {unit.split()[0]}" if stated else "not stated: assumed (see the budget)"
        said = {r.calibration[channel] for r in recordings if channel in r.calibration}
        accuracy += f" ({'; '.join(sorted(said))})" if said else ""
        if channel == "position_m" and not stated:
            accuracy = "not stated"
        rows.append((name, f"{low:.4g}", f"{high:.4g}", f"{unit}; standard uncertainty {accuracy}"))
    rates = [(r.time_s.size - 1) / (r.time_s[-1] - r.time_s[0]) for r in recordings]
    low, high = min(rates), max(rates)
    rows.append(("sampling", f"{low:.4g}", f"{high:.4g}", "samples a second, mean of each recording"))
    rows = [(r[0], r[3], r[1], r[2]) for r in rows]
    return Table(("channel", "unit, accuracy", "lowest", "highest"), tuple(rows), "Sensors", numbers_from=2)


def _files(found: Characterisation) -> Table:
    rows = []
    for result in found.results:
        r = result.recording
        where = f"{r.source.parent.name}/{r.source.name}" if r.source else "simulated" if r.synthetic else "from Python"
        bores = f"{np.sqrt(4 * max(r.area_a_m2, r.area_b_m2) / np.pi) * 1e3:.4g}"
        counts = (str(len(r)), str(len(result.strokes)), f"{r.time_s[-1] - r.time_s[0]:.0f}", bores)
        rows.append((where, seal_of(r), r.labels.get("run", ""), r.sha256[:16] if r.sha256 else "–", *counts))
    head = ("file", "seal", "run", "SHA-256, first 16", "samples", "strokes", "duration, s", "diameter, mm")
    return Table(head, tuple(rows), "Files; the diameter is that of a circle of the piston's area", numbers_from=4)
