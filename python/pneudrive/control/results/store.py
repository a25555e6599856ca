"""Stored runs of a comparison: a file for each run that is kept, and a line with the score for every other run."""

from __future__ import annotations

import hashlib
import json
import re
import threading
import uuid
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive.control.loop import Prepared, run_prepared
from pneudrive.control.results.card import ABOUT, KEPT, RUNS, TABLE, ControlledRun
from pneudrive.control.results.measures import Score
from pneudrive.errors import CommandError, RecordingError, SimulationError
from pneudrive.files.content import read_json
from pneudrive.files.tables import open_table
from pneudrive.files.writing import make_subfolder, open_to_append
from pneudrive.own_code import split
from pneudrive.simulation.trajectory import save_columns

if TYPE_CHECKING:
    from collections.abc import Mapping

    from pneudrive.control.tuned import Tuning

STEP_REPEATS = 3  # repeats of each step of kept runs, to measure its undisturbed time


@lru_cache(maxsize=1)
def core_hash() -> str:
    """Return the SHA-256 of the core in use: another core may give other bits."""
    from pneudrive import _core

    return hashlib.sha256(Path(_core.__file__).read_bytes()).hexdigest()


def mark_of(out: Path, tunings: Mapping[str, Tuning]) -> str:
    """Return the mark of the runs of custom laws: new once a comparison is finished, or if their code changed.

    The inputs of such code cannot be hashed.
    """
    own = [split(tuning.own.name) for tuning in tunings.values() if tuning.own is not None]
    if not own:
        return ""
    about, folders = out / ABOUT, [Path(code[0]).parent for code in own if code is not None]
    with suppress(CommandError, OSError, LookupError, TypeError):  # there is no comparison, or it is damaged
        began = about.stat().st_mtime
        changed = any(path.stat().st_mtime > began for folder in folders for path in folder.glob("*.py"))
        if not changed and not (out / TABLE).exists():
            return str(read_json(about, CommandError)["mark"]) or uuid.uuid4().hex
    return uuid.uuid4().hex


def key_of(prepared: Prepared, seed: int, mark: str) -> str:
    """Return the SHA-256 of all inputs that determine a run and its score."""
    decides = {
        "core": core_hash(),
        "measures": list(Score.__dataclass_fields__),
        "drive": prepared.truth.core_json,
        "controller": prepared.tuning.core(),
        "motion": prepared.reference.core(),
        "setup": prepared.truth.setup.core(seed, prepared.circuit.ambient.pressure_pa),
        "start": prepared.start | prepared.truth.start,
        "duration_s": prepared.duration_s,
        "rtol": prepared.rtol,
    }
    if prepared.tuning.own is not None:
        own = prepared.tuning.own
        decides["code"] = [own.digest, (split(own.name) or ("", own.name))[1], mark]  # a file may hold several laws
    return hashlib.sha256(json.dumps(decides, sort_keys=True).encode()).hexdigest()


@dataclass
class Store:
    """Runs of a comparison: a file for each run that is kept, and a line with the score for every other run."""

    folder: Path
    lines: Path
    keeps: bool
    known: dict[str, dict[str, Any]]
    lock: threading.Lock
    mark: str

    @classmethod
    def of(cls, out: Path, *, keeps: bool, mark: str) -> Store:
        """Open the store of a folder, with the scores that it already has."""
        folder, lines = out / RUNS, out / KEPT
        make_subfolder(folder)
        try:
            text = lines.read_bytes() if lines.exists() else b""
        except OSError as error:
            remedy = "Name another folder as out."
            raise CommandError(f"{lines} cannot be read", value=error.strerror, remedy=remedy) from None
        known: dict[str, dict[str, Any]] = {}
        for line in text.splitlines():
            with suppress(ValueError, LookupError, TypeError):  # a line that is damaged or was cut by a kill
                one = json.loads(line.decode("utf-8"))
                score = None if one["score"] is None else Score(**one["score"])
                known[one["key"]] = {"score": score, "reason": str(one["reason"])}
        if text and not text.endswith(b"\n"):
            with open_to_append(lines) as file:
                file.write("\n")
        return cls(folder, lines, keeps, known, threading.Lock(), mark)

    def run(self, prepared: Prepared, law: str, along: str, seed: int) -> ControlledRun:
        """Return a stored run, or run it and store it."""
        key = key_of(prepared, seed, self.mark)
        plain = re.sub(r"[^A-Za-z0-9]+", "-", f"{law}_{along}").strip("-")[:60]
        file = self.folder / f"{plain}_{seed}_{key[:12]}.parquet"
        truth = prepared.truth.values
        is_kept = self.keeps or seed == 1
        said = self.known.get(key)
        if said is not None and said["score"] is None:
            return ControlledRun(law, along, seed, None, said["reason"], file, truth)
        score = _score_in(file, key) if is_kept else None if said is None else said["score"]
        if score is not None:
            return ControlledRun(law, along, seed, score, "", file, truth)
        try:
            run = run_prepared(prepared._replace(step_repeats=STEP_REPEATS if is_kept else 1), seed)
        except SimulationError as error:
            self._note(key, None, error.what)
            return ControlledRun(law, along, seed, None, error.what, file, truth)
        score = Score(**run.provenance["score"])
        if is_kept:
            save_columns(run.columns, run.provenance | {"key": key}, file)
        else:
            self._note(key, score, "")
        return ControlledRun(law, along, seed, score, "", file, truth)

    def _note(self, key: str, score: Score | None, reason: str) -> None:
        line = json.dumps({"key": key, "score": None if score is None else score.to_dict(), "reason": reason})
        with self.lock, open_to_append(self.lines) as file:
            file.write(f"{line}\n")


def _score_in(file: Path, key: str) -> Score | None:
    """Return the score of a finished run; None if the file is missing, damaged, or belongs to another run."""
    if not file.exists():
        return None
    try:
        table = open_table(file, "parquet")
    except RecordingError:
        return None
    said = json.loads(table.metadata.get("pneudrive", "{}"))
    if not table.is_sealed or said.get("key") != key:
        return None
    return Score(**said["score"])
