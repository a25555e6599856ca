"""The numbers in docs/theory are what the product gives today (tables that an example prints: `test_examples`)."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_the_printed_equations_are_wrong_by_as_much_as_the_page_says():
    """Exponents 1.4 and (k + 1)/2 = 1.2, and a frequency lower by the root of their ratio."""
    rows = (ROOT / "docs" / "theory" / "as-printed.md").read_text().splitlines()

    def values(what):
        row = next(line for line in rows if line.startswith(f"| {what}"))
        return [float(cell) for cell in row.strip("| ").split("|")[1:]]

    assert values("closed chamber without heat, exponent") == pytest.approx([1.4, 1.2], abs=2e-3)
    right, wrong = values("natural frequency")
    assert wrong / right == pytest.approx((1.2 / 1.4) ** 0.5, rel=2e-3)
