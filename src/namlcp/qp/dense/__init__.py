"""The dual active-set method for small and dense QPs."""

from namlcp.qp.dense.solve import solve_dense
