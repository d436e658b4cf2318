"""solve_lcp(method="auto") against the definition, and its pieces against formulas."""

import time

import numpy as np
import problems_lcp as problems
import pytest
from lcp_definition import RELATIVE, assert_solves_lcp
from numba import njit
from scipy import sparse

from namlcp import Prepared, Status, solve_lcp
from namlcp.lcp.pivoting.driver import solve_box
from namlcp.lcp.pivoting.free_system import analyse, free_order, refactor, solve_free
from namlcp.lcp.pivoting.pivot import DONE, pivot
from namlcp.lcp.pivoting.state import PivotMemory, best_point, state_at
from namlcp.limits import Limits
from namlcp.linalg.columns import columns_of


@pytest.fixture
def rng():
    return np.random.default_rng(20261121)


# ---- textbook


@pytest.mark.parametrize("name", problems.TEXTBOOK)
def test_textbook(name):
    A, q, z = problems.textbook(name)
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    if z is not None:
        np.testing.assert_allclose(result.z, z, atol=1e-12)


@pytest.mark.parametrize("n", [1, 2, 8, 20, 30])
def test_murty_exponential(n):
    A, q, z = problems.murty(n)
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    np.testing.assert_allclose(result.z, z)


@pytest.mark.parametrize("n", [2, 10, 30])
def test_fathi_exponential(n):
    A, q = problems.fathi(n)
    assert_solves_lcp(solve_lcp(A, q), A, q)


def test_textbook_file():
    file = problems.textbook_file()
    if not file:
        pytest.skip(f"no textbook file in {problems.DATA}; set NAMLCP_DATA")
    for A, q in file.values():
        assert_solves_lcp(solve_lcp(A, q), A, q)


# ---- symmetric positive definite


@pytest.mark.parametrize("condition", [1e2, 1e6, 1e12])
@pytest.mark.parametrize("n", [1, 5, 40, 150])
def test_positive_definite(rng, n, condition):
    A = problems.spd(rng, n, condition)
    for q in (
        rng.standard_normal(n),
        problems.with_solution(rng, A)[0],
        problems.with_solution(rng, A, degenerate=0.5)[0],
    ):
        assert_solves_lcp(solve_lcp(A, q), A, q)


def test_known_solution(rng):
    A = problems.spd(rng, 60, 1e3)
    q, z = problems.with_solution(rng, A)
    np.testing.assert_allclose(solve_lcp(A, q).z, z, atol=1e-10)


