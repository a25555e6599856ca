"""A figure of the source paper, made from simulated data, and verdicts on the paper's sentences about it."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.report.topics import texts_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.rig import Envelope, Identity

#: The paper's sentences and our results, with places for numbers.
TEXTS = Path(__file__).with_name("figures.toml")
#: End of a quantity's name in SI -> end of its name in texts, in the usual unit, and number of those units in one
#: SI unit. The first match counts.
READABLE = {
    "_n_pa": ("_n_bar", 1e5),
    "_m_s": ("_mm_s", 1e3),
    "_pa": ("_bar", 1e-5),
    "_m": ("_mm", 1e3),
    "_share": ("_percent", 100.0),
}


@dataclass(frozen=True)
class Claim:
    """A sentence of the source paper that simulated data can check.

    Attributes
    ----------
    place : str
        Its place in the paper [bracha]: ``figure 8``, ``conclusions``, ``equations 2 and 3``.
    said : str
        The paper's words, or its caption; ``...`` marks omissions.
    verdict : {"holds", "holds in part", "does not hold"}
        Verdict by our data. With "in part", `found` says which part does not hold.
    found : str
        Our result, with the decisive numbers.
    """

    place: str
    said: str
    verdict: str
    found: str


def judge(whole: object, *, part: object) -> str:
    """Return a verdict from two tests: of the whole sentence, and of a part of it."""
    return "holds" if whole else "holds in part" if part else "does not hold"


def claims_of(topic: str, verdicts: Mapping[str, str], numbers: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Return the sentences of a topic with verdicts and numbers."""
    said, shown = texts_of(TEXTS)[topic]["claims"], readable(numbers)
    return tuple(
        Claim(one["place"], one["said"], verdicts[name], one["found"].format(**shown)) for name, one in said.items()
    )


def readable(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return the quantities, each in SI and in its usual unit.

    Examples
    --------
    >>> readable({"step_m": 0.002, "stuck_share": 0.5})
    {'step_m': 0.002, 'step_mm': 2.0, 'stuck_share': 0.5, 'stuck_percent': 50.0}
    """
    out = {}
    for name, value in numbers.items():
        out[name] = value
        end = next((end for end in READABLE if name.endswith(end)), None)
        if end is not None:
            other, factor = READABLE[end]
            out[name.removesuffix(end) + other] = factor * value
    return out


@dataclass(frozen=True)
class PaperFigure:
    """Data of one figure, and verdicts on the paper's sentences about it.

    Attributes
    ----------
    number : int
        Number of the figure in the source paper [bracha].
    title : str
    claims : tuple of Claim
        Every sentence of the paper about this figure that can be checked.
    measured : str
        The result in words.
    quantities : dict
        Its numbers, SI.
    columns : dict
        Name with unit -> array; the arrays of a figure have matching shapes (curves over pressure are 2-D).
    assumed : str
        Assumptions of the simulated rig beyond the paper.
    rig : (Identity, Envelope) or None
        For a figure that shows a rig.
    synthetic : bool
        Always true: the paper's own data are not published.
    """

    number: int
    title: str
    claims: tuple[Claim, ...]
    measured: str
    quantities: dict[str, float]
    columns: dict[str, NDArray[np.float64]] = field(repr=False)
    assumed: str = ""
    rig: tuple[Identity, Envelope] | None = field(default=None, repr=False)
    synthetic: bool = True

    @classmethod
    def make(
        cls,
        number: int,
        verdicts: Mapping[str, str],
        quantities: dict[str, float],
        columns: dict[str, NDArray[np.float64]],
        rig: tuple[Identity, Envelope] | None = None,
        **more: object,
    ) -> PaperFigure:
        """Return a figure of these numbers; `more` are numbers for its texts only."""
        texts, numbers = texts_of(TEXTS)[str(number)], {**quantities, **more}
        claims = claims_of(str(number), verdicts, numbers)
        measured = texts["measured"].format(**readable(numbers))
        return cls(number, texts["title"], claims, measured, quantities, columns, texts.get("assumed", ""), rig)

    def verdict(self, said: str) -> str:
        """Return the verdict on the sentence with this beginning.

        Raises
        ------
        KeyError
            The figure does not exist.
        """
        for claim in self.claims:
            if claim.said.startswith(said):
                return claim.verdict
        raise KeyError(said)
