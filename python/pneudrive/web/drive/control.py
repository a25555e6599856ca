"""Control requests of the page: a run, a benchmark as a job, and its score card."""

from __future__ import annotations

import math
import posixpath
import shlex
import time
from contextlib import suppress
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, Field, StrictInt, StrictStr

from pneudrive.control.controller import Controller
from pneudrive.control.loop import prepare, run_prepared
from pneudrive.control.mismatch import read_mismatch, ready_mismatches
from pneudrive.control.references import RECORDS, reference
from pneudrive.control.results.card import read_comparison
from pneudrive.control.results.comparison import standard
from pneudrive.control.results.measures import SHOWN, Score, written
from pneudrive.control.setup import ready_setups
from pneudrive.control.tuning import laws
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.progress import Watch
from pneudrive.web.drive.run_request import MOST_SAMPLES, RunLimit, described_at
from pneudrive.web.jobs import RESULTS, JobRequest, folder_name
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import pack
from pneudrive.web.requests import MOST_PIXELS, PageRequest, Pixels, Value
from pneudrive.web.workspace import DESCRIPTIONS, NewNames, is_in_catalogue, safe

if TYPE_CHECKING:
    from collections.abc import Mapping
    from pathlib import Path

    from pneudrive.control.loop import Prepared
    from pneudrive.control.results.card import StoredComparison
    from pneudrive.describe.circuit import Circuit
    from pneudrive.describe.drive import Drive
    from pneudrive.simulation.simulate import Run
    from pneudrive.web.workspace import Workspace

MOST_SECONDS = 10.0  # longest computing time of a run under control
MOST_MEMBERS = 10_000
MOST_EACH = 20_000  # runs whose values of a measure are sent
SMALL_M = 5e-3  # largest error that is drawn in micrometres
SLIDER = 4.0  # a gain's slider ranges from a quarter to four times its derived value
#: Panels of a run: title, SI unit of the columns, unit and its size, columns with their labels.
_PANELS = (
    ("Position", "mm", 1e-3, (("position_m", "position"), ("reference_m", "reference"))),
    ("Error", "", 0.0, (("error_m", "reference less position"),)),
    ("Pressure, absolute", "bar", 1e5, (("pressure_a_pa", "chamber a"), ("pressure_b_pa", "chamber b"))),
    ("Command", "", 1.0, (("command", "command"),)),
    ("Disturbance estimated by the controller", "N", 1.0, (("disturbance_n", "disturbance"),)),
)
_REFERENCE_FILES = (*DESCRIPTIONS, *RECORDS)


