"""Write the notebooks of ``examples/`` from pages of the gallery: ``python tools/notebooks.py``.

A test executes them, and compares them with their pages.
"""

from __future__ import annotations

import posixpath
import re
from pathlib import Path

import nbformat
from myst_nb.core.read import read_myst_markdown_notebook

ROOT = Path(__file__).parents[1]
#: Page of the gallery -> notebook in ``examples/``.
NOTEBOOKS = {
    "first-minute": "1_first_minute.ipynb",
    "own-recording": "2_own_recording.ipynb",
    "model-holds": "3_does_the_model_hold.ipynb",
    "servo-axis": "4_servo_axis.ipynb",
    "size-a-drive": "5_size_a_drive.ipynb",
}


def notebook(page: str) -> nbformat.NotebookNode:
    """Return the cells of a page, named relative to ``docs/`` without suffix, as Jupyter shows them.

    Cells that serve the site only show their figure, or are left out. Links name files of the project.
    """
    book = read_myst_markdown_notebook((ROOT / "docs" / f"{page}.md").read_text("utf-8"))
    book.cells = [cell for cell in book.cells if "display=False" not in cell.source]
    for number, cell in enumerate(book.cells):
        if "from myst_nb import" in cell.source:
            cell.source, cell.metadata = "figure", nbformat.NotebookNode()
        cell.id = f"cell-{number}"  # random otherwise
        if cell.cell_type == "markdown":
            text = re.sub(r"\{[a-z:]+\}`([^`<]+?)(?: <[^`]*>)?`", r"\1", cell.source)
            cell.source = re.sub(r"\[\]\(([^)]+)\)", lambda link: _file(page, link[1]), text)
    return book


def _file(page: str, link: str) -> str:
    """Return the file of the project that a link of a page means."""
    return f"`{posixpath.normpath(posixpath.join('docs', posixpath.dirname(page), link))}`"


if __name__ == "__main__":
    for page, name in NOTEBOOKS.items():
        nbformat.write(notebook(f"gallery/{page}"), ROOT / "examples" / name)
        print(f"examples/{name}")
