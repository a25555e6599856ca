"""Standard references, by which laws are compared."""

from __future__ import annotations

from pathlib import Path

from pneudrive.control.motion import REST_S, Reference, ReferenceMove, polynomials, sine, stairs
from pneudrive.control.paths import along_line
from pneudrive.control.references import reference

#: Share of a drive's speed that a standard reference takes at most, and of its stroke that a sine takes (assumed).
_SPEED_SHARE, _STROKE_SHARE = 0.85, 0.3
#: Those that laws are compared along where nothing is said; the others are asked for by name.
USUAL = ("R1", "R2", "R3", "R5", "R6")
#: Names of all of them.
NAMES = tuple(f"R{number}" for number in range(1, 9))
#: A hand that leads a piston over a stroke of 500 mm, in jerks and pauses: made up, of no person's hand.
HAND, HAND_STROKE_M = Path(__file__).with_name("hand.csv"), 0.5
#: Of R4: speeds, m/s, and ways, m. Of R7: targets for each metre and least number, approaches, move and dwell, s.
_RAMPS = ((0.001, 0.005), (0.01, 0.03), (0.1, 0.1))
_RUN_UP_S, _PAUSE_S = 0.1, 1.0
_TARGETS_PER_M, _LEAST_TARGETS, _APPROACHES, _MOVE_S, _DWELL_S = 5.0, 5, 5, 0.3, 1.5


def standard_references(stroke_m: float, speed_m_s: float) -> dict[str, Reference]:
    """Return the standard references for a drive, slowed to 0.85 of its speed at full opening where they are faster.

    R1 and R2: sines of 60 mm, 0.5 and 1 Hz, about mid stroke. R3: stairs, 60 mm forth and back in 0.3 s, then to 0.8
    and to 0.2 of the stroke. R4: ramps of 1, 10 and 100 mm/s. R5: 60 mm in 0.3 s and 40 s of rest. R6: 0.6 of the
    stroke in 0.25 s. R7: five targets, each approached five times from either side, 1.5 s of rest at each. R8: a hand.
    For a stroke below 200 mm, 0.3 of the stroke replaces 60 mm.

    Parameters
    ----------
    stroke_m, speed_m_s : float
        Stroke, and steady speed at full opening.

    Returns
    -------
    dict
        Name -> reference.
    """
    return {name: _standard(name, stroke_m, speed_m_s) for name in NAMES}


def named_or_read(given: Reference | str | Path, stroke_m: float, speed_m_s: float) -> Reference:
    """Return a standard reference for a drive by its name, or read any other reference.

    Errors are those of `reference`.
    """
    return _standard(str(given), stroke_m, speed_m_s) if given in NAMES else reference(given)


def _standard(name: str, stroke_m: float, speed_m_s: float) -> Reference:
    step = min(0.06, _STROKE_SHARE * stroke_m)
    low, middle, right, left = (round(share * stroke_m, 6) for share in (0.46, 0.5, 0.8, 0.2))
    high = round(low + step, 6)
    match name:
        case "R1":
            made = sine(step, 0.5, middle)
        case "R2":
            made = sine(step, 1.0, middle)
        case "R3":
            made = _moves(low, (1.0, 0.3, high), (3.0, 0.3, low), (5.0, 0.5, right), (7.0, 0.6, left))
        case "R4":
            made = _ramps(middle, stroke_m / HAND_STROKE_M)
        case "R5":
            made = _moves(low, (1.0, 0.3, high), rest_s=40.0)
        case "R6":
            made = _moves(left, (1.0, 0.25, right))
        case "R7":
            made = _targets(stroke_m)
        case _:
            made = _hand(stroke_m / HAND_STROKE_M)
    return made.stretched(made.reach().fastest_m_s / (_SPEED_SHARE * speed_m_s))


def _moves(start_m: float, *moves: tuple[float, float, float], rest_s: float = REST_S) -> Reference:
    return stairs(start_m, [ReferenceMove(*one) for one in moves], rest_s)


def _ramps(start_m: float, size: float) -> Reference:
    """Return ramps at constant velocity, each forth and back."""
    rows, at, time = [], start_m, _PAUSE_S
    for velocity, way in _RAMPS:
        for sign in (1.0, -1.0):
            to, lasts = at + sign * size * way, size * way / velocity
            rows += along_line(time, at, to, lasts, _RUN_UP_S)
            at, time = to, time + lasts + _RUN_UP_S + _PAUSE_S
    return polynomials("ramps of 1, 10 and 100 mm/s", start_m, rows)


def _targets(stroke_m: float) -> Reference:
    """Return moves that approach each target in turn from below and from above. They start beyond the outer targets."""
    count = max(_LEAST_TARGETS, round(_TARGETS_PER_M * stroke_m))
    every = [round(0.1 * stroke_m + 0.8 * stroke_m * k / (count + 1), 6) for k in range(count + 2)]
    cycle = [*every[1:], *every[-2::-1]]
    moves = [
        ReferenceMove(round(1.0 + number * (_MOVE_S + _DWELL_S), 6), _MOVE_S, to)
        for number, to in enumerate(cycle * _APPROACHES)
    ]
    return Reference(f"{count} targets, {_APPROACHES} times from either side", every[0], tuple(moves))


def _hand(size: float) -> Reference:
    record = reference(str(HAND))
    rows = [[*row[:2], *(size * number for number in row[2:])] for row in record.pieces]
    return polynomials("a hand", size * record.start_m, rows)
