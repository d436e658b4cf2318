"""Large symmetric faces: the factor in blocks, its parts, and what is built on it."""

import numpy as np
import problems_lcp as problems
import pytest
from numba import njit
from problems_lcp import box_lcp
from scipy import sparse

from namlcp import Status, solve_lcp
from namlcp.lcp.pivoting import driver as exact
from namlcp.lcp.pivoting.driver import solve_box
from namlcp.lcp.pivoting.line_search import step_to
from namlcp.limits import Limits
from namlcp.linalg.columns import columns_of
from namlcp.linalg.minimum_degree import minimum_degree
from namlcp.linalg.supernodes import blocks_of, factor_blocks, solve_blocks
from validation.problems import contact_scenes

KINDS = {
    "heap": contact_scenes.heap,
    "full heap": lambda n: contact_scenes.heap(n, sideways=True),
    "wall": contact_scenes.brick_wall,
}

LIMITS = Limits(eps_rel=exact.ACCURACY)


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


def residual(A, q, z):
    """Return Res of the LCP scaled to a unit diagonal, over Res(0)."""
    d = 1.0 / np.sqrt(A.diagonal())
    found = np.linalg.norm(np.minimum(z / d, d * (A @ z + q)))
    return found / np.linalg.norm(np.minimum(d * q, 0.0))


@pytest.mark.parametrize("kind", KINDS)
def test_scenes(kind):
    A, q, freedom = KINDS[kind](300)
    again = KINDS[kind](300)
    assert (A != again.A).nnz == 0
    np.testing.assert_array_equal(q, again.q)
    assert abs(A - A.T).max() <= 1e-15 * abs(A).max()
    assert abs(q.size - 300) < 60
    d = 1.0 / np.sqrt(A.diagonal())
    rank = np.linalg.matrix_rank(A.toarray() * np.outer(d, d), tol=1e-10)
    assert rank <= freedom
    assert (rank == q.size) == (kind == "heap")


@pytest.mark.parametrize("kind", ["grid", *KINDS])
@pytest.mark.parametrize("share", [0.6, 1.0])
def test_factor_in_blocks(rng, kind, share):
    """Against a dense solve: all anew, and after some unknowns changed their state."""
    A = problems.laplacian(18) if kind == "grid" else KINDS[kind](300).A
    n = A.shape[0]
    member = rng.random(n) < share
    columns = columns_of(A, True)
    order = minimum_degree(columns.indptr, columns.indices, member)
    blocks = blocks_of(columns.indptr, columns.indices, order)
    assert sorted(blocks.order) == list(np.flatnonzero(member))
    data, values = columns.data, np.full(blocks.nodes.panels[-1], np.nan)
    shift, b = A.diagonal() * rng.random(n), rng.standard_normal(n)
    free, changed = member & (rng.random(n) < 0.8), member
    for _ in range(4):
        least, part = factor_blocks(data, shift, free, changed, blocks, values)
        assert least == 1.0
        assert part <= 1.0
        x = np.zeros(n)
        solve_blocks(blocks, free, values, b, x)
        F = np.flatnonzero(free)
        M = A.toarray()[np.ix_(F, F)] + np.diag(shift[F])
        np.testing.assert_allclose(M @ x[F], b[F], atol=1e-9)
        assert not x[~free].any()
        anew = np.empty_like(values)
        factor_blocks(data, shift, free, member, blocks, anew)
        np.testing.assert_array_equal(values, anew)
        changed = member & (rng.random(n) < 0.02)
        free = free ^ changed


def test_indefinite_is_told(rng):
    A = sparse.csr_array(problems.laplacian(15) - 2.0 * sparse.eye_array(225))
    columns, every = columns_of(A, True), np.ones(225, dtype=bool)
    order = minimum_degree(columns.indptr, columns.indices)
    blocks = blocks_of(columns.indptr, columns.indices, order)
    values = np.empty(blocks.nodes.panels[-1])
    least, _ = factor_blocks(columns.data, np.zeros(225), every, every, blocks, values)
    assert least < -0.1


@pytest.mark.parametrize("kind", KINDS)
def test_large_contact(kind):
    A, q, _ = KINDS[kind](3000)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    assert np.all(result.z >= 0.0)
    assert residual(A, q, result.z) <= 1e-9
    np.testing.assert_array_equal(solve_lcp(A, q).z, result.z)


@pytest.mark.parametrize("kind", ["heap", "wall"])
def test_blocks_change_nothing(monkeypatch, kind):
    """w of a semidefinite LCP is unique: with and without blocks it is the same."""
    A, q, _ = KINDS[kind](600)
    found = []
    for size in (100, 10**9):
        monkeypatch.setattr(exact, "BLOCK_ORDER", size)
        monkeypatch.setattr(exact, "BLOCK_ENTRIES", 0)
        found.append(solve_lcp(A, q))
    np.testing.assert_allclose(found[0].w, found[1].w, atol=1e-7 * abs(q).max())


