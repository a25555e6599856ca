"""Several and switching valves under a law, and the choice of an observer: from files to runs, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.errors import CommandError, DescriptionError

AXES = Path(__file__).parents[2] / "examples"
SWITCHING = AXES / "axes/switching.toml"
MOVE = "240 mm; 50 ms: 245 mm in 0.15 s"


def test_numbers_of_switching_valves_go_through_a_file_into_a_run(tmp_path):
    drive = pn.Circuit.load(SWITCHING)
    tuning = pn.control.tune(drive, "inversion")
    assert tuning.plant.valves == ["in_a", "out_a", "in_b", "out_b"]
    file = tmp_path / "controller.toml"
    file.write_text('schema = 1\nlaw = "inversion"\n[valves]\nstiffness = "1.6 N/mm"\n')
    given = pn.control.tune(drive, controller=file)
    told = {one.key: one.value for one in given.numbers if one.given}
    assert told == {"stiffness": pytest.approx(1600.0)}
    given.save(tmp_path / "again.toml")
    again = pn.control.tune(drive, controller=tmp_path / "again.toml")
    assert again.core() == given.core()
    run = pn.control.run(drive, reference=MOVE, controller=file, duration="0.25 s")
    commands = np.array([run[f"{name}.command"] for name in tuning.plant.valves])
    assert set(np.unique(commands)) == {0.0, 1.0}
    assert not (commands[0] * commands[1]).any(), "a chamber is never filled and vented"
    assert float(run.position[-1] - run.position[0]) > 2e-3, "it moves"


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('[valves]\nstiffnes = "2 N/mm"', "valves.stiffnes is no gain of these valves"),
        ('[valves]\nstiffness = "-2 N/mm"', "out of bounds"),
    ],
)
def test_a_wrong_number_of_valves_is_told_with_its_place(tmp_path, text, says):
    file = tmp_path / "controller.toml"
    file.write_text(f'schema = 1\nlaw = "inversion"\n{text}\n')
    with pytest.raises(DescriptionError) as caught:
        pn.control.tune(pn.Circuit.load(SWITCHING), controller=file)
    assert says in str(caught.value)
    assert "controller.toml" in str(caught.value)


def test_the_screen_has_the_numbers_of_the_file(capsys):
    assert run(["control", "tune", str(SWITCHING)]) == 0
    said = capsys.readouterr().out
    assert all(gain.key in said for gain in pn.control.tune(pn.Circuit.load(SWITCHING)).numbers)


def test_what_has_no_several_valves_says_so(tmp_path):
    file = tmp_path / "controller.toml"
    file.write_text('schema = 1\nlaw = "inversion"\n[valves]\nstiffness = "2 N/mm"\n')
    with pytest.raises(DescriptionError, match=r"the drive one proportional 5/3 valve"):
        pn.control.tune(pn.Circuit.load(AXES / "controlled_axis.toml"), controller=file)
    tuning = pn.control.tune(pn.Circuit.load(SWITCHING), "inversion")
    with pytest.raises(CommandError, match="one command"):
        pn.control.export(tuning, "c", tmp_path / "law")
    with pytest.raises(CommandError, match="one command"):
        pn.control.export(tuning, "fmu", tmp_path / "law.fmu")
    with pytest.raises(DescriptionError, match="no spool that could deviate"):
        pn.control.run(pn.Circuit.load(SWITCHING), "inversion", reference=MOVE, mismatch="slow-spool")


def test_tune_says_what_no_observer_tells_apart():
    drive = pn.Circuit.load(AXES / "controlled_axis.toml")
    said = {setup: " ".join(pn.control.tune(drive, "inversion", setup=setup).limits) for setup in ("real", "cheap")}
    assert "friction that differs between the directions" in said["real"]
    assert "not both pressures" not in said["real"]
    assert "At rest the position tells the force of the gas, not both pressures" in said["cheap"]


@pytest.mark.parametrize("at", [[], ["2 s"]])
def test_switching_valves_tell_of_a_fallen_supply_and_of_no_other(at):
    """What a sensor tells late of a chamber that has just been shut is the flow before, no filling that fails."""
    told = pn.control.Setup(faults=[{"kind": "supply-fallen", "at": one, "value": "3 bar"} for one in at]).faults
    setup = pn.control.read_setup("real")[0].model_copy(update={"faults": told})
    run = pn.control.run(pn.Circuit.load(SWITCHING), "inversion", reference="R3", setup=setup, duration="7 s", seed=1)
    supplies = [one for one in run.attrs["events"] if one["kind"] == "supply"]
    assert len(supplies) == len(at)
    assert all(2.0 < one["time_s"] < 4.5 and one["value"] < 4.5e5 for one in supplies)


def test_a_valve_whose_flow_is_a_table_is_refused_with_a_way_out(tmp_path):
    """The remedy is not to add a conductance: a description takes one of the two."""
    text = (AXES / "controlled_axis.toml").read_text()
    points = (
        '{ opening = -1, supply_2 = "2 dm3/(s bar)" }, { opening = 0 }, { opening = 1, supply_4 = "2 dm3/(s bar)" }'
    )
    text = text.replace('conductance = "2 dm3/(s bar)"', f"flow_table = [{points}]")
    for key in ("overlap = 0.02", "leakage = 0.003"):
        text = text.replace(key, "")
    (tmp_path / "table.toml").write_text(text)
    with pytest.raises(DescriptionError, match=r"valve has a flow_table[\s\S]*in place of the table"):
        pn.control.tune(pn.Circuit.load(tmp_path / "table.toml"))
