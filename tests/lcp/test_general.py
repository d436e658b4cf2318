"""LCPs whose matrix is neither P nor semidefinite: what is solved, proved, or left."""

import itertools
from fractions import Fraction

import numpy as np
import problems_general as problems
import problems_lcp
import pytest
from lcp_definition import assert_proves_unsolvable, assert_solves_lcp
from scipy import sparse
from scipy.optimize import linprog

from namlcp import Status, solve_lcp
from validation.problems.fuzzed import cases as campaign
from validation.problems.general.families import FAMILIES

INF = np.inf
MOST = 60
"""Factorisations of a monotone LCP that has to be decided; or 10 n more pivots."""


# ---- friction


@pytest.mark.parametrize(
    ("family", "size", "seed", "ratio"),
    [
        ("wall", 200, 5, 1e4), ("chain", 200, 5, 1e4), ("pile", 200, 17, 1e4),
        ("pile", 600, 2, 1.0), ("balls", 600, 5, 1.0), ("cubes", 300, 0, 1.0),
        ("pile", 2000, 2, 1e4),
    ],
)  # fmt: skip
def test_scenes_are_finished(family, size, seed, ratio):
    """Nearly singular bases leave up to 1e-8 max |q_i|."""
    A, q = FAMILIES[family](size, seed, ratio)
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    assert result.residual < 1e-9 * np.abs(q).max()


def test_a_path_that_has_solved_the_problem_ends_soon():
    """Its residual stays at 1.4e-9 of the largest q_i for thousands of steps."""
    A, q = FAMILIES["cubes"](6000, 2, 1e4)
    result = solve_lcp(A, q, eps_abs=1e-9 * np.abs(q).max())
    assert result.status is Status.SOLVED
    assert result.iterations <= 1000


def test_dense_ones_go_to_lemke_and_sparse_ones_to_a_path():
    """A path takes several times as long; sparse matrices are left to paths."""
    rng = np.random.default_rng(0)
    A, q = rng.random((300, 300)), rng.standard_normal(300)  # strictly copositive
    A[0, 0] = 0.0
    result = solve_lcp(A, q)
    assert (result.status, result.method) == (Status.SOLVED, "lemke")
    assert solve_lcp(*problems.friction(rng, 40)).method == "path"


# ---- bimatrix games


def test_dominant_strategies_are_found_on_the_first_path():
    """Each player has a pure strategy that costs less than all others."""
    for seed in range(3):
        R, S = np.random.default_rng(seed).uniform(1.0, 2.0, (2, 50, 60))
        R[seed] -= 0.95
        S[:, 2 * seed] -= 0.95
        result = solve_lcp(*problems.game(R, S))
        assert np.flatnonzero(result.z).tolist() == [seed, 50 + 2 * seed]
        assert result.iterations <= 4


@pytest.mark.parametrize("sparsely", [False, True])
def test_a_game_is_known_in_any_order(sparsely):
    rng = np.random.default_rng(3)
    R, S = rng.uniform(0.1, 1.0, (2, 50, 60))
    order = rng.permutation(110)
    A, q = problems.game(R, S)
    A = A[np.ix_(order, order)]
    result = solve_lcp(sparse.csr_array(A) if sparsely else A, q)
    assert "lemke-howson" in result.method
    assert_solves_lcp(result, A, q)


@pytest.mark.parametrize(
    ("i", "j", "value"), [(0, 0, 1.0), (0, 70, -1.0), (1, 71, 0.0), (0, 1, 1.0)]
)
def test_what_is_nearly_a_game_is_none(i, j, value):
    """A stored 0 is a 0, and no entry of R or S may be."""
    A, q = problems.game(*np.random.default_rng(4).uniform(0.1, 1.0, (2, 50, 60)))
    A[i, j] = value
    full = sparse.csr_array(np.ones((110, 110)))
    full.data[:] = A.ravel()
    for given in (A, full):
        result = solve_lcp(given, q, max_iter=300)
        assert "lemke-howson" not in result.method
        if result.status is Status.SOLVED:
            assert_solves_lcp(result, A, q)
    for vectors in ((np.append(q[1:], 0.0),), (q, None, 1.0)):
        A, _ = problems.game(*np.random.default_rng(4).uniform(0.1, 1.0, (2, 50, 60)))
        assert "lemke-howson" not in solve_lcp(A, *vectors, max_iter=300).method


# ---- Lemke's method


