"""Control requests of the page: a run, a benchmark as a job, and its score card."""

from __future__ import annotations

import posixpath
import shlex
import time
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field, StrictInt, StrictStr, ValidationInfo

from pneudrive.arrays import Keyed, Plain, attributes_of
from pneudrive.control.benchmarks import ControlComparison, assumptions, read_comparison, standard
from pneudrive.control.loop import Prepared, prepare, run_prepared
from pneudrive.control.mismatch import read_mismatch, ready_mismatches
from pneudrive.control.motion import RECORDS
from pneudrive.control.scores import SHOWN, view_of_score, written
from pneudrive.control.setup import ready_setups
from pneudrive.control.tuning import Controller, laws
from pneudrive.describe.files import toml
from pneudrive.errors import Cancelled, CommandError, PneudriveError, package_table
from pneudrive.progress import Watch
from pneudrive.report.page import Topic
from pneudrive.report.trajectory import error_unit, gain_rows, tracks_of
from pneudrive.views import ShownTable, View
from pneudrive.web.drive.run_request import Described, Run, RunLimit, check_samples, described_at
from pneudrive.web.jobs import RESULTS, JobRequest, folder_name
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import MOST_PIXELS, PageRequest, Pixels, Value, bounded, call, pack, python, words
from pneudrive.web.workspace import DESCRIPTIONS, NewNames, Workspace, is_in_catalogue, safe

MOST_SECONDS = 10.0  # longest computing time of a run under control
MOST_MEMBERS = 10_000
MOST_FAILED = 20  # reasons of failed runs that are sent
MOST_EACH = 20_000  # runs whose values of a measure are sent
TRUE = "True drive: factors of the described values, and values in SI."
SLIDER = 4.0  # a gain's slider ranges from a quarter to four times its derived value
#: Panels of a run: title, displayed unit, size of this unit in SI, columns with their labels.
_PANELS = package_table(__file__, "../panels.toml")["control"]


