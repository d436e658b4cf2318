"""omega="auto" and alpha="auto", for every sweep method that has them."""

import math

import numpy as np
import pytest
from problems_lcp import box_lcp
from scipy import sparse
from sweeping import iterates, step_of, sweep
from test_sweeps import paper_example

from namlcp import Status, solve_lcp
from namlcp.lcp.modulus.adaptive import Choice, Spectrum, symmetric_form
from namlcp.lcp.modulus.methods import METHODS, Parameters
from namlcp.lcp.modulus.sweeps import iterate
from namlcp.limits import Limits

TAKERS = [name for name, method in METHODS.items() if method.takes]
KINDS = {"dense": np.asarray, "csr": sparse.csr_array}


def auto(method):
    """The parameters of a method that can be chosen; modified-nam takes one of two."""
    given = {
        name: "auto" for name in ("alpha", "omega") if name in METHODS[method].takes
    }
    if method == "modified-nam":
        del given["omega"]
    return given


def contact_problem(seed=0, n=40, signs=True):
    """SPD A of moderate condition, about half of the bounds active."""
    rng = np.random.default_rng(seed)
    B = rng.normal(size=(n, n)) if signs else -rng.random((n, n))
    A = B @ B.T / n + 0.3 * np.eye(n) if signs else B + B.T + 1.1 * n * np.eye(n)
    free = rng.random(n) < 0.5
    z = np.where(free, rng.exponential(size=n), 0.0)
    w = np.where(free, 0.0, rng.exponential(size=n))
    return A, w - A @ z, z


def obstacle(m=16):
    A, _, lower, upper = paper_example(1, m, 0.0)
    x = np.arange(1, m + 1) / (m + 1)
    wave = np.sin(3.0 * np.pi * x)
    return A, -np.outer(wave, wave).ravel(), lower, upper


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", TAKERS)
def test_solves_and_repeats_bit_for_bit(method, kind):
    A, q, z = contact_problem()
    given = dict(method=method, eps_abs=1e-9, max_iter=5000, **auto(method))
    first = solve_lcp(KINDS[kind](A), q, **given)
    assert first.status is Status.SOLVED
    np.testing.assert_allclose(first.z, z, atol=1e-7)
    again = solve_lcp(KINDS[kind](A), q, **given)
    assert again.iterations == first.iterations
    np.testing.assert_array_equal(again.z, first.z)


@pytest.mark.parametrize("method", TAKERS)
def test_units_do_not_matter(method):
    """c A, c q; and S A S, S q with z = S^-1 z for a diagonal S > 0."""
    A, q, _ = contact_problem(1)
    n = q.size
    lower, upper = np.zeros(n), np.full(n, np.inf)
    scale = np.exp(np.random.default_rng(2).uniform(-3.0, 3.0, n))
    given = dict(method=method, eps_abs=1e-300, **auto(method))
    for sweeps in (3, 10, 45):
        one = sweep(A, q, lower, upper, max_iter=sweeps, **given)
        for c in (1e-6, 3.0, 1e5):
            other = sweep(c * A, c * q, lower, upper, max_iter=sweeps, **given)
            np.testing.assert_allclose(other.s, one.s, rtol=1e-7, atol=1e-7)
        if method == "modified-nam":  # Omega = alpha I is of one size for all rows
            continue
        scaled = scale[:, None] * A * scale
        other = adapted(scaled, scale * q, lower, upper, method, sweeps)
        one = adapted(A, q, lower, upper, method, sweeps)
        np.testing.assert_allclose(scale * other, one, rtol=1e-7, atol=1e-7)


def adapted(A, q, lower, upper, method, sweeps):
    """s after some sweeps; Res, which does depend on units, decides nothing."""
    step = step_of(A, q, lower, upper, method, **auto(method))
    return iterates(step, np.zeros_like(q), lower, upper, sweeps)[-1]


@pytest.mark.parametrize("method", TAKERS)
@pytest.mark.parametrize("name", ["dominant", "nonsymmetric", "obstacle", "contact"])
def test_near_the_best_of_a_small_grid(name, method):
    if name == "contact":
        A, q, _ = contact_problem(3)
        lower, upper = np.zeros_like(q), np.full_like(q, np.inf)
    elif name == "obstacle":
        A, q, lower, upper = obstacle()
    else:
        number, delta = {"dominant": (1, 4.0), "nonsymmetric": (2, 1.0)}[name]
        A, q, lower, upper = paper_example(number, 12, delta)
    D = A.diagonal()
    takes = METHODS[method].takes
    eps = 1e-6 * np.linalg.norm(np.minimum(q, 0.0))
    best = math.inf
    for c in (0.02, 0.1, 0.3, 1.0, 3.0):
        for alpha in (0.5, 1.0, 1.5, 1.9) if "alpha" in takes else (None,):
            given = {"alpha": alpha} if alpha else {}
            if method == "modified-nam":
                given = {"shift": D}
            if "omega" in takes:
                given["omega"] = c * D
            if method == "nam":
                given["shift"] = D
            result = sweep(
                A, q, lower, upper, method, eps_abs=eps,
                max_iter=int(min(best, 700)), **given,
            )  # fmt: skip
            if result.status is Status.SOLVED:
                best = min(best, result.iterations)
    result = sweep(
        A, q, lower, upper, method, eps_abs=eps, max_iter=2000, **auto(method)
    )
    if best < math.inf:
        assert result.status is Status.SOLVED
        assert result.iterations <= 1.3 * best + 1


