"""Bounds of input: sizes, depths and counts, each with its reason, in one table."""

from __future__ import annotations

import os
from functools import lru_cache

from pneudrive.errors import CommandError, ErrorKind, nearest, package_table

VARIABLE = "PNEUDRIVE_BOUNDS"


#: Largest allowed amount of each kind of input: value, unit, reason why ordinary use stays below the value, and whether
#: the user may raise the value (by default yes).
BOUNDS = package_table(__file__, "bounds.toml")


def bound(name: str) -> float:
    """Return a bound from the table, or from the environment variable ``PNEUDRIVE_BOUNDS``.

    Raises
    ------
    CommandError
        The variable names an unknown bound or one that cannot be raised, or its value is not a number.

    Examples
    --------
    >>> bound("nesting")
    64
    """
    raised = _raised(os.environ.get(VARIABLE, ""))
    return raised[name] if name in raised else BOUNDS[name]["value"]


@lru_cache(maxsize=8)
def _raised(text: str) -> dict[str, float]:
    out = {}
    for entry in filter(None, map(str.strip, text.split(","))):
        name, _, value = (part.strip() for part in entry.partition("="))
        names = [n for n, b in BOUNDS.items() if b.get("raised", True)]
        if name not in names:
            raise CommandError(
                f"{VARIABLE}: bound '{name}' is unknown or cannot be raised", value=text, remedy=nearest(name, names)
            )
        try:
            out[name] = float(value)
        except ValueError:
            raise CommandError(
                f"{VARIABLE}: {name} = '{value}' is not a number", value=text, rule=f'{VARIABLE}="{name}=1e9, ..."'
            ) from None
    return out


def within(name: str, value: float, what: str, kind: ErrorKind, where: str | None = None) -> None:
    """Raise an error if a value exceeds a bound.

    Parameters
    ----------
    name : str
        Name of the bound.
    value : float
        Value to check; NaN always exceeds the bound.
    what : str
        First sentence of the message.
    kind : type of PneudriveError
    where : str, optional

    Raises
    ------
    PneudriveError
        An error of `kind`, with the bound, its reason and how to raise it.
    """
    most, entry = bound(name), BOUNDS[name]
    if value <= most:
        return
    wanted = value if value < float("inf") else 10 * most
    raised = f'{VARIABLE}="{name}={float(f"{1.5 * wanted:.0e}"):.3g}"'  # a rounded bound that is sufficient
    remedy = f"If the value is right, raise the bound: {raised}." if entry.get("raised", True) else None
    rule = f"at most {most:,.15g} {entry['unit']} ({name}: {entry['reason']})".replace("  ", " ")
    raise kind(what, where=where, rule=rule, remedy=remedy)
