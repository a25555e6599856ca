"""Sizing: a user's journey, and what a ranking must never get wrong."""

from __future__ import annotations

import html
import json
import math
import re
import shlex
import threading
from collections.abc import Mapping
from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from pneudrive.cli.main import run as command
from pneudrive.datasheet.strokes import stroke_numbers
from pneudrive.describe.circuit import Circuit
from pneudrive.errors import CommandError, DescriptionError
from pneudrive.report.page import references
from pneudrive.sizing.candidate import SafeBounds, air_estimate_kg
from pneudrive.sizing.checks import SAME_AIR, simulated
from pneudrive.sizing.result import SizingResult
from pneudrive.sizing.search import size
from pneudrive.sizing.strokes import DRAWN, RTOL, DriveStrokes, Setting, cycle_s, points, tune
from pneudrive.sizing.task import SLOTS, DriveChoice, Parts, SizingTask, choices

SMALL = ["parker*", "pneumax*", "smc-c[my]*", "ckd*", "festo-[dm]*", "smc-sy[79]*", "smc-tu0[46]*", "smc-tu1*"]
SMALL += ["smc-cd8*", "smc-cp*", "smc-c5*", "smc-mg*", "festo-gr-m3", "festo-gr-qs-3", "festo-gr-3-4"]
TASK: dict[str, Any] = {
    "name": "push",
    "mass": "2 kg",
    "stroke": "100 mm",
    "time": "0.35 s",
    "supply": {"pressure": "6 bar gauge"},
    "exclude": SMALL,
}
DRAWS = {"draws": 8, "draws_best": 16}


@pytest.fixture(scope="module")
def found() -> SizingResult:
    return size(TASK, **DRAWS)


def test_a_number_that_is_infinite_is_read_back(found: SizingResult, tmp_path: Path):
    """Where up to 1 % of the samples do not run to their end, the mean air is infinite; its file has null."""
    best = replace(found.ranked[0], air=math.inf)
    replace(found, ranked=(best, *found.ranked[1:])).save(tmp_path)
    assert SizingResult.load(tmp_path).ranked[0].air == math.inf


def test_each_row_of_the_table_names_its_file(found: SizingResult):
    """Twelve valves of one cylinder rank before another cylinder, which takes less air but has an open check more."""
    parts = dict(found.best.parts)
    first = [replace(found.best, parts=parts | {"valve": f"valve {k}"}) for k in range(12)]
    other = replace(
        found.best, parts=parts | {"cylinder": "other"}, air=0.5 * found.best.air, open_names=("hanging load",)
    )
    many = replace(found, ranked=(*first, other))
    assert list(many.written) == [f"{k:02d}.toml" for k in (*range(1, 11), 13)]
    view = many.view()
    assert [row[0] for row in view.tables[0].rows] == ["01.toml", "13.toml"]
    assert [row[3] for row in view.tables[0].rows][1] == "hanging load"
    assert any(note.startswith("Less air, but further open checks (hanging load): other") for note in view.notes)


def combined(found: Parts) -> list[DriveChoice]:
    return [DriveChoice(*parts) for parts in product(*(found[slot] for slot in SLOTS))]


def test_the_best_of_full_enumeration_is_found_and_margins_are_monotone(found: SizingResult):
    task = SizingTask(**TASK)
    made = [DriveStrokes(choice, task) for choice in combined(choices(task))]
    every = [simulated(one, tune(one).setting, points(DRAWS["draws_best"]), RTOL)[0] for one in made]
    best = min((one for one in every if one.is_feasible), key=lambda one: one.rank)
    assert len(every) == found.enumerated >= 4
    assert found.best.rank == best.rank
    reserve = 0.9 * found.best.margin
    tight = size(TASK | {"margin": f"{100.0 * reserve} %"}, **DRAWS)
    assert {one.name for one in tight.ranked} <= {one.name for one in found.ranked}
    assert tight.best.air >= found.best.air / SAME_AIR
    assert tight.best.margin == pytest.approx(1.0 - (1.0 - found.best.margin) / (1.0 - reserve), abs=1e-9)
    assert size(TASK | {"margin": "80 %"}, **DRAWS).best is None


def test_tuning_runs_fewer_cases_with_the_result_of_all(found: SizingResult, monkeypatch: pytest.MonkeyPatch):
    strokes, _ = nominal_strokes(found.best.parts, SizingTask(**TASK))
    few = tune(strokes)
    monkeypatch.setattr("pneudrive.sizing.strokes._next_runs", lambda table, is_run, openings: ~is_run)
    assert tune(strokes) == few


