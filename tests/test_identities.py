"""Identities between the methods as their papers have them, for many iterates.

`lcp/test_sweeps.py` shows that the kernels are these formulas. The matrices have no
symmetry, the bounds are of every kind.
"""

import numpy as np
import plain_sweeps
import pytest
from plain_sweeps import TAKES
from problems_lcp import every_bounds

BOXES = ("halfline", "boxes")
EXACT = 1e-13
SWEEPS = 40


def problem(seed, box, n=17):
    """Random A, q, bounds and s; Jacobi's row sums are below 1."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.4)
    np.fill_diagonal(A, 0.0)
    np.fill_diagonal(A, np.abs(A).sum(axis=1) + rng.uniform(0.5, 3.0, n))
    lower, upper = np.zeros(n), np.full(n, np.inf)
    if box == "boxes":
        lower, upper = every_bounds(rng, n)
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
    return plain_sweeps.iterates(A, q, lower, upper, method, s, count, **given)[0][1:]


def assert_same(actual, expected, tolerance=EXACT):
    """Agreement relative to the size of the vectors."""
    size = max(1.0, float(np.abs(expected).max()))
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=tolerance * size)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("alpha", [0.6, 1.0, 1.3])
def test_accelerated_sor_with_omega_d_over_alpha_is_projected_sor(alpha, box):
    """Forty iterates of z, each to 1e-13."""
    A, q, lower, upper, s = problem(2, box)
    D = np.diag(A)
    actual = iterates(A, q, lower, upper, "amsor", s, alpha=alpha, omega=D / alpha)
    z = np.clip(s, lower, upper)
    for k in range(SWEEPS):
        for i in range(q.size):
            w = A[i] @ z + q[i]
            z[i] = min(max(z[i] - alpha * w / D[i], lower[i]), upper[i])
        assert_same(np.clip(actual[k], lower, upper), z)


@pytest.mark.parametrize("box", BOXES)
@pytest.mark.parametrize("degenerate", [False, True])
@pytest.mark.parametrize("method", TAKES)
def test_every_solution_gives_a_fixed_point(method, degenerate, box):
    """s = z - Omega^-1 w stays where it is, for every Omega and every shift."""
    A, _, lower, upper, _ = problem(4, box)
    rng = np.random.default_rng(4)
    z, w, q = solution(rng, A, lower, upper, degenerate)
    takes = TAKES[method].split()
    for omega, shift in ((0.3, 0.0), (2.0, 1.0), (rng.uniform(0.1, 9.0, q.size), 5.0)):
        given = {"omega": omega, "shift": shift}
        given = {name: value for name, value in given.items() if name in takes}
        scale = omega if "omega" in takes else np.diag(A)
        s = z - w / scale
        assert_same(iterates(A, q, lower, upper, method, s, 1, **given)[0], s)


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


@pytest.mark.parametrize("alpha", [0.6, 1.0, 1.7])
def test_namaor_is_variant_6_with_the_coefficients_of_l_and_s_put_right(alpha):
    A, q, lower, upper, s = problem(9, "halfline")
    D, L, U = parts(A)
    I, beta, Omega = np.eye(q.size), 0.3, D / (2.0 * alpha**2)
    given = {"alpha": alpha, "beta": beta, "shift": 1.0}
    for new in iterates(A, q, lower, upper, "namaor", s, **given):
        s = np.linalg.solve(
            D - (alpha + beta) * L + alpha * Omega + alpha * I,
            ((1 - alpha) * D - beta * L + alpha * U + alpha * I) @ s
            + alpha * (Omega - A) @ abs(s)
            - 2 * alpha * q,
        )
        assert_same(new, s)


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


def test_without_bounds_namsor_is_sor():
    """Omega = c D, E = e D: SOR with relaxation 2 / (1/alpha + c + e); Bai's is not.

    While every z_i > 0, |s| = s: that is why NAMGS needs fewer sweeps than MGS, whose
    sweep has half of L.
    """
    A, q, _, _, s = problem(9, "halfline")
    free = np.full(q.size, np.inf)
    D = np.diag(A)
    alpha, c, e = 0.9, 0.6, 0.3
    given = {"alpha": alpha, "omega": c * D}
    actual = iterates(A, q, -free, free, "namsor", s, shift=e * D, **given)
    relaxation = 2.0 / (1.0 / alpha + c + e)
    expected = iterates(A, q, -free, free, "psor", s, alpha=relaxation)
    assert_same(actual, expected)
    bai_s = iterates(A, q, -free, free, "msor", s, **given)
    assert np.abs(bai_s[0] - expected[0]).max() > 1e-3
