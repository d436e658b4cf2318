"""Principal pivoting in blocks, with an interior path where it stagnates."""

from namlcp.lcp.pivoting.blocks import pivot
from namlcp.lcp.pivoting.driver import ACCURACY, MAX_ITER, Outcome, solve_box

__all__ = ["ACCURACY", "MAX_ITER", "Outcome", "pivot", "solve_box"]
