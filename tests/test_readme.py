"""README and docs: examples give the answers printed there, figures are measured."""

import contextlib
import doctest
import io
import re
import shlex
from importlib.util import find_spec
from itertools import pairwise
from pathlib import Path

import pytest

from namlcp.__main__ import main
from validation.claims.documents import DOCUMENTS, faults
from validation.claims.figures import values

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
PAGES = [README, *sorted((ROOT / "docs").rglob("*.md"))]
FENCE = re.compile(
    r"^(?:<!-- needs (\w+) -->\n)?```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL
)
RUN = "python", "console"
"""Blocks that are run; those of bash install something."""


def examples(page):
    """Return (needed package, language, code, what it prints) of what can be run.

    The package is "" where none is needed, the text where none follows.
    """
    blocks = [*FENCE.findall(page.read_text()), ("", "", "")]
    return [
        (package, language, code, text if kind == "text" else "")
        for (package, language, code), (_, kind, text) in pairwise(blocks)
        if language in RUN
    ]


RUNNING = [page for page in PAGES if examples(page)]


def answer(language, code, names):
    """Return what a block prints; a console's, with its commands left out."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        if language == "python":
            exec(code, names)
        else:
            for line in code.splitlines():
                if line.startswith("$ namlcp "):
                    assert main(shlex.split(line)[2:]) == 0
    return said.getvalue()


@pytest.mark.parametrize("page", RUNNING, ids=lambda page: page.stem)
def test_examples_print_what_stands_below_them(page, tmp_path, monkeypatch):
    """Those of a page share their names, as if typed one after another.

    A console says "..." where times, versions or more lines stand.
    """
    pytest.importorskip("cvxpy")
    monkeypatch.chdir(tmp_path)
    names = {}
    for package, language, code, printed in examples(page):
        if package and find_spec(package) is None:
            continue
        said = answer(language, code, names)
        if language == "console":
            wanted = re.sub(r"^\$ .*\n", "", code, flags=re.MULTILINE)
            like = doctest.OutputChecker().check_output(wanted, said, doctest.ELLIPSIS)
            assert like, said
        else:
            assert said == printed, code


def test_figures_and_tables_are_those_of_the_results():
    front = README.read_text()
    assert front.count("<!-- ") > 5
    assert front.count("\n") <= 180
    assert set(PAGES) < set(DOCUMENTS)
    known = values()
    for document in DOCUMENTS:
        assert faults(document.read_text(), known) == [], document
