"""Figures of a recording and its rig, and of how a proposed layout reads a foreign file."""

from __future__ import annotations

import math
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from pneudrive.errors import package_table
from pneudrive.figures import WIDTH_IN, Axis, Drawing, Figure, Line, Look, Panel, PenStroke, Rule, stack, thin
from pneudrive.report.page import spread_evenly
from pneudrive.report.render import draw_figure

if TYPE_CHECKING:
    from collections.abc import Collection, Mapping, Sequence

    from pneudrive.rig.interface import Envelope, Identity
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.proposal import Proposal
    from pneudrive.signals.recording import Recording


SHOWN_STROKES = 6
MOST_STROKES = 200  # over position: more thin lines cannot be told apart
FIRST_SAMPLES = 4000
LAYOUT_IN = 9.0
TITLE_WIDTH = 95  # characters over one panel


def write_layout_figure(proposal: Proposal, path: str | Path) -> Path:
    """Draw the channels as read, strokes shaded, and force against position.

    Parameters
    ----------
    proposal
        As returned by ``propose_layout``.
    path
        Picture to write. The suffix selects the kind (.png, .svg, .pdf).

    Returns
    -------
    pathlib.Path
        The file.

    Raises
    ------
    CommandError
        If the picture cannot be written.
    """
    if proposal.recording is None:
        figure = _columns(proposal)
    else:
        notes = {guess.role: f"column {guess.column!r}: {guess.reason}" for guess in proposal.guesses}
        title = f"{proposal.path.name}: as understood, {len(proposal.strokes)} strokes found"
        figure = record_figure(proposal.recording, proposal.strokes, notes, title)
    draw_figure(figure, path)
    return Path(path)


def _columns(proposal: Proposal) -> Figure:
    """Draw the raw columns if they do not form a recording."""
    shown = proposal.columns[:8]
    roles, panels = {guess.index: guess for guess in proposal.guesses}, []
    for index, values in enumerate(shown):
        part, guess = values[:FIRST_SAMPLES], roles.get(index)
        name = proposal.reading.names[index] if proposal.reading.names else f"column {index}"
        label = name if guess is None else f"{name}\n{guess.role}\n({guess.unit})"
        panels.append(Panel([Line(range(len(part)), part, width=0.7)], y=Axis(label, is_si=False)))
    text = proposal.problem or f"as understood, {len(proposal.strokes)} strokes found"
    return stack(panels, 5.4, x="row", title=f"{proposal.path.name}: {text}", width_in=LAYOUT_IN)


def record_figure(
    recording: Recording, strokes: Sequence[Stroke], notes: Mapping[str, str] | None = None, title: str = ""
) -> Figure:
    """Draw the channels over time with strokes shaded, and force against position.

    Parameters
    ----------
    recording : Recording
    strokes : sequence of Stroke
    notes : mapping, optional
        Channel -> title of its panel. With notes, the first strokes are drawn, otherwise all samples of all channels.
    title : str
    """
    first = strokes[:SHOWN_STROKES] if notes else strokes
    stop = first[-1].stop if first else FIRST_SAMPLES
    part = slice(0, stop, thin(recording.time_s[:stop]).step) if notes else thin(recording.time_s)
    channels = [("position", recording.position_m, "position / mm")]
    for side in ("a", "b"):
        if f"pressure_{side}" in notes if notes else not is_open(recording, side):
            gauge = getattr(recording, f"pressure_{side}_pa") - recording.ambient_pressure_pa
            channels.append((f"pressure_{side}", gauge, f"pressure {side} /\nbar gauge"))
    channels.append(("force", recording.force_n, "force, +x / N"))
    time, panels = recording.time_s - (0.0 if notes else recording.time_s[0]), []
    spans = [
        Rule((time[s.start], time[s.stop - 1]), look=Look("shade two" if s.direction > 0 else "shade"))
        for s in first
        if notes or s.direction > 0
    ]
    for role, values, label in channels:
        note = fill((notes or {}).get(role, ""), TITLE_WIDTH)
        panels.append(Panel([*spans, Line(time[part], values[part], width=0.8)], note, y=label))
    loops = [
        Line(
            recording.position_m[s.samples],
            recording.force_n[s.samples],
            look=Look() if s.direction > 0 else Look("orange", "--"),
            width=0.5,
        )
        for s in spread_evenly(strokes, MOST_STROKES)
    ]
    tall = Panel(loops, "", "position / mm", "force, +x / N (solid: towards +x, dashed: back)")
    more = {"tall": tall, "widths": (2, 1), "width_in": LAYOUT_IN if notes else WIDTH_IN, "text_scale": 0.85}
    height = 5.4 if notes else 1.4 * len(panels)
    return stack(panels, height, x="time / s (dark: towards +x)", title=title, **more)


