"""Convex QPs: the forms a solve chooses from, and what proves an answer."""

from namlcp.qp.active import solve_small
from namlcp.qp.active.dense import DenseActiveSet
from namlcp.qp.active.engine import Code
from namlcp.qp.batch import (
    STATUSES,
    Items,
    available_cores,
    chunks_of,
    on_threads,
    solve_items,
)
from namlcp.qp.closest import Face, Nearest
from namlcp.qp.convexity import NotConvex
from namlcp.qp.guess import NO_GUESS, Guess, check_warm_start, make_guess
from namlcp.qp.intake import qp_data, stamp_of
from namlcp.qp.kkt import KKT
from namlcp.qp.memory import Memory
from namlcp.qp.problem import QP, Point, qp_arrays
from namlcp.qp.solve import solve_checked
from namlcp.qp.transforms import equilibrate
