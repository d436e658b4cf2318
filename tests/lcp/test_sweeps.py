"""The sweep methods: the paper's tables, the papers' formulas, parameters, ends."""

import math

import numpy as np
import plain_sweeps
import problems_lcp as problems
import pytest
from lcp_definition import assert_solves_lcp
from plain_sweeps import TAKES, TRIANGULAR, auto
from scipy import sparse

from namlcp import Status, natural_residual, solve_lcp
from namlcp.lcp.loops import relax_coloured, two_colours

INF = np.inf
KINDS = {"dense": np.asarray, "csr": sparse.csr_array}
NEVER = 1e-300
"""An eps_abs that is not met."""


def paper_example(number, m, delta=4.0):
    return *problems.paper_example(number, m, delta), 0.0, INF


def random_problem(seed, n=13, symmetric=False, excess=0.0):
    """Return A with holes, q, every kind of bounds, and a start."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.5)
    np.fill_diagonal(A, rng.uniform(1.0, 9.0, n))
    A = A + A.T if symmetric else A
    np.fill_diagonal(A, A.diagonal() + excess * np.abs(A).sum(axis=1))
    lower, upper = problems.every_bounds(rng, n)
    return A, 3.0 * rng.normal(size=n), lower, upper, rng.normal(size=n)


# ---- the paper's tables

# n = 100 ... 10^4; iterations, printed residuals in units of 1e-7
SIZES = (10, 30, 50, 60, 80, 100)
TABLES = {
    (1, "mgs", None): ((36, 40, 41, 41, 42, 42), (97, 80, 79, 89, 74, 84)),
    (1, "namgs", None): ((16, 17, 17, 17, 18, 18), (63, 63, 85, 95, 45, 51)),
    (1, "msor", 0.85): ((15, 17, 18, 18, 18, 19), (95, 76, 53, 65, 89, 43)),
    (1, "namsor", 0.91): ((12, 12, 13, 13, 13, 13), (27, 76, 32, 37, 48, 59)),
    (2, "mgs", None): ((24, 26, 26, 26, 27, 27), (90, 65, 87, 96, 65, 73)),
    (2, "namgs", None): ((12, 12, 13, 13, 13, 13), (38, 84, 31, 35, 44, 53)),
    (2, "msor", 0.88): ((14, 14, 15, 15, 15, 15), (38, 82, 41, 46, 55, 63)),
    (2, "namsor", 0.88): ((8, 9, 9, 9, 9, 9), (22, 15, 27, 37, 46, 59)),
}
# One printed residual is off by more than one unit of its last digit: 3.38e-6 is right.
MISPRINTS = {(2, "namsor", 60): 34}


@pytest.mark.parametrize(("example", "method", "alpha"), TABLES)
def test_tables_of_the_paper(example, method, alpha):
    counts, printed = TABLES[example, method, alpha]
    for m, count, digits in zip(SIZES, counts, printed, strict=True):
        A, q, *_ = paper_example(example, m)
        result = solve_lcp(
            A, q, method=method, alpha=alpha, eps_abs=1e-5, max_iter=100,
            shift=1.0 if method.startswith("nam") else None,
            s0=np.tile([1.0, 0.0], m * m // 2),
        )  # fmt: skip
        assert result.status is Status.SOLVED
        assert result.iterations == count
        digits = MISPRINTS.get((example, method, m), digits)
        assert abs(result.residual * 1e7 - digits) <= 1.5
        np.testing.assert_allclose(result.z, np.tile([1.0, 2.0], m * m // 2), atol=1e-5)


# ---- the papers' formulas


def assert_is(rows, residuals, result, lower, upper, tolerance=1e-11):
    """History and best point are those of the iterates written out."""
    history, count = result.history, result.iterations + 1
    assert count > 2
    np.testing.assert_allclose(history["residual"], residuals[:count], rtol=1e-8)
    z = np.clip(rows, lower, upper)
    at_bound = ((z == lower) | (z == upper)).sum(axis=1)
    np.testing.assert_array_equal(history["active"], at_bound[:count])
    best = rows[np.argmin(residuals[:count])]
    size = max(1.0, np.abs(rows).max())
    np.testing.assert_allclose(result.s, best, rtol=0.0, atol=tolerance * size)
    np.testing.assert_array_equal(result.z, np.clip(result.s, lower, upper))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", TAKES)
def test_sweeps_are_the_formula(method, kind):
    """With the default parameters, and with others; from a dominant A to a wild one."""
    n, sweeps = 13, 5
    many = np.linspace(0.5, 4.0, n), np.linspace(0.0, 2.0, n)
    values = {"alpha": 1.3, "beta": 0.4, "omega": many[0], "shift": many[1]}
    others = {name: values[name] for name in TAKES[method].split()}
    if method == "modified-nam":
        del others["omega"]  # alpha or omega
    for seed, excess in enumerate((0.0, 0.5, 2.0, 0.0)):
        A, q, lower, upper, s = random_problem(seed, n, seed == 1, excess)
        for given in ({}, others):
            arguments = A, q, lower, upper, method, s, sweeps
            rows, residuals = plain_sweeps.iterates(*arguments, **given)
            result = solve_lcp(
                KINDS[kind](A), q, lower, upper, method=method, s0=s, eps_abs=NEVER,
                max_iter=sweeps, history=True, **given,
            )  # fmt: skip
            assert_is(rows, residuals, result, lower, upper)


@pytest.mark.parametrize("method", [*TRIANGULAR, "modulus"])
@pytest.mark.parametrize("scale", [1e-7, 3.0, 1e9])
def test_units_do_not_matter(method, scale):
    A, q, lower, upper, _ = random_problem(5, excess=2.0)
    for X in (A, sparse.csr_array(A)):
        one, other = (
            solve_lcp(c * X, c * q, lower, upper, method=method, eps_abs=NEVER,
                      max_iter=6)
            for c in (1.0, scale)
        )  # fmt: skip
        assert one.iterations == other.iterations
        np.testing.assert_allclose(other.z, one.z, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", TAKES)
def test_a_residual_far_smaller_than_the_unknowns_is_seen(method, kind):
    A = 1e-10 * np.array([[2.0, -1.0], [-1.0, 2.0]])
    shift = A.diagonal() if "shift" in TAKES[method] else None
    given = {"omega": A.diagonal()} if "omega" in TAKES[method] else {}
    result = solve_lcp(
        KINDS[kind](A), [-1.0, -1.1], method=method, shift=shift, **given
    )
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z, np.linalg.solve(A, [1.0, 1.1]), rtol=1e-7)


# ---- parameters that are chosen during the run

TAKERS = [name for name in TAKES if TAKES[name]]


def contact_problem(seed=0, n=40):
    """SPD A of moderate condition, about half of the bounds active."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n))
    A = B @ B.T / n + 0.3 * np.eye(n)
    q, z = problems.with_solution(rng, A)
    return A, q, z


