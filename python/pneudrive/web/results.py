"""Views of results for the page, and the summary lines of its overview."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from pneudrive import results
from pneudrive.arrays import Plain
from pneudrive.campaign.storage.folder import ABOUT, CYCLES
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.content import read_json
from pneudrive.fmu.package import read_fmu
from pneudrive.friction.friction_map import ALL_RECORDINGS, group_of
from pneudrive.sizing.result import SUMMARY, SizingResult
from pneudrive.sizing.task import SizingTask
from pneudrive.views import State
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.measured.recordings import layout_in
from pneudrive.web.messages import OF_DAMAGE
from pneudrive.web.workspace import DESCRIPTIONS, Workspace, is_in_catalogue


def load_at(workspace: Workspace, path: str) -> Any:  # noqa: ANN401 - any result
    """Read a file or folder that pneudrive wrote.

    Raises
    ------
    CommandError
        The name refers to a file outside the workspace, or the kind of the file is not known.
    """
    if is_in_catalogue(path):
        return results.load(path)
    place = workspace.folder(path)
    if place.is_dir():
        for inner in place.iterdir():
            workspace.folder(f"{path}/{inner.name}")
    elif path.endswith(DESCRIPTIONS):
        workspace.check_named(path, toml.read(place, CommandError)[0])
    return results.load(place)


def sent_view(workspace: Workspace, path: str) -> Plain:
    """Return the view of a result as data."""
    return results.view_of(load_at(workspace, path)).data()


# --- Contents of each file of the overview in a line: size of a drive, values of a fit, verdict of a check.

MOST_FILES, MOST_VALUES = 200, 3  # newest files with a line; values in a line
VERDICTS: dict[State, str] = {"good": "in order", "open": "open", "bad": "needs you"}


def headlines(workspace: Workspace) -> Plain:
    """Return a summary line for each of the newest files, by name. Files without a summary are left out."""
    out = {}
    for file in sorted(workspace.files(), key=lambda file: -file.changed)[:MOST_FILES]:
        with suppress(PneudriveError, *OF_DAMAGE):  # the view of the file says why
            line = _line(workspace, file.path, file.kind)
            if line is not None:
                out[file.path] = line
    return out


def _line(workspace: Workspace, path: str, kind: str) -> str | None:
    """Return the summary line of a file or folder; None for a kind without a summary."""
    match kind:
        case "drive" | "circuit":
            found = described_at(workspace, path)
            if not isinstance(found, Drive):
                return f"{found.name}: {len(found.components)} components"
            cylinder = found.cylinder
            return f"{found.name}: bore {1e3 * cylinder.bore_m:.4g} mm, stroke {1e3 * cylinder.stroke_m:.4g} mm"
        case "recording":  # seal, mounting and drive, by its layout
            place = workspace.path(path)
            layout = layout_in(workspace, place)
            group = "" if layout is None else group_of(layout.for_file(place, layout.kind).labels)
            return group.removeprefix(ALL_RECORDINGS)
        case "fit" | "friction map" | "validation" | "comparison":
            # The first leading values with their limits, or the headline, and the verdict in one word.
            view = results.view_of(load_at(workspace, path))
            is_judged = view.state != "good" or any(one.limit is not None for one in view.leading)
            word = f": {VERDICTS[view.state]}" if is_judged else ""
            return (", ".join(one.sentence for one in view.leading[:MOST_VALUES]) or view.title) + word
        case "sizing":
            folder = workspace.folder(path)
            is_finished = (folder / SUMMARY).is_file()
            return SizingResult.load(folder).answer.partition(":")[0] if is_finished else "not finished"
        case "task":
            task = SizingTask.load(workspace.path(path))
            return f"{task.name}: {task.mass_kg:.4g} kg, {1e3 * task.stroke_m:.4g} mm in {task.outward_s:.4g} s"
        case "campaign":
            folder = workspace.folder(path)
            about = read_json(folder / ABOUT, PneudriveError)
            count = sum(1 for _ in (folder / CYCLES).glob("*.parquet"))
            return f"{about.get('name') or folder.name}: {count} cycles"
        case "fmu":
            fmu = read_fmu(workspace.path(path))
            return f"{fmu.title}, FMI {fmu.version}"
    return None
