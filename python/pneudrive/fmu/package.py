"""FMUs as files: the description, the plan and the library in one archive."""

from __future__ import annotations

import sys
import zipfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from pneudrive.errors import CommandError, DescriptionError, nearest
from pneudrive.fmu.binary import PLATFORMS, binary_path, try_plan
from pneudrive.fmu.description import IDENTIFIER, description
from pneudrive.fmu.source_entries import source_entries
from pneudrive.fmu.variables import RTOL, FmuVariable, plan_of
from pneudrive.repr_tables import Shown
from pneudrive.simulation.simulate import require
from pneudrive.simulation.start import check_tolerance
from pneudrive.simulation.trajectory import check_target, whole

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.describe.tables.parts import Initial
    from pneudrive.fmu.variables import FmuPlan

VERSIONS = ("2.0", "3.0")
#: Date in archives: equal drives give equal bytes.
_DATE = (1980, 1, 1, 0, 0, 0)
_EXECUTABLE = 0o755 << 16


@dataclass(frozen=True, repr=False)
class FmuFile(Shown):
    """An FMU that was written.

    Attributes
    ----------
    path : Path
    version : str
    inputs, outputs, parameters : tuple of FmuVariable
    token : str
        Token of the plan.
    notes : tuple of str
        Warnings and assumed values of the drive.
    """

    path: Path
    version: str
    inputs: tuple[FmuVariable, ...]
    outputs: tuple[FmuVariable, ...]
    parameters: tuple[FmuVariable, ...]
    token: str
    notes: tuple[str, ...]


def complete_plan(
    drive: Drive | Circuit,
    initial: Initial | Mapping[str, object] | str | None,
    rtol: float,
    *,
    actuator: bool = False,
) -> FmuPlan:
    """Return the plan of a drive with its event indicators, checked by the library."""
    require(drive, "core_json", "drive", 'pn.Drive.load("drive.toml")')
    check_tolerance(rtol)
    plan = plan_of(drive, initial, rtol=rtol, actuator=actuator)
    states = [one.rate_of for one in plan.variables if one.rate_of]
    count, sizes = try_plan(plan.json(), plan.token, len(states))
    if actuator and count > 0:
        raise DescriptionError(
            f"the law {drive.friction.law} has a mode for sticking, which an imposed motion cannot have",  # type: ignore[union-attr]
            rule="an actuator needs a law whose force follows from the motion",
            remedy='Choose one with bristles, such as friction.law = "lugre".',
        )
    what = "above zero while the present mode of friction or of a valve holds"
    roles = [(f"event_indicator[{i + 1}]", {"role": "event", "of": i}) for i in range(count)]
    events = [FmuVariable(name, "1", what, "local", role) for name, role in roles]
    nominals = dict(zip(states, sizes, strict=True))
    sized = (replace(one, nominal=nominals.get(one.name)) for one in plan.variables)
    return replace(plan, variables=(*sized, *events))


def export_fmu(
    drive: Drive | Circuit,
    path: str | Path,
    *,
    version: str = "2.0",
    actuator: bool = False,
    initial: Initial | Mapping[str, object] | str | None = None,
    rtol: float = RTOL,
) -> FmuFile:
    """Write a drive or a circuit as a Functional Mock-up Unit for co-simulation and model exchange.

    Inputs are the command and the external force in N. Outputs are the variables of a trajectory in SI. Parameters are
    the numbers of the drive file by their keys, and ``start.position``, ``start.pressure_a`` and so on. Pressures are
    absolute. Each parameter is independent. A value that the drive file derives from another one does not change with
    it in the FMU.

    Parameters
    ----------
    drive : Drive or Circuit
    path : path-like
        File ending in ``.fmu``.
    version : str
        ``"2.0"`` or ``"3.0"``, of the Functional Mock-up Interface.
    actuator : bool
        Whether the other tool moves the piston. Then position and velocity are inputs, and the force on the moved body
        is an output. This needs model exchange, and a friction law with bristles.
    initial : Initial, dict or str, optional
        Start state, as for `pneudrive.simulate`.
    rtol : float
        Relative tolerance of co-simulation, unless the other tool sets one.

    Returns
    -------
    FmuFile

    Raises
    ------
    CommandError
        The version or the path is not valid, the file cannot be written, or this installation does not include the
        library.
    DescriptionError
        The start state does not fit, or the drive cannot be an actuator.
    """
    target = check_fmu(path, version)
    return write_fmu(complete_plan(drive, initial, rtol, actuator=actuator), target, version)


def check_fmu(path: str | Path, version: str) -> Path:
    """Return the path of a new FMU, or raise a CommandError."""
    if version not in VERSIONS:
        raise CommandError(f'FMI "{version}" is not available', remedy=nearest(version, VERSIONS))
    return check_target(path, (".fmu",))


def write_fmu(plan: FmuPlan, target: Path, version: str) -> FmuFile:
    """Write the description, and the plan with the library or the source code, as an archive."""
    suffix, *folders = PLATFORMS.get(sys.platform, PLATFORMS["linux"])
    place = f"binaries/{folders[version != '2.0']}/{plan.code.identifier if plan.code else IDENTIFIER}{suffix}"
    if plan.code is None:
        entries = [("resources/drive.json", plan.json().encode()), (place, binary_path().read_bytes())]
    else:
        entries = source_entries(plan, version, place)
    with whole(target) as temporary, zipfile.ZipFile(temporary, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in (("modelDescription.xml", description(plan, version)), *entries):
            entry = zipfile.ZipInfo(name, _DATE)
            entry.external_attr = _EXECUTABLE if name == place else 0o644 << 16
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, content)
    by = {
        kind: tuple(one for one in plan.variables if one.causality == kind) for kind in ("input", "output", "parameter")
    }
    return FmuFile(target, version, by["input"], by["output"], by["parameter"], plan.token, plan.notes)
