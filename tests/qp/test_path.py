"""The path for convex QPs: solutions, proofs, edges, and its parts."""

import re

import numpy as np
import pytest
from problems_lcp import laplacian
from problems_qp import (
    DATA,
    HOCK_SCHITTKOWSKI,
    assert_certificate,
    assert_solves_qp,
    complementary,
    infeasible,
    least_squares,
    make_qp,
    maros_meszaros,
    singular_block,
    unbounded,
    upper_triangle_of,
)
from problems_qp import (
    solve_sparse as solve,
)
from scipy.sparse import csc_array, csr_array, diags_array

from namlcp import solve_qp
from namlcp.limits import Deadline, Limits
from namlcp.options import Options
from namlcp.qp import convexity
from namlcp.qp.convexity import check_convex
from namlcp.qp.guess import make_guess
from namlcp.qp.path.advance import READY, REFINE, SOLVE
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.scaling import ScaledQP
from namlcp.residuals import qp_residuals
from namlcp.status import Status

DEFAULT = Options().limits()
I2 = np.eye(2)
O2 = np.zeros((2, 2))


@pytest.mark.parametrize("number", HOCK_SCHITTKOWSKI)
def test_hock_schittkowski(number):
    qp, constant, optimum = HOCK_SCHITTKOWSKI[number]
    result = solve(qp, DEFAULT)
    assert_solves_qp(qp, result)
    value = 0.5 * result.x @ (qp.P @ result.x) + qp.q @ result.x + constant
    assert value == pytest.approx(optimum, abs=1e-9)


@pytest.mark.parametrize(
    ("n", "m", "p", "rank", "density"),
    [
        (5, 8, 2, 5, 1.0),
        (20, 30, 5, 20, 1.0),
        (20, 30, 5, 7, 1.0),
        (30, 60, 0, 0, 1.0),
        (60, 80, 10, 60, 0.1),
        (60, 80, 10, 20, 0.1),
        (40, 0, 10, 10, 0.3),
        (40, 0, 0, 40, 0.3),
    ],
)
@pytest.mark.parametrize("seed", range(3))
def test_known_answers_are_found_exactly(seed, n, m, p, rank, density):
    known = complementary(seed, n, m, p, rank, density)
    result = solve(known.qp, DEFAULT)
    assert_solves_qp(known.qp, result, 1e-11)
    if rank == n:
        np.testing.assert_allclose(result.x, known.x, atol=1e-8)


@pytest.mark.parametrize("seed", range(3))
def test_weakly_active_rows_are_found_exactly(seed):
    known = complementary(seed, 20, 40, 0, 20, weak=5)
    result = solve(known.qp, DEFAULT)
    assert_solves_qp(known.qp, result)
    np.testing.assert_allclose(result.x, known.x, atol=1e-8)


def test_singular_block():
    known = singular_block(0, 20)
    assert_solves_qp(known.qp, solve(known.qp, DEFAULT), 1e-11)


def test_least_squares_with_a_dense_row():
    qp = least_squares(3000)
    result = solve(qp, DEFAULT)
    assert_solves_qp(qp, result)
    assert qp_residuals(*qp, *result[1:5]).primal < 1e-10


def test_tridiagonal_lcp_with_a_weakly_active_row():
    n = 150  # qpsolvers, tests/problems.py, get_sparse_problem
    M = diags_array(
        [np.ones(n), np.r_[0.0, -np.ones(n - 2)], np.r_[np.ones(n - 2), 0.0]],
        offsets=[0, 1, -1],
    )
    qp = make_qp(M.T @ M, -np.ones(n), -np.eye(n), np.full(n, -2.0))
    result = solve(qp, DEFAULT)
    assert_solves_qp(qp, result, 1e-12)
    assert (result.x - 2.0).min() > -1e-12


@pytest.mark.parametrize("rank", [0, 4, 10])
@pytest.mark.parametrize("seed", range(3))
def test_infeasible_problems_are_proved(seed, rank):
    qp = infeasible(seed, 10, 20, 3, rank)
    assert_certificate(qp, solve(qp, DEFAULT))


@pytest.mark.parametrize("rank", [0, 4, 8])
@pytest.mark.parametrize("seed", range(3))
def test_unbounded_problems_are_proved(seed, rank):
    qp = unbounded(seed, 10, 20, 3, rank)
    result = solve(qp, DEFAULT)
    assert result.status is Status.DUAL_INFEASIBLE
    assert_certificate(qp, result)


