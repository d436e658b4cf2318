"""QPs that are solved again and again: `Solver` keeps what the next solve can use."""

from namlcp.qp.sequences.solver import Solver
