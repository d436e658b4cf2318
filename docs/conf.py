"""The documentation: MyST pages, the theme furo, the reference from the docstrings."""

import contextlib
import io
import sys
from pathlib import Path

import namlcp

sys.path.insert(0, str(Path(__file__).parents[1]))
from examples import EXAMPLES, show_example

project = "namlcp"
author = "The namlcp authors"
copyright = "2026, The namlcp authors"
version = release = namlcp.__version__

extensions = [
    "myst_parser",
    "numpydoc",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
exclude_patterns = ["_build"]

default_role = "py:obj"
add_module_names = False
autodoc_member_order = "bysource"
autodoc_typehints = "none"  # the docstrings say more: shapes
numpydoc_show_class_members = False

html_theme = "furo"
html_title = f"namlcp {release}"
html_show_copyright = False

PICTURES = Path(__file__).parent / "pictures"


def draw_examples(app):
    """Run the examples and draw the pictures of the gallery."""
    PICTURES.mkdir(exist_ok=True)
    for name in EXAMPLES:
        picture = PICTURES / f"{name}.png"
        if not picture.exists():
            with contextlib.redirect_stdout(io.StringIO()):
                show_example(name, str(picture))


def escape_bars(app, what, name, obj, options, lines):
    """Let |x| be a modulus; reStructuredText would look for a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Draw before the pages are read."""
    app.connect("builder-inited", draw_examples)
    app.connect("autodoc-process-docstring", escape_bars)
