"""Exact derivatives of a trajectory by numbers of the drive: those of the numerical solution, including events."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from pneudrive.errors import CommandError, SimulationError
from pneudrive.free.circuit import CircuitFamily
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
    from pneudrive.free.parameters import DriveFamily, Parameter
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
    drive : Drive or Circuit
    names : sequence of str
        Names in the file, ``"friction.coulomb"``; in a circuit ``"left.friction.coulomb"``.
    command : as for `pneudrive.simulate`
        A function of time is not accepted, because the steps must be known in advance.
    initial : as for `pneudrive.simulate`
        The start state is held and does not depend on the numbers.
    rtol : float

    Raises
    ------
    CommandError
        A name is unknown or repeated, the command is a function, or the contact at the start has an age.
    """

    def __init__(
        self,
        drive: Drive | Circuit,
        names: Sequence[str],
        command: commands.Commands,
        initial: Initial | Mapping[str, object] | str | None = None,
        rtol: float = 1e-6,
    ) -> None:
        if callable(command):
            raise CommandError(
                "derivatives of a run need a command known in advance, not a function of time",
                remedy='Give steps, "0 s: 0.6, 1 s: -0.6", or pairs.',
            )
        names = [names] if isinstance(names, str) else names
        self._family: DriveFamily | CircuitFamily
        if drive.system.names is None:
            self._family = CircuitFamily(drive.circuit, names)
            self.parameters = self._family.parameters
        else:
            self.parameters = find(cast("Drive", drive), names)
            self._family = family_of(cast("Drive", drive), self.parameters)
        self._commands = commands.inputs(command, drive.commandable)
        core, start = ready(drive, initial)
        if not self._commands:  # a run has one command
            self._commands = [
                (next(name for name, *_ in core.inputs if name.endswith("load_force_n")), ((0.0,), (0.0,)))
            ]
        if any(value for name, value in start.items() if name.endswith("contact_age_s")):
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
            (first, (begun, held)), *others = self._commands
            asked: Shooting = {
                "times": list(begun),
                "commands": list(held),
                "others": [(name, list(times), list(steps)) for name, (times, steps) in others],
                "sample_times": times,
                "starts": [0],
                "initial": np.array([[self._start.get(name, 0.0) for name in core.segment_names]]),
                "parameters": family.paths if derivatives else [],
                "outputs": list(columns),
                "rtol": self._rtol,
            }
            found = core.shoot(first, asked, lambda _: watch.look())
        except ValueError as error:
            raise SimulationError(str(error)) from None
        if found["failures"][0] is not None:
            raise SimulationError(found["failures"][0])
        by_free = found["sensitivities"]
        if derivatives:
            by_free = by_free @ family.by_free(numbers)
        return Sensitivities(list(columns), found["values"], by_free, self.parameters)