def test_a_needle_is_tuned_to_its_largest_margin(found: SizingResult):
    task = SizingTask(**TASK | {"time": "1 s", "end_speed": "0.3 m/s"})
    slow, _ = nominal_strokes({**found.best.parts, "flow_control": "festo-gr-qs-8"}, task)
    own = tune(slow).setting
    near = [own._replace(needle_back=share * own.needle_back) for share in (0.85, 1.0, 1.16)]
    less, best, more = (simulated(slow, one, points(DRAWS["draws"]), RTOL)[0].margin for one in near)
    assert best > max(less, more)


def test_a_task_made_from_a_known_drive_finds_it_or_a_cheaper_one(found: SizingResult):
    known = found.ranked[-1]
    limits = {"time": f"{1.01 * known.time_out} s", "return_time": f"{1.01 * known.time_back} s"}
    again = size(TASK | limits, **DRAWS)
    assert again.best is not None
    assert again.best.air <= SAME_AIR * known.air


def nominal_strokes(parts: Mapping[str, str], task: SizingTask) -> tuple[DriveStrokes, np.ndarray]:
    """Return the strokes of a choice, and draws at which nothing deviates."""
    choice = next(one for one in combined(choices(task)) if one.parts == dict(parts))
    nominal = np.full((1, len(DRAWN)), 0.5)
    low, high = task.spread.friction
    nominal[0, DRAWN.index("friction")] = (1.0 - low) / (high - low)
    cold, hot = task.temperatures_k
    nominal[0, DRAWN.index("temperature")] = (task.ambient.temperature_k - cold) / (hot - cold)
    return DriveStrokes(choice, task), nominal


def open_at_once(circuit: Circuit) -> Circuit:
    """Return a circuit with a valve of the same paths, which opens at once after the delay of the sizing."""
    tables = circuit.to_dict()
    sizes = {key: one for key, one in tables["components"]["valve"].items() if not key.startswith(("time", "kind"))}
    tables["components"]["valve"] = {"kind": "valve/proportional-5/3", "delay": "21 ms", **sizes}
    return Circuit.model_validate(tables)


def test_the_energy_is_that_of_the_hardest_contact():
    task = SizingTask(**TASK | {"mass": "20 kg", "stroke": "300 mm", "time": "0.64 s", "exclude": []})
    parts = ("parker-osp-p32", "smc-sy9000", "smc-tu1208", "festo-gr-3-4")
    strokes, nominal = nominal_strokes(dict(zip(SLOTS, parts, strict=True)), task)
    setting = Setting(needle_out=0.06, cushion_out=0.02)
    own = strokes.run(True, nominal, np.array([setting]))
    run = open_at_once(strokes.circuit(setting)).simulate("0 s: 1", "1 s")
    first, second = (one["energy_j"] for one in run.attrs["impacts"])  # it rebounds from the gas before the piston
    assert own.energy[0] == pytest.approx(second, rel=3e-3)
    assert second > 2.5 * first


def test_a_stroke_has_the_numbers_of_a_datasheet(found: SizingResult):
    task = SizingTask(**TASK)
    strokes, nominal = nominal_strokes(found.best.parts, task)
    setting = np.array([list(found.best.setting.values())])
    own = strokes.run(True, nominal, setting, rtol=1e-10)
    late = strokes.opens_after(True, nominal)[0]  # time on and three quarters of the travel's second half
    assert late == pytest.approx(0.021, rel=1e-12)
    # The file of the choice agrees: its armature travels for 4 ms, which the sizing replaces by one time.
    switched = found.circuit().simulate("0 s: 1", "0.5 s", rtol=1e-8)
    assert switched.attrs["impacts"][0]["time_s"] == pytest.approx(own.time[0], rel=0.01)
    # Paths that open at once agree within the tolerance of the solver. The command at 0 s acts after the delay.
    run = open_at_once(found.circuit()).simulate("0 s: 1", "0.5 s", rtol=1e-10)
    mass = strokes.choice.cylinder.numbers["moving_mass"] + task.mass_kg
    short = {"time_s": "time", "position_m": "cylinder.position", "velocity_m_s": "cylinder.velocity"}
    read = {key: run[name].to_numpy() for key, name in short.items()}
    sheet = stroke_numbers(read, task.stroke_m, mass, impacts=run.attrs["impacts"])
    assert own.time[0] == pytest.approx(sheet.stroke_time, rel=5e-5)  # until the valve opens, gas settles
    assert own.end_speed[0] == pytest.approx(sheet.end_speed, rel=1e-4)
    assert own.energy[0] == pytest.approx(sheet.end_energy, rel=2e-4)
    assert len(run.attrs["impacts"]) == 1  # it does not rebound
    coarse = strokes.run(True, nominal, setting)
    assert coarse.time[0] == pytest.approx(own.time[0], rel=1e-4)
    assert coarse.end_speed[0] == pytest.approx(own.end_speed[0], rel=1e-3)
    assert coarse.air[0] == pytest.approx(own.air[0], rel=2e-3)
    assert own.air[0] == pytest.approx(abs(float(np.trapezoid(run["supply.mass_flow"], run.time))), rel=0.03)