IMPOSSIBLE = {
    "opposite rows": make_qp(I2, [0, 0], [[1, 1], [-2, -2]], [1, -4]),
    "three rows": make_qp(I2, [0, 0], [[1, 1], [-1, 0], [0, -1]], [1, -1, -1]),
    "row against bounds": make_qp(I2, [0, 0], [[1, 1]], [-1], lb=[0, 0]),
    "repeated equations": make_qp(O2, [1, 0], A=[[1, 1], [2, 2]], b=[1, 3]),
    "dependent equations": make_qp(
        np.eye(3), [0, 0, 0], A=[[1, 1, 0], [0, 1, 1], [1, 2, 1]], b=[1, 1, 3]
    ),
    "empty row of A": make_qp(I2, [0, 0], A=[[0, 0]], b=[-1]),
    "empty row of G": make_qp(I2, [0, 0], [[0, 0]], [-1]),
    "all fixed": make_qp(I2, [0, 0], [[1, 1]], [2], lb=[1, 2], ub=[1, 2]),
    "margin 1e-3": make_qp([[1]], [0], [[1], [-1]], [0, -1e-3]),
}


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_contradictions_are_proved(name):
    qp = IMPOSSIBLE[name]
    result = solve(qp, DEFAULT)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert_certificate(qp, result)


@pytest.mark.parametrize(
    ("sides", "place"),
    [
        ({"lb": [0, 1], "ub": [1, 0]}, r"x\[1\].*lb = 1.0, ub = 0.0"),
        ({"lb": [0, np.inf]}, r"x\[1\].*lb = inf"),
        ({"ub": [-np.inf, 0]}, r"x\[0\].*ub = -inf"),
        ({"G": [[1, 1]], "h": [-np.inf]}, r"row 0 of G has h = -inf"),
    ],
)
def test_contradictory_sides_are_named(sides, place):
    result = solve(make_qp(I2, [1, 1], **sides), DEFAULT)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert re.search(place, result.message)


@pytest.mark.parametrize(
    "P",
    [
        -I2,
        [[1, 2], [2, 1]],
        [[0, 1], [1, 0]],
        [[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]],
    ],
)
def test_nonconvex_P_is_refused(P):
    qp = make_qp(P, np.zeros(len(P)))
    with pytest.raises(ValueError, match="P must be positive semidefinite"):
        solve(qp, DEFAULT)


def test_singular_P_passes_the_convexity_test():
    B = np.random.default_rng(0).standard_normal((20, 50))
    check_convex(make_qp(B.T @ B, np.zeros(50)).P)
    check_convex(make_qp(np.ones((5, 5)), np.zeros(5)).P)


EDGES = {
    "no variables": make_qp(np.zeros((0, 0)), []),
    "nothing but P": make_qp(I2, [1, 2]),
    "equations only": make_qp(I2, [1, 2], A=[[1, 1]], b=[1]),
    "dependent equations": make_qp(I2, [1, 2], A=[[1, 1], [2, 2]], b=[1, 2]),
    "singular, equations only": make_qp(np.diag([1.0, 0.0]), [1, 0], A=[[1, 1]], b=[1]),
    "LP": make_qp(O2, [-1, -1], [[1, 2], [3, 1]], [4, 6], lb=[0, 0]),
    "zero objective": make_qp(O2, [0, 0], [[1, 1]], [-1]),
    "infinite and empty rows": make_qp(
        I2, [-3, -1], [[1, 1], [0, 0], [1, 0]], [np.inf, 1, 1]
    ),
    "repeated rows": make_qp(
        I2, [-5, -5], [[1, 1], [2, 2], [1, 1], [-1, -1]], [3, 5, 4, 0]
    ),
    "fixed": make_qp(I2, [1, 2], [[1, 1]], [5], [[1, -1]], [-1], lb=[1, 2], ub=[1, 2]),
    "one fixed": make_qp(
        [[2, 1], [1, 2]], [1, 2], [[-1, -1]], [-5], lb=[1, -9], ub=[1, 9]
    ),
    "degenerate": make_qp(I2, [-2, -2], [[1, 0], [0, 1], [1, 1], [1, 2]], [1, 1, 2, 3]),
    "huge": make_qp(1e8 * I2, [-1e8, -2e8], [[1e6, 1e6]], [1e6]),
    "tiny": make_qp(1e-8 * I2, [-1e-8, -2e-8], [[1e-6, 1e-6]], [1e-6]),
    "flat": make_qp([[1e-9]], [-1.0]),
    "stored zeros": make_qp(I2, [-1, 0], csr_array(([0.0, 1.0], [0, 1], [0, 2])), [3]),
}


