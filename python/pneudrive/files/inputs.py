"""Inputs of a result, as stored in the provenance of each result file.

An input is a table: ``kind`` and ``name`` in words, ``file``, and ``sha256`` of the relevant content. This content
consists of the values of a description or a map, the samples of a recording, or the bytes of any other file. An edited
comment or label of a description therefore does not change the input.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from pneudrive import __version__

#: Key of the list in a provenance.
INPUTS = "inputs"


def stored_input(
    kind: str,
    name: str,
    file: str | Path | None,
    sha256: str | None,
) -> dict[str, str]:
    """Return an input with the full path of its file. The name of a catalogue drive stays unchanged."""
    path = str(Path(file).resolve()) if file and Path(file).exists() else str(file or "")
    return {"kind": kind, "name": name, "file": path, "sha256": sha256 or ""}


def inputs_of(described: Any, recordings: Iterable[Any] = ()) -> list[dict[str, str]]:  # noqa: ANN401 - drive, circuit or tank
    """Return a list of inputs: a description and its recordings."""
    file, digest = (getattr(described, name, "") for name in ("source_file", "description_hash"))
    read = [stored_input("recording", one.name, one.source, one.sha256) for one in recordings]
    return [stored_input("drive", described.name, file, digest), *read]


def origin(described: Any, read: Iterable[Any] = (), /, **about: Any) -> dict[str, Any]:  # noqa: ANN401 - plain data
    """Return the provenance of a result: version, the entries `about`, and inputs."""
    return {"version": __version__, **about, INPUTS: inputs_of(described, read)}


def stored_beside(provenance: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the provenance for a result file in a folder, with the paths of inputs relative to this folder."""
    if INPUTS not in provenance:
        return dict(provenance)
    return {**provenance, INPUTS: [{**one, "file": path_from(one["file"], folder)} for one in provenance[INPUTS]]}


def path_from(file: str, folder: Path) -> str:
    """Return a full path relative to a folder. A path on another disk drive stays unchanged."""
    start = folder.resolve()
    is_near = Path(file).is_absolute() and Path(file).drive == start.drive
    return Path(os.path.relpath(file, start)).as_posix() if is_near else file


def located(provenance: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Return the provenance of a result file in a folder, with the full paths of the inputs."""
    inputs = []
    for one in provenance.get(INPUTS, ()):
        path = folder / one["file"]
        inputs.append({**one, "file": str(path.resolve()) if one["file"] and path.exists() else one["file"]})
    return {**provenance, INPUTS: inputs} if inputs else dict(provenance)
