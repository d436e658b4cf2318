"""Truncated multigrid: kernels against plain matrices, solutions against pivoting."""

import numpy as np
import pytest
from lcp_definition import assert_solves_lcp
from scipy import sparse

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.multigrid.hierarchy import VCycle
from validation.problems import known_scenes
from validation.problems.known_scenes import forced_obstacle

INF = np.inf
EPS = 1e-9
"""Natural residual asked of every solution here."""


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


def convection(m, c=0.3):
    """Return the five-point matrix with entries -1 -+ c: not symmetric."""
    line = sparse.diags_array(
        [-1.0 - c, 2.0, c - 1.0], offsets=[-1, 0, 1], shape=(m, m)
    )
    one = sparse.eye_array(m)
    return sparse.csr_array(sparse.kron(line, one) + sparse.kron(one, line))


MATRICES = {"five-point": forced_obstacle(24)[0], "convection": convection(24)}


# ---- what suits


def test_matrices_that_do_not_suit_are_refused(rng):
    n = 400
    factor = sparse.random_array((n, n), density=0.01, rng=rng)
    contact = sparse.csr_array(factor @ factor.T + 0.1 * sparse.eye_array(n))
    skew = sparse.csr_array(factor - factor.T + 0.1 * sparse.eye_array(n))
    no_diagonal = MATRICES["five-point"] - 4.0 * sparse.eye_array(576)
    no_diagonal.eliminate_zeros()
    full = sparse.csr_array(-np.ones((n, n)) + 2 * n * np.eye(n))
    diagonal = sparse.eye_array(2 * n)
    peclet = convection(40, 1.5)  # central differences far beyond cell Peclet number 1
    for A in (contact, skew, no_diagonal, full, diagonal, peclet):
        with pytest.raises(ValueError, match="does not suit"):
            solve_lcp(sparse.csr_array(A), np.ones(A.shape[0]), method="multigrid")


# ---- solutions


def bounds(rng, n, kind):
    """Return q, lower, upper."""
    q = 0.05 * rng.standard_normal(n) - 0.02
    lower, upper = np.zeros(n), np.full(n, INF)
    if kind == "box":
        upper[:] = 0.05
    if kind == "pinned":
        upper[rng.random(n) < 0.1] = 0.0
        lower[rng.random(n) < 0.5] = -INF
        upper[rng.random(n) < 0.2] = 0.03
    if kind == "free":
        lower[:] = -INF
    if kind == "shifted":
        lower = rng.uniform(-1.0, 1.0, n)
        upper = lower + rng.uniform(0.0, 0.5, n)
    if kind == "zero":
        q[:] = 0.0
    if kind == "zero away":
        q[:], lower[:] = 0.0, rng.uniform(-1.0, 1.0, n)
    if kind == "everything active":
        q = 1.0 + rng.random(n)
    if kind == "nothing active":
        q = -rng.random(n)
    return q, lower, upper


KINDS = [
    "plain", "box", "pinned", "free", "shifted", "zero", "zero away",
    "everything active", "nothing active",
]  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", MATRICES)
def test_solution_is_that_of_pivoting(rng, name, kind):
    A = MATRICES[name]
    q, lower, upper = bounds(rng, A.shape[0], kind)
    result = solve_lcp(A, q, lower, upper, method="multigrid", eps_abs=EPS)
    assert (result.status, result.method) == (Status.SOLVED, "multigrid")
    assert result.iterations <= 10
    assert result.residual < EPS
    assert np.all((lower <= result.z) & (result.z <= upper))
    exact = solve_lcp(A, q, lower, upper)
    assert_solves_lcp(exact, A, q, lower, upper)
    assert exact.method == "pivoting"
    np.testing.assert_allclose(result.z, exact.z, atol=1e-7)


