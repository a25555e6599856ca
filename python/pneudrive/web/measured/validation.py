"""Comparison of a drive with recordings for the page: result of `pneudrive validate`, and runs of a changed drive."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, StrictInt, StrictStr

from pneudrive.arrays import Interval, Keyed, Plain, attributes_of, rows_of
from pneudrive.describe import Drive
from pneudrive.describe.files import toml
from pneudrive.describe.system import DescribedValue, values_of
from pneudrive.errors import CommandError
from pneudrive.free.parameters import numbers_of, with_shape
from pneudrive.signals.drive_recording import NEEDED, OPTIONAL, drive_recording
from pneudrive.simulation.trajectory import columns_in, read_columns
from pneudrive.units import readable, write
from pneudrive.validate.balance import Signals, metrics, run_model
from pneudrive.validate.validation import CHANNELS
from pneudrive.web.drive.description import field_of
from pneudrive.web.drive.run_request import Changes, described_at, with_changes
from pneudrive.web.measured.tiles import drawn_columns
from pneudrive.web.messages import MOST_PIXELS, pack, wrong_request
from pneudrive.web.results import Edge, Lineage
from pneudrive.web.workspace import DESCRIPTIONS, TABLES, Workspace, is_in_catalogue

RUNS = ("free", "restarted")  # of a record in its file
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
        "values": _values(lineage.edges(place), drive, lineage.recordings, provenance.get("identified", {})),
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
        raise CommandError(f"{name} does not contain the runs", remedy="Validate again.")
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
        attributes_of(one, "key", "kind", "origin") | {"text": str(one.value)}
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
    runs = {run: {c: table[f"{run}.{c}"] for c in CHANNELS} for run in RUNS}
    if changes:
        described = described_at(workspace, drive)
        if not isinstance(described, Drive):
            raise CommandError("a circuit cannot be validated here")
        if signals.time_s.size > MOST_LIVE:
            raise CommandError.of("web.sliders", samples=signals.time_s.size, most=MOST_LIVE)
        free = run_model(with_changes(described, changes), signals)  # type: ignore[arg-type]
        head["fit"] = {c: metrics(getattr(signals, c), free[c]).fit_percent for c in CHANNELS}  # agreement, %
        runs["changed"] = {c: free.columns[c] for c in CHANNELS}
    for channel in CHANNELS:
        columns[f"{channel}.measured"] = table[channel]
        for name, run in runs.items():
            columns |= {f"{channel}.{name}": run[channel], f"{channel}.{name}.residual": table[channel] - run[channel]}
    begin, end = np.searchsorted(columns["time_s"], span)
    rows = slice(max(begin - 1, 0), max(end + 1, begin + 2))
    return pack(head, drawn_columns(rows_of(columns, rows), pixels))


@lru_cache(maxsize=4)
def _run(path: Path, _changed_ns: int) -> tuple[Plain, Signals]:
    """Read the file of a run as a recording."""
    runs = [f"{run}.{channel}" for run in RUNS for channel in CHANNELS]
    names = columns_in(path, (*NEEDED, *OPTIONAL, *runs))
    if not {*NEEDED, *runs} <= set(names):
        raise CommandError(f"{path.name} is not a run of a validation", remedy="Validate again.")
    table = read_columns(path, names)
    return table, Signals.of(drive_recording({key: table[key] for key in names if key not in runs}, path.stem))
