"""Every example runs by itself, in an empty folder, without a warning; pages have the tables that some print."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest

from page.conftest import ROOT

EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: Example -> page with the lines that it prints, how they begin, and how many there are at least.
PAGES = {
    "friction_of_seals": ("docs/theory/fit.md", "", 11),
    "as_printed": ("docs/theory/as-printed.md", "|", 6),
    "identified_to_controlled": ("docs/tutorials/identified-to-controlled.md", "|", 17),
    "linear_part": ("docs/theory/flow.md", "|", 6),
}


NUMBER = re.compile(r"-?\d+(?:\.\d+)?")
#: Share by which numbers that follow from a fit may differ: linear algebra rounds otherwise on other processors,
#: and the error of a law that learns moved by 8 % with that.
SHARE = 0.12


def _agree(row, other):
    """Say whether two rows have the same words, and numbers that agree."""
    if NUMBER.sub("", row) != NUMBER.sub("", other):
        return False
    numbers = zip(NUMBER.findall(row), NUMBER.findall(other), strict=True)
    return all(one == two or abs(float(one) - float(two)) <= SHARE * abs(float(two)) for one, two in numbers)


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(script, tmp_path):
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    page, begins, fewest = PAGES.get(script.stem, ("README.md", "", 0))
    rows = [row for row in done.stdout.splitlines() if fewest and row.startswith(begins)]
    assert len(rows) >= fewest
    known = (ROOT / page).read_text(encoding="utf-8").splitlines()
    missing = [row for row in rows if not any(_agree(row, one) for one in known)]
    assert missing == [], f"{page} is out of date: copy what {script.name} prints, renew its figure"
