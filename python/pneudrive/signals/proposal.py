"""Proposal of a layout for a foreign recording, with roles of columns and the evidence. Every guess is marked."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pneudrive.arrays import Array
from pneudrive.describe.files.toml import value_text
from pneudrive.errors import PneudriveError, RecordingError
from pneudrive.files.content import rendered
from pneudrive.signals.columns import ROLES, SIGNALS, families
from pneudrive.signals.drive_recording import read_drive_recordings, read_volume_recordings
from pneudrive.signals.importer import read_foreign
from pneudrive.signals.layout import Layout, stem
from pneudrive.signals.load import RecordingFile, find_cycles
from pneudrive.signals.motion import Stroke, find_strokes
from pneudrive.signals.recording import Recording
from pneudrive.signals.roles import Guess, RoleSearch
from pneudrive.signals.text_table import FileForm
from pneudrive.units import converter

MOST_TAGS = 100  # different texts that name the channels of a table with one row for each value
MOST_NAMED = 8  # columns in a message
#: Names of absolute pressures: p_abs, psia, bara.
ABSOLUTE = re.compile(r"abs|(?:psi|bar|pa)a\b", re.IGNORECASE)
#: Names of gauge pressures: p_rel, Druck relativ, Überdruck.
GAUGE = re.compile(r"(?<![a-z])rel(?![a-z])|relativ|gau?ge|[uü]e?berdruck", re.IGNORECASE)
TEMPLATE = Path(__file__).with_name("layout.toml.j2")


@dataclass(frozen=True)
class Proposal:
    """A proposed layout, and the data read with it, for a figure.

    ``kind`` is the kind of recording: a ``rig``, a ``drive``, a ``fixed-volume``. ``columns`` has the raw numbers of
    every column. ``recording`` and ``strokes`` are the file as read by the layout. Other kinds and unreadable files
    have None and an empty list there, and the reason in ``problem``. ``unused`` has the columns of numbers that the
    layout does not use.
    """

    path: Path
    text: str
    reading: FileForm
    guesses: list[Guess]
    columns: list[Array]
    recording: Recording | None
    strokes: list[Stroke]
    problem: str
    kind: str
    unused: tuple[str, ...]

    @property
    def asks(self) -> bool:
        """Whether the problem is a question to the user."""
        return self.problem.startswith("the file does not")


def propose_layout(path: str | Path) -> Proposal:
    """Propose how to read a foreign recording.

    Parameters
    ----------
    path
        The file.

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
    reading, columns = read_foreign(path)
    if max((column.size for column in columns), default=0) < 2:
        raise RecordingError("the file holds no samples", where=str(path), value=f"columns: {', '.join(reading.names)}")
    roles = RoleSearch.of(reading, columns)
    kind = _kind(path, roles)
    if kind == "fixed-volume":  # time, command and one pressure, which does not belong to a chamber
        pressures = [guess for role, guess in roles.guesses.items() if role.startswith("pressure")][:1]
        roles.guesses = {role: roles.guesses[role] for role in ("time", "command") if role in roles.guesses}
        for guess in pressures:
            roles.guesses["pressure"] = replace(guess, role="pressure", reason=guess.reason.partition(";")[0])
    elif kind == "rig":
        roles.ask_chambers()
    else:
        roles.questions = [question for question in roles.questions if question.role != "force"]
    text = layout_text(path, roles, kind)
    recording, strokes = None, list[Stroke]()
    problem = "; ".join(question.text for question in roles.questions)
    try:
        if problem:
            raise RecordingError(f"the file does not contain all information. {problem}")
        layout = Layout.loads(text, origin="proposed layout")
        if kind == "fixed-volume":
            read_volume_recordings([path], layout)
        elif kind == "drive":
            record = read_drive_recordings([path], layout)[0]
            strokes = find_strokes(record.name, record.time_s, record["position_m"])
        else:
            file = RecordingFile(path, layout, stem(path))
            recording = next(find_cycles(file)[1]) if file.has_cycles else file.read()
            strokes = find_strokes(recording.name, recording.time_s, recording.position_m)
    except PneudriveError as error:
        problem = error.what
    guesses, unused = [*roles.guesses.values()], tuple(str(column.place) for column in roles.unused)
    return Proposal(path, text, reading, guesses, columns, recording, strokes, problem, kind, unused)


def _kind(path: Path, roles: RoleSearch) -> str:
    """Return the kind of recording, from the roles that were guessed or are in a question.

    Raises
    ------
    RecordingError
        The kind is unknown, so that a layout would be meaningless.
    """
    found = {*roles.guesses, *roles.open_roles.split()}
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
        raise RecordingError.of("signals.long-table", where=str(path), name=path.name, index=index)
    shown = ", ".join(f"{g.role}: column {g.column!r}" for g in roles.guesses.values())
    named = f"columns: {', '.join(reading.names)}" if reading.names else ""
    remedy = "if it is a recording, write the layout by hand: see the guide, Your own recordings"
    if raw := [header.name for header in headers if header.is_raw and header.name]:
        example = f'position = {{ column = "{raw[0]}", unit = "mm", scale = 20.0 }}'
        remedy += f"; {', '.join(raw[:MOST_NAMED])} need a role, a unit and a scale, as in {example}"
    known = "; ".join(text for text in (shown, named) if text)[:300]
    raise RecordingError.of("signals.not-a-recording", where=str(path), value=known, remedy=remedy)


