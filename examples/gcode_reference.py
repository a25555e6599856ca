"""Custom reference reader: programs in a subset of G-code (G0, G1 with F, G4 P, G90, G91, G20, G21) as references.

    python examples/gcode_reference.py program.gcode --out records

writes a record for each axis, which `pneudrive control run --reference records/X.csv` follows. In Python,
`references(path)` returns a `pn.control.Reference` for each axis, all on one clock.
"""

from __future__ import annotations

import argparse
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

import pneudrive as pn
from pneudrive.control.motion import PEAK, along_line, blended
from pneudrive.errors import CommandError
from pneudrive.units import LARGEST

#: Speed of a rapid move, m/s, and time in which a velocity is taken up, s (both assumed).
RAPID_M_S, RUN_UP_S = 0.5, 0.1
AXES = "XYZABCUVW"
_INCH_M, _MM_M, _MINUTE_S = 0.0254, 1e-3, 60.0
_WORD = re.compile(r"([A-Z])\s*([-+]?(?:\d+(?:\.\d*)?|\.\d+))")
_KNOWN = {0, 1, 4, 20, 21, 90, 91}
_GROUPS = ((0, 1), (4,), (20, 21), (90, 91))  # of each at most one in a block
LONGEST_S = 1e6  # of a program
SAMPLE_S = 2e-3  # between the samples of a record
EXAMPLE = "(two axes)\nG21 G90\nG0 X100 Y50\nG1 X200 Y50 F6000\nG4 P0.5\nG91\nY30\nG0 X-20\n"
RULE = "G0, G1 with F, G4 P, G90, G91, G20, G21, and axes of " + ", ".join(AXES)


class AxisPath(NamedTuple):
    """Path of one axis.

    Attributes
    ----------
    start_m : float
    pieces : list
        As of `pneudrive.control.motion`.
    """

    start_m: float
    pieces: list[list[float]]


class _Modal:
    """Modal state: it holds from block to block."""

    def __init__(self) -> None:
        self.scale_m, self.is_relative, self.motion = _MM_M, False, 0
        self.feed_m_s: float | None = None
        self.time_s = 0.0
        self.at: dict[str, float] = {}
        self.paths: dict[str, AxisPath] = {}


def read_program(text: str, origin: str = "program") -> dict[str, AxisPath]:
    r"""Read a program: the path of each of its axes.

    The first block with axes says where the program begins, if it is a G0 in absolute positions. Positions are in mm
    (G21) unless G20 says inch; F in the same unit per minute, P in seconds. All axes of a block move in the same time.
    The longest way of a G0 reaches 0.5 m/s. A G1 follows the straight line with F, which it reaches within 0.1 s. Both
    are assumed. Comments are in parentheses or behind a semicolon.

    Raises
    ------
    CommandError
        A word is not known, a number is not valid, or F or P is missing; with the line.

    Examples
    --------
    >>> found = read_program("G21 G90\nG0 X220\nG1 X280 F6000\nG4 P1\nX220")
    >>> found["X"].start_m, round(found["X"].pieces[-1][0] + found["X"].pieces[-1][1], 3)
    (0.22, 2.4)
    """
    state = _Modal()
    for number, line in enumerate(text.splitlines(), start=1):
        plain = re.sub(r"\(.*?\)", " ", line.upper()).split(";")[0].replace("%", " ").strip()
        if plain:
            try:
                _block(plain, state)
            except CommandError as error:
                raise CommandError(error.what, where=f"{origin}:{number}", value=line.strip(), rule=RULE) from None
    if not state.paths:
        raise CommandError(f"{origin} has no block with an axis", rule=RULE)
    return state.paths


def _block(plain: str, state: _Modal) -> None:
    rest = _WORD.sub("", plain).strip()
    if rest:
        raise CommandError(f'"{rest}" is no word of a letter and a number')
    words = [(letter, float(value)) for letter, value in _WORD.findall(plain)]
    codes = [value for letter, value in words if letter == "G"]
    _check(words, codes)
    for code in codes:
        _code(code, state)
    named = {letter: value for letter, value in words if letter not in "GN"}
    if "F" in named:
        state.feed_m_s = named.pop("F") * state.scale_m / _MINUTE_S
        if not state.feed_m_s > 0.0:
            raise CommandError("F must be greater than 0")
    if 4 in codes:
        pause = named.pop("P", None)
        if pause is None or pause < 0.0:
            raise CommandError("G4 needs P with a time in seconds, from 0 on")
        state.time_s += pause
    strange = next((letter for letter in named if letter not in AXES), None)
    if strange is not None:
        raise CommandError(f"{strange} is not known")
    if named:
        _move({axis: value * state.scale_m for axis, value in named.items()}, state)
    if not state.time_s <= LONGEST_S:
        raise CommandError(f"the program takes {state.time_s:.3g} s, and at most {LONGEST_S:g} s are possible")


