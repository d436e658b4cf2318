"""The interior-point method for sparse QPs, with an active-set refinement."""

from namlcp.qp.path.solve import solve_path
