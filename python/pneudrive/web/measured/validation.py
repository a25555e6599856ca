"""Comparison of a drive with recordings for the page: result of `pneudrive validate`, and runs of a changed drive."""

from __future__ import annotations

import difflib
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache
from itertools import chain
from pathlib import Path, PurePosixPath
from typing import Annotated

import numpy as np
from pydantic import Field, StrictInt, StrictStr

from pneudrive.arrays import Interval, Keyed, Plain
from pneudrive.describe import Circuit, Drive
from pneudrive.describe.all_values import DescribedValue, values_of
from pneudrive.describe.files import toml
from pneudrive.errors import CommandError
from pneudrive.figures import Look, Markers
from pneudrive.free.parameters import numbers_of, with_shape
from pneudrive.friction.friction_map import groups_of, read_map
from pneudrive.identify.static.fit import fit_file
from pneudrive.identify.static.result import FrictionFit
from pneudrive.results import COMPARED, compare_results
from pneudrive.signals.drive_recording import NEEDED, OPTIONAL, drive_recording
from pneudrive.simulation.trajectory import columns_in, read_columns
from pneudrive.units import readable, write
from pneudrive.validate.balance import Signals, metrics, run_model
from pneudrive.validate.validation import CHANNELS
from pneudrive.views import ShownFigure
from pneudrive.web.drive.description import field_of
from pneudrive.web.drive.run_request import Changes, described_at, with_changes
from pneudrive.web.lineage import SAME, Edge, Lineage
from pneudrive.web.measured.recordings import by_stem
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import MOST_PIXELS, pack, python, shell, wrong_request
from pneudrive.web.results import load_at
from pneudrive.web.workspace import DESCRIPTIONS, TABLES, Workspace, is_in_catalogue

FIT = "fit.toml"  # of a map with one assembly
MOST_LIVE = 300_000  # samples of a recording that is run again while a slider moves


def shown_validation(workspace: Workspace, path: str) -> Plain:
    """Return a validation from its file, with the drive and the recordings in the workspace.

    Raises
    ------
    CommandError
        The file was not written by `pneudrive validate`.
    """
    content = _read(workspace, path)
    provenance = content["provenance"]
    recordings = {name: paths[0] for name, paths in by_stem(workspace.files()).items() if len(paths) == 1}
    lineage = Lineage(workspace)
    place, drive = lineage.drive_of(path)
    files = {edge.sha256: edge.path for edge in lineage.edges(path) if edge.kind == "recording"}
    for record in content["record"]:
        record["file"] = files.get(record["sha256"], "")
        record["span"] = [0.0, record["duration_s"]]
    return {
        **{key: content[key] for key in ("window_s", "synthetic", "notes", "record", "condition", "diagnosis")},
        "name": provenance["drive"],
        "drive": place,
        "editable": drive is not None and (is_in_catalogue(place) or lineage.files[place].kind != "fit"),
        "suspects": _suspects(drive, content["diagnosis"]),
        "values": _values(lineage.edges(place), drive, recordings, provenance.get("identified", {})),
        "channels": [
            {"column": column, "label": label, "size": size, "unit": unit}
            for column, label in CHANNELS.items()
            for size, unit in (readable("m" if column.endswith("_m") else "Pa"),)
        ],
    }


def _read(workspace: Workspace, name: str) -> Plain:
    path = workspace.path(name, DESCRIPTIONS)
    content, _ = toml.read(path, CommandError, "pneudrive validate writes a validation.toml.")
    if not all(key in content for key in ("verdict", "record", "diagnosis", "provenance")):
        raise CommandError(f"{name} is not a validation", remedy="Validate a drive against a recording first.")
    if not all("run" in one for one in content["record"]):
        raise CommandError(f"{name} was written without its runs", remedy="Validate again.")
    return content


def _suspects(drive: Drive | None, diagnosis: Keyed) -> list[Plain]:
    """Return form fields for the values that the diagnosed causes name, but that the drive file does not contain.

    Such values are derived from other values of the file.
    """
    if drive is None:
        return []
    given = {one.key for one in values_of(drive)}
    keys = [key for cause in diagnosis.get("culprit", []) for key in cause["free"] if key not in given]
    known = numbers_of(with_shape(drive, keys))
    fields = []
    for one in (known[key] for key in dict.fromkeys(keys) if key in known):
        value = one.value if one.unit in ("", "1") else write(one.value, one.unit, readable(one.unit)[1])
        fields.append(field_of(DescribedValue(one.name, value, "follows from other values of the file", "given")))
    return fields


