"""Principal pivoting in blocks, with an interior path where it stagnates."""

from namlcp.lcp.pivoting.driver import ACCURACY, solve_box
from namlcp.lcp.pivoting.pivot import pivot

__all__ = ["ACCURACY", "pivot", "solve_box"]
