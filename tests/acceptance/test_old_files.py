"""Files that earlier versions wrote load, and give the numbers that they gave (tests/old_files, named by commit).

``expected.json`` holds what version f77d3a3 read from both folders. Where a number moves on purpose, it stands in the
CHANGELOG under "Numbers that move", and ``python tests/acceptance/test_old_files.py`` writes the numbers anew.
"""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Callable
from pathlib import Path
from subprocess import run

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.campaign.planning.plan import lay_out
from pneudrive.campaign.planning.protocol import read_protocol
from pneudrive.characterise import read_map
from pneudrive.identify import FrictionFit, LawFit
from pneudrive.identify.dynamic import DriveFit
from pneudrive.rig import SimulatedRig, sweep

OLD = Path(__file__).parents[1] / "old_files"
EXPECTED = OLD / "expected.json"
VERSIONS = sorted(folder.name for folder in OLD.iterdir() if folder.is_dir())
RECORDING = Path(__file__).parents[2] / "data/measurements/zillen-2021-pneumatic-piston/friction/PK_3bar.csv.xz"


def drive(folder: Path) -> dict[str, object]:
    run = pn.simulate(pn.Drive.load(folder / "drive.toml"), 0.4, "0.1 s")
    return {"end_m": run.position[-1], "pressure_a_pa": run.pressure_a[-1]}


def rig(folder: Path) -> dict[str, object]:
    made = SimulatedRig.load(folder / "rig.toml")
    session = made.session()
    plan = lay_out(read_protocol(folder / "protocol.toml"), session.identity(), session.limits())
    rows = pn.characterise(sweep(made, speeds_m_s=[0.05], gauges_pa=[0.5e5], count=1, seed=1))
    return {"cycles": len(plan.cycles), "friction_n": rows.friction_n[0]}


def recording(folder: Path) -> dict[str, object]:
    rows = pn.characterise(RECORDING, layout=folder / "layout.toml")
    return {"rows": rows.sizes["row"], "friction_n": np.sum(rows.friction_n)}


def friction_map(folder: Path) -> dict[str, object]:
    rows = read_map(folder / "map.parquet")
    fit = FrictionFit.from_toml(folder / "map-fit.toml")
    applied = fit.apply(pn.Drive.load(folder / "drive.toml")).friction
    return {
        "rows": rows.sizes["row"],
        "friction_n": np.sum(rows.friction_n),
        "systematic_n": np.sum(rows.u_systematic_n),
        "at_20_mm_s_n": fit.predict([0.02]).friction_n[0],
        "applied_coulomb_n": applied.parameters["coulomb"],
    }


def law_fit(folder: Path) -> dict[str, object]:
    fit = LawFit.from_toml(folder / "law-fit.toml")
    return {**fit.parameters, "applied": fit.apply(pn.Drive.load(folder / "drive.toml")).friction.parameters["coulomb"]}


def identified(folder: Path) -> dict[str, object]:
    fit = DriveFit.from_toml(folder / "identified.toml")
    return {**fit.values, "low_n": fit.intervals["friction.coulomb"][0], "bore_m": fit.apply().cylinder.bore_m}


def campaign(folder: Path) -> dict[str, object]:
    found = pn.campaign_friction(folder / "campaign")
    return {
        "curves": len(found.curves),
        "friction_n": np.sum([np.sum(curve.friction_n) for curve in found.curves]),
        "width_n": np.sum([np.sum(curve.high_n - curve.low_n) for curve in found.curves]),
        "peaks_n": np.sum(found.stops["increment_n"].to_numpy()),
        "map_rows": found.friction_map.sizes["row"],
    }


READERS = (drive, rig, recording, friction_map, law_fit, identified, campaign)


def numbers(folder: Path, reader: Callable[[Path], dict[str, object]]) -> dict[str, float]:
    return {name: float(value) for name, value in reader(folder).items()}


@pytest.mark.parametrize("reader", READERS)
@pytest.mark.parametrize("version", VERSIONS)
def test_old_files_give_the_same_numbers(version, reader):
    expected = json.loads(EXPECTED.read_text("utf-8"))[version]
    if reader.__name__ not in expected:
        pytest.skip("this version had no such file")
    assert numbers(OLD / version, reader) == pytest.approx(expected[reader.__name__], rel=1e-9)


if __name__ == "__main__":
    found = {
        version: {
            reader.__name__: numbers(OLD / version, reader)
            for reader in READERS
            if reader is not law_fit or (OLD / version / "law-fit.toml").exists()
        }
        for version in VERSIONS
    }
    EXPECTED.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


# --- The current folder has no say in pictures: settings of matplotlib that lie in it are not read.

DRAW = (Path(__file__).parents[1] / "data" / "old_files_draw.txt").read_text("utf-8")
FOREIGN = {
    "bytes": b"\xff\xfe",
    "latex and sizes": b"text.usetex: True\ntext.latex.preamble: \\input{x}\nfont.size: 40\nlines.linewidth: 9\n"
    b"svg.fonttype: none\naxes.prop_cycle: cycler(color=['r'])\n",
}


def drawn(folder: Path, how: str) -> bytes:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MATPLOTLIB")}
    line = [sys.executable, "-c", DRAW, how]
    done = run(line, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return (folder / "a.svg").read_bytes()


@pytest.mark.parametrize(("how", "foreign"), [("command", "latex and sizes"), ("python", "bytes")])
def test_pictures_are_the_same_in_every_folder(tmp_path: Path, how: str, foreign: str) -> None:
    pictures = set()
    for name, settings in (("none", None), (foreign, FOREIGN[foreign])):
        folder = tmp_path / name
        folder.mkdir()
        if settings is not None:
            (folder / "matplotlibrc").write_bytes(settings)
        pictures.add(drawn(folder, how))
    assert len(pictures) == 1