class ControlRequest(PageRequest):
    """Request for a run under control. The fields that do not depend on the drive are already checked.

    Attributes
    ----------
    path : str
        Drive or circuit: a name in the workspace, or ``catalogue:NAME``.
    law : str
        A key of `pneudrive.control.laws`, or a controller file of the workspace.
    gains : dict
        Gain -> value that replaces the derived value. Allowed only if `law` is a key.
    reference, setup, mismatch : str
        As for `pneudrive.control.run`. Files are in the workspace. An empty `mismatch` means no mismatch.
    seed : int
    duration : str
        Duration of the run; empty: the default duration of the reference.
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

    def run(self, workspace: Workspace, limit: RunLimit) -> tuple[Prepared, Run]:
        """Run the drive under control. Return the prepared inputs (all except the seed), and the run.

        Raises
        ------
        PneudriveError
            A name is outside the workspace, a file is not valid, the drive cannot follow the reference, the
            simulation cannot continue, or the run is too long for a page.
        Cancelled
            The time limit is reached, or the page no longer waits.
        """
        drive = described_at(workspace, self.path)
        controller: Controller | str | None = _checked_law(workspace, self.law) or None
        if controller and self.gains:
            raise CommandError(f"{self.law} is a file with its own gains", remedy="Change them in the file.")
        if self.gains:
            controller = Controller(law=self.law, gains=dict(self.gains))
        prepared = prepare(
            drive,
            None if controller else self.law,
            _reference(workspace, self.reference),
            setup=_ready(workspace, self.setup, "setup"),
            duration=self.duration or None,
            controller=controller,
            mismatch=_ready(workspace, self.mismatch, "mismatch") if self.mismatch else None,
        )

        check_samples(prepared.duration_s / prepared.tuning.period_s)
        limit.allow(MOST_SECONDS)
        return prepared, run_prepared(prepared, self.seed, Watch(cancel=limit))

    @property
    def _options(self) -> Plain:
        return attributes_of(self, "setup", "seed", "mismatch", "duration")

    def as_command(self, names: NewNames) -> str:
        """Return the shell lines that make the same run in the folder of the workspace."""
        text, law = "", self.law
        stem = posixpath.splitext(self.path.rpartition(":")[2].rpartition("/")[2])[0] or "axis"
        if self.gains:
            law = names.of(f"{stem}-{self.law}", ".toml")
            file = toml.write({"schema": 1, **attributes_of(self, "law", "gains")})
            text = f"{shlex.join(['printf', '%s', file])} > {shlex.quote(law)}\n"
        out = names.of(f"{stem}-control")
        line = words("control run", self.path, controller=safe(law), **self._options, out=out)
        line.insert(3, f"--reference={self.reference}")
        return text + shlex.join(["pneudrive", *line])

    def as_python(self, described: Described) -> str:
        """Return the lines of Python that make the same run in the folder of the workspace."""
        lines = ["import pneudrive as pn", "", f"drive = pn.{type(described).__name__}.load({self.path!r})"]
        law = f"controller={self.law!r}" if _is_file(self.law) else repr(self.law)
        if self.gains:
            lines.append(f"controller = pn.control.Controller(law={self.law!r}, gains={dict(self.gains)!r})")
            law = "controller=controller"
        run = call("pn.control.run", "drive", law, f"reference={self.reference!r}", **self._options)
        return "\n".join([*lines, f"run = {run}", ""])


def _is_file(law: str) -> bool:
    return law.lower().endswith(DESCRIPTIONS)


def _checked_law(workspace: Workspace, law: str) -> str:
    """Check a controller and return the path of its file, or "" for a key of `laws`.

    The drive that a controller file assumes must also be in the workspace or the catalogue.
    """
    if _is_file(law):
        drive = toml.parse(workspace.read(law)[0], law).get("drive")
        if isinstance(drive, str):
            beside = posixpath.normpath(posixpath.join(posixpath.dirname(law), drive))
            described_at(workspace, drive if is_in_catalogue(drive) else beside)
        return str(workspace.path(law, DESCRIPTIONS))
    if law not in laws():
        raise CommandError(f'there is no law "{law[:80]}"', rule=", ".join(laws()))
    return ""


def _ready(workspace: Workspace, name: str, kind: str) -> str:
    """Return the name of a setup or mismatch of the package, or the path of a file in the workspace."""
    ready = ready_setups() if kind == "setup" else ready_mismatches()
    if name in ready:
        return name
    if not _is_file(name):
        raise CommandError(f'there is no {kind} "{name[:80]}"', rule=f"a TOML file, or {', '.join(ready)}")
    return str(workspace.path(name, DESCRIPTIONS))


def _reference(workspace: Workspace, text: str) -> str:
    """Return a reference unchanged, or the path of its file in the workspace."""
    files = (*DESCRIPTIONS, *RECORDS)
    return str(workspace.path(text, files)) if text.endswith(files) else text


def answer(workspace: Workspace, request: ControlRequest, limit: RunLimit, number: object = None) -> bytes:
    """Run a request, and return the answer as a frame with the number of the request.

    Raises
    ------
    PneudriveError
        As for `ControlRequest.run`.
    """
    began = time.monotonic()
    prepared, run = request.run(workspace, limit)
    took = time.monotonic() - began
    shown = {"time_s", *(column for *_, curves in _PANELS for column, _ in curves)}
    columns = {name: values for name, values in run.columns.items() if name in shown}
    columns["error_m"] = run.columns["reference_m"] - run.columns["position_m"]
    error = _error_unit([columns["error_m"]])
    panels = [
        {"title": title, "curves": [{"column": name, "label": label} for name, label in curves]}
        | ({"unit": unit, "size": size} if size else error)
        for title, unit, size, curves in _PANELS
    ]
    deviation = read_mismatch(_ready(workspace, request.mismatch, "mismatch"))[0].about if request.mismatch else ""
    head = {
        "number": number,
        "panels": panels,
        "samples": len(columns["time_s"]),
        "took_s": took,
        "command": request.as_command(NewNames(workspace)),
        "python": request.as_python(described_at(workspace, request.path)),
        "mismatch": [prepared.mismatch, deviation],
        "warnings": prepared.warnings,
    }
    return pack({**head, **_about(prepared, run)}, drawn_columns(columns, request.pixels))


def tried_law(workspace: Workspace, request: ControlRequest) -> Plain:
    """Run a controller as requested, and return its largest error (m).

    Raises
    ------
    PneudriveError
        As for `ControlRequest.run`.
    """
    try:
        _, run = request.run(workspace, RunLimit())
    except Cancelled:
        raise CommandError(f"{request.law} took longer than {MOST_SECONDS:g} s", remedy="Use Compare.") from None
    return {"value": run.provenance["score"]["max_error_m"]}


def _error_unit(errors_m: list[Any]) -> Plain:
    unit = error_unit(errors_m)
    return {"unit": unit, "size": {"um": 1e-6, "mm": 1e-3}[unit]}


def _about(prepared: Prepared, run: Run) -> Plain:
    """Return the results of a run, the gains with the ranges of their sliders, and the assumed drive."""
    tuning, about = prepared.tuning, run.provenance
    score, view = about["score"], view_of_score(about)
    gains = []
    for gain in tuning.gains:
        size, _, unit = str(gain.quantity).partition(" ")
        low, high = sorted((gain.value / SLIDER, gain.value * SLIDER)) if gain.value else (0.0, 1.0)
        scale = float(size) / gain.value if gain.value else 1.0
        slider = {"key": gain.key, "number": float(size), "unit": unit, "low": scale * low, "high": scale * high}
        gains.append(slider | {"meaning": gain.meaning, "rule": "given" if gain.given else gain.rule})
    true = [(name, f"{value:.4g}") for name, value in about["deviations"].items()]
    deviations = (ShownTable(TRUE, ("deviation", "value"), true),) if true else ()
    told = f"{tuning.law} for {tuning.belief.name}, every {1e3 * tuning.period_s:.3g} ms"
    setup = f"Setup {prepared.setup_name}. {prepared.setup.about}"
    values = f"{len(about['assumed'])} values are assumed: the page Drive lists those of the drive."
    return {
        "law": tuning.law,
        "drive": prepared.circuit.name,
        "gains": gains,
        "max_error_m": score["max_error_m"],
        "view": replace(view, tables=(*deviations, *view.tables)).data(),
        "told": _assumed(f"Assumed drive: {told}", assumptions({tuning.law: tuning}), (setup, values)),
        "lost": score["lost"],
    }


def _assumed(
    title: str,
    about: Keyed,
    notes: tuple[str, ...] = (),
    tables: Iterable[ShownTable] = (),
) -> Plain:
    """Return the data of a view: the drive that the controllers assume, their gains and their limits."""
    topic = Topic("control", "told")
    shown = topic.table(gain_rows(about["laws"]), "gains"), topic.table(about["plant"], "plant")
    limits = (f"{name}: {limit}" for name, law in about["laws"].items() for limit in law["limits"])
    return View(title, notes=(*notes, *limits), tables=(*tables, *shown)).data()


def choices(workspace: Workspace, path: str) -> Plain:
    """Return the options for a drive: controllers, instrumentation, mismatches and standard references.

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
        "references": [{"name": name, "text": one.text, "usable": not one.pieces} for name, one in usual.items()],
    }


