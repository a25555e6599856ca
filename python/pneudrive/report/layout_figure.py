"""A figure of how a proposed layout reads a foreign file."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.report import style
from pneudrive.simulation.trajectory import whole

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
    path = Path(path)
    with style.applied():
        figure = style.new_figure(5.4, WIDTH_IN)
        if proposal.recording is None:
            _draw_columns(figure, proposal)
        else:
            _draw_recording(figure, proposal)
        try:
            with whole(path) as temporary:
                figure.savefig(temporary, dpi=style.PNG_DPI)
        except (OSError, ValueError) as error:
            raise CommandError(f"the picture {path} cannot be written", value=str(error).splitlines()[0]) from None
    return path


def _draw_columns(figure, proposal: Proposal) -> None:  # noqa: ANN001 - matplotlib is imported on use
    """Draw raw columns if they do not make a recording."""
    shown = proposal.columns[:8]
    axes = figure.subplots(len(shown), 1, sharex=True, squeeze=False)[:, 0]
    roles = {guess.index: guess for guess in proposal.guesses}
    for index, (axis, values) in enumerate(zip(axes, shown, strict=True)):
        axis.plot(values[:FIRST_SAMPLES], lw=0.7, color=style.BLACK)
        guess = roles.get(index)
        name = proposal.reading.names[index] if proposal.reading.names else f"column {index}"
        axis.set_ylabel(name if guess is None else f"{name}\n{guess.role}\n({guess.unit})", fontsize=8)
    axes[-1].set_xlabel("row")
    said = proposal.problem or f"as understood, {len(proposal.strokes)} strokes found"
    figure.suptitle(f"{proposal.path.name}: {said}", fontsize=9)


def _draw_recording(figure, proposal: Proposal) -> None:  # noqa: ANN001
    """Draw the channels of the first strokes over time, and force against position."""
    recording, strokes = proposal.recording, proposal.strokes
    assert recording is not None
    names = {guess.role: guess for guess in proposal.guesses}
    stop = strokes[min(SHOWN_STROKES, len(strokes)) - 1].stop if strokes else FIRST_SAMPLES
    part = slice(0, stop)
    channels = [("position", recording.position_m * 1e3, "position / mm")]
    ambient = recording.ambient_pressure_pa
    for side in ("a", "b"):
        if f"pressure_{side}" in names:
            gauge = (getattr(recording, f"pressure_{side}_pa") - ambient) / 1e5
            channels.append((f"pressure_{side}", gauge, f"pressure {side} /\nbar gauge"))
    channels.append(("force", recording.force_n, "force, +x / N"))
    left, right = figure.subfigures(1, 2, width_ratios=(2, 1))
    axes = left.subplots(len(channels), 1, sharex=True)
    for axis, (role, values, label) in zip(axes, channels, strict=True):
        axis.plot(recording.time_s[part], values[part], lw=0.8, color=style.BLACK)
        for stroke in strokes[:SHOWN_STROKES]:
            shade = "0.85" if stroke.direction > 0 else "0.95"
            axis.axvspan(recording.time_s[stroke.start], recording.time_s[stroke.stop - 1], color=shade, lw=0)
        axis.set_ylabel(label)
        axis.grid(visible=False)
        place = names[role].column
        axis.set_title(fill(f"column {place!r}: {names[role].reason}", TITLE_WIDTH), fontsize=7)
    axes[-1].set_xlabel("time / s (dark: towards +x)")
    axis = right.subplots()
    for stroke in strokes:
        line = "-" if stroke.direction > 0 else "--"
        colour = style.BLACK if stroke.direction > 0 else style.ORANGE
        axis.plot(
            recording.position_m[stroke.samples] * 1e3, recording.force_n[stroke.samples], line, color=colour, lw=0.5
        )
    axis.set_xlabel("position / mm")
    axis.set_ylabel("force, +x / N (solid: towards +x, dashed: back)")
    figure.suptitle(f"{proposal.path.name}: as understood, {len(strokes)} strokes found", fontsize=9)
