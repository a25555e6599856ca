"""Results for the page: values and curves in usual units, and sentences; and reports as separate pages.

`SHOWN` has one line for each kind of result. The page needs no separate code for a kind in this table.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import asdict, dataclass
from importlib import import_module
from mimetypes import guess_type
from typing import TYPE_CHECKING, Any

from pneudrive.campaign.storage.folder import ABOUT as CAMPAIGN
from pneudrive.campaign.storage.folder import CYCLES
from pneudrive.describe.drive import Drive
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.content import read_json
from pneudrive.fmu.description import read_fmu
from pneudrive.report.page import FIGURES, POLICY, REPORT
from pneudrive.sizing.result import SUMMARY, answer_of
from pneudrive.sizing.task import SizingTask
from pneudrive.units import readable
from pneudrive.web.drive.run_request import described_at
from pneudrive.web.guard import REPORTS, new_token
from pneudrive.web.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Callable, Iterable

    from pneudrive.views import ShownCurve, View


#: What a browser allows a report to do: nothing but to be seen, saved and left.
SANDBOX = f"{POLICY}; frame-ancestors 'none'; sandbox allow-same-origin allow-downloads"
_PICTURE = re.compile(rf"{FIGURES}/[\w.+-]+\.(?:png|svg)")
#: Kind of a file -> module and function that read it and return its `View`.
SHOWN = {
    "fit": "pneudrive.web.measured.friction:view_of_fit",
    "friction map": "pneudrive.web.measured.friction:view_of_map",
    "validation": "pneudrive.web.measured.validation:view_of_validation",
    "comparison": "pneudrive.web.results:view_of_comparison",
}


@dataclass(frozen=True)
class SentValue:
    """A value: in SI, and as text in its usual unit."""

    key: str
    label: str
    quantity: str
    value: float | str | None
    text: str
    unit: str
    origin: str


@dataclass(frozen=True)
class SentCurve:
    """A curve in usual units. Points that are not measured lie between measured ones."""

    key: str
    label: str
    group: str
    x_title: str
    y_title: str
    x: list[float | None]
    y: list[float | None]
    low: list[float | None]
    high: list[float | None]
    measured: list[bool]


@dataclass(frozen=True)
class SentView:
    """A result: its table, as in terminal, notebook and report, the values of its cells, and its curves."""

    title: str
    head: list[str]
    table: list[list[str]]
    rows: list[SentValue]
    curves: list[SentCurve]
    notes: list[str]


def sent(view: View) -> dict[str, Any]:
    """Return a view as plain data."""
    head, table = view.table() if view.rows else ((), [])
    rows = [
        SentValue(one.key, one.label, one.quantity, _number(one.value), one.text, one.usual_unit, one.origin)
        for one in view.rows
    ]
    curves = [_curve(curve) for curve in view.curves]
    return asdict(SentView(view.title, list(head), list(map(list, table)), rows, curves, list(view.notes)))


def _curve(curve: ShownCurve) -> SentCurve:
    (x_size, x_unit), (size, unit) = readable(curve.x_unit), readable(curve.unit)
    titles = f"{curve.x_quantity}, {x_unit}", f"{curve.quantity}, {unit}"
    low, high = (_scaled(end, size) for end in curve.band or ((), ()))
    line = _scaled(curve.x, x_size), _scaled(curve.y, size), low, high
    return SentCurve(curve.key, curve.label, curve.group, *titles, *line, curve.measured.tolist())


def _number(value: float | str) -> float | str | None:
    return value if isinstance(value, str) or math.isfinite(value) else None


def _scaled(values: Iterable[float], size: float) -> list[float | None]:
    return [float(value) / size if math.isfinite(value) else None for value in values]


def shown_result(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return the view of a result by the kind of its file.

    Raises
    ------
    CommandError
        There is no such file, or its kind has no view.
    """
    kind = next((one.kind for one in workspace.files() if one.path == path), "")
    if kind not in SHOWN:
        raise CommandError(f"{path[:200]} has no values to show", rule=f"a {', '.join(SHOWN)}")
    return sent(view_at(workspace, path, kind))


def view_at(workspace: Workspace, path: str, kind: str) -> View:
    """Return the view of a result of a kind in `SHOWN`."""
    module, _, function = SHOWN[kind].partition(":")
    return getattr(import_module(module), function)(workspace, path)  # type: ignore[no-any-return]


def view_of_comparison(workspace: Workspace, path: str) -> View:
    """Return the medians of each controller along each reference."""
    from pneudrive.control.results.card import read_comparison

    return read_comparison(workspace.folder(path)).view()


class OpenReports:
    """Addresses of reports. A report never runs code.

    A tab that is opened by a link has no token. The address itself is therefore the key: a secret of the length of a
    token, for one folder, valid until the server stops.

    Attributes
    ----------
    folders : dict
        Secret -> folder. The guard accepts these secrets.
    """

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self.folders = workspace, dict[str, str]()

    def read(self, secret: str, name: str) -> tuple[bytes, str]:
        """Return a report, or a picture of it, with its type.

        Raises
        ------
        CommandError
            The file is neither.
        """
        if secret in self.folders and (name == REPORT or _PICTURE.fullmatch(name)):
            path = self.workspace.folder(f"{self.folders[secret]}/{name}")
            if path.is_file():
                return path.read_bytes(), guess_type(name)[0] or ""
        raise CommandError("there is no such report", remedy="Open it from the page again.")


def report_address(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the address of the report in a folder. Empty without a report."""
    if not (workspace.folder(path) / REPORT).is_file():
        return {"address": ""}
    folders = workspace.state(OpenReports).folders
    secret = next((known for known, folder in folders.items() if folder == path), None) or new_token()
    folders[secret] = path
    return {"address": f"{REPORTS}{secret}/{REPORT}"}


# --- Contents of each file of the overview in a line: size of a drive, values of a fit, verdict of a check.

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
