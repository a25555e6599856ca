"""Data sheets of drives, as jobs of the page."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pneudrive.errors import CommandError
from pneudrive.report.page import REPORT
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.jobs import RESULTS, AskedJob, folder_name
from pneudrive.web.workspace import safe

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.web.workspace import Workspace


def datasheet_job(given: Mapping[str, Any], workspace: Workspace) -> AskedJob:
    """Return the job that writes the data sheet of a drive or a circuit into a folder below ``results``.

    Raises
    ------
    CommandError, DescriptionError
        The drive is not in the workspace or not valid.
    """
    drive = given.get("drive")
    if not isinstance(drive, str):
        raise CommandError("no drive is named", remedy="Choose one.")
    described_at(workspace, drive)
    out = f"{RESULTS}/{folder_name(given.get('name'))}/{REPORT}"
    loaded = (
        "from pneudrive.datasheet.sheet import build\nfrom pneudrive.describe.files.load import load_described\n"
        "from pneudrive.progress import Watch\n\n"
    )
    python = f"{loaded}sheet = build(load_described({drive!r}), [], None, Watch())\n"
    return AskedJob(("datasheet", safe(drive), "--out", out), out, python=python)