def test_young_s_relaxation():
    """Row sums of 1/2 decide at once: 2/(1 + sqrt(1 - mu^2)), without any product."""
    A, q, lower, upper = paper_example(1, 10, 4.0)
    step = step_of(A, q, lower, upper, "psor", alpha="auto")
    assert step.alpha == pytest.approx(2.0 / (1.0 + math.sqrt(0.75)))
    assert step.choice.spectrum.products == 0


@pytest.mark.parametrize("omega", [0.3, "D"])
def test_one_of_the_two_may_be_given(omega):
    A, q, z = contact_problem(5)
    omega = A.diagonal() if omega == "D" else omega
    for method in ("msor", "namsor", "amsor", "maor", "namaor"):
        for given in ({"alpha": "auto", "omega": omega}, {"alpha": "auto"},
                      {"alpha": 1.2, "omega": "auto"}, {"omega": "auto"}):  # fmt: skip
            result = solve_lcp(
                A, q, method=method, eps_abs=1e-9, max_iter=20_000, **given
            )
            assert result.status is Status.SOLVED, (method, given)
            np.testing.assert_allclose(result.z, z, atol=1e-6)
    result = solve_lcp(
        A, q, method="modified-nam", omega="auto", eps_abs=1e-9, max_iter=5000
    )
    assert result.status is Status.SOLVED


@pytest.mark.parametrize("method", TAKERS)
def test_solution_is_a_fixed_point(method):
    """Also across changes of Omega: s is written anew."""
    A, q, lower, upper = obstacle(8)
    z = solve_lcp(A, q, lower, upper, eps_abs=1e-13).z
    start = sweep(
        A, q, lower, upper, method, z0=z, eps_abs=1e-9, max_iter=9, **auto(method)
    )
    assert start.iterations == 0
    result = sweep(
        A, q, lower, upper, method, z0=z, eps_abs=1e-300, max_iter=30, **auto(method)
    )  # fmt: skip
    assert result.history["residual"].max() < 1e-10


@pytest.mark.parametrize("method", TAKERS)
def test_result_satisfies_the_modulus_equation(method):
    A, q, _ = contact_problem(6)
    lower, upper = np.zeros_like(q), np.full_like(q, np.inf)
    step, lcp = (
        step_of(A, q, lower, upper, method, **auto(method)),
        box_lcp(A, q, lower, upper),
    )
    status, s, _ = iterate(lcp, step, np.zeros_like(q), Limits(1e-9, max_iter=5000))
    assert status is Status.SOLVED
    z = np.clip(s, lower, upper)
    np.testing.assert_allclose(step.omega * (z - s), A @ z + q, atol=1e-6)
    result = sweep(
        A, q, lower, upper, method, eps_abs=1e-9, max_iter=5000, **auto(method)
    )
    np.testing.assert_array_equal(result.s, s)
    np.testing.assert_array_equal(result.z, z)


def test_spectrum():
    A, _, _ = contact_problem(7)
    d = 1.0 / np.sqrt(A.diagonal())
    free = np.random.default_rng(0).random(d.size) < 0.6
    values = np.linalg.eigvalsh((d[:, None] * A * d)[np.ix_(free, free)])
    for X in (A, sparse.csr_array(A)):
        spectrum = Spectrum(X, A.diagonal())
        spectrum.estimate(free, np.zeros_like(d))
        assert values[0] <= spectrum.low <= 1.3 * values[0]
        assert spectrum.high == pytest.approx(values[-1], rel=0.02)
        assert spectrum.high <= values[-1] * (1.0 + 1e-12)
        before = spectrum.products
        spectrum.estimate(np.zeros_like(free), np.zeros_like(d))
        assert spectrum.products == before


