"""Truncated multigrid: kernels against plain matrices, solutions against pivoting."""

import math
import tracemalloc

import numpy as np
import pytest
from scipy import sparse
from scipy.linalg import solve_triangular

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.multigrid import cycles as multigrid
from namlcp.lcp.multigrid.coarsening import interpolation
from namlcp.lcp.multigrid.hierarchy import MAX_COARSE, build, coarsen, suits
from namlcp.lcp.multigrid.vcycle import VCycle
from namlcp.lcp.relaxation import relax_back, relax_csr
from namlcp.limits import Deadline
from namlcp.residuals import natural_residual
from namlcp.scenes import forced_obstacle

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


MATRICES = {
    "five-point": forced_obstacle(24)[0],
    "convection": convection(24),
}


def csr(rows, shape):
    """Return what a kernel sees."""
    return sparse.csr_array((rows.data, rows.indices, rows.indptr), shape=shape)


def nbytes(hierarchy):
    """Return the bytes of all levels, those of A included."""
    parts = ((*k.A, *k.P, *k.R, k.diagonal, k.d, k.C) for k in hierarchy.levels)
    return sum(array.nbytes for arrays in parts for array in arrays)


def dense(rows, shape):
    """Return what a kernel sees as a dense array."""
    return csr(rows, shape).toarray()


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


def test_backward_sweep_is_the_forward_one_in_reverse_order(rng):
    A = MATRICES["convection"]
    n = A.shape[0]
    q, lower = rng.standard_normal(n), -rng.random(n)
    upper = lower + rng.random(n)
    z = np.clip(rng.standard_normal(n), lower, upper)
    back = z.copy()
    relax_back(A.indptr, A.indices, A.data, q, lower, upper, back)
    R = sparse.csr_array(A[::-1][:, ::-1])
    R.sort_indices()
    vectors = [v[::-1].copy() for v in (q, lower, upper, z)]
    relax_csr(R.indptr, R.indices, R.data, *vectors[:3], 1.0, vectors[3])
    np.testing.assert_allclose(back, vectors[3][::-1], atol=1e-14)


# ---- hierarchies


def test_levels_are_what_the_kernels_expect():
    A = MATRICES["five-point"]
    hierarchy = build(A, True)
    first, second = hierarchy.levels[:2]
    assert hierarchy.levels[0].A.data is A.data
    assert hierarchy.levels[-1].d.size <= MAX_COARSE
    assert hierarchy.rate < 0.3
    for level in hierarchy.levels:
        assert level.A.indices.dtype == level.diagonal.dtype == np.int32
        np.testing.assert_array_equal(level.A.data[level.diagonal], level.d)
        n = level.d.size
        rows = csr(level.A, (n, n))
        assert (np.diff(rows.tocoo().coords[0] * n + rows.indices) > 0).all()
    P = dense(first.P, (first.d.size, second.d.size))
    np.testing.assert_array_equal(dense(first.R, P.T.shape), P.T)
    np.testing.assert_array_equal(P[first.C], np.eye(second.d.size))
    np.testing.assert_allclose(
        dense(second.A, (second.d.size,) * 2), P.T @ A @ P, atol=1e-13
    )
    size = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    assert size < nbytes(hierarchy) < 6 * size


@pytest.mark.parametrize("second_pass", [False, True])
@pytest.mark.parametrize("name", MATRICES)
def test_levels_are_those_of_pyamg(name, second_pass):
    import pyamg

    A = MATRICES[name]
    theirs = pyamg.ruge_stuben_solver(
        sparse.csr_matrix(A),  # pyamg 5.2 takes no csr_array
        strength=("classical", {"theta": 0.25, "norm": "min"}),
        CF=("RS", {"second_pass": second_pass}),
        max_coarse=MAX_COARSE,
    )
    ours = coarsen(A, True, second_pass)
    assert len(ours) == len(theirs.levels)
    for level, other in zip(ours, theirs.levels, strict=True):
        n = level.d.size
        np.testing.assert_allclose(
            dense(level.A, (n, n)), other.A.toarray(), atol=1e-13
        )
        if level.C.size:
            P = dense(level.P, other.P.shape)
            np.testing.assert_allclose(P, other.P.toarray(), atol=1e-13)


def test_scaling_is_undone_only_where_it_helps(rng):
    A = MATRICES["five-point"]
    assert np.all(build(A, True).scale == 1.0)
    D = sparse.diags_array(10.0 ** rng.uniform(-2, 2, A.shape[0]))
    B = sparse.csr_array(D @ A @ D)
    scale = build(B, True).scale
    np.testing.assert_allclose(scale * D.diagonal(), 0.5)


def test_matrices_that_do_not_suit_are_refused(rng):
    n = 400
    factor = sparse.random_array((n, n), density=0.01, rng=rng)
    contact = sparse.csr_array(factor @ factor.T + 0.1 * sparse.eye_array(n))
    skew = sparse.csr_array(factor - factor.T + 0.1 * sparse.eye_array(n))
    no_diagonal = MATRICES["five-point"] - 4.0 * sparse.eye_array(576)
    no_diagonal.eliminate_zeros()
    full = sparse.csr_array(-np.ones((n, n)) + 2 * n * np.eye(n))
    assert build(sparse.csr_array(sparse.eye_array(2 * n)), True) is None
    for A in (contact, skew, sparse.csr_array(no_diagonal), full):
        assert not suits(A)
        assert build(A, True) is None
        with pytest.raises(ValueError, match="does not suit"):
            solve_lcp(A, np.ones(A.shape[0]), method="multigrid")


