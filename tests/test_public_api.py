"""Names, layering and errors that every user may meet."""

import subprocess
import sys

import numpy as np
import pytest

import namlcp


def test_public_names():
    assert namlcp.__all__ == sorted(namlcp.__all__)
    assert all(getattr(namlcp, name).__doc__ for name in namlcp.__all__)


def test_import_prints_nothing_and_warns_of_nothing():
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", "import namlcp.qp.path.loop"],
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
