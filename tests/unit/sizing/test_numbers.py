"""Numbers of a sizing by hand, without runs: spreads of the samples, margins, checks of a machine, safe bounds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from pneudrive.sizing import checks
from pneudrive.sizing.candidate import SafeBounds, nearest_possible
from pneudrive.sizing.strokes import DRAWN, DriveStrokes, StrokeResults
from pneudrive.sizing.task import DriveChoice, SizingTask, choices

TASK: dict[str, Any] = {"mass": "4 kg", "stroke": "200 mm", "time": "0.5 s", "supply": {"pressure": "6 bar gauge"}}
PARTS = {"cylinder": "smc-cp96-32", "valve": "smc-sy9000", "tube": "smc-tu0805", "flow_control": "festo-gr-3-4"}
G = 9.80665


@pytest.fixture(scope="module")
def found():
    return choices(SizingTask(**TASK))


@pytest.fixture(scope="module")
def choice(found):
    return DriveChoice(*(next(one for one in found[slot] if one.name == name) for slot, name in PARTS.items()))


def test_assumed_values_of_a_cylinder_by_hand(found):
    """Of 0.2 bar on bore 25: 9.817 N, 70 % sliding. Of 45 N sliding: a third more. Of 6 bar on bore 32: 5 % and 7 %."""
    given = {
        "smc-cm2y-25": (6.872, 9.817, 40.0),
        "parker-osp-p25": (45.0, 60.0, 40.0),
        "smc-cp96-32": (24.13, 33.78, 51.2),
    }
    kinds = {one.name: one.numbers for one in found["cylinder"]}
    for name, values in given.items():
        own = [kinds[name][f"friction.parameters.{key}"] for key in ("coulomb", "breakaway", "viscous")]
        assert own == pytest.approx(values, rel=1e-3), name
    masses = [kinds[name]["moving_mass"] for name in ("smc-cp96-32", "parker-osp-p25", "parker-osp-p16")]
    rod = 7850.0 * math.pi / 4.0 * 0.012**2 * 0.2
    assert masses == pytest.approx([0.2 + rod, 0.7, 0.7 * 0.64**2.2], rel=2e-3)
    numbers = kinds["smc-cp96-32"]
    volume = 0.015 * math.pi / 4.0 * 0.032**2
    cushion = {"length": 0.016, "plunger_diameter": 0.016, "needle_conductance": 1.5e-9, "port_volume": 0.4 * volume}
    assert {key: numbers[f"cushion_a_{key}"] for key in cushion} == pytest.approx(cushion, rel=2e-3)
    assert numbers["dead_volume_a"] == pytest.approx(0.6 * volume, rel=2e-3)
    for stroke, has_cushion in ((36, True), (35, False)):  # a cushion of 16 mm takes at most 45 % of a stroke
        cylinders = choices(SizingTask(**TASK | {"stroke": f"{stroke} mm"}))["cylinder"]
        (own,) = (one.numbers for one in cylinders if one.name == "smc-cp96-32")
        assert ("cushion_a_length" in own) == has_cushion


def test_each_drawn_number_moves_its_own_numbers_by_its_spread_and_no_other(choice):
    task = SizingTask(**TASK)  # tube and needle have an assumed size, which doubles the spread
    nominal = np.full(len(DRAWN), 0.5)
    nominal[[DRAWN.index("friction"), DRAWN.index("temperature")]] = 0.375, 0.4  # 1 of 0.7 to 1.5, -10 K to +15 K

    def moved(name: str, share: float) -> dict[str, float]:
        draws = np.stack([nominal, np.where(np.array(DRAWN) == name, share, nominal)])
        strokes = DriveStrokes(choice, task)
        made = strokes.members(True, draws, np.ones((2, 4)))
        pairs = zip([*made.paths, "late"], np.c_[made.values, strokes.opens_after(True, draws)].T, strict=True)
        return {path: own / usual for path, (usual, own) in pairs if not math.isclose(usual, own)}

    dead = [f"cylinder.{key}" for key in ("dead_volume_a", "dead_volume_b")]
    ports = [f"cylinder.cushion_{side}_port_volume" for side in "ab"]
    friction = [f"cylinder.friction.parameters.{key}" for key in ("coulomb", "breakaway", "viscous")]
    assumed = choice.cylinder.assumed >= {"moving_mass", "dead_volume_a"}, bool(choice.valve.assumed & {"time_on"})
    supply = 6e5 + 101325.0
    expected = {
        "supply pressure": {"supply.pressure": ((supply - 5e4) / supply, (supply + 5e4) / supply)},
        "load": {"load.mass": (0.9, 1.1)},
        "friction": dict.fromkeys(friction, (0.7, 1.5)),
        "valve conductance": dict.fromkeys(("feed.conductance", "vent.conductance"), (0.9, 1.1)),
        "tube conductance": dict.fromkeys(
            ("tube_a.diameter", "tube_b.diameter"), (0.8 ** (1.0 / 2.3), 1.2 ** (1.0 / 2.3))
        ),
        "needle": {f"flow_control_{side}.needle_conductance": (0.8, 1.2) for side in "ab"},
        "dead volume": dict.fromkeys([*dead, *ports], (0.7, 1.3)),
        "temperature": {"ambient.temperature_k": (283.15 / 293.15, 308.15 / 293.15)},
        "mass of the piston": {"cylinder.moving_mass": (0.7, 1.3)},
        "valve time": {"late": (0.7, 1.3)},
        "cushion": {f"cylinder.cushion_{side}_needle_conductance": (0.8, 1.2) for side in "ab"},
        "heat transfer": {"cylinder.heat_transfer_scale": (0.5, 2.0)}
        | {f"tube_{side}.heat_transfer_scale": (0.5**0.485, 2.0**0.485) for side in "ab"},
    }
    assert assumed == (True, True)
    assert [*expected] == [*DRAWN]
    for name, paths in expected.items():
        for at, share in enumerate((0.0, 1.0)):
            assert moved(name, share) == pytest.approx({path: ends[at] for path, ends in paths.items()}), (name, share)


def results(**columns: Any) -> StrokeResults:
    plain = dict.fromkeys(StrokeResults._fields, np.full(200, 0.1)) | columns
    return StrokeResults(**{name: np.array(values) for name, values in plain.items()})


def test_margins_count_from_the_limit_less_its_reserve_and_the_worst_one_in_a_hundred(choice):
    """Of 200 times 0.2 to 0.399 s, of at most 0.5 s with 10 %: one exceeds the worst, which leaves 1 - 0.398/0.45."""
    task = SizingTask(
        **TASK | {"margin": "10 %", "holding_force": "100 N", "end_speed": "1 m/s", "peak_pressure": "10 bar abs"}
    )
    times = 0.2 + 0.001 * np.arange(200.0)
    speeds, forces = np.linspace(0.5, 1.0, 200), np.linspace(300.0, 120.0, 200)
    out = results(time=times, end_speed=speeds, force=forces, peak_pressure=np.full(200, 6e5))
    back = results(time=times[::-1] + 0.1, peak_pressure=np.full(200, 9e5))
    by_name = {one.name: one for one in checks.limits(task, choice, out, back)}
    assert (by_name["time out"].worst, by_name["time out"].margin) == pytest.approx((0.398, 1.0 - 0.398 / 0.45))
    assert by_name["time back"].worst == pytest.approx(by_name["time out"].worst + 0.1)
    assert by_name["end speed out"].margins[-1] == pytest.approx(1.0 - 1.0 / 0.9)
    assert by_name["holding force"].margins[[0, -1]] == pytest.approx([0.9 * 3.0 - 1.0, 0.9 * 1.2 - 1.0])
    assert np.sum(forces < by_name["holding force"].worst) == 1
    assert by_name["peak pressure"].margins == pytest.approx(np.full(200, 1.0 - 9e5 / 9e5), abs=1e-12)
    assert checks.is_met([*by_name.values()]).sum() == np.sum((times <= 0.45) & (times[::-1] <= 0.35) & (speeds <= 0.9))
    for draws in (8, 16, 100, 101, 128, 201, 1024):
        assert checks.passed(draws) == np.sum(np.arange(draws) > checks.interval(np.arange(draws))[1]), draws


def kept(checked: Any) -> dict[str, tuple[float, float | None, bool | None]]:
    return {one.name: (one.value, one.limit, one.is_kept) for one in checked}


def test_checks_of_the_machine_by_hand(choice):
    """A rod of 12 mm under 6.5 bar; 30 degrees up; a guide shortens the length that buckles from 2 to 0.7 strokes."""
    push, inertia = 6.5e5 * math.pi / 4.0 * 0.032**2, math.pi / 64.0 * 0.012**4
    for guide, length in (("ball", 0.7), ("none", 2.0)):
        task = SizingTask(**TASK | {"guide": guide, "incline": "30 deg", "max_stroke": "150 mm", "stroke": "0.2 m"})
        own = kept(checks.machine_checks(replace(choice, cylinder=rod(choice, {}, "12 mm")), task, None))
        euler = math.pi**2 * 210e9 * inertia / (length * 0.2) ** 2 / 5.0
        assert own["buckling of the rod"] == (pytest.approx(push), pytest.approx(euler), push < euler)
        assert own["stroke"] == (0.2, 0.15, False)
        assert own["speed"][0] == pytest.approx(0.2 / 0.5)
        assert ("side load" in own) == (guide == "none")
    assert own["side load"][0] == pytest.approx(4.0 * G * math.cos(math.radians(30.0)))
    piston = choice.cylinder.numbers["moving_mass"]
    hangs = (4.0 * 1.1 + piston) * G * 0.5
    assert own["load that hangs at pressure loss"][0] == pytest.approx(hangs)
    # An assumed rod may be a sixth thinner, which halves the force that it carries: then the check stays open.
    limits = {share: kept(checks.mechanical_checks(rod(choice, {}, f"{share} mm", True), task)) for share in (7, 9, 30)}
    assert [one["buckling of the rod"][2] for one in limits.values()] == [False, None, True]
    # The sheet carries 40 N up to 0.3 m/s, and life and energy an hour as they are printed.
    printed = {"max_load": "40 N", "max_load_speed": "0.3 m/s", "b10_cycles": 1e7, "absorber_energy_per_hour": "9 kJ"}
    busy = SizingTask(**TASK | {"cycles": 2e7, "cycles_per_hour": 1000, "stroke": "100 mm"})
    drive: Any = type("Drive", (), {"energy": 2.0, "peak_pressure": 5e5, "end_speed": 0.3, "setting": NEEDLES})
    full = replace(choice, cylinder=rod(choice, printed, "12 mm"), valve=replace(choice.valve, printed=printed))
    own = kept(checks.machine_checks(full, busy, drive))
    assert own["side load"] == (pytest.approx(4.0 * G), 40.0, True)
    assert own["life"] == (2e7, 1e7, False)
    assert own["energy per hour"] == (pytest.approx(2.0 * 1000 * 2.0), 9000.0, True)
    assert own["opening of a needle"][:2] == pytest.approx((5.0, 10.0))
    drive.end_speed = 0.31
    assert kept(checks.machine_checks(full, busy, drive))["side load"][1:] == (None, None)


NEEDLES = {"needle_out": 0.05, "needle_back": 0.4}


def rod(choice: DriveChoice, printed: dict[str, Any], diameter: str, assumed: bool = False) -> Any:
    """Return the cylinder of a choice with another rod and other printed values."""
    one = choice.cylinder
    numbers = {**one.numbers, "rod_diameter": 1e-3 * float(diameter.split()[0])}
    known = one.assumed | {"rod_diameter"} if assumed else one.assumed - {"rod_diameter"}
    return replace(one, numbers=numbers, printed=printed, assumed=known)


@pytest.mark.parametrize(
    ("change", "name"),
    [
        ({"time": "2 ms", "return_time": "3 ms"}, "time"),
        ({"mass": "400 kg", "incline": "90 deg", "time": "60 s"}, "mass"),
        ({"external_force": "5 kN"}, "external force"),
        ({"holding_force": "5 kN"}, "holding force"),
        ({"holding_force": "540 N"}, "supply pressure"),  # 100 times the pressure would buckle the rod
    ],
)
def test_the_nearest_possible_value_leaves_a_choice_and_one_a_little_off_none(choice, change, name):
    """By `SafeBounds` at that value itself, of a catalogue of one choice whose sheets have no limits."""
    parts = {slot: [replace(getattr(choice, slot), printed={})] for slot in PARTS}
    only = DriveChoice(*(one for (one,) in parts.values()))

    def left(one: SizingTask) -> bool:
        bounds = SafeBounds(one, parts["tube"])
        return bounds.cylinder(only.cylinder) is None and bounds.fits(only) is None

    task = SizingTask(**TASK | change)
    said = dict(line.split(": ", 1) for line in nearest_possible(task, parts, SafeBounds(task, parts["tube"])))
    least = float(said[name].split()[2])
    key = name.replace(" ", "_")
    unit = {"time": "s", "mass": "kg"}.get(name, "N")
    towards = 1.0 if said[name].startswith("at least") else -1.0
    for factor, is_left in ((1.0 + 0.01 * towards, True), (1.0 - 0.01 * towards, False)):
        value = factor * least
        other = change | {key: f"{value} {unit}"}
        if name == "time":
            other["return_time"] = f"{1.5 * value} s"
        if name == "supply pressure":
            other = change | {"supply": {"pressure": f"{value} bar gauge"}}
        assert left(SizingTask(**TASK | other)) == is_left, said[name]


def test_safe_bounds_are_full_force_and_choked_exhaust(choice):
    """At the favourable end: a load of 90 %, a piston of 70 %, 0.5 bar more, conductances 20 % wider, 15 K warmer."""
    area_a = math.pi / 4.0 * 0.032**2
    area_b = area_a - math.pi / 4.0 * choice.cylinder.numbers["rod_diameter"] ** 2
    mass = 0.9 * 4.0 + 0.7 * choice.cylinder.numbers["moving_mass"]
    for outward, area, against in ((True, area_a, 0.9 * 2.0 * G + 10.0), (False, area_b, -1.1 * 2.0 * G - 10.0)):
        least = math.sqrt(2.0 * 0.2 * mass / (6.5e5 * area - against))
        for factor, is_late in ((0.999, True), (1.001, False)):
            limits = dict(
                zip(("time", "return_time")[:: 1 if outward else -1], (f"{factor * least} s", "9 s"), strict=True)
            )
            task = SizingTask(**TASK | limits | {"incline": "30 deg", "external_force": "10 N"})
            lacks = SafeBounds(task, [choice.tube]).cylinder(choice.cylinder)
            assert (lacks is not None and lacks.limit == "time") == is_late, (outward, factor)
