"""A folder of somebody else: it is not believed, and it moves nothing outside itself."""

from __future__ import annotations

import io
import os
import random
import shutil
import struct
import time
import zipfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import polars as pl
import pytest

from pneudrive.control.benchmarks import SO_FAR
from pneudrive.control.motion import reference
from pneudrive.errors import CommandError, PneudriveError
from pneudrive.files.writing import make_subfolder, open_to_append
from pneudrive.report.page import FIGURES, Report
from pneudrive.signals.columns import family_of, header_unit, split_name
from pneudrive.signals.layout import labels_from_name
from pneudrive.signals.text_table import TextForm, read_preamble
from pneudrive.simulation.trajectory import whole
from pneudrive.units import parse
from pneudrive.web.drive.description import edited
from pneudrive.web.drive.run_request import RunRequest
from pneudrive.web.signatures import SIGNATURES
from pneudrive.web.workspace import ChangedError, Workspace
from web.conftest import DRIVE, Served
from web.frames import unpack
from web.test_recordings import read

INPUTS = Path(__file__).parent / "inputs"
CSV = "time,force\n" + "".join(f"{at * 0.01:.2f},{at % 7}\n" for at in range(3000))


def force_of(served: Served, name: str) -> list[float]:
    key = read(served, name)["key"]
    ask = {"what": "window", "path": name, "key": key, "from": 0, "to": 1, "pixels": 800, "columns": "force"}
    with served.client.websocket_connect("/api/live", **served.socket) as socket:
        socket.send_json(ask)
        return list(unpack(socket.receive_bytes())[1]["force"])


