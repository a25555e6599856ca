"""Sphinx configuration."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import nbformat
from myst_nb.core.read import is_myst_markdown_notebook
from sphinx.application import Sphinx

sys.path.insert(0, str(Path(__file__).parents[1]))

from benches.quoted import quoted
from tools.notebooks import notebook

project = "pneudrive"
author = "the pneudrive developers"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx.ext.mathjax"]
extensions += ["sphinx_design", "sphinxcontrib.bibtex"]
templates_path = ["_templates"]
exclude_patterns = ["_build", "_templates"]
html_theme = "pydata_sphinx_theme"
html_title = "pneudrive"
html_favicon = "../page/public/icon.svg"  # without it a browser asks for one that is not there
html_context = {"default_mode": "auto"}  # of light and dark; left out, the theme complains in the browser
# Formulas are drawn by what the page's lock names, so that no page asks another machine for anything.
html_static_path = [str(Path(__file__).parents[1] / "page/node_modules/mathjax/es5/tex-svg.js")]
mathjax_path = "tex-svg.js"
bibtex_bibfiles = ["../references.bib"]
myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "substitution"]
myst_substitutions = quoted()
nb_execution_mode = "cache"
nb_execution_timeout = 300  # s; on a busy machine a cell takes ten times as long
nb_render_markdown_format = "myst"
nb_execution_raise_on_error = True
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
# Words of a docstring's types ("shape (n,)") are no references, though attributes of that name exist.
suppress_warnings = ["ref.python"]

# The reference shows names as a user types them, after `import pneudrive as pn`.
for path in ("", ".control", ".ensemble", ".errors", ".mujoco", ".report", ".rig", ".units"):
    sys.modules[f"pn{path}"] = import_module(f"pneudrive{path}")
napoleon_use_ivar = True  # the fields of a class stand in a list, not as members

html_theme_options = {"secondary_sidebar_items": ["page-toc", "notebook", "sourcelink"]}


def write_notebook(app: Sphinx, page: str, template: str, context: dict[str, Any], *rest: object) -> None:
    """Write the cells of an executed page as a notebook, to which its side bar links."""
    path = Path(app.srcdir, f"{page}.md")
    if path.is_file() and is_myst_markdown_notebook(path.read_text("utf-8")):
        target = Path(app.outdir, "_notebooks", f"{page}.ipynb")
        target.parent.mkdir(parents=True, exist_ok=True)
        nbformat.write(notebook(page), target)
        context["notebook"] = f"_notebooks/{page}.ipynb"


def setup(app: Sphinx) -> None:
    """Offer pages as notebooks, and show no signature of a class: functions or files give its values."""
    app.connect("html-page-context", write_notebook)
    app.connect("autodoc-process-signature", lambda app, what, *rest: ("", None) if what == "class" else None)
