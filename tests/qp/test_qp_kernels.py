"""Kernels of the QP engines, each beside a plain transcription of what it computes."""

from types import SimpleNamespace

import numpy as np
import plain
import pytest
from problems_qp import complementary, dense_scaled, make_qp, upper_triangle_of
from scipy.sparse import csc_array, random_array

from namlcp.checks import transposed
from namlcp.limits import Limits
from namlcp.linalg import csc
from namlcp.qp.certificates import accepted
from namlcp.qp.interior.loop import run
from namlcp.qp.interior.state import Interior
from namlcp.qp.kkt import ScaledQP
from namlcp.qp.problem import NO_GUESS
from namlcp.qp.reductions import presolve
from namlcp.qp.route import Chain

LIMITS = Limits(1e-9, 0.0)
TOL = 1e-6
newton, state = (
    plain.module(f"namlcp.qp.interior.{name}") for name in ("newton", "state")
)


# ---- the interior-point method


class Transcription:
    """The Newton system of `newton` before its elimination, dense.

    Unknowns dx, dy, dZ, dW; the constraints are S x + W = c.
    """

    def __init__(self, problem):
        self.P, self.A, self.S = dense_scaled(problem)
        self.q, self.b, self.c = problem.q, problem.b, problem.c

    def direction(self, point, target, rho, delta):
        """Return the step from (x, y, W, Z) for the target of W dZ + Z dW."""
        P, A, S = self.P, self.A, self.S
        (x, y, W, Z), (m, n), p = point, S.shape, self.b.size
        rd = P @ x + self.q + A.T @ y + S.T @ Z
        M = np.block([
            [P + rho * np.eye(n), A.T, S.T, np.zeros((n, m))],
            [A, -delta * np.eye(p), np.zeros((p, 2 * m))],
            [S, np.zeros((m, p)), -delta * np.eye(m), np.eye(m)],
            [np.zeros((m, n + p)), np.diag(W), np.diag(Z)],
        ])  # fmt: skip
        rhs = np.concatenate((-rd, self.b - A @ x, self.c - S @ x - W, target))
        dx, dy, dZ, dW = np.split(np.linalg.solve(M, rhs), np.cumsum((n, p, m)))
        return dx, dy, dW, dZ

    def first_point(self):
        """W = Z = 1 as weights of least squares, then Mehrotra's shift."""
        (m, n), p, delta = self.S.shape, self.b.size, newton.DELTA
        K = np.block([
            [self.P + newton.RHO * np.eye(n), self.A.T, self.S.T],
            [self.A, -delta * np.eye(p), np.zeros((p, m))],
            [self.S, np.zeros((m, p)), -(1.0 + delta) * np.eye(m)],
        ])  # fmt: skip
        rhs = np.concatenate((-self.q, self.b, self.c))
        x, y, Z = np.split(np.linalg.solve(K, rhs), (n, n + p))
        W, Z = -Z + max(0.0, 1.5 * Z.max()), Z + max(0.0, -1.5 * Z.min())
        product = 0.5 * W @ Z
        return x, y, W + product / Z.sum(), Z + product / W.sum()


def longest(W, Z, dW, dZ):
    """Return the longest primal and dual steps up to 1."""
    with np.errstate(divide="ignore"):
        return [
            min(1.0, np.min(-v[dv < 0.0] / dv[dv < 0.0], initial=1.0))
            for v, dv in ((W, dW), (Z, dZ))
        ]


def iterate(whole, point, rho, delta):
    """Return the next point: predictor, corrector, centring corrector, move."""
    _, _, W, Z = point
    m, mu = W.size, W @ Z / W.size
    _, _, dW, dZ = whole.direction(point, -W * Z, rho, delta)
    a, z = longest(W, Z, dW, dZ)
    sigma = ((W + a * dW) @ (Z + z * dZ) / (m * mu)) ** 3
    least = state.LEAST_TARGET * LIMITS.eps_abs / m
    aim = max(min(max(sigma, 0.0), 1.0) * mu, least)
    target = aim - W * Z - dW * dZ
    step = whole.direction(point, target, rho, delta)
    a, z = longest(W, Z, *step[2:])
    if a + z < newton.LONG:
        by = newton.LENGTHENED
        longer = [min(1.0, (1.0 + by) * s + by) for s in (a, z)]
        product = (W + longer[0] * step[2]) * (Z + longer[1] * step[3])
        most = newton.MOST_PRODUCT * aim
        change = np.clip(product, newton.LEAST_PRODUCT * aim, most) - product
        other = whole.direction(point, target + np.maximum(change, -most), rho, delta)
        b, w = longest(W, Z, *other[2:])
        if b + w >= a + z + newton.GAIN:
            step, a, z = other, b, w
    a, z = newton.SHORT * a, newton.SHORT * z
    lengths = a, z, a, z
    return [v + k * dv for v, k, dv in zip(point, lengths, step, strict=True)]


