"""Box LCPs: `solve_lcp`, and the methods it chooses from, a room each."""

from namlcp.lcp.auto import LARGE, solve_auto
from namlcp.lcp.modulus import (
    METHODS,
    factored_omega,
    find_method,
    relax_csr,
    spread,
    triangular_parameters,
)
from namlcp.lcp.pivoting import ACCURACY, Outcome, pivot, solve_box
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.solve import solve_lcp

__all__ = [
    "ACCURACY",
    "LARGE",
    "METHODS",
    "Outcome",
    "Prepared",
    "factored_omega",
    "find_method",
    "pivot",
    "relax_csr",
    "solve_auto",
    "solve_box",
    "solve_lcp",
    "spread",
    "triangular_parameters",
]
