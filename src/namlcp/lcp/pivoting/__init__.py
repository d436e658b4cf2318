"""Principal pivoting in blocks, with an interior path where it stagnates."""

from namlcp.lcp.pivoting.blocks import pivot
from namlcp.lcp.pivoting.driver import ACCURACY, solve_box

__all__ = ["ACCURACY", "pivot", "solve_box"]
