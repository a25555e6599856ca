"""Lineage of each result of the workspace from the hashes in the result, and whether its inputs have changed.

A result names its inputs with their hashes. A run, a fit of a drive and a validation name the description. A fit of a
friction map names the values of the map, and an applied drive its fit. Fits and validations name the samples of their
recordings. A friction map names the files of its recordings with hashes (Parquet) or without (CSV).
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import count
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from pneudrive.campaign.storage.folder import ABOUT as CAMPAIGN
from pneudrive.control.results.card import ABOUT as COMPARISON
from pneudrive.describe.drive import Drive
from pneudrive.describe.files import toml
from pneudrive.describe.files.catalogue import entries
from pneudrive.errors import CommandError, FitError, PneudriveError
from pneudrive.files.content import read_json
from pneudrive.files.tables import open_table
from pneudrive.friction.friction_map import HASHES, read_map
from pneudrive.identify.dynamic.result import DriveFit
from pneudrive.identify.files import read_fit
from pneudrive.identify.static.laws import CANDIDATES
from pneudrive.identify.static.observations import fingerprint
from pneudrive.identify.static.result import FrictionFit, SlidingFit, values_of_fit
from pneudrive.identify.volume import VolumeFit
from pneudrive.signals.drive_recording import NEEDED, read_drive_recordings, read_volume_recordings
from pneudrive.signals.layout import stem
from pneudrive.signals.load import hashes_of
from pneudrive.simulation.trajectory import SUFFIXES, columns_in
from pneudrive.web.drive.run_request import described_at, kept
from pneudrive.web.jobs import RESULTS
from pneudrive.web.measured.recordings import by_stem, layout_in
from pneudrive.web.workspace import Listed, Workspace, is_in_catalogue

if TYPE_CHECKING:
    import xarray as xr

    from pneudrive.identify.files import AnyFit

MOST_CHECKED, MOST_TRACED = 300, 3000  # newest files of a kind that are searched: for all results, for one result
MOST_DRIVES = 500  # files that are searched for the requested drive
MOST_INPUTS = 100  # of one result
MOST_BYTES = 200_000_000  # largest recording whose samples are hashed for a page
SAME, CHANGED, DIFFERS, MISSING, NAMED, UNREAD = "same", "changed", "differs", "missing", "named", "unread"


class Input(NamedTuple):
    """An input named by a result: kind, name and hash. Without a hash, only the name identifies the input.

    `part` distinguishes inputs of one kind further. For a fit it has the options, or the value that came from it. For a
    drive with identified values it is ``"identified"``. For a recording it is ``"volume"`` or ``"file"``.
    """

    kind: str
    name: str
    digest: str = ""
    part: str = ""


@dataclass(frozen=True)
class Edge:
    """An input, and its present file in the workspace.

    Attributes
    ----------
    input : Input
    path : str
        Path of the file. Empty if the file is missing.
    state : str
        ``"same"``, ``"changed"`` (the file has other content), ``"differs"`` (the run had other values than the file,
        possibly set for the run), ``"missing"``, ``"named"`` (the result does not contain its hash), ``"unread"`` (too
        long or not readable).
    """

    input: Input
    path: str
    state: str


@dataclass
class Lineage:
    """The files of a workspace in their present state, and their lineage."""

    workspace: Workspace
    most: int
    _edges: dict[str, list[Edge]] = field(default_factory=dict)

    @cached_property
    def files(self) -> dict[str, Listed]:
        """All files by name, the newest first."""
        return {file.path: file for file in sorted(self.workspace.files(), key=lambda file: -file.changed)}

    def _of_kind(self, *kinds: str) -> list[Listed]:
        return [file for file in self.files.values() if file.kind in kinds][: self.most]

    def _of(self, read: Callable[..., Any], path: str) -> Any:  # noqa: ANN401 - content of the file, or its hash
        """Call a kept function of workspace, path and time of the last change with a file."""
        return read(self.workspace, path, self.files[path].changed)

    @cached_property
    def _drives(self) -> tuple[dict[str, str], dict[tuple[str, str], list[str]]]:
        """Files by hash, and by name and `Input.part`: drives, then fits of drives, then the catalogue."""
        by_hash: dict[str, str] = {}
        by_name: dict[tuple[str, str], list[str]] = {}
        for file in [*self._of_kind("drive", "circuit"), *self._of_kind("fit")]:
            digest, name = _described(self.workspace, file.path, file.kind, file.changed)
            if digest:
                by_hash.setdefault(digest, file.path)
            if digest and file.kind != "fit":
                part = "identified" if self._named(file.path) else ""
                by_name.setdefault((name, part), []).append(file.path)
        return {drive.description_hash: path for path, drive in _catalogue().items()} | by_hash, by_name

    @cached_property
    def _circuits(self) -> dict[str, str]:
        """Files of drives by the hash of their circuit, which controllers refer to."""
        known = {drive.circuit.description_hash: path for path, drive in _catalogue().items()}
        return known | {self._of(_circuit_hash, file.path): file.path for file in self._of_kind("drive")}

    @cached_property
    def fits(self) -> dict[str, str]:
        """Files of fits by the hash that identified values carry."""
        return {self._of(hash_at, file.path): file.path for file in reversed(self._of_kind("fit"))}

    @cached_property
    def _recordings(self) -> dict[str, list[str]]:
        return by_stem(self.files.values())

    def edges(self, path: str) -> list[Edge]:
        """Return the inputs of a file, each with its present file."""
        if path not in self._edges:
            named = self._named(path) if path in self.files else ()
            self._edges[path] = [Edge(each, *getattr(self, f"_{each.kind}")(each, path)) for each in named]
        return self._edges[path]

    def _named(self, path: str) -> tuple[Input, ...]:
        return _inputs(self.workspace, path, self.files[path].kind, self.files[path].changed)

    def _drive(self, each: Input, of: str) -> tuple[str, str]:
        by_hash, by_name = self._drives
        path = by_hash.get(each.digest, "") or self._circuits.get(each.digest, "")
        if path and path != of:
            return path, SAME
        alike = [other for other in by_name.get((each.name, each.part), []) if other != of]
        if len(alike) != 1:
            return "", MISSING
        return alike[0], DIFFERS if self.files[of].kind == "recording" else CHANGED

    def _fit(self, each: Input, _of: str) -> tuple[str, str]:
        if each.digest in self.fits:
            return self.fits[each.digest], SAME
        for file in self._of_kind("fit"):
            fit = self._of(_fit_at, file.path)
            if fit is not None and each.part in fit.values and set(each.name.split(", ")) <= set(fit.recordings):
                return file.path, CHANGED
        return "", MISSING

    def _map(self, each: Input, of: str) -> tuple[str, str]:
        def is_beside(path: str) -> bool:
            return path.rpartition("/")[0] == of.rpartition("/")[0]

        maps = [file.path for file in self._of_kind("friction map")]
        maps.sort(key=lambda path: (not is_beside(path), not path.endswith(".parquet")))
        known, beside = json.loads(each.part), ""
        for path in maps:
            with suppress(FitError):
                table = self._of(map_at, path)
                values = None if table is None else values_of_fit(table, known)
                if values is not None and fingerprint(values) == each.digest:
                    return path, SAME
                beside = beside or (path if values is not None and is_beside(path) else "")
        return beside, CHANGED if beside else MISSING

    def _recording(self, each: Input, _of: str) -> tuple[str, str]:
        """Return the file of a recording: by name, and among several also by hash; None without one."""
        own, alike = each.name in self.files, self._recordings.get(stem(Path(each.name)), [])
        paths = list(dict.fromkeys([each.name, *alike])) if own else alike
        path = paths[0] if own or len(paths) == 1 else ""
        if not paths or not each.digest:
            return path, NAMED if paths else MISSING
        states = {other: self._state(each, other) for other in paths}
        path = next((other for other, state in states.items() if state == SAME), "") or path
        return path, states[path] if path else UNREAD if UNREAD in states.values() else CHANGED

    def _state(self, each: Input, path: str) -> str:
        if self.files[path].size > MOST_BYTES:
            return UNREAD
        digests = _digests(self.workspace, path, each.part, self.files[path].changed)
        return SAME if each.digest in digests else CHANGED if digests else UNREAD

    def drive_of(self, digest: str) -> tuple[str, Drive | None]:
        """Return the file whose drive has this hash, and the drive, or "" if it no longer exists."""
        path = self._drives[0].get(digest, "")
        return path, self._of(drive_at, path) if path in self.files else _catalogue().get(path)

    def file_of(self, each: Input) -> str:
        """Return the file of a recording by its name, or by its hash among several of that name, or None."""
        alike = [each.name] if each.name in self.files else self._recordings.get(stem(Path(each.name)), [])
        return alike[0] if len(alike) == 1 else self._recording(each, "")[0]

    def _rig(self, each: Input, _of: str) -> tuple[str, str]:
        paths = sorted(path for path in self.files if Path(path).name == Path(each.name).name)
        for path in paths:
            if hashlib.sha256(self.workspace.path(path).read_bytes()).hexdigest() == each.digest:
                return path, SAME
        own = paths if len(paths) == 1 else [path for path in paths if path == each.name]
        return (own[0] if own else ""), CHANGED if paths else MISSING

    def why_stale(self, path: str, seen: tuple[str, ...] = ()) -> list[str]:
        """Return the names of changed inputs, of the result or of its inputs."""
        names: list[str] = []
        for edge in self.edges(path):
            if edge.state == CHANGED:
                names.append(edge.path or edge.input.name)
            elif edge.path not in ("", *seen):
                names += self.why_stale(edge.path, (*seen, path))
        return list(dict.fromkeys(names))

    def tree(self, path: str, seen: tuple[str, ...] = ()) -> list[dict[str, Any]]:
        """Return the inputs of a file, and their inputs, as plain tables."""
        return [
            {
                "kind": edge.input.kind,
                "name": stem(Path(edge.input.name)) if edge.input.kind == "recording" else edge.input.name,
                "digest": edge.input.digest[:12],
                "path": edge.path,
                "state": edge.state,
                "inputs": [] if edge.path in ("", *seen) else self.tree(edge.path, (*seen, path)),
            }
            for edge in self.edges(path)
        ]

    @cached_property
    def results(self) -> list[str]:
        """Return all files that can have inputs, the newest first, with recordings in Parquet only."""
        runs = (file for file in self.files.values() if file.kind != "recording" or file.path.endswith(".parquet"))
        return [file.path for file in runs if file.kind in INPUTS]

    def again(self, path: str) -> dict[str, Any] | None:
        """Return the request that makes a result again from the present inputs, or None if this is not possible."""
        kind, edges = self.files[path].kind, self.edges(path)
        recordings = [edge.path for edge in edges if edge.input.kind == "recording"]
        others = [edge.path for edge in edges if edge.input.kind != "recording"]
        drive = next((edge.path for edge in edges if edge.input.kind == "drive"), "")
        if not all([*recordings, *others]):
            return None
        folder, base = Path(path).parent, path.removesuffix(".toml")
        given: dict[str, Any] = {"drive": drive} if drive else {}
        given |= {"recordings": recordings} if recordings else {}
        if recordings and (kind == "friction map" or (kind == "validation" and drive)):
            name = self._new(f"{RESULTS}/{folder.name or Path(path).stem}")
            return {"kind": "validate" if kind == "validation" else "characterise", **given, "name": name}
        out = (folder / f"{self._new(base, '.toml')}.toml").as_posix()
        if kind == "drive" and len(set(others)) == 1:
            start = next((edge.path for edge in self.edges(others[0]) if edge.input.kind == "drive"), "")
            return {"kind": "apply", "fit": others[0], "drive": start, "out": out} if start else None
        fit = self._of(_fit_at, path) if kind == "fit" else None
        if isinstance(fit, DriveFit) and drive and recordings:
            free = ", ".join(name for name in fit.values if name in fit.free)
            return {"kind": "identify", **given, "free": free, "out": out}
        if isinstance(fit, FrictionFit) and (law := _law(fit)):
            form = fit.model.pressure if fit.provenance["pressure_dependence"] else "none"
            return {"kind": "fit", "map": others[0], "law": law, "pressure": form, "name": self._new(base, ".toml")}
        return None

    def _new(self, path: str, suffix: str = "") -> str:
        """Return an unused name that is similar to that of a path, without folder and suffix."""
        places = ((number, self.workspace.folder(f"{path}-{number}{suffix}")) for number in count(2))
        return f"{Path(path).name}-{next(number for number, place in places if not place.exists())}"


@lru_cache(maxsize=1)
def _catalogue() -> dict[str, Drive]:
    return {name: Drive.load(name) for name in (f"catalogue:{one.name}" for one in entries().values() if one.is_drive)}


@kept(2 * MOST_TRACED)
def _circuit_hash(workspace: Workspace, path: str, changed: float) -> str:
    drive = drive_at(workspace, path, changed)
    return "" if drive is None else drive.circuit.description_hash


@kept(2 * MOST_TRACED)
def _described(workspace: Workspace, path: str, kind: str, changed: float) -> tuple[str, str]:
    """Return hash and name of the description in a file. Empty without a description."""
    try:
        found = described_at(workspace, path) if kind == "circuit" else drive_at(workspace, path, changed)
    except PneudriveError:
        found = None
    return ("", "") if found is None else (found.description_hash, found.name)


def is_fit(path: Path) -> bool:
    """Return whether a file is the fit of a drive."""
    tables, _ = toml.read(path)
    return tables.get("kind") == DriveFit.KIND and "values" in tables


@kept(MOST_DRIVES)
def drive_at(workspace: Workspace, name: str, changed: float) -> Drive | None:
    """Return the drive of a file, or of a fit. None for another file, or one that is not valid."""
    fit = _fit_at(workspace, name, changed)
    with suppress(PneudriveError):
        if fit is not None:
            return fit.apply() if isinstance(fit, DriveFit) and fit.converged else None
        found = described_at(workspace, name)
        return found if isinstance(found, Drive) else None
    return None


@lru_cache(maxsize=2 * MOST_TRACED)
def hash_at(workspace: Workspace, path: str, changed: float) -> str:
    """Return the hash of a fit in the form that identified values carry. Empty for another file."""
    fit = _fit_at(workspace, path, changed)
    with suppress(PneudriveError):
        return "" if fit is None else fit.identified_as({}).fit
    return ""


@lru_cache(maxsize=2 * MOST_TRACED)
def _fit_at(workspace: Workspace, path: str, _changed: float) -> AnyFit | None:
    with suppress(PneudriveError):
        return read_fit(workspace.path(path))
    return None


@lru_cache(maxsize=64)
def map_at(workspace: Workspace, path: str, _changed: float) -> xr.Dataset | None:
    """Return a friction map, or None for another file."""
    with suppress(PneudriveError):
        return read_map(workspace.path(path))
    return None


def _law(fit: FrictionFit) -> str:
    """Return the law that repeats this fit. Empty if some options cannot be expressed, or if the law was reduced."""
    plain = fit.provenance["direction"] == "both" and fit.provenance["robust"] and not fit.provenance["exclude_flags"]
    own = (fit.law, fit.model.exponent, fit.model.lorentzian)
    named = ((name, (one.law, one.exponent, one.lorentzian)) for name, one in CANDIDATES.items())
    return next((name for name, law in named if law == own and plain and fit.model.law == fit.law), "")


@lru_cache(maxsize=2 * MOST_TRACED)
def _inputs(workspace: Workspace, path: str, kind: str, _changed: float) -> tuple[Input, ...]:
    """Return the inputs that a file names."""
    try:
        return tuple(dict.fromkeys(INPUTS[kind](workspace, path)))[:MOST_INPUTS] if kind in INPUTS else ()
    except (PneudriveError, KeyError, TypeError, ValueError, AttributeError):
        return ()  # a file that is not a result has no inputs


def _of_fit(workspace: Workspace, path: str) -> Iterator[Input]:
    fit = read_fit(workspace.path(path))
    about = fit.provenance
    if isinstance(fit, SlidingFit):
        names = ("direction", "ambient_pressure_pa", "exclude_flags", "recordings")
        part = json.dumps({name: about.get(name, []) for name in names})
        yield Input("map", "friction map", about["map_sha256"], part)
        return
    if "description_hash" in about:
        part = "identified" if isinstance(fit, DriveFit) and fit.start.provenance else ""
        yield Input("drive", about["drive"], about["description_hash"], part)
    part = "volume" if isinstance(fit, VolumeFit) else ""
    for one in about["recordings"]:
        known = (one["file"] or one["name"], one["sha256"], part) if isinstance(one, dict) else (str(one),)
        yield Input("recording", *known)


def _of_drive(workspace: Workspace, path: str) -> Iterator[Input]:
    drive = drive_at(workspace, path, workspace.path(path).stat().st_mtime)  # in the order of the list
    for key, one in drive.provenance.items() if drive is not None else ():
        if one.fit:
            yield Input("fit", one.source, one.fit, key)


def _of_validation(workspace: Workspace, path: str) -> Iterator[Input]:
    content, _ = toml.read(workspace.path(path), CommandError)
    about = content["provenance"]
    yield Input("drive", about["drive"], about["description_hash"], "identified" if "identified" in about else "")
    for one in content["record"]:
        yield Input("recording", one["source"] or one["name"], one["sha256"])


def _of_map(workspace: Workspace, path: str) -> Iterator[Input]:
    found = read_map(workspace.path(path))
    hashes = json.loads(found.attrs.get(HASHES, "{}"))
    for name in dict.fromkeys(found["recording"].to_numpy().tolist()):
        yield Input("recording", name, hashes[name], "file") if name in hashes else Input("recording", name)


def _of_run(workspace: Workspace, path: str) -> Iterator[Input]:
    place = workspace.path(path)
    if place.suffix == ".parquet" and columns_in(place, NEEDED):
        about = json.loads(open_table(place, "parquet").metadata.get("pneudrive", "{}"))
        if "validation of" in about:
            yield Input("drive", "", about["validation of"])
            yield Input("recording", about["recording"], about["sha256"])
        elif "description_hash" in about:
            # The true drive of a controller may deviate from the assumed one.
            digest = about.get("belief_hash") or about["description_hash"]
            yield Input("drive", about.get("title", ""), digest, "identified" if "identified" in about else "")


def _of_comparison(workspace: Workspace, path: str) -> Iterator[Input]:
    for one in read_json(workspace.folder(path) / COMPARISON, CommandError)["laws"].values():
        yield Input("drive", one["believes"], one["belief_hash"])


def _of_campaign(workspace: Workspace, path: str) -> Iterator[Input]:
    about = read_json(workspace.folder(path) / CAMPAIGN, CommandError)
    if str(about["rig"]).endswith(".toml") and about["rig_sha256"]:
        yield Input("rig", about["rig"], about["rig_sha256"])


#: Kind of a file -> function that yields the inputs that it names.
INPUTS: dict[str, Callable[[Workspace, str], Iterator[Input]]] = {
    "drive": _of_drive,
    "fit": _of_fit,
    "validation": _of_validation,
    "friction map": _of_map,
    "recording": _of_run,
    "comparison": _of_comparison,
    "campaign": _of_campaign,
}


def recordings_of_map(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the files of a friction map's recordings by their names, if they are known."""
    found = Lineage(workspace, MOST_TRACED)
    files = {one.name: found.file_of(one) for one in _of_map(workspace, path)}
    return {name: file for name, file in files.items() if file}


