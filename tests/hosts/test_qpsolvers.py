"""The host's own problems through our door, and everything hosts may hand over."""

import subprocess
import sys

import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from qpsolvers import Problem, solve_ls, solve_problem, solve_qp
from qpsolvers import problems as host
from qpsolvers.exceptions import ParamError, ProblemError, SolverError

import namlcp.qpsolvers

SPARSE_CLASSES = [
    sp.csc_matrix, sp.csr_matrix, sp.coo_matrix, sp.csc_array, sp.csr_array,
    sp.coo_array, sp.lil_matrix, sp.dok_array, sp.bsr_array, sp.dia_array,
]  # fmt: skip


def textbook() -> dict:
    """Return a QP with every kind of constraint, all of them active somewhere."""
    return {
        "P": np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 2.0]]),
        "q": np.array([-1.0, -6.0, 1.0]),
        "G": np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]),
        "h": np.array([2.0, 1.5]),
        "A": np.array([[1.0, 1.0, 1.0]]),
        "b": np.array([1.0]),
        "lb": np.array([-5.0, -5.0, 0.1]),
        "ub": np.array([0.2, 5.0, 5.0]),
    }


def assert_exact(answer, eps=1e-10):
    """Check all that the host checks, and the signs that it does not."""
    problem = answer.problem
    assert answer.found, answer.extras
    assert answer.primal_residual() <= eps
    assert answer.dual_residual() <= eps
    assert answer.duality_gap() <= eps
    assert (answer.z >= 0.0).all()
    if problem.lb is not None:
        assert (answer.z_box[~np.isfinite(problem.lb)] >= 0.0).all()
    if problem.ub is not None:
        assert (answer.z_box[~np.isfinite(problem.ub)] <= 0.0).all()


def test_registered_once_and_again():
    namlcp.qpsolvers.register()
    assert qpsolvers.available_solvers.count("nam") == 1
    assert qpsolvers.dense_solvers.count("nam") == 1
    assert qpsolvers.sparse_solvers.count("nam") == 1


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


@pytest.mark.parametrize(
    "get",
    [host.get_qpsut01, host.get_qpsut02, host.get_qpsut04, host.get_qpsut05],
    ids=lambda g: g.__name__,
)
def test_host_problem_with_known_solution(get):
    problem, reference = get()
    answer = solve_problem(problem, solver="nam")
    assert np.linalg.norm(answer.x - reference.x) < 1e-8
    assert_exact(answer)


def test_host_problem_with_unique_multipliers():
    problem, reference = host.get_qpsut01()
    answer = solve_problem(problem, solver="nam")
    for name in ("y", "z", "z_box"):
        error = getattr(answer, name) - getattr(reference, name)
        assert np.linalg.norm(error) < 1e-7


def test_host_problem_without_rows_has_empty_multipliers():
    problem, _ = host.get_qpsut03()
    answer = solve_problem(problem, solver="nam")
    parts = answer.x, answer.y, answer.z, answer.z_box
    assert [v.shape for v in parts] == [(4,), (0,), (0,), (4,)]
    assert_exact(answer)


@pytest.mark.parametrize(
    "get",
    [host.get_qptest, host.get_qpgurdu, host.get_qpgurabs, host.get_qpgureq],
    ids=lambda g: g.__name__,
)
def test_host_problem_is_solved_exactly(get):
    assert_exact(solve_problem(get()[0], solver="nam"), 1e-8)


@pytest.mark.parametrize(("name", "value"), [("lb", -np.inf), ("ub", np.inf)])
def test_infinite_bounds(name, value):
    problem, _ = host.get_qpsut01()
    getattr(problem, name)[1] = value
    assert_exact(solve_problem(problem, solver="nam"))


