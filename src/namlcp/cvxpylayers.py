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
        rows = numbered(context.reduced_A.problem_data_index)
        n = rows.shape[1] - 1
        self.A, self.G = rows[: dims.zero, :n], rows[dims.zero :, :n]
        self.b, self.h = rows[: dims.zero, n:], rows[dims.zero :, n:]
        self.entries = rows.nnz
        squares = getattr(context.reduced_P, "problem_data_index", None)
        empty = np.empty(0, int), np.zeros(n + 1, int), (n, n)
        self.P = numbered(empty if squares is None else squares)

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
        result = solve_qp(
            filled(self.P, np.empty(0) if P is None else P),
            q[:-1],
            -filled(self.G, A),
            filled(self.h, A).toarray(),
            -filled(self.A, A),
            filled(self.b, A).toarray(),
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
        rows = np.zeros(self.entries)
        rows[self.G.data - 1], rows[self.A.data - 1] = -found.G.data, -found.A.data
        rows[self.h.data - 1] = found.h[self.h.indices]
        rows[self.b.data - 1] = found.b[self.b.indices]
        dP = found.P.data if self.P.nnz else None
        return dP, np.append(found.q, 0.0), rows


def numbered(pattern: tuple[Any, Any, Any]) -> sp.csc_array:
    """Return a matrix with a pattern (indices, indptr, shape) and values 1, 2, ..."""
    indices, indptr, shape = pattern
    M = sp.csc_array((np.arange(1, indices.size + 1), indices, indptr), shape=shape)
    M.sort_indices()
    return M


def filled(numbers: sp.csc_array, values: np.ndarray) -> sp.csc_array:
    """Return a block of a numbered matrix with the values of these numbers."""
    parts = values[numbers.data - 1], numbers.indices, numbers.indptr
    return sp.csc_array(parts, shape=numbers.shape)
