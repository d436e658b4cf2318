"""Sweep methods: modulus-based matrix splittings for box LCPs, and their parameters."""

from namlcp.lcp.modulus.methods import (
    METHODS,
    SOLVERS,
    Parameters,
    checked_parameters,
    find_method,
    spread,
)
from namlcp.lcp.modulus.sweeps import sweep
