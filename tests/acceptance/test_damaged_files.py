"""Damaged files of every format that is read: one message, never a crash, never other numbers than the file holds.

Damage is drawn with fixed seeds: bits, bytes, cuts, blocks; in text also brackets, dots, numbers, lines and signs that
hide. Where a format proves its content (our seal, the checksums of gzip, xz and HDF5), what is accepted must be
what was written; CSV is held against a reading by Python itself. ``PNEUDRIVE_DAMAGED`` sets the number of cases, as
``make trials`` does.
"""

from __future__ import annotations

import gzip
import lzma
import os
import random
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import xarray as xr

import pneudrive as pn
from pneudrive.campaign.cycle import Cycle
from pneudrive.campaign.planning.protocol import read_protocol, ready_protocols
from pneudrive.campaign.storage.folder import Campaign, Head, create, write_cycle
from pneudrive.cli.main import run
from pneudrive.errors import PneudriveError
from pneudrive.files.seal import sealed_parquet
from pneudrive.friction.friction_map import COLUMNS, read_map
from pneudrive.rig.description import DEFAULT, open_file
from pneudrive.rig.interface import Hold, Identity, Samples
from pneudrive.rig.rig_file import load_rig
from pneudrive.signals.layout import Layout
from pneudrive.signals.load import load_recording
from pneudrive.signals.proposal import propose_layout
from pneudrive.simulation.command import steps
from pneudrive.simulation.trajectory import read_columns, save

HIDDEN = re.compile("[\x00-\x08\x1b\u202a-\u202e\u2066-\u2069]")
NUMBER = int(os.environ.get("PNEUDRIVE_DAMAGED", "600"))
ROWS = 200
LAYOUT = """\
format = "{form}"
[columns]
time = {{ column = "t", unit = "s" }}
position = {{ column = "x", unit = "mm" }}
pressure_b = {{ column = "p", unit = "bar abs" }}
force = {{ column = "f", unit = "N" }}
[geometry]
bore = "25 mm"
[chamber_a]
open_to_ambient = true
"""
NASTY = (
    *(
        b"[" * 200,
        b"{" * 200,
        b"a." * 200,
        b"1e999",
        b"-1",
        b"nan",
        b"\x00",
        b"\xff\xfe",
        b'"',
        b"'''",
        b"\xe2\x80\xae",
    ),
    *(b"99999999999999999999999", b"0", b"null", b"true", b'""', b"\n", b",", b";", b"=", b"#", b"\\u0000", b"1e300"),
)


def columns() -> dict[str, np.ndarray]:
    t = np.arange(ROWS) / 100.0
    rng = np.random.default_rng(0)
    x = 20.0 + 10.0 * np.sin(t * 6.0)
    return {"t": t, "x": x, "p": 3.0 + 0.01 * rng.standard_normal(ROWS), "f": 15.0 * np.cos(t * 6.0)}


def trajectory() -> xr.Dataset:
    drive = pn.Drive.load("catalogue:reference")
    return pn.simulate(drive, "0 s: 0.4", "0.1 s")


def friction_map() -> pl.DataFrame:
    words, whole = {"recording": "run", "flags": ""}, {"direction", "samples", "strokes", "strokes_recorded"}
    return pl.DataFrame(
        {name: [words.get(name, 1 + i if name in whole else 0.5 + i) for i in range(4)] for name in COLUMNS}
    )


def hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in columns().items():
            file.create_dataset(name, data=values.reshape(1, -1)).attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, written by hand".ljust(124) + b"\x00\x02IM")


