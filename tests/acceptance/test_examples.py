"""Every example runs by itself, in an empty folder, without a warning; one prints the table of the first page."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run(script, tmp_path):
    command = [sys.executable, "-W", "error", str(script)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout
    if script.stem == "friction_of_seals":
        rows, page = done.stdout.splitlines(), (ROOT / "README.md").read_text(encoding="utf-8").splitlines()
        assert len(rows) > 10
        missing = [row for row in rows if row not in page]
        assert missing == [], f"README.md is out of date: copy what {script.name} prints, renew its figure"
