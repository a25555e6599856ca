"""Contents of each file of the overview in a line: size of a drive, values of a fit, verdict of a check."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from pneudrive.campaign.storage.folder import ABOUT as CAMPAIGN
from pneudrive.campaign.storage.folder import CYCLES
from pneudrive.describe.drive import Drive
from pneudrive.errors import PneudriveError
from pneudrive.files.content import read_json
from pneudrive.fmu.description import read_fmu
from pneudrive.sizing.result import SUMMARY, answer_of
from pneudrive.sizing.task import SizingTask
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.results import SHOWN, view_at
from pneudrive.web.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Callable

MOST_FILES, MOST_VALUES = 200, 3  # newest files with a line; values in a line
VALUE = "value"  # column of the values of a fit


def headlines(workspace: Workspace) -> dict[str, str]:
    """Return a line for each of the newest files, by their names."""
    out = {}
    for one in sorted(workspace.files(), key=lambda one: -one.changed)[:MOST_FILES]:
        with suppress(PneudriveError):  # the view of the file says why
            if line := LINES.get(one.kind):
                out[one.path] = line(workspace, one.path)
    return out


def _of_drive(workspace: Workspace, path: str) -> str:
    found = described_at(workspace, path)
    if not isinstance(found, Drive):
        return f"{found.name}: {len(found.components)} components"
    cylinder = found.cylinder
    return f"{found.name}: bore {1e3 * cylinder.bore_m:.4g} mm, stroke {1e3 * cylinder.stroke_m:.4g} mm"


def _of_view(workspace: Workspace, path: str, kind: str) -> str:
    """Return the first values of a result, or its verdict, or its title."""
    view = view_at(workspace, path, kind)
    values = [f"{one.label} {one.text} {one.usual_unit}" for one in view.rows if one.quantity == VALUE and one.text]
    return ", ".join(values[:MOST_VALUES]) or (view.notes[0] if kind == "validation" and view.notes else view.title)


def _of_sizing(workspace: Workspace, path: str) -> str:
    summary = workspace.folder(path) / SUMMARY
    stored = read_json(summary, PneudriveError) if summary.is_file() else {}
    return answer_of(stored).partition(":")[0] or "not finished"


def _of_task(workspace: Workspace, path: str) -> str:
    task = SizingTask.load(workspace.path(path))
    return f"{task.name}: {task.mass_kg:.4g} kg, {1e3 * task.stroke_m:.4g} mm in {task.outward_s:.4g} s"


def _of_campaign(workspace: Workspace, path: str) -> str:
    folder = workspace.folder(path)
    about = read_json(folder / CAMPAIGN, PneudriveError)
    return f"{about.get('name') or folder.name}: {sum(1 for _ in (folder / CYCLES).glob('*.parquet'))} cycles"


def _of_fmu(workspace: Workspace, path: str) -> str:
    fmu = read_fmu(workspace.path(path))
    return f"{fmu.title}, FMI {fmu.version}"


#: Kind of a file -> function that returns its line.
LINES: dict[str, Callable[[Workspace, str], str]] = {
    "drive": _of_drive,
    "circuit": _of_drive,
    "sizing": _of_sizing,
    "task": _of_task,
    "fmu": _of_fmu,
    "campaign": _of_campaign,
    **{kind: lambda workspace, path, kind=kind: _of_view(workspace, path, kind) for kind in SHOWN},  # type: ignore[misc]
}