class ControlRequest(PageRequest):
    """A run under control, checked as far as possible without its drive.

    Attributes
    ----------
    path : str
        Drive or circuit: a name in the workspace, or ``catalogue:NAME``.
    law : str
        A key of `pneudrive.control.laws`, or a controller file of the workspace.
    gains : dict
        Gain -> value, in place of the derived gain. Only with a key.
    reference, setup, mismatch : str
        As for `pneudrive.control.run`. Files are in the workspace. An empty `mismatch` stands for no mismatch.
    seed : int
    duration : str
        Empty: from the reference.
    pixels : int
        Width of the drawing.
    """

    path: StrictStr = ""
    law: StrictStr = "nmpc"
    gains: dict[str, Value] = Field(default_factory=dict)
    reference: Annotated[StrictStr, AfterValidator(str.strip)] = ""
    setup: StrictStr = "real"
    mismatch: StrictStr = ""
    seed: StrictInt = 1
    duration: StrictStr = ""
    pixels: Pixels = 1000

    def prepared(self, workspace: Workspace) -> Prepared:
        """Return everything that determines the run, except its seed.

        Raises
        ------
        PneudriveError
            A name leads out of the workspace, a file is not valid, or the drive cannot follow the reference.
        """
        drive = described_at(workspace, self.path)
        law, controller = self.law, None
        if _is_file(self.law):
            law, controller = None, _controller(workspace, self.law)
        elif law not in laws():
            raise CommandError(f'there is no law "{law[:80]}"', rule=", ".join(laws()))
        elif self.gains:
            law, controller = None, Controller(law=law, gains=dict(self.gains))
        if self.gains and _is_file(self.law):
            raise CommandError(f"{self.law} has gains of its own", remedy="Change them in the file.")
        return prepare(
            drive,
            law,
            _reference(workspace, self.reference),
            setup=_ready(workspace, self.setup, ready_setups(), "setup"),
            duration=self.duration or None,
            controller=controller,
            mismatch=self.place_of_mismatch(workspace) if self.mismatch else None,
        )

    def place_of_mismatch(self, workspace: Workspace) -> str:
        """Return the name of a mismatch of the package, or the path of its file.

        Raises
        ------
        CommandError
            It is neither a ready mismatch nor a file of the workspace.
        """
        return _ready(workspace, self.mismatch, ready_mismatches(), "mismatch")

    def run(self, workspace: Workspace, limit: RunLimit | None = None) -> tuple[Prepared, Run]:
        """Run it.

        Raises
        ------
        PneudriveError
            As for `prepared`, or the run is too long for a page, or the drive cannot continue.
        Cancelled
            The time is over, or the page no longer waits.
        """
        prepared = self.prepared(workspace)
        samples = prepared.duration_s / prepared.tuning.period_s
        if samples > MOST_SAMPLES:
            raise CommandError(
                f"{samples:.3g} samples are too many for the page",
                rule=f"at most {MOST_SAMPLES:.0e}",
                remedy="Copy the command and run it in a terminal.",
            )
        limit = limit or RunLimit()
        limit.allow(MOST_SECONDS)
        return prepared, run_prepared(prepared, self.seed, Watch(cancel=limit))

    def as_command(self, names: NewNames) -> str:
        """Return the shell lines that make the same run in the folder of the workspace."""
        lines, law = [], self.law
        stem = posixpath.splitext(self.path.rpartition(":")[2].rpartition("/")[2])[0] or "axis"
        if self.gains:
            law = names.of(f"{stem}-{self.law}", ".toml")
            lines.append(f"printf %s {shlex.quote(_controller_text(self.law, self.gains))} > {shlex.quote(law)}")
        words = ["pneudrive", "control", "run", safe(self.path), f"--reference={self.reference}"]
        words += ["--controller", safe(law), "--setup", self.setup, "--seed", str(self.seed)]
        words += ["--mismatch", self.mismatch] if self.mismatch else []
        words += ["--duration", self.duration] if self.duration else []
        return "\n".join([*lines, shlex.join([*words, "--out", names.of(f"{stem}-control")])])

    def as_python(self, described: Drive | Circuit) -> str:
        """Return the lines of Python that make the same run in the folder of the workspace."""
        lines = ["import pneudrive as pn", "", f"drive = pn.{type(described).__name__}.load({self.path!r})"]
        law = f"controller={self.law!r}" if _is_file(self.law) else repr(self.law)
        if self.gains:
            lines.append(f"controller = pn.control.Controller(law={self.law!r}, gains={dict(self.gains)!r})")
            law = "controller=controller"
        words = [law, f"reference={self.reference!r}", f"setup={self.setup!r}", f"seed={self.seed}"]
        words += [f"{name}={getattr(self, name)!r}" for name in ("mismatch", "duration") if getattr(self, name)]
        return "\n".join([*lines, f"run = pn.control.run(drive, {', '.join(words)})", ""])


def _controller_text(law: str, gains: Mapping[str, str | float]) -> str:
    lines = [f"{key} = {toml.value_text(value)}" for key, value in gains.items()]
    return "\n".join(["schema = 1", f"law = {toml.value_text(law)}", "", "[gains]", *lines, ""])


def _is_file(law: str) -> bool:
    return law.lower().endswith(DESCRIPTIONS)


def _controller(workspace: Workspace, name: str) -> str:
    """Return the place of a controller file.

    The drive that a controller file assumes must also be in the workspace or the catalogue.
    """
    tables = toml.parse(workspace.read(name)[0], name)
    drive = tables.get("drive")
    if isinstance(drive, str):
        beside = posixpath.normpath(posixpath.join(posixpath.dirname(name), drive))
        described_at(workspace, drive if is_in_catalogue(drive) else beside)
    return str(workspace.path(name, DESCRIPTIONS))


def _ready(workspace: Workspace, name: str, ready: Mapping[str, Path], what: str) -> str:
    """Return the name of a table of the package, or the path of a file in the workspace."""
    if name in ready:
        return name
    if not _is_file(name):
        raise CommandError(f'there is no {what} "{name[:80]}"', rule=f"a TOML file, or {', '.join(ready)}")
    return str(workspace.path(name, DESCRIPTIONS))