# --- Sketches of rigs, from strokes in a table.


def sketch(name: str, there: Collection[str] = (), **values: object) -> Figure:
    """Return a sketch of ``sketches.toml`` with values in its texts and the optional parts that are present."""
    table = package_table(__file__, "sketches.toml")[name]
    strokes = [_stroke(one, values) for one in table["strokes"] if one.get("when", "") in ("", *there)]
    drawing = Drawing(strokes, tuple(table["x"]), tuple(table["y"]), equal=table.get("equal", False))
    width_in = table.get("width_in", WIDTH_IN)
    return Figure([Panel([drawing])], row_in=table["height_in"], rest_in=0.0, width_in=width_in)


def _stroke(table: Mapping[str, Any], values: Mapping[str, object]) -> PenStroke:
    own = {key: value for key, value in table.items() if key not in ("when", "box")}
    if "box" in table:
        x, y, width, height = table["box"]
        right, top = x + width, y + height
        own["points"] = [(x, y), (right, y), (right, top), (x, top), (x, y)]
    return PenStroke(**own | {"text": own.get("text", "").format(**values)})


def is_open(recording: Recording, side: str) -> bool:
    """Return whether a chamber was open to ambient: its pressure equals ambient exactly."""
    values = getattr(recording, f"pressure_{side}_pa")
    return bool(np.ptp(values) == 0 and abs(values[0] - recording.ambient_pressure_pa) < 1.0)


def recorded_rig(recording: Recording) -> Figure:
    """Draw cylinder, piston, force sensor and servo or hand, with signs."""
    incline = recording.incline_rad
    states = {}
    for side in "ab":
        stated = "stated" if np.ptp(getattr(recording, f"pressure_{side}_pa")) == 0 else "measured"
        states[side] = "open to ambient" if is_open(recording, side) else f"p_{side} {stated}"
    return sketch("recording", ["inclined"] if incline else [], **states, incline=np.degrees(incline))


def rig_diagram(identity: Identity, envelope: Envelope) -> Figure:
    """Draw a rig with its stated values."""
    sensor = []
    if "force_n" in identity.limits:
        sensor.append(f"±{max(abs(v) for v in identity.limits['force_n']):.0f} N")
    if "force_n" in identity.accuracy:
        sensor.append(f"u = {identity.accuracy['force_n']:.2g} N")
    if identity.stiffness_n_m is not None:
        sensor.append(f"{1e-6 * identity.stiffness_n_m:.3g} N/µm")
    low, high = (1e-5 * (p - identity.ambient_pressure_pa) for p in envelope.pressure_pa)
    return sketch(
        "rig",
        [identity.chambers if identity.chambers in ("open", "common") else "separate"],
        low_mm=1e3 * envelope.position_m[0],
        high_mm=1e3 * envelope.position_m[1],
        speed_mm_s=1e3 * envelope.speed_m_s,
        acceleration=envelope.acceleration_m_s2,
        jerk=envelope.jerk_m_s3,
        sensor=", ".join(sensor),
        bore_mm=2e3 * math.sqrt(identity.area_a_m2 / math.pi),
        mass=identity.mass_beyond_sensor_kg,
        held="pressures held" if identity.chambers == "held" else "a regulator for each chamber",
        served=f"{max(low, 0.0):.2g} to {high:.3g} bar gauge",
    )
