"""Identities between the methods, against the kernels: one iterate, or many.

The matrices have no symmetry, the bounds are of every kind; `tests/test_sweeps.py` has
the formulas of the methods themselves.
"""

import numpy as np
import pytest
import sweeping
from scipy import sparse

from namlcp import solve_lcp
from namlcp.lcp.modulus.methods import SWEEPS as METHODS

TRIANGULAR = [name for name, method in METHODS.items() if not method.factored]
KINDS = {"dense": np.asarray, "csr": sparse.csr_array}
BOXES = ("halfline", "boxes")
EXACT = 1e-13
SWEEPS = 40


def problem(seed, box, n=17, dominance=1.0):
    """Random A, q, bounds and s; Jacobi's row sums are below 1/dominance."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.4)
    np.fill_diagonal(A, 0.0)
    np.fill_diagonal(A, dominance * np.abs(A).sum(axis=1) + rng.uniform(0.5, 3.0, n))
    lower, upper = np.zeros(n), np.full(n, np.inf)
    if box == "boxes":
        lower, upper = sweeping.every_bounds(rng, n)
    return A, 4.0 * rng.normal(size=n), lower, upper, 2.0 * rng.normal(size=n)


def parts(A):
    return np.diag(np.diag(A)), -np.tril(A, -1), -np.triu(A, 1)


def solution(rng, A, lower, upper, degenerate=False):
    """z, w and q such that z solves the box LCP (A, q)."""
    n = A.shape[0]
    z = np.clip(2.0 * rng.normal(size=n), lower, upper)
    size = rng.exponential(size=n)
    w = np.where(z == lower, size, np.where(z == upper, -size, 0.0))
    pinned = lower == upper
    w[pinned] = rng.normal(size=pinned.sum())
    if degenerate:
        w[::3] = 0.0
    return z, w, w - A @ z


def iterates(A, q, lower, upper, method, s, count=SWEEPS, **given):
    """s_1 ... s_count of a method."""
    step = sweeping.step_of(A, q, lower, upper, method, **given)
    return sweeping.iterates(step, s, lower, upper, count)


def bai(A, M, Omega, q, lower, upper, s, count=SWEEPS, r=2.0):
    """s_1 ... of (M + Omega) s+ = (M - A) s + (Omega - A) R(s) - r q, z = (R + s)/r."""
    rows = []
    for _ in range(count):
        z = np.clip(2.0 * s / r, lower, upper)
        R = r * z - s
        s = np.linalg.solve(M + Omega, (M - A) @ s + (Omega - A) @ R - r * q)
        rows.append(s)
    return np.array(rows)


def assert_same(actual, expected, tolerance=EXACT):
    """Agreement relative to the size of the vectors."""
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=tolerance * size)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(
    ("method", "alpha", "beta"),
    [("namj", 1.0, 0.0), ("namgs", 1.0, 1.0), ("namsor", 0.8, 0.8),
     ("namaor", 1.2, 0.4)],
)  # fmt: skip
def test_nam_is_bai_with_the_shifted_splitting(method, alpha, beta, kind, box):
    """NAM(M, N) is Bai's method with (M + I - L, N + I - L)."""
    A, q, lower, upper, s = problem(0, box)
    D, L, _ = parts(A)
    takes = METHODS[method].takes
    given = {"alpha": alpha, "beta": beta, "omega": 0.7 * np.diag(D), "shift": 1.0}
    given = {name: given[name] for name in takes}
    Omega, I = 0.7 * D, np.eye(q.size)
    M = (D - beta * L) / alpha
    N = M - A
    actual = iterates(KINDS[kind](A), q, lower, upper, method, s, **given)
    assert_same(actual, bai(A, M + I - L, Omega, q, lower, upper, s))
    for new in actual:
        R = 2.0 * np.clip(s, lower, upper) - s
        right = (N + I - L) @ s + (Omega - A) @ R - 2.0 * q  # Method 3.1, |s| = R
        s = np.linalg.solve(M + Omega + I - L, right)
        assert_same(new, s)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("kind", KINDS)
def test_namaor_contains_the_others(kind, box):
    """NAMAOR(alpha, alpha) = NAMSOR(alpha), (1, 1) = NAMGS, (1, 0) = NAMJ."""
    A, q, lower, upper, s = problem(1, box)
    A = KINDS[kind](A)
    omega = np.linspace(1.0, 3.0, q.size)
    for pair, method, given in (
        ((0.7, 0.7), "namsor", {"alpha": 0.7}),
        ((1.4, 1.4), "namsor", {"alpha": 1.4}),
        ((1.0, 1.0), "namgs", {}),
        ((1.0, 0.0), "namj", {}),
    ):
        one = iterates(
            A, q, lower, upper, "namaor", s, alpha=pair[0], beta=pair[1],
            omega=omega, shift=1.0,
        )  # fmt: skip
        other = iterates(
            A, q, lower, upper, method, s, omega=omega, shift=1.0, **given
        )  # fmt: skip
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alpha", [0.6, 1.0, 1.3])
def test_accelerated_sor_with_omega_d_over_alpha_is_projected_sor(alpha, kind, box):
    """Forty iterates of z, each to 1e-13."""
    A, q, lower, upper, s = problem(2, box)
    D = np.diag(A)
    actual = iterates(
        KINDS[kind](A), q, lower, upper, "amsor", s, alpha=alpha, omega=D / alpha
    )
    z = np.clip(s, lower, upper)
    for k in range(SWEEPS):
        for i in range(q.size):
            w = A[i] @ z + q[i]
            z[i] = min(max(z[i] - alpha * w / D[i], lower[i]), upper[i])
        assert_same(np.clip(actual[k], lower, upper), z)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("degenerate", [False, True])