def layout_text(path: Path, roles: RoleSearch, kind: str) -> str:
    """Return the text of the layout file."""
    reading, form, signs = roles.form, roles.form.form, {None: "whitespace", "\t": "tab"}
    keys = {
        "delimiter": signs.get(form.delimiter, form.delimiter),
        "header_delimiter": None if form.of_header == form.delimiter else signs.get(form.of_header, form.of_header),
        "comment": None if form.comment == "#" else form.comment,
        "quoted": True if form.delimiter == form.decimal else None,
        "header": form.header,
        "decimal": form.decimal,
        "thousands": form.thousands,
        "skip_lines": form.skip_lines or None,
    }
    sign, bore, why = _sign_and_bore(roles)
    known = {*roles.guesses, *roles.open_roles.split()}
    cycle = [name for name in reading.names if re.search(ROLES["cycle"]["words"], name.strip().lower())]
    return rendered(
        TEMPLATE,
        {"toml": value_text},
        name=path.name,
        kind=kind,
        format=reading.format,
        keys=keys if reading.format == "csv" else {},
        guesses=[guess for role, guess in roles.guesses.items() if not (kind == "drive" and role == "force")],
        questions=roles.questions,
        line=lambda guess: _column_line(guess, sign),
        unused=families(str(column.place) for column in roles.unused),
        cycle=cycle[:1] if reading.format == "parquet" else (),
        missing=[role for role in ("time", "position", "force") if role not in known],
        bore=f"{bore * 1e3:.3g}",
        why=why,
        sides=[side for side in "ab" if f"pressure_{side}" not in roles.guesses],
        is_open="pressure" in roles.open_roles,
    )


def _column_line(guess: Guess, sign: str) -> str:
    """Return the line of a column in the layout."""
    place = value_text(guess.column)
    if guess.source is None:
        return f"{guess.role} = {{ {guess.keys} }}  # guess: {guess.reason}"
    keys = f", {guess.keys}" if guess.keys else ""
    if guess.role == "command":
        signal = _signal(guess.unit, guess.source.values)
        return f"command = {{ column = {place}{signal}{keys} }}  # guess: {guess.reason}"
    unit, note = guess.unit, ""
    if guess.role.startswith("pressure"):
        is_gauge = guess.gauge
        if is_gauge is None:
            is_gauge, note = GAUGE.search(str(guess.column)) is not None, "; gauge or abs is a guess"
            is_gauge |= unit != "Pa" and not ABSOLUTE.search(str(guess.column))
        unit += " gauge" if is_gauge else " abs"
    extra = f', positive = "{sign}"' if guess.role == "force" else ""
    return f'{guess.role} = {{ column = {place}, unit = "{unit}"{extra}{keys} }}  # guess: {guess.reason}{note}'


def _signal(unit: str, values: Array) -> str:
    """Return unit and range of a command that is not an opening fraction: the narrowest usual range for its values."""
    low, high = np.nanmin(values), np.nanmax(values)
    if low >= -1.0 and high <= 1.0 and not unit:
        return ""
    unit = unit or "V"
    scale = 1e-3 if unit == "mV" else 1.0
    margin = 0.02 * (high - low)
    for a, b in SIGNALS["mA" if unit == "mA" else "V"]:
        if low * scale >= a - margin * scale and high * scale <= b + margin * scale:
            written = "mA" if unit == "mA" else "V"
            return f', unit = "{unit}", range = "{a:g} {written} .. {b:g} {written}"'
    return f', unit = "{unit}", range = "{low:.4g} {unit} .. {high:.4g} {unit}"'


def _sign_and_bore(roles: RoleSearch) -> tuple[str, float, str]:
    """Return the sign of the force for which friction opposes motion, a bore, and the reason for this bore.

    The bore is the one for which pressure times area equals the mean force of both directions.
    """
    sign, unknown = "-x" if roles.sign < 0 else "+x", 0.025
    force, directions = roles.guesses.get("force"), roles.directions
    pressures = [guess for role, guess in roles.guesses.items() if role.startswith("pressure")]
    pressure = pressures[0].source if len(pressures) == 1 and "pressure" not in roles.open_roles else None
    if directions is None or force is None or force.source is None or pressure is None:
        return sign, unknown, "write the real bore"
    levels = directions.levels(force.source.values)
    mean_pa = np.nanmean(pressure.values) * converter(pressures[0].unit, "Pa")[0]
    area = abs(sum(levels) / 2 * converter(force.unit, "N")[0] / mean_pa) if levels is not None and mean_pa else 0.0
    if not 1e-6 < area < 1.0:
        return sign, unknown, "write the real bore"
    return sign, math.sqrt(4 * area / math.pi), "force over pressure, mean of both directions; write the real bore"
