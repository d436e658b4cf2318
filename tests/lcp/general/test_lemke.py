"""Lemke's method, by the definition and beside a transcription in rational numbers."""

from fractions import Fraction

import numpy as np
import problems_lcp as problems
import pytest
from scipy import sparse

from namlcp import Prepared, Status, natural_residual, solve_lcp
from namlcp.lcp.data import lcp_data
from namlcp.lcp.general import lemke
from namlcp.lcp.general.lemke import covering_vectors, solve_by_lemke
from namlcp.lcp.general.plain import Plain
from namlcp.lcp.general.tableau import RAY, Tableau, exchange, pivot_until
from namlcp.limits import Limits

LIMITS = Limits(0.0, 1e-9)


def by_name(A, q, **options):
    return solve_lcp(np.array(A, dtype=float), q, method="lemke", **options)


def rational_lemke(A, q, d):
    """Lemke's lexicographic method in rational numbers: z, or None for a ray."""
    n = len(q)
    rows = []  # of [b, B^-1, columns of z, column of z_0] in w - A z - z_0 d = q
    for i in range(n):
        unit = [Fraction(int(i == j)) for j in range(n)]
        column = [Fraction(-int(A[i][j])) for j in range(n)]
        rows.append([Fraction(int(q[i])), *unit, *column, Fraction(-int(d[i]))])
    if min(q) >= 0:
        return [0] * n
    basic = list(range(n))

    def pivot(row, name):
        rows[row] = [x / rows[row][1 + name] for x in rows[row]]
        for i in range(n):
            if i != row:
                factor = rows[i][1 + name]
                rows[i] = [
                    x - factor * y for x, y in zip(rows[i], rows[row], strict=True)
                ]
        left, basic[row] = basic[row], name
        return left

    first = min(range(n), key=lambda i: [x / int(d[i]) for x in rows[i][: 1 + n]])
    left = pivot(first, 2 * n)
    while left != 2 * n:
        enters = left + n if left < n else left - n
        limiting = [i for i in range(n) if rows[i][1 + enters] > 0]
        if not limiting:
            return None

        def order(i, enters=enters):
            part = [x / rows[i][1 + enters] for x in rows[i][: 1 + n]]
            return part[0], basic[i] != 2 * n, part

        left = pivot(min(limiting, key=order), enters)
    z = [Fraction(0)] * 2 * n
    for i, name in enumerate(basic):
        if name < 2 * n:
            z[name] = rows[i][0]
    return z[n:]


@pytest.mark.parametrize("seed", range(60))
def test_the_path_is_that_of_rational_numbers(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 8))
    A, q = rng.integers(-2, 4, (n, n)), rng.integers(-3, 3, n)
    np.fill_diagonal(A, 1)  # so that nothing is scaled
    d = rng.integers(1, 3, n)
    expected = rational_lemke(A, q, d)
    result = by_name(A, q.astype(float), cover=d)
    if expected is None:
        assert result.status in (Status.STALLED, Status.UNSOLVABLE)
    else:
        assert result.status is Status.SOLVED
        np.testing.assert_allclose(
            result.z, np.array(expected, dtype=float), atol=1e-11
        )


def test_exchange_swaps_two_variables():
    rng = np.random.default_rng(0)
    A, q, d = rng.standard_normal((4, 4)), rng.standard_normal(4), np.ones(4)
    tableau = Tableau.of(A, q, d)
    exchange(tableau, 1, 3)  # w_1 leaves, z_2 enters
    x = rng.standard_normal(5)  # z_0, z_1, w_1, z_3 and Lemke's z_0
    basic = tableau.rows[:, 0] + tableau.rows[:, 1:] @ x
    z = np.array([x[0], x[1], basic[1], x[3]])
    w = A @ z + q + x[4] * d
    np.testing.assert_allclose([w[0], w[2], w[3]], basic[[0, 2, 3]])
    assert w[1] == pytest.approx(x[2])
    assert tableau.basic.tolist() == [0, 6, 2, 3]
    assert tableau.nonbasic[1:].tolist() == [4, 5, 1, 7, 8]
    for name, place in enumerate(tableau.place):
        found = tableau.nonbasic[-1 - place] if place < 0 else tableau.basic[place]
        assert found == name


def test_a_ray_and_its_direction():
    tableau = Tableau.of(-np.eye(1), np.array([-1.0]), np.ones(1))
    exchange(tableau, 0, 2)
    end, entering, pivots = pivot_until(tableau, 1, (2, 2), 10)
    assert (end, entering, pivots) == (RAY, 1, 0)
    np.testing.assert_array_equal(tableau.direction(1), [0.0, 1.0, 1.0])


@pytest.mark.parametrize("name", problems.TEXTBOOK)
def test_textbook(name):
    A, q, _ = problems.textbook(name)
    result = by_name(A, q)
    assert result.status is Status.SOLVED
    assert result.method == "lemke"
    assert natural_residual(result.z, A @ result.z + q, 0 * q, q + np.inf) < 1e-9


@pytest.mark.parametrize("n", [4, 8])
def test_murty_takes_all_bases(n):
    """Murty (1978): with d = 1 the path visits 2^n bases."""
    A, q, _ = problems.murty(n)
    result = by_name(A, q)
    assert result.status is Status.SOLVED
    assert result.iterations == 2**n
    short = by_name(A, q, max_iter=2 ** (n - 1))
    assert short.status is Status.MAX_ITER
    assert short.iterations == 2 ** (n - 1)