class Blind:
    """A judge who finds no point good."""

    is_solved, doubt = False, None

    def offer(self, point):
        return np.inf


@pytest.mark.parametrize("seed", range(6))
def test_iterations_are_those_of_the_formulas(seed):
    qp = complementary(seed, 12, 15, 3, 9, 0.6).qp
    problem, found = ScaledQP(presolve(qp, 1e-9, 0.0)), []

    def report(*numbers):
        found.append(([v.copy() for v in m.point], m.rho, m.delta))

    limits = LIMITS._replace(max_iter=8, report=report)
    m = Interior(problem, Chain(problem), Blind(), limits)
    run(m, NO_GUESS)
    assert len(found) == 9
    whole = Transcription(problem)
    expected = whole.first_point()
    for point, rho, delta in found:
        for v, mine in zip(expected, point, strict=True):
            np.testing.assert_allclose(mine, v, rtol=1e-5, atol=1e-7)
        expected = iterate(whole, point, rho, delta)


def solved_by_other_factors(change, krylov):
    """Solve a KKT system by factors of another matrix; return |residual| and the rest.

    The text of `newton` runs as plain Python.
    """
    kkt = ScaledQP(presolve(complementary(4, 20, 10, 3, 12).qp, 1e-9, 0.0)).kkt
    n, size, m = kkt.n, kkt.size, plain.Struct()
    data = kkt.base.copy()
    data[kkt.diagonal] += np.r_[np.full(n, 1e-6), np.full(size - n, -1e-8)]
    kkt.data[:] = data
    full = upper_triangle_of(kkt).toarray()
    full = full + np.triu(full, 1).T
    other = full + np.diag(np.r_[np.full(n, change), np.zeros(size - n)])

    def solve_into(rhs, x):
        x.part(size)[:] = np.linalg.solve(other, rhs.part(size))

    m.size, m.factors, m.step = size, SimpleNamespace(solve_into=solve_into), m
    m.indptr, m.indices, m.data = map(plain.Pointer, (kkt.indptr, kkt.indices, data))
    for name in ("du", "r", "answer", "trial", "trial_r", "row_size", "dt"):
        setattr(m, name, plain.reals(m, size))
    m.krylov = plain.reals(m, 16 * size)
    m.row_size.array[:] = np.maximum(1.0, np.abs(data[kkt.diagonal]))
    rhs = np.random.default_rng(0).standard_normal(size)
    m.rhs, m.accuracy, m.krylov_pays = plain.Pointer(rhs), 1e-14, krylov
    newton.solve(m)
    rest = rhs - full @ m.du.part(size)
    np.testing.assert_allclose(m.r.part(size), rest, atol=1e-9)
    return np.abs(rest).max(), m


def test_newton_systems_are_refined():
    residual, m = solved_by_other_factors(0.0, False)
    assert residual < 1e-9
    assert m.error < 1e-13
    crude, _ = solved_by_other_factors(3.0, False)
    better, m = solved_by_other_factors(3.0, True)
    assert m.krylov_pays
    assert better < 0.1 * crude


@pytest.mark.parametrize("soft", [0, 5])
@pytest.mark.parametrize(("m", "first", "wrong"), [(200, 0, -1e3), (7, 20, 1e3)])
def test_full_rows_are_condensed(m, first, wrong, soft):
    """The factors are other ones, of the smaller part, and solve the same systems."""
    rng = np.random.default_rng(0)
    width, p = 20, 5
    n = width + soft  # the last ones are shifts of soft rows
    G, A = rng.standard_normal((m, width)), rng.standard_normal((p, width))
    G[rng.random((m, width)) < 0.3] = 0.0
    G = np.hstack((G, -np.eye(m)[:, rng.permutation(m)[:soft]]))
    A = np.hstack((A, np.zeros((p, soft))))
    qp = make_qp(np.eye(n), np.ones(n), G, np.ones(m), A, np.ones(p))
    kkt = ScaledQP(presolve(qp, 1e-9, 0.0)).kkt
    factors = kkt.plan(condense=True)
    kkt.data[kkt.diagonal] += np.r_[np.ones(n), -rng.random(p + m)]
    factors.refactor(kkt.data)
    K = upper_triangle_of(kkt).toarray()
    K += np.triu(K, 1).T
    rhs = rng.random(n + p + m)
    assert factors.entries == min(width, p + m) * (n + p + m)
    np.testing.assert_allclose(K @ factors.solve(rhs), rhs, atol=1e-10)
    kkt.data[kkt.diagonal[first + soft * (first > 0)]] = wrong
    with pytest.raises(ValueError, match="vanishes"):
        factors.refactor(kkt.data)


