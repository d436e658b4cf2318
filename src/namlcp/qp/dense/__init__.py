"""Small and full QPs: pivots on the multipliers' LCP."""

from namlcp.qp.dense.solve import solve_dense

__all__ = ["solve_dense"]