@pytest.mark.parametrize("scale_A", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("scale_q", [1e-9, 1e9])
def test_scale_free(rng, scale_A, scale_q):
    A = problems.spd(rng, 50, 1e4)
    q = rng.standard_normal(50)
    z = solve_lcp(A, q).z * (scale_q / scale_A)
    result = solve_lcp(scale_A * A, scale_q * q)
    assert_solves_lcp(result, scale_A * A, scale_q * q)
    np.testing.assert_allclose(result.z, z, rtol=1e-6, atol=1e-9 * abs(z).max())


def test_rescaled_unknowns(rng):
    A, q = problems.spd(rng, 50, 1e4), rng.standard_normal(50)
    d = 10 ** rng.uniform(-4, 4, 50)
    B = d[:, None] * A * d
    B = (B + B.T) / 2
    assert_solves_lcp(solve_lcp(B, d * q), B, d * q)


# ---- nonsymmetric P-matrices


@pytest.mark.parametrize("n", [1, 2, 3, 10, 60])
@pytest.mark.parametrize("make", ["quotient_p", "triangular_p"])
def test_p_matrices(rng, make, n):
    A = getattr(problems, make)(rng, n)
    q, z = problems.with_solution(rng, A)
    result = solve_lcp(A, q)
    assert_solves_lcp(result, A, q)
    np.testing.assert_allclose(result.z, z, atol=1e-7 * (1 + abs(z).max()))
    rows, columns = 10 ** rng.uniform(-4, 4, (2, n))
    B, p = rows[:, None] * A * columns, rows * rng.standard_normal(n)
    assert_solves_lcp(solve_lcp(B, p), B, p)


@pytest.mark.parametrize("diagonal", [1e-2, 1e-4])
@pytest.mark.parametrize("n", [5, 50, 150])
def test_skew(rng, n, diagonal):
    A, q = problems.skew(rng, n, diagonal), rng.standard_normal(n)
    assert_solves_lcp(solve_lcp(A, q), A, q)


def test_sparse_nonsymmetric_faces_by_sparse_lu(rng):
    A = problems.laplacian(30, 0.5)
    A = sparse.csr_array(A + 0.1 * sparse.triu(A, 1))
    q = rng.standard_normal(900)
    assert_solves_lcp(solve_lcp(A, q), A, q)


# ---- boxes


@pytest.mark.parametrize("symmetric", [True, False])
def test_box(rng, symmetric):
    n = 60
    A = problems.spd(rng, n, 1e3) if symmetric else problems.quotient_p(rng, n)
    q = rng.standard_normal(n)
    lower, upper = -rng.random(n), rng.random(n)
    lower[:10], upper[5:15] = -np.inf, np.inf
    lower[20:25] = upper[20:25]
    result = solve_lcp(A, q, lower, upper)
    assert_solves_lcp(result, A, q, lower, upper)
    np.testing.assert_array_equal(result.z[20:25], upper[20:25])


def test_free_unknowns_are_equations(rng):
    A, q = problems.spd(rng, 20, 10), rng.standard_normal(20)
    result = solve_lcp(A, q, -np.inf, np.inf)
    np.testing.assert_allclose(result.z, np.linalg.solve(A, -q), atol=1e-12)


# ---- contact


@pytest.mark.parametrize("rows", [1, 3, 8])
def test_pile_of_discs(rng, rows):
    A, q = problems.disc_pile(rng, rows)
    assert_solves_lcp(solve_lcp(A, q), A, q)


def test_contact_scenes():
    names = problems.contact_names()
    if not names:
        pytest.skip(f"no contact scenes in {problems.DATA}; set NAMLCP_DATA")
    for name in names:
        A, q = problems.contact(name)
        assert_solves_lcp(solve_lcp(A, q), A, q)


# ---- large


def test_dominant_needs_no_factorisation():
    A = problems.laplacian(120, 4.0)
    z = np.tile([1.0, 0.0], A.shape[0] // 2)
    q = np.tile([0.0, 1.0], A.shape[0] // 2) - A @ z
    result = solve_lcp(A, q, eps_abs=1e-10)
    assert result.status is Status.SOLVED
    assert result.method == "psor"
    assert result.residual < 1e-10
    np.testing.assert_allclose(result.z, z, atol=1e-10)


@pytest.mark.parametrize(("m", "method"), [(50, "pivoting"), (150, "multigrid")])
def test_sparse_beyond_sweeps(rng, m, method):
    A, q = problems.laplacian(m), rng.standard_normal(m * m)
    result = solve_lcp(A, q)
    assert result.method == method
    assert_solves_lcp(result, A, q)


# ---- warm start, limits, edges


def test_restart_at_the_answer(rng):
    A, q = problems.spd(rng, 80, 1e4), rng.standard_normal(80)
    first = solve_lcp(A, q)
    assert solve_lcp(A, q, z0=first.z).iterations == 0
    assert solve_lcp(A, q + 1e-6, z0=first.z).iterations <= 2


def test_a_start_is_returned_only_if_it_is_far_better_than_asked_for():
    # Otherwise errors would add up from one problem of a sequence to the next.
    A, z = np.ones((3, 3)) + 3.0 * np.eye(3), np.array([1.0, 2.0, 3.0])
    near, nearer = z + 1e-8, z + 1e-10
    assert solve_lcp(A, -A @ z, z0=near, eps_abs=1e-6).residual < 1e-14
    np.testing.assert_array_equal(
        solve_lcp(A, -A @ z, z0=nearer, eps_abs=1e-6).z, nearer
    )


def test_nothing_to_do():
    result = solve_lcp(np.eye(3), np.array([0.0, 1.0, 2.0]))
    assert result.status is Status.SOLVED
    assert result.iterations == 0
    np.testing.assert_array_equal(result.z, np.zeros(3))


@pytest.mark.parametrize("method", ["auto", "multigrid"])
def test_empty(method):
    result = solve_lcp(np.zeros((0, 0)), np.zeros(0), method=method)
    assert result.status is Status.SOLVED
    assert result.z.shape == (0,)


@pytest.mark.parametrize("a", [1e-12, 1.0, 1e12])
def test_one_unknown(a):
    result = solve_lcp(np.array([[a]]), np.array([-3.0]))
    np.testing.assert_allclose(result.z, 3.0 / a, rtol=1e-14)


def test_modulus_variable(rng):
    A, q = problems.spd(rng, 10, 10), rng.standard_normal(10)
    result = solve_lcp(A, q)
    np.testing.assert_allclose(np.maximum(result.s, 0), result.z, atol=1e-12)
    np.testing.assert_allclose(
        A.diagonal() * (result.z - result.s), result.w, atol=1e-12
    )


def test_layouts_agree_and_inputs_stay(rng):
    A, q = problems.disc_pile(rng, 4)
    copies = A.copy(), q.copy()
    z = solve_lcp(A, q).z
    for other in (A.toarray(), A.tocsc(), A.tocoo(), np.asfortranarray(A.toarray())):
        result = solve_lcp(other, q)
        np.testing.assert_allclose(A @ result.z, A @ z, atol=1e-9)
    assert (copies[0] != A).nnz == 0
    np.testing.assert_array_equal(copies[1], q)


def test_deterministic(rng):
    A, q = problems.disc_pile(rng, 6)
    np.testing.assert_array_equal(solve_lcp(A, q).z, solve_lcp(A, q).z)


def test_limits(rng):
    A, q = problems.skew(rng, 100, 1e-4), rng.standard_normal(100)
    result = solve_lcp(A, q, max_iter=1)
    assert result.status is Status.MAX_ITER
    assert result.iterations == 1
    A, q = problems.laplacian(150), rng.standard_normal(150**2)
    start = time.perf_counter()
    result = solve_lcp(A, q, time_limit=1e-3)
    assert result.status is Status.TIME_LIMIT
    assert time.perf_counter() - start < 5


def test_history(rng, capsys):
    A, q = problems.spd(rng, 40, 1e6), rng.standard_normal(40)
    result = solve_lcp(A, q, history=True, verbose=True)
    assert result.history["iter"][-1] == result.iterations
    assert result.history["residual"][-1] <= RELATIVE * np.linalg.norm(q)
    assert "solved: " in capsys.readouterr().out


# ---- pieces against formulas


@njit
def free_solution(address, state, shift, b, x):
    m = state_at(address)
    factor = analyse(m, free_order(m, state))
    quality = refactor(m, shift, factor)
    solve_free(m.symmetric, factor, b, x)
    return quality, factor.dense.shape[0]


@pytest.mark.parametrize("kind", ["dense", "sparse", "nonsymmetric"])
def test_free_systems(rng, kind):
    A = problems.laplacian(12, 0.5)
    n = A.shape[0]
    if kind == "nonsymmetric":
        A = sparse.csr_array(A + sparse.triu(A, 1))
    if kind == "dense":
        A = A.toarray() + 0.01
    symmetric = kind != "nonsymmetric"
    shift, b = rng.random(n), rng.standard_normal(n)
    columns = columns_of(A, symmetric)
    memory = PivotMemory(columns, *np.zeros((4, n)))
    memory.now.symmetric = symmetric
    memory.now.scaled = memory.now.values  # which need no scaling here
    dense = A if kind == "dense" else A.toarray()
    for share in (0.5, 0.9, 1.0):
        state = np.where(rng.random(n) < share, 0, 1).astype(np.int32)
        F = np.flatnonzero(state == 0)
        x = np.zeros(n)
        _, size = free_solution(memory.address, state, shift, b, x)
        assert (size == 0) == (kind == "sparse")
        expected = np.linalg.solve(dense[np.ix_(F, F)] + np.diag(shift[F]), b[F])
        np.testing.assert_allclose(x[F], expected, atol=1e-12)
        assert not x[state == 1].any()


@pytest.mark.parametrize("kind", ["dense", "sparse"])
def test_vectors_of_the_record(rng, kind):
    A = problems.laplacian(6, 0.5) * 4.0
    n = A.shape[0]
    columns = columns_of(A.toarray() if kind == "dense" else A, True)
    q, start = rng.standard_normal((2, n))
    lower, upper = np.zeros(n), np.full(n, 0.05)
    memory = PivotMemory(columns, q, lower, upper, start)
    for name, given in zip(("q", "upper", "z"), (q, upper, start), strict=True):
        np.testing.assert_array_equal(getattr(memory, name), given)
    assert (memory.rank == -1).all()
    memory.now.symmetric, memory.now.eps_rel = True, 1e-9
    assert pivot(memory.address, 20) == DONE
    d = 1.0 / np.sqrt(A.diagonal())
    np.testing.assert_allclose(memory.d, d, rtol=1e-15)
    scaled = memory.scaled
    found = scaled.dense if kind == "dense" else scaled.data
    wanted = d[:, None] * A.toarray() * d
    wanted = wanted if kind == "dense" else wanted[A.nonzero()]
    np.testing.assert_allclose(found, wanted, rtol=1e-15)
    z = best_point(memory.address, lower, upper)
    np.testing.assert_array_equal(z, np.clip(memory.best * memory.d, lower, upper))
    w = A @ z + q
    np.testing.assert_allclose(np.clip(z - w, lower, upper), z, atol=1e-12)
    with pytest.raises(AttributeError, match="no vector 'price'"):
        memory.price  # noqa: B018


def test_solve_box_takes_csc(rng):
    A, q = problems.disc_pile(rng, 3)
    lower, upper = np.zeros(q.size), np.full(q.size, np.inf)
    lcp = problems.box_lcp(A.tocsc(), q, lower, upper)
    found = solve_box(lcp, None, Limits(eps_rel=1e-9), ask_convex=True)
    assert found.status is Status.SOLVED
    assert found.ray is None
    assert found.convex
    np.testing.assert_allclose(found.w, A @ found.z + q)


@pytest.mark.parametrize("n", [3, 40])
def test_convexity_is_told_on_demand(rng, n):
    """A - 2 lambda_min I has a solution of its LCP, but is not convex."""
    A = problems.spd(rng, n, 10.0)
    d = np.sqrt(A.diagonal())
    A /= np.outer(d, d)
    low = np.linalg.eigvalsh(A)[0]
    lower, upper = np.zeros(n), np.full(n, 1.0)
    for shift, convex in ((0.0, True), (0.9 * low, True), (1.2 * low, False)):
        B = A - shift * np.eye(n)
        for matrix in (B, sparse.csr_array(B)):
            lcp = problems.box_lcp(matrix, -np.ones(n), lower, upper)
            found = solve_box(lcp, None, Limits(eps_rel=1e-9), ask_convex=True)
            assert found.convex is convex


@pytest.mark.parametrize("kind", [np.asarray, sparse.csr_array, sparse.coo_matrix])
def test_a_prepared_matrix_serves_many_problems(kind, monkeypatch):
    """The same answers, of the first problem in every bit; A is looked at once."""
    rng = np.random.default_rng(5)
    A = problems.spd(rng, 30, 1e3)
    plain = [rng.standard_normal(30) for _ in range(3)]
    expected = [solve_lcp(kind(A), q) for q in plain]
    prepared = Prepared(kind(A))
    assert prepared.symmetric
    monkeypatch.setattr("namlcp.lcp.prepared.lcp_matrix", None)
    monkeypatch.setattr("namlcp.lcp.prepared.is_symmetric", None)
    for k, (q, before) in enumerate(zip(plain, expected, strict=True)):
        result = solve_lcp(prepared, q)
        assert_solves_lcp(result, prepared.A, q)
        close = 1e-13 * 1e3 * np.abs(before.z).max() if k > 0 else 0.0
        np.testing.assert_allclose(result.z, before.z, rtol=0.0, atol=close)
    assert solve_lcp(prepared, plain[0], method="namgs").method == "namgs"


def test_a_prepared_matrix_is_checked_at_once():
    with pytest.raises(ValueError, match=r"A must be square, got shape \(2, 3\)"):
        Prepared(np.ones((2, 3)))


@pytest.mark.parametrize("seed", range(5))
def test_entries_of_which_one_side_is_stored(seed):
    """Symmetric up to rounding, but not in its pattern: the order must not mind."""
    rng = np.random.default_rng(seed)
    n = 70
    B = np.where(rng.random((n, n)) < 0.06, rng.standard_normal((n, n)), 0.0)
    A = B @ B.T + 0.1 * np.eye(n)
    A[(A == 0.0) & (rng.random((n, n)) < 0.1)] = 1e-18
    q = rng.standard_normal(n)
    result = solve_lcp(sparse.csr_array(A), q)
    assert result.status is Status.SOLVED
    assert np.abs(np.minimum(result.z, A @ result.z + q)).max() <= 1e-9
