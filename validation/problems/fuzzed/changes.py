"""How a fuzzed QP changes from one solve to the next."""

from collections.abc import Callable

import numpy as np

from namlcp.qp import QP
from validation.problems.fuzzed.draw import Draw, symmetric

INF = np.inf


def vectors(draw: Draw, qp: QP) -> QP:
    """Move q, h and b; in two of three cases A x = b stays consistent if it was."""
    step = draw.one_of(1e-3, 0.1, 1.0)
    n, p = qp.q.size, qp.b.size
    shift = qp.A @ draw.numbers(n) if draw.chance(0.67) else draw.numbers(p)
    return qp._replace(
        q=qp.q + step * draw.numbers(n),
        h=qp.h + step * draw.numbers(qp.h.size),
        b=qp.b + step * shift,
    )


def bounds(draw: Draw, qp: QP) -> QP:
    """Move bounds, take some away, and bring some; they may contradict each other."""
    n, step = qp.q.size, draw.one_of(0.1, 1.0)
    lb, ub = qp.lb + step * draw.numbers(n), qp.ub + step * draw.numbers(n)
    if draw.chance(0.8):
        lb, ub = np.minimum(lb, ub), np.maximum(lb, ub)
    lb = np.where(draw.some(n, 0.1), -INF, lb)
    top = np.where(np.isfinite(lb), lb, 0.0) + draw.positive(n)
    return qp._replace(lb=lb, ub=np.where(draw.some(n, 0.1), top, ub))


def matrices(draw: Draw, qp: QP) -> QP:
    """Change the values of P, G and A; zeros stay, and P as convex as it was."""
    d = draw.power(-0.5, 0.5, qp.q.size)
    G, A = (M * draw.power(-0.1, 0.1, M.size).reshape(M.shape) for M in (qp.G, qp.A))
    return qp._replace(P=symmetric(d[:, None] * qp.P * d), G=G, A=A)


def nothing(draw: Draw, qp: QP) -> QP:
    return qp


CHANGES: tuple[Callable[[Draw, QP], QP], ...] = (
    vectors, vectors, bounds, matrices, nothing,
)  # fmt: skip


def changed(draw: Draw, qp: QP) -> QP:
    return CHANGES[int(draw.rng.integers(len(CHANGES)))](draw, qp)
