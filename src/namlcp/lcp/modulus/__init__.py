"""The paper's sweeps: one family of modulus-based splittings, and its parameters."""

from namlcp.lcp.modulus.factored import dense_solver, sparse_solver
from namlcp.lcp.modulus.methods import EXACT, METHODS, find_method, spread
from namlcp.lcp.modulus.sweeps import factored_omega, sweep, triangular_parameters

__all__ = [
    "EXACT",
    "METHODS",
    "dense_solver",
    "factored_omega",
    "find_method",
    "sparse_solver",
    "spread",
    "sweep",
    "triangular_parameters",
]