def test_units_of_the_unknowns_do_not_matter(rng):
    """D A D with D in 10^(+-2): tolerance and result stay the caller's."""
    A, q = forced_obstacle(30)
    d = 10.0 ** rng.uniform(-2, 2, q.size)
    D = sparse.diags_array(d)
    B = sparse.csr_array(D @ A @ D)
    result = solve_lcp(B, d * q, method="multigrid", eps_abs=EPS)
    assert result.status is Status.SOLVED
    assert result.residual < EPS
    assert result.iterations <= 10
    np.testing.assert_allclose(d * result.z, solve_lcp(A, q).z, atol=1e-6)


@pytest.mark.parametrize("unit", [1e-14, 1e10, 1e17])
def test_units_of_the_matrix_do_not_matter(unit, capfd):
    A, q = forced_obstacle(30)
    result = solve_lcp(unit * A, q, method="multigrid")
    assert result.status is Status.SOLVED
    expected = solve_lcp(A, q, method="multigrid").z / unit
    np.testing.assert_allclose(result.z, expected, atol=1e-8 * np.max(expected))
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("m", [5, 9, 40])
def test_few_unknowns_and_the_default_tolerance(m):
    A, q = forced_obstacle(m)
    result = solve_lcp(A.toarray(), q, method="multigrid")
    assert_solves_lcp(result, A, q)
    np.testing.assert_allclose(result.z, solve_lcp(A, q).z, atol=1e-9)


def test_a_large_obstacle_takes_few_cycles_by_default():
    A, q = forced_obstacle(120)
    result = solve_lcp(A, q, eps_abs=EPS, history=True)
    assert (result.status, result.method) == (Status.SOLVED, "multigrid")
    assert result.iterations <= 5
    assert result.residual < EPS
    assert result.history["iter"][-1] == result.iterations
    assert result.history["active"][-1] == np.count_nonzero(result.z == 0.0)
    again = solve_lcp(A, q, eps_abs=EPS)
    np.testing.assert_allclose(again.z, result.z, atol=1e-12)
    # ones are no good start, and cycles from there are no worse than others
    far = solve_lcp(A, q, eps_abs=EPS, z0=np.ones(q.size), method="multigrid")
    assert far.status is Status.SOLVED
    assert far.iterations <= 10
    np.testing.assert_allclose(far.z, result.z, atol=1e-6)


def test_transport_takes_few_cycles(monkeypatch):
    """Example 2 at delta = 0, with a load: 60 at most, on all levels together."""
    solve, begun = VCycle.solve, []

    def counted(cycle, k, *vectors):
        begun.append(k == len(cycle.levels) - 1)  # once in a cycle
        solve(cycle, k, *vectors)

    monkeypatch.setattr(VCycle, "solve", counted)
    A, *vectors = known_scenes.transport(100)
    matrix = Prepared(A)
    solve_lcp(matrix, *vectors, method="multigrid", eps_abs=EPS)
    begun.clear()
    result = solve_lcp(matrix, *vectors, method="multigrid", eps_abs=EPS)
    assert result.status is Status.SOLVED
    assert 0 < sum(begun) <= 60


def test_a_hierarchy_is_kept_and_reused(monkeypatch):
    A, q = forced_obstacle(40)
    matrix = Prepared(A)

    def solve(q, **options):
        return solve_lcp(matrix, q, method="multigrid", eps_abs=EPS, **options)

    late = solve(q, time_limit=1e-9)  # before the levels are made: nothing is kept
    assert (late.status, late.iterations) == (Status.TIME_LIMIT, 0)
    np.testing.assert_array_equal(late.w, A @ late.z + q)
    first = solve(q)
    monkeypatch.setattr("namlcp.lcp.multigrid.hierarchy.build", None)
    for load, upper in ((q, INF), (2.0 * q, 0.2), (-q, INF)):
        result = solve(load, upper=upper)
        assert result.status is Status.SOLVED
        assert result.residual < EPS
    np.testing.assert_allclose(first.z, solve(q).z, atol=1e-12)
    assert solve(q, z0=first.z).iterations == 0
    for load in (1.001 * q, -q):
        assert solve(load, z0=first.z).residual < EPS