def rational_lemke(A, q, d):
    """Lemke's lexicographic method in rational numbers: z or None for a ray, pivots."""
    n = len(q)
    rows = []  # of [b, B^-1, columns of z, column of z_0] in w - A z - z_0 d = q
    for i in range(n):
        unit = [Fraction(int(i == j)) for j in range(n)]
        column = [Fraction(-int(A[i][j])) for j in range(n)]
        rows.append([Fraction(int(q[i])), *unit, *column, Fraction(-int(d[i]))])
    if min(q) >= 0:
        return [0] * n, 0
    basic = list(range(n))

    def pivot(row, name):
        rows[row] = [x / rows[row][1 + name] for x in rows[row]]
        for i in range(n):
            if i != row:
                factor = rows[i][1 + name]
                rows[i] = [
                    x - factor * y for x, y in zip(rows[i], rows[row], strict=True)
                ]
        left, basic[row] = basic[row], name
        return left

    first = min(range(n), key=lambda i: [x / int(d[i]) for x in rows[i][: 1 + n]])
    left, pivots = pivot(first, 2 * n), 1
    while left != 2 * n:
        enters = left + n if left < n else left - n
        limiting = [i for i in range(n) if rows[i][1 + enters] > 0]
        if not limiting:
            return None, pivots

        def order(i, enters=enters):
            part = [x / rows[i][1 + enters] for x in rows[i][: 1 + n]]
            return part[0], basic[i] != 2 * n, part

        left = pivot(min(limiting, key=order), enters)
        pivots += 1
    z = [Fraction(0)] * 2 * n
    for i, name in enumerate(basic):
        if name < 2 * n:
            z[name] = rows[i][0]
    return z[n:], pivots


@pytest.mark.parametrize("seed", range(60))
def test_the_path_is_that_of_rational_numbers(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    A, q = rng.integers(-2, 4, (n, n)), rng.integers(-3, 3, n)
    np.fill_diagonal(A, 1)  # so that nothing is scaled
    d = rng.integers(1, 3, n)
    expected, pivots = rational_lemke(A, q, d)
    result = solve_lcp(A, q, method="lemke", cover=d)
    assert result.method == "lemke"
    assert result.iterations == pivots
    if expected is None:
        assert result.status in (Status.STALLED, Status.UNSOLVABLE)
    else:
        assert result.status is Status.SOLVED
        z = np.array(expected, dtype=float)
        np.testing.assert_allclose(result.z, z, atol=1e-11)


@pytest.mark.parametrize("n", [4, 8])
def test_murty_takes_all_bases(n):
    """Murty (1978): with d = 1 the path visits 2^n bases."""
    A, q, _ = problems_lcp.murty(n)
    result = solve_lcp(A, q, method="lemke", history=True)
    assert result.status is Status.SOLVED
    assert result.iterations == 2**n
    assert len(result.history) == 2**n - 1


def test_a_ray_is_a_proof_only_if_it_is_one():
    """Semidefinite: a proof. diag(-1): it is a ray, and z = 1 would be a solution."""
    result = solve_lcp([[1, -1], [-1, 1]], [-1.0, -1.0], method="lemke")
    assert result.status is Status.UNSOLVABLE
    np.testing.assert_allclose(result.ray, [0.5, 0.5])
    A, q = [[-1, 0], [2, 1]], [1.0, -3.0]
    result = solve_lcp(A, q, method="lemke", cover=[1.0, 4.0])
    assert result.status in (Status.SOLVED, Status.STALLED)
    assert result.ray is None


# ---- proofs, and what is left open


def test_monotone_lcps_of_whole_numbers_are_decided():
    """Solved or proved, in few factorisations."""
    unsolvable = 0
    for seed in range(30, 300):
        A, q, lower, upper = problems_lcp.whole_numbers(seed)
        result = solve_lcp(A, q, lower, upper)
        if result.status is Status.UNSOLVABLE:
            assert_proves_unsolvable(result.ray, A, q, lower, upper)
            unsolvable += 1
        else:
            assert_solves_lcp(result, A, q, lower, upper)
    assert 45 < unsolvable < 110


def test_no_proof_is_sought_beside_a_solution(monkeypatch):
    """Proximal steps refine it, as A is nearly singular."""
    rng = np.random.default_rng(0)
    X = rng.standard_normal((20, 60))
    A, q = X.T @ X + 1e-4 * np.eye(60), -X.T @ rng.standard_normal(20)
    monkeypatch.setattr("namlcp.lcp.pivoting.driver.proof", None)
    assert_solves_lcp(solve_lcp(A, q, -INF, INF), A, q, -INF, INF)


@pytest.mark.parametrize("kind", ["infeasible", "unbounded", "solvable"])
def test_quadratic_programs_take_few_factorisations(kind):
    for free in (1.0, 0.3, 0.0):
        result = solve_lcp(*problems_lcp.program(0, 60, 100, kind, free))
        solvable = kind == "solvable"
        assert result.status is (Status.SOLVED if solvable else Status.UNSOLVABLE)
        assert result.iterations <= MOST + 10 * result.z.size


@pytest.mark.parametrize("index", [98, 149, 302, 557, 710])
def test_rounding_of_a_skew_matrix_does_not_hide_that_it_is_monotone(index):
    A, q, lower, upper = campaign.make(1, index).problem
    rng = np.random.default_rng(index)
    A = A + 1e-16 * np.abs(A).max() * rng.standard_normal(A.shape)
    assert solve_lcp(A, q, lower, upper).iterations <= MOST + 10 * q.size


@pytest.mark.parametrize("fall", [1.0, 1e-3, 1e-6])
def test_a_proof_beyond_the_range_is_not_returned(fall):
    A = [[0.0, 3.0 * fall, 0.0], [-3.0 * fall, 0.0, 0.0], [0.0, 0.0, 1.0]]
    unit = 1e-305
    lower, upper = [2.0 * unit, 0.0, 0.0], [2.0 * unit, INF, INF]
    result = solve_lcp(A, np.array([1.0, 0.0, 1.0]) * unit, lower, upper)
    assert result.status is Status.UNSOLVABLE
    assert result.ray is None or np.isfinite(result.ray).all()


def test_a_general_lcp_is_called_unsolvable_where_linear_programming_proves_it():
    """Boxes of all kinds, beside SciPy's linprog on w >= 0, w <= 0 and w = 0."""
    said = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        A, q, lower, upper = problems.mixed(rng, 8)
        q += 3.0 * rng.standard_normal(8)
        least, most = upper == INF, lower == -INF  # rows with w >= 0, with w <= 0
        rows = np.vstack([-A[least], A[most]]), np.append(q[least], -q[most])
        bounds = np.stack([lower, upper], 1)
        program = linprog(np.zeros(8), *rows, bounds=bounds)
        assert program.status in (0, 2)
        result = solve_lcp(A, q, lower, upper)
        said.append(result.ray is not None)
        assert said[-1] == (program.status == 2)
        if result.ray is not None:
            assert_proves_unsolvable(result.ray, A, q, lower, upper)
    assert 0 < sum(said) < 20


def has_solution(A, q):
    """By all faces, with regular ones alone."""
    for face in itertools.product([False, True], repeat=q.size):
        F = np.array(face)
        z = np.zeros(q.size)
        if F.any():
            z[F] = np.linalg.solve(A[np.ix_(F, F)], -q[F])
        if min(z.min(), (A @ z + q)[~F].min(initial=INF)) >= -1e-12:
            return True
    return False


def test_random_matrices_without_any_class():
    """Half of them have no solution; what is found is right, and most is found."""
    said = {True: [], False: []}
    for seed in range(100):
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1, 7))
        A, q = rng.standard_normal((n, n)), rng.standard_normal(n)
        result, truth = solve_lcp(A, q), has_solution(A, q)
        said[truth].append(result.status)
        if result.status is Status.SOLVED:
            assert_solves_lcp(result, A, q)
        elif result.ray is not None:
            assert_proves_unsolvable(result.ray, A, q)
    assert Status.SOLVED not in said[False]
    assert Status.UNSOLVABLE not in said[True]
    assert said[True].count(Status.SOLVED) >= 0.9 * len(said[True])
    assert said[False].count(Status.UNSOLVABLE) >= 0.3 * len(said[False])
    assert min(map(len, said.values())) > 20


