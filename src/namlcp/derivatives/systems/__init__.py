"""Active sets of solved QPs and their KKT systems, dense or sparse."""

from namlcp.derivatives.systems.active import (
    ACTIVE,
    INACTIVE,
    STRICT,
    ActiveSet,
    active_sets,
    mark_dense,
)
from namlcp.derivatives.systems.dense import (
    LEAST_PIVOT,
    SINGULAR,
    SOLVES,
    DenseSystem,
    factor_dense,
    memory_size,
    solve_dense,
)
from namlcp.derivatives.systems.sparse import SparseSystem
