"""What one solve leaves to the next of the same shape.

A problem whose matrices stay and whose vectors change (model predictive control, a path
of penalties) needs its presolve, its scaling and, on the same face, its factorisation
once. A problem that keeps only the pattern keeps the elimination order.
"""

from typing import Any, NamedTuple

import numpy as np

from namlcp.checks import QPData
from namlcp.qp.presolve import Presolved
from namlcp.qp.scaling import ScaledQP
from namlcp.qp.substitution import Substitution


class Seen(NamedTuple):
    """A matrix and what it held when it was seen: the caller may change it in place."""

    matrix: Any
    indptr: np.ndarray
    indices: np.ndarray
    data: np.ndarray


class Memory:
    """Kept by the caller from solve to solve; not for two solves at a time.

    Parts are recognised by the identity of their matrices: `recognised` gives equal
    matrices the identity of the last ones.
    """

    def __init__(self) -> None:
        """Begin empty."""
        self.seen: list[Seen] = []
        self.substitution: Substitution | None = None
        self.presolved: Presolved | None = None
        self.problem: ScaledQP | None = None

    def __reduce__(self) -> tuple[type["Memory"], tuple[()]]:
        """Let a copy begin empty: the factors cannot be copied."""
        return Memory, ()

    def known(self, P: Any, G: Any, A: Any) -> list[Any]:
        """Return the matrices of the last QP where these, in CSC, hold the same.

        Those are checked already; the others come back as they are.
        """
        matrices = [P, G, A]
        for k, seen in enumerate(self.seen):
            if holds(matrices[k], seen):
                matrices[k] = seen.matrix
        return matrices

    def recognised(self, qp: QPData) -> QPData:
        """Return qp with the last matrices where they are the same, and remember it."""
        if qp.is_dense:
            return qp
        matrices = [qp.P, qp.G, qp.A]
        for k, M in enumerate(matrices):
            if k < len(self.seen) and holds(M, self.seen[k]):
                matrices[k] = self.seen[k].matrix
                continue
            if k < len(self.seen) and M is self.seen[k].matrix:
                matrices[k] = M = M.copy()
            seen = Seen(M, M.indptr.copy(), M.indices.copy(), M.data.copy())
            self.seen[k : k + 1] = [seen]
        P, G, A = matrices
        return qp._replace(P=P, G=G, A=A)


def holds(M: Any, seen: Seen) -> bool:
    """Tell whether a matrix in CSC has the entries that were seen, one by one."""
    return (
        M.shape == seen.matrix.shape
        and np.array_equal(M.indptr, seen.indptr)
        and np.array_equal(M.indices, seen.indices)
        and np.array_equal(M.data, seen.data)
        and (M is seen.matrix or np.array_equal(seen.matrix.data, seen.data))
    )