def _check(words: list[tuple[str, float]], codes: list[float]) -> None:
    """Refuse numbers out of bounds, and words of which a block can have only one."""
    letters = [letter for letter, _ in words if letter != "G"]
    for letter, value in words:
        if not abs(value) <= LARGEST:
            raise CommandError(f"the number of {letter} is out of bounds: beyond {LARGEST:g}")
        if letters.count(letter) > 1:
            raise CommandError(f"{letter} stands twice in a block")
    for group in _GROUPS:
        both = [f"G{code:g}" for code in codes if code in group]
        if len(both) > 1:
            raise CommandError(f"{' and '.join(both)} stand in one block, of which only one can hold")


def _code(code: float, state: _Modal) -> None:
    if code not in _KNOWN:
        raise CommandError(f"G{code:g} is not known")
    if code in (20, 21):
        state.scale_m = _INCH_M if code == 20 else _MM_M
    elif code in (90, 91):
        state.is_relative = code == 91
    elif code in (0, 1):
        state.motion = int(code)


def _move(asked: dict[str, float], state: _Modal) -> None:
    ways = {}
    for axis, value in asked.items():
        if axis not in state.at:
            if state.is_relative or state.motion == 1 or state.time_s > 0.0:
                raise CommandError(f"where {axis} begins is not said: give it in a first block with G0 and G90")
            state.at[axis] = value
            state.paths[axis] = AxisPath(value, [])
        to = state.at[axis] + value if state.is_relative else value
        ways[axis] = (state.at[axis], to)
    longest = max(abs(to - start) for start, to in ways.values())
    if longest == 0.0:
        return
    if state.motion == 0:
        duration_s = PEAK * longest / RAPID_M_S
        ends_s = duration_s
    else:
        if state.feed_m_s is None:
            raise CommandError("G1 needs a feed F")
        length = sum((to - start) ** 2 for start, to in ways.values()) ** 0.5
        duration_s = length / state.feed_m_s
        ends_s = duration_s + min(RUN_UP_S, duration_s)
    for axis, (start, to) in ways.items():
        if to != start:
            begin = state.time_s
            made = (
                blended(begin, duration_s, start, to)
                if state.motion == 0
                else along_line(begin, start, to, duration_s, RUN_UP_S)
            )
            state.paths[axis].pieces.extend(made)
        state.at[axis] = to
    state.time_s += ends_s


def references(path: str | Path) -> dict[str, pn.control.Reference]:
    """Return a reference for each axis of a program file."""
    each = read_program(Path(path).read_text("utf-8-sig"), str(path))
    return {
        axis: pn.control.Reference(f"{path}:{axis}", own.start_m, pieces=tuple(own.pieces))
        for axis, own in each.items()
    }


def main() -> None:
    """Write a record for each axis of a program."""
    parser = argparse.ArgumentParser(description="Write a record for each axis of a program.")
    parser.add_argument("program", type=Path, nargs="?", help="without one, an example is written and read")
    parser.add_argument("--out", type=Path, default=Path())
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    program = given.program or given.out / "example.gcode"
    if given.program is None:
        program.write_text(EXAMPLE)
    for axis, reference in references(program).items():
        end_s = reference.duration_s - reference.rest_s
        times = np.linspace(0.0, end_s, max(2, round(end_s / SAMPLE_S) + 1))
        table = np.column_stack([times, reference.at(times)[:, 0]])
        file = given.out / f"{axis}.csv"
        np.savetxt(file, table, fmt="%.9g", delimiter=",", header="time_s,position_m", comments="")
        print(f"{file}: {len(table)} samples, {end_s:.4g} s")


if __name__ == "__main__":
    main()
