"""Lineage of each result of the workspace from the hashes in the result, and whether its inputs have changed.

A result names its inputs with their hashes. A run, a fit of a drive and a validation name the description. A fit of a
friction map names the values of the map, and an applied drive its fit. Fits and validations name the samples of their
recordings. A friction map names the files of its recordings with hashes (Parquet) or without (CSV).
"""

from __future__ import annotations

import hashlib
import json
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
from pneudrive.web.drive.drives import drive_at, hash_at
from pneudrive.web.drive.run_request import described_at, kept
from pneudrive.web.jobs import RESULTS
from pneudrive.web.measured.recordings import by_stem, layout_in
from pneudrive.web.workspace import is_in_catalogue

if TYPE_CHECKING:
    from collections.abc import Iterator

    import xarray as xr

    from pneudrive.identify.files import AnyFit
    from pneudrive.identify.static.model import Observations
    from pneudrive.web.workspace import Listed, Workspace

MOST_CHECKED, MOST_TRACED = 300, 3000  # newest files of a kind that are searched: for all results, for one result
MOST_INPUTS = 100  # of one result
MOST_BYTES = 200_000_000  # largest recording whose samples are hashed for a page
#: Results that can have inputs.
KINDS = ("drive", "fit", "validation", "friction map", "recording", "comparison", "campaign")
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
        """All files, by name."""
        return {one.path: one for one in self.workspace.files()}

    @cached_property
    def _newest(self) -> list[Listed]:
        return sorted(self.files.values(), key=lambda one: -one.changed)

    def _of_kind(self, *kinds: str) -> list[Listed]:
        return [one for one in self._newest if one.kind in kinds][: self.most]

    @cached_property
    def _drives(self) -> tuple[dict[str, str], dict[tuple[str, str], list[str]]]:
        """Files by hash, and by name and `Input.part`: drives, then fits of drives, then the catalogue."""
        by_hash: dict[str, str] = {}
        by_name: dict[tuple[str, str], list[str]] = {}
        for one in [*self._of_kind("drive", "circuit"), *self._of_kind("fit")]:
            digest, name = _described(self.workspace, one.path, one.kind, one.changed)
            if digest:
                by_hash.setdefault(digest, one.path)
            if digest and one.kind != "fit":
                by_name.setdefault((name, "identified" if self._named(one.path) else ""), []).append(one.path)
        return _catalogue() | by_hash, by_name

    @cached_property
    def _fits(self) -> dict[str, str]:
        return {_hash_at(self.workspace, one.path, one.changed): one.path for one in reversed(self._of_kind("fit"))}

    @cached_property
    def _recordings(self) -> dict[str, list[str]]:
        return by_stem(self._newest)

    def edges(self, path: str) -> list[Edge]:
        """Return the inputs of a file, each with its present file."""
        one = self.files.get(path)
        if one is None or one.kind not in KINDS:
            return []
        if path not in self._edges:
            self._edges[path] = [self._resolved(each, path) for each in self._named(path)]
        return self._edges[path]

    def _named(self, path: str) -> tuple[Input, ...]:
        one = self.files[path]
        return _inputs(self.workspace, path, one.kind, one.changed)

    def _resolved(self, each: Input, of: str) -> Edge:
        path, state = getattr(self, f"_{each.kind}")(each, of)
        return Edge(each, path, state)

    def _drive(self, each: Input, of: str) -> tuple[str, str]:
        by_hash, by_name = self._drives
        path = by_hash.get(each.digest, "") or self._circuits.get(each.digest, "")
        if path and path != of:
            return path, SAME
        alike = [one for one in by_name.get((each.name, each.part), []) if one != of]
        if len(alike) != 1:
            return "", MISSING
        return alike[0], DIFFERS if self.files[of].kind == "recording" else CHANGED

    @cached_property
    def _circuits(self) -> dict[str, str]:
        """Files of drives by the hash of their circuit, which controllers refer to."""
        found = {_circuit_hash(self.workspace, one.path, one.changed): one.path for one in self._of_kind("drive")}
        return _catalogue_circuits() | found

    def _fit(self, each: Input, _of: str) -> tuple[str, str]:
        if each.digest in self._fits:
            return self._fits[each.digest], SAME
        for one in self._of_kind("fit"):
            fit = _fit_at(self.workspace, one.path, one.changed)
            if fit is not None and each.part in fit.values and set(each.name.split(", ")) <= set(fit.recordings):
                return one.path, CHANGED
        return "", MISSING

    def _map(self, each: Input, of: str) -> tuple[str, str]:
        folder = of.rpartition("/")[0]
        maps = self._of_kind("friction map")  # the file next to the fit comes first
        maps.sort(key=lambda one: (one.path.rpartition("/")[0] != folder, not one.path.endswith(".parquet")))
        known, beside = json.loads(each.part), ""
        for one in maps:
            values = self._values(one, known)
            if values is not None and fingerprint(values) == each.digest:
                return one.path, SAME
            if values is not None and one.path.rpartition("/")[0] == folder:
                beside = beside or one.path
        return beside, CHANGED if beside else MISSING

    def _values(self, one: Listed, known: dict[str, Any]) -> Observations | None:
        found = map_at(self.workspace, one.path, one.changed)
        with suppress(FitError):
            return None if found is None else values_of_fit(found, known)
        return None

    def _recording(self, each: Input, _of: str) -> tuple[str, str]:
        """Return the file of a recording: by name, and among several also by hash; None without one."""
        own, alike = each.name in self.files, self._recordings.get(stem(Path(each.name)), [])
        paths = list(dict.fromkeys([each.name, *alike])) if own else alike
        path = paths[0] if own or len(paths) == 1 else ""
        if not paths:
            return "", MISSING
        if not each.digest:
            return path, NAMED
        states = {one: self._state(each, one) for one in paths}
        same = next((one for one, state in states.items() if state == SAME), "")
        if same or path:
            return same or path, states[same or path]
        return "", UNREAD if UNREAD in states.values() else CHANGED

    def _state(self, each: Input, path: str) -> str:
        one = self.files[path]
        if one.size > MOST_BYTES:
            return UNREAD
        if each.part == "file":
            digests = _contents(self.workspace, path, one.changed)
        else:
            digests = _samples(self.workspace, path, one.changed, is_volume=each.part == "volume")
        return SAME if each.digest in digests else CHANGED if digests else UNREAD

    def file_of(self, each: Input) -> str:
        """Return the file of a recording by its name, or by its hash among several of that name, or None."""
        alike = [each.name] if each.name in self.files else self._recordings.get(stem(Path(each.name)), [])
        return alike[0] if len(alike) == 1 else self._recording(each, "")[0]

    def _rig(self, each: Input, _of: str) -> tuple[str, str]:
        paths = [one for one in self.files if Path(one).name == Path(each.name).name]
        for path in paths:
            if hashlib.sha256(self.workspace.path(path).read_bytes()).hexdigest() == each.digest:
                return path, SAME
        own = paths if len(paths) == 1 else [one for one in paths if one == each.name]
        return (own[0] if own else ""), CHANGED if paths else MISSING

    def why_stale(self, path: str, seen: tuple[str, ...] = ()) -> list[str]:
        """Return the names of changed inputs, of the result or of its inputs."""
        said = []
        for edge in self.edges(path):
            if edge.state == CHANGED:
                said.append(edge.path or edge.input.name)
            elif edge.path not in ("", *seen):
                said += self.why_stale(edge.path, (*seen, path))
        return list(dict.fromkeys(said))

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
        runs = (one for one in self._newest if one.kind != "recording" or one.path.endswith(".parquet"))
        return [one.path for one in runs if one.kind in KINDS]

    def again(self, path: str) -> dict[str, Any] | None:
        """Return the request that makes a result again from the present inputs, or None if this is not possible."""
        one = self.files[path]
        edges = [edge for edge in self.edges(path) if edge.input.kind != "recording"]
        recordings = [edge.path for edge in self.edges(path) if edge.input.kind == "recording"]
        if not all([*recordings, *(edge.path for edge in edges)]):
            return None
        drive = next((edge.path for edge in edges if edge.input.kind == "drive"), "")
        results = f"{RESULTS}/{Path(path).parent.name or Path(path).stem}"
        if one.kind == "validation" and drive and recordings:
            return {"kind": "validate", "drive": drive, "recordings": recordings, "name": self._new(results)}
        if one.kind == "friction map" and recordings:
            return {"kind": "characterise", "recordings": recordings, "name": self._new(results)}
        if one.kind == "drive" and len(fits := {edge.path for edge in edges}) == 1:
            of_fit = next((edge.path for edge in self.edges(*fits) if edge.input.kind == "drive"), "")
            out = f"{self._new(path.removesuffix('.toml'), '.toml')}.toml"
            return (
                {"kind": "apply", "fit": edges[0].path, "drive": of_fit, "out": _beside(path, out)} if of_fit else None
            )
        fit = _fit_at(self.workspace, path, one.changed) if one.kind == "fit" else None
        if isinstance(fit, DriveFit) and drive and recordings:
            free = ", ".join(name for name in fit.values if name in fit.free)
            out = _beside(path, f"{self._new(path.removesuffix('.toml'), '.toml')}.toml")
            return {"kind": "identify", "drive": drive, "recordings": recordings, "free": free, "out": out}
        if isinstance(fit, FrictionFit) and (law := _law(fit)):
            form = fit.model.pressure if fit.provenance["pressure_dependence"] else "none"
            name = self._new(path.removesuffix(".toml"), ".toml")
            return {"kind": "fit", "map": edges[0].path, "law": law, "pressure": form, "name": name}
        return None

    def _new(self, path: str, suffix: str = "") -> str:
        """Return an unused name that is similar to that of a path, without folder and suffix."""
        places = ((number, self.workspace.folder(f"{path}-{number}{suffix}")) for number in count(2))
        return f"{Path(path).name}-{next(number for number, place in places if not place.exists())}"


