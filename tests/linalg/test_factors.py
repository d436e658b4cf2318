"""The protocol of factorisations, kept by each: analyse, factor, solve, again.

K = L D L' is told from outside: the solutions solve, the pivots have the
determinant and the inertia of K.
"""

import functools

import numpy as np
import pytest
from problems_elimination import laplacian, natural, parts, quasi_definite, upper
from problems_qp import assert_solves_qp, make_qp
from scipy.sparse import (
    block_array,
    csc_array,
    diags_array,
    eye_array,
    hstack,
    kronsum,
    triu,
)

from namlcp import solve_qp
from namlcp.linalg import factors
from namlcp.linalg.factors import plan_lu
from namlcp.linalg.fronts import Fronts
from namlcp.linalg.ordering import minimum_degree
from namlcp.linalg.sparse_ldl import SparseFactors


def by_degree(kind):
    return lambda U: kind(*parts(U), minimum_degree(*parts(U)))


def as_it_stands(kind):
    return lambda U: kind(*parts(U), natural(U))


KINDS = {
    "columns": by_degree(SparseFactors),
    "columns, natural order": as_it_stands(SparseFactors),
    "fronts": by_degree(Fronts),
    "fronts, natural order": as_it_stands(Fronts),
    "planned": lambda U: factors.plan_factors(*parts(U)),
}


def bordered(pairs, border, density):
    """Return K with 2 by 2 blocks that are coupled by the last rows alone."""
    rng = np.random.default_rng(5)
    inner = np.kron(np.eye(pairs), np.array([[4.0, 1.0], [1.0, 3.0]]))
    B = rng.standard_normal((border, 2 * pairs))
    B *= rng.random(B.shape) < density
    return np.block([[inner, B.T], [B, -3.0 * np.eye(border)]])


def saddle(rows, columns):
    """Return the K of a discretised control problem on a grid."""
    L = laplacian(rows, columns).toarray()
    return np.block([[np.eye(L.shape[0]), L], [L, -1e-6 * L]])


def stages(states, inputs, steps):
    """Return the K of linear control: variables (x_1, u_0, x_2, u_1, ...), dynamics.

    All inputs of a step have the same rows, which are the columns of one supernode.
    """
    rng = np.random.default_rng(4)
    F, B = rng.standard_normal((states, states)), rng.standard_normal((states, inputs))
    A = np.zeros((steps, states, steps, states + inputs))
    for t in range(steps):
        A[t, :, t] = np.hstack((-np.eye(states), B))
        if t > 0:
            A[t, :, t - 1, :states] = F
    A = A.reshape(steps * states, -1)
    P = np.diag(rng.uniform(1.0, 2.0, A.shape[1]))
    return np.block([[P, A.T], [A, -np.eye(A.shape[0])]])


CASES = {
    "one": np.array([[-2.0]]),
    "diagonal": np.diag([1.0, -2.0, 3.0]),
    "full": quasi_definite(130, 90, 1.0, 1),
    "sparse": quasi_definite(60, 40, 0.06, 2),
    "denser": quasi_definite(40, 30, 0.3, 3),
    "apart": np.kron(np.eye(3), quasi_definite(7, 6, 0.4, 4)),
    "blocks of three": np.kron(np.eye(4), np.full((3, 3), 0.3)) + np.eye(12),
    "path": laplacian(1, 40).toarray(),
    "grid": laplacian(17, 13).toarray(),
    "no zeros": np.ones((20, 20)) + 5.0 * np.eye(20),
    "data rows": bordered(130, 24, 0.2),
    "full data rows": bordered(100, 17, 1.0),
    "saddle": saddle(9, 12),
    "stages": stages(9, 5, 6),
    "wide stages": stages(40, 60, 3),
}


