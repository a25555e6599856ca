"""A drive for other tools from the page: the FMU is that of command and Python, and the page shows what is in it."""

from __future__ import annotations

import shlex
import zipfile
from hashlib import sha256
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.cli.main import run as run_command
from web.conftest import Served
from web.test_friction import post
from web.test_recordings import get

ASKED = {"kind": "export", "drive": "axis.toml", "to": "fmu", "fmi": "3.0", "initial": "position = 50 mm", "name": "x"}


@pytest.mark.parametrize("change", [{}, {"fmi": "2.0", "actuator": True, "initial": ""}])
def test_page_command_and_python_write_the_same_fmu(
    served: Served, monkeypatch: pytest.MonkeyPatch, change: dict
) -> None:
    copied = post(served, "/api/work", ASKED | change)
    monkeypatch.chdir(served.folder)
    Path("results").mkdir()
    assert run_command(shlex.split(copied["command"].splitlines()[-1])[1:]) == 0
    by_command = Path("results/x.fmu").read_bytes()
    names: dict = {}
    exec(copied["python"], names)
    done = names["done"]
    assert Path("results/x.fmu").read_bytes() == by_command
    shown = get(served, "/api/fmu", path="results/x.fmu")
    assert shown["sha256"] == sha256(by_command).hexdigest()
    assert (shown["version"], shown["token"]) == (done.version, done.token)
    for causality in ("inputs", "outputs", "parameters"):
        own = [(one.name, one.unit, one.meaning) for one in getattr(done, causality)]
        seen = [one for one in shown["variables"] if f"{one['causality']}s" == causality]
        assert [(one["name"], one["unit"], one["meaning"]) for one in seen] == own
        starts = [one.start for one in getattr(done, causality)]
        assert [float(one["start"]) if one["start"] else None for one in seen] == starts
    assert ("CoSimulation" in shown["kinds"]) is not bool(change)
    assert get(served, "/api/studies")["files"][-1]["kind"] == "fmu"


@pytest.mark.parametrize(
    "change",
    [
        {"drive": "missing.toml"},
        {"drive": "../axis.toml"},
        {"drive": 3},
        {"to": "simscape"},
        {"fmi": "1.0"},
        {"name": "a/b"},
        {"name": "\U0001d49c" * 81},
        {"initial": ["position"]},
    ],
)
def test_a_wrong_request_starts_nothing(served: Served, change: dict) -> None:
    assert post(served, "/api/jobs", ASKED | change, 400)["problems"]
    assert not served.jobs


def test_what_is_no_fmu_is_answered_in_words(served: Served) -> None:
    path = served.folder / "x.fmu"

    def said() -> str:
        answered = served.client.get("/api/fmu", params={"path": "x.fmu"}, headers=served.headers)
        assert answered.status_code == 400
        return answered.json()["problems"][0]["what"]

    path.write_text("no archive")
    assert "is not an FMU" in said()
    bomb = '<!DOCTYPE a [<!ENTITY b "bbbbbbbb"><!ENTITY c "&b;&b;">]><fmiModelDescription modelName="&c;"/>'
    for text in (bomb.encode(), bomb.encode("utf-16"), b"<fmi", b" " * 17_000_000):
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("modelDescription.xml", text)
        assert "x.fmu" in said()
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("other.xml", "<a/>")
    assert "is not an FMU" in said()
    assert pn.export_fmu(pn.Drive.load("catalogue:reference"), path).token in str(get(served, "/api/fmu", path="x.fmu"))
