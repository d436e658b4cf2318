"""Iterations of the interior-point method beside a dense transcription."""

import numpy as np
import pytest
from problems_qp import complementary, upper_triangle_of

from namlcp.limits import Limits
from namlcp.qp.path.advance import CLOCK, GAIN, LONG, LOOK, OPERATIONS, START
from namlcp.qp.path.regularisation import DELTA, RHO
from namlcp.qp.path.steps import (
    LEAST_PRODUCT,
    LEAST_TARGET,
    LENGTHENED,
    MOST_PRODUCT,
    SHORT,
)
from namlcp.qp.path.workspace import Workspace
from namlcp.qp.transforms.presolve import presolve
from namlcp.qp.transforms.scaling import ScaledQP

LIMITS = Limits(1e-9, 0.0)


class Transcription:
    """The Newton system of `steps` before its elimination, dense.

    Unknowns dx, dy, dZ, dW; the constraints are S x + W = c.
    """

    def __init__(self, problem):
        kkt, n, p = problem.kkt, problem.n, problem.p
        K = upper_triangle_of(kkt).toarray()
        K[np.diag_indices(kkt.size)] = kkt.base[kkt.diagonal]
        K += np.triu(K, 1).T
        self.P, self.A = K[:n, :n], K[n : n + p, :n]
        T = np.vstack((np.eye(n), K[n:, :n]))
        self.S = problem.sign[:, None] * T[problem.place]
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


def steps(W, Z, dW, dZ):
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
    a, z = steps(W, Z, dW, dZ)
    sigma = ((W + a * dW) @ (Z + z * dZ) / (m * mu)) ** 3
    aim = max(min(max(sigma, 0.0), 1.0) * mu, LEAST_TARGET * LIMITS.eps_abs / m)
    target = aim - W * Z - dW * dZ
    step = whole.direction(point, target, rho, delta)
    a, z = steps(W, Z, *step[2:])
    if a + z < LONG:
        longer = [min(1.0, (1.0 + LENGTHENED) * s + LENGTHENED) for s in (a, z)]
        product = (W + longer[0] * step[2]) * (Z + longer[1] * step[3])
        change = np.clip(product, LEAST_PRODUCT * aim, MOST_PRODUCT * aim) - product
        target = target + np.maximum(change, -MOST_PRODUCT * aim)
        other = whole.direction(point, target, rho, delta)
        b, w = steps(W, Z, *other[2:])
        if b + w >= a + z + GAIN:
            step, a, z = other, b, w
    a, z = SHORT * a, SHORT * z
    lengths = a, z, a, z
    return [v + k * dv for v, k, dv in zip(point, lengths, step, strict=True)]


@pytest.mark.parametrize("seed", range(6))
def test_iterations_are_those_of_the_formulas(seed):
    qp = complementary(seed, 12, 15, 3, 9, 0.6).qp
    work = Workspace(ScaledQP(presolve(qp, 1e-9, 0.0)), LIMITS)
    now, whole = work.now, Transcription(work.problem)
    now.reports, now.max_iter, now.patience = True, 99, 99
    now.rho, now.delta, now.accuracy = RHO, DELTA, 1e-12
    now.best = now.reference = now.last_refined = np.inf
    now.drop = 0.1
    found = work.run(START)
    for _ in range(7):
        assert found == LOOK
        point = [v.copy() for v in (work.x, work.y, work.W, work.Z)]
        expected = iterate(whole, point, now.rho, now.delta)
        found = work.resume()
        for v, name in zip(expected, "xyWZ", strict=True):
            np.testing.assert_allclose(getattr(work, name), v, rtol=1e-5, atol=1e-7)


def test_the_first_point_solves_the_least_squares_problem():
    """W = Z = 1 as weights, then Mehrotra's shift: W and Z are positive."""
    qp = complementary(1, 12, 15, 3, 9, 0.6).qp
    work = Workspace(ScaledQP(presolve(qp, 1e-9, 0.0)), LIMITS)
    now, whole = work.now, Transcription(work.problem)
    now.reports, now.rho, now.delta, now.accuracy = True, RHO, DELTA, 1e-12
    now.drop = 0.1
    work.run(START)
    (m, n), p = whole.S.shape, whole.b.size
    K = np.block([
        [whole.P + RHO * np.eye(n), whole.A.T, whole.S.T],
        [whole.A, -DELTA * np.eye(p), np.zeros((p, m))],
        [whole.S, np.zeros((m, p)), -(1.0 + DELTA) * np.eye(m)],
    ])  # fmt: skip
    rhs = np.concatenate((-whole.q, whole.b, whole.c))
    x, y, Z = np.split(np.linalg.solve(K, rhs), (n, n + p))
    W = -Z + max(0.0, 1.5 * Z.max())
    Z = Z + max(0.0, -1.5 * Z.min())
    product = 0.5 * W @ Z
    W, Z = W + product / Z.sum(), Z + product / W.sum()
    for v, found in ((x, work.x), (y, work.y), (W, work.W), (Z, work.Z)):
        np.testing.assert_allclose(found, v, rtol=1e-7, atol=1e-9)


def test_the_clock_is_looked_at_after_enough_operations():
    work = Workspace(
        ScaledQP(presolve(complementary(2, 12, 15, 3, 9).qp, 1e-9, 0.0)), LIMITS
    )
    now = work.now
    assert 0.0 < now.iteration_work < 1e-3 * OPERATIONS
    now.max_iter, now.patience, now.accuracy = 99, 99, 1e-12
    now.best = now.reference = now.last_refined = np.inf
    now.drop = 0.1
    now.rho, now.delta, now.iteration_work = RHO, DELTA, 0.4 * OPERATIONS
    assert work.run(START) == LOOK
    assert now.wants == CLOCK
    assert now.iterations == 2
