"""The public functions that solve: engines below, results in the end."""

from namlcp.solve.batch import solve_batch
from namlcp.solve.lcp import solve_lcp
from namlcp.solve.qp import solve_arguments, solve_qp
from namlcp.solve.solver import OtherShape, Solver
