"""A figure of the source paper, made from simulated data, and what the data say to each of the paper's sentences."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.rig.interface import Envelope, Identity

    Verdict = Literal["holds", "holds in part", "does not hold"]


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
    verdict: Verdict
    found: str


def judge(whole: object, *, part: object) -> Verdict:
    """Turn two tests into a verdict: of the whole sentence, and of what is left of it where the whole fails."""
    return "holds" if whole else "holds in part" if part else "does not hold"


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

    def verdict(self, said: str) -> Verdict:
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
