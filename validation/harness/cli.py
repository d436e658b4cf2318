"""What the command lines of all scripts have in common."""

import argparse
import os
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from validation.harness.machine import THREADS, lines

ROOT = Path(__file__).resolve().parents[2]
RESULTS, FIGURES = ROOT / "validation" / "results", ROOT / "validation" / "figures"
MISSING = 2  # what a script returns upon a MissingDataError
USUAL: dict[str, dict[str, Any]] = {
    "data": {"type": Path, "help": "the data folder"},
    "quick": {"action": "store_true", "help": "smaller problems, or fewer"},
    "limit": {"type": float, "default": 10.0, "help": "[s] a problem"},
    "csv": {"type": Path, "help": "write all rows to this file"},
    "go-on": {"action": "store_true", "help": "keep the rows of the file"},
    "results": {"type": Path, "default": RESULTS, "help": "folder of CSV files"},
    "figures": {"type": Path, "default": FIGURES, "help": "folder of figures"},
}


class MissingDataError(Exception):
    """The data folder, which is no part of this repository, lacks what is named."""


def require(path: Path) -> Path:
    if not path.exists():
        raise MissingDataError(f"{path} is missing")
    return path


def parser(doc: str | None, *names: str, **defaults: Any) -> Any:
    """Return a parser described by a module's docstring, with usual options.

    Those of `defaults` have another default; one of `...` makes an option required.
    """
    parser = argparse.ArgumentParser(
        description=doc, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    for name in (*names, *defaults):
        given = dict(USUAL[name])
        if defaults.get(name) is ...:
            given["required"] = True
        elif name in defaults:
            given["default"] = defaults[name]
        parser.add_argument(f"--{name}", **given)
    return parser


def begin(solvers: Iterable[str] = (), *more: str) -> list[str]:
    """Set one thread for the child processes; print and return the CSV header."""
    for library in THREADS:
        os.environ[f"{library}_NUM_THREADS"] = "1"
    header = [*lines(solvers), *more]
    print("\n".join(header), flush=True)
    return header
