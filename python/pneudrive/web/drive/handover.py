"""Drives for other tools: the export as a job, and the description of an FMU of the folder."""

from __future__ import annotations

import hashlib
import re
import zipfile
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.files.content import read_bytes
from pneudrive.fmu.description import read_fmu
from pneudrive.web.workspace import FMUS

if TYPE_CHECKING:
    from pneudrive.web.workspace import Workspace

#: An input that commands a valve; every valve takes full opening, also one that switches.
_COMMAND, _OPENING = re.compile(r"(?:.+\.)?command"), 1.0


def shown_fmu(workspace: Workspace, name: str) -> dict[str, Any]:
    """Return the description of an FMU of the workspace, its hash, and the lines that run it in FMPy.

    Raises
    ------
    CommandError
        The file is not an FMU.
    """
    path = workspace.path(name, FMUS)
    data, found = read_bytes(path, CommandError), read_fmu(path)
    inputs = [variable.name for variable in found.variables if variable.causality == "input"]
    outputs = [variable.name for variable in found.variables if variable.causality == "output"]
    commands = dict.fromkeys((one for one in inputs if _COMMAND.fullmatch(one)), _OPENING)
    given = f", start_values={commands}" if commands else ""
    lines = [
        "from fmpy import simulate_fmu\n",
        f"run = simulate_fmu({name!r}{given}, stop_time=0.5, output_interval=1e-3)",
        f'print(run["{outputs[0]}"][-1])' if outputs else "print(run[-1])",
    ]
    with zipfile.ZipFile(path) as archive:
        systems = sorted({one.split("/")[1] for one in archive.namelist() if one.startswith("binaries/")} - {""})
    return {
        "platforms": systems,
        "title": found.title,
        "tool": found.tool,
        "version": found.version,
        "token": found.token,
        "kinds": found.kinds,
        "variables": [vars(variable) for variable in found.variables],
        "sha256": hashlib.sha256(data).hexdigest(),
        "size": len(data),
        "fmpy": "\n".join(lines) + "\n",
    }
