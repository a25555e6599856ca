"""The current folder has no say in pictures: settings of matplotlib that lie in it are not read."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from subprocess import run

import pytest

DRAW = """
import sys
import warnings

warnings.simplefilter("ignore")
if "command" in sys.argv:
    from pneudrive.cli.main import run

    assert run(["draw", "catalogue:reference", "--out", "a.svg"]) == 0
else:
    import pneudrive as pn
    from pneudrive.report.page import svg_text
    from pneudrive.report.style import applied, new_figure

    with applied():
        figure = new_figure(2.0)
        figure.subplots().plot([0, 1], [0, 1], label="$x_1$")
        open("a.svg", "w").write(svg_text(figure))
"""
FOREIGN = {
    "none": None,
    "latex": b"text.usetex: True\ntext.latex.preamble: \\input{x}\n",
    "bytes": b"\xff\xfe",
    "sizes": b"font.size: 40\nlines.linewidth: 9\nsvg.fonttype: none\naxes.prop_cycle: cycler(color=['r'])\n",
}


def drawn(folder: Path, how: str) -> bytes:
    environment = {name: value for name, value in os.environ.items() if not name.startswith("MATPLOTLIB")}
    line = [sys.executable, "-c", DRAW, how]
    done = run(line, cwd=folder, env=environment, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    return (folder / "a.svg").read_bytes()


@pytest.mark.parametrize("how", ["command", "python"])
def test_pictures_are_the_same_in_every_folder(tmp_path: Path, how: str) -> None:
    pictures = set()
    for name, settings in FOREIGN.items():
        folder = tmp_path / name
        folder.mkdir()
        if settings is not None:
            (folder / "matplotlibrc").write_bytes(settings)
        pictures.add(drawn(folder, how))
    assert len(pictures) == 1