def test_infinite_right_side_switches_a_row_off():
    problem, _ = host.get_qpsut01()
    problem.h[0] = np.inf
    answer = solve_problem(problem, solver="nam")
    assert answer.found
    assert answer.z[0] == 0.0
    P, q, G, h, *others = problem.unpack()
    smaller = Problem(P, q, G[1:], h[1:], *others)
    np.testing.assert_allclose(
        answer.x, solve_problem(smaller, solver="nam").x, atol=1e-9
    )


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


@pytest.mark.parametrize("kind", SPARSE_CLASSES, ids=lambda c: c.__name__)
def test_every_sparse_class(kind):
    dense = solve_problem(Problem(**textbook()), solver="nam")
    data = textbook()
    for name in ("P", "G", "A"):
        data[name] = kind(data[name])
    answer = solve_problem(Problem(**data), solver="nam")
    assert answer.found
    np.testing.assert_allclose(answer.x, dense.x, atol=1e-9)
    np.testing.assert_allclose(answer.z, dense.z, atol=1e-8)
    np.testing.assert_allclose(answer.z_box, dense.z_box, atol=1e-8)


def odd_forms():
    """Yield a textbook problem in forms that mean the same."""
    for name, matrix in textbook().items():
        frozen = matrix.copy()
        frozen.flags.writeable = False
        forms = {"read-only": frozen, "strided": np.repeat(matrix, 2, axis=0)[::2]}
        if matrix.ndim == 2:
            forms["sparse"] = sp.csc_matrix(matrix)
            forms["Fortran"] = np.asfortranarray(matrix)
        else:
            forms["column"] = matrix.reshape(-1, 1)
        for form, value in forms.items():
            yield f"{name} {form}", textbook() | {name: value}
    data = textbook()
    P, G, A = (data[name] for name in "PGA")
    yield "A one-dimensional", data | {"A": A.ravel()}
    yield "float32", {name: v.astype(np.float32) for name, v in data.items()}
    yield "integers", data | {"P": P.astype(int), "G": G.astype(np.int8)}
    yield "rounding asymmetry", data | {"P": P + 1e-12 * np.eye(3, k=1)}


@pytest.mark.parametrize("data", [pytest.param(d, id=n) for n, d in odd_forms()])
def test_odd_forms_are_taken_and_left_alone(data):
    before = {name: v.copy() for name, v in data.items() if not sp.issparse(v)}
    answer = solve_problem(Problem(**data), solver="nam")
    reference = solve_problem(Problem(**textbook()), solver="nam")
    assert answer.found
    np.testing.assert_allclose(answer.x, reference.x, atol=1e-6)
    for name, value in before.items():
        np.testing.assert_array_equal(data[name], value)


def test_unsorted_and_duplicate_entries():
    P = sp.csc_matrix(
        ([1.0, 1.0, 1.0, 4.0, 1.0], [1, 0, 0, 1, 0], [0, 3, 5]), shape=(2, 2)
    )
    copy = P.copy()
    assert not P.has_canonical_format
    answer = solve_problem(Problem(P, np.array([-3.0, -5.0])), solver="nam")
    assert answer.found
    np.testing.assert_allclose(answer.x, [1.0, 1.0], atol=1e-10)
    np.testing.assert_array_equal(P.indices, copy.indices)


@pytest.mark.parametrize("sparse", [False, True])
@pytest.mark.parametrize(
    ("name", "place", "value"),
    [("lb", 0, 0.3), ("lb", 1, np.inf), ("ub", 2, -np.inf), ("h", 0, -np.inf)],
)
def test_contradictions_are_not_found(name, place, value, sparse):
    data = textbook()
    data[name][place] = value
    if sparse:
        data["P"] = sp.csc_matrix(data["P"])
    answer = solve_problem(Problem(**data), solver="nam")
    assert answer.found is False
    assert answer.extras["status"] == "primal_infeasible"