@functools.cache
def eigenvalues(case):
    return np.linalg.eigvalsh(CASES[case])


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("kind", KINDS)
def test_factors_solve_and_take_other_values(kind, case):
    K = CASES[case]
    U, values = upper(K), eigenvalues(case)
    tolerance = 1e-12 * max(1.0, abs(values).max() / abs(values).min())
    rhs = np.random.default_rng(0).standard_normal((8, K.shape[0]))

    def solutions(f):
        return np.array([f.solve(b) for b in rhs])

    f = KINDS[kind](U)
    f.refactor(U.data)
    X = solutions(f)
    np.testing.assert_allclose(X @ K, rhs, rtol=0.0, atol=tolerance)
    if kind != "planned":
        D = f.pivots
        assert (D < 0.0).sum() == (values < 0.0).sum()
        size = np.log(abs(values)).sum()
        assert np.log(abs(D)).sum() == pytest.approx(size, abs=1e-8)
    other = K + np.diag(np.sign(np.diag(K)))
    f.refactor(upper(other).data)
    np.testing.assert_allclose(solutions(f) @ other, rhs, atol=tolerance)
    f.refactor(U.data)
    fresh = KINDS[kind](U)
    fresh.refactor(U.data)
    for same in f, fresh:
        np.testing.assert_array_equal(solutions(same), X)


@pytest.mark.parametrize("bad", [0.0, np.nan, np.inf, 1e-310])
@pytest.mark.parametrize("kind", KINDS)
def test_a_pivot_that_vanishes_is_told(kind, bad):
    f = KINDS[kind](upper(np.diag([1.0, 5.0, 2.0])))
    with pytest.raises(ValueError, match="pivot"):
        f.refactor(np.array([1.0, bad, 2.0]))
    f.refactor(np.array([1.0, -2.0, 4.0]))
    np.testing.assert_array_equal(f.solve(np.ones(3)), [1.0, -0.5, 0.25])


@pytest.mark.parametrize("size", [5, 25])
@pytest.mark.parametrize("kind", KINDS)
def test_a_singular_matrix_is_told(kind, size):
    U = upper(np.ones((size, size)))
    with pytest.raises(ValueError, match="pivot"):
        KINDS[kind](U).refactor(U.data)


@pytest.mark.parametrize("kind", ["columns", "planned"])
def test_of_order_zero(kind):
    U = upper(np.empty((0, 0)))
    f = KINDS[kind](U)
    f.refactor(U.data)
    assert f.solve(np.empty(0)).size == 0


def test_a_qp_is_solved_with_either_kind_of_factors(monkeypatch):
    """Fronts are taken from some work on; the answer is the same to rounding."""
    n = 15
    L, eye = laplacian(n, n), eye_array(n * n)
    P = diags_array(np.r_[np.ones(n * n), np.full(n * n, 1e-2)])
    q = np.r_[-np.sin(np.arange(n * n)), np.zeros(n * n)]
    A, b = block_array([[L, -eye]]), np.zeros(n * n)
    qp = make_qp(P, q, A=A, b=b, lb=np.full(q.size, -0.2), ub=np.full(q.size, 0.3))
    usual = solve_qp(*qp, eps_abs=1e-9, eps_rel=0.0)
    used = []
    monkeypatch.setattr(
        factors, "Fronts", lambda *args: (used.append(1), Fronts(*args))[1]
    )
    monkeypatch.setattr(factors, "HEAVY", 0.0)
    monkeypatch.setattr(factors, "HEAVY_ROW", 0.0)
    heavy = solve_qp(*qp, eps_abs=1e-9, eps_rel=0.0)
    assert used
    assert_solves_qp(qp, heavy, 1e-9)
    np.testing.assert_allclose(heavy.x, usual.x, atol=1e-7)

    def without_memory(*args):
        raise MemoryError

    monkeypatch.setattr(factors, "Fronts", without_memory)
    again = solve_qp(*qp, eps_abs=1e-9, eps_rel=0.0)
    np.testing.assert_array_equal(again.x, usual.x)


def assert_ended_by_ctrl_c(monkeypatch, factors, data):
    """What the first look at the clock raises comes out of the factorisation."""

    def press():
        raise KeyboardInterrupt

    with monkeypatch.context() as patch:
        patch.setattr("time.perf_counter", press)
        with pytest.raises(KeyboardInterrupt):
            factors.refactor(data)


def test_what_is_raised_in_a_long_factorisation_ends_it(monkeypatch):
    K = quasi_definite(200, 150, 1.0, 1)
    U = upper(K)
    fronts = by_degree(Fronts)(U)
    assert_ended_by_ctrl_c(monkeypatch, fronts, U.data)
    fronts.refactor(U.data)
    rhs = np.ones(len(K))
    np.testing.assert_allclose(K @ fronts.solve(rhs), rhs, atol=1e-8)


