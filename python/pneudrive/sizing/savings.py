"""Changes of the best drive that save air: a lower pressure for the return stroke, shorter tubes."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from pneudrive.sizing.choices import choices
from pneudrive.sizing.spreads import sized
from pneudrive.sizing.tune import tune

if TYPE_CHECKING:
    from collections.abc import Iterator

    import numpy as np
    from numpy.typing import NDArray

    from pneudrive.sizing.sized_drive import SizedDrive
    from pneudrive.sizing.strokes import DriveStrokes

#: Shares of the gauge pressure that the way back is tried with, and of the length of the tubes.
RETURN_SHARES, TUBE_SHARE = (0.5, 0.7), 0.5


class Saving(NamedTuple):
    """A change that keeps the task and saves air.

    Attributes
    ----------
    change : str
    share : float
        Share of the air that it saves; 0 where the change does not keep the task.
    is_kept : bool
        Whether the task is met with the change.
    """

    change: str
    share: float
    is_kept: bool

    def __str__(self) -> str:
        if not self.is_kept:
            return f"{self.change}: the task is not met"
        return f"{self.change}: saves {100.0 * self.share:.3g} % of the air"


def savings(best: DriveStrokes, sized_best: SizedDrive, draws: NDArray[np.float64]) -> Iterator[Saving]:
    """Try changes of the best drive; each is tuned and simulated over samples of the spreads."""
    task, half = best.task, best.task.tube_length_m * TUBE_SHARE
    shorter = task.model_copy(update={"tube_length_m": half})
    tube = next(part for part in choices(shorter)["tube"] if part.name == best.choice.tube.name)
    tried = {
        f"{100.0 * share:.0f} % of the supply's gauge pressure for the way back": replace(best, return_share=share)
        for share in RETURN_SHARES
    }
    short = replace(best, choice=replace(best.choice, tube=tube), task=shorter)
    tried[f"tubes of {half:.3g} m in place of {task.tube_length_m:.3g} m"] = short
    for change, strokes in tried.items():
        tuned = tune(strokes)
        made = None if tuned.nominal < 0.0 else sized(strokes, tuned.setting, draws)
        is_kept = made is not None and made.is_feasible
        yield Saving(change, 1.0 - made.air / sized_best.air if is_kept and made else 0.0, is_kept)