def test_factors_of_another_pattern_are_not_taken_for_known():
    """x_0 <= 1 and x_1 <= 1 make K of the same numbers in other places."""
    qps = [make_qp(np.eye(2), np.ones(2), row, [1.0]) for row in np.eye(2)[:, None]]
    first = ScaledQP(presolve(qps[0], 1e-9, 0.0))
    first.kkt.plan()
    first.kkt.factored[:] = 1.0
    same = ScaledQP(presolve(make_qp(*qps[0]), 1e-9, 0.0), first).kkt
    other = ScaledQP(presolve(qps[1], 1e-9, 0.0), first).kkt
    np.testing.assert_array_equal(other.base, first.kkt.base)
    assert same.factors is first.kkt.factors
    assert same.factored is first.kkt.factored
    assert other.factors is None
    assert np.isnan(other.factored).all()


@pytest.mark.parametrize("place", [0, 1, 2])
def test_the_norm_of_a_residual_with_nan_is_nan(place):
    r, weight = np.array([1.0, -6.0, 2.0]), np.array([1.0, 2.0, 4.0])
    norm = newton.weighted_norm
    assert norm(plain.Pointer(r), plain.Pointer(weight), 3) == 3.0
    r[place] = np.nan
    assert np.isnan(norm(plain.Pointer(r), plain.Pointer(weight), 3))


# ---- certificates


def weighed(b, y, h, z, lb, ub, s):
    """Return z_box, and the value, its moduli and the 1-norm of the multipliers."""
    certificates = plain.module("namlcp.qp.certificates")
    c, z_box = certificates.Claim(), np.empty(s.size)
    c.p, c.m, c.n = b.size, h.size, s.size
    c.b, c.h, c.lb, c.ub = map(plain.Pointer, (b, h, lb, ub))
    certificates.weigh(c, *map(plain.Pointer, (y, z, s, z_box)))
    return z_box, (c.value, c.moduli, c.lam)


@pytest.mark.parametrize("seed", range(6))
def test_numbers_of_a_certificate_are_those_of_their_definition(seed):
    rng = np.random.default_rng(seed)
    n, m, p = 7, 6, 3
    b, h, y, s = (rng.standard_normal(k) for k in (p, m, p, n))
    lb = np.where(rng.random(n) < 0.5, -np.inf, -rng.random(n))
    ub = np.where(rng.random(n) < 0.5, np.inf, rng.random(n))
    h[rng.random(m) < 0.3] = np.inf
    s[rng.random(n) < 0.3] = 0.0
    kept = np.maximum(rng.standard_normal(m), 0.0)
    kept[np.isinf(h)] = 0.0
    z_box, found = weighed(b, y, h, kept, lb, ub, s)
    allowed = np.where(s < 0.0, np.isfinite(ub), np.isfinite(lb))
    np.testing.assert_array_equal(z_box, np.where(allowed & (s != 0.0), -s, 0.0))
    at, up, low = kept > 0.0, z_box > 0.0, z_box < 0.0
    terms = (b * y, h[at] * kept[at], ub[up] * z_box[up], lb[low] * z_box[low])
    terms, entries = np.concatenate(terms), np.concatenate((y, kept, z_box))
    expected = terms.sum(), np.abs(terms).sum(), np.abs(entries).sum()
    np.testing.assert_allclose(found, expected, rtol=1e-13)
    s[2] = np.nan
    assert np.isnan(weighed(b, y, h, kept, lb, ub, s)[1][0])


