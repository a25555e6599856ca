"""A new view costs one module with a function that returns a `View`, its test, and one line of the registry."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from page.conftest import Server
from page.test_journeys import Open, violations

#: The module of the view.
TOY = """
import numpy as np

from pneudrive.views import ShownCurve, ShownValue, View


def view_of_setup(workspace, path):
    text, _ = workspace.read(path)
    speed = np.array([0.01, 0.1, 1.0])
    known = np.ones(3, dtype=bool)
    curve = ShownCurve("c", "toy curve", speed, 30.0 + speed, "speed", "friction", "m/s", "N", None, known)
    lines = ShownValue("lines", path, "lines", str(len(text.splitlines())))
    reach = ShownValue("reach", path, "reach", 0.25, "m", (0.24, 0.26))
    return View("a toy", (lines, reach), (curve,), ("said by the toy",))
"""
#: The line of the registry, before the server starts.
MAIN = """
import sys

from pneudrive.cli.main import run
from pneudrive.web.results import SHOWN

SHOWN["setup"] = "toy:view_of_setup"
sys.exit(run(sys.argv[1:]))
"""


def test_a_toy_view_is_one_module_and_one_line(tmp_path: Path, open_tab: Open) -> None:
    (tmp_path / "toy.py").write_text(TOY)
    (tmp_path / "main.py").write_text(MAIN)
    folder = tmp_path / "studies"
    folder.mkdir()
    (folder / "cheap.toml").write_text("[sensors]\nposition = 1\n")
    words = [sys.executable, str(tmp_path / "main.py"), "web", str(folder), "--no-browser", "--port", "0"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout
    server = Server(folder, process.stdout.readline().strip(), process)
    try:
        tab = open_tab(server.address)
        page = tab.page
        page.click(".tree >> text=cheap.toml")
        page.wait_for_selector("td[data-value=reach][data-si='0.25']")
        assert page.inner_text("td[data-value=reach]") == "250 ± 10"
        page.wait_for_selector("figure[data-plot='friction over speed'][data-points='3'] canvas")
        page.wait_for_selector("text=said by the toy")
        assert violations(tab) == []
        tab.picture("toy-view")
        tab.check()
    finally:
        server.end()
