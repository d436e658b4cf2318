"""LinearOperators: MPRGP against pivoting, certificates, errors."""

import numpy as np
import problems_lcp as problems
import pytest
from lcp_cases import all_cases
from lcp_definition import assert_proves_unsolvable
from scipy.sparse.linalg import LinearOperator, aslinearoperator

from namlcp import Prepared, Status, solve_lcp
from validation.problems.draw import definite as spd

INF = np.inf


@pytest.fixture
def rng():
    return np.random.default_rng(7)


def box_problem(rng, n):
    """SPD A of condition 100 and every kind of bounds."""
    A = spd(rng, n, 100.0)
    lower = np.where(rng.random(n) < 0.3, -INF, -rng.random(n))
    upper = np.where(rng.random(n) < 0.3, INF, rng.random(n))
    lower[:2] = upper[:2] = 0.3
    return A, rng.standard_normal(n), lower, upper


def by_products(A, *vectors, **options):
    return solve_lcp(aslinearoperator(A), *vectors, diagonal=A.diagonal(), **options)


def test_box_against_pivoting(rng):
    for n in (5, 40, 100):
        A, q, lower, upper = box_problem(rng, n)
        exact = solve_lcp(A, q, lower, upper)
        found = by_products(A, q, lower, upper, eps_rel=1e-12)
        assert (found.status, found.method) == (Status.SOLVED, "mprgp")
        np.testing.assert_allclose(found.z, exact.z, atol=1e-9)
        for bound in (lower, upper):
            at_bound = np.abs(exact.z - bound) <= 1e-15
            np.testing.assert_array_equal(found.z == bound, at_bound)
        np.testing.assert_allclose(found.w, A @ found.z + q, atol=1e-14)
        start = by_products(A, q, lower, upper, z0=exact.z)
        assert (start.status, start.iterations) == (Status.SOLVED, 0)
        matrix = Prepared(aslinearoperator(A), A.diagonal())
        prepared = solve_lcp(matrix, q, lower, upper, eps_rel=1e-12)
        np.testing.assert_allclose(prepared.z, found.z, atol=1e-10)
        assert solve_lcp(matrix, q, lower, upper).found


def test_equations_alone_are_conjugate_gradients(rng):
    """Without bounds: n steps at most, and one for every refreshed gradient."""
    A = spd(rng, 20, 10.0)
    q = rng.standard_normal(20)
    found = solve_lcp(aslinearoperator(A), q, -INF, INF, eps_rel=1e-11)
    assert found.status is Status.SOLVED
    assert found.iterations <= 25
    np.testing.assert_allclose(found.z, np.linalg.solve(A, -q), atol=1e-9)


def test_singular_contact_scene():
    A, q, *_ = all_cases()["pile of discs 5"].data
    found = by_products(A, q)
    assert found.status is Status.SOLVED
    assert found.residual <= 1e-6
    np.testing.assert_allclose(A @ found.z, A @ solve_lcp(A, q).z, atol=1e-6)


def test_the_objective_never_rises(rng):
    """z'A z / 2 + q'z of the points that ever longer runs return."""
    A, q, lower, upper = box_problem(rng, 60)
    values = []
    for most in range(1, 80):
        found = by_products(A, q, lower, upper, max_iter=most)
        values.append(0.5 * found.z @ (found.w + q))
        if found.status is Status.SOLVED:
            break
    assert found.status is Status.SOLVED
    assert np.all(np.diff(values) <= 1e-12)
    assert values[0] - values[-1] > 0.1


def test_units_do_not_matter_with_the_diagonal(rng):
    A, q, lower, upper = box_problem(rng, 40)
    counts = []
    for scale in (np.ones(40), 10.0 ** rng.uniform(-3, 3, 40)):
        B = scale[:, None] * A * scale
        found = by_products(B, scale * q, lower / scale, upper / scale)
        assert found.status is Status.SOLVED
        counts.append(found.iterations)
    assert abs(counts[0] - counts[1]) <= 2


@pytest.mark.parametrize("n", [1, 5, 30])
def test_unsolvable_with_a_proof(n, rng):
    A, q = problems.unsolvable(rng, n) if n > 1 else (np.zeros((1, 1)), -np.ones(1))
    found = by_products(A, q)
    assert found.status is Status.UNSOLVABLE
    assert_proves_unsolvable(found.ray, A, q, cancels=1e-10)


