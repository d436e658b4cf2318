"""LinearOperators: MPRGP against pivoting, certificates, errors."""

from types import SimpleNamespace

import numpy as np
import problems_lcp as problems
import pytest
from scipy import sparse
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from namlcp import Prepared, solve_lcp
from namlcp.lcp.data import LCP
from namlcp.lcp.mprgp import solve_by_products
from namlcp.limits import Limits
from namlcp.residuals import natural_residual
from namlcp.status import Status

INF = np.inf


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def box_problem(rng, n):
    """SPD A of condition 100 and every kind of bounds."""
    A = problems.spd(rng, n, 100.0)
    lower = np.where(rng.random(n) < 0.3, -INF, -rng.random(n))
    upper = np.where(rng.random(n) < 0.3, INF, rng.random(n))
    lower[:2] = upper[:2] = 0.3
    return A, rng.standard_normal(n), lower, upper


def test_box_against_pivoting(rng):
    for n in (5, 40, 100):
        A, q, lower, upper = box_problem(rng, n)
        exact = solve_lcp(A, q, lower, upper)
        found = solve_lcp(
            aslinearoperator(A), q, lower, upper, diagonal=A.diagonal(), eps_rel=1e-12
        )
        assert (found.status, found.method) == (Status.SOLVED, "mprgp")
        np.testing.assert_allclose(found.z, exact.z, atol=1e-9)
        for bound in (lower, upper):
            at_bound = np.abs(exact.z - bound) <= 1e-15
            np.testing.assert_array_equal(found.z == bound, at_bound)
        np.testing.assert_allclose(found.w, A @ found.z + q, atol=1e-14)


def test_equations_alone_are_conjugate_gradients(rng):
    """Without bounds: n steps at most, and one for every refreshed gradient."""
    A = problems.spd(rng, 20, 10.0)
    q = rng.standard_normal(20)
    found = solve_lcp(aslinearoperator(A), q, -INF, INF, eps_rel=1e-11)
    assert found.status is Status.SOLVED
    assert found.iterations <= 25
    np.testing.assert_allclose(found.z, np.linalg.solve(A, -q), atol=1e-9)


def test_singular_contact_scene(rng):
    A, q = problems.disc_pile(rng, 5)
    found = solve_lcp(aslinearoperator(A), q, diagonal=A.diagonal())
    assert found.status is Status.SOLVED
    z, w = found.z, A @ found.z + q
    assert natural_residual(z, w, 0.0 * z, z + INF) <= 1e-6
    np.testing.assert_allclose(A @ z, A @ solve_lcp(A, q).z, atol=1e-6)


def test_f_never_rises(rng):
    A, q, lower, upper = box_problem(rng, 60)
    values = []

    def accept(z, w):
        values.append(0.5 * z @ (w + q))
        return natural_residual(z, w, lower, upper) < 1e-10

    matrix = Prepared(aslinearoperator(A), A.diagonal())
    found = solve_by_products(
        LCP(matrix, q, lower, upper), None, Limits(), SimpleNamespace(accepts=accept)
    )
    assert found.status is Status.SOLVED
    assert np.all(np.diff(values) <= 1e-12)


def test_units_do_not_matter_with_the_diagonal(rng):
    A, q, lower, upper = box_problem(rng, 40)
    d = 10.0 ** rng.uniform(-3, 3, 40)
    counts = []
    for scale in (np.ones(40), d):
        B = scale[:, None] * A * scale
        found = solve_lcp(
            aslinearoperator(B), scale * q, lower / scale, upper / scale,
            diagonal=B.diagonal(),
        )  # fmt: skip
        assert found.status is Status.SOLVED
        counts.append(found.iterations)
    assert abs(counts[0] - counts[1]) <= 2


def test_start_at_the_solution(rng):
    A, q, lower, upper = box_problem(rng, 30)
    z = solve_lcp(A, q, lower, upper).z
    found = solve_lcp(aslinearoperator(A), q, lower, upper, z0=z)
    assert (found.status, found.iterations) == (Status.SOLVED, 0)


@pytest.mark.parametrize("n", [1, 5, 30])
def test_unsolvable_with_a_proof(n, rng):
    A, q = problems.unsolvable(rng, n) if n > 1 else (np.zeros((1, 1)), -np.ones(1))
    found = solve_lcp(aslinearoperator(A), q, diagonal=A.diagonal())
    assert found.status is Status.UNSOLVABLE
    assert np.all(found.ray >= 0.0)
    assert found.ray @ q == pytest.approx(-1.0)
    size = np.abs(A).max() * found.ray.max()
    np.testing.assert_allclose(A @ found.ray, 0.0, atol=1e-10 * size)


