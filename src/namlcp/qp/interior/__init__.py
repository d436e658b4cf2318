"""The interior-point method for sparse QPs, with an active-set refinement."""

from namlcp.qp.interior.loop import solve_interior
