"""The numbers in docs/theory are what the product gives today: each table against the example that prints it."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(("script", "page"), [("as_printed", "as-printed.md"), ("linear_part", "flow.md")])
def test_a_table_in_the_documentation_is_what_its_example_prints(script, page, tmp_path):
    command = [sys.executable, str(ROOT / "examples" / f"{script}.py")]
    printed = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=True).stdout
    rows = [line for line in printed.splitlines() if line.startswith("|")]
    assert len(rows) > 5
    missing = [row for row in rows if row not in (ROOT / "docs" / "theory" / page).read_text().splitlines()]
    assert missing == [], f"docs/theory/{page} is out of date: copy what examples/{script}.py prints"


def test_the_printed_equations_are_wrong_by_as_much_as_the_page_says():
    """Exponents 1.4 and (k + 1)/2 = 1.2, and a frequency lower by the root of their ratio."""
    rows = (ROOT / "docs" / "theory" / "as-printed.md").read_text().splitlines()

    def values(what):
        row = next(line for line in rows if line.startswith(f"| {what}"))
        return [float(cell) for cell in row.strip("| ").split("|")[1:]]

    assert values("closed chamber without heat, exponent") == pytest.approx([1.4, 1.2], abs=2e-3)
    right, wrong = values("natural frequency")
    assert wrong / right == pytest.approx((1.2 / 1.4) ** 0.5, rel=2e-3)
