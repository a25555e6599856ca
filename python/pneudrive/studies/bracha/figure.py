"""A figure of the source paper, made from simulated data, and what the data say to each of the paper's sentences."""

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

#: The paper's sentences, and what our data show, with places for numbers.
TEXTS = Path(__file__).with_name("figures.toml")
#: End of a quantity's name -> end of the name under which texts have it in the unit that people read, and how often
#: that unit goes into the SI one. The first one that fits counts.
READABLE = {
    "_n_pa": ("_n_bar", 1e5),
    "_m_s": ("_mm_s", 1e3),
    "_pa": ("_bar", 1e-5),
    "_m": ("_mm", 1e3),
    "_share": ("_percent", 100.0),
}


@dataclass(frozen=True)
class Claim:
    """A sentence of the source paper that simulated data can speak to.

    Attributes
    ----------
    place : str
        Where it stands in the paper [bracha]: ``figure 8``, ``conclusions``, ``equations 2 and 3``.
    said : str
        The paper's words, or its caption; what was left out stands as ``...``.
    verdict : {"holds", "holds in part", "does not hold"}
        Of our data. "In part" says in `found` which part does not.
    found : str
        What our data show, with the numbers that decide.
    """

    place: str
    said: str
    verdict: str
    found: str


def judge(whole: object, *, part: object) -> str:
    """Turn two tests into a verdict: of the whole sentence, and of what is left of it where the whole fails."""
    return "holds" if whole else "holds in part" if part else "does not hold"


def claims_of(topic: str, verdicts: Mapping[str, str], numbers: Mapping[str, Any]) -> tuple[Claim, ...]:
    """Return the sentences of a topic, each with its verdict and the numbers in its place."""
    said, shown = texts_of(TEXTS)[topic]["claims"], readable(numbers)
    return tuple(
        Claim(one["place"], one["said"], verdicts[name], one["found"].format(**shown)) for name, one in said.items()
    )


def readable(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Add each quantity in the unit in which people read it.

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
    """Data of one figure and what they say to the paper's sentences about it.

    Attributes
    ----------
    number : int
        Of the figure in the source paper [bracha].
    title : str
    claims : tuple of Claim
        Every sentence of the paper about this figure that can be checked.
    measured : str
        What the data show, in words.
    quantities : dict
        The numbers behind it, SI.
    columns : dict
        Name with unit -> array; all of one figure's arrays fit together (curves over pressure are two-dimensional).
    assumed : str
        What the simulated rig assumed that the paper does not say.
    rig : (Identity, Envelope) or None
        Of a figure that shows a rig.
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
        """Make a figure of its numbers; `more` are numbers for its texts alone."""
        texts, numbers = texts_of(TEXTS)[str(number)], {**quantities, **more}
        claims = claims_of(str(number), verdicts, numbers)
        measured = texts["measured"].format(**readable(numbers))
        return cls(number, texts["title"], claims, measured, quantities, columns, texts.get("assumed", ""), rig)

    def verdict(self, said: str) -> str:
        """Return the verdict of the claim whose sentence begins so.

        Raises
        ------
        KeyError
            There is none.
        """
        for claim in self.claims:
            if claim.said.startswith(said):
                return claim.verdict
        raise KeyError(said)
