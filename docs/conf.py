"""The documentation site: `sphinx-build -W -c docs . docs/_build/html`.

Its source is the whole checkout, so that a link between two pages holds here and on a code host alike.
"""

import importlib
import os
import pkgutil
import re
import sys
from pathlib import Path

from sphinx.util.docutils import SphinxDirective

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "src"))

import repose  # noqa: E402

# The notebook's matrices are small: threads cost more than they gain.
os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

project = "repose"
author = "The repose developers"
version = release = repose.__version__
html_title = f"repose {version}"

root_doc = "docs/index"
include_patterns = [
    "*.md",
    "benchmarks/*.md",
    "config/*.md",
    "docs/**.md",
    "examples/*.md",
    "research/**.md",
    "resources/*.md",
    "src/repose/dem/README.md",
]
exclude_patterns = [
    ".*",
    "build",
    "dist",
    "docs/_build",
    "paper.md",
    "results",
    "tests",
    "workflow",
]

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_copybutton",
]
# docs/notebook.md runs here, but not in .ci/run; a cell that fails ends the build.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 600

myst_heading_anchors = 4
myst_enable_extensions = ["dollarmath"]
# myst-nb.lexer: .ci/run builds the notebook without running it, and only a run gives the cells' language. ref.python: a
# type in a docstring may have the name of several attributes.
suppress_warnings = ["myst.header", "myst-nb.lexer", "ref.python"]

# Docstrings are NumPy style; a name in single backquotes is code.
default_role = "code"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_ivar = True
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_default_options = {
    "members": True,
    "ignore-module-all": True,
    # Written by scikit-learn itself.
    "exclude-members": "set_fit_request, set_predict_request, set_score_request",
}

html_theme = "furo"
# The first page of the site lies in docs/.
html_extra_path = ["site"]


def as_prose(app, what, name, obj, options, lines):
    """Docstrings are prose: a bar is a bar, and a last underscore belongs to its name; neither is a reference."""
    for number, line in enumerate(lines):
        parts = line.split("`")
        for outside in range(0, len(parts), 2):
            text = re.sub(r"(?<!\\)\|", r"\\|", parts[outside])
            parts[outside] = re.sub(r"(?<=[A-Za-z0-9])_(?!\w)", r"\\_", text)
        lines[number] = "`".join(parts)


class Modules(SphinxDirective):
    """Show every module of a package, in alphabetical order: `.. modules:: PACKAGE`."""

    required_arguments = 1

    def run(self):
        package = importlib.import_module(self.arguments[0])
        lines = [
            f".. automodule:: {package.__name__}.{module.name}"
            for module in pkgutil.iter_modules(package.__path__)
        ]
        return self.parse_text_to_nodes("\n".join(lines))


def setup(app):
    app.add_directive("modules", Modules)
    # after napoleon, which comes at 500
    app.connect("autodoc-process-docstring", as_prose, priority=600)
