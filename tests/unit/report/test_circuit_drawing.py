"""Drawings of circuits: no block, line or text on another, nothing outside, every port joined as it is described."""

from __future__ import annotations

from itertools import combinations
from pathlib import Path

import pytest

import pneudrive as pn
from pneudrive.cli.main import run
from pneudrive.report.circuit import layout as blocks
from pneudrive.report.circuit.svg import arranged, circuit_shapes, draw_circuit

DATA = Path(__file__).parents[2] / "data"
EXAMPLES = Path(__file__).parents[3] / "examples"


def dense():
    """Return three axes with all there is: silencers, tubes, flow controls or a quick exhaust valve, loads, springs."""
    return pn.Circuit.load(DATA / "dense.toml")


def simple():
    drive = pn.Drive.load("catalogue:parker-osp-p25-sy5000")
    line = {"length": "1 m", "diameter": "4 mm"}
    return drive.replace({"tubing": {"a": line}, "load": {"mass": "3 kg"}}).circuit


def held():
    """Return a tandem cylinder that piloted check valves hold, and what its rod moves and runs into."""
    return pn.Circuit.load(DATA / "held.toml")


def vacuum():
    """Return a compressor with a receiver, and an ejector behind a soft-start valve; a leak to another supply."""
    return pn.Circuit.load(DATA / "vacuum.toml")


CIRCUITS = {
    "tripod": lambda: pn.Circuit.load(EXAMPLES / "tripod.toml"),
    "two cylinders": lambda: pn.Circuit.load(EXAMPLES / "two_cylinders.toml"),
    "lines": lambda: pn.Circuit.load(EXAMPLES / "one_cylinder_with_lines.toml"),
    "cushions": lambda: pn.Circuit.load(EXAMPLES / "cushioned_axis.toml"),
    "pulses": lambda: pn.Circuit.load(EXAMPLES / "pwm_axis.toml"),
    "drive": simple,
    "dense": dense,
    "held": held,
    "vacuum": vacuum,
}


@pytest.mark.parametrize("name", CIRCUITS)
def test_nothing_lies_on_anything_and_everything_is_joined(name):
    circuit = CIRCUITS[name]()
    placed, joints, routes = arranged(circuit)
    for one, other in combinations(placed.values(), 2):
        a, b = one.rectangle(), other.rectangle()
        assert a[0] >= b[2] or b[0] >= a[2] or a[1] >= b[3] or b[1] >= a[3], (one.name, other.name)
    cells = {cell for block in placed.values() for cell in block.cells()}
    for number, joint in enumerate(joints):
        pins, steps = {placed[port.component].port(port.name) for port in joint.ports}, routes.lines[number]
        points = {point for step in steps for point in step}
        assert points & cells <= pins
        found, todo = set(), [next(iter(pins))]
        while todo:
            at = todo.pop()
            found.add(at)
            todo += [p for step in steps if at in step for p in step if p not in found]
        assert pins <= found
    for (one, way), (other, across) in combinations(enumerate(routes.lines), 2):
        assert not way.keys() & across.keys()
        shared = {p for step in way for p in step} & {p for step in across for p in step}
        assert all({routes.through[p][one], routes.through[p][other]} == {"h", "v"} for p in shared)
    joined = sorted(sorted(f"{c}.{p}" for c, p in net) for net in circuit_shapes(circuit).nets)
    described = [joint for joint in circuit.wiring.joints if len(joint.ports) > 1 and not joint.ambient]
    assert joined == sorted(sorted(port.id for port in joint.ports) for joint in described)
    marks = {f"{name}.{port}" for name, block in placed.items() for port, m in block.marks.items() if m == "exhaust"}
    assert marks == {port.id for joint in circuit.wiring.joints if joint.ambient for port in joint.ports}


@pytest.mark.parametrize("name", CIRCUITS)
def test_no_text_lies_outside_or_on_another(name):
    circuit = CIRCUITS[name]()
    figure = draw_circuit(circuit)
    figure.canvas.draw()
    paper = figure.bbox
    boxes = [text.get_window_extent() for text in figure.axes[0].texts if text.get_text().strip()]
    for box in boxes:
        assert paper.x0 <= box.x0 <= box.x1 <= paper.x1
        assert paper.y0 <= box.y0 <= box.y1 <= paper.y1
    assert not any(a.overlaps(b) for a, b in combinations(boxes, 2))
    words = " ".join(text.get_text() for text in figure.axes[0].texts)
    assert all(f"{name} " in f"{words} " for name in circuit.components)
    assert all(volume in words for volume, _ in circuit.joint_volumes)
    assert words.endswith("after ISO 1219.")


