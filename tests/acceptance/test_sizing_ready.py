"""Sizing: "Take" stands only if every check is kept, and the written drive files agree when they run."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import pneudrive as pn
from pneudrive.cli.main import _plain_warnings
from pneudrive.cli.main import run as command
from pneudrive.describe.components import USUAL, unusual_sizes
from pneudrive.describe.files import toml
from pneudrive.errors import DescriptionError, PneudriveWarning, warn
from pneudrive.report.page import Paragraph, Report, Section
from pneudrive.report.sizing import sizing_sheet
from pneudrive.sizing import checks
from pneudrive.sizing.result import SizingResult
from pneudrive.sizing.search import Search, size
from pneudrive.sizing.strokes import Setting
from pneudrive.sizing.task import NO_FLOW_CONTROL, DriveChoice, SizingTask, choices
from pneudrive.views import ShownTable

DRAWS: dict[str, Any] = {"draws": 8, "draws_best": 32}
#: Of the catalogue no more than a test has time for: two rodless cylinders, two valves, a tube.
EXCLUDE = ["parker-osp-p[1238]*", "pneumax*", "ckd*", "smc-c*", "smc-mg*", "festo-[dgm]*", "smc-tu0*", "smc-tu12*"]
SLOPE: dict[str, Any] = {
    "name": "slope",
    "mass": "8 kg",
    "stroke": "400 mm",
    "max_stroke": "400 mm",
    "end_speed": "3 m/s",
    "time": "0.6 s",
    "incline": "30 deg",
    "guide": "ball",
    "supply": {"pressure": "6 bar gauge"},
    "exclude": [*EXCLUDE, "smc-sy[35]*"],
}
#: A lift by one cylinder, one valve and one tube, which have the time and the energy.
LIFT: dict[str, Any] = {
    "name": "lift",
    "mass": "15 kg",
    "stroke": "400 mm",
    "max_stroke": "400 mm",
    "end_speed": "3 m/s",
    "time": "1.2 s",
    "incline": "90 deg",
    "impact_energy": "5 J",
    "tube_length": "3 m",
    "supply": {"pressure": "6 bar gauge"},
    "exclude": ["parker*", "pneumax*", "ckd*", "smc-c[5dmy]*", "smc-cp96-[135-8][02356]*", "smc-mg*", "festo-[dgm]*"],
}
LIFT["exclude"] += ["smc-tu0[48]*", "smc-tu1*", "smc-sy[357]*"]
#: A transfer by one cylinder, whose sheet has neither side load nor life.
TRANSFER: dict[str, Any] = {
    "name": "transfer",
    "mass": "2 kg",
    "stroke": "100 mm",
    "time": "0.5 s",
    "supply": {"pressure": "6 bar gauge"},
    "exclude": ["parker*", "pneumax*", "smc-[cm]*", "ckd*", "festo-gr*", "smc-tu0[48]*", "smc-tu1*", "smc-sy[579]*"],
}


def drop_mm(found: SizingResult) -> float:
    """Return how far the lifted load of the best drive falls within a second without pressure, mm."""
    tables = found.circuit().to_dict()
    tables["components"]["supply"] |= {"pressure": "0 bar gauge"}
    start = {"cylinder.position": "400 mm", "cylinder.a": "0 bar gauge", "cylinder.b": "0 bar gauge"}
    run = pn.Circuit.model_validate(tables).simulate("0 s: 1", "1 s", initial=start)
    return 400.0 - 1e3 * float(run["cylinder.position"].values[-1])


def test_a_lift_that_nothing_holds_is_not_ready_and_falls_when_it_runs(tmp_path, capsys, monkeypatch):
    found = size(LIFT, **DRAWS)
    assert (found.feasible, found.ready) == (True, False)
    hanging = found.open_checks[0]
    assert (hanging.name, hanging.is_kept) == ("load that hangs at pressure loss", False)
    piston = found.circuit().components["cylinder"].moving_mass_kg
    assert hanging.value == pytest.approx((16.5 + piston) * 9.80665)
    assert hanging.value > hanging.limit  # type: ignore[operator]
    assert drop_mm(found) > 300.0
    assert found.answer.startswith("Not ready to order: one check of the best choice is open. SMC CP96-40")
    assert f'clamp_force = "{math.ceil(hanging.value)} N"' in hanging.finding.remedy  # a remedy that is enough
    assert hanging.finding.remedy in repr(found)  # whole, though longer than other lines of a card
    view = found.view()
    assert (view.state, view.findings[0]) == ("open", hanging.finding)

    held = size(LIFT | {"held_by": "machine"}, **DRAWS)
    assert (held.ready, held.view().state) == (True, "good")
    assert held.answer.startswith("Take SMC CP96-40")
    for pulls, is_ready, order in ({}, True, "clamp"), ({"external_force": "20 N"}, False, "missing"):
        clamped = size(LIFT | {"held_by": "clamp", "clamp_force": "180 N"} | pulls, **DRAWS)
        least = "180 N" if is_ready else f"{math.ceil(hanging.value + 20.0)} N"
        row = ("1", order, f"rod clamp, {least} or more", "–")
        assert (clamped.ready, sizing_sheet(clamped).tables[0].rows[-1]) == (is_ready, row)
    assert clamped.open_checks[0].value == pytest.approx(hanging.value + 20.0)
    for wrong in ({"held_by": "clamp"}, {"clamp_force": "180 N"}):
        with pytest.raises(DescriptionError, match="clamp_force"):
            SizingTask(**LIFT | wrong)

    monkeypatch.chdir(tmp_path)
    Path("lift.toml").write_text(toml.write(LIFT))
    assert command(["size", "lift.toml", "--samples", "8", "--out", "lift", "--max-candidates", "20"]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    assert shown.index("NOT KEPT") < shown.index("end speed, m/s")  # above the table
    assert "feasible = true, but ready = false" in shown
    summary = json.loads(Path("lift/result.json").read_text())
    assert (summary["feasible"], summary["ready"]) == (True, False)
    page = Path("lift/report.html").read_text()
    assert '<li class="fails">Open check: load that hangs' in page
    stored = pn.load("lift")
    assert stored.view().data()["findings"] == found.view().data()["findings"]
    assert stored.answer.startswith("Not ready to order: one check of the best choice is open. SMC CP96-40")
    old = summary | {"said": [held.answer, *summary["said"][1:]]}  # as an earlier version wrote it
    del old["provisional"], old["notes"]
    Path("lift/result.json").write_text(json.dumps(old))
    assert pn.load("lift").answer == stored.answer


def test_a_choice_that_keeps_its_checks_ranks_before_one_of_less_air():
    """A peak of 19 bar in the smaller cylinder, whose sheet states no limit."""
    names = ["parker*", "pneumax*", "smc-c[5dmy]*", "smc-mg*", "ckd*", "festo-[gm]*", "smc-tu0[48]*", "smc-tu1*"]
    task = TRANSFER | {"mass": "5 kg", "time": "0.6 s", "impact_energy": "3 J", "guide": "ball", "incline": "90 deg"}
    task |= {
        "max_stroke": "100 mm",
        "end_speed": "3 m/s",
        "held_by": "machine",
        "external_force": "100 N",
        "exclude": [*names, "smc-sy[79]*", "smc-cp96-[5681]*"],
    }
    found = size(task, **DRAWS)
    thrifty = found.ranked[-1]
    assert (found.ready, thrifty.open_checks, thrifty.air < found.best.air) == (True, 1, True)


def test_a_task_without_limits_keeps_the_rule_of_the_warning_about_impacts(monkeypatch):
    """The rule is assumed, so the check stays open until the task has the energy of a data sheet. So is the peak's."""
    monkeypatch.setattr(checks, "USUAL_PEAK_PA", 4e5)
    found = size(SLOPE | {"held_by": "machine"}, **DRAWS)
    bore = found.circuit().components["cylinder"].bore_m
    limit = 4e3 * math.pi / 4.0 * bore**2
    energy, peak = found.open_checks
    assert (peak.name, peak.value > peak.limit) == ("peak pressure", True)
    assert energy.limit == pytest.approx(limit)
    assert energy.value < limit
    assert energy.rule.startswith("assumed: 4 mJ")
    run = found.circuit().simulate("0 s: 0, 0.1 s: 1", "1 s")
    assert run.attrs["impacts"][0]["time_s"] - 0.1 < 0.6
    assert run.attrs["impacts"][0]["energy_j"] < limit
    assert not any("harder than" in line for line in run.attrs["warnings"])
    monkeypatch.undo()
    hard = size(SLOPE | {"held_by": "machine", "impact_energy": "60 J", "peak_pressure": "25 bar abs"}, **DRAWS)
    assert hard.best.energy > limit  # the task's own limit counts
    assert hard.ready


