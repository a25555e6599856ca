"""Results of the workspace: views, summary lines, and lineage (the inputs that each result lists)."""

from __future__ import annotations

import difflib
import hashlib
import json
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import chain, count
from pathlib import Path, PurePosixPath
from posixpath import dirname, join, normpath
from typing import Any

import numpy as np
from pydantic import TypeAdapter

from pneudrive import results
from pneudrive.arrays import Plain, attributes_of
from pneudrive.campaign.storage.folder import ABOUT as CAMPAIGN
from pneudrive.campaign.storage.folder import CYCLES
from pneudrive.control.benchmarks import ABOUT as COMPARISON
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.figures import Look, Markers
from pneudrive.files.content import read_json
from pneudrive.files.inputs import INPUTS
from pneudrive.files.tables import open_table
from pneudrive.fmu.package import read_fmu
from pneudrive.friction.friction_map import ALL_RECORDINGS, group_of, groups_of, read_map
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.model import CANDIDATES, NOT_SLIDING, FrictionModel, fingerprint
from pneudrive.identify.static.result import FrictionFit, values_of_fit
from pneudrive.signals.drive_recording import NEEDED, read_drive_recordings, read_volume_recordings
from pneudrive.signals.layout import stem
from pneudrive.signals.load import hashes_of
from pneudrive.simulation.trajectory import columns_in
from pneudrive.sizing.result import SUMMARY, SizingResult
from pneudrive.sizing.task import SizingTask
from pneudrive.views import ShownFigure, State
from pneudrive.web.drive.run_request import Described, described_at
from pneudrive.web.jobs import RESULTS
from pneudrive.web.measured.recordings import layout_in, needs_none
from pneudrive.web.messages import OF_DAMAGE, python, shell
from pneudrive.web.workspace import DESCRIPTIONS, Listed, Workspace, is_in_catalogue

FIT = "fit.toml"  # of a map with one assembly


def load_at(workspace: Workspace, path: str) -> Any:  # noqa: ANN401 - any result
    """Read a file or folder that pneudrive wrote.

    Raises
    ------
    CommandError
        The name refers to a file outside the workspace, or the kind of the file is not known.
    """
    if is_in_catalogue(path):
        return results.load(path)
    place = workspace.folder(path)
    if place.is_dir():
        for inner in place.iterdir():
            workspace.folder(f"{path}/{inner.name}")
    elif path.endswith(DESCRIPTIONS):
        workspace.check_named(path, toml.read(place, CommandError)[0])
    return results.load(place)


def sent_view(workspace: Workspace, path: str) -> Plain:
    """Return the view of a result as data."""
    return results.view_of(load_at(workspace, path)).data()


def _labels(*paths: PurePosixPath) -> tuple[str, str]:
    """Return distinguishable short names of two files: names of seals for fits, otherwise of files or folders."""
    ways = ([path.stem.removeprefix("fit-") for path in paths], [path.parent.name for path in paths])
    whole = str(paths[0]), str(paths[1])
    return next(((a, b) for a, b in ways if a != b), whole)


def _measured(workspace: Workspace, path: str, look: Look, chamber: str) -> Iterator[Markers]:
    """Yield the points of a friction fit over the gauge pressure of a chamber, if its map is unchanged."""
    edge = next(iter(Lineage(workspace).edges(path)), None)
    if edge is None or edge.state != SAME:
        return
    table = read_map(workspace.path(edge.path))
    groups = groups_of(table)
    for group in groups:
        if PurePosixPath(path).name in (fit_file(group.assembly), FIT):
            part = table.isel(row=group.rows)
            friction = part["friction_n"].to_numpy()
            reach = 2.0 * np.hypot(part["stderr_n"].to_numpy(), part["u_systematic_n"].to_numpy())  # U, k = 2
            gauge = np.full(friction.size, group.gauges["ab".index(chamber)])
            yield Markers(gauge, friction, look=look, low=friction - reach, high=friction + reach, filled=True)


