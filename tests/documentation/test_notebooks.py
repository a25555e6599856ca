"""The notebooks of ``examples/`` run, and are the pages of the gallery."""

from __future__ import annotations

from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

from page.conftest import ROOT
from tools.notebooks import NOTEBOOKS, notebook


@pytest.mark.parametrize("page", NOTEBOOKS)
def test_a_notebook_is_its_page_and_runs(page: str, tmp_path: Path) -> None:
    book = nbformat.read(ROOT / "examples" / NOTEBOOKS[page], as_version=4)
    assert book.cells == notebook(f"gallery/{page}").cells, "run python tools/notebooks.py"
    NotebookClient(book, timeout=300, resources={"metadata": {"path": str(tmp_path)}}).execute()
    assert "image/png" in str(book.cells)
