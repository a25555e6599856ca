"""Tasks and candidates for the page, read from the text of a task and from the folder of a search."""

from __future__ import annotations

import math
from contextlib import suppress
from pathlib import Path

from pneudrive.arrays import Interval, Plain, attributes_of, by_name
from pneudrive.constants import ANR_LITRES_PER_KG
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.content import read_json, read_text
from pneudrive.files.writing import is_held
from pneudrive.lazy_names import upper
from pneudrive.numbers import plain
from pneudrive.sizing import result as sized
from pneudrive.sizing.checks import READ, SizedDrive
from pneudrive.sizing.search import is_of_command
from pneudrive.sizing.task import SizingTask, follows_from, values_of
from pneudrive.web.messages import problems_of
from pneudrive.web.workspace import Workspace

#: File of an initial task.
FIRST = Path(__file__).with_name("first_task.toml")


def checked_or_first(text: str | None = None) -> Plain:
    """Check the text of a task and return its problems, or its full content. Without a text, return an example task."""
    if text is None:
        return {"text": read_text(FIRST, CommandError)}
    try:
        task = SizingTask.load(text if "\n" in text else f"{text}\n")
    except PneudriveError as error:
        return {"problems": problems_of(error)}
    return {
        "problems": [],
        "name": task.name,
        "values": [by_name(("key", "text", "origin", "kind"), row) for row in values_of(task)],
        "follows": [by_name(("what", "value", "unit"), row) for row in follows_from(task)],
    }


def shown_sizing(workspace: Workspace, path: str) -> Plain:
    """Return a search from its folder: task, simulated candidates, and the ranking if it exists.

    If the search has just started and the folder is still empty, the answer is ``{"waits": True}``.

    Raises
    ------
    CommandError
        The folder does not contain a sizing.
    """
    folder = workspace.folder(path)
    if not (folder / sized.ABOUT).is_file():
        if is_held(folder / sized.LOCK) or all(one.name == sized.LOCK for one in folder.glob("*")):
            return {"waits": True}
        raise CommandError(f"{path} holds no sizing", remedy="Size a task first.")
    about, early = read_json(folder / sized.ABOUT, CommandError), folder / sized.PROVISIONAL
    if not (isinstance(about, dict) and about.get("task") and about.get("draws")):
        raise CommandError(f"{sized.ABOUT} in {path} is damaged", remedy="Size the task again.")
    draws, table = about["draws"][0], about["task"]
    done = sized.SizingResult.load(folder) if (folder / sized.SUMMARY).is_file() else None
    simulated = sized.read_choices(folder / sized.LINES)
    places = {} if done is None else {drive.name: place for place, drive in enumerate(done.ranked)}
    files = {} if done is None else {drive.name: f"{path}/{file}" for file, drive in done.written.items()}
    task = SizingTask.model_validate(table)
    ranked = sorted(
        simulated, key=lambda drive: (places.get(drive.name, len(places)), not drive.is_feasible, drive.rank)
    )
    gauge_bar = 1e-5 * (task.supply_pa - task.ambient.pressure_pa)
    tasks = (file for file in workspace.files() if file.kind == "task")  # one of them may be that of the search
    return {
        "name": task.name,
        "words": (
            f"{plain(task.mass_kg)} kg by {plain(1e3 * task.stroke_m)} mm in {plain(task.outward_s)} s, "
            f"back in {plain(task.back_s)} s; incline {plain(math.degrees(task.incline_rad))} deg, "
            f"{plain(gauge_bar)} bar gauge, tubes of {plain(task.tube_length_m)} m"
        ),
        "task": next((file.path for file in tasks if _task_at(workspace.path(file.path)) == task), ""),
        "draws": draws,
        "candidates": [_candidate(one, places.get(one.name), files.get(one.name, "")) for one in ranked],
        "view": done and done.view().data(),
        "sheet": done and done.best and upper("sizing_sheet")(done).data(),
        "done": done is not None and not done.interrupted,
        "searched": is_held(folder / sized.LOCK),
        "provisional": read_text(early, CommandError).strip() if early.is_file() and done is None else "",
        "asked": done.asked if done and done.asked and is_of_command(done.asked) else None,
    }


def _candidate(drive: SizedDrive, place: int | None, file: str) -> Plain:
    rows = list[tuple[object, ...]]()
    for name, (value, limit, unit) in drive.worst.items():
        factor, read = READ.get(unit, (1.0, unit))
        ends = _scaled(drive.intervals.get(name), factor)
        rows.append((name, factor * value, factor * limit, read, drive.margins[name], ends))
    air = _scaled(drive.intervals.get("air"), ANR_LITRES_PER_KG)
    rows.append(("air of a cycle", drive.air_litres_anr, None, "l ANR", None, air))
    # The load ratio gets the interval of the stroke with the larger load ratio.
    ratios = [drive.intervals[name] for name in ("load_ratio_out", "load_ratio_back") if name in drive.intervals]
    if ratio := max(ratios, key=lambda ends: ends[1], default=None):
        rows.append(("load ratio", 100.0 * ratio[1], 100.0, "%", 1.0 - ratio[1], _scaled(ratio, 100.0)))
    return {
        **attributes_of(drive, "name", "draws", "met", "time_out", "time_back", "energy", "margin"),
        **attributes_of(drive, "binding", "load_ratio"),
        "title": sized.maker_type(drive.parts["cylinder"]),
        "cylinder": drive.parts["cylinder"],
        "parts": drive.part_names,
        "setting": drive.needles,
        "at_least": drive.probability_bound,
        "air": drive.air_litres_anr,
        "limits": [by_name(("name", "value", "limit", "unit", "margin", "interval"), row) for row in rows],
        "misses": not drive.is_feasible,
        "place": place,
        "file": file,
    }


def _scaled(ends: Interval | None, factor: float) -> list[float] | None:
    return None if ends is None else [factor * end for end in ends]


def _task_at(path: Path) -> SizingTask | None:
    """Return the task of a file, or None if it is not valid."""
    with suppress(PneudriveError):
        return SizingTask.load(path)
    return None
