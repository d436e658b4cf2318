"""Tridiagonal LCPs: the definition, the pieces against formulas, all classes of A."""

import numpy as np
import pytest
from problems_lcp import box_lcp, with_solution
from scipy import sparse

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.pivoting.driver import solve_box
from namlcp.lcp.tridiagonal.diagonals import (
    eliminate_rows,
    fill_in,
    halve,
    tridiagonal_of,
)
from namlcp.lcp.tridiagonal.elimination import scan_for_states
from namlcp.lcp.tridiagonal.elimination import solve_tridiagonal as solve_form
from namlcp.limits import Deadline, Limits

INF = np.inf
LIMITS = Limits(eps_rel=1e-9, max_iter=1000)


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


def solve_tridiagonal(lcp, z0, limits):
    return solve_form(lcp, lcp.matrix.tridiagonal, z0, limits)


def membrane(n):
    """Return the matrix h^2 (-u'') on n nodes and x."""
    one = np.ones(n - 1)
    return matrix(-one, np.full(n, 2.0), -one), np.arange(1, n + 1) / (n + 1)


def assert_solves(A, q, lower, upper, z, w, tolerance=1e-9):
    """The definition, scaled to a unit diagonal."""
    d = 1.0 / np.sqrt(A.diagonal())

    def residual(z):
        w = d * (A @ z + q)
        return np.linalg.norm(z / d - np.clip(z / d - w, lower / d, upper / d))

    assert np.all(z >= lower)
    assert np.all(z <= upper)
    np.testing.assert_allclose(w, A @ z + q, rtol=1e-12, atol=1e-12 * np.abs(q).max())
    assert residual(z) <= tolerance * residual(np.clip(np.zeros(q.size), lower, upper))


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


# ---- the form


def test_form_of_a_tridiagonal_matrix(rng):
    A = random_matrix(rng, 7, "H+")
    form = tridiagonal_of(A)
    dense = A.toarray()
    np.testing.assert_array_equal(form.rows[0, 1:], np.diag(dense, -1))
    np.testing.assert_array_equal(form.rows[1], np.diag(dense))
    np.testing.assert_array_equal(form.rows[2, :-1], np.diag(dense, 1))
    leading = [np.linalg.det(dense[:k, :k]) for k in range(8)]
    pivots = np.array(leading[1:]) / leading[:-1]
    np.testing.assert_allclose(1.0 / form.rows[3], pivots, rtol=1e-10)
    assert not form.z_matrix
    assert tridiagonal_of(random_matrix(rng, 7, "M")).z_matrix


def test_what_has_no_form(rng):
    wide = sparse.csr_array(sparse.eye_array(5) + 0.1 * sparse.eye_array(5, k=2))
    assert tridiagonal_of(wide) is None
    assert (
        tridiagonal_of(matrix(np.ones(2), np.array([1.0, 0.0, 1.0]), -np.ones(2)))
        is None
    )
    assert tridiagonal_of(sparse.csr_array((0, 0))) is None
    assert Prepared(np.eye(3)).tridiagonal is None


