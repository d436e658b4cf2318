"""Which form a QP has: bounds alone, small or full enough to be dense, or neither."""

from namlcp.qp.bounds import is_box_open
from namlcp.qp.problem import QP

# Up to here a dense QP is small; beyond, its pivots take seconds.
DENSE_VARIABLES = 2000
DENSE_ENTRIES = 16_000_000
# Sparse problems below this many entries are cheaper as dense ones.
SPARSE_ENTRIES = 10_000

# From this density on the matrices of a sparse problem are treated as dense.
FULL = 0.3


def is_small(qp: QP) -> bool:
    """Tell whether the dense form fits."""
    n = qp.q.size
    entries = n * (n + qp.h.size + qp.b.size)
    if n > DENSE_VARIABLES or entries > DENSE_ENTRIES:
        return False
    if qp.is_dense or entries <= SPARSE_ENTRIES:
        return True
    return qp.P.nnz + qp.G.nnz + qp.A.nnz >= FULL * entries


def is_box(qp: QP) -> bool:
    """Tell whether there are bounds and nothing else."""
    return qp.h.size == 0 and qp.b.size == 0 and is_box_open(qp.lb, qp.ub)