@pytest.mark.parametrize("sparsely", [False, True])
@pytest.mark.parametrize("seed", range(10))
def test_bounds_and_free_unknowns(seed, sparsely):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 30))
    F, K = rng.standard_normal((2, n, n))
    A = F @ F.T + 0.1 * np.eye(n) + K - K.T
    q = 5.0 * rng.standard_normal(n)
    lower = np.where(rng.random(n) < 0.4, -np.inf, rng.standard_normal(n))
    room = rng.exponential(size=n) * (rng.random(n) < 0.9)
    upper = np.where(rng.random(n) < 0.4, np.inf, np.maximum(lower, -2.0) + room)
    given = sparse.csr_array(A) if sparsely else A
    result = solve_lcp(given, q, lower, upper, method="lemke")
    assert result.status is Status.SOLVED
    assert natural_residual(result.z, A @ result.z + q, lower, upper) < 1e-9
    assert ((lower <= result.z) & (result.z <= upper)).all()


@pytest.mark.parametrize("n", [5, 40, 120])
def test_copositive(n):
    """Nonnegative off the diagonal: strictly copositive, so that no ray exists."""
    rng = np.random.default_rng(n)
    A = np.abs(rng.standard_normal((n, n))) * (rng.random((n, n)) < 0.3)
    A -= np.diag(A.diagonal() - 1.0)
    q = rng.standard_normal(n)
    result = by_name(A, q)
    assert result.status is Status.SOLVED


def test_a_ray_is_a_proof_only_if_it_is_one():
    """Semidefinite: a proof. diag(-1): it is a ray, and z = 1 would be a solution."""
    result = by_name([[1, -1], [-1, 1]], [-1.0, -1.0])
    assert result.status is Status.UNSOLVABLE
    np.testing.assert_allclose(result.ray, [0.5, 0.5])
    result = by_name([[-1, 0], [2, 1]], [1.0, -3.0], cover=[1.0, 4.0])
    assert result.status in (Status.SOLVED, Status.STALLED)
    assert result.ray is None


def test_nothing_to_do():
    result = by_name(np.eye(3), np.zeros(3))
    assert (result.status, result.iterations) == (Status.SOLVED, 0)
    assert by_name(np.zeros((0, 0)), np.zeros(0)).status is Status.SOLVED
    fixed = solve_lcp(np.eye(2), [1.0, -1.0], 2.0, 2.0, method="lemke")
    np.testing.assert_array_equal(fixed.z, [2.0, 2.0])


def test_history_and_time():
    A, q, _ = problems.murty(6)
    result = by_name(A, q, history=True)
    assert len(result.history) == result.iterations - 1
    assert by_name(A, q, time_limit=1e-9).status is Status.TIME_LIMIT


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"cover": [1.0, 0.0]}, r"cover must be positive, got 0 at \(1\)"),
        ({"cover": np.ones(3)}, r"cover must have shape \(2,\)"),
        ({"z0": np.ones(2)}, "z0 is not for method 'lemke'"),
        ({"alpha": 1.0}, "alpha is not a parameter of method 'lemke'"),
        ({"method": "auto", "cover": 1.0}, "cover is not a parameter of method 'auto'"),
    ],
)
def test_refusals(options, text):
    with pytest.raises(ValueError, match=text):
        solve_lcp(np.eye(2), np.ones(2), **{"method": "lemke", **options})


def test_what_is_too_large_or_singular_is_refused(monkeypatch):
    A = sparse.csr_array([[0.0, 1.0], [-1.0, 1.0]])
    with pytest.raises(ValueError, match="regular in the rows and columns"):
        solve_lcp(A, np.ones(2), [-np.inf, 0.0], np.inf, method="lemke")
    monkeypatch.setattr(lemke, "LARGEST_TABLEAU", 1)
    with pytest.raises(ValueError, match=r"order of at most 1 .* got 2"):
        solve_lcp(A, np.ones(2), method="lemke")


def test_three_covering_vectors_share_the_limit():
    A = np.array([[0.0, 2.0], [2.0, 0.0]])  # a game: every path ends on a ray
    lcp = lcp_data(Prepared(A), -np.ones(2), None, None)
    assert solve_by_lemke(lcp, None, LIMITS) is None
    outcome = solve_by_lemke(lcp, None, LIMITS._replace(max_iter=2))
    assert outcome.iterations == 2
    assert all((d > 0.0).all() for d in covering_vectors(np.zeros((3, 3))))


def test_plain_form_of_a_free_unknown():
    """w_1 = z_0 + 2 z_1 - 3 = 0 leaves z_1 = (3 - z_0) / 2."""
    A = np.array([[4.0, 1.0], [1.0, 2.0]])
    lcp = lcp_data(Prepared(A), np.array([1.0, -3.0]), [0.0, -np.inf], np.inf)
    plain = Plain(lcp)
    assert plain.M[0, 0] * plain.root[0] ** 2 == pytest.approx(3.5)
    assert plain.r[0] * plain.root[0] * plain.unit == pytest.approx(2.5)
    np.testing.assert_allclose(plain.point(np.zeros(1)), [0.0, 1.5])
