"""A figure of the source paper, made from simulated data, with the check of the paper's sentence."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.rig.interface import Envelope, Identity


@dataclass(frozen=True)
class PaperFigure:
    """Data of one figure and whether they show what the paper says.

    Attributes
    ----------
    number : int
        Of the figure in the source paper [bracha].
    title : str
    sentence : str
        What the paper says, in short.
    holds : bool
        Whether the data show it.
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
    sentence: str
    holds: bool
    measured: str
    quantities: dict[str, float]
    columns: dict[str, NDArray[np.float64]] = field(repr=False)
    assumed: str = ""
    rig: tuple[Identity, Envelope] | None = field(default=None, repr=False)
    synthetic: bool = True