def obstacle(m=16):
    wave = np.sin(3.0 * np.pi * np.arange(1, m + 1) / (m + 1))
    return paper_example(1, m, 0.0)[0], -np.outer(wave, wave).ravel()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", TAKERS)
def test_chosen_parameters_solve_and_repeat(method, kind):
    """At the end w = Omega (z - s), Omega = c D (c I for modified-nam)."""
    A, q, z = contact_problem()
    given = dict(method=method, eps_abs=1e-9, max_iter=5000, **auto(method))
    first, again = (solve_lcp(KINDS[kind](A), q, **given) for _ in "ab")
    assert first.status is Status.SOLVED
    np.testing.assert_allclose(first.z, z, atol=1e-7)
    assert again.iterations == first.iterations
    np.testing.assert_allclose(again.z, first.z, atol=1e-12)
    D = np.ones_like(q) if method == "modified-nam" else A.diagonal()
    held = first.w > 1e-3
    c = first.w[held] / (D[held] * (first.z - first.s)[held])
    np.testing.assert_allclose(c, c[0], rtol=1e-4)


@pytest.mark.parametrize("method", TAKERS)
def test_units_do_not_matter_to_chosen_parameters(method):
    """c A, c q; and S A S, S q with z = S^-1 z for a diagonal S > 0."""
    A, q, _ = contact_problem(1)
    given = dict(method=method, eps_abs=NEVER, **auto(method), history=True)
    S = np.exp(np.random.default_rng(2).uniform(-3.0, 3.0, q.size))
    compared = 0
    for sweeps in (3, 10, 45):
        one = solve_lcp(A, q, max_iter=sweeps, **given)
        for c in (1e-6, 3.0, 1e5):
            other = solve_lcp(c * A, c * q, max_iter=sweeps, **given)
            np.testing.assert_allclose(other.s, one.s, rtol=1e-7, atol=1e-7)
        other = solve_lcp(S[:, None] * A * S, S * q, max_iter=sweeps, **given)
        # of each run the best point comes back: they are the same if both are the last
        best = [np.argmin(run.history["residual"]) for run in (one, other)]
        if best == [sweeps, sweeps] and method != "modified-nam":  # Omega = alpha I
            np.testing.assert_allclose(S * other.s, one.s, rtol=1e-7, atol=1e-7)
            compared += 1
    assert compared or method == "modified-nam"


