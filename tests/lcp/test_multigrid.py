"""Truncated multigrid: kernels against plain matrices, solutions against pivoting."""

import tracemalloc

import numpy as np
import pytest
from lcp_definition import assert_solves_lcp
from scipy import sparse
from scipy.linalg import solve_triangular

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.multigrid.hierarchy import build
from namlcp.lcp.multigrid.vcycle import VCycle
from namlcp.scenes import forced_obstacle
from validation.problems import large_scenes

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


# ---- kernels


def dense(rows, shape):
    """Return what a kernel sees as a dense array."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), shape).toarray()


def truncated_matrices(levels, free):
    """Return dense A_k = P' T A T P, T of every level, and P, by plain products."""
    n = levels[0].d.size
    A = dense(levels[0].A, (n, n))
    T = free.astype(float)
    matrices, faces, interpolations = [], [], []
    for level in levels:
        matrices.append(A)
        faces.append(T)
        if level.C.size:
            P = dense(level.P, (level.d.size, level.C.size))
            interpolations.append(P)
            A = P.T @ (T[:, None] * A * T) @ P
            T = T[level.C]
    return matrices, faces, interpolations


def plain_cycle(matrices, faces, interpolations, edges, b):
    """Return B b: a sweep down, coarse correction, a sweep up, with dense solves."""
    F = np.flatnonzero(faces[0])
    A = matrices[0][np.ix_(F, F)]
    x = np.zeros(b.size)
    if not interpolations:
        x[F] = np.linalg.pinv(A, rcond=1e-13) @ b[F]
        return x
    x[F] = solve_triangular(A, b[F], lower=True)
    r = np.zeros(b.size)
    r[F] = b[F] - A @ x[F]
    P = interpolations[0]
    rest = matrices[1:], faces[1:], interpolations[1:], edges[1:]
    x += faces[0] * (P @ relaxed_cycle(*rest, P.T @ r))
    x[F] += solve_triangular(A, b[F] - A @ x[F])
    return x


def relaxed_cycle(matrices, faces, interpolations, edges, b):
    """Return a cycle between two sweeps over the rows of the edge, down and up."""
    A, edge = matrices[0] * np.outer(faces[0], faces[0]), edges[0]
    x, y = np.zeros((2, b.size))
    own = A[np.ix_(edge, edge)]
    x[edge] = solve_triangular(own, b[edge], lower=True)
    x += plain_cycle(matrices, faces, interpolations, edges, b - A @ x)
    y[edge] = solve_triangular(own, (b - A @ x)[edge])
    return x + y


def faces_in_turn(rng, n):
    """Yield faces: everything, a few isolated unknowns off, patches, almost nothing."""
    i = np.arange(n)
    yield np.ones(n, dtype=bool)
    yield rng.random(n) > 0.02
    yield (i // 24 < 15) | (i % 24 < 7)
    yield rng.random(n) > 0.5
    yield rng.random(n) > 0.97
    yield (i // 24 > 3) & (i % 24 < 20)


@pytest.mark.parametrize("name", MATRICES)
def test_cycle_and_local_galerkin_product_are_their_formulas(rng, name):
    """One VCycle takes face after face: rows are recomputed and restored."""
    A = MATRICES[name]
    hierarchy = build(A, name != "convection")
    cycle = VCycle(hierarchy.levels, hierarchy.symmetric)
    assert len(hierarchy.levels) >= 3
    n = A.shape[0]
    for free in faces_in_turn(rng, n):
        cycle.faces[0].dinv[:] = np.where(free, 1.0 / A.diagonal(), 0.0)
        cycle.follow_face(0)
        matrices, faces, P = truncated_matrices(hierarchy.levels, free)
        for state, matrix, T in zip(cycle.faces, matrices, faces, strict=True):
            np.testing.assert_array_equal(state.dinv > 0.0, T > 0.0)
            found = dense(state.A, matrix.shape) * np.outer(T, T)
            expected = matrix * np.outer(T, T)
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
            np.testing.assert_allclose(
                state.dinv[T > 0.0], 1.0 / matrix.diagonal()[T > 0.0], rtol=1e-12
            )
        b = np.where(free, rng.standard_normal(n), 0.0)
        x = np.empty(n)
        product = cycle.solve(0, b, x)
        expected = plain_cycle(matrices, faces, P, cycle.edges, b)
        np.testing.assert_allclose(x, expected, atol=1e-11 * np.abs(expected).max())
        assert product == pytest.approx(b @ x)


@pytest.mark.parametrize("name", MATRICES)
def test_levels_are_those_of_pyamg(name):
    """Ruge and Stueben's, by the first pass alone where its rate is good."""
    import pyamg

    A = MATRICES[name]
    theirs = [
        pyamg.ruge_stuben_solver(
            sparse.csr_matrix(A),  # pyamg 5.2 takes no csr_array
            strength=("classical", {"theta": 0.25, "norm": "min"}),
            CF=("RS", {"second_pass": second_pass}),
            max_coarse=50,
        ).levels
        for second_pass in (False, True)
    ]
    ours = build(A, True).levels
    like = [other for other in theirs if len(other) == len(ours)]
    like = [o for o in like if o[1].A.shape[0] == ours[1].d.size]
    for level, other in zip(ours, like[0], strict=True):
        n = level.d.size
        np.testing.assert_allclose(
            dense(level.A, (n, n)), other.A.toarray(), atol=1e-13
        )
        if level.C.size:
            P = dense(level.P, other.P.shape)
            np.testing.assert_allclose(P, other.P.toarray(), atol=1e-13)
            np.testing.assert_array_equal(P[level.C], np.eye(level.C.size))


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

    def counted(cycle, k, b, x):
        begun.append(b is not cycle.faces[k].b)  # else part of a cycle from above
        return solve(cycle, k, b, x)

    monkeypatch.setattr(VCycle, "solve", counted)
    A, *vectors = large_scenes.transport(100)
    matrix = Prepared(A)
    matrix.hierarchy()
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
    monkeypatch.setattr("namlcp.lcp.prepared.build", None)
    for load, upper in ((q, INF), (2.0 * q, 0.2), (-q, INF)):
        result = solve(load, upper=upper)
        assert result.status is Status.SOLVED
        assert result.residual < EPS
    np.testing.assert_allclose(first.z, solve(q).z, atol=1e-12)
    assert solve(q, z0=first.z).iterations == 0
    for load in (1.001 * q, -q):
        assert solve(load, z0=first.z).residual < EPS


def test_limits_return_the_best_point():
    A, q = forced_obstacle(40)
    found = solve_lcp(A, q, method="multigrid", max_iter=1, eps_abs=1e-30)
    assert (found.status, found.iterations) == (Status.MAX_ITER, 1)
    assert found.residual < 0.1 * np.linalg.norm(np.minimum(q, 0.0))
    found = solve_lcp(A, q, method="multigrid", eps_abs=1e-30)
    assert found.status is Status.STALLED
    assert found.iterations < 10
    assert found.residual < 1e-14


def test_memory_stays_below_three_times_that_of_the_hierarchy():
    A, q = forced_obstacle(120)
    solve_lcp(A, q, method="multigrid", eps_abs=EPS)  # compiles
    tracemalloc.start()
    matrix = Prepared(A)
    solve_lcp(matrix, q, method="multigrid", eps_abs=EPS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    levels = matrix.hierarchy().levels
    parts = ((*k.A, *k.P, *k.R, k.diagonal, k.d, k.C) for k in levels)
    kept = sum(array.nbytes for arrays in parts for array in arrays)
    size = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    assert size < kept < 6 * size
    assert size + peak < 2.5 * kept