def _names(given: object, info: ValidationInfo) -> list[str]:
    """Return names as a list. A name must not contain a comma, because commas separate names in commands."""
    each = [given] if isinstance(given, str) else given
    if not isinstance(each, list) or not each or not all(isinstance(name, str) and name.strip() for name in each):
        raise CommandError(f"{info.field_name} are missing", remedy="Choose at least one.")
    for name in each:
        if "," in name:
            raise CommandError.of("web.comma", name=name[:80], of=info.field_name)
    return [name.strip() for name in each]


Names = Annotated[list[str], BeforeValidator(_names)]


class BenchmarkRequest(PageRequest):
    """Request for a benchmark, sent by the page or read from the folder of a benchmark that is to be repeated."""

    drive: StrictStr = ""
    laws: Names = Field(default_factory=list, validate_default=True)
    references: Names = Field(default_factory=list, validate_default=True)
    setup: StrictStr = "real"
    mismatch: StrictStr | None = None
    spread: StrictStr | None = None
    count: Annotated[StrictInt, bounded(1, MOST_MEMBERS)] = 1

    def job(self, workspace: Workspace, out: str, *, is_new: bool = False) -> JobRequest:
        """Return the job that makes the folder of a benchmark, or continues in it.

        Raises
        ------
        PneudriveError
            A name refers to a file outside the workspace, or is not known.
        """
        drive = described_at(workspace, self.drive)
        for law in self.laws:
            if law != "all":
                _checked_law(workspace, law)
        for track in self.references:
            _reference(workspace, track)
        kinds = self.model_dump(include={"setup", "mismatch", "spread"})
        for kind, name in kinds.items():
            if name:
                _ready(workspace, name, kind)
        counted = {"members" if self.spread else "seeds": self.count}
        command = words("control benchmark", self.drive, laws=",".join(map(safe, self.laws)))
        command += [f"--references={','.join(self.references)}"]
        command += words("", **{kind: safe(name or "") for kind, name in kinds.items()}, **counted, out=safe(out))
        lists = [repr(each[0] if each in (["all"], ["standard"]) else each) for each in (self.laws, self.references)]
        card = call("pn.control.benchmark", "drive", *lists, **kinds, **counted, out=out)
        lines = python("benchmark", type=type(drive).__name__, path=self.drive, card=card)
        return JobRequest(command, out, is_new=is_new, python=lines)


