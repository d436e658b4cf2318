"""Tridiagonal LCPs: all classes of A and bounds by the definition, and their limits."""

import numpy as np
import pytest
from lcp_definition import assert_solves_lcp
from problems_lcp import with_solution
from scipy import sparse

from namlcp import Prepared, Status, solve_lcp

INF = np.inf


def matrix(below, diagonal, above):
    """Return a csr_array with these diagonals, without a zero stored."""
    if diagonal.size == 1:
        return sparse.csr_array(diagonal.reshape(1, 1))
    A = sparse.diags_array([below, diagonal, above], offsets=[-1, 0, 1])
    A = sparse.csr_array(A)
    A.eliminate_zeros()
    return A


def random_matrix(rng, n, kind):
    """Return an M-, H+-, symmetric or other P-matrix of order n."""
    below, above = -rng.random((2, n - 1))
    if kind == "H+":
        below *= rng.choice([-1.0, 1.0], n - 1)
        above *= rng.choice([-1.0, 1.0], n - 1)
    if kind == "symmetric":
        above = below
    if kind == "P":  # below * above < 0: I + a skew part, in other units
        above *= -2.0
    diagonal = np.full(n, 0.05)
    if kind != "P":
        diagonal[1:] += np.abs(below)
        diagonal[:-1] += np.abs(above)
    scale = 10.0 ** rng.uniform(-2, 2, n)
    return sparse.csr_array(sparse.diags_array(scale) @ matrix(below, diagonal, above))


def random_box(rng, n, kind):
    """Return bounds: lower ones; some free and some pinned; or two everywhere."""
    lower, upper = rng.standard_normal(n), np.full(n, INF)
    if kind == "mixed":
        lower[rng.random(n) < 0.2] = -INF
        pinned = (rng.random(n) < 0.2) & (lower > -INF)
        upper[pinned] = lower[pinned]
    if kind == "two":
        upper = lower + rng.random(n)
    if kind == "upper":
        lower, upper = np.full(n, -INF), lower
    return lower, upper


def membrane(n):
    """Return the matrix h^2 (-u'') on n nodes and x."""
    one = np.ones(n - 1)
    return matrix(-one, np.full(n, 2.0), -one), np.arange(1, n + 1) / (n + 1)


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


@pytest.mark.parametrize("box", ["lower", "mixed", "two", "upper"])
@pytest.mark.parametrize("kind", ["M", "H+", "symmetric", "P"])
def test_random_problems(rng, kind, box):
    """The answer is that of the same A as a dense array."""
    for n in (1, 2, 3, 10, 40, 300):
        A = random_matrix(rng, n, kind)
        q = rng.standard_normal(n) * A.diagonal()
        lower, upper = random_box(rng, n, box)
        result = solve_lcp(A, q, lower, upper)
        assert_solves_lcp(result, A, q, lower, upper)
        if kind in ("M", "symmetric"):
            assert result.method == "tridiagonal"
        other = solve_lcp(A.toarray(), q, lower, upper)
        assert other.status is Status.SOLVED
        size = 1.0 + np.abs(other.z).max()
        np.testing.assert_allclose(result.z, other.z, rtol=0, atol=1e-6 * size)


def test_what_has_no_form(rng):
    wide = sparse.csr_array(sparse.eye_array(5) + 0.1 * sparse.eye_array(5, k=2))
    no_diagonal = matrix(np.ones(2), np.array([1.0, 0.0, 1.0]), -np.ones(2))
    for A in (wide, no_diagonal, np.eye(3)):
        result = solve_lcp(A, -np.ones(A.shape[0]))
        assert result.method != "tridiagonal"
        assert_solves_lcp(result, A, -np.ones(A.shape[0]))


def test_known_solution_with_ties(rng):
    A = random_matrix(rng, 500, "M")
    q, z = with_solution(rng, A, degenerate=0.3)
    result = solve_lcp(A, q)
    assert (result.status, result.method) == (Status.SOLVED, "tridiagonal")
    np.testing.assert_allclose(result.z, z, atol=1e-7)


