"""Sentences on recordings, campaigns, determined values and flags. The texts are in sentences.toml and flags.toml."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from pneudrive.errors import package_table
from pneudrive.views import Finding

NAMED = 3  # most cycles or recordings that a sentence names


@dataclass(frozen=True)
class Statement:
    """A sentence on determined or undetermined values, with a remedy.

    Attributes
    ----------
    topic : str
        curve, direction, pressure, air, position, stops, drift, repeatability, stick-slip, zero, range, data.
    text : str
    carried : bool
        Whether the data determine the value.
    remedy : str
        Cycles to add; "" if nothing is missing.
    """

    topic: str
    text: str
    carried: bool = True
    remedy: str = ""

    def __str__(self) -> str:
        """Return the text and remedy."""
        return f"{self.text} Remedy: {self.remedy}" if self.remedy else self.text


def table() -> dict[str, dict[str, str | dict[str, str]]]:
    """Return the sentences by topic and name. A sentence with a remedy is a dict of its text and its remedy."""
    return package_table(__file__, "sentences.toml")


def flag_table() -> dict[str, dict[str, str]]:
    """Return name -> ``means`` and ``do`` of each flag: its meaning, and what to do."""
    return package_table(__file__, "flags.toml")


IMPOSSIBLE = "negative_friction"  # with the doubts, a flag of values that no rig can have


def flag_findings(raised: Mapping[str, Sequence[str]], count: int) -> list[Finding]:
    """Return a finding for each raised flag, with its meaning, the recordings and the remedy.

    Parameters
    ----------
    raised : mapping
        Flag -> names of recordings.
    count : int
        Number of all recordings.
    """
    findings = []
    for name, flag in flag_table().items():
        if names := list(dict.fromkeys(raised.get(name, ()))):
            where = "all recordings" if len(names) == count > 1 else named(names)
            is_bad, is_open = name in table()["doubt"] or name == IMPOSSIBLE, not flag["do"].startswith("Nothing")
            text = f"{name}: {flag['means']} (in {where})."
            findings.append(Finding(text, "bad" if is_bad else "open" if is_open else "good", flag["do"]))
    return findings


def sentence(name: str, part: str = "text", /, **values: Any) -> str:  # noqa: ANN401 - whatever the sentence names
    """Fill in a sentence of the table.

    Parameters
    ----------
    name : str
        Topic and name, ``"doubt.no_friction"``.
    part : {"text", "remedy"}
        For a sentence without a remedy, the part "remedy" is "".
    **values
        Values for the braces of the sentence.
    """
    topic, _, key = name.partition(".")
    found = table()[topic][key]
    parts = {"text": found} if isinstance(found, str) else found
    return parts.get(part, "").format(**values)


def say(name: str, /, **values: Any) -> Statement:  # noqa: ANN401 - whatever the sentence names
    """Return a statement from the table. A statement with a remedy concerns an undetermined value.

    Parameters
    ----------
    name : str
        Topic and name, ``"curve.none"``.
    **values
        Values for the braces of the sentence.
    """
    remedy = sentence(name, "remedy", **values)
    return Statement(name.partition(".")[0], sentence(name, **values), carried=not remedy, remedy=remedy)


def named(names: Iterable[str], separator: str = ", ") -> str:
    """Return the first few names and the number of the others as one text."""
    every = list(names)
    more = [f"and {len(every) - NAMED} more"] if len(every) > NAMED else []
    return separator.join([*every[:NAMED], *more])
