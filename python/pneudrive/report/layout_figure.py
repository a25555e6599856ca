"""A figure of how a proposed layout reads a foreign file."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.figures import Axis, Figure, Line, Look, Panel, Rule, stack
from pneudrive.report.render import draw_figure

if TYPE_CHECKING:
    from pneudrive.signals.proposal import Proposal

SHOWN_STROKES = 6
FIRST_SAMPLES = 4000
WIDTH_IN = 9.0
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
    figure = _columns(proposal) if proposal.recording is None else _recording(proposal)
    try:
        draw_figure(figure, path)
    except (OSError, ValueError) as error:
        raise CommandError(f"the picture {path} cannot be written", value=str(error).splitlines()[0]) from None
    return Path(path)


def _columns(proposal: Proposal) -> Figure:
    """Draw raw columns if they do not make a recording."""
    shown = proposal.columns[:8]
    roles, panels = {guess.index: guess for guess in proposal.guesses}, []
    for index, values in enumerate(shown):
        part, guess = values[:FIRST_SAMPLES], roles.get(index)
        name = proposal.reading.names[index] if proposal.reading.names else f"column {index}"
        label = name if guess is None else f"{name}\n{guess.role}\n({guess.unit})"
        panels.append(Panel([Line(range(len(part)), part, width=0.7)], y=Axis(label, is_si=False)))
    text = proposal.problem or f"as understood, {len(proposal.strokes)} strokes found"
    return stack(panels, 5.4, x="row", title=f"{proposal.path.name}: {text}", width_in=WIDTH_IN)


def _recording(proposal: Proposal) -> Figure:
    """Draw the channels of the first strokes over time, and force against position."""
    recording, strokes = proposal.recording, proposal.strokes
    assert recording is not None
    names = {guess.role: guess for guess in proposal.guesses}
    part = slice(0, strokes[min(SHOWN_STROKES, len(strokes)) - 1].stop if strokes else FIRST_SAMPLES)
    channels = [("position", recording.position_m, "position / mm")]
    for side in ("a", "b"):
        if f"pressure_{side}" in names:
            gauge = getattr(recording, f"pressure_{side}_pa") - recording.ambient_pressure_pa
            channels.append((f"pressure_{side}", gauge, f"pressure {side} /\nbar gauge"))
    channels.append(("force", recording.force_n, "force, +x / N"))
    time, panels = recording.time_s, []
    spans = [
        Rule((time[s.start], time[s.stop - 1]), look=Look("shade two" if s.direction > 0 else "shade"))
        for s in strokes[:SHOWN_STROKES]
    ]
    for role, values, label in channels:
        title = fill(f"column {names[role].column!r}: {names[role].reason}", TITLE_WIDTH)
        panels.append(Panel([*spans, Line(time[part], values[part], width=0.8)], title, y=label))
    loops = [
        Line(
            recording.position_m[s.samples],
            recording.force_n[s.samples],
            look=Look() if s.direction > 0 else Look("orange", "--"),
            width=0.5,
        )
        for s in strokes
    ]
    tall = Panel(loops, "", "position / mm", "force, +x / N (solid: towards +x, dashed: back)")
    more = {"tall": tall, "widths": (2, 1), "width_in": WIDTH_IN, "text_scale": 0.85}
    title = f"{proposal.path.name}: as understood, {len(strokes)} strokes found"
    return stack(panels, 5.4, x="time / s (dark: towards +x)", title=title, **more)