def _beside(path: str, name: str) -> str:
    """Return the path of a file in another file's folder."""
    return (Path(path).parent / name).as_posix()


@lru_cache(maxsize=1)
def _catalogue() -> dict[str, str]:
    drives = [f"catalogue:{one.name}" for one in entries().values() if one.is_drive]
    return {Drive.load(name).description_hash: name for name in drives}


@lru_cache(maxsize=1)
def _catalogue_circuits() -> dict[str, str]:
    return {Drive.load(name).circuit.description_hash: name for name in _catalogue().values()}


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


@lru_cache(maxsize=2 * MOST_TRACED)
def _hash_at(workspace: Workspace, path: str, changed: float) -> str:
    return hash_at(workspace.path(path), changed)


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
        found = {
            "fit": _of_fit,
            "drive": _of_drive,
            "validation": _of_validation,
            "friction map": _of_map,
            "recording": _of_run,
            "comparison": _of_comparison,
            "campaign": _of_campaign,
        }[kind](workspace, path)
        return tuple(dict.fromkeys(found))[:MOST_INPUTS]
    except (PneudriveError, KeyError, TypeError, ValueError, AttributeError):
        return ()  # a file that is not a result has no inputs


def _of_fit(workspace: Workspace, path: str) -> Iterator[Input]:
    fit = read_fit(workspace.path(path))
    said = fit.provenance
    if isinstance(fit, SlidingFit):
        names = ("direction", "ambient_pressure_pa", "exclude_flags", "recordings")
        yield Input("map", "friction map", said["map_sha256"], json.dumps({name: said.get(name, []) for name in names}))
        return
    if "description_hash" in said:
        part = "identified" if isinstance(fit, DriveFit) and fit.start.provenance else ""
        yield Input("drive", said["drive"], said["description_hash"], part)
    part = "volume" if isinstance(fit, VolumeFit) else ""
    for one in said["recordings"]:
        if isinstance(one, dict):
            yield Input("recording", one["file"] or one["name"], one["sha256"], part)
        else:
            yield Input("recording", str(one))


