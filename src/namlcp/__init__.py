"""Linear complementarity problems and convex quadratic programs, solved exactly.

``solve_lcp(A, q)`` finds z >= 0 with w = A z + q >= 0 and z'w = 0 (or its box form);
``solve_qp(P, q, G, h, A, b, lb, ub)`` solves a convex QP. Importing the package makes
``solver="nam"`` known to qpsolvers.

A folder is a room, entered by what its ``__init__`` exports. It calls those below it:

- `qpsolvers`, `cvxpy`, `cli`: other people's names and files, given to `solve_qp`;
- `qp`: any arrays -> `QP` (checked) -> transforms to an easier QP -> an LCP in bounds,
  dense pivots or interior points -> the point back through the transforms -> residuals
  on the caller's data decide -> `QPResult`;
- `theory`: on which matrices the sweeps converge, with proofs (`converges`);
- `lcp`: any arrays -> `Prepared` and `LCP` (checked) -> unit diagonal -> elimination,
  the paper's sweeps, multigrid cycles or pivots -> residual on the caller's data ->
  `LCPResult`;
- `residuals`, `result`, `limits`, `options`, `status`, `progress`, `checks`: for all;
- `linalg`: products, orderings and factorisations, dense and sparse;
- `compiled`: the decorators of compiled functions, and the files of machine code.
"""

from importlib import import_module
from typing import Any

from namlcp.lcp import Prepared, solve_lcp
from namlcp.options import Options
from namlcp.qp import solve_qp
from namlcp.qpsolvers import register
from namlcp.residuals import Residuals, natural_residual, qp_residuals
from namlcp.result import LCPResult, QPResult
from namlcp.status import Status
from namlcp.theory import Verdict, converges, is_h_plus

__all__ = [
    "LCPResult",
    "Options",
    "Prepared",
    "QPResult",
    "Residuals",
    "Status",
    "Verdict",
    "converges",
    "is_h_plus",
    "natural_residual",
    "qp_residuals",
    "solve_lcp",
    "solve_qp",
    "warmup",
]
__version__ = "0.1.0"

register()


def __getattr__(name: str) -> Any:
    """Import on first use what few need: CVXPY is optional, and slow to import."""
    if name == "cvxpy":
        return import_module("namlcp.cvxpy")
    if name == "warmup":
        return import_module("namlcp.first_use").warmup
    raise AttributeError(f"module 'namlcp' has no attribute {name!r}")