def _reference(workspace: Workspace, text: str) -> str:
    """Return a reference unchanged, or the path of its file in the workspace."""
    return str(workspace.path(text, _REFERENCE_FILES)) if text.endswith(_REFERENCE_FILES) else text


def answer(workspace: Workspace, asked: Mapping[str, Any], limit: RunLimit | None = None) -> bytes:
    """Run the request of a message, and return the frame of the answer with its number.

    Raises
    ------
    PneudriveError
        As for `ControlRequest.run`.
    """
    request = ControlRequest.of(asked)
    began = time.monotonic()
    prepared, run = request.run(workspace, limit)
    took = time.monotonic() - began
    shown = {name: run.columns[name] for panel in _PANELS for name, _ in panel[3] if name in run.columns}
    shown["error_m"] = run.columns["reference_m"] - run.columns["position_m"]
    columns = {"time_s": run.columns["time_s"], **shown}
    error = _error_unit([columns["error_m"]])
    panels = [
        {
            "title": title,
            "unit": unit if size else error["unit"],
            "size": size or error["size"],
            "curves": [{"column": name, "label": label} for name, label in curves],
        }
        for title, unit, size, curves in _PANELS
    ]
    described = described_at(workspace, request.path)
    head = {"number": asked.get("number"), "panels": panels, "samples": len(columns["time_s"]), "took_s": took}
    head |= {"command": request.as_command(NewNames(workspace)), "python": request.as_python(described)}
    deviation = read_mismatch(request.place_of_mismatch(workspace))[0].about if request.mismatch else ""
    head |= {"mismatch": [prepared.mismatch, deviation], "warnings": prepared.warnings}
    return pack({**head, **_about(prepared, run)}, drawn_columns(columns, request.pixels))


def _error_unit(errors_m: list[Any]) -> dict[str, Any]:
    largest = max((float(np.abs(one).max()) for one in errors_m if len(one)), default=0.0)
    return {"unit": "um", "size": 1e-6} if largest < SMALL_M else {"unit": "mm", "size": 1e-3}


def _about(prepared: Prepared, run: Run) -> dict[str, Any]:
    """Return the assumed drive, the true drive and the results of a run."""
    tuning, said = prepared.tuning, run.provenance
    score = Score(**said["score"])
    gains = []
    for gain in tuning.gains:
        number, _, unit = str(gain.quantity).partition(" ")
        low, high = sorted((gain.value / SLIDER, gain.value * SLIDER)) if gain.value else (0.0, 1.0)
        scale = float(number) / gain.value if gain.value else 1.0
        text = {"key": gain.key, "number": float(number), "unit": unit, "low": scale * low, "high": scale * high}
        gains.append(text | {"meaning": gain.meaning, "rule": "given" if gain.given else gain.rule})
    return {
        "law": tuning.law,
        "drive": prepared.circuit.name,
        "believes": tuning.belief.name,
        "period_s": tuning.period_s,
        "gains": gains,
        "plant": tuning.plant.rows(),
        "limits": tuning.limits,
        "setup": [prepared.setup_name, prepared.setup.about],
        "true": [{"name": name, "value": f"{value:.4g}"} for name, value in said["deviations"].items()],
        "score": _score(score),
        "events": said["events"][:20],
        "assumed": len(said["assumed"]),
        "synthetic": True,
        "lost": score.lost,
    }


def _score(score: Score) -> list[dict[str, Any]]:
    """Return the measures of a run, as text and as number. A number that JSON does not support becomes None."""
    each = ((name, title, getattr(score, name)) for name, (title, *_) in SHOWN.items())
    return [
        {"name": name, "title": title, "text": written(name, value), "value": _number(value)}
        for name, title, value in each
        if value is not None
    ]


