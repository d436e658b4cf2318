"""The README: its examples give the answers printed there, its figures are measured."""

import contextlib
import io
import re
from importlib.util import find_spec
from pathlib import Path

import pytest

from validation.claims import stale, values

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
