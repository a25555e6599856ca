"""The chain closes: rig with a hidden truth, campaign, characterise, apply, simulate; one command each (synthetic)."""

from __future__ import annotations

import re
import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from oracle.rig_faults import with_friction
from pneudrive.cli.main import run
from pneudrive.rig import SimulatedRig, sweep
from trials.chain_coverage import WIDEST, hits

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
PROTOCOL = (Path(__file__).parents[1] / "data" / "hidden_truth.toml").read_text("utf-8")
DRIVE = (Path(__file__).parents[1] / "data" / "axis_of_the_chain.toml").read_text("utf-8")
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
def chain(tmp_path_factory, undrawn):
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


def test_a_fit_of_the_campaign_applies_all_that_characterise_does(chain, refusal):
    out = str(chain / "curve.toml")
    assert run(["fit", str(chain / "c"), "--laws", "stribeck gaussian", "--pressure", "linear", "--out", out]) == 0
    assert run(["apply", out, str(chain / "drive.toml"), "--out", str(chain / "again.toml")]) == 0
    drives = [(chain / name).read_text("utf-8") for name in ("again.toml", "applied.toml")]
    assert len({re.sub(r'(fit|file) = "[^"]+"', "", text) for text in drives}) == 1  # but for the fit's file
    circuit = Path(__file__).parents[2] / "examples/two_cylinders.toml"
    assert "circuit" in refusal(["apply", out, str(circuit), "--out", str(chain / "circuit.toml")])


# --- From the simulated rig to parameters: recordings with noise, characterised and fitted, give the truth back.


def test_truth_lies_in_intervals_that_are_hardly_wider_than_the_bound():
    """A sample; the fractions of 100 runs are those of ``make trials``."""
    held, ratios = hits(range(5))
    assert np.mean(list(held.values())) >= 0.9, held
    assert all(0.75 <= ratio <= WIDEST for ratio in ratios.values()), ratios


@pytest.mark.parametrize("law", ["stribeck", "lugre"])
def test_friction_of_every_point_lies_within_its_u(law):
    rig = SimulatedRig.default()
    rig = with_friction(rig, law, bristle_stiffness=2e6, bristle_damping=200.0) if law == "lugre" else rig
    recordings = sweep(rig, np.geomspace(1e-3, 0.45, 8), [0.0, 0.5e5, 1.5e5, (0.3e5, 1.2e5)], count=2, seed=11)
    curves = pn.characterise(recordings)
    true = np.repeat([recording.truth["friction_n"] for recording in recordings], 2)
    error = curves["friction_n"].to_numpy() - true
    expanded = 2.0 * np.hypot(curves["stderr_n"].to_numpy(), curves["u_systematic_n"].to_numpy())
    assert curves.sizes["row"] == 2 * len(recordings)
    assert np.all(np.abs(error) <= expanded)
    assert np.max(np.abs(error)) < 0.05


def test_pressure_slopes_come_back():
    speeds = np.geomspace(1e-3, 0.45, 10)
    gauges = [(0.0, 0.0), (1.5e5, 0.0), (0.0, 1.5e5), (1e5, 1e5)]
    rig = SimulatedRig.default()
    curves = pn.characterise(sweep(rig, speeds, gauges, count=2, seed=12))
    fit = pn.fit_friction(curves, pressure_dependence=True)
    assert fit.undetermined == ()
    for name, value in rig.description.friction["pressure"].items():
        assert fit.parameters[name] == pytest.approx(value, rel=0.05)
        assert abs(fit.parameters[name] - value) <= max(fit.expanded_uncertainty(name), 1e-9)
