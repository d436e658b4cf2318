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
from namlcp.qp.intake import qp_data, stamp_of
from namlcp.qp.kkt import KKT, equilibrate
from namlcp.qp.problem import (
    NO_GUESS,
    QP,
    Guess,
    NotConvex,
    Point,
    check_warm_start,
    make_guess,
    qp_arrays,
)
from namlcp.qp.route import Memory, solve_checked