def requested_comparison(
    workspace: Workspace, given: Plain, resume: str | None = None, name: object = None
) -> JobRequest:
    """Return the job that runs a benchmark into a new folder, or continues the benchmark of a folder.

    Raises
    ------
    PneudriveError
        An input is missing, not valid or outside the workspace, or the folder does not match the request.
    """
    if resume is not None:
        asked = read_comparison(workspace.folder(resume)).about.get("asked")
        if not asked:
            raise CommandError(f"{resume} does not record the command that started it", remedy="Repeat that command.")
        return BenchmarkRequest.of(asked).job(workspace, resume)
    return BenchmarkRequest.of(given).job(workspace, f"{RESULTS}/{folder_name(name)}", is_new=True)


def shown_card(workspace: Workspace, path: str, measure: str = "") -> Plain:
    """Return the score card of a folder: one measure of all runs with its medians, the assumed and the true drive.

    Raises
    ------
    CommandError
        The folder is not a benchmark, or the measure does not exist.
    """
    card, measure = read_comparison(workspace.folder(path)), measure or "max_error_m"
    if measure not in SHOWN:
        raise CommandError(f"{measure[:80]!r} is not a measure", rule=", ".join(SHOWN))
    job = None
    if card.about.get("asked"):
        with suppress(PneudriveError):  # started elsewhere, or without its drive file: the card is shown anyway
            job = BenchmarkRequest.of(card.about["asked"]).job(workspace, path)
    told = card.about["laws"]
    ended = ((run.law, run.reference, run.reason) for run in card.runs if run.score is None)
    failed = dict.fromkeys(f"{law} along {along} ended early: {reason}" for law, along, reason in ended)
    truth = Topic("control", "true").table((name, *ends) for name, ends in card.truth.items())
    return {
        "measure": measure,
        "spread": card.spread,
        "total": card.count * len(card.references) * len(told),
        "finished": card.is_finished,
        "done": len(card.runs),
        "laws": list(told),
        "references": [{"name": track, "text": text} for track, text in card.references.items()],
        "measures": [
            {"name": name, "title": title, "size": 1.0 / factor, "unit": unit}
            for name, (title, factor, unit) in SHOWN.items()
        ],
        "cells": [_cell(card, law, track, measure) for law in told for track in card.references],
        "each": [
            attributes_of(run, "law", "reference", "seed") | {"value": getattr(run.score, measure, None)}
            for run in card.runs[:MOST_EACH]
        ],
        "failed": list(failed)[:MOST_FAILED],
        "told": _assumed("Assumed and true drive", card.about, tables=[truth] if card.truth else []),
        "command": shlex.join(["pneudrive", *job.arguments]) if job else "",
        "python": job.python if job else python("card", path=path),
    }


def _cell(card: ControlComparison, law: str, track: str, measure: str) -> Plain:
    """Return a measure of a controller along a reference: median and extremes, or quantiles of a spread."""
    shares = (0.5, 0.95, 1.0) if card.spread else (0.5, 0.0, 1.0)
    middle, *others = (card.within(law, track, measure, share) for share in shares)
    text = written(measure, middle)
    return {
        "law": law,
        "reference": track,
        "text": text,
        "range": [written(measure, other) for other in others],
        "value": middle,
        "best": card.best(track, measure) == law and text != "never",
        "lost": card.lost(law, track),
    }


def shown_tracks(
    workspace: Workspace,
    path: str,
    reference: str,
    pixels: Annotated[int, bounded(1, MOST_PIXELS, f"1 to {MOST_PIXELS} pixels")] = 1000,
) -> bytes:
    """Return the tracks of all controllers and their errors as a frame, from the first run of each controller.

    Raises
    ------
    CommandError
        The folder is not a benchmark, or does not have this reference.
    """
    card = read_comparison(workspace.folder(path))
    if reference not in card.references:
        raise CommandError(f"{reference[:80]!r} is not a reference of {path}", rule=", ".join(card.references))
    tracks, arrays = {run.law: track for run, track in tracks_of(card, reference)}, Plain()
    for law, track in tracks.items():
        arrays |= {f"{law}/{key}": values for key, values in drawn_columns(track, pixels).items()}
    errors = [track["error_m"] for track in tracks.values()]
    return pack({"laws": list(tracks), "error": _error_unit(errors)}, arrays)