@pytest.mark.parametrize("n", [1000, 5000])
def test_contact_far_from_the_first_guess(n):
    """A face a node would be thousands."""
    A, x = membrane(n)
    load = np.sin(7.0 * np.pi * x) * -50.0 / n**2
    obstacle = np.sqrt(np.maximum(0.09 - (x - 0.5) ** 2, 0.0)) - 0.05
    wall = np.minimum(x, 1.0 - x)
    for q, lower, upper in (
        (load, np.zeros(n), np.full(n, INF)),
        (0.0 * x, obstacle, np.full(n, INF)),
        (np.full(n, -5.0 / n**2), -wall, wall),
        (load, np.full(n, -0.02), np.full(n, 0.03)),
    ):
        result = solve_lcp(A, q, lower, upper)
        assert_solves_lcp(result, A, q, lower, upper)
        assert result.iterations <= 100
        assert np.count_nonzero((result.z == lower) | (result.z == upper)) > 0


def test_one_node_after_the_other_is_freed():
    """The last unknown frees all before it, one by one."""
    A, _ = membrane(2000)
    q = np.full(2000, 1e-9)
    q[-1] = -1.0
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    assert np.all(result.z > 0.0)


def test_a_warm_start_takes_one_face(rng):
    A, x = membrane(400)
    P = Prepared(A)
    q = np.sin(9.0 * x) * 1e-3
    first = solve_lcp(P, q, -1.0, 1.0)
    again = solve_lcp(P, 1.0001 * q, -1.0, 1.0, z0=first.z)
    assert (again.status, again.iterations) == (Status.SOLVED, 1)
    far = solve_lcp(P, q, -1.0, 1.0, z0=rng.standard_normal(400) * 1e3)
    np.testing.assert_allclose(far.z, first.z, atol=1e-9)


def test_rounding_is_told_or_overcome():
    """The condition number is 10^9, and the accuracy asked for 10^-16."""
    n = 20_000
    A, x = membrane(n)
    q = np.sin(3.0 * np.pi * x) * -50.0 / n**2
    result = solve_lcp(A, q, eps_rel=1e-16)
    assert result.status in (Status.STALLED, Status.SOLVED)
    if result.status is Status.SOLVED:
        assert_solves_lcp(result, A, q, relative=1.01e-16)
    assert result.residual <= 1e-4 * np.linalg.norm(q)


def test_american_put_against_brennan_and_schwartz():
    """60 time steps, each against elimination from the right with a floor."""
    n, steps, sigma, rate = 199, 60, 0.3, 0.05
    x = np.linspace(-1.5, 1.5, n)
    payoff = np.maximum(1.0 - np.exp(x), 0.0)
    c = 0.5 * sigma**2 / (x[1] - x[0]) ** 2 / steps
    d = (rate - 0.5 * sigma**2) / (2.0 * (x[1] - x[0])) / steps
    below, diagonal, above = d - c, 1.0 + 2.0 * c + rate / steps, -c - d
    one = np.ones(n - 1)
    A = Prepared(matrix(below * one, np.full(n, diagonal), above * one))
    left = below * (1.0 - np.exp(2.0 * x[0] - x[1]))
    V, expected = payoff, payoff.copy()
    for step in range(steps):
        q = -V
        q[0] += left
        result = solve_lcp(A, q, payoff, z0=V)
        assert result.status is Status.SOLVED
        if step > 0:  # the payoff itself is no start nearby
            assert result.method == "tridiagonal"
            assert result.iterations <= 8
        V = result.z
        b, pivots = expected.copy(), np.full(n, diagonal)
        b[0] -= left
        for i in range(n - 2, -1, -1):
            b[i] -= above / pivots[i + 1] * b[i + 1]
            pivots[i] -= above / pivots[i + 1] * below
        before = 0.0
        for i in range(n):
            before = max((b[i] - below * before) / pivots[i], payoff[i])
            expected[i] = before
        np.testing.assert_allclose(V, expected, rtol=0, atol=1e-11)