@lru_cache(maxsize=2 * MOST_TRACED)
def _digests(workspace: Workspace, path: str, part: str, _changed: float) -> frozenset[str]:
    """Return the hashes that a result may have of a recording. Empty if the recording cannot be read.

    Friction maps carry the hash of the file, fits and validations that of its samples.
    """
    place = workspace.path(path)
    with suppress(PneudriveError):
        if part == "file":
            return hashes_of(place)
        own = place.suffix in SUFFIXES and len(columns_in(place, NEEDED)) == len(NEEDED)
        layout = None if own else layout_in(workspace, place)
        if layout is not None or own:
            if part == "volume":
                return frozenset([read_volume_recordings(place, layout)[0].sha256])
            return frozenset([read_drive_recordings(place, layout, needed=NEEDED[:2], gaps=True)[0].sha256])
    return frozenset()


def shown_lineage(workspace: Workspace, path: str) -> dict[str, Any]:
    """Return the inputs of a file, the files made from it, and the request that makes it again.

    Raises
    ------
    CommandError
        The file does not exist.
    """
    found = Lineage(workspace, MOST_TRACED)
    if path not in found.files and not is_in_catalogue(path):
        raise CommandError(f"there is no {path[:200]} in the folder", remedy="Read the folder again.")
    made = [result for result in found.results[:MOST_TRACED] if any(edge.path == path for edge in found.edges(result))]
    again = found.again(path) if path in found.files else None
    return {"path": path, "inputs": found.tree(path), "made": made, "again": again, "stale": found.why_stale(path)}


def stale_results(workspace: Workspace) -> dict[str, Any]:
    """Return the results whose inputs have changed, with their names, and the number of unchecked results."""
    found = Lineage(workspace, MOST_CHECKED)
    stale = {path: why for path in found.results[:MOST_CHECKED] if (why := found.why_stale(path))}
    return {"stale": stale, "unchecked": max(len(found.results) - MOST_CHECKED, 0)}