def test_halves_solve_what_the_whole_does(rng):
    """With wide bounds the halved problem has the same solution, exactly."""
    for n in (2, 3, 8, 9):
        A = random_matrix(rng, n, "M")
        form, q = tridiagonal_of(A), rng.standard_normal(n)
        z = np.linalg.solve(A.toarray(), -q)
        rows, q_below = np.empty((5, (n + 1) // 2)), np.empty((n + 1) // 2)
        halve(form.rows, q, rows, q_below)
        assert eliminate_rows(rows) == (True, True)
        B = matrix(rows[0, 1:], rows[1], rows[2, :-1])
        np.testing.assert_allclose(B @ z[::2], -q_below, rtol=1e-9, atol=1e-9)
        filled = np.empty(n)
        wide = np.full(n, INF)
        fill_in(form.rows, q, -wide, wide, z[::2].copy(), filled)
        np.testing.assert_allclose(filled, z, rtol=1e-9)


# ---- the scan


def chandrasekaran(A, q, lower, upper):
    """A plain transcription: free whoever has w_i < 0, solve anew, until nobody has."""
    A = A.toarray()
    fixed = lower == upper
    free = lower == -INF
    base = np.where(lower > -INF, lower, 0.0)
    while True:
        z = base.copy()
        F = np.flatnonzero(free)
        if F.size:
            z[F] -= np.linalg.solve(A[np.ix_(F, F)], (A @ base + q)[F])
        wrong = (A @ z + q < 0.0) & ~free & ~fixed
        if not wrong.any():
            return free
        free |= wrong


@pytest.mark.parametrize("kind", ["lower", "mixed"])
def test_scan_is_chandrasekarans_method(rng, kind):
    for trial in range(60):
        n = int(rng.integers(1, 30))
        A = random_matrix(rng, n, "M")
        q = rng.standard_normal(n) * A.diagonal() + 0.3 * (trial % 3 - 1)
        lower, upper = random_box(rng, n, kind)
        state = np.empty(n, dtype=np.int8)
        m = (n + 1) // 2
        stack, spans = np.empty((6, m)), np.empty((2, m), dtype=np.int64)
        problem = tridiagonal_of(A).rows, q, lower, upper
        scan_for_states(*problem, state, np.empty((7, n + 2)), stack, spans)
        free = chandrasekaran(A, q, lower, upper)
        np.testing.assert_array_equal(state, np.where(free, 0, -1))


def test_scan_frees_one_after_the_other_in_linear_time():
    """The last unknown frees all before it, one by one: quadratic if done anew."""
    n = 200_000
    A, _ = membrane(n)
    q = np.full(n, 1e-12)
    q[-1] = -1.0
    lower, upper = np.zeros(n), np.full(n, INF)
    found = solve_tridiagonal(box_lcp(A, q, lower, upper), None, LIMITS)
    assert (found.status, found.iterations) == (Status.SOLVED, 1)
    assert np.all(found.z > 0.0)
    assert_solves(A, q, lower, upper, found.z, found.w)


# ---- the solver


@pytest.mark.parametrize("box", ["lower", "mixed", "two", "upper"])
@pytest.mark.parametrize("kind", ["M", "H+", "symmetric", "P"])
def test_random_problems(rng, kind, box):
    for n in (1, 2, 3, 10, 40, 300):
        A = random_matrix(rng, n, kind)
        q = rng.standard_normal(n) * A.diagonal()
        lower, upper = random_box(rng, n, box)
        result = solve_lcp(A, q, lower, upper)
        assert result.status is Status.SOLVED
        if kind != "P":
            assert result.method == "tridiagonal"
        assert_solves(A, q, lower, upper, result.z, result.w)
        with np.errstate(all="ignore"):
            lcp = box_lcp(A, q, lower, upper, symmetric=False)
            other = solve_box(lcp, None, Limits(eps_rel=1e-9))
        assert other.status is Status.SOLVED
        size = 1.0 + np.abs(other.z).max()
        np.testing.assert_allclose(result.z, other.z, rtol=0, atol=1e-6 * size)


def test_known_solution_with_ties(rng):
    A = random_matrix(rng, 500, "M")
    q, z = with_solution(rng, A, degenerate=0.3)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    assert result.method == "tridiagonal"
    np.testing.assert_allclose(result.z, z, atol=1e-7)


@pytest.mark.parametrize("n", [1000, 5000])
def test_contact_far_from_the_first_guess_needs_few_faces(n):
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
        assert result.status is Status.SOLVED
        assert result.method == "tridiagonal"
        assert result.iterations <= 4
        assert np.count_nonzero((result.z == lower) | (result.z == upper)) > 0


def test_warm_start_takes_one_face(rng):
    A, x = membrane(400)
    P = Prepared(A)
    q = np.sin(9.0 * x) * 1e-3
    first = solve_lcp(P, q, -1.0, 1.0)
    again = solve_lcp(P, 1.0001 * q, -1.0, 1.0, z0=first.z)
    assert again.status is Status.SOLVED
    assert again.iterations == 1
    far = solve_lcp(P, q, -1.0, 1.0, z0=rng.standard_normal(400) * 1e3)
    np.testing.assert_allclose(far.z, first.z, atol=1e-9)


def test_answers_do_not_depend_on_what_was_solved_before(rng):
    A = random_matrix(rng, 200, "H+")
    P = Prepared(A)
    q = rng.standard_normal(200)
    fresh = solve_lcp(A, q)
    for _ in range(3):
        solve_lcp(P, rng.standard_normal(200))
    again = solve_lcp(P, q)
    np.testing.assert_array_equal(again.z, fresh.z)
    assert again.iterations == fresh.iterations


def test_already_solved():
    A, _ = membrane(5)
    result = solve_lcp(A, np.ones(5))
    assert result.status is Status.SOLVED
    assert result.iterations == 0
    np.testing.assert_array_equal(result.z, np.zeros(5))
    np.testing.assert_array_equal(result.w, np.ones(5))


def test_huge_units(rng):
    A = random_matrix(rng, 30, "M")
    q = rng.standard_normal(30)
    plain, huge = solve_lcp(A, q), solve_lcp(A, q * 2.0**600)
    np.testing.assert_array_equal(huge.z, plain.z * 2.0**600)


def test_singular_matrix_is_left_to_pivoting():
    """The Neumann matrix: solvable or not, by the sign of sum(q)."""
    n = 40
    diagonal = np.full(n, 2.0)
    diagonal[[0, -1]] = 1.0
    A = matrix(-np.ones(n - 1), diagonal, -np.ones(n - 1))
    q = np.sin(np.arange(n))
    assert solve_lcp(A, q - q.mean() + 0.1).status is Status.SOLVED
    result = solve_lcp(A, q - q.mean() - 0.1)
    assert result.status is Status.UNSOLVABLE
    assert q @ result.ray - (q.mean() + 0.1) * result.ray.sum() == pytest.approx(-1.0)


def test_matrix_that_is_not_p():
    """A negative pivot in the first face; the answer is the judge's, not the form's."""
    A = matrix(np.full(3, -2.0), np.ones(4), np.full(3, -2.0))
    result = solve_lcp(A, -np.ones(4))
    if result.status is Status.SOLVED:
        assert_solves(A, -np.ones(4), np.zeros(4), np.full(4, INF), result.z, result.w)
    else:
        assert result.status in (Status.UNSOLVABLE, Status.STALLED)


def test_rounding_is_told(rng):
    """The condition number of 10^12 leaves no residual of 1e-9: STALLED, at once."""
    n = 300_000
    A, x = membrane(n)
    q = np.sin(3.0 * np.pi * x) * -50.0 / n**2
    lcp = box_lcp(A, q, np.zeros(n), np.full(n, INF))
    found = solve_tridiagonal(lcp, None, LIMITS)
    assert (found.status, found.iterations) == (Status.STALLED, 1)
    assert_solves(A, *lcp[1:], found.z, found.w, 1e-4)


def test_limits(rng):
    A, x = membrane(5000)
    q = np.sin(50.0 * x) * 1e-3
    lower, upper = np.full(5000, -0.1), np.full(5000, 0.1)
    rows = []
    for limits, expected in (
        ({"max_iter": 1}, Status.MAX_ITER),
        ({"deadline": Deadline(0.0)}, Status.TIME_LIMIT),
    ):
        limits = LIMITS._replace(report=lambda *row: rows.append(row), **limits)
        lcp = box_lcp(A, q, lower, upper)
        found = solve_tridiagonal(lcp, np.zeros(5000), limits)
        assert (found.status, found.iterations) == (expected, 1)
        assert np.all((lower <= found.z) & (found.z <= upper))
        np.testing.assert_allclose(found.w, A @ found.z + q, atol=1e-15)
    assert [row[0] for row in rows] == [1, 1]


def test_history_has_a_row_a_face():
    A, x = membrane(300)
    result = solve_lcp(A, -np.sin(9.0 * x) / 300**2, -0.001, 0.002, history=True)
    assert result.method == "tridiagonal"
    assert result.history["iter"].tolist() == list(range(1, result.iterations + 1))
    assert result.history["active"][-1] == np.count_nonzero(
        (result.z == -0.001) | (result.z == 0.002)
    )


# ---- the American put


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
    for _ in range(steps):
        q = -V
        q[0] += left
        result = solve_lcp(A, q, payoff, z0=V)
        assert result.status is Status.SOLVED
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


@pytest.mark.parametrize("size", [1e-160, 1e162])
def test_diagonals_whose_squares_leave_the_range(size):
    """z is as small as 1 / diag A, once q has been scaled: its square would be 0."""
    A = sparse.csr_array(sparse.diags_array(np.array([7.0, 7.0]) * size))
    result = solve_lcp(A, np.array([-1.5, 1.1]) * 1e-6 * size)
    assert result.status is Status.SOLVED
    assert result.method == "tridiagonal"
    np.testing.assert_allclose(result.z, [1.5e-6 / 7.0, 0.0], rtol=1e-9)