def test_a_path_of_lemke_that_overflows_leaves_the_start():
    A = np.array(
        [[7e-75, -1e69, -6e-58], [2e67, 6e-81, -2e102], [-4e54, -5e-80, -1e111]]
    )
    result = solve_lcp(A, [0.0, 2e-128, 0.0], -1.0, 1.0, method="lemke")
    assert result.status is not Status.SOLVED
    assert np.isfinite(result.z).all()


def test_nearly_solvable():
    """w_1 = -1e-13 is rounding or a contradiction: the tolerance decides."""
    A, q = np.array([[1.0, 0.0], [0.0, 0.0]]), np.array([-1.0, -1e-13])
    assert solve_lcp(A, q, eps_rel=1e-9).status is Status.SOLVED
    assert solve_lcp(A, q, eps_rel=1e-15).status is not Status.SOLVED
    assert solve_lcp(A, [-1.0, -1e-3]).status is Status.UNSOLVABLE


def test_a_cone_that_nnls_leaves_open_proves_nothing(monkeypatch):
    """SciPy raises where its active sets cycle, as for matrices of 1e-9 to 1e9."""

    def cycling(*arguments):
        raise RuntimeError("Maximum number of iterations reached.")

    A, q = [[0.0, 0.0], [2.0, 0.0]], [1.0, -3.0]
    assert solve_lcp(A, q).method == "enumeration"
    monkeypatch.setattr("scipy.optimize.nnls", cycling)
    assert solve_lcp(A, q).status is Status.STALLED
