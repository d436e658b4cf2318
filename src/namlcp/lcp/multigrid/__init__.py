"""Truncated multigrid cycles for matrices like those of differential equations."""

from namlcp.lcp.multigrid.cycles import solve_by_multigrid
from namlcp.lcp.multigrid.hierarchy import Hierarchy, build
from namlcp.lcp.multigrid.kernels import ascend
from namlcp.lcp.multigrid.linear import FreeSystem
