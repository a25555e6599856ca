"""A drive for C programs: a folder with the header, the library, the plan and an example."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError
from pneudrive.fmu.binary import binary_name, binary_path
from pneudrive.fmu.package import complete_plan
from pneudrive.fmu.variables import RTOL
from pneudrive.simulation.trajectory import whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tables.parts import Initial

HEADER, EXAMPLE, PLAN = "pneudrive.h", "example.c", "drive.json"


def export_c(
    drive: Drive | Circuit,
    folder: str | Path,
    *,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = RTOL,
) -> tuple[Path, ...]:
    """Write a drive or a circuit for C programs: pneudrive.h, the library, drive.json and example.c.

    Parameters
    ----------
    drive : Drive or Circuit
    folder : path-like
        It is made if it does not exist. Files with these names in it are replaced.
    initial : Initial, dict or str, optional
        Start state, as for `pneudrive.simulate`.
    rtol : float
        Relative tolerance of the solver.

    Returns
    -------
    tuple of Path
        The files.

    Raises
    ------
    CommandError
        The folder cannot be written, or this installation does not include the library.
    DescriptionError
        The start state does not fit.
    """
    plan = complete_plan(drive, initial, rtol)
    target, own = Path(folder), Path(__file__).parent
    library = binary_path().read_bytes()
    try:
        target.mkdir(parents=True, exist_ok=True)
        texts = {PLAN: plan.json().encode(), **{name: (own / name).read_bytes() for name in (HEADER, EXAMPLE)}}
        for name, data in {binary_name(): library, **texts}.items():
            with whole(target / name) as temporary:
                temporary.write_bytes(data)
    except OSError as error:
        raise CommandError(f"{target} cannot be written: {error.strerror}") from None
    return tuple(target / name for name in (HEADER, binary_name(), PLAN, EXAMPLE))
