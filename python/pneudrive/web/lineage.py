"""Lineage of each result of the workspace: its stored list of inputs, and whether these have changed."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Collection
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import count
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any

from pydantic import TypeAdapter

from pneudrive.arrays import Plain, attributes_of
from pneudrive.campaign.storage.folder import ABOUT as CAMPAIGN
from pneudrive.control.benchmarks import ABOUT as COMPARISON
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.content import read_json
from pneudrive.files.inputs import INPUTS
from pneudrive.files.tables import open_table
from pneudrive.friction.friction_map import read_map
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.model import CANDIDATES, NOT_SLIDING, FrictionModel, fingerprint
from pneudrive.identify.static.result import FrictionFit, values_of_fit
from pneudrive.signals.drive_recording import NEEDED, read_drive_recordings, read_volume_recordings
from pneudrive.signals.layout import stem
from pneudrive.signals.load import hashes_of
from pneudrive.simulation.trajectory import columns_in
from pneudrive.web.drive.run_request import Described, described_at
from pneudrive.web.jobs import RESULTS
from pneudrive.web.measured.recordings import by_stem, layout_in, needs_none
from pneudrive.web.messages import OF_DAMAGE
from pneudrive.web.workspace import Listed, Workspace, is_in_catalogue

MOST_CHECKED, MOST_TRACED = 300, 3000  # newest files that are read: for all results, for one result
MOST_INPUTS = 100  # of one result
MOST_BYTES = 200_000_000  # largest recording whose samples are hashed for a page
SAME, CHANGED, DIFFERS, MISSING, NAMED, UNREAD = "same", "changed", "differs", "missing", "named", "unread"


@dataclass(frozen=True)
class Edge:
    """An input of a result as the result stores it (see `pneudrive.files.inputs`), and its present file.

    Attributes
    ----------
    kind, name, file, sha256 : str
        Kind, name and file in words, and SHA-256 of the content that determines the result.
    path : str
        Path of the present file in the workspace. Empty if the file is missing.
    state : str
        ``"same"``, ``"changed"`` (the file has other content), ``"differs"`` (the run had other values than the file,
        possibly set for the run), ``"missing"``, ``"named"`` (the result does not contain a hash), ``"unread"`` (too
        large or not readable).
    """

    kind: str
    name: str
    file: str = ""
    sha256: str = ""
    path: str = ""
    state: str = MISSING


_EDGES = TypeAdapter(list[Edge])


class Lineage:
    """The files of a workspace in their present state, and their lineage."""

    def __init__(self, workspace: Workspace) -> None:
        self.workspace, self._edges = workspace, dict[str, list[Edge]]()

    @cached_property
    def files(self) -> dict[str, Listed]:
        """All files by name, the newest first."""
        return {file.path: file for file in sorted(self.workspace.files(), key=lambda file: -file.changed)}

    @cached_property
    def _recordings(self) -> dict[str, list[str]]:
        return by_stem(self.files.values())

    def _read(self, read: Callable[..., Any], path: str, *of: Any) -> Any:  # noqa: ANN401 - content of the file, or its hash
        """Return the result of `read` for a file, cached until the file changes; None for an unreadable file."""
        return _kept(read, self.workspace, path, self.files[path].changed if path in self.files else 0.0, *of)

    def edges(self, path: str) -> list[Edge]:
        """Return the inputs of a file, each with its present file."""
        if path not in self._edges:
            inputs = self._read(_inputs, path, self.files[path].kind) if path in self.files else None
            edges = []
            for one in inputs or ():
                place = self._path(one, path)
                state = NAMED if place else MISSING
                if place and one.sha256:
                    digests = self._digests(one.kind, place, path)
                    changed = DIFFERS if one.kind == "drive" and self.files[path].kind == "recording" else CHANGED
                    state = SAME if one.sha256 in digests else changed if digests else UNREAD
                edges.append(replace(one, path=place, state=state))
            self._edges[path] = edges
        return self._edges[path]

    def _path(self, one: Edge, of: str) -> str:
        """Return the file of an input in the folder of the result or in the workspace. A recording is found by name."""
        if one.kind == "drive" and is_in_catalogue(one.file):
            return one.file
        file, root = Path(one.file), self.workspace.root
        inside = file.relative_to(root).as_posix() if file.is_relative_to(root) else one.file
        folder = of if self.files[of].kind in ("comparison", "campaign") else dirname(of)
        near = (normpath(join(folder, inside)), normpath(inside), join(folder, file.name))
        alike = self._recordings.get(stem(Path(one.name)), []) if one.kind == "recording" else []
        return next((path for path in near if path in self.files), alike[0] if len(alike) == 1 else "")

    def _digests(self, kind: str, path: str, of: str) -> Collection[str]:
        """Return the hashes by which a result may name an input; empty if the file cannot be read."""
        if kind == "friction map":
            fit = self._read(read_fit, of)
            with suppress(PneudriveError, LookupError):
                table = self._read(read_map, path)
                if fit is not None and table is not None:
                    values = values_of_fit(table, fit.provenance)
                    return ["" if values is None else fingerprint(values)]
        elif kind == "drive":
            with suppress(OSError, PneudriveError):
                described = self._described(path)
                return [described.description_hash, described.circuit.description_hash]
        elif kind != "recording" or self.files[path].size <= MOST_BYTES:
            return self._read(_hashes, path, kind, self.workspace) or ()
        return ()

    def _described(self, path: str) -> Described:
        """Return the drive or circuit of a file, or the drive with the values of a fit."""
        return self._read(_identified, path) or described_at(self.workspace, path)

    def drive_of(self, path: str) -> tuple[str, Drive | None]:
        """Return the drive file of a result and its drive; "" and None if the file is missing or has changed."""
        place = next((edge.path for edge in self.edges(path) if edge.kind == "drive" and edge.state == SAME), "")
        described = self._described(place) if place else None
        return place, described if isinstance(described, Drive) else None

    def why_stale(self, path: str, seen: tuple[str, ...] = ()) -> list[str]:
        """Return the names of changed inputs of a result, and of changed inputs of its inputs."""
        names: list[str] = []
        for edge in self.edges(path):
            if edge.state == CHANGED:
                names.append(edge.path or edge.name)
            elif edge.path not in ("", *seen):
                names += self.why_stale(edge.path, (*seen, path))
        return list(dict.fromkeys(names))

    def tree(self, path: str, seen: tuple[str, ...] = ()) -> list[Plain]:
        """Return the inputs of a file, and recursively their inputs, as plain tables."""
        return [
            {
                **attributes_of(edge, "kind", "name", "path", "state"),
                "digest": edge.sha256[:12],
                "inputs": [] if edge.path in ("", *seen) else self.tree(edge.path, (*seen, path)),
            }
            for edge in self.edges(path)
        ]

    @cached_property
    def results(self) -> list[str]:
        """Return all files that can have inputs, the newest first, with recordings in Parquet only."""
        runs = (file for file in self.files.values() if file.kind != "recording" or file.path.endswith(".parquet"))
        return [file.path for file in runs if file.kind in RESULT_KINDS]

    def again(self, path: str) -> Plain | None:
        """Return the request that repeats a result with the present inputs, or None if this is not possible."""
        kind, edges = self.files[path].kind, self.edges(path)
        recordings = [edge.path for edge in edges if edge.kind == "recording"]
        others = [edge.path for edge in edges if edge.kind != "recording"]
        drive = next((edge.path for edge in edges if edge.kind == "drive"), "")
        if not all([*recordings, *others]):
            return None
        folder, base = Path(path).parent, path.removesuffix(".toml")
        request: Plain = {"drive": drive} if drive else {}
        request |= {"recordings": recordings} if recordings else {}
        if recordings and (kind == "friction map" or (kind == "validation" and drive)):
            name = self._new(f"{RESULTS}/{folder.name or Path(path).stem}")
            return {"kind": "validate" if kind == "validation" else "characterise", **request, "name": name}
        out = (folder / f"{self._new(base, '.toml')}.toml").as_posix()
        if kind == "drive" and len(set(others)) == 1:
            start = next((edge.path for edge in self.edges(others[0]) if edge.kind == "drive"), "")
            return {"kind": "apply", "fit": others[0], "drive": start, "out": out} if start else None
        fit = self._read(read_fit, path) if kind == "fit" else None
        if isinstance(fit, DriveFit) and drive and recordings:
            free = ", ".join(name for name in fit.values if name in fit.free)
            return {"kind": "identify", **request, "free": free, "out": out}
        if isinstance(fit, FrictionFit) and (law := _law(fit)):
            form = fit.model.pressure if fit.provenance["pressure_dependence"] else "none"
            return {"kind": "fit", "map": others[0], "law": law, "pressure": form, "name": self._new(base, ".toml")}
        return None

    def _new(self, path: str, suffix: str = "") -> str:
        """Return an unused name, without folder and suffix, similar to the name of a path."""
        places = ((number, self.workspace.folder(f"{path}-{number}{suffix}")) for number in count(2))
        return f"{Path(path).name}-{next(number for number, place in places if not place.exists())}"


def _law(fit: FrictionFit) -> str:
    """Return the value of ``--laws`` that repeats a fit; empty if the command line cannot repeat the fit."""
    plain = fit.provenance["direction"] == "both" and fit.provenance.get("robust", True)
    plain &= fit.provenance["exclude_flags"] in ([], list(NOT_SLIDING))
    plain &= fit.model.law == fit.law
    own = FrictionModel(fit.law, fit.model.exponent, lorentzian=fit.model.lorentzian)
    return next((name for name, law in CANDIDATES.items() if law == own and plain), "")


# --- Contents of files, kept until a file changes.


@lru_cache(maxsize=6 * MOST_TRACED)
def _kept(read: Callable[..., Any], workspace: Workspace, path: str, _changed: float, *of: Any) -> Any:  # noqa: ANN401 - of the function
    with suppress(OSError, PneudriveError):
        return read(workspace.folder(path), *of)
    return None


def _identified(path: Path) -> Drive | None:
    """Return the drive with the values of a fit. None if the search of the fit has not converged."""
    fit = read_fit(path)
    return fit.apply() if isinstance(fit, DriveFit) and isinstance(fit.start, Drive) and fit.converged else None


def _hashes(path: Path, kind: str, workspace: Workspace) -> Collection[str]:
    """Return the hashes by which results identify a file: of its values, its samples, or its bytes.

    Friction maps refer to the file of a recording, and other results to its samples.
    """
    if kind == "fit":
        return [read_fit(path).identified_as({}).fit]
    if kind != "recording":
        return [hashlib.sha256(path.read_bytes()).hexdigest()]
    digests = hashes_of(path)
    with suppress(OSError, PneudriveError):
        layout = layout_in(workspace, path)
        if layout is not None and layout.kind == "fixed-volume":
            return digests | {read_volume_recordings(path, layout)[0].sha256}
        if layout is not None or needs_none(path):
            return digests | {read_drive_recordings(path, layout, needed=NEEDED[:2], gaps=True)[0].sha256}
    return digests


def _inputs(path: Path, kind: str) -> tuple[Edge, ...]:
    """Return the inputs that a file lists; empty for a file that is not a result."""
    try:
        inputs = _EDGES.validate_python(_provenance(path, kind).get(INPUTS, []))
    except (PneudriveError, *OF_DAMAGE):
        return ()
    return tuple(dict.fromkeys(inputs))[:MOST_INPUTS]


#: Kinds of files with a provenance.
RESULT_KINDS = ("drive", "fit", "validation", "friction map", "recording", "comparison", "campaign")


def _provenance(path: Path, kind: str) -> Plain:
    """Return the provenance of a file; empty for a file that is not a result."""
    match kind:
        case "drive":
            origins = toml.read(path, CommandError)[0].get("provenance", {}).values()
            fitted = (one for one in origins if one.get("fit"))
            return {INPUTS: [Edge("fit", one["source"], one.get("file", ""), one["fit"]) for one in fitted]}
        case "fit" | "validation":
            return toml.read(path, CommandError)[0]["provenance"]
        case "friction map":
            table = read_map(path)
            names = dict.fromkeys(table["recording"].to_numpy().tolist())
            return {INPUTS: table.attrs[INPUTS] or [Edge("recording", name) for name in names]}
        case "recording" if path.suffix == ".parquet" and columns_in(path, NEEDED):
            return json.loads(open_table(path, "parquet").metadata.get("pneudrive", "{}"))
        case "comparison" | "campaign":
            return read_json(path / (COMPARISON if kind == "comparison" else CAMPAIGN), CommandError)
    return {}


def shown_lineage(workspace: Workspace, path: str) -> Plain:
    """Return the inputs of a file, the files made from it, and the request that repeats it.

    Raises
    ------
    CommandError
        The file does not exist.
    """
    lineage = Lineage(workspace)
    if path not in lineage.files and not is_in_catalogue(path):
        raise CommandError(f"there is no {path[:200]} in the folder", remedy="Read the folder again.")
    results = lineage.results[:MOST_TRACED]
    made = [result for result in results if any(edge.path == path for edge in lineage.edges(result))]
    again = lineage.again(path) if path in lineage.files else None
    return {"path": path, "inputs": lineage.tree(path), "made": made, "again": again, "stale": lineage.why_stale(path)}


def stale_results(workspace: Workspace) -> Plain:
    """Return the results with changed inputs and the names of these inputs, and the number of unchecked results."""
    lineage = Lineage(workspace)
    stale = {path: why for path in lineage.results[:MOST_CHECKED] if (why := lineage.why_stale(path))}
    return {"stale": stale, "unchecked": max(len(lineage.results) - MOST_CHECKED, 0)}
