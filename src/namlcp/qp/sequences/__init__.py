"""Many QPs: one after the other by a `Solver`, or at once by `solve_batch`."""

from namlcp.qp.sequences.batch import (
    BatchResult,
    available_cores,
    on_threads,
    solve_batch,
)
from namlcp.qp.sequences.pattern import OtherShape
from namlcp.qp.sequences.solver import Solver
