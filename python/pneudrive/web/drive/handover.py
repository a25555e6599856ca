"""Drives for other tools: the export as a job, and the description of an FMU of the folder."""

from __future__ import annotations

import hashlib
import re
import zipfile
from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.files.content import read_bytes
from pneudrive.fmu.package import VERSIONS
from pneudrive.fmu.reading import read_fmu
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.jobs import RESULTS, AskedJob, folder_name
from pneudrive.web.workspace import FMUS, safe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.web.workspace import Workspace

#: What a drive becomes: a file for other tools, or a folder for C.
FORMS = ("fmu", "c")
#: An input that commands a valve; half open moves every drive.
_COMMAND, _OPENING = re.compile(r"(?:.+\.)?command"), 0.5


def export_job(given: Mapping[str, Any], workspace: Workspace) -> AskedJob:
    """Return the job that writes a drive or a circuit for other tools, into a file or a folder below ``results``.

    Raises
    ------
    CommandError, DescriptionError
        The drive is not in the workspace or not valid, or a choice is unknown.
    """
    drive, form, version, initial = (given.get(key) for key in ("drive", "to", "fmi", "initial"))
    if not isinstance(drive, str) or not isinstance(initial, str | None):
        raise CommandError("no drive is named", remedy="Choose one.")
    described_at(workspace, drive)
    for what, value, known in (("to", form, FORMS), ("fmi", version, VERSIONS)):
        if value not in known:
            raise CommandError(f"{what} = {str(value)[:80]!r} is not known", rule=", ".join(known))
    is_fmu, start = form == "fmu", initial or ""
    actuator = is_fmu and given.get("actuator") is True
    out = f"{RESULTS}/{folder_name(given.get('name'))}{'.fmu' if is_fmu else ''}"
    words = ["export", safe(drive), "--to", str(form), "--out", out]
    words += ["--fmi", str(version)] if is_fmu else []
    words += ["--actuator"] if actuator else []
    words += ["--initial", start] if start else []
    options = [f"version={version!r}"] if is_fmu else []
    options += ["actuator=True"] if actuator else []
    options += [f"initial={start!r}"] if start else []
    call = ", ".join(["drive", repr(out), *options])
    loaded = "import pneudrive as pn\nfrom pneudrive.describe.files.load import load_described\n\n"
    python = f"{loaded}drive = load_described({drive!r})\ndone = pn.export_{form}({call})\n"
    return AskedJob(tuple(words), out, python=python)


def shown_fmu(workspace: Workspace, name: str) -> dict[str, Any]:
    """Return the description of an FMU of the workspace, its hash, and the lines that run it in FMPy.

    Raises
    ------
    CommandError
        The file is not an FMU.
    """
    path = workspace.path(name, FMUS)
    data, found = read_bytes(path, CommandError), read_fmu(path)
    inputs = [one.name for one in found.variables if one.causality == "input"]
    outputs = [one.name for one in found.variables if one.causality == "output"]
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
        "variables": [vars(one) for one in found.variables],
        "sha256": hashlib.sha256(data).hexdigest(),
        "size": len(data),
        "fmpy": "\n".join(lines) + "\n",
    }
