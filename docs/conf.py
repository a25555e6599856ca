"""Sphinx configuration."""

import sys
from importlib import import_module
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from benches.quoted import quoted

project = "pneudrive"
author = "the pneudrive developers"
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "sphinxcontrib.bibtex"]
exclude_patterns = ["_build"]
html_theme = "pydata_sphinx_theme"
html_title = "pneudrive"
html_favicon = "../page/public/icon.svg"  # without it a browser asks for one that is not there
html_context = {"default_mode": "auto"}  # of light and dark; left out, the theme complains in the browser
# Formulas are drawn by what the page's lock names, so that no page asks another machine for anything.
html_static_path = [str(Path(__file__).parents[1] / "page/node_modules/mathjax/es5/tex-svg.js")]
mathjax_path = "tex-svg.js"
bibtex_bibfiles = ["../references.bib"]
myst_enable_extensions = ["dollarmath", "amsmath", "deflist", "substitution"]
myst_substitutions = quoted()
nb_execution_mode = "cache"
nb_execution_timeout = 300  # s; on a busy machine a cell takes ten times as long
nb_render_markdown_format = "myst"
nb_execution_raise_on_error = True
autodoc_typehints = "description"
# Words of a docstring's types ("shape (n,)") are no references, though attributes of that name exist.
suppress_warnings = ["ref.python"]

# Names that a package imports when they are asked for have to be there before autodoc looks at it.
for package in ("pneudrive.describe", "pneudrive.characterise", "pneudrive.rig"):
    module = import_module(package)
    for name in module.__all__:
        getattr(module, name)
