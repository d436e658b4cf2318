"""The same call with the same data gives the same bits, wherever its arrays lie.

What a machine adds up in which order may depend on its processor, not on addresses.
"""

import numpy as np
import pytest
from problems_qp import make_qp

from namlcp import Solver, solve_batch, solve_lcp, solve_qp

OFFSETS = range(0, 8, 2)  # memory of any size begins at a multiple of 16 bytes


def moved(array, offset):
    """Return a copy that begins so many doubles after a multiple of 64 bytes."""
    memory = np.empty(array.size + 16)
    start = -memory.ctypes.data % 64 // 8 + offset
    copy = memory[start : start + array.size].reshape(array.shape)
    copy[...] = array
    return copy


def qp_of(n, rank):
    rng = np.random.default_rng(n)
    B, G, A = (rng.standard_normal((k, n)) for k in (rank, n, n // 5))
    x = rng.standard_normal(n)
    P = B.T @ B
    q = P @ rng.standard_normal(n)
    return P, q, G, G @ x + rng.random(n), A, A @ x, x - 1.0, x + 1.0


def bits(result):
    return b"".join(part.tobytes() for part in result)


def by_solver(*qp):
    solver = Solver(*qp)
    first = solver.solve()
    solver.update(q=1.1 * qp[1])
    return first, solver.solve()


QP_WAYS = {
    "solve_qp": lambda *qp: [solve_qp(*qp)],
    "sparse": lambda *qp: [solve_qp(*make_qp(*qp))],
    "Solver": by_solver,
    "solve_batch": lambda P, q, *rest: [solve_batch(P, np.array([q, -q]), *rest)],
}


@pytest.mark.parametrize("way", QP_WAYS)
@pytest.mark.parametrize(("n", "rank"), [(5, 5), (33, 33), (33, 16), (120, 120)])
def test_of_qps(way, n, rank):
    qp = qp_of(n, rank)
    found = set()
    for offset in OFFSETS:
        results = QP_WAYS[way](*(moved(part, offset) for part in qp))
        found.add(bits(v for r in results for v in (r.x, r.y, r.z, r.z_box)))
    assert len(found) == 1


@pytest.mark.parametrize("n", [5, 30, 200])
@pytest.mark.parametrize("skew", [0.0, 0.1])
def test_of_lcps(n, skew):
    P, q = qp_of(n, n)[:2]
    A = P + np.eye(n) + skew * np.triu(np.ones((n, n)))
    found = {
        bits([solve_lcp(moved(A, offset), moved(q, offset)).z]) for offset in OFFSETS
    }
    assert len(found) == 1
