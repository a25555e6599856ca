"""Exact derivatives of a trajectory by numbers of the drive: those of the discrete solution, including events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from pneudrive.errors import CommandError, SimulationError
from pneudrive.free.parameters import family_of, find
from pneudrive.progress import UNWATCHED
from pneudrive.simulation import command as commands
from pneudrive.simulation.start import ready

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

    from pneudrive._core import Shooting
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.free.parameters import Parameter
    from pneudrive.progress import Watch

    Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sensitivities:
    """Columns of a trajectory and their derivatives by numbers of the drive.

    Attributes
    ----------
    columns : list of str
        Names as in a trajectory file.
    values : ndarray, shape (n, c)
    derivatives : ndarray, shape (n, c, p)
        SI; by each parameter including its derived values, see `pneudrive.describe.tables.derived`.
    parameters : list of Parameter
    """

    columns: list[str]
    values: Array
    derivatives: Array
    parameters: list[Parameter]


class Differentiator:
    """Simulation of a drive for any values of some of its numbers, with derivatives by them.

    Parameters
    ----------
    drive : Drive
    names : sequence of str
        Names in the drive file, ``"friction.coulomb"``.
    command : as for `pneudrive.simulate`
        A function of time is not accepted, because the steps must be known in advance.
    initial : as for `pneudrive.simulate`
        The start state is held and does not depend on the numbers.
    rtol : float

    Raises
    ------
    CommandError
        A name is unknown or repeated, the drive is a circuit, the command is a function, or the contact at the start
        has an age.
    """

    def __init__(
        self,
        drive: Drive | Circuit,
        names: Sequence[str],
        command: commands.Commands,
        initial: Initial | Mapping[str, object] | str | None = None,
        rtol: float = 1e-6,
    ) -> None:
        if not hasattr(drive, "valve"):
            raise CommandError("derivatives of a circuit are not available", remedy="Describe it as a drive.")
        drive = cast("Drive", drive)
        if callable(command):
            raise CommandError(
                "derivatives of a run need a command known in advance, not a function of time",
                remedy='Give steps, "0 s: 0.6, 1 s: -0.6", or pairs.',
            )
        self.parameters = find(drive, [names] if isinstance(names, str) else names)
        self._family = family_of(drive, self.parameters)
        self._steps = commands.steps(command, None, drive.valve.command)  # pyright: ignore[reportArgumentType]
        _, start = ready(drive, initial)
        if start.pop("contact_age_s", 0.0):
            raise CommandError("derivatives of a run that starts with an aged contact are not available")
        self._start = start
        self._rtol = rtol

    def run(
        self,
        values: ArrayLike,
        times: Array,
        columns: Sequence[str],
        *,
        derivatives: bool = True,
        watch: Watch = UNWATCHED,
    ) -> Sensitivities:
        """Simulate the drive.

        Parameters
        ----------
        values : array_like, shape (p,)
            Values of the parameters, SI.
        times : ndarray, shape (n,)
            Times of the samples, s, increasing from the start.
        columns : sequence of str
            Columns of a trajectory file.
        derivatives : bool
            False: no derivatives; their last axis has length 0.
        watch : Watch
            May end the run.

        Raises
        ------
        SimulationError
            The solver cannot continue, or the core rejects the values.
        """
        family, numbers = self._family, np.asarray(values, dtype=float)
        try:
            core = family.core(numbers)
            begun, held = self._steps
            asked: Shooting = {
                "times": list(begun),
                "commands": list(held),
                "sample_times": times,
                "starts": [0],
                "initial": np.array([[self._start.get(name, 0.0) for name in core.segment_names]]),
                "parameters": family.paths if derivatives else [],
                "outputs": list(columns),
                "rtol": self._rtol,
            }
            found = family.shoot(core, asked, lambda _: watch.look())
        except ValueError as error:
            raise SimulationError(str(error)) from None
        if found["failures"][0] is not None:
            raise SimulationError(found["failures"][0])
        by_free = found["sensitivities"]
        if derivatives:
            by_free = by_free @ family.by_free(numbers)
        return Sensitivities(list(columns), found["values"], by_free, self.parameters)
