"""The dense form against the definition, a brute force and known answers."""

from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pytest
from problems_qp import make_qp
from scipy.sparse import csc_array

import namlcp
from namlcp.qp import forms
from namlcp.residuals import qp_residuals
from namlcp.status import Status

INF = np.inf


def solved(*qp, **settings):
    """Return the result of solve_qp, which is right by the definition."""
    result = namlcp.solve_qp(*qp, **settings)
    assert result.status is Status.SOLVED
    assert (result.z >= 0.0).all()
    assert max(result.residuals[:3]) <= 1e-9
    return result


def random_qp(rng, n, m, p, condition):
    """Return a feasible strictly convex QP, often degenerate or with repeated rows."""
    Q, _ = np.linalg.qr(rng.standard_normal((n, n)))
    P = (Q * np.logspace(0, -np.log10(condition), n)) @ Q.T
    P = (P + P.T) / 2
    G, A = rng.standard_normal((m, n)), rng.standard_normal((p, n))
    if m > 4 and rng.random() < 0.4:
        G = np.round(G)
        G[m // 2 :] = G[: m - m // 2] * rng.uniform(0.1, 10.0, (m - m // 2, 1))
    x = rng.standard_normal(n)
    h = G @ x + np.where(rng.random(m) < 0.5, 0.0, rng.random(m))
    lb = np.where(rng.random(n) < 0.5, x - rng.integers(0, 2, n), -INF)
    ub = np.where(rng.random(n) < 0.5, x + rng.random(n), INF)
    return P, rng.standard_normal(n), G, h, A, A @ x, lb, ub


@pytest.mark.parametrize("seed", range(8))
def test_variables_in_units_of_very_different_size(seed):
    """x = c t, c from 1e-8 to 1e8: rounding in one column is a whole unit in others."""
    rng = np.random.default_rng(seed)
    n, m = 12, 18
    P, q, G, h, A, b, lb, ub = random_qp(rng, n, m, 2, 10.0)
    plain = namlcp.solve_qp(P, q, G, h, A, b, lb, ub)
    c = 10.0 ** rng.permutation(np.linspace(-8.0, 8.0, n))
    scaled = c[:, None] * P * c, c * q, G * c, h, A * c, b, lb / c, ub / c
    result = namlcp.solve_qp(*scaled, x0=plain.x / c if seed % 2 else None)
    assert result.status is Status.SOLVED
    assert result.form == "dual"
    np.testing.assert_allclose(c * result.x, plain.x, atol=1e-9)
    there = c * result.x, result.y, result.z, result.z_box / c
    assert qp_residuals(P, q, G, h, A, b, lb, ub, *there).solved(1e-9, 1e-9)


def test_proofs_in_units_of_very_different_size():
    c = np.array([1e-7, 1.0, 1e7])
    P, G = c[:, None] * (np.eye(3) + 0.5) * c, np.ones((2, 3)) * c
    G[1] *= -1.0
    result = namlcp.solve_qp(P, np.ones(3), G, np.array([-1.0, -1.0]))
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert np.abs(G.T @ result.z).max() <= 1e-12 * np.abs(G * result.z[:, None]).max()


@pytest.mark.parametrize("seed", range(60))
def test_random_problems_are_exact(seed):
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(1, 30)), int(rng.integers(0, 60))
    qp = random_qp(rng, n, m, int(rng.integers(0, 1 + n // 4)), 10.0 ** (seed % 8))
    result = solved(*qp)
    assert result.form == "dual"
    restart = solved(*qp, warm_start=result)
    np.testing.assert_allclose(restart.x, result.x, atol=1e-7)


def brute_force(P, q, G, h):
    """Minimise 1/2 x'Px + q'x, Gx <= h by trying every active set."""
    best, point = INF, None
    m, n = G.shape
    for k in range(min(m, n) + 1):
        for F in combinations(range(m), k):
            rows = G[list(F)]
            K = np.block([[P, rows.T], [rows, np.zeros((k, k))]])
            if np.linalg.matrix_rank(K) < n + k:
                continue
            x = np.linalg.solve(K, np.concatenate((-q, h[list(F)])))[:n]
            value = 0.5 * x @ P @ x + q @ x
            if (G @ x <= h + 1e-9).all() and value < best:
                best, point = value, x
    return point


@pytest.mark.parametrize("seed", range(15))
def test_same_as_trying_every_active_set(seed):
    rng = np.random.default_rng(100 + seed)
    P, q, G, h, *_ = random_qp(rng, 3, 7, 0, 10.0)
    np.testing.assert_allclose(solved(P, q, G, h).x, brute_force(P, q, G, h), atol=1e-9)


def test_goldfarb_idnani_example():
    """Goldfarb and Idnani (1983), section 5: x = (1, 0) after two constraints."""
    P, q = [[4.0, -2.0], [-2.0, 4.0]], [6.0, 0.0]
    result = solved(P, q, [[-1.0, -1.0]], [-2.0], lb=[0.0, 0.0])
    np.testing.assert_allclose(result.x, [0.5, 1.5], atol=1e-14)
    np.testing.assert_allclose(result.z, [5.0], atol=1e-13)
    np.testing.assert_array_equal(result.z_box, [0.0, 0.0])


def test_unconstrained_and_empty():
    assert solved([[2.0]], [-4.0]).x == pytest.approx([2.0], rel=1e-15)
    result = solved(np.empty((0, 0)), [])
    assert (result.iterations, result.x.size) == (0, 0)


def test_equal_bounds_pin_a_variable():
    result = solved(np.eye(2), [1.0, 1.0], lb=[3.0, -9], ub=[3.0, 9])
    np.testing.assert_array_equal(result.x, [3.0, -1.0])
    np.testing.assert_allclose(result.z_box, [-4.0, 0.0], atol=1e-15)


def test_more_active_rows_than_variables():
    """All of 40 planes pass through the solution of a problem with two variables."""
    angle = np.linspace(0.0, np.pi / 2, 40)
    G = np.column_stack((np.cos(angle), np.sin(angle)))
    x = solved(np.eye(2), [-3.0, -3.0], G, G @ [1.0, 1.0]).x
    np.testing.assert_allclose(x, [1.0, 1.0], atol=1e-12)


def test_redundant_equalities_are_taken():
    A = [[1.0, 1.0, 0.0], [2.0, 2.0, 0.0], [0.0, 0.0, 1.0]]
    for P in (np.eye(3), np.diag([1.0, 1.0, 0.0]), np.diag([1.0, 0.0, 0.0])):
        result = solved(P, np.zeros(3), A=A, b=[2.0, 4.0, 1.0])
        assert result.form == "dual"
        np.testing.assert_allclose(A @ result.x, [2.0, 4.0, 1.0], atol=1e-14)


@pytest.mark.parametrize("seed", range(20))
def test_infeasible_rows_give_a_farkas_candidate(seed):
    rng = np.random.default_rng(seed)
    n, m = 6, 9
    G, h = rng.standard_normal((m, n)), rng.standard_normal(m)
    weights = rng.random(m)
    G = np.vstack((G, -weights @ G))
    h = np.append(h, -weights @ h - 0.1)
    root = rng.standard_normal((n if seed % 2 else 2, n))
    result = namlcp.solve_qp(root.T @ root, rng.standard_normal(n), G, h)
    assert (result.status, result.form) == (Status.PRIMAL_INFEASIBLE, "dual")
    assert (result.z >= 0.0).all()
    np.testing.assert_allclose(G.T @ result.z + result.z_box, 0.0, atol=1e-9)
    assert h @ result.z == pytest.approx(-1.0)


@pytest.mark.parametrize(
    "P", [np.diag([1.0, -1.0]), [[1.0, 1.1], [1.1, 1.0]], [[0.0, 1.0], [1.0, 0.0]]]
)
def test_a_cost_that_is_not_convex_is_refused(P):
    with pytest.raises(ValueError, match="P must be positive semidefinite"):
        namlcp.solve_qp(P, np.ones(2), np.ones((1, 2)), np.ones(1), lb=np.zeros(2))


def test_scales_do_not_matter():
    rng = np.random.default_rng(7)
    P, q, G, h, A, b, lb, ub = random_qp(rng, 12, 20, 2, 100.0)
    x = solved(P, q, G, h, A, b, lb, ub).x
    r = 10.0 ** rng.integers(-4, 5, 20)
    rows = r[:, None] * G, r * h, 1e-4 * A, 1e-4 * b
    scaled = namlcp.solve_qp(1e6 * P, 1e6 * q, *rows, lb, ub, eps_rel=1e-9)
    np.testing.assert_allclose(scaled.x, x, atol=1e-9)
    far = P, 1e8 * q, G, 1e8 * h, A, 1e8 * b, 1e8 * lb, 1e8 * ub
    far = namlcp.solve_qp(*far, eps_rel=1e-9)
    assert scaled.status is far.status is Status.SOLVED
    np.testing.assert_allclose(far.x * 1e-8, x, atol=1e-9)


@pytest.mark.parametrize("seed", range(10))
def test_definite_on_the_equalities_is_enough(seed):
    """P of rank n - p with p equalities across its kernel, against the whole KKT."""
    rng = np.random.default_rng(seed)
    n, p = 9, 4
    B = rng.standard_normal((n - p, n))
    P, q = B.T @ B, 1e3 * rng.standard_normal(n)
    A, b = rng.standard_normal((p, n)), rng.standard_normal(p)
    result = namlcp.solve_qp(P, q, A=A, b=b)
    assert (result.status.value, result.form) == ("solved", "dual")
    K = np.block([[P, A.T], [A, np.zeros((p, p))]])
    known = np.linalg.solve(K, np.concatenate((-q, b)))
    np.testing.assert_allclose(np.concatenate((result.x, result.y)), known, rtol=1e-9)


def test_an_indefinite_cost_is_refused_where_equalities_hide_it():
    P, A = np.diag([1.0, -1.0]), np.array([[0.0, 1.0]])
    with pytest.raises(ValueError, match="positive semidefinite"):
        namlcp.solve_qp(P, np.ones(2), A=A, b=np.ones(1))


def test_equalities_that_contradict_are_told_with_a_singular_cost():
    P, A = np.diag([1.0, 0.0]), np.array([[0.0, 1.0], [0.0, 2.0]])
    result = namlcp.solve_qp(P, np.ones(2), A=A, b=np.array([1.0, 3.0]))
    assert result.status.value == "primal_infeasible"
    assert abs(A.T @ result.y).max() <= 1e-9


def singular_qp(rng, n, m, p, rank):
    """Return (qp, x): P of this rank, often dependent and degenerate rows, x optimal.

    x and multipliers are planted; some of the active rows have multiplier zero.
    """
    B = rng.standard_normal((rank, n))
    P, G, A = B.T @ B, rng.standard_normal((m, n)), rng.standard_normal((p, n))
    if m > 4 and rng.random() < 0.5:
        G = np.round(G)
        G[m // 2 :] = G[: m - m // 2] * rng.uniform(0.1, 10.0, (m - m // 2, 1))
    if p > 1:
        A[-1] = A[0]
    x = np.round(rng.standard_normal(n), 1)
    on, at = rng.random(m) < 0.6, rng.integers(0, 4, n)  # at 0: lb, 1: ub, 2, 3: open
    h = G @ x + np.where(on, 0.0, rng.random(m))
    lb = np.where(at == 0, x, np.where(at == 2, -INF, x - 1.0))
    ub = np.where(at == 1, x, np.where(at == 3, INF, x + 1.0))
    z = np.where(on & (rng.random(m) < 0.7), rng.random(m), 0.0)
    z_box = np.where(at == 0, -1.0, np.where(at == 1, 1.0, 0.0)) * rng.random(n)
    q = -(P @ x + G.T @ z + A.T @ rng.standard_normal(p) + z_box)
    return (P, q, G, h, A, A @ x, lb, ub), x


@pytest.mark.parametrize("seed", range(80))
def test_singular_problems_are_exact(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 40))
    m, p, rank = (int(rng.integers(0, k + 1)) for k in (2 * n, n // 3, n - 1))
    qp, optimal = singular_qp(rng, n, m, p, rank if seed % 4 else 0)
    result = solved(*qp)
    assert result.form == "dual"
    P, q = qp[:2]
    best = 0.5 * optimal @ P @ optimal + q @ optimal
    assert result.obj == pytest.approx(best, abs=1e-9 * (1.0 + abs(best)))
    restart = solved(*qp, warm_start=result)
    assert restart.iterations <= max(4, result.iterations // 2)
    assert restart.obj == pytest.approx(best, abs=1e-9 * (1.0 + abs(best)))


def test_vertex_of_a_linear_program():
    """Vanderbei, Linear Programming, section 2.1: 5, 4, 3 gives (2, 0, 1)."""
    G = [[2.0, 3.0, 1.0], [4.0, 1.0, 2.0], [3.0, 4.0, 2.0]]
    q, h = [-5.0, -4.0, -3.0], [5.0, 11.0, 8.0]
    result = solved(np.zeros((3, 3)), q, G, h, lb=np.zeros(3))
    np.testing.assert_allclose(result.x, [2.0, 0.0, 1.0], atol=1e-13)
    np.testing.assert_allclose(result.z, [1.0, 0.0, 1.0], atol=1e-13)
    np.testing.assert_allclose(result.z_box, [0.0, -3.0, 0.0], atol=1e-13)


def test_beale_cycling_example():
    """Beale (1955), where the textbook simplex method cycles: -1/20 at (1/25, 0, 1, 0).

    The vertex at the origin is degenerate.
    """
    G = [[0.25, -60.0, -0.04, 9.0], [0.5, -90.0, -0.02, 3.0], [0.0, 0.0, 1.0, 0.0]]
    q = np.array([-0.75, 150.0, -0.02, 6.0])
    x = solved(np.zeros((4, 4)), q, G, [0.0, 0.0, 1.0], lb=np.zeros(4)).x
    np.testing.assert_allclose(x, [0.04, 0.0, 1.0, 0.0], atol=1e-13)
    assert q @ x == pytest.approx(-0.05, abs=1e-14)


def test_no_cost_at_all_asks_for_a_feasible_point():
    x = solved(np.zeros((2, 2)), np.zeros(2), A=[[1.0, 1.0]], b=[3.0]).x
    np.testing.assert_allclose(x, [1.5, 1.5], atol=1e-14)  # the one nearest to 0
    assert solved(np.zeros((1, 1)), [0.0]).x == [0.0]


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("rank", [0, 3])
def test_unbounded_problems_give_a_ray(rank, scale):
    rng = np.random.default_rng(rank)
    n, m = 8, 5
    d = rng.standard_normal(n)
    B, G = rng.standard_normal((rank, n)), rng.standard_normal((m, n))
    A = rng.standard_normal((2, n))
    B, A = (M - np.outer(M @ d, d) / (d @ d) for M in (B, A))
    G = np.where((G @ d > 0.0)[:, None], -G, G)
    q = rng.standard_normal(n)
    q = np.where(q @ d > 0.0, -q, q) * scale
    h, b = scale * rng.random(m), scale * rng.random(2)
    P = B.T @ B
    result = namlcp.solve_qp(P, q, G, h, A, b)
    assert (result.status, result.form) == (Status.DUAL_INFEASIBLE, "dual")
    ray = result.x
    size = np.abs(ray).max()
    np.testing.assert_allclose(P @ ray, 0.0, atol=1e-8 * size * np.abs(P).max())
    np.testing.assert_allclose(A @ ray, 0.0, atol=1e-9 * size)
    assert (G @ ray <= 1e-9 * size).all()
    assert q @ ray < 0.0


def test_curvatures_far_apart_on_one_face():
    """Curvatures from 1 to 1e-8, and 0."""
    P = np.diag([1.0, 1e-4, 1e-8, 0.0])
    q = np.array([-1.0, -1e-4, -1e-8, -1.0])
    result = namlcp.solve_qp(P, q, np.ones((1, 4)), [10.0])
    assert result.status is Status.SOLVED
    # x_i = 1 - z / P_ii where that is not pushed down: z = 1 by the last column
    np.testing.assert_allclose(result.z, [1.0], atol=1e-12)
    gradient = P @ result.x + q + 1.0
    np.testing.assert_allclose(gradient, 0.0, atol=1e-11)


def test_guesses_that_are_wrong_do_no_harm():
    rng = np.random.default_rng(2)
    qp, _ = singular_qp(rng, 20, 30, 2, 8)
    plain = solved(*qp)
    for share in (1.0, 0.3):
        x, z = rng.standard_normal(20), 1.0 * (rng.random(30) < share)
        z_box = np.where(rng.random(20) < share, rng.choice([-1.0, 1.0], 20), 0.0)
        wrong = SimpleNamespace(x=x, y=np.zeros(2), z=z, z_box=z_box)
        result = solved(*qp, warm_start=wrong)
        assert result.form == "dual"
        assert result.obj == pytest.approx(plain.obj, rel=1e-9)


def test_an_empty_row_says_nothing_about_the_scale():
    G, h = [[1.0, 1.0], [0.0, 0.0], [-1.0, 0.0], [0.0, -1.0]], [4.0, 1.0, 0.0, 0.0]
    result = namlcp.solve_qp(np.zeros((2, 2)), [-1.0, -2.0], G, h)
    assert (result.status, result.form) == (Status.SOLVED, "dual")
    np.testing.assert_allclose(result.x, [0.0, 4.0], atol=1e-12)


def test_a_guess_with_multipliers_on_infinite_sides_does_no_harm():
    guess = SimpleNamespace(
        x=np.ones(2), y=np.zeros(0), z=np.zeros(0), z_box=np.array([-1.0, 1.0])
    )
    P, q, lb = np.diag([1.0, 0.0]), np.array([-1.0, 1.0]), np.array([-INF, 0.0])
    result = namlcp.solve_qp(P, q, lb=lb, warm_start=guess)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.x, [1.0, 0.0], atol=1e-12)


def test_ctrl_c_in_compiled_code_is_ctrl_c(monkeypatch):
    def pressed(*_):
        raise SystemError("result with an exception set") from KeyboardInterrupt()

    monkeypatch.setattr("namlcp.qp.responses.fresh.run_once", pressed)
    with pytest.raises(KeyboardInterrupt):
        namlcp.solve_qp(np.eye(2), np.ones(2))


@pytest.mark.parametrize("off", [1e-7, 1e-12])
def test_proportional_equalities_are_judged_in_their_own_units(off):
    A, b = [[1.0], [300.0], [300.0]], [1.0, 300.0, 300.0 + 2.0 * off]
    for kind in (np.asarray, csc_array):
        matrices = kind(np.eye(1)), kind(np.array(A))
        result = namlcp.solve_qp(matrices[0], [0.0], A=matrices[1], b=b)
        wanted = Status.SOLVED if off < 1e-9 else Status.PRIMAL_INFEASIBLE
        assert result.status is wanted


def test_dense_arrays_with_mostly_zeros_take_the_sparse_form():
    """From the size on at which that pays; full ones stay in dense form."""
    n = 110
    few = make_qp(np.eye(n), np.ones(n), np.eye(n)[:5] - np.eye(n)[1:6], np.ones(5))
    qp = few._replace(P=few.P.toarray(), G=few.G.toarray(), A=few.A.toarray())
    assert not forms.is_small(qp)
    assert forms.is_small(qp._replace(P=np.eye(n) + 1e-3))
