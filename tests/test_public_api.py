"""Names, layering and errors that every user may meet."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import namlcp

CLIENT = Path(__file__).parent / "shared" / "typed_client.py"

METHODS = {
    "BatchResult": ("backward",),
    "ClosestPoint": ("backward",),
    "LCPResult": ("backward", "forward", "directional"),
    "QPResult": ("backward", "forward", "directional"),
    "Solver": ("update", "solve"),
}
"""The methods for users, by class; those of named tuples stand in their class."""


def public():
    """Yield all that users call, by name."""
    for name in namlcp.__all__:
        yield name, getattr(namlcp, name)
        for method in METHODS.get(name, ()):
            yield f"{name}.{method}", getattr(getattr(namlcp, name), method)


def test_public_names():
    assert namlcp.__all__ == sorted(namlcp.__all__)


@pytest.mark.parametrize(("name", "what"), list(public()))
def test_every_public_name_has_an_example(name, what):
    """`test_doctests` runs them all."""
    assert ">>> " in what.__doc__


def test_a_typed_client_passes_mypy(tmp_path):
    """With the package's own hints, from outside, and as strictly as mypy can."""
    pytest.importorskip("mypy")
    if "editable" in type(namlcp.__loader__).__module__:
        pytest.skip("mypy does not find a package that is installed in place")
    options = "--strict", "--no-error-summary", "--cache-dir", str(tmp_path)
    done = subprocess.run(
        [sys.executable, "-m", "mypy", *options, str(CLIENT)],
        capture_output=True, text=True, check=False, cwd=tmp_path,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_the_typed_client_runs():
    assert subprocess.run([sys.executable, CLIENT], check=False).returncode == 0


def test_import_prints_nothing_and_warns_of_nothing():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "import namlcp.qp.interior.loop"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout) == (0, ""), done.stderr


def test_what_takes_long_to_import_is_imported_where_it_is_used():
    late = {"pyamg", "joblib", "tqdm", "dask", "cvxpy", "torch"}
    code = f"import namlcp, sys; sys.exit(not {late}.isdisjoint(sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_results_can_be_compared_without_an_error():
    result = namlcp.solve_qp(np.eye(2), np.ones(2))
    assert result == result
    assert result != namlcp.solve_qp(np.eye(2), np.ones(2))


@pytest.mark.parametrize("status", namlcp.Status)
def test_every_status_explains_itself(status):
    assert status.value == status.name.lower()
    assert status.explanation.endswith(".")


def test_warmup_says_that_it_does_nothing():
    with pytest.warns(DeprecationWarning, match="compiled when it is installed"):
        namlcp.warmup()