def test_what_no_sheet_states_is_open_and_candidates_are_counted_once():
    found = size(TRANSFER | {"cycles": 5e6, "mass": "0.5 g"}, **DRAWS)
    assert [check.name for check in found.open_checks] == ["side load", "speed", "energy at the end", "life", "mass"]
    assert 'end_speed = "' in found.open_checks[1].finding.remedy
    assert [size[0] for size in unusual_sizes(SizingTask(**SLOPE | {"stroke": "1 um"}), USUAL)] == ["stroke"]
    assert f"{len(found.ranked)} meet the task" in found.extent
    of = {slot: {one.name: one for one in parts} for slot, parts in choices(found.task).items()}
    choice = DriveChoice(*(of[slot][name] for slot, name in found.best.parts.items()))
    shut = replace(found.best, setting=Setting(needle_out=0.0365)._asdict())
    assert set(checks.open_names(choice, found.task, shut)) - {*found.best.open_names} == {"opening of a needle"}
    assert replace(shut, open_names=(*found.best.open_names, checks.NEEDLE)).rank == found.best.rank
    rule = {"short": ("energy out", 3.2, 3.6), "air": 0.5 * found.best.air}
    lost = SimpleNamespace(lost=True, settings=SimpleNamespace(**rule), cylinder="of less air")
    search = SimpleNamespace(
        candidates=[lost, lost], task=found.task, _candidate=lambda _: SimpleNamespace(choice=choice)
    )
    (energy,) = (one for one in Search._checks(search, [found.best]) if one.name == "energy at the end")  # type: ignore[arg-type]
    assert energy.rule.endswith("this limit decides the bore: it excludes cylinders that take less air (1)")
    short = size(TRANSFER | {"guide": "ball"}, **DRAWS, most=1)
    assert not any("`most`" in note for note in short.notes)
    assert short.complete or "--max-candidates 2" in short.notes[0]