def write_all(folder: Path) -> None:
    """Write one sound file of each format, by its library."""
    import asammdf
    import nptdms
    from scipy.io import savemat

    table = columns()
    frame = pl.DataFrame(table)
    text = frame.write_csv()
    (folder / "plain.csv").write_text(text)
    (folder / "packed.csv.gz").write_bytes(gzip.compress(text.encode(), mtime=0))
    (folder / "packed.csv.xz").write_bytes(lzma.compress(text.encode()))
    frame.write_parquet(folder / "foreign.parquet")
    data = xr.Dataset({name: ("sample", values) for name, values in table.items()})
    data.to_netcdf(folder / "foreign.nc", engine="h5netcdf")
    data.to_netcdf(folder / "classic.nc", engine="scipy")
    with nptdms.TdmsWriter(folder / "run.tdms") as writer:
        writer.write_segment([nptdms.ChannelObject("rig", name, values) for name, values in table.items()])
    with asammdf.MDF() as file:
        file.append([asammdf.Signal(table[n], table["t"], name=n) for n in "xpf"])
        file.save(folder / "run.mf4")
    savemat(folder / "five.mat", table)
    hdf5(folder / "seven.mat")
    made = trajectory()
    for suffix in (".csv", ".parquet", ".nc"):
        save(made, folder / f"own{suffix}")
    (folder / "map.parquet").write_bytes(sealed_parquet(friction_map(), {}))
    friction_map().write_csv(folder / "map.csv")
    (folder / "drive.toml").write_text(pn.Drive.load("catalogue:reference").to_toml(), encoding="utf-8")
    (folder / "rig.toml").write_bytes(DEFAULT.read_bytes())
    (folder / "protocol.toml").write_bytes(ready_protocols()["paper-stops"].read_bytes())
    (folder / "layout.toml").write_text(LAYOUT.format(form="csv"), encoding="utf-8")
    (folder / "steps.csv").write_text("time_s,command\n0,1\n0.5,-0.25\n1,0\n")
    identity = Identity("rig", area_a_m2=5e-4, area_b_m2=5e-4)
    campaign = create(folder / "campaign", ready_protocols()["quick-look"].read_text(encoding="utf-8"), identity, {})
    cycle = Cycle("b1/tare", "tare", (Hold(1.0),), read_protocol("quick-look").sampling, 1e5, 1e5)
    channels = {name: np.linspace(0.0, 1.0, ROWS) for name in Samples.__dataclass_fields__ if name != "step"}
    write_cycle(campaign.path, Head(1, cycle), Samples(**channels, step=np.zeros(ROWS, dtype=np.int64)))


def layout_for(path: Path) -> Layout:
    form = {".parquet": "parquet", ".nc": "netcdf", ".tdms": "tdms", ".mf4": "mf4", ".mat": "mat"}.get(
        path.suffix, "csv"
    )
    text = LAYOUT.format(form=form)
    if form == "csv":
        text = text.replace("[columns]", 'delimiter = ","\nheader = true\n[columns]', 1)
    return Layout.loads(text.replace('column = "t"', 'column = "time"') if form == "mf4" else text)


def recording(path: Path) -> list[np.ndarray]:
    found = load_recording(path, layout_for(path))
    return [found.time_s, found.position_m, found.force_n, np.asarray(found.pressure_b_pa)]


def proposal(path: Path) -> list[np.ndarray]:
    return list(propose_layout(path).file.values)


def own(path: Path) -> list[np.ndarray]:
    load_recording(path, None)
    return list(read_columns(path, ("time_s", "position_m", "pressure_a_pa")).values())


def map_of(path: Path) -> list[np.ndarray]:
    found = read_map(path)
    return [found[name].to_numpy() for name in COLUMNS if name in found]


def campaign_of(path: Path) -> list[np.ndarray]:
    folder = path.parent if path.parent.name != "cycles" else path.parent.parent
    opened = Campaign.open(folder)
    opened.protocol  # noqa: B018 - it is read where it is asked for
    files, problems = opened.scan()
    assert len(files) + sum(p.lost for p in problems) == 1
    return [np.asarray(vars(file.samples())[name]) for file in files for name in ("position_m", "force_n")]


def drive(path: Path) -> list[np.ndarray]:
    pn.Drive.load(path).core_json()
    return []


def rig(path: Path) -> list[np.ndarray]:
    load_rig(path)
    return []


@dataclass(frozen=True)
class Kind:
    """A file, what reads it, and whether what is accepted must be what was written."""

    name: str
    read: Callable[[Path], object]
    proven: bool = False
    text: bool = False


KINDS = (
    Kind("plain.csv", recording, text=True),
    Kind("plain.csv", proposal, text=True),
    Kind("packed.csv.gz", recording, proven=True),
    Kind("packed.csv.xz", recording, proven=True),
    Kind("foreign.parquet", recording),
    Kind("foreign.parquet", proposal),
    Kind("foreign.nc", recording),
    Kind("classic.nc", recording),
    Kind("run.tdms", recording),
    Kind("run.tdms", proposal),
    Kind("run.mf4", recording),
    Kind("run.mf4", proposal),
    Kind("five.mat", recording),
    Kind("seven.mat", recording),
    Kind("own.csv", own, text=True),
    Kind("own.parquet", own, proven=True),
    Kind("own.nc", own, proven=True),
    Kind("map.parquet", map_of, proven=True),
    Kind("map.csv", map_of, text=True),
    Kind("drive.toml", drive, text=True),
    Kind("rig.toml", open_file, text=True),
    Kind("rig.toml", rig, text=True),
    Kind("protocol.toml", read_protocol, text=True),
    Kind("layout.toml", Layout.load, text=True),
    Kind("steps.csv", steps, text=True),
    Kind("campaign/campaign.json", campaign_of, text=True),
    Kind("campaign/rig.json", campaign_of, text=True),
    Kind("campaign/campaign.toml", campaign_of, text=True),
    Kind("campaign/cycles/00001-b1_tare.parquet", campaign_of, proven=True),
)