def _values(
    inputs: list[Edge],
    drive: Drive | None,
    recordings: Mapping[str, str],
    identified: Keyed,
) -> list[Plain]:
    """Return the values of the drive with their sources; without the drive, return the identified values."""
    known = identified if drive is None else {key: one.to_dict() for key, one in drive.provenance.items()}
    out: list[Plain] = [
        {"key": one.key, "text": str(one.value), "kind": one.kind, "origin": one.origin}
        for one in (() if drive is None else values_of(drive))
    ]
    fits = {edge.sha256: edge.path for edge in inputs if edge.kind == "fit"}
    out = out or [{"key": key, "text": "", "kind": "identified", "origin": ""} for key in known]
    for value in out:
        if origin := known.get(value["key"]):
            names = [name.strip() for name in origin["source"].split(",")]
            value["origin"] = ""
            value["interval"] = " … ".join(str(end) for end in origin["interval"])
            value["source"] = [{"name": name, "file": recordings.get(name, "")} for name in names]
            value["fit"] = fits.get(origin.get("fit", ""), "")
    return out


def frame_of(
    workspace: Workspace,
    path: StrictStr,
    record: Annotated[StrictInt, Field(ge=0)],
    span: Interval,
    pixels: Annotated[StrictInt, Field(ge=1, le=MOST_PIXELS)],
    drive: StrictStr = "",
    changes: Changes | None = None,
    number: object = None,
) -> bytes:
    """Return a view of one record as a frame: measurement, both runs, residuals, and the run of a changed drive.

    Parameters
    ----------
    workspace : Workspace
    path : str
        The validation.
    record : int
        Index of the record in the validation.
    span : (float, float)
        First and last time, in s.
    pixels : int
        Width of the drawing.
    drive : str
        Drive to change, by its name in the workspace or the catalogue.
    changes : dict, optional
        Changed values.
    number : int
        Number of the request, which the head of the frame repeats.

    Raises
    ------
    CommandError
        The request is not valid, the validation is missing, or the recording is too long to be run again for a page.
    DescriptionError
        A changed value is not valid.
    """
    records = _read(workspace, path)["record"]
    if record >= len(records):
        raise wrong_request()
    file = workspace.path(f"{path.rpartition('/')[0]}/{records[record]['run']}".lstrip("/"), TABLES)
    if not file.is_file():
        raise CommandError(f"{file.name} is missing next to {path}", remedy="Validate again.")
    table, signals = _run(file, file.stat().st_mtime_ns)
    head: Plain = {"number": number}
    columns = {"time_s": table["time_s"], "command": table["command"]}
    changed: Keyed = {}
    if changes:
        described = described_at(workspace, drive)
        if not isinstance(described, Drive):
            raise CommandError("a circuit cannot be validated here")
        if signals.time_s.size > MOST_LIVE:
            raise CommandError.of("web.sliders", samples=signals.time_s.size, most=MOST_LIVE)
        free = run_model(with_changes(described, changes), signals)  # type: ignore[arg-type]
        head["fit"] = {c: metrics(getattr(signals, c), free[c]).fit_percent for c in CHANNELS}  # agreement, %
        changed = free.columns
    for channel in CHANNELS:
        measured = table[channel]
        columns[f"{channel}.measured"] = measured
        for run in ("free", "restarted"):
            columns[f"{channel}.{run}"] = table[f"{run}.{channel}"]
            columns[f"{channel}.{run}.residual"] = measured - table[f"{run}.{channel}"]
        if changed:
            columns[f"{channel}.changed"] = changed[channel]
            columns[f"{channel}.changed.residual"] = measured - changed[channel]
    begin, end = np.searchsorted(columns["time_s"], span)
    rows = slice(max(begin - 1, 0), max(end + 1, begin + 2))
    return pack(head, drawn_columns({key: values[rows] for key, values in columns.items()}, pixels))


@lru_cache(maxsize=4)
def _run(path: Path, _changed_ns: int) -> tuple[Plain, Signals]:
    """Read the file of a run as a recording."""
    runs = [f"{run}.{channel}" for run in ("free", "restarted") for channel in CHANNELS]
    names = columns_in(path, (*NEEDED, *OPTIONAL, *runs))
    if not {*NEEDED, *runs} <= set(names):
        raise CommandError(f"{path.name} is not a run of a validation", remedy="Validate again.")
    table = read_columns(path, names)
    return table, Signals.of(drive_recording({key: table[key] for key in names if key not in runs}, path.stem))


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
    found = compare_results(sources[0], sources[1], labels)
    figure = found.figure() if found.curves else None
    if figure is not None and isinstance(sources[0], FrictionFit) and found.curves[0].first.x_unit == "Pa":
        chamber = found.curves[0].first.x_quantity[-1]
        marks = [_measured(workspace, *each, chamber) for each in zip(names, COMPARED, strict=True)]
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
