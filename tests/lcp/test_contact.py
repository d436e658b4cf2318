"""Large symmetric faces: contact scenes, singular matrices, free systems, convexity."""

import numpy as np
import problems_lcp as problems
import pytest
from lcp_definition import assert_proves_unsolvable, assert_solves_lcp
from scipy import sparse

from namlcp import Status, solve_lcp, solve_qp
from validation.problems import contact_scenes

INF = np.inf
KINDS = {
    "heap": contact_scenes.heap,
    "full heap": lambda n: contact_scenes.heap(n, sideways=True),
    "wall": contact_scenes.brick_wall,
}


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


@pytest.mark.parametrize("kind", KINDS)
def test_large_contact(kind):
    A, q, *_ = KINDS[kind](3000)
    result, again = solve_lcp(A, q), solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    assert result.iterations <= 200
    np.testing.assert_allclose(again.w, result.w, atol=1e-9 * np.abs(q).max())


def test_pivoting_that_goes_round_is_ended():
    """A heap on which paths stall, too."""
    A, q, *_ = contact_scenes.heap(6000, sideways=True, seed=1)
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    assert result.iterations <= 300


def test_a_path_that_is_slow_at_first_is_followed():
    """Its residual halves in 10 steps, again at 10^-4, where faces are not found."""
    A, q, *_ = contact_scenes.heap(28_000, sideways=True)
    result = solve_lcp(A, q, time_limit=60.0)
    assert_solves_lcp(result, A, q)
    assert result.iterations <= 400


@pytest.mark.parametrize(("m", "method"), [(50, "pivoting"), (150, "multigrid")])
def test_sparse_beyond_sweeps(rng, m, method):
    A, q = problems.laplacian(m), rng.standard_normal(m * m)
    result = solve_lcp(A, q)
    assert result.method == method
    assert_solves_lcp(result, A, q)
    assert solve_lcp(A, q, time_limit=1e-3).status is Status.TIME_LIMIT


@pytest.mark.parametrize("shape", [(544, 1), (272, 2), (34, 16)])
@pytest.mark.parametrize("seed", range(2))
def test_free_ends_are_solved_or_refuted(shape, seed):
    """Solvable if and only if sum(q) >= 0; otherwise the constants prove it."""
    A = problems.neumann(*shape)
    q = np.random.default_rng(seed).standard_normal(A.shape[0])
    above, below = q - q.mean() + 1e-3, q - q.mean() - 1e-3
    found = solve_lcp(A, above)
    assert_solves_lcp(found, A, above)
    found = solve_lcp(A, below)
    assert found.status is Status.UNSOLVABLE
    assert found.ray.min() > 0.0
    assert_proves_unsolvable(found.ray, A, below)


@pytest.mark.parametrize("kind", ["dense", "sparse", "nonsymmetric", "singular", "big"])
def test_free_and_pinned_unknowns_are_a_linear_system(rng, kind):
    """z_F = -A_FF^-1 (q + A z_B)_F, for every engine of free systems."""
    A = problems.laplacian(30 if kind == "big" else 12, 0.5)
    if kind == "nonsymmetric":
        A = sparse.csr_array(A + sparse.triu(A, 1))
    if kind == "singular":
        A = problems.neumann(12, 12)
    if kind == "dense":
        A = A.toarray() + 0.01
    full, n = A if kind == "dense" else A.toarray(), A.shape[0]
    for share in (0.5, 0.9, 1.0):
        F, q = rng.random(n) < share, rng.standard_normal(n)
        F[0] = kind != "singular"
        z = rng.standard_normal(n)
        lower, upper = np.where(F, -INF, z), np.where(F, INF, z)
        result = solve_lcp(A, q, lower, upper)
        assert result.status is Status.SOLVED
        z[F] = np.linalg.solve(full[np.ix_(F, F)], -(q + full[:, ~F] @ z[~F])[F])
        np.testing.assert_allclose(result.z, z, atol=1e-8 * np.abs(z).max())


@pytest.mark.parametrize("kind", ["symmetric", "nonsymmetric"])
def test_last_rows_may_be_empty(rng, kind):
    """Of large matrices, whose order does not follow from their entries."""
    A = problems.laplacian(66)
    if kind == "nonsymmetric":
        A = sparse.csr_array(A - 0.1 * sparse.triu(A, 1))
    A = sparse.csr_array(sparse.block_diag([A, sparse.csr_array((1000, 1000))]))
    n = A.shape[0]
    q, lower = rng.standard_normal(n), np.zeros(n)
    q[-1000:], lower[-500:], q[-500:] = 1.0, -INF, 0.0
    result = solve_lcp(A, q, lower)
    assert result.method == "pivoting"
    assert_solves_lcp(result, A, q, lower)
    if kind == "symmetric":
        result = solve_qp(sparse.csc_array(A), q, lb=lower)
        assert result.status is Status.SOLVED


@pytest.mark.parametrize("n", [225, 900])
def test_boxes_of_sparse_matrices(rng, n):
    A, q = problems.laplacian(int(np.sqrt(n))), rng.standard_normal(n)
    lower, upper = -rng.random(n), rng.random(n)
    lower[:20], upper[10:30] = -INF, INF
    upper[40:50] = lower[40:50]
    result = solve_lcp(A, q, lower, upper)
    assert_solves_lcp(result, A, q, lower, upper)
    np.testing.assert_array_equal(result.z[40:50], lower[40:50])


def test_convexity_is_told():
    """A - s I has a solution of its LCP for all s, but as a QP it must be convex."""
    A, n = problems.laplacian(15), 225
    low = np.linalg.eigvalsh(A.toarray())[0]
    for shift, convex in ((0.0, True), (0.9 * low, True), (1.2 * low, False)):
        P = sparse.csc_array(A - shift * sparse.eye_array(n))
        if convex:
            result = solve_qp(P, -np.ones(n), lb=np.zeros(n), ub=np.ones(n))
            assert (result.status, result.form) == (Status.SOLVED, "bounds")
        else:
            with pytest.raises(ValueError, match="positive semidefinite"):
                solve_qp(P, -np.ones(n), lb=np.zeros(n), ub=np.ones(n))
