"""Active sets of solved QPs and their KKT systems, dense or sparse."""

from namlcp.derivatives.systems.active import ActiveSet, active_sets
from namlcp.derivatives.systems.cholesky import CholeskySystem
from namlcp.derivatives.systems.dense import SINGULAR, DenseSystem
from namlcp.derivatives.systems.sparse import SparseSystem
