"""Pictures of platforms: every mechanism has one, its labels lie apart, and a film shows the recorded poses."""

from __future__ import annotations

import os
import re
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import pneudrive as pn
from oracle.platforms import described
from pneudrive.cli.main import run as command
from pneudrive.report.platform import (
    FRAMES_S,
    LEG_PANELS,
    SHORTEST_S,
    draw_platform,
    platform_lines,
)
from pneudrive.report.render import INKS
from pneudrive.simulation.trajectory import save

KINDS = ["platform/3-rps", "platform/3-upu", "platform/6-ups", "platform/linear-delta"]
TRIPOD = Path(__file__).parents[3] / "examples" / "tripod.toml"


def machine(kind, rng):
    base, top = rng.uniform(150.0, 400.0), rng.uniform(60.0, 250.0)
    length = abs(base - top) + rng.uniform(200.0, 400.0)
    angles = rng.uniform(2.0, 25.0, 2) if kind == "platform/6-ups" else ()
    return pn.platform(pn.Circuit(**described(kind, base, top, length, *angles)))


def around_home(own, rng, count=20):
    return own.home + 0.01 * rng.standard_normal((count, len(own.home)))


@pytest.mark.parametrize("kind", KINDS)
def test_labels_lie_apart_and_inside(kind):
    rng = np.random.default_rng(4)
    for _ in range(10):
        own = machine(kind, rng)
        path = around_home(own, rng)
        figure = draw_platform(own, path)
        texts = [text for text in figure.axes[0].texts if text.get_text() != "simulated"]
        assert [text.get_text() for text in texts] == [str(i) for i, _ in enumerate(own.legs, start=1)]
        assert {text.get_color() for text in texts} == {INKS["black"][0]}
        boxes = [text.get_window_extent() for text in figure.axes[0].texts]
        paper = figure.bbox
        assert all(paper.x0 <= b.x0 and b.x1 <= paper.x1 and paper.y0 <= b.y0 and b.y1 <= paper.y1 for b in boxes)
        assert not any(one.overlaps(other) for one, other in combinations(boxes, 2))


@pytest.mark.parametrize("kind", KINDS)
def test_pistons_are_at_their_positions_and_joints_are_joined(kind):
    rng = np.random.default_rng(8)
    own = machine(kind, rng)
    poses = around_home(own, rng, 5)
    poses[:, own.coordinates.index("heave" if "heave" in own.coordinates else "z")] += 0.08
    lines, positions = list(platform_lines(own, poses)), own.inverse(poses)
    top = next(points for what, _, points in lines if what == "platform")
    for i, points in enumerate(points for what, _, points in lines if what == "piston"):
        if own.is_delta:
            direction = np.asarray(own.core.joints[2][i])
            moved = (points.mean(axis=1) - own.core.joints[0][i]) @ direction
        else:  # measured from the joint on the platform: the rod has one length
            moved = -np.linalg.norm(points[:, 1] - top[:, i], axis=1)
            moved += np.linalg.norm(top[:, i] - own.core.joints[0][i], axis=1)
        assert moved - moved[0] == pytest.approx(positions[:, i] - positions[0, i], abs=1e-12)


@pytest.fixture(scope="module")
def tripod_run(tmp_path_factory):
    path = tmp_path_factory.mktemp("run") / "run.parquet"
    circuit = pn.Circuit.load(TRIPOD)
    run = circuit.simulate({"valve_1": [(0.0, 0.3)], "valve_2": [(0.0, -0.2)]}, "0.2 s")
    save(run, path)
    return path


def test_a_page_of_a_run_shows_the_drawing_and_every_curve(tripod_run, tmp_path, printed):
    page = tmp_path / "run.html"
    assert command(["platform", str(TRIPOD), "--run", str(tripod_run), "--out", str(page)]) == 0
    text = page.read_text()
    assert text.count("<svg ") == 1
    assert "synthetic" in text
    for label, *_ in LEG_PANELS:
        assert label in text
    said = printed(["platform", TRIPOD, "--run", tripod_run])
    assert all(label in said for label, *_ in LEG_PANELS)
    tripod = pn.platform(pn.Circuit.load(TRIPOD))
    table = tmp_path / "run.csv"
    assert command(["platform", str(TRIPOD), "--run", str(tripod_run), "--out", str(table)]) == 0
    head = table.read_text().partition("\n")[0].split(",")
    assert {"tripod.heave_m", "tripod.smallest_singular_value", "tripod.leg_3_side_force_n"} < set(head)
    assert tripod._repr_html_().count("<svg") == 1


def test_a_dark_film_has_the_frames_of_the_run(tripod_run, tmp_path, monkeypatch, refusal):
    words = ["platform", str(TRIPOD), "--run", str(tripod_run), "--dark", "--out"]
    picture = tmp_path / "motion.gif"
    assert command([*words, str(picture)]) == 0
    with Image.open(picture) as film:
        assert abs(film.n_frames - SHORTEST_S * FRAMES_S[".gif"]) <= 1
        paper = film.convert("RGB").getpixel((0, 0))
        assert sum(paper) < 200
    monkeypatch.setenv("PATH", "")
    refusal([*words, tmp_path / "motion.mp4"], "the program ffmpeg is missing", "motion.gif")
    program = tmp_path / "ffmpeg"  # stands for the real one: counts the bytes of its frames
    program.write_text("#!/bin/sh\nfor last; do :; done\n/usr/bin/wc -c > $last\necho $* >> $last\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path) + os.pathsep)
    assert command([*words, str(tmp_path / "motion.mp4")]) == 0
    count, given = (tmp_path / "motion.mp4").read_text().splitlines()
    width, height = map(int, re.search(r"-s (\d+)x(\d+)", given).groups())
    assert width % 2 == height % 2 == 0
    assert int(count) == (SHORTEST_S * FRAMES_S[".mp4"] + 1) * 3 * width * height
    program.write_text("#!/bin/sh\necho no such codec >&2\nexit 1\n")
    refusal([*words, tmp_path / "other.mp4"], "no such codec")
    assert not (tmp_path / "other.mp4").exists()


WRONG = {
    "film at rest": (["--out", "motion.gif"], "motion.gif needs a run"),
    "no such run": (["--run", "run.parquet"], "run.parquet"),
    "suffix": (["--out", "motion.avi"], ".mp4"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_words_of_the_command_are_told(case, tmp_path, monkeypatch, refusal):
    monkeypatch.chdir(tmp_path)
    words, said = WRONG[case]
    refusal(["platform", TRIPOD, *words], said)