def test_symmetric_form_has_the_eigenvalues_of_a_similar_matrix():
    A, _, _ = contact_problem(8, 12)
    d = np.exp(np.random.default_rng(1).normal(size=12))
    similar = d[:, None] * A / d
    for X in (similar, sparse.csr_array(similar)):
        C = symmetric_form(X)
        dense = C if isinstance(C, np.ndarray) else C.toarray()
        np.testing.assert_allclose(dense, A, atol=1e-12)
    assert symmetric_form(A) is A
    opposite = np.array([[1.0, 2.0], [-2.0, 1.0]])
    np.testing.assert_array_equal(symmetric_form(opposite), np.eye(2))


@pytest.mark.parametrize("method", ["msor", "namsor", "amsor"])
def test_a_wrong_estimate_is_corrected(method):
    """Signs differ across the diagonal: the estimate sees the identity."""
    A = np.eye(3) + 0.95 * (np.triu(np.ones((3, 3)), 1) - np.tril(np.ones((3, 3)), -1))
    q, lower, upper = -np.ones(3), np.zeros(3), np.full(3, np.inf)
    step = step_of(A, q, lower, upper, method, alpha="auto", omega="auto")
    first = step.omega[0]
    lcp, limits = box_lcp(A, q, lower, upper), Limits(1e-9, max_iter=2000)
    status, _, _ = iterate(lcp, step, np.zeros(3), limits)
    assert status is Status.SOLVED
    assert step.choice.scale > 1.0
    assert step.omega[0] > first


def test_growth_and_standing_raise_p():
    A, _, _ = contact_problem(4)
    choice = Choice(A, METHODS["amsor"], Parameters("auto", omega="auto"))
    change = np.ones(len(A))
    free = change > 0.0
    assert not choice.watch(change)
    assert not choice.watch(3.9 * change)
    assert choice.watch(4.1 * change)
    assert choice.scale == pytest.approx(1.1)
    for k, size, scale in (
        (64, 4.0, 1.1), (128, 4.0, 1.1), (256, 0.1, 1.1 * 1.2), (512, 0.1, 1.1 * 1.2),
    ):  # fmt: skip
        choice.look(k, free, change)
        assert choice.scale == pytest.approx(scale)
        choice.watch(size * change)


@pytest.mark.parametrize(
    ("method", "given", "message"),
    [
        (
            "psor",
            {"alpha": "best"},
            r"alpha must be a number in \(0, 2\) or 'auto', got",
        ),
        ("modified-nam", {"alpha": "1"}, r"a number in \(0, inf\) or 'auto', got '1'"),
        (
            "mgs",
            {"omega": "Auto"},
            "omega must be a positive number, an array or 'auto'",
        ),
    ],
)
def test_other_words_are_refused(method, given, message):
    with pytest.raises(TypeError, match=message):
        solve_lcp(np.eye(2), np.ones(2), method=method, **given)


@pytest.mark.parametrize(
    ("method", "given", "message"),
    [
        ("mgs", {"alpha": "auto"}, "alpha is not a parameter of method 'mgs'"),
        ("psor", {"omega": "auto"}, "omega is not a parameter of method 'psor'"),
        ("auto", {"omega": "auto"}, "omega is not a parameter of method 'auto'"),
        ("msor", {"alpha": 2.0, "omega": "auto"}, r"alpha must lie in \(0, 2\)"),
        ("msor", {"alpha": "auto", "omega": -1.0}, "omega must be positive"),
        ("namsor", {"alpha": "auto", "shift": -1.0}, "shift must not be negative"),
        ("maor", {"alpha": "auto", "beta": 2.0}, r"beta must lie in \[0, 2\)"),
        ("modified-nam", {"alpha": "auto", "omega": 1.0}, "alpha or omega, not both"),
    ],
)
def test_the_other_parameters_are_still_checked(method, given, message):
    with pytest.raises(ValueError, match=message):
        solve_lcp(np.eye(2), np.ones(2), method=method, **given)


@pytest.mark.parametrize("method", TAKERS)
def test_diagonal_must_be_positive(method):
    A = np.array([[1.0, 0.5], [0.5, 0.0]])
    with pytest.raises(ValueError, match="positive diagonal"):
        solve_lcp(A, np.ones(2), method=method, **auto(method))


@pytest.mark.parametrize("method", TAKERS)
def test_empty_and_free_and_pinned(method):
    if not METHODS[method].factored:
        empty = np.empty(0)
        result = sweep(
            np.empty((0, 0)), empty, empty, empty, method, eps_abs=1e-8, max_iter=9,
            **auto(method),
        )  # fmt: skip
        assert result.status is Status.SOLVED
    A, q, _ = contact_problem(9, 8)
    free = np.full(8, np.inf)
    lower, upper = -free, free.copy()
    lower[0] = upper[0] = 0.7
    result = sweep(
        A, q, lower, upper, method, eps_abs=1e-9, max_iter=3000, **auto(method)
    )
    assert result.status is Status.SOLVED
    assert result.z[0] == 0.7
