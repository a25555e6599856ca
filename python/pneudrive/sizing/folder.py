"""Folder of a sizing with a line for each finished choice, so that an interrupted search can be resumed."""

from __future__ import annotations

import hashlib
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pneudrive import __version__
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import CommandError
from pneudrive.files.content import read_text
from pneudrive.files.writing import NO_FOLLOW, make_result_folder, open_to_append, take
from pneudrive.simulation.trajectory import write_whole
from pneudrive.sizing.checks import SizedDrive
from pneudrive.sizing.strokes import Setting
from pneudrive.sizing.tune import Tuned

if TYPE_CHECKING:
    from types import TracebackType

    from pneudrive.arrays import Plain
    from pneudrive.sizing.task import SizingTask

ABOUT, LINES, LOCK, PROVISIONAL = "sizing.json", "choices.jsonl", "sizing.lock", "provisional.txt"


#: Version of the ranking rules. From 2 on, every choice has a limit of the energy; from 3 on, open checks count.
RULES = 3


class SizingFolder:
    """Finished choices of one task, in a folder that is locked until the search ends: ``with SizingFolder(...)``.

    Parameters
    ----------
    folder : Path
        Made if it does not exist.
    task : SizingTask
    draws : tuple of int

    Raises
    ------
    CommandError
        The folder holds another task or other files, cannot be written to, or is used by another process.
    """

    def __init__(self, folder: Path, task: SizingTask, draws: tuple[int, int]) -> None:
        self.folder = folder
        self._stages: dict[tuple[str, int], tuple[str, Any]] = {}
        self._file: int | None = None
        said = {
            "version": __version__,
            "task": task.to_dict(),
            "draws": draws,
            "catalogue": _catalogue(),
            "rules": RULES,
        }
        about = json.loads(json.dumps(said))
        path = folder / ABOUT
        if path.exists():
            self._lock()
            self._resume(path, about)
        elif folder.is_dir() and any(one.name != LOCK for one in folder.iterdir()):
            raise CommandError(f"{folder} is not empty and holds no sizing", remedy="Choose a new folder.")
        else:
            make_result_folder(folder)
            self._lock()
            write_whole(path, json.dumps(about, indent=1))

    def _lock(self) -> None:
        """Lock the folder; continue without a lock if the file system has no locks."""
        with suppress(OSError):
            self._file = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC | NO_FOLLOW, 0o666)
            if take(self._file):
                return
            self.release()
            raise CommandError.of("sizing.locked", folder=self.folder)

    def release(self) -> None:
        """Release the folder for other processes."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def __enter__(self) -> SizingFolder:
        return self

    def __exit__(self, kind: type | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.release()

    def _resume(self, path: Path, about: Plain) -> None:
        try:
            begun = json.loads(path.read_text("utf-8"))
        except (OSError, ValueError) as error:
            raise CommandError(f"{path} cannot be read: {error}") from None
        differ = [key for key in about if begun.get(key) != about[key]]
        if differ:
            told = {"folder": self.folder, "differ": ", ".join(differ)}
            raise CommandError.of("sizing.other_task", where=str(path), **told)
        self._stages = read_stages(self.folder / LINES)
        if self._stages:
            write_whole(self.folder / LINES, "".join(f"{line}\n" for line, _ in self._stages.values()))

    def stored(self, name: str, draws: int = 0) -> Any:  # noqa: ANN401 - SizedDrive, or Tuned for 0 draws
        """Return the stored drive of a choice for a number of samples, or its tuned settings; None if not stored."""
        return self._stages.get((name, draws), ("", None))[1]

    def store(self, name: str, stage: SizedDrive | Tuned) -> None:
        """Store a simulated drive, or the tuned settings of a choice."""
        line = stage.to_dict() if isinstance(stage, SizedDrive) else {"name": name, **stage._asdict()}
        try:
            with open_to_append(self.folder / LINES) as file:
                file.write(json.dumps(line) + "\n")
        except OSError as error:
            raise CommandError(f"{self.folder / LINES} cannot be written: {error.strerror}") from None

    def tell(self, sentence: str) -> None:
        """Write the provisional answer."""
        write_whole(self.folder / PROVISIONAL, sentence + "\n")


def read_stages(path: Path) -> dict[tuple[str, int], tuple[str, Any]]:
    """Return the finished stages of choices: name and number of samples -> line, and drive (`Tuned` for 0 samples).

    An incomplete line is left out: the search was killed while writing it, or is still writing it.
    """
    stages: dict[tuple[str, int], tuple[str, Any]] = {}
    for line in read_text(path, CommandError).splitlines() if path.is_file() else ():
        with suppress(ValueError, KeyError, TypeError):
            content: Plain = json.loads(line)
            if "short" not in content:
                drive = read_drive(content)
                stages[drive.name, drive.draws] = line, drive
                continue
            known = {key: content[key] for key in ("nominal", "least", "air") if key in content}
            setting, times = Setting(*content["setting"]), tuple(content.get("times", ()))
            name, limit, value = content["short"]
            stages[content["name"], 0] = line, Tuned(setting, short=(name, limit, value), times=times, **known)
    return stages


def read_choices(path: Path) -> tuple[list[SizedDrive], int]:
    """Return the simulated drives, each with its largest number of samples, and the number of failed choices."""
    drives: dict[str, SizedDrive] = {}
    stages = read_stages(path)
    for (name, draws), (_, drive) in stages.items():
        if draws and (name not in drives or draws >= drives[name].draws):
            drives[name] = drive
    return list(drives.values()), sum(not draws and stage.nominal < 0.0 for (_, draws), (_, stage) in stages.items())


def read_drive(content: Plain) -> SizedDrive:
    """Return a simulated drive from plain data. Data of earlier versions have no intervals."""
    read: Plain = content | {"sizes": tuple(content["sizes"])}
    for name in ("worst", "intervals"):
        read[name] = {key: tuple(values) for key, values in content.get(name, {}).items()}
    return SizedDrive(**read)


def _catalogue() -> str:
    """Return the SHA-256 of all parts of the catalogue."""
    said = sorted(f"{one.name} {one.kind} {one.values} {one.printed}" for one in entries().values() if not one.is_drive)
    return hashlib.sha256("\n".join(said).encode()).hexdigest()
