"""Socket of the sliders: a thread runs one request, the newest request waits, and older requests are dropped."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Sequence

import numpy as np
from starlette.websockets import WebSocket, WebSocketDisconnect

from pneudrive.arrays import Plain
from pneudrive.errors import Cancelled, CommandError, PneudriveError, package_table
from pneudrive.simulation.run_view import run_view
from pneudrive.simulation.trajectory import meaning
from pneudrive.units import readable
from pneudrive.views import SentValue
from pneudrive.web.drive.run_request import ExtrasRequest, Run, RunLimit, described_at, with_changes
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import answer_of, pack, page_error, problems_of, table_of
from pneudrive.web.workspace import Workspace

#: Panels of the page: quantity of the columns in it, its SI unit, and its title.
PANELS: list[list[str]] = package_table(__file__, "panels.toml")["run"]
#: Kind of a request other than a run -> function that answers, see `answer_of`.
ANSWERS = {
    "window": "measured.recordings:shown_window",
    "control": "drive.control:answer",
    "validation": "measured.validation:frame_of",
}
PROTOCOL = "pneudrive"  # subprotocol of the socket; a second subprotocol carries the token
ANSWERED = threading.Event()  # set by the first answer
MOST_CURVES = 8  # curves in a panel: as many as there are line styles
MOST_IMPACTS = MOST_EVENTS = 40  # impacts, and moments marked above the curves
AT_REST_M_S = 1e-3  # a piston slower than this is at rest
LONG_REST = 20  # samples without motion that are marked as a rest


async def live(socket: WebSocket, workspace: Workspace, threads: asyncio.Semaphore) -> None:
    """Answer runs and views of recordings until the page disconnects."""
    await socket.accept(subprotocol=PROTOCOL)
    waiting, limit = asyncio.Queue[str](1), RunLimit(0.0)

    async def work() -> None:
        nonlocal limit
        while True:
            message = await waiting.get()
            async with threads:
                limit = RunLimit()
                frame = await asyncio.to_thread(answer, workspace, message, limit)
            await socket.send_bytes(frame)
            ANSWERED.set()

    worker = asyncio.create_task(work())
    try:
        while True:
            message = await socket.receive_text()
            if waiting.full():
                waiting.get_nowait()  # a new request replaces one that was not begun
            waiting.put_nowait(message)
    except (WebSocketDisconnect, KeyError):  # KeyError: the message has bytes instead of text
        pass
    finally:
        limit.cancelled = True
        worker.cancel()


def answer(workspace: Workspace, message: str, limit: RunLimit | None = None) -> bytes:
    """Run the request of a message, and return the answer as a frame with the number of the request."""
    number = path = None
    limit = limit or RunLimit()
    try:
        asked = table_of(message)
        number, path = asked.get("number"), asked.get("path")
        if name := ANSWERS.get(str(asked.get("what"))):
            return answer_of(name, asked, {"workspace": workspace, "limit": limit})  # type: ignore[no-any-return]
        extras = ExtrasRequest.of(asked)
        described = with_changes(described_at(workspace, extras.path, extras.text), extras.changes)
        run = extras.run(workspace, described, limit)
        panels = panels_of(run)
        shown = [curve["column"] for panel in panels for curve in panel["curves"]]
        head, arrays = extras.answer(workspace, described, run, shown, limit)
        return frame_of(run, panels, extras.pixels, {"number": number, "path": path, **head}, arrays)
    except Cancelled:
        error: PneudriveError = CommandError(
            f"the run took longer than {limit.seconds:g} s of real time",
            remedy="Make it shorter, or copy the command and run it in a terminal.",
        )
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as raised:  # also an unexpected one; without an answer the page would wait forever
        error = page_error(raised)
    return pack({"number": number, "path": path, "problems": problems_of(error)}, {})


def panels_of(run: Run) -> list[Plain]:
    """Return the panels of a run with their curves. Panels without a column are left out."""
    panels = []
    for *quantity, title in PANELS:
        if every := [name for name in run.columns if [*_quantity(name)] == quantity]:
            size, unit = readable(quantity[1])
            curves = [{"column": name, "label": meaning(name)[0].replace("_", " ")} for name in every[:MOST_CURVES]]
            left_out = len(every) - len(curves)
            panels.append({"title": title, "unit": unit, "size": size, "curves": curves, "left_out": left_out})
    return panels


def frame_of(run: Run, panels: Sequence[Plain], pixels: int, head: Plain, beside: Plain) -> bytes:
    """Pack the drawn data of a run: time and the columns of its panels in SI, and notes in the head."""
    names = (curve["column"] for panel in panels for curve in panel["curves"])
    columns = {name: run.columns[name] for name in ("time_s", *names)}
    about = run.provenance
    impacts = about["impacts"]
    told = {"warnings": about["warnings"], "impacts": impacts[:MOST_IMPACTS], "assumed": len(about["assumed"])}
    told["more_impacts"] = len(impacts) - len(told["impacts"])
    # Moments that the page marks above the curves: impacts, reversals and stops.
    time, events = run.columns["time_s"], [(one["time_s"], f"impact, end {one['end']}") for one in impacts]
    for name in (column for column in run.columns if _quantity(column) == ("velocity", "m/s")):
        speed = run.columns[name]
        sign = np.sign(np.where(np.abs(speed) > AT_REST_M_S, speed, 0.0))
        moving = np.flatnonzero(sign)
        turns = moving[1:][np.diff(sign[moving]) != 0]
        gaps = np.flatnonzero(np.diff(moving) > LONG_REST)
        events += [(time[at], "reversal") for at in turns] + [(time[moving[at] + 1], "rest") for at in gaps]
    told["events"] = [{"time_s": at, "what": what} for at, what in sorted(set(events))[:MOST_EVENTS]]
    # Air needs the gas of the description, which the run does not have.
    told["leading"] = [SentValue.of(one) for one in run_view(run.columns, about).leading if one.key != "air"]
    ends = {name: values[-1] for name, values in columns.items()}
    head |= {**told, "panels": panels, "ends": ends, "samples": len(columns["time_s"])}
    return pack(head, {**drawn_columns(columns, pixels), **beside})


def _quantity(column: str) -> tuple[str, str]:
    """Return the quantity of a column, independent of component and chamber, and its unit."""
    name, unit, _ = meaning(column)
    last = name.rpartition(".")[2]
    if last in ("heave", "x", "y", "z") and unit == "m":
        return "place", unit
    if last.startswith("tilt_") and unit == "rad":
        return "tilt", unit
    return (last.removesuffix("_a").removesuffix("_b") if last.startswith("pressure") else last), unit
