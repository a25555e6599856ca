"""The chain closes: rig with a hidden truth, campaign, characterise, apply, simulate; one command each (synthetic)."""

from __future__ import annotations

import re
import tomllib
import warnings

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.identify.static.result import FrictionFit

LAW = {
    "coulomb": "14 N",
    "breakaway": "19 N",
    "stribeck_velocity": "12 mm/s",
    "stribeck_exponent": "2",
    "viscous": "22 N s/m",
    "bristle_stiffness": "2e6 N/m",
    "bristle_damping": "300 N s/m",
}
BESIDE = {
    "pressure.coulomb": {"a": "2.4 N/bar", "b": "1.5 N/bar"},
    "pressure.breakaway": {"a": "2.6 N/bar", "b": "1.9 N/bar"},
    "dwell": {"growth": "log", "increment": "0.8 N", "time": "0.3 s", "distance": "150 um"},
    "direction": {"positive": "1.04", "negative": "0.96"},
    "position": {"slope": "0.6 1/m", "reference": "100 mm"},
}
PROTOCOL = """
schema = 1
name = "Hidden truth"
about = "all that acts on friction, at once"
seed = 3
directions = "both"
repeats = 2

[speed]
from = "2 mm/s"
to = "300 mm/s"
count = 7
settled_time = "0 s"

[pressure]
pairs = [
    { a = "0 bar gauge", b = "0 bar gauge" },
    { a = "2 bar gauge", b = "0 bar gauge" },
    { a = "0 bar gauge", b = "2 bar gauge" },
]
settling = "2 s"

[stop]
durations = ["0.3 s", "2 s", "10 s", "60 s"]
restart_speed = "1 mm/s"
approach = "5 mm"
recovery = "10 mm"
preconditioning = { strokes = 1, speed = "200 mm/s" }

[sampling]
samples_per_stroke = 400
burst_rate = "5 kHz"

[before_block]
tare = "2 s"
"""
DRIVE = """
name = "Axis"
[supply]
pressure = "6 bar gauge"
[cylinder]
kind = "rodless"
bore = "25 mm"
stroke = "300 mm"
dead_volume = { a = "5 cm3", b = "5 cm3" }
moving_mass = "2 kg"
[valve]
kind = "proportional-5/3"
conductance = "0.4 dm3/(s bar)"
critical_pressure_ratio = 0.3
[friction]
law = "lugre"
coulomb = "10 N"
breakaway = "13 N"
stribeck_velocity = "20 mm/s"
viscous = "10 N s/m"
bristle_stiffness = "2e6 N/m"
bristle_damping = "300 N s/m"
"""
# A rest of 20 s, then slow strokes both ways, where friction decides.
COMMAND = "0 s: 0, 20 s: 0.012, 22 s: -0.012, 24 s: 0.03, 25 s: -0.03, 26 s: 0"


def rig_file() -> str:
    """Write the truth as a rig file states it."""
    lines = ['schema = 1\nextends = "default"\nname = "Hidden truth"\n[friction]\nlaw = "lugre"']
    lines += [f'{key} = {{ value = "{text}", source = "assumed", reason = "truth" }}' for key, text in LAW.items()]
    for key, table in BESIDE.items():
        head, _, last = key.partition(".")
        if last:
            inside = ", ".join(f'{chamber} = "{text}"' for chamber, text in table.items())
            lines.append(
                f'[friction.{head}.{last}]\n{inside.replace(", ", chr(10))}\nsource = "assumed"\nreason = "truth"'
            )
        else:
            lines.append(f"[friction.{key}]")
            lines += [f'{k} = {{ value = "{v}", source = "assumed", reason = "truth" }}' for k, v in table.items()]
    return "\n".join(lines)


def true_drive(drive: pn.Drive) -> pn.Drive:
    def plain(text: str) -> object:
        try:
            return float(text)
        except ValueError:
            return text

    changes: dict[str, object] = {f"friction.{key}": plain(text) for key, text in LAW.items()}
    for key, table in BESIDE.items():
        changes[f"friction.{key}"] = {k: plain(v) for k, v in table.items()}
    return drive.replace(changes)


def motion(drive: pn.Drive) -> np.ndarray:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # fast transients of this bristle set are told as not passive
        ran = pn.simulate(drive, COMMAND, "27 s", initial={"position": "100 mm"}, sample_rate="100 Hz")
    return np.asarray(ran.position)


def moved(drive: pn.Drive, name: str, value: object) -> pn.Drive:
    """Put one identified value elsewhere."""
    table, _, last = name.rpartition(".")
    if last in ("a", "b"):
        pair = drive.to_dict()["friction"]["pressure"][table.rpartition(".")[2]]
        return drive.replace({table: pair | {last: value}})
    return drive.replace({name: value})


@pytest.fixture(scope="module")
def chain(tmp_path_factory):
    folder = tmp_path_factory.mktemp("chain")
    for name, text in (("rig.toml", rig_file()), ("protocol.toml", PROTOCOL), ("drive.toml", DRIVE)):
        (folder / name).write_text(text, encoding="utf-8")
    at = {
        name: str(folder / name) for name in ("rig.toml", "protocol.toml", "drive.toml", "c", "results", "applied.toml")
    }
    assert run(["campaign", "run", at["protocol.toml"], "--rig", at["rig.toml"], "--out", at["c"], "--yes"]) == 0
    assert run(["characterise", at["c"], "--out", at["results"]]) == 0
    assert run(["apply", str(folder / "results/fit.toml"), at["drive.toml"], "--out", at["applied.toml"]]) == 0
    return folder


def test_what_was_measured_predicts_the_drive(chain):
    start, applied = pn.Drive.load(chain / "drive.toml"), pn.Drive.load(chain / "applied.toml")
    truth, guessed, predicted = motion(true_drive(start)), motion(start), motion(applied)
    error = np.abs(predicted - truth)
    intervals = tomllib.loads((chain / "applied.toml").read_text("utf-8"))["provenance"]
    parts = ("pressure.coulomb.a", "pressure.breakaway.b", "dwell.increment", "direction.positive", "position.slope")
    assert {f"friction.{part}" for part in ("coulomb", "breakaway", "viscous", *parts)} <= intervals.keys()
    reach = np.zeros_like(truth)
    for name, said in intervals.items():
        ends = [float(e) if name.endswith(("positive", "negative")) else e for e in said["interval"]]
        reach += np.max([np.abs(motion(moved(applied, name, end)) - predicted) for end in ends], axis=0) ** 2
    inside = error <= np.sqrt(reach) + 1e-5
    assert inside.mean() > 0.95
    assert np.abs(guessed - truth).max() > 3.0 * error.max()  # friction decides here, and was not known before
    assert np.sqrt(reach).max() < 10e-3


def test_a_fit_of_the_campaign_applies_all_that_characterise_does(chain):
    out = str(chain / "curve.toml")
    assert run(["fit", str(chain / "c"), "--laws", "stribeck gaussian", "--pressure", "linear", "--out", out]) == 0
    assert run(["apply", out, str(chain / "drive.toml"), "--out", str(chain / "again.toml")]) == 0
    drives = [(chain / name).read_text("utf-8") for name in ("again.toml", "applied.toml")]
    assert len({re.sub(r'fit = "\w+"', "", text) for text in drives}) == 1  # but for the hash of the fit's file
    assert run(["fit", str(chain / "c"), "--laws", "coulomb", "--direction", "+x", "--out", out]) == 0
    kept = FrictionFit.from_toml(out).dependences
    assert {"dwell", "position"} <= kept.tables.keys()
    assert "direction" not in kept.tables  # the curve of one direction has it already