def test_negative_curvature_is_told(rng):
    A = spd(rng, 30, 10.0) - 0.5 * np.eye(30)
    assert np.linalg.eigvalsh(A)[0] < 0.0
    found = solve_lcp(aslinearoperator(A), rng.standard_normal(30), -INF, INF)
    assert found.status is Status.STALLED
    assert found.message == "A is not positive semidefinite"


def test_a_tiny_curvature_is_no_ray():
    """A minimum at 1e13 is one."""
    result = solve_lcp(aslinearoperator(np.diag([1.0, 1e-13])), -np.ones(2))
    assert result.status is not Status.UNSOLVABLE


def test_products_that_are_not_finite():
    calls = []

    def product(x):
        calls.append(0)
        return x * (np.nan if len(calls) > 4 else 1.0)

    A = LinearOperator((3, 3), matvec=product, dtype=float)
    found = solve_lcp(A, np.array([-1.0, 2.0, -3.0]))
    assert found.status is Status.NUMERICAL_ERROR
    assert np.isnan(found.z).all()


@pytest.mark.parametrize("unit", [1e-290, 1e-200, 1e-170, 1e170, 1e290])
def test_squares_of_products_may_leave_the_range(unit):
    """As of small ones, which would be no size for a lack of symmetry."""
    A = aslinearoperator(unit * np.diag([1.0, 2.0]))
    for q in (-np.ones(2), -unit * np.ones(2)):
        result = solve_lcp(A, q)
        assert result.status is Status.SOLVED
        np.testing.assert_allclose(result.z, -q / unit / [1.0, 2.0])


def test_a_matrix_that_is_never_formed(rng):
    """A sum of a sparse matrix and a low-rank one."""
    L, V = problems.laplacian(10), rng.standard_normal((100, 3))
    A = LinearOperator((100, 100), matvec=lambda x: L @ x + V @ (V.T @ x), dtype=float)
    q = rng.standard_normal(100)
    diagonal = L.diagonal() + np.sum(V * V, axis=1)
    found = solve_lcp(A, q, diagonal=diagonal, eps_rel=1e-11)
    exact = solve_lcp(L.toarray() + V @ V.T, q)
    np.testing.assert_allclose(found.z, exact.z, atol=1e-8)


def test_a_start_far_away_does_no_harm():
    A = aslinearoperator(problems.laplacian(4))
    for far in (1e17, 1e200):
        result = solve_lcp(A, -np.ones(16), z0=np.full(16, far))
        assert result.status is Status.SOLVED
        assert result.residual < 1e-8


def operator(A, dtype=None):
    return LinearOperator(A.shape, matvec=lambda x: A @ x, dtype=dtype or A.dtype)


EYE, SKEW = np.eye(2), np.array([[1.0, 1.0], [-1.0, 1.0]])


@pytest.mark.parametrize(
    ("A", "options", "error", "text"),
    [
        (EYE, {"diagonal": np.ones(2)}, ValueError, "diagonal is for a Linear"),
        (operator(np.ones((2, 3))), {}, ValueError, "A must be square"),
        (operator(EYE, complex), {}, TypeError, "A must be real"),
        (operator(1j * EYE, float), {}, TypeError, "A must be real, got a product of"),
        (operator(SKEW), {}, ValueError, "A must be symmetric as a LinearOperator"),
        (operator(EYE), {"diagonal": [1.0]}, ValueError, "diagonal must hav"),
        (operator(EYE), {"diagonal": [1, np.nan]}, ValueError, "diagonal must b"),
        (operator(EYE), {"diagonal": [1, -1]}, ValueError, "diagonal must not b"),
        (operator(EYE), {"method": "psor"}, ValueError, "method 'psor' needs th"),
        (operator(EYE), {"method": "multigrid"}, ValueError, "'multigrid' needs the e"),
        (Prepared(operator(EYE)), {"diagonal": [1, 1]}, ValueError, "given to Prepar"),
    ],
)
def test_bad_operators_are_named(A, options, error, text):
    with pytest.raises(error, match=text):
        solve_lcp(A, -np.ones(2), **options)