def damaged(data: bytes, rng: random.Random, *, text: bool) -> bytes:
    """Damage a file once or a few times; ends of files, where formats keep their tables, more often."""
    out = bytearray(data)
    low = max(len(out) - 1500, 0) if rng.random() < 0.4 else 0

    def at() -> int:
        return rng.randrange(low, max(len(out), low + 1))

    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        how = rng.randrange(8 if text else 5)
        place = at()
        if not out:
            break
        if how == 0:
            out[place % len(out)] ^= 1 << rng.randrange(8)
        elif how == 1:
            out[place % len(out)] = rng.randrange(256)
        elif how == 2:
            del out[place : place + rng.choice((1, 8, 100, len(out)))]
        elif how == 3:
            other, length = at(), rng.randrange(1, 64)
            out[place : place + length], out[other : other + length] = (
                out[other : other + length],
                out[place : place + length],
            )
        elif how == 4:
            out[place:place] = bytes(rng.randrange(256) for _ in range(rng.randrange(1, 9)))
        elif how == 5:
            out[place:place] = rng.choice(NASTY)
        elif how == 6:  # another value in place of a number or a text
            found = list(re.finditer(rb'-?\d+\.?\d*(?:[eE][-+]?\d+)?|"[^"\n]*"', out))
            if found:
                one = rng.choice(found)
                out[one.start() : one.end()] = rng.choice(NASTY)
        else:  # a line twice, or not at all
            lines = bytes(out).split(b"\n")
            place = rng.randrange(len(lines))
            lines[place : place + 1] = rng.choice(([], [lines[place]] * 2, [lines[place], rng.choice(lines)]))
            out = bytearray(b"\n".join(lines))
    return bytes(out)


def same(found: list[np.ndarray], wanted: list[np.ndarray]) -> bool:
    return all(np.array_equal(a, b, equal_nan=a.dtype.kind == "f") for a, b in zip(found, wanted, strict=True))


def by_python(path: Path) -> list[np.ndarray]:
    """Read three columns of a CSV file of ours by means of Python alone."""
    first, *rows = [line.split(",") for line in path.read_bytes().decode("latin-1").removesuffix("\n").split("\n")]
    places = [first.index(name) for name in ("time_s", "position_m", "pressure_a_pa")]
    missing = "nan"  # an empty field, and an empty line, are rows without values
    return [
        np.array([float((row[place] if place < len(row) else missing) or missing) for row in rows]) for place in places
    ]


@pytest.fixture(scope="module")
def sound(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("sound")
    write_all(folder)
    return folder


@pytest.mark.filterwarnings("ignore")  # what a damaged file makes NumPy say on the way to the message
@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: f"{kind.name}-{kind.read.__name__}")
def test_damaged_files_are_refused_in_words_or_read_as_they_are(sound, kind, monkeypatch):
    path = sound / kind.name
    data = path.read_bytes()
    written = kind.read(path)
    monkeypatch.setenv("PNEUDRIVE_BOUNDS", "reader_seconds=2")  # some damage sends HDF5 round in a circle
    said: list[str] = []
    try:
        for seed in range(-(-NUMBER // len(KINDS))):
            path.write_bytes(damaged(data, random.Random(f"{kind.name} {seed}"), text=kind.text))
            try:
                found = kind.read(path)
            except PneudriveError as error:
                said.append(str(error))
                continue
            if kind.proven and found:
                assert same(found, written), seed
            if kind.name == "own.csv":
                assert same(found, by_python(path)), seed
    finally:
        path.write_bytes(data)
    if kind.proven and not kind.name.startswith("campaign/"):  # a folder tells of them among its problems
        assert said
    assert all(len(text) < 40_000 and not HIDDEN.search(text) for text in said)


@pytest.mark.parametrize("name", ["foreign.parquet", "own.parquet", "own.nc", "packed.csv.xz"])
def test_a_command_ends_with_status_2_and_leaves_nothing(sound, tmp_path, name, capfd):
    """Through the command line: one message on stderr, and no folder half written."""
    source = sound / name
    data = bytearray(source.read_bytes())
    data[len(data) // 3 : len(data) // 3 + 400] = b"\xff" * 400
    path = tmp_path / source.name
    path.write_bytes(data)
    (tmp_path / "layout.toml").write_text(layout_for(path).text, encoding="utf-8")
    before = sorted(p.name for p in tmp_path.rglob("*"))
    assert (
        run(["characterise", str(path), "--layout", str(tmp_path / "layout.toml"), "--out", str(tmp_path / "out")]) == 2
    )
    said = capfd.readouterr().err
    assert said.startswith("RecordingError: ")
    assert "Traceback" not in said
    assert "panicked" not in said
    assert sorted(p.name for p in tmp_path.rglob("*")) == before
