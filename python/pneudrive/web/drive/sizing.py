"""Tasks and their candidates for the page, from the text of a task and from the folder of its search."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.content import read_json, read_text
from pneudrive.files.writing import is_held
from pneudrive.sizing.checks import READ
from pneudrive.sizing.folder import ABOUT, LINES, LOCK, PROVISIONAL, read_choices
from pneudrive.sizing.result import SUMMARY, WRITTEN, SizingResult
from pneudrive.sizing.search import is_of_command
from pneudrive.sizing.task import SizingTask, follows_from, values_of
from pneudrive.web.messages import plain, problems_of
from pneudrive.web.workspace import Workspace

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.sizing.checks import SizedDrive

#: A task to begin with.
FIRST = Path(__file__).with_name("first_task.toml")
MOST_TASKS = 500  # number of kept tasks
#: Values of a sized drive that the page gets under their names.
SENT = ("name", "draws", "met", "time_out", "time_back", "end_speed", "energy", "margin", "binding", "load_ratio")
SENT += ("measure", "explains")


def checked_or_first(given: Mapping[str, Any]) -> dict[str, Any]:
    """Check the text of a task and return its problems, or its full content. Without a text, return an example task."""
    text = given.get("text")
    if not isinstance(text, str):
        return {"text": read_text(FIRST, CommandError)}
    try:
        task = SizingTask.load(text if "\n" in text else f"{text}\n")
    except PneudriveError as error:
        return {"problems": problems_of(error)}
    return {
        "problems": [],
        "name": task.name,
        "values": [
            {"key": one.key, "text": one.text, "given": one.is_given, "meaning": one.meaning} for one in values_of(task)
        ],
        "follows": [dict(zip(("what", "value", "unit"), row, strict=True)) for row in follows_from(task)],
    }


def shown_sizing(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return a search from its folder: its task, the simulated candidates, and the ranking once it exists.

    If the folder does not exist yet because the search has just started, the answer is ``{"waits": True}``.

    Raises
    ------
    CommandError
        The folder does not contain a sizing.
    """
    folder = workspace.folder(path)
    if not folder.exists():
        return {"waits": True}
    about, early = _json(folder / ABOUT, path, "task", "draws"), folder / PROVISIONAL
    done = SizingResult.load(folder) if (folder / SUMMARY).is_file() else None
    simulated, short = read_choices(folder / LINES)
    places = {} if done is None else {drive.name: place for place, drive in enumerate(done.ranked)}
    task = SizingTask.model_validate(about["task"])
    fraction = 1.0 - task.margin
    return plain(
        {
            "name": task.name,
            "task": _file_of(workspace, task),
            "draws": about["draws"][0],
            "limits": {"out": task.outward_s * fraction, "back": task.back_s * fraction},
            "candidates": [_candidate(one, places.get(one.name), path) for one in simulated],
            "meets": len(places),
            "short": short,
            "done": done is not None and not done.interrupted,
            "searched": is_held(folder / LOCK),
            "feasible": done and done.feasible,
            "checks": [check._asdict() for check in done.checks] if done else [],
            "miss": done and done.miss and vars(done.miss),
            "said": done.sentences if done else [],
            "provisional": read_text(early, CommandError).strip() if early.is_file() and done is None else "",
            "asked": done.asked if done and done.asked and is_of_command(done.asked) else None,
        }
    )


def _json(path: Path, name: str, *keys: str) -> dict[str, Any]:
    if not path.is_file():
        raise CommandError(f"{name} holds no sizing", remedy="Size a task first.")
    found = read_json(path, CommandError)
    if not isinstance(found, dict) or not all(found.get(key) for key in keys):
        raise CommandError(f"{path.name} in {name} is damaged", remedy="Size the task again.")
    return found


def _candidate(one: SizedDrive, place: int | None, folder: str) -> dict[str, Any]:
    # The load ratio has the interval of the stroke with the larger one.
    ratios = [one.intervals[name] for name in ("load_ratio_out", "load_ratio_back") if name in one.intervals]
    ratio = max(ratios, key=lambda ends: ends[1], default=None)
    limits = []
    for name, (value, limit, unit) in one.worst.items():
        factor, read = READ.get(unit, (1.0, unit))
        about = {"name": name, "value": factor * value, "limit": factor * limit, "unit": read}
        limits.append({**about, "margin": one.margins[name], "interval": _scaled(one.intervals.get(name), factor)})
    return {
        **{name: getattr(one, name) for name in SENT},
        "parts": dict(one.parts),
        "setting": one.needles,
        "at_least": one.probability_bound,
        "air": one.air_litres_anr,
        "intervals": {
            **{name: one.intervals.get(name) for name in ("time_out", "time_back", "end_speed", "energy")},
            "air": _scaled(one.intervals.get("air"), ANR_LITRES_PER_KG),
            "load_ratio": _scaled(ratio, 100.0),
        },
        "limits": limits,
        "meets": place is not None,
        "misses": not one.is_feasible,
        "place": place,
        "file": f"{folder}/{place + 1:02d}.toml" if place is not None and place < WRITTEN else "",
    }


def _scaled(ends: tuple[float, float] | None, factor: float) -> list[float] | None:
    return None if ends is None else [factor * end for end in ends]


def _file_of(workspace: Workspace, task: SizingTask) -> str:
    """Return the file of a task, or "" if the workspace no longer has it."""
    tasks = (one for one in workspace.files() if one.kind == "task")
    return next((one.path for one in tasks if _task_at(workspace.path(one.path), one.changed) == task), "")


@lru_cache(maxsize=MOST_TASKS)
def _task_at(path: Path, _changed: float) -> SizingTask | None:
    """Return the task of a file, or None if it is not valid."""
    try:
        return SizingTask.load(path)
    except PneudriveError:
        return None