def test_the_way_back_begins_with_one_side_full_and_the_other_empty(found: SizingResult):
    strokes, nominal = nominal_strokes(found.best.parts, SizingTask(**TASK))
    setting = np.array([list(found.best.setting.values())])
    own = strokes.run(False, nominal, setting, rtol=1e-10)
    begun = {"cylinder.position": "100 mm", "cylinder.a": "6 bar gauge", "cylinder.b": "0 bar gauge"}
    run = open_at_once(found.circuit()).simulate("0 s: -1", "0.59 s", rtol=1e-10, initial=begun)
    (hit,) = (one for one in run.attrs["impacts"] if one["end"] == "a")
    assert own.time[0] == pytest.approx(hit["time_s"], rel=5e-5)
    assert own.end_speed[0] == pytest.approx(hit["speed_m_s"], rel=1e-4)
    assert own.air[0] == pytest.approx(abs(float(np.trapezoid(run["supply.mass_flow"], run.time))), rel=0.03)


@pytest.mark.parametrize(("outward", "incline"), [(True, 90), (False, -90)])
def test_a_drive_lifts_what_its_load_ratio_says_and_no_more(found: SizingResult, outward: bool, incline: int):
    """The ratio is linear in the load: just below 1 the drive that runs arrives, just above it does not."""
    nominal, opened = np.full((1, len(DRAWN)), 0.5), np.ones((1, 4))

    def strokes(mass_kg: float) -> DriveStrokes:
        task = SizingTask(**TASK | {"mass": f"{mass_kg} kg", "incline": f"{incline} deg", "time": "8 s"})
        return DriveStrokes(next(one for one in combined(choices(task)) if one.parts == dict(found.best.parts)), task)  # type: ignore[union-attr]

    light, heavy = (float(strokes(mass).load_ratio(outward, nominal)[0]) for mass in (10.0, 20.0))
    for ratio in (0.95, 1.02):
        mass = 10.0 + 10.0 * (ratio - light) / (heavy - light)
        assert np.isfinite(strokes(mass).run(outward, nominal, opened).time[0]) == (ratio < 1.0)


@pytest.mark.parametrize(
    "change",
    [{"time": "0.05 s"}, {"mass": "100 kg", "incline": "90 deg"}, {"time": "0.1 s", "tube_length": "10 m"}],
)
def test_what_is_pruned_fails_at_the_favourable_end_of_every_spread(change: dict[str, str]):
    task = SizingTask(**TASK | change | {"exclude": [one for one in SMALL if not one.startswith("smc-tu")]})
    found = choices(task)
    bounds = SafeBounds(task, found["tube"])
    throttled = [(one.tube.name, bounds.fits(one)) for one in combined(found) if one.is_throttled]
    fitting = {tube for tube, lacks in throttled if lacks is None or lacks.limit != "connection"}
    assert fitting == {"smc-tu0805"}  # 8 mm
    lacking = [(one, bounds.cylinder(one.cylinder) or bounds.fits(one)) for one in combined(found)]
    pruned = [(one, lacks) for one, lacks in lacking if lacks is not None and lacks.limit != "connection"]
    assert pruned
    best, low = np.ones((2, len(DRAWN))), {"friction", "load", "mass of the piston", "valve time", "dead volume"}
    best[:, [name in low for name in DRAWN]] = 0.0
    best[1, DRAWN.index("dead volume")] = 1.0
    for choice, lacks in pruned[:12]:
        assert lacks.share < 1.0
        strokes = DriveStrokes(choice, task)
        limits = ((True, task.outward_s), (False, task.back_s))
        times = [strokes.run(way, best, np.ones((2, 4))).time / limit for way, limit in limits]
        assert max(one.min() for one in times) > 1.0, (choice.name, lacks)