@pytest.mark.parametrize("name", EDGES)
def test_edges(name):
    qp = EDGES[name]
    copy = [np.array(getattr(part, "data", part)) for part in qp]
    assert_solves_qp(qp, solve(qp, DEFAULT), 1e-10)
    for part, before in zip(qp, copy, strict=True):
        np.testing.assert_array_equal(getattr(part, "data", part), before)


@pytest.mark.parametrize("name", ["LP", "degenerate", "repeated rows", "one fixed"])
def test_start_at_the_solution_needs_no_iteration(name):
    qp = EDGES[name]
    x = solve(qp, DEFAULT).x
    result = solve(qp, DEFAULT, make_guess(qp, x, None))
    assert_solves_qp(qp, result)
    assert result.iterations == 0


def test_any_start_is_accepted():
    known = complementary(1, 20, 30, 5, 20)
    result = solve(known.qp, DEFAULT, make_guess(known.qp, np.full(20, 1e3), None))
    assert_solves_qp(known.qp, result)


def test_limits_return_the_best_point():
    known = complementary(0, 30, 60, 0, 0)
    result = solve(known.qp, Options(max_iter=2).limits())
    assert result.status is Status.MAX_ITER
    assert result.iterations == 2
    assert np.isfinite(result.x).all()
    result = solve(known.qp, DEFAULT._replace(deadline=Deadline(0.0)))
    assert result.status is Status.TIME_LIMIT
    assert np.isfinite(result.x).all()


def test_every_iteration_is_reported():
    known = complementary(0, 30, 60, 0, 0)
    rows = []
    result = solve(known.qp, DEFAULT._replace(report=lambda *row: rows.append(row)))
    assert [row[0] for row in rows] == list(range(result.iterations + 1))
    assert {len(row) for row in rows} == {6}


def test_runs_repeat_bit_for_bit():
    known = complementary(2, 30, 60, 4, 10)
    first, second = solve(known.qp, DEFAULT), solve(known.qp, DEFAULT)
    np.testing.assert_array_equal(first.x, second.x)
    np.testing.assert_array_equal(first.z, second.z)


@pytest.mark.parametrize("seed", range(2))
def test_scaled_rows_and_columns(seed):
    known = complementary(seed, 20, 30, 5, 12)
    rng = np.random.default_rng(seed)
    d, e, f = (10.0 ** rng.uniform(-3, 3, k) for k in (20, 30, 5))
    D, E, F = diags_array(d), diags_array(e), diags_array(f)
    P, q, G, h, A, b, lb, ub = known.qp
    P = D @ P @ D
    qp = make_qp(
        0.5 * (P + P.T), q * d, E @ G @ D, h * e, F @ A @ D, b * f, lb / d, ub / d
    )
    assert_solves_qp(qp, solve(qp, DEFAULT))


needs_data = pytest.mark.skipif(
    not (DATA / "maros_meszaros").is_dir(),
    reason="no Maros-Meszaros data: set NAMLCP_DATA to the data folder",
)


@needs_data
@pytest.mark.parametrize(
    "name",
    [
        "AUG3DCQP", "CONT-050", "CVXQP1_S", "DUALC1", "HS118", "HUES-MOD", "KSIP",
        "LASER", "LISWET3", "MOSARQP2", "PRIMAL1", "QADLITTL", "QAFIRO", "QBANDM",
        "QCAPRI", "QPCBLEND", "QPCBOEI2", "QRECIPE", "QSCTAP1", "YAO",
    ],
)  # fmt: skip
def test_maros_meszaros(name):
    qp = maros_meszaros(name)
    result = solve_qp(*qp, eps_abs=1e-6, eps_rel=0.0)
    assert result.status is Status.SOLVED
    residuals = qp_residuals(*qp, result.x, result.y, result.z, result.z_box)
    assert residuals.solved(1e-6, 0.0)


@needs_data
@pytest.mark.parametrize(("name", "most"), [("QPILOTNO", 150), ("UBH1", 15)])
def test_full_steps_do_not_go_on_in_vain(name, most):
    """In QPILOTNO another scaling is needed, in UBH1 smaller proximal terms."""
    result = solve(maros_meszaros(name), Limits(eps_abs=1e-6, eps_rel=0.0))
    assert result.status is Status.SOLVED
    assert result.iterations <= most