@pytest.mark.parametrize("method", METHODS)
def test_every_solution_gives_a_fixed_point(method, degenerate, box):
    """s = z - Omega^-1 w stays where it is, for every Omega and every shift."""
    A, _, lower, upper, _ = problem(4, box)
    rng = np.random.default_rng(4)
    z, w, q = solution(rng, A, lower, upper, degenerate)
    takes = METHODS[method].takes
    for omega, shift in ((0.3, 0.0), (2.0, 1.0), (rng.uniform(0.1, 9.0, q.size), 5.0)):
        given = {"omega": omega, "shift": shift}
        given = {name: value for name, value in given.items() if name in takes}
        scale = omega if "omega" in takes else np.diag(A)
        s = z - w / scale
        assert_same(iterates(A, q, lower, upper, method, s, 1, **given)[0], s)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("method", TRIANGULAR)
def test_every_fixed_point_is_a_solution(method, box):
    """For every shift and Omega the limit is the z that another method finds."""
    A, q, lower, upper, _ = problem(5, box, dominance=2.0)
    z = solve_lcp(A, q, lower, upper, eps_abs=1e-12).z
    takes = METHODS[method].takes
    for c, shift in ((0.6, 0.0), (1.0, 1.0), (3.0, 20.0)):
        given = {"omega": c * np.diag(A), "shift": shift}
        given = {name: value for name, value in given.items() if name in takes}
        result = sweeping.sweep(
            A, q, lower, upper, method, eps_abs=1e-12, max_iter=5000, **given
        )
        assert result.status.value == "solved"
        np.testing.assert_allclose(result.z, z, rtol=0.0, atol=1e-11)
        s_next = iterates(A, q, lower, upper, method, result.s, 1, **given)[0]
        np.testing.assert_allclose(s_next, result.s, rtol=0.0, atol=1e-11)


@pytest.mark.parametrize("box", BOXES)
def test_the_printed_formulas_5_and_6_do_not_stay_at_a_solution(box):
    """Variants (5) and (6) as printed move a solution; put right they do not."""
    A, _, lower, upper, _ = problem(6, "halfline")
    if box == "boxes":
        A = A + 3.0 * np.eye(A.shape[0])
    z, w, q = solution(np.random.default_rng(6), A, lower, upper)
    D, L, U = parts(A)
    I, a, b = np.eye(q.size), 0.9, 0.5
    Omega = D / (2.0 * a * a)
    s = z - w / np.diag(Omega)
    common = (1.0 - a) * D + a * U + a * I
    right, wrong = a * (Omega - A) @ abs(s), a * (Omega - A) @ s
    for left, put_right, printed in (
        (D - 2.0 * a * L + a * Omega + a * I, -a * L, -L),
        (D - (a + b) * L + a * Omega + a * I, -b * L, (2.0 * a - b) * L),
    ):
        moves = [
            np.linalg.solve(left, (common + term) @ s + rest - 2.0 * a * q) - s
            for term, rest in ((put_right, right), (printed, right), (put_right, wrong))
        ]
        assert np.abs(moves[0]).max() < EXACT * 10.0
        assert np.abs(moves[1]).max() > 1e-3
        assert np.abs(moves[2]).max() > 1e-3


@pytest.mark.parametrize("box", BOXES)
def test_modulus_is_peaceman_rachford(box):
    """With M = A: s+ = R_A(R_C(s)), reflections at the box and at A z + q.

    R_C = 2 clip - 1, R_A = 2 J - 1, J y = (A + Omega)^-1 (Omega y - q): the resolvents
    in the metric of Omega.
    """
    A, q, lower, upper, s = problem(7, box)
    omega = np.linspace(0.5, 4.0, q.size)
    actual = iterates(A, q, lower, upper, "modulus", s, omega=omega)
    for k in range(SWEEPS):
        y = 2.0 * np.clip(s, lower, upper) - s
        s = 2.0 * np.linalg.solve(A + np.diag(omega), omega * y - q) - y
        assert_same(actual[k], s)


@pytest.mark.parametrize("kind", KINDS)
def test_without_bounds_namsor_is_sor(kind):
    """Omega = c D, E = e D: SOR with relaxation 2 / (1/alpha + c + e); Bai's is not.

    While every z_i > 0, |s| = s: that is why NAMGS needs fewer sweeps than MGS, whose
    sweep has half of L.
    """
    A, q, _, _, s = problem(9, "halfline")
    free = np.full(q.size, np.inf)
    D = np.diag(A)
    alpha, c, e = 0.9, 0.6, 0.3
    given = {"alpha": alpha, "omega": c * D}
    X = KINDS[kind](A)
    actual = iterates(X, q, -free, free, "namsor", s, shift=e * D, **given)
    relaxation = 2.0 / (1.0 / alpha + c + e)
    expected = iterates(X, q, -free, free, "psor", s, alpha=relaxation)
    assert_same(actual, expected)
    bai_s = iterates(X, q, -free, free, "msor", s, **given)
    assert np.abs(bai_s[0] - expected[0]).max() > 1e-3