def test_infeasible_rows_come_with_a_certificate():
    data = textbook()
    data["A"] = np.vstack((data["A"], data["A"]))
    data["b"] = np.array([1.0, 2.0])
    answer = solve_problem(Problem(**data), solver="nam")
    assert answer.found is False
    assert answer.extras["status"] == "primal_infeasible"
    proof = answer.extras["certificate"]
    y, z, z_box = proof["y"], proof["z"], proof["z_box"]
    s = data["A"].T @ y + data["G"].T @ z + z_box
    np.testing.assert_allclose(s, 0.0, atol=1e-8)
    side = np.where(z_box > 0.0, data["ub"], data["lb"])
    assert data["b"] @ y + data["h"] @ z + side @ z_box == pytest.approx(-1.0)


def test_unbounded_comes_with_a_ray():
    P, q = np.diag([1.0, 0.0]), np.array([0.0, -1.0])
    answer = solve_problem(Problem(P, q, lb=np.zeros(2)), solver="nam")
    assert answer.found is False
    assert answer.extras["status"] == "dual_infeasible"
    ray = answer.extras["certificate"]["x"]
    np.testing.assert_allclose(P @ ray, 0.0, atol=1e-9)
    assert (ray >= 0.0).all()
    assert q @ ray == pytest.approx(-1.0)
    assert solve_qp(P, q, lb=np.zeros(2), solver="nam") is None


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"q": np.ones(2)}, r"q must have shape \(3,\) to match P of shape \(3, 3\)"),
        ({"h": np.ones(3)}, r"h must have shape \(2,\) to match G of shape \(2, 3\)"),
        ({"G": np.ones((2, 4))}, "G must have 3 columns to match q"),
        ({"P": np.ones((3, 2))}, "P must be square"),
        ({"lb": np.ones(4)}, r"lb must have shape \(3,\)"),
        ({"q": np.array([1.0, np.nan, 0.0])}, r"q must be finite, got nan at \(1\)"),
        ({"h": np.array([1.0, np.nan])}, r"h must not hold NaN, got nan at \(1\)"),
        ({"b": np.array([np.inf])}, r"b must be finite, got inf at \(0\)"),
        ({"P": np.triu(textbook()["P"])}, r"P must be symmetric: max \|P - P'\|"),
        ({"P": np.diag([1.0, -1.0, 1.0])}, "P must be positive semidefinite"),
        ({"q": np.array([1j, 0, 0])}, "q must be an array of real numbers"),
        ({"P": sp.csc_matrix(np.diag([np.inf, 1.0, 1.0]))}, "P must be finite"),
    ],
)
def test_malformed_problems_are_named(change, text):
    problem = Problem(**{**textbook(), **change})
    with pytest.raises(ProblemError, match=text):
        solve_problem(problem, solver="nam")


@pytest.mark.parametrize(
    ("settings", "text"),
    [
        ({"maxiter": 3}, "unknown option 'maxiter'; did you mean 'max_iter'"),
        ({"eps_abs": -1.0}, "eps_abs must be >= 0, got -1.0"),
        ({"eps_abs": "small"}, "eps_abs must be a number, got 'small'"),
        ({"eps_abs": 0.0, "eps_rel": 0.0}, "must not both be 0"),
        ({"max_iter": 0}, "max_iter must be >= 1, got 0"),
        ({"max_iter": 1.5}, "max_iter must be an integer, got 1.5"),
        ({"time_limit": 0.0}, "time_limit must be > 0"),
        ({"initvals": np.ones(5)}, r"initvals must have shape \(3,\)"),
        ({"initvals": np.full(3, np.nan)}, "initvals must be finite"),
        ({"eps_abs": np.inf}, "eps_abs must be finite"),
        ({"warm_start": 3}, "warm_start must be a QPResult"),
    ],
)
def test_bad_settings_are_named(settings, text):
    with pytest.raises(ParamError, match=text):
        solve_problem(Problem(**textbook()), solver="nam", **settings)