def test_second_pass_comes_where_the_rate_is_bad(monkeypatch):
    asked = []

    def noted(A, symmetric, second_pass, deadline):
        asked.append(second_pass)
        return coarsen(A, symmetric, second_pass, deadline)

    monkeypatch.setattr("namlcp.lcp.multigrid.hierarchy.coarsen", noted)
    build(MATRICES["five-point"], True)
    assert asked == [False]
    monkeypatch.setattr("namlcp.lcp.multigrid.hierarchy.GOOD", 0.0)
    monkeypatch.setattr("namlcp.lcp.multigrid.hierarchy.USELESS", 0.01)
    assert build(MATRICES["five-point"], True) is None
    assert asked == [False, False, True]


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
    np.testing.assert_array_equal(result.w, A @ result.z + q)
    assert result.residual == natural_residual(result.z, result.w, lower, upper) < EPS
    assert np.all((lower <= result.z) & (result.z <= upper))
    exact = solve_lcp(A, q, lower, upper)
    assert exact.method == "pivoting"
    np.testing.assert_allclose(result.z, exact.z, atol=1e-7)


def test_units_do_not_matter(rng):
    """D A D with D in 10^(+-2): tolerance and result stay the caller's."""
    A, q = forced_obstacle(30)
    d = 10.0 ** rng.uniform(-2, 2, q.size)
    D = sparse.diags_array(d)
    B = sparse.csr_array(D @ A @ D)
    result = solve_lcp(B, d * q, method="multigrid", eps_abs=EPS)
    assert result.status is Status.SOLVED
    assert result.residual < EPS
    assert result.iterations <= 10
    expected = solve_lcp(A, q).z
    np.testing.assert_allclose(d * result.z, expected, atol=1e-6)


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
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z, solve_lcp(A, q).z, atol=1e-9)


def test_large_obstacle_takes_few_cycles_by_default():
    A, q = forced_obstacle(120)
    result = solve_lcp(A, q, eps_abs=EPS, history=True)
    assert (result.status, result.method) == (Status.SOLVED, "multigrid")
    assert result.iterations <= 5
    assert result.residual < EPS
    assert result.history["iter"][-1] == result.iterations
    assert result.history["active"][-1] == np.count_nonzero(result.z == 0.0)
    again = solve_lcp(A, q, eps_abs=EPS)
    np.testing.assert_array_equal(again.z, result.z)


def test_start_that_only_looked_close_is_given_up(monkeypatch):
    monkeypatch.setattr(multigrid, "WARM_RESIDUAL", INF)
    monkeypatch.setattr(multigrid, "WARM_CYCLES", 2)
    A, q = forced_obstacle(120)
    matrix = Prepared(A)
    z = solve_lcp(matrix, q, method="multigrid", eps_abs=EPS).z
    z0 = np.ones(q.size)
    result = solve_lcp(matrix, q, z0=z0, method="multigrid", eps_abs=EPS)
    assert result.status is Status.SOLVED
    assert 2 < result.iterations <= 2 + 5
    np.testing.assert_allclose(result.z, z, atol=1e-6)


def test_hierarchy_is_kept_and_reused(monkeypatch):
    A, q = forced_obstacle(40)
    matrix = Prepared(A)
    first = solve_lcp(matrix, q, method="multigrid", eps_abs=EPS)
    monkeypatch.setattr("namlcp.lcp.multigrid.hierarchy.coarsen", None)
    for load, upper in ((q, INF), (2.0 * q, 0.2), (-q, INF)):
        result = solve_lcp(matrix, load, upper=upper, method="multigrid", eps_abs=EPS)
        assert result.status is Status.SOLVED
        assert result.residual < EPS
    again = solve_lcp(matrix, q, method="multigrid", eps_abs=EPS)
    np.testing.assert_array_equal(first.z, again.z)
    warm = solve_lcp(matrix, q, method="multigrid", eps_abs=EPS, z0=first.z)
    assert warm.iterations == 0
    near = solve_lcp(matrix, 1.001 * q, method="multigrid", eps_abs=EPS, z0=first.z)
    assert near.residual < EPS
    far = solve_lcp(matrix, -q, method="multigrid", eps_abs=EPS, z0=first.z)
    assert far.residual < EPS


def test_set_up_looks_at_the_deadline(monkeypatch):
    """Between the levels; nothing half made is kept."""
    deadline, levels = Deadline(math.inf), []

    def interrupting(*arguments):
        levels.append(arguments[0].shape[0])
        deadline.interrupted = len(levels) == 2
        return interpolation(*arguments)

    A, q = forced_obstacle(40)
    matrix = Prepared(A)
    with monkeypatch.context() as patch:
        patch.setattr("namlcp.lcp.multigrid.hierarchy.interpolation", interrupting)
        assert matrix.hierarchy(deadline) is None
    assert len(levels) == 2
    result = solve_lcp(matrix, q, 0.1, method="multigrid", time_limit=1e-9)
    assert result.status is Status.TIME_LIMIT
    assert result.iterations == 0
    np.testing.assert_array_equal(result.z, 0.1)
    np.testing.assert_array_equal(result.w, A @ result.z + q)
    assert solve_lcp(matrix, q, method="multigrid").status is Status.SOLVED


def test_memory_stays_below_three_times_that_of_the_hierarchy():
    A, q = forced_obstacle(120)
    solve_lcp(A, q, method="multigrid", eps_abs=EPS)  # compiles
    tracemalloc.start()
    matrix = Prepared(A)
    solve_lcp(matrix, q, method="multigrid", eps_abs=EPS)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    size = A.data.nbytes + A.indices.nbytes + A.indptr.nbytes
    assert size + peak < 2.5 * nbytes(matrix.hierarchy())
