"""Circuits on the command line: the file decides; commands have names; what there is can be listed."""

from __future__ import annotations

from pathlib import Path

import polars as pl

from pneudrive.describe.kinds import component_kinds

EXAMPLE = str(Path(__file__).parents[2] / "examples" / "two_cylinders.toml")


def test_a_circuit_file_is_simulated(tmp_path, printed):
    out, picture = tmp_path / "run.parquet", tmp_path / "run.svg"
    commands = ["--command", "valve_l: 0 s: 1, 0.5 s: -1", "--command", "valve_r: 0.4"]
    said = printed(["simulate", EXAMPLE, *commands, "--duration", "0.3 s", "--out", out, "--plot", picture])
    assert said.startswith("two cylinders on one tank: 301 samples to 0.3 s")
    assert "left.position   0.000 mm" in said
    columns = pl.read_parquet(out)
    assert columns["left.position_m"][-1] > columns["right.position_m"][-1] > 0.001
    assert columns["valve_r.command"][-1] == 0.4
    assert "fc_la" not in picture.read_text()  # it has no position, pressure or force of its own
    assert picture.stat().st_size > 10_000


def test_commands_need_the_name_of_a_valve(refusal):
    for drive, commands, said in (
        (EXAMPLE, ["0 s: 1"], "must name one of: valve_l, valve_r"),
        (EXAMPLE, ["valv_l: 0 s: 1"], "Did you mean 'valve_l'?"),
        (EXAMPLE, ["valve_l: 0 s: 2"], "valve_l: command = 2 at 0 s"),
        (EXAMPLE, ["valve_l: 1", "valve_l: 0"], "two commands are given for valve_l"),
        ("catalogue:reference", [], "the command of the valve is missing"),
        ("catalogue:reference", ["1", "0"], "a drive has one valve"),
    ):
        options = [option for command in commands for option in ("--command", command)]
        refusal(["simulate", drive, "--duration", "0.1 s", *options], said)


def test_components_are_listed(printed, refusal):
    listed = printed(["components"])
    assert all(f"\n  {kind} " in f"\n{listed}" for kind in component_kinds())
    for kind, entry in component_kinds().items():
        shown = printed(["components", kind])
        assert entry["doc"] in shown
        assert all(f"\n  {parameter['key']} " in shown for parameter in entry["parameters"])
        assert all(f"{{{source}," in shown for source in entry["sources"])
        assert ("deg, not less than -90 deg and not more than 90 deg" in shown) is ("  incline " in shown)
    refusal(["components", "flow-controls"], "Did you mean 'flow-control'?")