def test_friction_that_pressure_adds_or_that_is_assumed_holds_no_load(tmp_path):
    """12 kg hang at a cylinder of 320 N of friction at 6 bar. Without pressure, only a measured part of it holds."""
    part = """kind = "cylinder/rodless"
title = "Measured"
[values]
bore = { value = "63 mm", source = "sheet" }
friction.coulomb = { value = "280 N", source = "sheet" }
[sources.sheet]
title = "measured without pressure"
address = "here"
date = "2026"
"""
    (tmp_path / "known.toml").write_text(
        part.replace(
            "[sources",
            'friction.pressure.coulomb = { value = { a = "7 N/bar", b = "7 N/bar" }, source = "sheet" }\n[sources',
        )
    )
    (tmp_path / "unknown.toml").write_text(part)
    task = SizingTask(**SLOPE | {"mass": "12 kg", "incline": "90 deg", "exclude": ["smc*", "festo-d*", "pneumax*"]})
    with pn.catalogue_folders(tmp_path):
        found = {one.name: one for one in choices(task)["cylinder"]}
    none = NO_FLOW_CONTROL
    held = {
        name: next(
            one
            for one in checks.machine_checks(DriveChoice(found[name], none, none, none), task, None)
            if "hangs" in one.name
        )
        for name in ("parker-osp-p25", "parker-osp-p63", "unknown", "known")
    }
    assert [(one.is_kept, one.limit) for one in held.values()] == [
        (False, pytest.approx(0.7 * 45.0)),
        (None, None),
        (None, None),
        (True, pytest.approx(0.7 * 280.0)),
    ]
    assert held["parker-osp-p63"].value == pytest.approx((1.1 * 12.0 + 5.35) * 9.80665)
    assert 'held_by = "clamp", clamp_force = "182 N"' in held["parker-osp-p63"].finding.remedy


def test_a_severe_finding_is_never_folded_or_counted(capsys):
    with _plain_warnings():
        for number in range(10):
            warn(f"Hazard: cylinder {number}: an impact of {number} J")
    assert len(capsys.readouterr().err.splitlines()) == 10
    drive = pn.Drive.load("catalogue:reference").replace({"load.mass": "20 kg"})
    with pytest.warns(PneudriveWarning, match="^Hazard: "):
        pn.simulate(drive, "0 s: 1", "0.5 s")
    names = ["provenance", "budget", *map(str, range(9))]
    texts = dict.fromkeys(names, "as usual") | {"provenance": "Hazard: the piston has met the cover"}
    parts = [Section(name, name, (Paragraph((texts[name],)), ShownTable("", ("a",), (("b",),)))) for name in names]
    page = Report("report", ["Fine.", "Hazard: it falls"], parts).html()
    assert page.index("Hazard: it falls") < page.index("Fine.")
    assert page.count("<details>") == 1  # that of the budget