def test_box_pinned_free_and_convexity(rng, monkeypatch):
    monkeypatch.setattr(exact, "BLOCK_ORDER", 100)
    monkeypatch.setattr(exact, "BLOCK_ENTRIES", 0)
    A, q = problems.laplacian(15), rng.standard_normal(225)
    lower, upper = -rng.random(225), rng.random(225)
    lower[:20], upper[10:30] = -np.inf, np.inf
    upper[40:50] = lower[40:50]
    found = solve_box(box_lcp(A, q, lower, upper), None, LIMITS, ask_convex=True)
    assert found.status is Status.SOLVED
    assert found.convex
    r = found.z - np.clip(found.z - found.w, lower, upper)
    assert np.linalg.norm(r) <= 1e-8 * np.linalg.norm(q)
    B = sparse.csr_array(A - 0.5 * sparse.eye_array(225))
    lcp = box_lcp(B, np.ones(225), np.zeros(225), np.ones(225))
    found = solve_box(lcp, None, LIMITS, ask_convex=True)
    assert not found.convex


# ---- the search along a step of block pivoting


@njit
def stepped(x, s, x_end, s_end, lower, upper):
    """Call what only compiled code may call."""
    return step_to(x, s, x_end, s_end, lower, upper)


def test_search_finds_the_least_phi(rng):
    """Against a grid of steps, with bounds of every kind."""
    n, rho = 30, 1e-2
    B = rng.standard_normal((n, n // 2))
    A, q, centre = B @ B.T, rng.standard_normal(n), rng.random(n)
    lower, upper = np.zeros(n), np.full(n, np.inf)
    upper[:10], lower[20:] = 0.5, -np.inf

    def shifted(x):
        return centre - (A @ x + q) / rho

    def phi(x):
        s = shifted(x)
        outside = s - np.clip(s, lower, upper)
        return 0.5 * x @ A @ x + 0.5 * rho * (s @ s - outside @ outside)

    begin, end = rng.random(n), rng.standard_normal(n)
    x, s = begin.copy(), shifted(begin)
    step = stepped(x, s, end, shifted(end), lower, upper)
    assert 0.0 < step < 1.0
    steps = np.linspace(0.0, 1.0, 2001)
    values = [phi(begin + t * (end - begin)) for t in steps]
    assert abs(step - steps[np.argmin(values)]) <= 1e-3
    np.testing.assert_allclose(x, begin + step * (end - begin))
    np.testing.assert_allclose(s, shifted(x), atol=1e-9 / rho)


def test_search_ends_where_pivoting_goes_round():
    """A heap on which the path stalls: no more than some dozens of factorisations."""
    A, q, _ = contact_scenes.heap(6000, sideways=True, seed=1)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    assert residual(A, q, result.z) <= 1e-9
    assert result.iterations <= 60


# ---- singular matrices of pure Neumann problems


def neumann(n):
    """Return the second difference with free ends: it sends constants to 0."""
    diagonal = np.full(n, 2.0)
    diagonal[[0, -1]] = 1.0
    off = -np.ones(n - 1)
    return sparse.diags_array([off, diagonal, off], offsets=[-1, 0, 1])


def neumann_wall(m, n):
    return sparse.csr_array(
        sparse.kron(neumann(m), sparse.eye_array(n))
        + sparse.kron(sparse.eye_array(m), neumann(n))
    )


@pytest.mark.parametrize(
    "A", [sparse.csr_array(neumann(544)), neumann_wall(2, 272), neumann_wall(16, 34)]
)
@pytest.mark.parametrize("seed", range(3))
def test_neumann_is_solved_or_refuted(A, seed):
    """Solvable if and only if sum(q) >= 0; otherwise the constants prove it."""
    n = A.shape[0]
    q = np.random.default_rng(seed).standard_normal(n)
    lower, upper = np.zeros(n), np.full(n, np.inf)
    lcp = box_lcp(A, q - q.mean() + 1e-3, lower, upper)
    found = solve_box(lcp, None, LIMITS)
    assert found.status is Status.SOLVED
    assert found.iterations < 30
    q -= q.mean() + 1e-3
    found = solve_box(lcp._replace(q=q), None, LIMITS)
    assert found.status is Status.UNSOLVABLE
    assert found.iterations < 30
    assert q @ found.ray == pytest.approx(-1.0)
    assert found.ray.min() > 0.0
    assert abs(A @ found.ray).max() <= 1e-12 * found.ray.max()