def compared(workspace: Workspace, before: str, after: str) -> Plain:
    """Return the differences between two results or descriptions of one kind: a sentence, values, and a figure.

    For drives and circuits, also return the lines of their full texts that differ.

    Raises
    ------
    PneudriveError
        A name refers to a file outside the workspace, a file is not a result, or the files are of different kinds.
    """
    names = (before, after)
    sources = [load_at(workspace, name) for name in names]
    texts = [source.to_toml().splitlines() for source in sources if isinstance(source, Drive | Circuit)]
    lines: list[str] = []
    if len(texts) == 2:
        lines = list(difflib.unified_diff(texts[0], texts[1], before, after, n=1, lineterm=""))
    labels = _labels(*map(PurePosixPath, names))
    found = results.compare_results(sources[0], sources[1], labels)
    figure = found.figure() if found.curves else None
    if figure is not None and isinstance(sources[0], FrictionFit) and found.curves[0].first.x_unit == "Pa":
        chamber = found.curves[0].first.x_quantity[-1]
        marks = [_measured(workspace, *each, chamber) for each in zip(names, results.COMPARED, strict=True)]
        first = figure.panels[0]
        assert first is not None  # the laws of both fits
        first = replace(first, marks=[*first.marks, *chain(*marks)])
        figure = replace(figure, panels=[first, *figure.panels[1:]])
    caption = f"{labels[0]}, {labels[1]} and their difference, with 95 % bands."
    return {
        "names": labels,
        "sentence": found.sentence,
        "values": [pair._asdict() for pair in found.values],
        "figure": figure and ShownFigure("compared", caption, figure),
        "lines": lines,
        "command": shell("compare", *names),
        "python": python("compare", before=before, after=after),
    }


# --- A summary line for each file of the overview: size of a drive, values of a fit, verdict of a check.

MOST_FILES, MOST_VALUES = 200, 3  # newest files with a line; values in a line
VERDICTS: dict[State, str] = {"good": "in order", "open": "open", "bad": "needs you"}


def headlines(workspace: Workspace) -> Plain:
    """Return a summary line for each of the newest files, by name. Files without a summary are left out."""
    out = {}
    for file in sorted(workspace.files(), key=lambda file: -file.changed)[:MOST_FILES]:
        with suppress(PneudriveError, *OF_DAMAGE):  # the view of the file says why
            line = _line(workspace, file.path, file.kind)
            if line is not None:
                out[file.path] = line
    return out


def _line(workspace: Workspace, path: str, kind: str) -> str | None:
    """Return the summary line of a file or folder; None for a kind without a summary."""
    match kind:
        case "drive" | "circuit":
            found = described_at(workspace, path)
            if not isinstance(found, Drive):
                return f"{found.name}: {len(found.components)} components"
            cylinder = found.cylinder
            return f"{found.name}: bore {1e3 * cylinder.bore_m:.4g} mm, stroke {1e3 * cylinder.stroke_m:.4g} mm"
        case "recording":  # seal, mounting and drive, by its layout
            place = workspace.path(path)
            layout = layout_in(workspace, place)
            group = "" if layout is None else group_of(layout.for_file(place, layout.kind).labels)
            return group.removeprefix(ALL_RECORDINGS)
        case "fit" | "friction map" | "validation" | "comparison":
            # The first leading values with their limits, or the headline, and the verdict in one word.
            view = results.view_of(load_at(workspace, path))
            is_judged = view.state != "good" or any(one.limit is not None for one in view.leading)
            word = f": {VERDICTS[view.state]}" if is_judged else ""
            return (", ".join(one.sentence for one in view.leading[:MOST_VALUES]) or view.title) + word
        case "sizing":
            folder = workspace.folder(path)
            is_finished = (folder / SUMMARY).is_file()
            return SizingResult.load(folder).answer.partition(":")[0] if is_finished else "not finished"
        case "task":
            task = SizingTask.load(workspace.path(path))
            return f"{task.name}: {task.mass_kg:.4g} kg, {1e3 * task.stroke_m:.4g} mm in {task.outward_s:.4g} s"
        case "campaign":
            folder = workspace.folder(path)
            about = read_json(folder / CAMPAIGN, PneudriveError)
            count = sum(1 for _ in (folder / CYCLES).glob("*.parquet"))
            return f"{about.get('name') or folder.name}: {count} cycles"
        case "fmu":
            fmu = read_fmu(workspace.path(path))
            return f"{fmu.title}, FMI {fmu.version}"
    return None


# --- Lineage of each result: its stored list of inputs, and whether these have changed.

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
        ``"same"``, ``"changed"`` (the file has other content), ``"differs"`` (values of the run, perhaps set for
        the run, are not those of the file), ``"missing"``, ``"named"`` (the result does not contain a hash),
        ``"unread"`` (too large or not readable).
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
    def recordings(self) -> dict[str, str]:
        """Recordings by name without folder and suffix. Results may use this name if it is unique."""
        found = [(stem(Path(path)), path) for path, file in self.files.items() if file.kind == "recording"]
        counts = Counter(name for name, _ in found)
        return {name: path for name, path in found if counts[name] == 1}

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
        alike = self.recordings.get(stem(Path(one.name)), "") if one.kind == "recording" else ""
        return next((path for path in near if path in self.files), alike)

    def _digests(self, kind: str, path: str, of: str) -> Collection[str]:
        """Return the hashes by which a result may identify an input; empty if the file cannot be read."""
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
        """Return all files that can have inputs, the newest first. A recording needs the format Parquet."""
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

    Friction maps store the hash of a recording's file. Other results store the hash of its samples.
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
