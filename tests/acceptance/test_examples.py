"""Every example runs by itself, in an empty folder, without a warning; pages have the tables that some print."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
#: Example -> page with the lines that it prints, how they begin, and how many there are at least.
PAGES = {
    "friction_of_seals": ("README.md", "", 11),
    "as_printed": ("docs/theory/as-printed.md", "|", 6),
    "identified_to_controlled": ("docs/guide/identified-to-controlled.md", "|", 17),
    "linear_part": ("docs/theory/flow.md", "|", 6),
}


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(script, tmp_path):
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    page, begins, fewest = PAGES.get(script.stem, ("README.md", "", 0))
    rows = [row for row in done.stdout.splitlines() if fewest and row.startswith(begins)]
    assert len(rows) >= fewest
    missing = [row for row in rows if row not in (ROOT / page).read_text(encoding="utf-8").splitlines()]
    assert missing == [], f"{page} is out of date: copy what {script.name} prints, renew its figure"