def _of_drive(workspace: Workspace, path: str) -> Iterator[Input]:
    drive = drive_at(workspace, path, workspace.path(path).stat().st_mtime)  # in the order of the list
    for key, one in drive.provenance.items() if drive is not None else ():
        if one.fit:
            yield Input("fit", one.source, one.fit, key)


def _of_validation(workspace: Workspace, path: str) -> Iterator[Input]:
    content, _ = toml.read(workspace.path(path), CommandError)
    said = content["provenance"]
    yield Input("drive", said["drive"], said["description_hash"], "identified" if "identified" in said else "")
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
        said = json.loads(open_table(place, "parquet").metadata.get("pneudrive", "{}"))
        if "validation of" in said:
            yield Input("drive", "", said["validation of"])
            yield Input("recording", said["recording"], said["sha256"])
        elif "description_hash" in said:
            part = "identified" if "identified" in said else ""
            told = said.get("belief_hash") or said["description_hash"]  # the true drive of a controller may deviate
            yield Input("drive", said.get("title", ""), told, part)


def _of_comparison(workspace: Workspace, path: str) -> Iterator[Input]:
    for one in read_json(workspace.folder(path) / COMPARISON, CommandError)["laws"].values():
        yield Input("drive", one["believes"], one["belief_hash"])