def test_young_s_relaxation():
    """Row sums of 1/2 decide at once: 2/(1 + sqrt(1 - mu^2))."""
    A, q, *_ = paper_example(1, 10, 4.0)
    young = 2.0 / (1.0 + math.sqrt(0.75))
    one, other = (
        solve_lcp(A, q, method="psor", alpha=alpha, eps_abs=1e-12, history=True)
        for alpha in ("auto", young)
    )
    np.testing.assert_allclose(one.history["residual"], other.history["residual"])


@pytest.mark.parametrize("omega", [0.3, "D"])
def test_one_of_the_two_may_be_given(omega):
    A, q, z = contact_problem(5)
    omega = A.diagonal() if omega == "D" else omega
    runs = [
        (method, given)
        for method in ("msor", "namsor", "amsor", "maor", "namaor")
        for given in ({"alpha": "auto", "omega": omega}, {"alpha": "auto"},
                      {"alpha": 1.2, "omega": "auto"}, {"omega": "auto"})
    ]  # fmt: skip
    for method, given in [*runs, ("modified-nam", {"omega": "auto"})]:
        given = given | {"method": method, "eps_abs": 1e-9, "max_iter": 20_000}
        result = solve_lcp(A, q, **given)
        assert result.status is Status.SOLVED, given
        np.testing.assert_allclose(result.z, z, atol=1e-6)


@pytest.mark.parametrize("method", TAKERS)
def test_solution_is_a_fixed_point_of_chosen_parameters(method):
    """Also across changes of Omega: s is written anew."""
    A, q = obstacle(8)
    z = solve_lcp(A, q, eps_abs=1e-13).z
    given = dict(method=method, z0=z, **auto(method))
    assert solve_lcp(A, q, eps_abs=1e-9, **given).iterations == 0
    result = solve_lcp(A, q, eps_abs=NEVER, max_iter=30, history=True, **given)
    assert result.history["residual"].max() < 1e-10


@pytest.mark.parametrize("method", ["msor", "namsor", "amsor"])
def test_a_wrong_estimate_is_corrected(method):
    """Signs differ across the diagonal: the estimate sees the identity."""
    A = np.eye(3) + 0.95 * (np.triu(np.ones((3, 3)), 1) - np.tril(np.ones((3, 3)), -1))
    given = {"alpha": "auto", "omega": "auto", "max_iter": 2000, "eps_abs": 1e-9}
    assert solve_lcp(A, -np.ones(3), method=method, **given).status is Status.SOLVED