def _number(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else float(value)


def choices(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return the options for a drive: controllers, instrumentations and mismatches of the package, standard references.

    Raises
    ------
    PneudriveError
        The description is not valid, or no controller can command it.
    """
    usual = standard(described_at(workspace, path))
    ready = {name: read_mismatch(name)[0].is_spread for name in sorted(ready_mismatches())}
    return {
        "laws": laws(),
        "setups": sorted(ready_setups()),
        "mismatches": [name for name, is_spread in ready.items() if not is_spread],
        "spreads": [name for name, is_spread in ready.items() if is_spread],
        "references": [{"name": name, "text": one.text, "usable": _is_text(one.text)} for name, one in usual.items()],
    }


def _is_text(text: str) -> bool:
    try:
        reference(text)
    except CommandError:
        return False
    return True


def comparison_job(given: Mapping[str, Any], workspace: Workspace) -> JobRequest:
    """Return the job that runs a benchmark into a new folder, or continues the benchmark of a folder.

    Raises
    ------
    PneudriveError
        A part is missing, leads out of the workspace, or is not valid, or the folder does not match the request.
    """
    folder = given.get("resume")
    if isinstance(folder, str):
        asked = read_comparison(workspace.folder(folder)).about.get("asked")
        if not asked:
            raise CommandError(f"{folder} does not say how it was begun", remedy="Run its command again.")
        return _job(asked, workspace, folder, is_new=False)
    return _job(given, workspace, f"{RESULTS}/{folder_name(given.get('name'))}", is_new=True)


def _job(given: Mapping[str, Any], workspace: Workspace, out: str, *, is_new: bool) -> JobRequest:
    texts = {name: given.get(name) or usual for name, usual in (("drive", ""), ("setup", "real"))}
    texts |= {name: given.get(name) or "" for name in ("mismatch", "spread")}
    lists = [_words(given.get(name), name) for name in ("laws", "references")]
    count = given.get("count", 1)
    right = all(isinstance(text, str) for text in texts.values()) and isinstance(count, int)
    if not right or isinstance(count, bool) or not 1 <= count <= MOST_MEMBERS:
        raise CommandError(f"count = {str(count)[:80]} is out of bounds", rule=f"a whole number, 1 to {MOST_MEMBERS}")
    drive = described_at(workspace, texts["drive"])
    for law in lists[0]:
        if _is_file(law):
            _controller(workspace, law)
        elif law not in (*laws(), "all"):
            raise CommandError(f'there is no law "{law[:80]}"', rule=", ".join(laws()))
    for along in lists[1]:
        _reference(workspace, along)
    _ready(workspace, texts["setup"], ready_setups(), "setup")
    words = ["control", "benchmark", safe(texts["drive"]), "--laws", ",".join(map(safe, lists[0]))]
    words += [f"--references={','.join(lists[1])}", "--setup", safe(texts["setup"])]
    for name in ("mismatch", "spread"):
        if texts[name]:
            _ready(workspace, texts[name], ready_mismatches(), name)
            words += [f"--{name}", safe(texts[name])]
    words += ["--members" if texts["spread"] else "--seeds", str(count), "--out", safe(out)]
    kind = type(drive).__name__
    options = [f"{name}={texts[name]!r}" for name in ("setup", "mismatch", "spread") if texts[name]]
    options.append(f"{'members' if texts['spread'] else 'seeds'}={count}")
    asked = ", ".join(repr(one[0]) if one in (["all"], ["standard"]) else repr(one) for one in lists)
    python = f"import pneudrive as pn\n\ndrive = pn.{kind}.load({texts['drive']!r})\n"
    python += f"card = pn.control.benchmark(drive, {asked}, {', '.join(options)}, out={out!r})\n"
    return JobRequest(tuple(words), out, is_new=is_new, python=python)


def _words(given: object, what: str) -> list[str]:
    """Return a list of words for one argument of a command. No item may contain a comma."""
    each = [given] if isinstance(given, str) else given
    if not isinstance(each, list) or not each or not all(isinstance(one, str) and one.strip() for one in each):
        raise CommandError(f"{what} are missing", remedy="Choose at least one.")
    for one in each:
        if "," in one:
            raise CommandError(f"{one[:80]!r} has a comma, which separates {what}", remedy="Write it without.")
    return [one.strip() for one in each]


def shown_card(workspace: Workspace, name: str, measure: str = "") -> dict[str, Any]:
    """Return the score card of a folder: a measure of each run and its medians, the assumed drive and the true drive.

    Raises
    ------
    CommandError
        The folder is not a benchmark, or the measure does not exist.
    """
    card, measure = read_comparison(workspace.folder(name)), measure or "max_error_m"
    if measure not in SHOWN:
        raise CommandError(f"{measure[:80]!r} is not a measure", rule=", ".join(SHOWN))
    job = None
    if card.about.get("asked"):
        with suppress(PneudriveError):  # started elsewhere, or without its drive file: the card is shown anyway
            job = _job(card.about["asked"], workspace, name, is_new=False)
    told = card.about["laws"]
    return {
        "drive": card.drive,
        "setup": [card.setup, str(card.about.get("setup_about", ""))],
        "mismatch": card.mismatch,
        "spread": card.spread,
        "count": card.count,
        "total": card.count * len(card.references) * len(told),
        "finished": card.is_finished,
        "done": len(card.runs),
        "laws": list(told),
        "references": [{"name": along, "text": text} for along, text in card.references.items()],
        "measures": [
            {"name": one, "title": title, "size": 1.0 / factor, "unit": unit}
            for one, (title, factor, unit) in SHOWN.items()
        ],
        "cells": [_cell(card, law, along, measure) for law in told for along in card.references],
        "each": [
            {
                "law": run.law,
                "reference": run.reference,
                "seed": run.seed,
                "value": None if run.score is None else _number(getattr(run.score, measure)),
            }
            for run in card.runs[:MOST_EACH]
        ],
        "tables": {along: _table(card, along) for along in card.references} if card.is_finished else {},
        "told": told,
        "plant": card.about["plant"],
        "true": _true(card),
        "failed": [f"{run.law} along {run.reference}, {run.seed}: {run.reason}" for run in card.runs if run.reason][
            :20
        ],
        "command": f"pneudrive {shlex.join(job.arguments)}" if job else "",
        "python": job.python if job else f"import pneudrive as pn\n\ncard = pn.control.read_comparison({name!r})\n",
    }


def _cell(card: StoredComparison, law: str, along: str, measure: str) -> dict[str, Any]:
    """Return a measure of a controller along a reference: median, least and largest, or 95 and 100 % limits."""
    shares = (0.5, 0.95, 1.0) if card.spread else (0.5, 0.0, 1.0)
    middle, *others = (card.within(law, along, measure, share) for share in shares)
    lost = sum(run.score is None or run.score.lost for run in card.of(law, along))
    return {
        "law": law,
        "reference": along,
        "text": written(measure, middle),
        "range": [written(measure, one) for one in others],
        "value": _number(middle),
        "best": card.best(along, measure) == law and _number(middle) is not None,
        "lost": lost,
    }


def _table(card: StoredComparison, along: str) -> dict[str, Any]:
    """Return the medians of all measures of a reference."""
    heads, rows = card.table(along, spread=False)
    return {"heads": heads, "rows": rows}


def _true(card: StoredComparison) -> list[dict[str, str]]:
    """Return the true values that differ from the assumed ones: over all runs, the least and the largest."""
    each: dict[str, list[float]] = {}
    for run in card.runs:
        for name, value in run.truth.items():
            each.setdefault(name, []).append(value)
    return [{"name": name, "least": f"{min(of):.4g}", "largest": f"{max(of):.4g}"} for name, of in each.items()]


def shown_tracks(workspace: Workspace, name: str, along: str, pixels: str = "") -> bytes:
    """Return the tracks of all controllers and their errors as a frame, with each controller's first run.

    Raises
    ------
    CommandError
        The folder is not a benchmark, or does not have this reference.
    """
    width = pixels or "1000"
    if not width.isdecimal() or not 1 <= int(width) <= MOST_PIXELS:
        raise CommandError("the width is out of bounds", rule=f"1 to {MOST_PIXELS} pixels")
    card = read_comparison(workspace.folder(name))
    if along not in card.references:
        raise CommandError(f"{along[:80]!r} is not a reference of {name}", rule=", ".join(card.references))
    tracks: dict[str, dict[str, Any]] = {}
    for law in card.laws:
        run = next((one for one in card.of(law, along) if one.score is not None and one.file.is_file()), None)
        if run is not None:
            tracks[law] = {"seed": run.seed, **run.columns("time_s", "position_m", "reference_m")}
            tracks[law]["error_m"] = tracks[law]["reference_m"] - tracks[law]["position_m"]
    arrays: dict[str, Any] = {}
    for law, one in tracks.items():
        thin = drawn_columns({key: one[key] for key in ("time_s", "position_m", "reference_m", "error_m")}, int(width))
        arrays |= {f"{law}/{key}": values for key, values in thin.items()}
    head = {"reference": along, "laws": list(tracks), "seeds": [track["seed"] for track in tracks.values()]}
    return pack(head | {"error": _error_unit([track["error_m"] for track in tracks.values()])}, arrays)