def test_an_impossible_task_is_refused_with_the_nearest_possible_value_of_each_quantity():
    task = TASK | {"mass": "200 kg", "incline": "90 deg", "time": "60 s"}
    found = size(task, **DRAWS)
    assert (found.best, found.tuned, found.left) == (None, 0, 0)
    assert found.miss is not None
    said = {one.partition(":")[0]: one for one in found.miss.possible}
    assert set(said) == {"time", "mass", "supply pressure"}
    assert "no value of this quantity alone" in said["time"]
    exclude = ["parker*", "pneumax*", "ckd*", "smc-[cm][!5]*", "festo-[dgm]*", "smc-tu[01][!2]*", "smc-sy[57]*"]
    late = size(task | {"mass": "500 kg", "time": "0.5 s", "exclude": exclude}, **DRAWS).miss
    assert (late.parts["cylinder"], late.possible) == ("smc-c55-100", ())  # type: ignore[union-attr]


def test_a_search_that_was_interrupted_goes_on(tmp_path, found: SizingResult):
    flag, seen = threading.Event(), []

    def stop(done: float, _total: float, _task: str) -> None:
        seen.append(done)
        if done >= 2:
            flag.set()

    part = size(TASK, **DRAWS, out=tmp_path / "s", progress=stop, cancel=flag)
    assert not part.complete
    assert part.provisional
    assert "interrupted" in part.notes[0]
    lines = (tmp_path / "s" / "choices.jsonl").read_text().splitlines()
    assert lines
    with (tmp_path / "s" / "choices.jsonl").open("a") as file:
        file.write('{"parts": {"cylin')  # a line that a kill cut off
    with pytest.raises(CommandError, match="sizing of another task"):  # refused, and the folder stays free
        size(TASK | {"mass": "3 kg"}, **DRAWS, out=tmp_path / "s")
    again = size(TASK, **DRAWS, out=tmp_path / "s")
    assert again.ranked == found.ranked
    assert (tmp_path / "s" / "choices.jsonl").read_text().splitlines()[: len(lines)] == lines


@pytest.mark.parametrize(
    ("incline", "expected"), [("90 deg", 0.0), ("-90 deg", 0.0), ("60 deg", 0.15 * 2.0 * 9.80665 / 2.0)]
)
def test_a_guide_rubs_by_what_lies_on_it(incline: str, expected: float):
    """Upright none, and so no 4e-16 N of it in the reason of a cylinder's friction."""
    task = SizingTask(**TASK | {"guide": "plain", "incline": incline})
    assert task.guide_friction_n == pytest.approx(expected, rel=1e-12, abs=0.0)


def test_a_task_is_written_and_read_again_with_its_energy_and_its_cold_room():
    task = SizingTask(**TASK | {"impact_energy": "500 mJ", "ambient": {"temperature": "-20 degC"}})
    assert (task.to_dict()["impact_energy"], task.temperatures_k) == ("0.5 J", pytest.approx((243.15, 268.15)))
    assert SizingTask(**task.to_dict()) == task


def test_a_cycle_takes_the_time_that_the_cycles_of_an_hour_leave(found: SizingResult):
    """In 6 s both sides fill: what is swept from nothing, what is dead from the ambient pressure."""
    full = {}
    for change in ({}, {"cycles_per_hour": 600}):
        strokes, nominal = nominal_strokes(found.best.parts, SizingTask(**TASK | change))
        setting = np.array([list(found.best.setting.values())])
        air = sum(strokes.run(way, nominal, setting, rtol=1e-6).air[0] for way in (True, False))
        swept, task = sum(strokes.choice.areas_m2) * 0.1, strokes.task
        estimate = air_estimate_kg(strokes.choice.cylinder, strokes.choice.tube, task)
        volumes = estimate + task.ambient.pressure_pa * swept / (287.05 * task.ambient.temperature_k)
        full[cycle_s(task)] = air / volumes
    short, whole = full.values()
    assert [*full][1] == pytest.approx(6.0)
    assert (whole, short < whole) == (pytest.approx(1.0, abs=0.03), True)  # still a little warm


def test_a_fault_of_a_task_is_told_before_the_search():
    lift = {"incline": "90 deg", "held_by": "clamp", "clamp_force": "19 N"}  # 2 kg weigh 19.6 N
    for change, said in ((lift, "at least 19.61 N"), ({"cycles_per_minute": 20}, "20 a minute are 1200 an hour")):
        with pytest.raises(DescriptionError) as error:
            SizingTask(**TASK | change)
        assert said in str(error.value)
    with pytest.raises(DescriptionError, match='pressure = "6 bar gauge"'):
        SizingTask(**{key: value for key, value in TASK.items() if key != "supply"})
    miss = size(TASK | {"time": "0.8 ms"}, **DRAWS).miss
    assert (miss.limit, "0.0008 s allowed" in miss.gives) == ("time", True)  # type: ignore[union-attr]