# ---- ends


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("A", "lower"),
    [
        ([[1.0, -2.0], [2.0, 1.0]], -INF),  # spectral radius 4
        ([[1.0, 2.0, 0.0], [0.0, 1.0, 2.0], [2.0, 0.0, 1.0]], 0.0),  # goes round
    ],
)
def test_growth_and_cycles_are_called_divergence(A, lower, kind):
    A, q = np.array(A), np.array([1.0, 1.0]) if len(A) == 2 else -np.ones(3)
    result = solve_lcp(KINDS[kind](A), q, lower, method="pgs", eps_abs=1e-9)
    assert result.status is Status.DIVERGED
    assert result.iterations < 100
    assert np.isfinite(result.z).all()
    assert result.residual <= np.linalg.norm(q)
    bounds = np.full(len(A), lower), np.full(len(A), INF)
    residual = natural_residual(result.z, A @ result.z + q, *bounds)
    assert result.residual == pytest.approx(residual)


@pytest.mark.parametrize("coupling", [-1.0, -3.0])
def test_an_estimate_that_finds_no_positive_eigenvalue_is_no_error(coupling):
    """z moves along (1, 1) alone, which A does not raise."""
    A = np.array([[1.0, coupling], [coupling, 1.0]])
    given = dict(method="modulus", omega="auto", max_iter=50)
    assert solve_lcp(A, [-1.0, -1.0], -INF, **given).status is Status.MAX_ITER


@pytest.mark.parametrize("method", TAKERS)
def test_couplings_whose_squares_overflow_are_no_error(method):
    A = np.array([[1e-150, 1e150], [1e150, 1e-150]])
    given = {"method": method, "max_iter": 50, **auto(method)}
    assert np.isfinite(solve_lcp(A, -np.ones(2), -1.0, **given).z).all()


def test_growth_of_the_first_sweeps_is_no_divergence():
    """Far from normal: Res grows from 10^2 to 10^14, then falls (NAM, Omega = I)."""
    A, q, *_ = paper_example(2, 40, 0.0)
    result = solve_lcp(
        A, q, method="nam", s0=np.tile([1.0, 0.0], 800), eps_abs=1e-4, history=True
    )
    assert result.history["residual"][1] > 1e6
    assert result.status is Status.SOLVED


@pytest.mark.parametrize("method", ["mgs", "modulus"])
def test_overflow_is_called_divergence(method):
    A = np.array([[1.0, 1e200], [-1e200, 1.0]])
    q = np.array([-1.0, 1e150])
    with np.errstate(all="raise"):
        result = solve_lcp(A, q, method=method, eps_abs=1e-9, omega=1e-100)
    assert result.status is Status.DIVERGED
    assert np.isfinite(result.z).all()


def test_the_best_point_is_kept():
    """The residuals of a diverging run go down, then up."""
    A, q, lower, upper, s = random_problem(3)
    A[0, 1:] *= 9.0
    given = dict(method="mgs", s0=s, eps_abs=NEVER, max_iter=60, history=True)
    result = solve_lcp(A, q, lower, upper, **given)
    least = result.history["residual"].min()
    assert result.residual == pytest.approx(least, rel=1e-12)
    assert least < result.history["residual"][-1]


@pytest.mark.parametrize("kind", KINDS)
def test_no_factorisation_is_a_numerical_error(kind):
    A = KINDS[kind](np.array([[-2.0, 0.0], [0.0, 3.0]]))
    result = solve_lcp(A, np.ones(2), method="nam")
    assert result.status is Status.NUMERICAL_ERROR
    assert np.isnan(result.z).all()


def test_iterations_is_the_first_below_the_tolerance():
    A, q, *_ = paper_example(1, 10)
    result = solve_lcp(A, q, method="pgs", eps_abs=1e-6)
    again = solve_lcp(A, q, method="pgs", eps_abs=result.residual)
    assert again.iterations == result.iterations + 1


# ---- projected SOR as "auto" uses it, for 10^4 unknowns and more


