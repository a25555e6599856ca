"""One recording in every format, written by the format's own library: the same friction map to the bit."""

from __future__ import annotations

import struct
from datetime import datetime, timedelta, timezone
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from pneudrive.characterise import Layout, characterise
from pneudrive.errors import RecordingError
from pneudrive.files.inputs import INPUTS
from pneudrive.signals.proposal import propose_layout

LAYOUT = """\
format = "{form}"
{text}
[columns]
time = {{ column = "{t}", {unit} }}
position = {{ column = "{x}", unit = "m" }}
pressure_b = {{ column = "{p}", unit = "Pa abs" }}
force = {{ column = "{f}", unit = "N" }}
[geometry]
bore = "25 mm"
[chamber_a]
open_to_ambient = true
"""
START = datetime(2026, 10, 24, 23, 59, 58, 250000, tzinfo=timezone.utc)  # over midnight
SECONDS, DATES = 'unit = "s"', 'unit = "date-time"'

Table = dict[str, np.ndarray]


@pytest.fixture
def table(make) -> Table:
    r = make(strokes=6)
    return {"t": np.arange(len(r)) / 100.0, "x": r.position_m, "p": r.pressure_b_pa, "f": r.force_n}


def stamps(table: Table) -> np.ndarray:
    """Give the times of the clock on the wall."""
    return np.datetime64(START.replace(tzinfo=None), "ns") + np.round(1e9 * table["t"]).astype("timedelta64[ns]")


def written(table: Table, form: str) -> list[str]:
    return [(START + timedelta(seconds=float(t))).strftime(form) for t in table["t"]]


def write_text(path: Path, table: Table, times: list[str], decimal: str = ",") -> None:
    rows = zip(times, *([repr(float(v)) for v in table[n]] for n in "xpf"), strict=True)
    lines = [";".join(row).replace(".", decimal) if decimal != "." else ";".join(row) for row in rows]
    path.write_text("t;x;p;f\n" + "\n".join(lines))


def plain_text(path: Path, table: Table) -> None:
    write_text(path, table, [repr(float(t)) for t in table["t"]])


def text_iso(path: Path, table: Table) -> None:
    write_text(path, table, written(table, "%Y-%m-%dT%H:%M:%S.%f+00:00"), ".")


def text_german(path: Path, table: Table) -> None:
    dates = written(table, "%d/%m/%Y %H:%M:%S,%f")
    write_text(path, table, [date.replace("/", "") for date in dates])  # 24102026: decimal commas all over


def text_quoted(path: Path, table: Table) -> None:
    write_text(path, table, [f'"{stamp}"' for stamp in written(table, "%d %b %Y %I:%M:%S.%f %p")], ".")


def parquet(path: Path, table: Table) -> None:
    import polars as pl

    pl.DataFrame(table).write_parquet(path)


def parquet_dates(path: Path, table: Table) -> None:
    parquet(path, {**table, "t": stamps(table)})


def parquet_texts(path: Path, table: Table) -> None:
    parquet(path, {**table, "t": np.array(written(table, "%Y-%m-%d %H:%M:%S.%f"))})


def netcdf(path: Path, table: Table, engine: str = "h5netcdf") -> None:
    xr.Dataset({name: ("sample", values) for name, values in table.items()}).to_netcdf(path, engine=engine)


def netcdf3(path: Path, table: Table) -> None:
    netcdf(path, table, "scipy")


def netcdf_dates(path: Path, table: Table) -> None:
    netcdf(path, {**table, "t": stamps(table)})


def tdms(path: Path, table: Table) -> None:
    import nptdms

    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", name, values) for name, values in table.items()])


def tdms_dates(path: Path, table: Table) -> None:
    tdms(path, {**table, "t": stamps(table).astype("datetime64[us]")})


def tdms_waveform(path: Path, table: Table) -> None:
    import nptdms

    clock = {
        "wf_increment": 0.01,
        "wf_start_offset": 0.0,
        "wf_samples": 1,
        "wf_start_time": np.datetime64("2026-10-24"),
    }
    channels = [nptdms.ChannelObject("rig", name, table[name], clock) for name in "xpf"]
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(channels)


def mf4(path: Path, table: Table) -> None:
    import asammdf

    with asammdf.MDF() as file:
        file.append([asammdf.Signal(table[n], table["t"], name=n) for n in "xpf"])
        file.save(path)