def test_warm_starts_give_the_same_answer():
    problem = Problem(**textbook())
    cold = solve_problem(problem, solver="nam")
    for settings in ({"initvals": cold.x}, {"warm_start": cold}):
        warm = solve_problem(problem, solver="nam", **settings)
        np.testing.assert_allclose(warm.x, cold.x, atol=1e-12)
        assert warm.extras["iterations"] <= 1
    impossible = Problem(**{**textbook(), "ub": np.full(3, -1e3)})
    failed = solve_problem(impossible, solver="nam")
    assert not failed.found
    again = solve_problem(problem, solver="nam", warm_start=failed)
    np.testing.assert_allclose(again.x, cold.x, atol=1e-12)


def test_nothing_is_printed_unless_asked(capsys):
    problem = Problem(**textbook())
    solve_problem(problem, solver="nam")
    assert capsys.readouterr() == ("", "")
    solve_problem(problem, solver="nam", verbose=True)
    out = capsys.readouterr().out
    assert out.splitlines()[0].startswith("namlcp  QP: n = 3")
    assert out.splitlines()[-1].startswith("solved: ")
    assert max(map(len, out.splitlines())) <= 79


def test_repeated_solves_agree_to_the_last_bit():
    problem = Problem(**textbook())
    first = solve_problem(problem, solver="nam")
    second = solve_problem(problem, solver="nam", verbose=False)
    for name in ("x", "y", "z", "z_box"):
        np.testing.assert_array_equal(getattr(first, name), getattr(second, name))


class Hostile:
    """An array-like that raises what the host would misread."""

    def __array__(self, *args, **kwargs):
        raise KeyError("no array")


def test_no_keyerror_leaves_the_adapter():
    problem = Problem(np.eye(2), np.ones(2))
    with pytest.raises(SolverError, match="KeyError"):
        solve_problem(problem, solver="nam", initvals=Hostile())


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("kind", [np.asarray, sp.csc_matrix])
def test_negative_curvature_is_refused_at_any_scale(scale, kind):
    n = 101
    P = kind(scale * np.diag(np.append(np.ones(n - 1), -1e-3)))
    bounds = {"lb": -np.ones(n), "ub": np.ones(n)}
    with pytest.raises(ProblemError, match="positive semidefinite"):
        solve_problem(Problem(P, np.zeros(n), **bounds), solver="nam")


def test_time_limit_keeps_the_best_point_of_the_bounds_form():
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(40, 40))
    P = sp.csc_matrix(sp.kron(line, sp.eye_array(40)) + sp.kron(sp.eye_array(40), line))
    q = np.random.default_rng(0).standard_normal(1600)
    problem = Problem(P, q, lb=np.zeros(1600))
    answer = solve_problem(problem, solver="nam", time_limit=1e-6)
    assert answer.found is False
    assert answer.extras["status"] == "time_limit"
    assert answer.extras["form"] == "bounds"
    assert np.linalg.norm(np.minimum(answer.x, P @ answer.x + q)) < np.linalg.norm(
        np.minimum(0.0, q)
    )


def test_the_closest_point_of_an_infeasible_problem():
    G, h = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])
    problem = Problem(np.eye(1), np.zeros(1), G, h)
    answer = solve_problem(problem, solver="nam", infeasible="closest")
    assert not answer.found
    assert answer.obj == np.inf
    np.testing.assert_allclose(answer.x, [1.5])
    np.testing.assert_allclose(answer.extras["closest"].shift_h, [1.5, 1.5])
    assert answer.z_box.size == 0
    certificate = answer.extras["certificate"]["z"]
    assert certificate @ h == pytest.approx(-1.0)
    assert solve_problem(problem, solver="nam").x is None
    weighed = namlcp.Relaxation(h=[2.0, 1.0])
    answer = solve_problem(problem, solver="nam", infeasible=weighed)
    np.testing.assert_allclose(answer.extras["closest"].shift_h, [1.0, 2.0])