def dominant_grid(m, delta, number=2):
    A, q = problems.paper_example(number, m, delta)
    return A, q + 6.0 * np.random.default_rng(0).normal(size=q.size)


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("delta", [0.3, 4.0])
def test_dominant_needs_no_factorisation(number, delta):
    A, q = dominant_grid(104, delta, number)
    result = solve_lcp(A, q, eps_abs=1e-10)
    assert (result.status, result.method) == (Status.SOLVED, "psor")
    assert_solves_lcp(result, A, q)
    assert result.residual < 1e-10
    assert 0 < np.count_nonzero(result.z == 0.0) < q.size
    assert result.iterations < (30 if delta == 4.0 else 100)
    S = sparse.diags_array(10.0 ** np.random.default_rng(0).uniform(-3, 3, q.size))
    B = sparse.csr_array(S @ A @ S)
    B.sort_indices()
    scaled = solve_lcp(B, S @ q, eps_rel=1e-9)
    assert (scaled.status, scaled.method) == (Status.SOLVED, "psor")
    assert scaled.iterations == solve_lcp(A, q, eps_rel=1e-9).iterations


@pytest.mark.parametrize("number", [1, 2])
def test_slow_sweeps_are_given_up(number):
    A, q = dominant_grid(104, 0.0, number)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    assert result.method == "multigrid"


@pytest.mark.parametrize("delta", [4.0, 12.0])
def test_sweeps_that_no_longer_move_end(delta):
    """At the solution, whose last digits the first of two sweeps may have found."""
    A, q, *_ = paper_example(1, 100, delta)
    result = solve_lcp(A, q, eps_abs=1e-30)
    assert (result.status, result.method) == (Status.SOLVED, "psor")
    assert result.residual == 0.0


def test_a_tolerance_far_below_the_data_is_no_error():
    A, q, *_ = paper_example(1, 100, 0.5)
    q = 1e30 * np.cos(np.arange(q.size))
    result = solve_lcp(A, q, eps_abs=NEVER)
    assert result.residual <= 1e-10 * np.abs(q).max()


def bipartite_problem(seed):
    """Return an A, n = 40, whose even and odd rows have two colours, q and bounds."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(40, 40))
    A *= np.triu(rng.random((40, 40)) < 0.1) + np.eye(40, k=1) > 0.0
    A += A.T * rng.uniform(0.5, 2.0)
    A[::2, ::2] = A[1::2, 1::2] = 0.0
    A += np.diag(1.0 + np.abs(A).sum(axis=1) * rng.uniform(1.0, 2.0, 40))
    return A, 3.0 * rng.normal(size=40), rng.normal(size=40) - 1.0, np.full(40, 1.5)


@pytest.mark.parametrize("seed", range(5))
def test_second_colour_is_relaxed_last(seed):
    A, q, lower, upper = bipartite_problem(seed)
    rows = sparse.csr_array(A)
    second = np.zeros(40, np.uint8)
    assert two_colours(rows.indptr, rows.indices, second)
    np.testing.assert_array_equal(second, np.arange(40) % 2)
    z, alpha = np.clip(np.zeros(40), lower, upper), 1.1
    expected, changes = z.copy(), []
    for _ in range(2):
        before = expected.copy()
        for i in (*range(0, 40, 2), *range(1, 40, 2)):
            step = alpha * (A[i] @ expected + q[i]) / A[i, i]
            expected[i] = np.clip(expected[i] - step, lower[i], upper[i])
        changes.append(np.linalg.norm(np.sqrt(np.diag(A)) * (expected - before)))
    parts = rows.indptr, rows.indices, rows.data, q, lower, upper, alpha
    moved = relax_coloured(*parts, z, second)
    np.testing.assert_allclose(z, expected, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(moved, changes, rtol=1e-12)


@pytest.mark.parametrize("method", TAKES)
def test_no_unknowns_are_solved(method, capfd):
    assert solve_lcp(np.zeros((0, 0)), [], method=method).found
    assert capfd.readouterr() == ("", "")


def test_triangles_have_no_two_colours():
    rows = sparse.csr_array(np.ones((3, 3)))
    assert not two_colours(rows.indptr, rows.indices, np.zeros(3, np.uint8))


def test_youngs_rate_from_the_first_sweeps():
    A, q, *_ = paper_example(1, 110)
    result = solve_lcp(A, q, eps_abs=1e-10)
    assert (result.status, result.method) == (Status.SOLVED, "psor")
    assert result.iterations <= 15