def mf4_groups(path: Path, table: Table) -> None:
    """Write a second group of another rate, in which a name of the first one occurs, and one of texts."""
    import asammdf

    with asammdf.MDF() as file:
        file.append([asammdf.Signal(table[n], table["t"], name=n) for n in "xpf"])
        file.append([asammdf.Signal(np.zeros(5), np.arange(5.0), name="x")])
        file.append([asammdf.Signal(np.array([b"run", b"stop"]), np.arange(2.0), name="mode", encoding="utf-8")])
        file.save(path)


def mat5(path: Path, table: Table) -> None:
    from scipy.io import savemat

    savemat(path, {"rig": {name: values.reshape(-1, 1) for name, values in table.items()}})


def mat73(path: Path, table: Table) -> None:
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        rig = file.create_group("rig")
        rig.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in table.items():
            column = rig.create_dataset(name, data=values.reshape(1, -1))  # as MATLAB writes a column
            column.attrs["MATLAB_class"] = np.bytes_("double")
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file, written by hand".ljust(124) + b"\x00\x02IM")


TEXT = 'delimiter = ";"\nheader = true\n'
RIG = {name: f"rig.{name}" for name in "txpf"}
CASES = {
    "csv, decimal comma": ("csv", plain_text, SECONDS, TEXT + 'decimal = ","', {}),
    "csv, ISO 8601": ("csv", text_iso, DATES, TEXT, {}),
    "csv, own form": ("csv", text_german, DATES + ', format = "%d%m%Y %H:%M:%S,%f"', TEXT + 'decimal = ","', {}),
    "csv, words": ("csv", text_quoted, DATES + ', format = "%d %b %Y %I:%M:%S.%f %p"', TEXT, {}),
    "parquet, dates": ("parquet", parquet_dates, DATES, "", {}),
    "parquet, texts": ("parquet", parquet_texts, DATES, "", {}),
    "netcdf": ("netcdf", netcdf, SECONDS, "", {}),
    "netcdf 3": ("netcdf", netcdf3, SECONDS, "", {}),
    "netcdf, dates": ("netcdf", netcdf_dates, DATES, "", {}),
    "tdms": ("tdms", tdms, SECONDS, "", {"x": "rig/x"}),
    "tdms, dates": ("tdms", tdms_dates, DATES, "", {}),
    "tdms, waveform": ("tdms", tdms_waveform, SECONDS, "", {"t": "time"}),
    "mf4": ("mf4", mf4, SECONDS, "", {"t": "time"}),
    "mf4, groups": ("mf4", mf4_groups, SECONDS, "", {"t": "time", "x": "0/x"}),
    "mat 5": ("mat", mat5, SECONDS, "", RIG),
    "mat 7.3": ("mat", mat73, SECONDS, "", RIG),
}


def layout(form: str, unit: str = SECONDS, text: str = "", names: dict[str, str] | None = None) -> Layout:
    columns = {name: name for name in "txpf"} | (names or {})
    return Layout.loads(LAYOUT.format(form=form, unit=unit, text=text, **columns))


@pytest.mark.filterwarnings("ignore")  # of the optional libraries
@pytest.mark.parametrize("case", CASES)
def test_the_same_map(table, tmp_path, case):
    form, write, unit, text, names = CASES[case]
    parquet(tmp_path / "lip.parquet", table)
    expected = characterise(tmp_path / "lip.parquet", layout("parquet"))
    assert expected.sizes["row"] >= 2
    file = tmp_path / f"lip.{form}"
    file.unlink(missing_ok=True)
    write(file, table)
    found = characterise(file, layout(form, unit, text, names))
    if case == "tdms, waveform":  # its times are products, not the ones that were recorded
        xr.testing.assert_allclose(found, expected, rtol=1e-9)
    else:
        assert found.attrs.pop(INPUTS) != expected.attrs.pop(INPUTS)  # of two files, and all that tells them apart
        xr.testing.assert_identical(found, expected)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("write", [text_iso, parquet_dates, tdms_dates, mf4_groups, mat73], ids=lambda w: w.__name__)
def test_a_layout_is_proposed_for_it(table, tmp_path, write):
    name = {"text_iso": "csv", "mat73": "mat"}.get(write.__name__, write.__name__.partition("_")[0])
    write(tmp_path / f"lip.{name}", table)
    proposal = propose_layout(tmp_path / f"lip.{name}")
    assert ("date-time" in proposal.text) == (write in (text_iso, parquet_dates, tdms_dates))
    assert proposal.recording is not None
    assert np.array_equal(proposal.recording.time_s, table["t"])


def test_columns_of_a_mat_file_are_in_the_order_of_their_names(table, tmp_path):
    """Its library lists them in any order."""
    mat73(tmp_path / "lip.mat", table)
    assert propose_layout(tmp_path / "lip.mat").file.names == [f"rig.{name}" for name in "fptx"]


