"""The solver interface of cvxpylayers 1.2: ``CvxpyLayer(..., solver=NAM())``.

cvxpylayers writes the problem of its layer as

    minimise  1/2 x'Px + q'x   subject to  b - A x = 0,  h - G x >= 0

and hands over the values of P, of (q, offset) and of the matrix ``[-A b; -G h]``, each
on a sparse pattern that is known once, at `NAM.setup`. It works with the layer for
PyTorch. That for JAX fails in cvxpylayers 1.2.0 for every solver interface of this kind
(it asks None for ``jax_to_data``); `namlcp.jax.solve_qp` differentiates in JAX. CVXPY's
own ``Problem.backward`` admits no other solver than DIFFCP.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from cvxpylayers.interfaces.base import SolverInterface

from namlcp.derivatives.gradients import rank_two_on
from namlcp.results import QPResult
from namlcp.solve.qp import solve_qp
from namlcp.status import Status

# The fields of CVXPY's cone dimensions for which a problem is not a QP.
OTHER_CONES = "exp", "soc", "psd", "p3d", "pnd"


class NAM(SolverInterface):
    """Solver of the QPs of one ``CvxpyLayer``, and of their derivatives.

    ``solver_args`` of the layer are the fields of `namlcp.Options`. Batches and dual
    variables work; gradients are exact (`namlcp.QPResult.backward`). A problem with
    other constraints than equations and inequalities (second-order cones, ...) raises
    ValueError when the layer is made, one that is not solved RuntimeError.

    Examples
    --------
    >>> import cvxpy as cp
    >>> import torch
    >>> from cvxpylayers.torch import CvxpyLayer
    >>> from namlcp.cvxpylayers import NAM
    >>> x, c = cp.Variable(2), cp.Parameter(2)
    >>> problem = cp.Problem(cp.Minimize(cp.sum_squares(x - c)), [x <= 1])
    >>> layer = CvxpyLayer(problem, parameters=[c], variables=[x], solver=NAM())
    >>> point = torch.tensor([0.5, 3.0], dtype=torch.float64, requires_grad=True)
    >>> solution, = layer(point)
    >>> solution.sum().backward()
    >>> print((point.grad + 0.0).round(decimals=9).tolist())
    [1.0, 0.0]
    """

    canon_solver = "CLARABEL"
    supports_quad_obj = True

    def setup(self, context: Any) -> None:
        dims = context.cone_dims
        cones = [name for name in OTHER_CONES if np.size(getattr(dims, name, 0) or ())]
        if cones:
            raise ValueError(
                f"the problem must be a QP, got cones of the kinds {', '.join(cones)}"
            )
        self.rows = context.reduced_A.problem_data_index
        self.squares: Any = getattr(context.reduced_P, "problem_data_index", None)

    def solve_numpy(
        self,
        P: np.ndarray | None,
        q: np.ndarray,
        A: np.ndarray,
        dims: Any,
        solver_args: dict[str, Any],
        needs_grad: bool,
    ) -> tuple[np.ndarray, np.ndarray, QPResult]:
        """Return x, (y, z) and the result, for values on the patterns."""
        n, p, rows = q.size - 1, dims.zero, filled(self.rows, A)
        result = solve_qp(
            sp.csc_array((n, n)) if P is None else filled(self.squares, P),
            q[:n],
            -rows[p:, :n],
            rows[p:, n:].toarray(),
            -rows[:p, :n],
            rows[:p, n:].toarray(),
            **solver_args,
        )
        if result.status is not Status.SOLVED:
            raise RuntimeError(
                f"namlcp: {result.status.value}. {result.status.explanation}"
            )
        return result.x, np.concatenate((result.y, result.z)), result

    def derivative_numpy(
        self, dprimal: np.ndarray, ddual: np.ndarray, saved_state: QPResult
    ) -> tuple[np.ndarray | None, np.ndarray, np.ndarray]:
        """Return the gradients in the values of P, of (q, offset) and of the rows."""
        p = saved_state.y.size
        found = saved_state.backward(dx=dprimal, dy=ddual[:p], dz=ddual[p:])
        x, y, z, _ = saved_state.derivative.point
        v, slopes = np.append(y, z), np.append(found.b, found.h)
        pattern = filled(self.rows, np.ones(self.rows[0].size))
        of_q = np.append(found.q, 0.0)
        rows = rank_two_on(pattern, -v, of_q, slopes, np.append(x, 1.0))
        return None if self.squares is None else found.P.data, of_q, rows.data


def filled(pattern: tuple[Any, Any, Any], values: np.ndarray) -> sp.csc_array:
    """Return the matrix of a pattern (indices, indptr, shape) with these values."""
    indices, indptr, shape = pattern
    return sp.csc_array((values, indices, indptr), shape=shape)