def solved_by_other_factors(change, krylov):
    """Solve a KKT system by factors of another matrix; return |residual| and `now`."""
    qp = complementary(4, 20, 10, 3, 12).qp
    work = Workspace(ScaledQP(presolve(qp, 1e-9, 0.0)), DEFAULT)
    now, kkt = work.now, work.kkt
    n, m = now.n, now.size - now.n
    data = kkt.base.copy()
    data[kkt.diagonal] += np.r_[np.full(n, 1e-6), np.full(m, -1e-8)]
    kkt.data[:] = data
    kkt.data[kkt.diagonal] += np.r_[np.full(n, change), np.zeros(m)]
    assert work.factor()
    kkt.data[:] = data
    full = upper_triangle_of(kkt).toarray()
    full = full + np.triu(full, 1).T
    rhs = np.random.default_rng(0).standard_normal(now.size)
    work.rhs[:], work.r[:], work.du[:] = rhs, rhs, 0.0
    now.rhs_norm, now.error, now.accuracy, now.solves = 1.0, np.inf, 1e-14, 0
    now.krylov_pays, now.after, now.then = krylov, REFINE, READY
    work.run(SOLVE)
    return np.abs(full @ work.du - rhs).max(), now


def test_newton_systems_are_refined():
    residual, now = solved_by_other_factors(0.0, False)
    assert residual < 1e-9
    assert now.error < 1e-13
    crude, _ = solved_by_other_factors(3.0, False)
    better, now = solved_by_other_factors(3.0, True)
    assert now.krylov_pays
    assert better < 0.1 * crude


def dense_rows(seed, m=400, n=60):
    """A support vector machine: min |w|^2/2 + sum t, t >= 1 - Bw, t >= 0."""
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((m, n))
    P = np.diag(np.concatenate((np.ones(n), np.zeros(m))))
    q = np.concatenate((np.zeros(n), np.ones(m)))
    G = np.block([[-B, -np.eye(m)], [np.zeros((m, n)), -np.eye(m)]])
    return make_qp(P, q, G, np.concatenate((-np.ones(m), np.zeros(m))))


def test_dense_rows():
    qp = dense_rows(0)
    assert_solves_qp(qp, solve(qp, DEFAULT), 1e-10)


@pytest.mark.parametrize("seed", range(3))
def test_a_wrong_warm_start_costs_iterations_only(seed):
    """The solution of another problem of the same shape, and nonsense."""
    qp, other = (complementary(s, 30, 60, 3, 8, 0.5).qp for s in (seed, seed + 50))
    for point in (solve(other, DEFAULT), solve(other, DEFAULT)._replace(z=np.ones(60))):
        result = solve(qp, DEFAULT, make_guess(qp, None, point))
        assert_solves_qp(qp, result, 1e-10)


@pytest.mark.parametrize("scale", [1e-8, 1e-7, 1e-5])
def test_small_blocks_of_p_are_not_torn_apart(scale):
    v = scale * np.array([1.0, 1.0, 100.0])
    P = np.zeros((4, 4))
    P[:3, :3] = np.outer(v, v)
    P[3, 3] = 1.0
    check_convex(csc_array(P))


def test_a_large_h_matrix_is_convex_without_a_factorisation(monkeypatch):
    """Badly scaled, so that its rows are not dominant."""
    d = diags_array(10.0 ** np.random.default_rng(0).uniform(-2, 2, 400))
    P = make_qp(d @ laplacian(20) @ d, np.zeros(400)).P
    monkeypatch.setattr(convexity, "MULTIGRID_ORDER", 400)
    with pytest.raises(convexity.NotConvex, match="an eigenvalue of P"):
        check_convex(csc_array(P - 0.1 * (d @ d)))
    monkeypatch.setattr(convexity, "has_positive_pivots", None)
    check_convex(P)


def test_a_huge_side_of_an_inactive_row_does_not_loosen_the_others():
    """x1 + x2 <= -1, x1 - x2 <= -1, x1 >= 0 leave nothing, whatever else is asked."""
    G = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 0.0], [1.0, 2.0]])
    for huge in (1e10, 1e14, 1e18):
        qp = make_qp(np.diag([1.0, 0.0]), [0, 0], G, [-1.0, -1.0, 0.0, huge])
        point = (np.zeros(2), np.zeros(0), np.zeros(4), np.zeros(2))
        assert not qp_residuals(*qp, *point).solved(1e-9, 1e-10)
        assert solve(qp, DEFAULT).status is not Status.SOLVED
