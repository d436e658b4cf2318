"""Linear complementarity problems and convex quadratic programs, to rounding error.

``solve_lcp(A, q)`` finds z >= 0 with w = A z + q >= 0 and z'w = 0, or solves an LCP
with bounds; ``solve_qp(P, q, G, h, A, b, lb, ub)`` solves a convex QP. ``converges``
and ``is_h_plus`` tell on which matrices the sweep methods converge. Importing the
package makes ``solver="nam"`` known to qpsolvers; ``namlcp.cvxpy`` is for CVXPY,
``namlcp.jax``, ``namlcp.torch`` and ``namlcp.cvxpylayers`` are for learning.

The documentation is in docs/ of the repository, a map of the source code in
src/README.md.
"""

import warnings
from contextlib import suppress
from importlib import import_module
from typing import TYPE_CHECKING, Any

from namlcp.lcp.data import Prepared
from namlcp.options import Options, Relaxation
from namlcp.qp.problem import NotConvex
from namlcp.residuals import Residuals, natural_residual, qp_residuals
from namlcp.results import BatchResult, ClosestPoint, LCPResult, QPResult
from namlcp.solve.lcp import solve_lcp
from namlcp.solve.qp import solve_batch, solve_many, solve_qp
from namlcp.solve.solver import OtherShape, Solver
from namlcp.status import Status
from namlcp.theory.comparison import Verdict, is_h_plus
from namlcp.theory.convergence import converges

if TYPE_CHECKING:  # `__getattr__` below imports these when they are asked for
    from namlcp import cvxpylayers, jax, torch

__all__ = [
    "BatchResult",
    "ClosestPoint",
    "LCPResult",
    "NotConvex",
    "Options",
    "OtherShape",
    "Prepared",
    "QPResult",
    "Relaxation",
    "Residuals",
    "Solver",
    "Status",
    "Verdict",
    "converges",
    "is_h_plus",
    "natural_residual",
    "qp_residuals",
    "solve_batch",
    "solve_lcp",
    "solve_many",
    "solve_qp",
    "warmup",
]
__version__ = "0.2.0"
LATE = "cvxpy", "cvxpylayers", "jax", "scenes", "torch"

# qpsolvers may be in the middle of its own import, of a backend that imports namlcp;
# whatever comes of it, namlcp can be used without.
with suppress(Exception):
    import_module("namlcp.qpsolvers").register()


def __dir__() -> list[str]:
    return sorted([*__all__, *LATE, "qpsolvers", "__version__"])


def __getattr__(name: str) -> Any:
    """Import what is seldom used at its first use: hosts are optional, and slow."""
    if name not in LATE:
        raise AttributeError(f"module 'namlcp' has no attribute {name!r}")
    try:
        return import_module(f"namlcp.{name}")
    except ImportError as error:  # for `hasattr`, and `help(namlcp)`
        raise AttributeError(f"namlcp.{name} cannot be imported: {error}") from error


def warmup(progress: bool = True, processes: int | None = None) -> None:
    """Do nothing: all there is to compile is compiled when namlcp is installed.

    This function goes with the next release; its arguments have no meaning.

    Examples
    --------
    >>> import namlcp
    >>> namlcp.warmup()  # doctest: +SKIP
    """
    warnings.warn(
        "namlcp.warmup() does nothing: namlcp is compiled when it is installed; the "
        "next release goes without it",
        DeprecationWarning,
        stacklevel=2,
    )