def test_cycles_of_a_campaign_file_with_dates(table, tmp_path):
    import polars as pl

    number = (table["t"] > table["t"].mean()).astype(int)
    pl.DataFrame({**table, "t": stamps(table), "n": number}).write_parquet(tmp_path / "lip.parquet")
    said = LAYOUT.format(form="parquet", unit=DATES, text="", **{n: n for n in "txpf"})
    maps = [characterise(tmp_path / "lip.parquet", Layout.loads(said.replace("[columns]", "[columns]\ncycle = 4")))]
    pl.DataFrame({**table, "n": number}).write_parquet(tmp_path / "lip.parquet")
    said = said.replace(DATES, SECONDS)
    maps.append(characterise(tmp_path / "lip.parquet", Layout.loads(said.replace("[columns]", "[columns]\ncycle = 4"))))
    for name in ("friction_n", "velocity_m_s", "stderr_n"):
        assert maps[0][name].values == pytest.approx(maps[1][name].values, rel=1e-9)


def test_dates_that_are_none_and_none_that_are_dates(table, tmp_path):
    file = tmp_path / "lip.csv"
    text_iso(file, table)
    with pytest.raises(
        RecordingError, match=r"(?s)no value of the time column is a date of the format %H.*2026-10.*format"
    ):
        characterise(file, layout("csv", DATES + ', format = "%H.%M.%S"', TEXT))
    lines = file.read_text().splitlines()
    lines[20] = "yesterday;" + lines[20].partition(";")[2]
    file.write_text("\n".join(lines))
    assert characterise(file, layout("csv", DATES, TEXT)).sizes["row"] >= 2  # one bad clock reading is one bad sample
    parquet_dates(tmp_path / "lip.parquet", table)
    with pytest.raises(RecordingError, match=r'(?s)holds dates and times.*unit = "date-time"'):
        characterise(tmp_path / "lip.parquet", layout("parquet"))
    parquet(tmp_path / "lip.parquet", table)
    with pytest.raises(RecordingError, match=r"(?s)holds numbers, not dates.*state its unit"):
        characterise(tmp_path / "lip.parquet", layout("parquet", DATES))


@pytest.mark.parametrize(("form", "library"), [("tdms", "nptdms"), ("mf4", "asammdf"), ("mat", "pymatreader")])
def test_a_format_whose_library_is_missing_names_the_extra(tmp_path, monkeypatch, form, library):
    from pneudrive.files import formats

    def absent(name: str) -> None:
        raise ImportError(name)

    monkeypatch.setattr(formats, "import_module", absent)
    with pytest.raises(RecordingError, match=rf"(?s)needs the optional library {library}.*pneudrive\[formats\]"):
        formats.OPENERS[form][1](tmp_path / f"a.{form}")


def test_the_units_that_a_tdms_file_says_are_proposed(make, tmp_path):
    nptdms = pytest.importorskip("nptdms")
    r = make(friction=20.0, strokes=4, travel=0.1, speed=0.05, rate=200.0)
    table = {"t": (r.time_s, "s"), "x": (r.position_m * 100, "cm"), "p_b": ((r.pressure_b_pa - 101325) / 1e3, "kPa")}
    table["f"] = (r.force_n / 1e3, "kN")
    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment(
            [nptdms.ChannelObject("rig", n, v, properties={"unit_string": unit}) for n, (v, unit) in table.items()]
        )
    proposal = propose_layout(tmp_path / "a.tdms")
    assert {g.role: g.unit for g in proposal.guesses} == {
        "time": "s", "position": "cm", "pressure_b": "kPa", "force": "kN"
    }  # fmt: skip
    curves = characterise(tmp_path / "a.tdms", Layout.loads(proposal.text))
    assert curves.friction_n.to_numpy() == pytest.approx(20.0, abs=0.2)


def test_a_tdms_header_that_states_more_samples_than_memory_is_refused(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    path = tmp_path / "a.tdms"
    columns = {"Time": np.arange(1000) * 0.01, "Note": ["a"] * 1000}
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("rig", name, values) for name, values in columns.items()])
    stated, hostile = (struct.pack("<IIQ", 0x20, 1, count) for count in (1000, 10**12))  # texts, one dimension
    assert path.read_bytes().count(stated) == 1
    path.write_bytes(path.read_bytes().replace(stated, hostile))
    with pytest.raises(RecordingError, match="unpacks to 8,000,000,008,000 bytes"):
        propose_layout(path)