@pytest.mark.parametrize("most", [0, -3])
def test_a_search_of_less_than_one_choice_is_refused(most: int):
    with pytest.raises(CommandError, match=f"most = {most} is out of bounds"):
        size(TASK, most=most)


def read_report(path: Path) -> tuple[dict[str, list[list[str]]], list[str], str]:
    """Return a report as its reader has it: rows of each table by its caption, blocks of code, all text."""
    page = path.read_text()

    def shown(pattern: str, text: str = page) -> list[str]:
        return [html.unescape(re.sub("<[^>]+>", "", one)) for one in re.findall(f"(?s){pattern}", text)]

    captions, bodies = (
        shown('<p class="caption"[^>]*>(.*?)</p>\\s*<(?:div|table)'),
        re.findall("(?s)<table.*?</table>", page),
    )
    tables = [
        [cells for row in body.split("<tr")[1:] if (cells := shown("<td[^>]*>(.*?)</td>", row))] for body in bodies
    ]
    return dict(zip(captions, tables, strict=True)), shown("<pre[^>]*>(.*?)</pre>"), shown(".+")[0]


def test_a_user_sizes_a_drive_and_runs_it(tmp_path, capsys, printed, refusal, monkeypatch, found: SizingResult):
    lists = ", ".join(f'"{one}"' for one in SMALL)
    text = f"""mass = "2 kg"
stroke = "100 mm"
time = "0.35 s"
exclude = [{lists}]
supply.pressure = "6 bar gauge"
"""
    task = tmp_path / "push.toml"
    task.write_text(text)
    out = tmp_path / "out"
    shown = printed(["size", task, "--samples", "8", "--out", out])
    assert "feasible = true" in shown
    assert found.best.parts["cylinder"] in shown
    assert (out / "figures" / "candidates.png").stat().st_size > 10_000
    assert json.loads((out / "result.json").read_text())["feasible"] is True
    tables, code, shown = read_report(out / "report.html")
    ranked = json.loads((out / "result.json").read_text())["ranked"]
    assert [row[1] for row in tables["Candidates that meet the task: the best of each cylinder"]] == [
        " + ".join(name for name in one["parts"].values() if name != "none") for one in ranked[:1]
    ]
    (table,) = (rows for caption, rows in tables.items() if caption.startswith("Range that contains 98 % of "))
    ranges = {row[0]: row[1] for row in table}
    value, limit, _ = ranked[0]["worst"]["time out"]
    low, _, rest = ranges["time out, limit 0.35 s"].partition(" … ")
    assert rest == f"{value:.3g} ({100.0 * (1.0 - value / limit):.0f}\u00a0%)"
    assert 0.0 < float(low) < value
    least, most = map(float, ranges["air of a cycle, l ANR"].split(" … "))
    assert least < found.best.air_litres_anr < most
    least, most = map(float, ranges["load ratio out, %"].split(" … "))
    assert 0.0 < least < most < 100.0
    origins = {key: origin for key, _, origin in tables["Sources in brackets, listed at the end"]}
    assert origins["cylinder.friction.coulomb"].startswith("assumed: ")
    assert origins["load.mass"] == "the task, or the choice of parts"
    (source,) = references([origins["cylinder.bore"].partition("]")[0][1:]])
    assert source in shown
    again = tmp_path / "again"
    again.mkdir()
    monkeypatch.chdir(again)
    Path("task.toml").write_text(code[-1])
    assert command(shlex.split(code[0])[1:]) == 0
    assert Path("out/ranking.csv").read_bytes() == (out / "ranking.csv").read_bytes()
    capsys.readouterr()
    command_line = ["simulate", str(out / "01.toml"), "--command", "0 s: 1", "--duration", "0.2 s"]
    assert command(command_line) == 0
    capsys.readouterr()

    task.write_text(text.replace("2 kg", "200 kg").replace("supply", 'incline = "90 deg"\nsupply'))
    shown = " ".join(printed(["size", task, "--samples", "8", "--out", tmp_path / "none"]).split())
    assert all(words in shown for words in ("feasible = false", "Nearest miss", "needed"))
    assert "Nothing in the catalogue meets the task." in read_report(tmp_path / "none" / "report.html")[2]
    for wrong, said in (
        (text.replace("2 kg", "0 kg"), "mass"),
        (text.replace("2 kg", "nan kg"), "mass"),
        (text.replace("0.35 s", "0.35 m"), "time"),
        (text.replace("exclude = [", 'exclude = ["festoo-dsbg", '), "festoo-dsbg"),
    ):
        task.write_text(wrong)
        refusal(["size", task], said, "push.toml:")
