"""Convex QPs: `solve_qp`, the forms it chooses from, and what proves an answer."""

from namlcp.qp.active import solve_small
from namlcp.qp.closest import ClosestPoint, Face
from namlcp.qp.convexity import NotConvex
from namlcp.qp.guess import NO_GUESS, make_guess
from namlcp.qp.kkt import KKT
from namlcp.qp.problem import QP, Point, qp_arrays, qp_data
from namlcp.qp.sequences import (
    BatchResult,
    OtherShape,
    Solver,
    available_cores,
    on_threads,
    solve_batch,
)
from namlcp.qp.solve import (
    solve_arguments,
    solve_checked,
    solve_qp,
)
from namlcp.qp.transforms import equilibrate
