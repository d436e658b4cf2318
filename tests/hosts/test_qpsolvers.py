"""What qpsolvers alone has: how it finds us, the forms it hands over, its errors."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from qpsolvers import Problem, solve_ls, solve_problem
from qpsolvers import problems as host
from qpsolvers.exceptions import ParamError, SolverError
from test_conformance import TEXTBOOK

import namlcp.qpsolvers


def solve(data=TEXTBOOK, **settings):
    return solve_problem(Problem(**data), solver="nam", **settings)


def test_registered_once_and_again():
    namlcp.qpsolvers.register()
    for names in ("available", "dense", "sparse"):
        assert getattr(qpsolvers, f"{names}_solvers").count("nam") == 1


@pytest.mark.parametrize("order", ["namlcp, qpsolvers", "qpsolvers, namlcp"])
def test_registered_in_either_order_of_import(order):
    code = (
        f"import {order}\n"
        "assert 'nam' in qpsolvers.available_solvers\n"
        "import sys\n"
        "assert 'cvxpy' not in sys.modules or 'osqp' in sys.modules\n"
        "assert 'matplotlib.pyplot' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize("key", ["nam", "namlcp"])
@pytest.mark.parametrize("order", ["qpsolvers, namlcp", "namlcp, qpsolvers"])
def test_qpsolvers_may_have_a_backend_that_imports_namlcp(tmp_path, order, key):
    """In the middle of its own import; what it has by this key stays."""
    solvers = tmp_path / "qpsolvers" / "solvers"
    shutil.copytree(Path(qpsolvers.__file__).parent, tmp_path / "qpsolvers")
    (solvers / "own_.py").write_text("from namlcp import solve_qp as own\n")
    with open(solvers / "__init__.py", "a") as file:
        file.write(f"\nfrom .own_ import own\nsolve_function[{key!r}] = own\n")
        for names in ("available", "dense", "sparse"):
            file.write(f"{names}_solvers.append({key!r})\n")
    code = (
        f"import {order}, namlcp.qpsolvers\n"
        f"assert qpsolvers.__file__.startswith({str(tmp_path)!r})\n"
        "for _ in range(2):\n"
        "    namlcp.qpsolvers.register()\n"
        "table = qpsolvers.solvers.solve_function\n"
        f"assert table[{key!r}] is namlcp.solve_qp\n"
        "for names in ('available', 'dense', 'sparse'):\n"
        "    assert getattr(qpsolvers, names + '_solvers').count('nam') == 1\n"
    )
    path = os.pathsep.join((str(tmp_path), os.environ.get("PYTHONPATH", "")))
    env = os.environ | {"PYTHONPATH": path}
    subprocess.run([sys.executable, "-c", code], check=True, env=env)


def test_unique_multipliers_are_the_hosts():
    problem, reference = host.get_qpsut01()
    answer = solve_problem(problem, solver="nam")
    for name in ("y", "z", "z_box"):
        error = getattr(answer, name) - getattr(reference, name)
        assert np.linalg.norm(error) < 1e-7


def test_without_rows_multipliers_are_empty():
    answer = solve_problem(host.get_qpsut03()[0], solver="nam")
    parts = answer.x, answer.y, answer.z, answer.z_box
    assert [v.shape for v in parts] == [(4,), (0,), (0,), (4,)]
    assert solve({"P": np.eye(2), "q": np.ones(2)}).z_box.size == 0


def test_large_sparse_least_squares():
    R, s, G, h, A, b, lb, ub = host.get_sparse_least_squares(15_000)
    for conversion in (False, True):
        x = solve_ls(
            R, s, G, h, A, b, lb, ub, solver="nam", sparse_conversion=conversion
        )
        assert x is not None
        assert (G @ x - h).max() < 1e-10
        assert np.abs(A @ x - b).max() < 1e-10
        assert x.min() >= -1e-10


class Hostile:
    """An array-like that raises what the host would misread."""

    def __array__(self, *args, **kwargs):
        raise KeyError("no array")


@pytest.mark.parametrize(
    ("start", "error", "text"),
    [
        ({"initvals": np.ones(5)}, ParamError, r"initvals must have shape \(3,\)"),
        ({"initvals": np.full(3, np.nan)}, ParamError, "initvals must be finite"),
        ({"warm_start": 3}, ParamError, "warm_start must be a QPResult"),
        ({"initvals": Hostile()}, SolverError, "KeyError"),
    ],
)
def test_bad_starts_are_named(start, error, text):
    with pytest.raises(error, match=text):
        solve(**start)


def test_warm_starts_give_the_same_answer():
    cold = solve()
    for settings in ({"initvals": cold.x}, {"warm_start": cold}):
        warm = solve(**settings)
        np.testing.assert_allclose(warm.x, cold.x, atol=1e-12)
        assert warm.extras["iterations"] <= 1
    failed = solve(TEXTBOOK | {"ub": np.full(3, -1e3)})
    assert not failed.found
    np.testing.assert_allclose(solve(warm_start=failed).x, cold.x, atol=1e-12)


def test_time_limit_keeps_the_best_point_of_the_bounds_form():
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(40, 40))
    P = sp.csc_matrix(sp.kron(line, sp.eye_array(40)) + sp.kron(sp.eye_array(40), line))
    q = np.random.default_rng(0).standard_normal(1600)
    answer = solve({"P": P, "q": q, "lb": np.zeros(1600)}, time_limit=1e-6)
    assert answer.found is False
    assert answer.extras["status"] == "time_limit"
    assert answer.extras["form"] == "bounds"
    residual = np.linalg.norm(np.minimum(answer.x, P @ answer.x + q))
    assert residual < np.linalg.norm(np.minimum(0.0, q))


def test_the_closest_point_of_an_infeasible_problem():
    h = np.array([0.0, -3.0])
    data = {"P": np.eye(1), "q": np.zeros(1), "G": np.array([[1.0], [-1.0]]), "h": h}
    answer = solve(data, infeasible="closest")
    assert not answer.found
    assert answer.obj == np.inf
    np.testing.assert_allclose(answer.x, [1.5])
    np.testing.assert_allclose(answer.extras["closest"].shift_h, [1.5, 1.5])
    assert answer.z_box.size == 0
    assert answer.extras["certificate"]["z"] @ h == pytest.approx(-1.0)
    assert solve(data).x is None
    answer = solve(data, infeasible=namlcp.Relaxation(h=[2.0, 1.0]))
    np.testing.assert_allclose(answer.extras["closest"].shift_h, [1.0, 2.0])