def test_a_pilot_line_is_dashed_and_gas_is_not():
    circuit = held()
    placed, joints, routes = arranged(circuit)
    piloted = [number for number, joint in enumerate(joints) if any(port.is_pilot for port in joint.ports)]
    assert len(piloted) == 2
    for number in piloted:
        dashed = {point for step, is_pilot in routes.lines[number].items() if is_pilot for point in step}
        gas = {point for step, is_pilot in routes.lines[number].items() if not is_pilot for point in step}
        for port in joints[number].ports:
            assert placed[port.component].port(port.name) in (dashed if port.is_pilot else gas)
    drawn = [line for line in draw_circuit(circuit).axes[0].lines if line.is_dashed()]
    corners = {(x, y) for line in drawn for x, y in zip(*line.get_data(), strict=True)}
    assert all(placed[name].port("12") in corners for name in ("hold_a", "hold_b"))
    solid = {point for number, _ in enumerate(joints) for run in routes.runs(number, pilots=False) for point in run}
    assert not solid & {placed[name].port("12") for name in ("hold_a", "hold_b")}


def test_a_platform_is_drawn_above_its_cylinders_and_their_rods_do_not_cross():
    placed, joints, routes = arranged(CIRCUITS["tripod"]())
    top = placed["tripod"]
    legs = [block for own, block in placed.items() if own.startswith("leg_")]
    assert top.y > max(block.rectangle()[3] for block in legs)
    assert min(block.x for block in legs) < top.x < max(block.x for block in legs)
    rods = [{point for step in routes.lines[k] for point in step} for k, one in enumerate(joints) if blocks.is_rod(one)]
    assert not any(one & other for one, other in combinations(rods, 2))


def test_a_place_of_ones_own(tmp_path, printed):
    text = (EXAMPLES / "two_cylinders.toml").read_text()
    tank = 'kind = "tank"\nat = [40, 4]'
    path = tmp_path / "circuit.toml"
    path.write_text(text.replace('kind = "tank"', tank))
    placed, *_ = arranged(pn.Circuit.load(path))
    assert (placed["tank"].x, placed["tank"].y) == (40, 4)
    assert pn.Circuit.load(pn.Circuit.load(path).to_toml()).components["tank"].at == (40.0, 4.0)
    out = tmp_path / "circuit.svg"
    assert "joint of valve_l.4: 0.4 cm3" in printed(["draw", path, "--out", out])
    assert out.read_text().startswith("<?xml")
    before = out.read_bytes()
    assert run(["draw", str(path), "--out", str(out)]) == 0
    assert out.read_bytes() == before
    assert run(["draw", "catalogue:reference", "--out", str(tmp_path / "drive.png")]) == 0
    assert (tmp_path / "drive.png").read_bytes()[:4] == b"\x89PNG"


FAULTS = {
    "together": ('kind = "reservoir"\nat = [41, 5]', "mains and tank overlap", 'kind = "tank"', "Move tank"),
    "form": ('kind = "reservoir"\nat = "left"', "mains.at: 'left' is not a place", "at = ", "at = [12, 0]"),
    "number": ('kind = "reservoir"\nat = [1, "2 m"]', "mains.at: '2 m' is not a number", "at = ", "without unit"),
    "far": ('kind = "reservoir"\nat = [1, 1e9]', "mains.at: 1000000000.0 is out of bounds", "at = ", "not more"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_a_place_is_told(tmp_path, refusal, fault):
    new, what, mark, rest = FAULTS[fault]
    text = (EXAMPLES / "two_cylinders.toml").read_text().replace('kind = "reservoir"', new)
    text = text.replace('kind = "tank"', 'kind = "tank"\nat = [40, 4]')
    path = tmp_path / "circuit.toml"
    path.write_text(text)
    said = refusal(["draw", path, "--out", tmp_path / "x.svg"])
    line = next(n for n, one in enumerate(text.splitlines(), start=1) if mark in one)
    assert what in said
    assert f"{path}:{line + (fault == 'together')}" in said
    assert rest in said
    assert not (tmp_path / "x.svg").exists()