def _of_campaign(workspace: Workspace, path: str) -> Iterator[Input]:
    about = read_json(workspace.folder(path) / CAMPAIGN, CommandError)
    if str(about["rig"]).endswith(".toml") and about["rig_sha256"]:
        yield Input("rig", about["rig"], about["rig_sha256"])


@lru_cache(maxsize=2 * MOST_TRACED)
def _fit_at(workspace: Workspace, path: str, _changed: float) -> AnyFit | None:
    try:
        return read_fit(workspace.path(path))
    except PneudriveError:
        return None


def recordings_of_map(workspace: Workspace, path: str) -> dict[str, str]:
    """Return the files of a friction map's recordings by their names, if they are known."""
    found = Lineage(workspace, MOST_TRACED)
    files = {one.name: found.file_of(one) for one in _of_map(workspace, path)}
    return {name: file for name, file in files.items() if file}


@lru_cache(maxsize=64)
def map_at(workspace: Workspace, path: str, _changed: float) -> xr.Dataset | None:
    """Return a friction map, or None for another file."""
    try:
        return read_map(workspace.path(path))
    except PneudriveError:
        return None


@lru_cache(maxsize=2 * MOST_TRACED)
def _contents(workspace: Workspace, path: str, _changed: float) -> frozenset[str]:
    """Return the hashes of a recording's file that friction maps may carry. Empty if it cannot be read."""
    try:
        return hashes_of(workspace.path(path))
    except PneudriveError:
        return frozenset()


@lru_cache(maxsize=2 * MOST_TRACED)
def _samples(workspace: Workspace, path: str, _changed: float, *, is_volume: bool) -> frozenset[str]:
    """Return the hash of a recording's samples in the form of fits and validations. Empty if it cannot be read."""
    place = workspace.path(path)
    try:
        own = place.suffix in SUFFIXES and len(columns_in(place, NEEDED)) == len(NEEDED)
        layout = None if own else layout_in(workspace, place)
        if layout is None and not own:
            return frozenset()
        read = read_volume_recordings if is_volume else read_drive_recordings
        options = {} if is_volume else {"needed": NEEDED[:2], "gaps": True}
        return frozenset([read(place, layout, **options)[0].sha256])
    except PneudriveError:
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
