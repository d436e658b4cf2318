"""Tridiagonal LCPs by direct elimination."""

from namlcp.lcp.tridiagonal.diagonals import Tridiagonal, tridiagonal_of
from namlcp.lcp.tridiagonal.elimination import solve_faces, solve_tridiagonal