def test_negative_curvature_is_told(rng):
    A = problems.spd(rng, 30, 10.0) - 0.5 * np.eye(30)
    assert np.linalg.eigvalsh(A)[0] < 0.0
    found = solve_lcp(aslinearoperator(A), rng.standard_normal(30), -INF, INF)
    assert found.status is Status.STALLED
    assert found.message == "A is not positive semidefinite"


def test_impossible_accuracy_stalls():
    A = problems.laplacian(20)
    q = -np.ones(A.shape[0])
    found = solve_lcp(aslinearoperator(A), q, eps_abs=1e-30)
    assert found.status is Status.STALLED
    assert found.residual < 1e-12


def test_products_that_are_not_finite():
    calls = []

    def product(x):
        calls.append(0)
        return x * (np.nan if len(calls) > 4 else 1.0)

    A = LinearOperator((3, 3), matvec=product, dtype=float)
    found = solve_lcp(A, np.array([-1.0, 2.0, -3.0]))
    assert found.status is Status.NUMERICAL_ERROR
    assert np.isnan(found.z).all()


def test_limits_and_history():
    A = aslinearoperator(problems.laplacian(30))
    q = -np.ones(900)
    found = solve_lcp(A, q, max_iter=5, history=True)
    assert (found.status, found.iterations) == (Status.MAX_ITER, 5)
    np.testing.assert_array_equal(found.history["iter"], np.arange(6))
    assert solve_lcp(A, q, time_limit=1e-9).status is Status.TIME_LIMIT


def test_prepared_operator(rng):
    A, q, lower, upper = box_problem(rng, 20)
    matrix = Prepared(aslinearoperator(A), A.diagonal())
    one = solve_lcp(matrix, q, lower, upper)
    other = solve_lcp(aslinearoperator(A), q, lower, upper, diagonal=A.diagonal())
    np.testing.assert_array_equal(one.z, other.z)


def operator(A, dtype=None):
    return LinearOperator(A.shape, matvec=lambda x: A @ x, dtype=dtype or A.dtype)


SKEW = np.array([[1.0, 1.0], [-1.0, 1.0]])


@pytest.mark.parametrize(
    ("A", "options", "error", "text"),
    [
        (np.eye(2), {"diagonal": np.ones(2)}, ValueError, "diagonal is for a Linear"),
        (operator(np.ones((2, 3))), {}, ValueError, "A must be square"),
        (operator(np.eye(2), complex), {}, TypeError, "A must be real"),
        (operator(SKEW), {}, ValueError, "A must be symmetric as a LinearOperator"),
        (operator(np.eye(2)), {"diagonal": [1.0]}, ValueError, "diagonal must hav"),
        (operator(np.eye(2)), {"diagonal": [1, np.nan]}, ValueError, "diagonal must b"),
        (operator(np.eye(2)), {"diagonal": [1, -1]}, ValueError, "diagonal must not b"),
        (operator(np.eye(2)), {"method": "psor"}, ValueError, "method 'psor' needs th"),
        (
            operator(np.eye(2)), {"method": "multigrid"}, ValueError,
            "method 'multigrid' needs the entries of A",
        ),
        (
            Prepared(operator(np.eye(2))), {"diagonal": [1, 1]}, ValueError,
            "diagonal must be given to Prepared",
        ),
    ],
)  # fmt: skip
def test_bad_operators_are_named(A, options, error, text):
    with pytest.raises(error, match=text):
        solve_lcp(A, np.ones(2), **options)


def test_sparse_format_is_not_needed(rng):
    """A sum of a sparse matrix and a low-rank one, never formed."""
    L, V = problems.laplacian(10), rng.standard_normal((100, 3))
    A = LinearOperator((100, 100), matvec=lambda x: L @ x + V @ (V.T @ x), dtype=float)
    q = rng.standard_normal(100)
    diagonal = L.diagonal() + np.sum(V * V, axis=1)
    found = solve_lcp(A, q, diagonal=diagonal, eps_rel=1e-11)
    exact = solve_lcp(sparse.csr_array(L).toarray() + V @ V.T, q)
    np.testing.assert_allclose(found.z, exact.z, atol=1e-8)


def test_complex_products_are_refused():
    A = LinearOperator((2, 2), matvec=lambda x: x * (1 + 1j), dtype=float)
    with pytest.raises(TypeError, match="A must be real, got a product of dtype"):
        solve_lcp(A, -np.ones(2))


def test_a_start_far_away_does_no_harm():
    A = aslinearoperator(sparse.csr_array(problems.laplacian(4)))
    for far in (1e17, 1e200):
        result = solve_lcp(A, -np.ones(16), z0=np.full(16, far))
        assert result.status is Status.SOLVED
        assert result.residual < 1e-8


def test_a_tiny_curvature_is_no_ray():
    """A minimum at 1e13 is one."""
    result = solve_lcp(aslinearoperator(np.diag([1.0, 1e-13])), -np.ones(2))
    assert result.status is not Status.UNSOLVABLE
