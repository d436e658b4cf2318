"""The README: its examples give the answers printed there, its figures are measured."""

import contextlib
import io
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from validation.claims import renewed, stale, values

README = Path(__file__).parents[1] / "README.md"
FENCE = re.compile(
    r"^(?:<!-- needs (\w+) -->\n)?```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL
)


def examples():
    """Return (needed package, code, what it prints) of the blocks of Python.

    The package is "" where none is needed, the text where none follows.
    """
    blocks = FENCE.findall(README.read_text())
    following = [*blocks[1:], ("", "", "")]
    return [
        (package, code, text if kind == "text" else "")
        for (package, language, code), (_, kind, text) in zip(
            blocks, following, strict=True
        )
        if language == "python"
    ]


def test_examples_print_what_stands_below_them():
    """They share their names, as if typed one after another."""
    pytest.importorskip("cvxpy")
    names = {}
    assert len(examples()) > 5
    for package, code, printed in examples():
        if package and find_spec(package) is None:
            continue
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            exec(code, names)
        assert said.getvalue() == printed


def test_figures_are_those_of_the_results():
    text = README.read_text()
    assert text.count("<!-- ") > 5
    assert stale(text, values()) == []


def test_tables_are_those_of_the_results():
    for package in ("cvxpy", "matplotlib"):
        pytest.importorskip(package)
    from validation.page import documents

    for document in documents.DOCUMENTS:
        assert documents.faults(document) == []


def test_stale_figures_are_found_and_renewed():
    known = {"time": 0.784, "solved": 134.0, "error": 3.06e-10}
    text = "0.78<!-- time -->, 134<!-- solved --> and 3.1e-10<!-- error -->"
    assert stale(text, known) == []
    assert renewed(text, known) == text
    later = known | {"time": 0.79, "error": 2e-9}
    faults = ["time: 0.78, measured 0.79", "error: 3.1e-10, measured 2e-09"]
    assert stale(text, later) == faults
    new = "0.79<!-- time -->, 134<!-- solved --> and 2.0e-9<!-- error -->"
    assert renewed(text, later) == new
    assert stale("1<!-- speed -->", known) == ["speed: 1, not measured"]
    assert renewed("1<!-- speed -->", known) == "1<!-- speed -->"
