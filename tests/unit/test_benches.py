"""Benches, tools, oracles and trials find what they import; the page of results of control has its measured values."""

import ast
import json
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

from benches import ensemble
from benches.control_results import PAGE, VALUES, page

ROOT = Path(__file__).parents[2]


def imported(folder: str) -> set[tuple[str, str]]:
    """Return module and name of each import from the package, but types of the core, which only its stub names."""
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in (ROOT / folder).rglob("*.py")]
    nodes = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)]
    modules = [(node.module or "", node.names) for node in nodes if not node.level]
    own = [(module, names) for module, names in modules if module.split(".")[0] == "pneudrive"]
    return {(module, name.name) for module, names in own if module != "pneudrive._core" for name in names}


@pytest.mark.parametrize("folder", ["benches", "tools", "tests/oracle", "trials"])
def test_what_is_imported_exists(folder):
    names = imported(folder)
    assert names
    assert not {(m, n) for m, n in names if not hasattr(import_module(m), n) and not find_spec(f"{m}.{n}")}


def test_the_bench_of_ensembles_runs():
    final_m, _, stroke_s = ensemble.ours(4, 1).T
    assert (abs(final_m) < 1e-3).all()
    assert (stroke_s > 0.1).all()


def test_the_page_is_that_of_the_measured_values():
    assert PAGE.read_text(encoding="utf-8") == page(json.loads(VALUES.read_text(encoding="utf-8")))