# ---- threads


@functools.cache
def control(n):
    """Return P and A of a control problem on a grid in space, and the K of its QP."""
    side = diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n))
    A = hstack((kronsum(kronsum(side, side), side), -eye_array(n**3)))
    P = diags_array(np.r_[np.ones(n**3), np.full(n**3, 1e-2)])
    K = block_array([[P, A.T], [A, -1e-6 * eye_array(n**3)]])
    return P, csc_array(A), upper(K)


def test_threads_give_equal_bits():
    """Of the factors, their solutions, and of a QP with large factors."""
    P, A, U = control(14)
    order = minimum_degree(*parts(U))
    rhs = np.sin(np.arange(U.shape[0]))
    found = []
    for threads in (1, 2, 3, 8):
        f = Fronts(*parts(U), order, None, threads)
        for _ in range(3):
            f.refactor(U.data)
            found.append((f.pivots.tobytes(), f.solve(rhs).tobytes()))
        assert f.threads == threads
    assert len(set(found)) == 1
    solve = functools.partial(
        solve_qp, P, -rhs[: 2 * 14**3], A=A, b=np.zeros(14**3), lb=-np.ones(2 * 14**3)
    )
    one, two = (solve(eps_abs=1e-6, threads=threads) for threads in (1, 2))
    assert one.status.value == two.status.value == "solved"
    np.testing.assert_array_equal(one.x, two.x)


def test_all_threads_stop_and_begin_again(monkeypatch):
    U = control(14)[2]
    f = Fronts(*parts(U), minimum_degree(*parts(U)), None, 2)
    for value in (0.0, np.nan):
        with pytest.raises(ValueError, match="pivot"):
            f.refactor(U.data * value)
    assert_ended_by_ctrl_c(monkeypatch, f, U.data)
    f.refactor(U.data)
    K, one = csc_array(U + triu(U, 1).T), np.ones(U.shape[0])
    K.sort_indices()
    lu = plan_lu(K.indptr, K.indices).another()  # of one thread, in pieces too
    lu.refactor(K.data)
    for factors_of_K in f, lu:
        np.testing.assert_allclose(K @ factors_of_K.solve(one), one, atol=1e-8)


# ---- symmetric patterns of other values


def dominant(pattern, seed):
    """Return K of a pattern, with a diagonal of both signs that leads."""
    rng, n = np.random.default_rng(seed), len(pattern)
    K = rng.uniform(-1.0, 1.0, (n, n)) * pattern
    signs = rng.choice([-1.0, 1.0], n)
    np.fill_diagonal(K, signs * (1.0 + np.abs(K).sum(axis=1)))
    return K


def stored(K, pattern):
    """Return the CSC pattern and the entries of K in it."""
    P = csc_array(pattern)
    columns = np.repeat(np.arange(len(K)), np.diff(P.indptr))
    return P.indptr, P.indices, K[P.indices, columns]


@pytest.mark.parametrize("case", CASES)
def test_fronts_of_two_sides_solve_as_dense_algebra_does(case):
    pattern = CASES[case] != 0.0
    plan = plan_lu(*stored(pattern, pattern)[:2])
    kept, b = [], np.random.default_rng(0).standard_normal(len(pattern))
    for seed in range(3):  # the layout serves all matrices of the pattern
        K = dominant(pattern, seed)
        lu = plan.another()
        lu.refactor(stored(K, pattern)[2])
        assert np.prod(np.sign(lu.pivots)) == np.linalg.slogdet(K)[0]
        kept.append((lu, K))
    for lu, K in kept:  # factors stay what they were when others are made
        x = np.linalg.solve(K, b)
        np.testing.assert_allclose(lu.solve(b), x, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("value", [0.0, np.nan, np.inf])
@pytest.mark.parametrize("case", ["one", "diagonal", "grid"])
def test_a_pivot_of_two_sides_that_vanishes_is_told(case, value):
    pattern = CASES[case] != 0.0
    K = dominant(pattern, 0)
    K[-1] = K[:, -1] = 0.0
    K[-1, -1] = value
    indptr, indices, data = stored(K, pattern)
    with pytest.raises(ValueError, match="pivot"):
        plan_lu(indptr, indices).refactor(data)