def test_multipliers_that_prove_nothing_are_left_out_and_nan_refused():
    """1 <= x <= 0 by rows; a row without a side and a wrong sign do no harm."""
    G, h = np.array([[-1.0], [1.0], [1.0], [1.0]]), np.array([-1.0, 0.0, np.inf, 5.0])
    qp = make_qp(np.eye(1), np.zeros(1), G, h)
    z = np.array([1.0, 1.0, 3.0, -2.0])
    proof, residuals = accepted(qp, (np.zeros(1), np.empty(0), z), None, TOL)
    assert residuals.dual == 0.0
    np.testing.assert_array_equal(proof.z, [1.0, 1.0, 0.0, 0.0])
    z[0] = np.nan
    assert accepted(qp, (np.zeros(1), np.empty(0), z), None, TOL) is None


def test_a_column_of_tiny_entries_proves_nothing():
    """1e-13 x <= -1 holds far out; x <= 1 with -x <= -2 holds nowhere."""
    one = np.ones(1)
    qp = make_qp([[0.0]], [0.0], [[-1e-13]], [-1.0])
    assert accepted(qp, (np.zeros(1), np.empty(0), one), None, TOL) is None
    qp = make_qp([[0.0]], [0.0], [[1e-13], [-1e-13]], [1e-3, -2e-3])
    assert accepted(qp, (np.zeros(1), np.empty(0), np.ones(2)), None, TOL) is not None


def test_the_difference_of_rows_alike_is_no_proof():
    """x = 1 and (1 + d) x = 1 + d hold together; so, along a row, no cost can fall.

    d is so small that a residual of this size counts as mere rounding.
    """
    d = 2.0**-40
    a, multipliers = np.array([1.0, 1.0 + d]), np.array([1.0, -1.0]) / d
    tol, none, one = 1e-14, np.empty(0), np.ones(1)
    point = make_qp([[0.0]], [0.0], A=a[:, None], b=a)
    assert accepted(point, (one, multipliers, none), None, tol) is None
    row = make_qp(np.zeros((2, 2)), a, A=a[None], b=[0.0])
    start = np.ones(2), np.zeros(1), none
    assert accepted(row, start, multipliers, tol) is None
    apart = make_qp([[0.0]], [0.0], A=np.ones((2, 1)), b=a)
    assert accepted(apart, (one, multipliers, none), None, tol) is not None


# ---- sparse matrices


def canonical(M):
    return make_qp(np.zeros((M.shape[1],) * 2), np.zeros(M.shape[1]), G=M, h=0).G


def test_kernels_of_sparse_matrices_are_scipys(monkeypatch):
    rng = np.random.default_rng(0)
    M = canonical(random_array((30, 20), density=0.2, rng=rng))
    B = canonical(random_array((30, 20), density=0.1, rng=rng))
    rows, columns = np.array([1, 4, 29]), np.array([0, 7, 8, 19])
    part = csc.submatrix(M, rows, columns)
    np.testing.assert_array_equal(part.toarray(), M.toarray()[np.ix_(rows, columns)])
    assert csc.submatrix(M, np.arange(30), np.arange(20)) is M
    np.testing.assert_array_equal(csc.by_rows(M).toarray(), M.toarray())
    indptr, indices, data = transposed(M.indptr, M.indices, M.data, 30)
    turned = csc_array((data, indices, indptr), shape=(20, 30))
    np.testing.assert_array_equal(turned.toarray(), M.toarray().T)
    P, weight = canonical(M.T @ M), rng.random(30)
    for most in (csc.MOST_DENSE, 40):  # full rows: at once, and in blocks
        monkeypatch.setattr(csc, "MOST_DENSE", most)
        for rest in (B, canonical(csc_array(rng.random((30, 20))))):
            S = csc.with_squares(P, rest, weight)
            exact = P.toarray() + rest.toarray().T @ np.diag(weight) @ rest.toarray()
            np.testing.assert_allclose(S.toarray(), exact, atol=1e-12)
            assert S.has_sorted_indices
    M.data[3] = 0.0
    assert csc.without_zeros(M).nnz == M.nnz - 1
    assert csc.without_zeros(B) is B


def test_products_sum_in_scipys_order():
    rng = np.random.default_rng(1)
    M = canonical(random_array((40, 30), density=0.3, rng=rng))
    x, z = rng.standard_normal(30), rng.standard_normal(40)
    np.testing.assert_array_equal(csc.times(M, x), M @ x)
    out = np.zeros(30)
    csc.add_transposed(M, z, out)
    np.testing.assert_array_equal(out, M.T @ z)
    dense = M.toarray()
    np.testing.assert_allclose(csc.times(dense, x), M @ x, atol=1e-14)
    csc.add_transposed(dense, z, out)
    np.testing.assert_allclose(out, 2 * (M.T @ z), atol=1e-13)
