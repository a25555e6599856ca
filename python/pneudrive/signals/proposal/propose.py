"""Proposal of a layout for a foreign recording, with every guess marked."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.progress import UNWATCHED
from pneudrive.signals.cycles import find_cycles, read_cycles
from pneudrive.signals.drive_recording import read_drive_recordings, read_volume_recordings
from pneudrive.signals.importer import read_foreign
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import load_recording
from pneudrive.signals.motion import find_strokes
from pneudrive.signals.proposal.propose_text import layout_text
from pneudrive.signals.proposal.roles import Guess, RoleSearch

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from pneudrive.progress import Watch
    from pneudrive.signals.motion import Stroke
    from pneudrive.signals.recording import Recording
    from pneudrive.signals.tables.sniff import FileForm

STAGES = 3
MOST_TAGS = 100  # different texts that name the channels of a table with one row for each value
MOST_NAMED = 8  # columns in a message


@dataclass(frozen=True)
class Proposal:
    """A proposed layout, and the data as read, for a picture.

    ``kind`` is the kind of recording: a ``rig``, a ``drive``, a ``fixed-volume``. ``columns`` has the raw numbers of
    every column. ``recording`` and ``strokes`` are the file as read by the layout. They are None and empty if it is not
    a recording of a rig, or not readable, with the reason in ``problem``. ``unused`` has the columns of numbers that
    the layout does not use.
    """

    path: Path
    text: str
    reading: FileForm
    guesses: tuple[Guess, ...]
    columns: tuple[NDArray[np.float64], ...]
    recording: Recording | None
    strokes: tuple[Stroke, ...]
    problem: str
    kind: str = "rig"
    unused: tuple[str, ...] = ()

    @property
    def asks(self) -> bool:
        """Whether the problem is a question to the user."""
        return self.problem.startswith("the file does not")


def propose_layout(path: str | Path, watch: Watch = UNWATCHED) -> Proposal:
    """Propose how to read a foreign recording.

    Parameters
    ----------
    path
        The file.
    watch
        Receives the present step.

    Returns
    -------
    Proposal
        ``text`` is the layout file, with guesses marked.

    Raises
    ------
    RecordingError
        The file does not exist, is empty or of an unknown format, or does not contain a table of numbers. Or the table
        is not a recording of a rig, a drive or a fixed volume.
    """
    path = Path(path)
    watch.tell(0, STAGES, "reading the file")
    reading, columns = read_foreign(path)
    if max((column.size for column in columns), default=0) < 2:
        raise RecordingError("the file holds no samples", where=str(path), value=f"columns: {', '.join(reading.names)}")
    watch.tell(1, STAGES, "looking at the columns")
    roles = RoleSearch.of(reading, columns)
    kind = _kind(path, roles)
    if kind == "fixed-volume":
        roles.guesses = _one_pressure(roles.guesses)
    elif kind == "rig":
        roles.ask_chambers()
    else:
        roles.questions = [question for question in roles.questions if question.role != "force"]
    text = layout_text(path, roles, kind)
    watch.tell(2, STAGES, "reading the file by the proposed layout")
    recording, strokes = None, ()
    problem = "; ".join(question.text for question in roles.questions)
    try:
        if problem:
            raise RecordingError(f"the file does not contain all information. {problem}")
        layout = Layout.loads(text, origin="proposed layout")
        if kind == "fixed-volume":
            read_volume_recordings([path], layout)
        elif kind == "drive":
            record = read_drive_recordings([path], layout)[0]
            strokes = tuple(find_strokes(record.name, record.time_s, record["position_m"]))
        else:
            recording = _first_recording(path, layout)
            strokes = tuple(find_strokes(recording.name, recording.time_s, recording.position_m))
    except PneudriveError as error:
        problem = error.what
    watch.tell(STAGES, STAGES, "reading the file by the proposed layout")
    unused = tuple(str(column.place) for column in roles.unused)
    return Proposal(
        path, text, reading, tuple(roles.guesses), tuple(columns), recording, strokes, problem, kind, unused
    )


def _kind(path: Path, roles: RoleSearch) -> str:
    """Return the kind of recording, by the roles that were found or are open questions.

    Raises
    ------
    RecordingError
        If the kind is unknown: a layout would be meaningless.
    """
    found = {guess.role for guess in roles.guesses}
    found |= {role for question in roles.questions for role in re.findall(r"\w+", question.role)}
    has_pressure = any("pressure" in role for role in found)
    if {"position", "command"} <= found and has_pressure:
        return "drive"
    if "position" in found and ("force" in found or has_pressure or roles.questions):
        return "rig"
    if "position" not in found and "force" not in found and has_pressure:
        return "fixed-volume"
    reading, headers = roles.form, roles.columns
    tags = [at for at, count in reading.words.items() if 1 < count <= MOST_TAGS]
    values = [one.index for one in headers if one.index not in reading.words and one.role != "time"]
    if tags and len(values) == 1 and reading.names:
        time = next((header.name for header in headers if header.role == "time"), "TIME")
        index = f'index="{time}", columns="{headers[tags[0]].name}", values="{headers[values[0]].name}"'
        raise RecordingError(
            "this table has one row for each value of each channel",
            where=str(path),
            rule="a recording has one row for each time, with a column for each channel",
            remedy=f'pivot it before, in pandas: pd.read_csv("{path.name}").pivot({index}).to_csv("wide.csv")',
        )
    shown = ", ".join(f"{g.role}: column {g.column!r}" for g in roles.guesses)
    named = f"columns: {', '.join(reading.names)}" if reading.names else ""
    remedy = "if it is a recording, write the layout by hand: see the guide, Your own recordings"
    if raw := [header.name for header in headers if header.is_raw and header.name]:
        example = f'position = {{ column = "{raw[0]}", unit = "mm", scale = 20.0 }}'
        remedy += f"; {', '.join(raw[:MOST_NAMED])} need a role, a unit and a scale, as in {example}"
    raise RecordingError(
        "this table is not a recording, according to names and numbers",
        where=str(path),
        value="; ".join(text for text in (shown, named) if text)[:300],
        rule="time, position and force of a rig; time, command, position and pressures of a drive; time and pressure "
        "of a fixed volume",
        remedy=remedy,
    )


def _one_pressure(guesses: list[Guess]) -> list[Guess]:
    """Keep time, command and one pressure, because the pressure of a volume does not belong to a chamber."""
    first = next((g for g in guesses if g.role.startswith("pressure")), None)
    kept = [g for g in guesses if g.role in ("time", "command")]
    return kept if first is None else [*kept, replace(first, role="pressure", reason=first.reason.partition(";")[0])]


def _first_recording(path: Path, layout: Layout) -> Recording:
    if layout.for_file(path).cycle is None:
        return load_recording(path, layout)
    return next(read_cycles(find_cycles(path, layout).part(0, 1)))
