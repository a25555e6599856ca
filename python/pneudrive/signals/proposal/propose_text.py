"""The text of a proposed layout, with every guess marked."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

import numpy as np

from pneudrive.describe.files.toml import value_text
from pneudrive.signals.proposal.roles import families
from pneudrive.signals.tables.names import ROLES
from pneudrive.units import converter

if TYPE_CHECKING:
    from pathlib import Path

    from numpy.typing import NDArray

    from pneudrive.signals.proposal.columns import FileColumn
    from pneudrive.signals.proposal.roles import Guess, RoleSearch
    from pneudrive.signals.tables.sniff import FileForm

#: Names of absolute pressures: p_abs, psia, bara.
ABSOLUTE = re.compile(r"abs|(?:psi|bar|pa)a\b", re.IGNORECASE)
MOST_CHOICES = 8  # columns that are listed for a role that is left open
#: Ranges of electrical signals that command a valve, in V or mA.
SIGNALS = {"V": ((0.0, 5.0), (0.0, 10.0), (-5.0, 5.0), (-10.0, 10.0)), "mA": ((0.0, 20.0), (4.0, 20.0))}


def layout_text(path: Path, roles: RoleSearch, kind: str) -> str:
    """Return the text of the layout file."""
    reading, columns, guesses = roles.form, roles.columns, roles.guesses
    lines = _file_lines(path, reading, kind)
    lines += ["", "[columns]"]
    sign, bore, why = _sign_and_bore(roles)
    lines += [
        _column_line(guess, columns, sign) for guess in guesses if not (kind == "drive" and guess.role == "force")
    ]
    for question in roles.questions:
        lines.append(f"# open: {question.text}")
        lines += [f"# {_column_line(choice, columns, sign)}" for choice in question.choices[:MOST_CHOICES]]
    if unused := families(str(column.place) for column in roles.unused):
        lines.append(f"# not used: {', '.join(unused)}")
    found = {guess.role for guess in guesses}
    cycle = [name for name in reading.names if re.search(ROLES["cycle"].words, name.strip().lower())]
    if cycle and reading.format == "parquet":
        lines.append(f"cycle = {{ column = {value_text(cycle[0])} }}  # guess: numbers the cycles of a campaign")
    if kind != "rig":
        return "\n".join([*lines, ""])
    open_roles = " ".join(question.role for question in roles.questions)
    missing = [role for role in ("time", "position", "force") if role not in found and role not in open_roles]
    lines += [f"# not found: {role}" for role in missing]
    lines += ["", "[geometry]", 'kind = "rodless"  # guess', f'bore = "{bore * 1e3:.3g} mm"  # guess: {why}']
    for side in ("a", "b"):
        if f"pressure_{side}" not in found:
            sign = "# " if "pressure" in open_roles else ""
            why = "if it is" if sign else "guess: no pressure column for this chamber"
            lines += ["", f"{sign}[chamber_{side}]", f"{sign}open_to_ambient = true  # {why}"]
    if "pressure_a" in found:
        lines += _parallel_lines(roles)
    lines += ["", "# [window]", '# position = "5 mm .. 30 mm"  # absent: the middle 60 % of the stroke', ""]
    return "\n".join(lines)


def _parallel_lines(roles: RoleSearch) -> list[str]:
    """Return a parallel force as a comment, if two further columns are pressures, which may belong to a ram."""
    spare = [(one.column.place, unit) for one in roles.candidates("pressure") if (unit := one.column.unit)]
    if len(spare) != 2:
        return []
    lines = ["", "# Two more pressures: if they drive a ram in parallel with the force, state its area and direction."]
    lines += ["# [[force]]", '# name = "ram"', '# area = "10 cm2"', '# area_accuracy = "5 %"', '# positive = "+x"']
    for key, (place, unit) in zip(("pressure", "against"), spare, strict=True):
        form = f"{unit.unit} {'abs' if unit.gauge is False else 'gauge'}"
        lines.append(f'# {key} = {{ column = {value_text(place)}, unit = "{form}" }}')
    return lines


def _file_lines(path: Path, reading: FileForm, kind: str) -> list[str]:
    """Return the lines on the format of the file."""
    form = reading.form
    lines = [f"# Proposed for {path.name}. Check every line that says guess, in particular units and signs.", ""]
    if kind == "fixed-volume":
        lines.append('kind = "fixed-volume"  # guess: pressures, and no position')
    lines.append(f'format = "{reading.format}"')
    if reading.format == "csv":
        names = {None: "whitespace", "\t": "tab"}
        lines.append(f'delimiter = "{names.get(form.delimiter, form.delimiter)}"')
        if form.of_header != form.delimiter:
            lines.append(f'header_delimiter = "{names.get(form.of_header, form.of_header)}"')
        if form.comment != "#":
            lines.append(f'comment = "{form.comment}"')
        if form.delimiter == form.decimal:
            lines.append("quoted = true  # numbers are in quotation marks")
        lines.append(f"header = {'true' if form.header else 'false'}")
        lines.append(f'decimal = "{form.decimal}"')
        if form.thousands:
            lines.append(f'thousands = "{form.thousands}"')
        if form.skip_lines:
            lines.append(f"skip_lines = {form.skip_lines}")
    return lines


def _column_line(guess: Guess, columns: list[FileColumn], sign: str) -> str:
    """Return the line of a column."""
    place = value_text(guess.column)
    if guess.index is None:
        return f"{guess.role} = {{ {guess.keys} }}  # guess: {guess.reason}"
    keys = f", {guess.keys}" if guess.keys else ""
    if guess.role == "command":
        signal = _signal(guess, columns[guess.index].values)
        return f"command = {{ column = {place}{signal}{keys} }}  # guess: {guess.reason}"
    unit, note = guess.unit, ""
    if guess.role.startswith("pressure"):
        is_gauge = guess.gauge
        if is_gauge is None:
            is_gauge, note = not (unit == "Pa" or ABSOLUTE.search(str(guess.column))), "; gauge or abs is a guess"
        unit += " gauge" if is_gauge else " abs"
    extra = f', positive = "{sign}"' if guess.role == "force" else ""
    return f'{guess.role} = {{ column = {place}, unit = "{unit}"{extra}{keys} }}  # guess: {guess.reason}{note}'


def _signal(guess: Guess, values: NDArray[np.float64]) -> str:
    """Return unit and range of a command that is not an opening fraction: the narrowest usual signal around it."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    unit = guess.unit or "V"
    if low >= -1.0 and high <= 1.0 and guess.unit == "":
        return ""
    scale = 1e-3 if unit == "mV" else 1.0
    margin = 0.02 * (high - low)
    for a, b in SIGNALS["mA" if unit == "mA" else "V"]:
        if low * scale >= a - margin * scale and high * scale <= b + margin * scale:
            written = "mA" if unit == "mA" else "V"
            return f', unit = "{unit}", range = "{a:g} {written} .. {b:g} {written}"'
    return f', unit = "{unit}", range = "{low:.4g} {unit} .. {high:.4g} {unit}"'


def _sign_and_bore(roles: RoleSearch) -> tuple[str, float, str]:
    """Return the sign of the force, by which friction opposes motion, and the bore that closes the balance."""
    sign = "-x" if roles.sign < 0 else "+x"
    force = next((guess for guess in roles.guesses if guess.role == "force"), None)
    pressures = [guess for guess in roles.guesses if guess.role.startswith("pressure")]
    is_open = any("pressure" in question.role for question in roles.questions)
    if roles.directions is None or force is None or force.index is None or len(pressures) != 1 or is_open:
        return sign, 0.025, "write the real bore"
    levels = roles.directions.levels(roles.columns[force.index].values)
    if levels is None or pressures[0].index is None:
        return sign, 0.025, "write the real bore"
    mean = float(np.nanmean(roles.columns[pressures[0].index].values)) * converter(pressures[0].unit, "Pa")[0]
    area = abs(sum(levels) / 2 * converter(force.unit, "N")[0] / mean) if mean else 0.0
    if not 1e-6 < area < 1.0:
        return sign, 0.025, "write the real bore"
    return sign, math.sqrt(4 * area / math.pi), "force over pressure, mean of both directions; write the real bore"