def files_in(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_forged_cache_of_a_folder_is_not_believed(served: Served, cache: Path) -> None:
    """The old place in the folder, links included, is neither read nor written; the cache is for this user alone."""
    elsewhere = served.folder.parent / "elsewhere"
    elsewhere.mkdir()
    (served.folder / ".pneudrive").mkdir()
    (served.folder / ".pneudrive" / "cache").symlink_to(elsewhere)
    (served.folder / "a.csv").write_text(CSV)
    assert max(force_of(served, "a.csv")) <= 6.0
    assert not any(elsewhere.iterdir())
    (made,) = cache.rglob("table-*.parquet")
    assert cache.stat().st_mode & 0o077 == 0
    forged = elsewhere / made.parent.name
    shutil.copytree(made.parent, forged)
    pl.read_parquet(made).with_columns(force=pl.lit(99999.0)).write_parquet(forged / made.name)
    assert max(force_of(served, "a.csv")) <= 6.0


def test_a_file_that_changes_in_its_middle_is_read_again(served: Served, cache: Path) -> None:
    """Size, both ends and the time of the file may be the same, as in a copy that somebody prepared."""
    place = served.folder / "a.csv"
    text = "time,force\n" + "".join(f"{at * 0.01:.2f},{at % 7}\n" for at in range(40_000))
    place.write_text(text)
    before, known = read(served, "a.csv")["key"], place.stat()
    middle = len(text) // 2
    at = text.index("\n", middle) - 1
    place.write_text(text[:at] + "9" + text[at + 1 :])
    os.utime(place, ns=(known.st_atime_ns, known.st_mtime_ns))
    assert place.stat().st_size == known.st_size
    assert read(served, "a.csv")["key"] != before


def test_writers_replace_a_link_and_never_follow_it(tmp_path: Path) -> None:
    own, folder = tmp_path / "own", tmp_path / "foreign"
    for place in (own, folder):
        place.mkdir()
    (own / "precious.txt").write_text("precious")
    for name in ("report.html", SO_FAR, "new.txt"):
        (folder / name).symlink_to(own / "precious.txt")
    (folder / FIGURES).symlink_to(own)
    before = files_in(own)
    with whole(folder / "new.txt") as temporary:
        temporary.write_text("ours")
    assert (folder / "new.txt").read_text() == "ours"
    for write in (
        lambda: open_to_append(folder / SO_FAR),
        lambda: make_subfolder(folder / FIGURES),
        lambda: Report("title", [], []).write(folder),
    ):
        with pytest.raises(CommandError, match="is a link"):
            write()
    assert files_in(own) == before


def test_names_of_unfinished_files_cannot_be_foreseen(tmp_path: Path) -> None:
    names = set()
    for _ in range(3):
        with whole(tmp_path / "a.csv") as temporary:
            temporary.write_text("1")
            names.add(temporary.name)
    assert len(names) == 3


@pytest.mark.parametrize("is_new", [True, False])
@pytest.mark.parametrize("servers", [1, 2])
def test_of_savers_who_know_the_same_text_one_succeeds(served: Served, is_new: bool, servers: int) -> None:
    """The first of them may write the very text that is there: the others are told even so."""
    places = [Workspace.at(served.folder) for _ in range(servers)]
    for turn in range(8):
        name = f"new-{turn}.toml" if is_new else "axis.toml"
        known = None if is_new else places[0].read(name)[1]
        text = "" if is_new else places[0].read(name)[0]

        def save(index: int, name: str = name, text: str = text, known: str | None = known) -> bool:
            try:
                places[index % servers].write(name, f"{text}# {index} {'x' * 5000}\n", known)
            except ChangedError:
                return False
            return True

        with ThreadPoolExecutor(8) as pool:
            assert sum(pool.map(save, range(8))) == 1


def test_empty_lines_do_not_stop_the_server(served: Served) -> None:
    for name, text in {
        "blank": "\n" * 60_000,
        "spaces": " " * 60_000,
        "rows": " \n" * 30_000,
        "crlf": "\r\n" * 30_000,
    }.items():
        (served.folder / f"{name}.toml").write_bytes(f"{text}x = 1\n".encode())
    begin = time.process_time()
    kinds = {one.path: one.kind for one in Workspace.at(served.folder).files()}
    assert time.process_time() - begin < 0.5
    assert kinds["blank.toml"] == "other"
    (served.folder / "late.toml").write_text("\n" * 1000 + "[ columns ]\n")
    assert {one.path: one.kind for one in Workspace.at(served.folder).files()}["late.toml"] == "layout"


def damaged_fmus() -> dict[str, bytes]:
    """Return archives whose data are no deflate stream, whose text has an unknown encoding, and that are cut."""
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", "<fmiModelDescription " + "a" * 300)
    whole_one = bytearray(memory.getvalue())
    start = 30 + len("modelDescription.xml")
    memory = io.BytesIO()
    with zipfile.ZipFile(memory, "w") as archive:
        archive.writestr("modelDescription.xml", '<?xml version="1.0" encoding="no-such-code"?><fmiModelDescription/>')
    broken = whole_one[:start] + bytes([255] * 8) + whole_one[start + 8 :]
    return {"zlib.fmu": bytes(broken), "encoding.fmu": memory.getvalue(), "cut.fmu": bytes(whole_one[:60])}


#: Addresses that take a file.
OF_FILES = ("validation", "view", "behind", "next", "lineage", "map", "slice", "sizing", "comparison")
OF_OTHERS = ("tracks", "campaign", "cycle", "fmu", "control", "recording", "strokes", "spectrum", "propose", "file")
#: Addresses that take a table.
OF_TABLES = ("check", "edit", "drawing", "copy", "measure", "compare", "task", "work", "jobs", "cancel", "campaign")
OF_PLANS = ("plan", "comparisons", "campaigns")


@pytest.mark.parametrize(
    ("kind", "address"), [("validation", "/api/validation"), ("validation", "/api/view"), ("fit", "/api/view")]
)
def test_an_incomplete_result_is_one_message(served: Served, kind: str, address: str) -> None:
    """Whichever line is missing, cut or of another kind: an answer in words, and the list of files stays whole."""
    whole_text = (INPUTS / f"{kind}.toml").read_text("utf-8")
    lines, random_numbers = whole_text.splitlines(), random.Random(3)
    place = served.folder / f"{kind}.toml"
    texts = ["\n".join(lines[:at] + lines[at + 1 :]) for at in range(len(lines))]
    texts += ["\n".join(lines[:at]) for at in range(0, len(lines), 5)]
    for at, line in enumerate(lines):
        if " = " in line:
            value = random_numbers.choice(['"x"', "[]", "{}", "1e400", "9" * 400, "nan", "[[1]]", "true", "[{}]"])
            texts.append("\n".join([*lines[:at], f"{line.partition(' = ')[0]} = {value}", *lines[at + 1 :]]))
    for text in texts:
        place.write_text(text)
        answer = served.client.get(address, params={"path": place.name}, headers=served.headers)
        assert answer.status_code in (200, 400)
        if answer.status_code == 400:
            (problem, *_) = answer.json()["problems"]
            assert problem["what"]
            assert "a fault of pneudrive" not in problem["what"]
    place.write_text("\n".join(line for line in lines if not line.startswith(("notes", "version"))))
    answer = served.client.get(address, params={"path": place.name}, headers=served.headers)
    assert answer.status_code == 400 or kind == "fit"


def test_damaged_files_of_any_kind_are_answered_in_words(served: Served) -> None:
    """Every address that takes a file, with every kind of damage: never an exception."""
    files = {
        **damaged_fmus(),
        "empty.toml": b"",
        "bytes.toml": b"\xff\xfe\x00",
        "deep.toml": b"a = " + b"[" * 3000 + b"]" * 3000,
        "digits.toml": b"[friction]\ncoulomb = " + b"9" * 400 + b"\n",
        "law.toml": b"law = 3\n[covariance]\n",
        "map.csv": b"speed_m_s,friction_n\n1,\nx,2\n",
        "columns.csv": b"time,time,,\n1,2,3,4,5\n",
        "map.parquet": b"PAR1" + struct.pack("<I", 2**31 - 1) + b"PAR1",
        "run.mat": b"MATLAB 5.0 MAT-file" + bytes(300),
        "run.h5": b"\x89HDF\r\n\x1a\n" + bytes(100),
    }
    for name, content in files.items():
        (served.folder / name).write_bytes(content)
    for folder, name in (("campaign", "campaign.json"), ("comparison", "comparison.json"), ("sizing", "sizing.json")):
        (served.folder / folder).mkdir()
        for own in (name, "rig.json"):
            (served.folder / folder / own).write_text('{"schema": 1, "laws": 3}')
    for path in [*files, "campaign", "comparison", "sizing", "none.toml", "", "a" * 3000, "\0", "../x"]:
        for address in (*OF_FILES, *OF_OTHERS):
            more = {"path": path, "speed": "9" * 400, "pixels": "800", "fit": path, "reference": path, "measure": path}
            answer = served.client.get(f"/api/{address}", params=more, headers=served.headers)
            assert answer.status_code in (200, 400), (path[:20], address)
            assert "a fault of pneudrive" not in answer.text[:2000], (path[:20], address)


def test_odd_requests_are_answered_in_words(served: Served) -> None:
    """Bodies of any JSON: never an exception."""
    odd: list[object] = [None, 3, "x", [], {}, {"path": 1}, {"path": []}, {"path": {}}, {"path": "axis.toml"}]
    values = (None, 3, "9" * 5000, [], [3], [[]], {}, {"a": []}, True, 1e308)
    keys = ("text", "kind", "values", "columns", "name", "drive", "laws", "command", "duration", "initial", "after")
    odd += [{"path": "axis.toml", "before": "axis.toml", key: value} for key in keys for value in values]
    work = {"path": "axis.toml", "name": [], "drive": {}, "recordings": [[]], "law": 3, "to": {}, "spread": 3}
    odd += [work | {"kind": kind} for kind in (*SIGNATURES, {}, [])]
    for body in odd:
        for address in (*OF_TABLES, *OF_PLANS):
            answer = served.client.post(f"/api/{address}", json=body, headers=served.headers)
            assert answer.status_code in (200, 400), (address, body)
            assert "a fault of pneudrive" not in answer.text[:2000], (address, body)
    for body in (b"", b"{", b"\xff", b"[" * 5000, b'{"path": "\\ud800"}'):
        answer = served.client.post("/api/check", content=body, headers=served.headers)
        assert answer.status_code == 400


LONG = 20_000


@pytest.mark.parametrize(
    "read",
    [
        lambda: parse(f"{'1' * LONG},", "m"),
        lambda: parse(f"1{' ' * LONG}m{' ' * LONG}!", "m"),
        lambda: reference(f"sine {'1' * LONG}"),
        lambda: edited(DRIVE, "friction.coulomb", f"{'1' * LONG}!"),
        lambda: labels_from_name("{a}{b}{c}{d}{e}{f}{g}{h}{i}x", "y" * 250),
        lambda: split_name(f"force a{'-' * LONG}b"),
        lambda: split_name(f"force{'(a' * LONG}"),
        lambda: header_unit(f"force a{' ' * LONG}b"),
        lambda: family_of(f"{'1' * LONG}a1"),
        lambda: read_preamble([f"{'sampl' * LONG}!"], TextForm(), 3),
        lambda: RunRequest.of({"path": "catalogue:reference", "command": f"{' ' * LONG}x", "duration": "1 s"}),
        lambda: RunRequest.of({"path": "catalogue:reference", "command": f"{' ' * LONG}x.csv", "duration": "1 s"}),
    ],
    ids=[
        *("digits", "blanks", "sine", "edit", "labels", "column", "brackets", "unit", "family"),
        *("preamble", "command", "command file"),
    ],
)
def test_no_text_takes_quadratic_time(read: Callable[[], object]) -> None:
    """Quadratic time would be 3 s or more, and the labels some 1e15 ways to split a name."""
    begin = time.process_time()
    with suppress(PneudriveError):
        read()
    assert time.process_time() - begin < 2.0
