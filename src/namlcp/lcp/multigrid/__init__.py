"""Truncated multigrid cycles for matrices like those of differential equations."""

from namlcp.lcp.multigrid.cycles import MAX_CYCLES, solve_multigrid
from namlcp.lcp.multigrid.hierarchy import Hierarchy, build
from namlcp.lcp.multigrid.kernels import ascend

__all__ = ["MAX_CYCLES", "Hierarchy", "ascend", "build", "solve_multigrid"]
