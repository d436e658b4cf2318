"""What a solve returns."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from namlcp.residuals import Residuals
from namlcp.result_base import ResultBase
from namlcp.status import Status

if TYPE_CHECKING:
    from namlcp.derivatives import (
        LCPDerivative,
        LCPGradients,
        LCPTangent,
        QPDerivative,
        QPGradients,
        QPTangent,
    )


class Differentiable:
    """A result that keeps its problem by reference, for its derivatives."""

    def __getstate__(self) -> dict[str, Any]:
        """Leave the problem and the factors behind, in a pickle and in a copy."""
        state = vars(self) | {"problem": None}
        state.pop("derivative", None)
        return state


@dataclass(frozen=True, eq=False, kw_only=True)
class LCPResult(Differentiable):
    """Result of `solve_lcp`; read `status` first.

    Attributes
    ----------
    status : Status
        How the solve ended.
    z, w : (n,) array
        The solution, else the best point found, and w = A z + q; NaN for
        NUMERICAL_ERROR.
    s : (n,) array
        The modulus variable: z = clip(s, lower, upper), w = Omega (z - s), with the
        Omega of a named method, diag(A) for "auto".
    iterations : int
        Sweeps, multigrid cycles, MPRGP iterations, pivots (of the methods of Lemke, and
        Lemke and Howson), cones (enumeration) or else factorisations, by `method`.
    residual : float
        || z - clip(z - w, lower, upper) ||_2, recomputed on the caller's data.
    method : str
        The method that gave the point; for "auto" one of "tridiagonal", "psor",
        "multigrid", "mprgp", "pivoting", and for general matrices "lemke",
        "lemke-howson", "enumeration", "path" (interior), "arc" (smooth homotopy), or
        "start" for a start that one exact step has completed.
    setup_time, solve_time : float
        Seconds.
    ray : (n,) array or None
        With UNSOLVABLE, a vector v that proves it, where one was found: v_i <= 0 where
        u_i is finite, v_i >= 0 where l_i is finite, and q'v + z'A'v <= -1 for all z in
        the box. For the plain LCP: v >= 0, A'v <= 0, q'v = -1. A solution would have
        v'w >= 0, but v'w = q'v + z'A'v < 0.
    message : str
        A sentence that adds to the status, or "".
    history : structured array or None
        The rows of the verbose table, when asked for: one for each iteration, for
        "auto" one for each factorisation or run of sweeps. The residuals are those of
        the iterates; where factorisations are counted, those of the best point so far.

    Notes
    -----
    `backward` and `forward` read the arrays that were given to the solve, which must
    not have been changed since. A result that is pickled or copied goes without them,
    and has no derivatives.

    Examples
    --------
    >>> import namlcp
    >>> result = namlcp.solve_lcp([[2.0, 1.0], [0.0, 1.0]], [-4.0, 1.0])
    >>> result.status.value, result.z, result.w + 0.0
    ('solved', array([2., 0.]), array([0., 1.]))
    >>> namlcp.solve_lcp([[0.0]], [-1.0]).ray  # w = -1 whatever z is
    array([1.])
    """

    status: Status
    z: np.ndarray
    w: np.ndarray
    s: np.ndarray
    iterations: int
    residual: float
    method: str
    setup_time: float
    solve_time: float
    ray: np.ndarray | None = None
    message: str = ""
    history: np.ndarray | None = None
    problem: Any = field(default=None, repr=False)
    """The checked LCP and A as it was given, for the derivatives."""

    def backward(self, dz: Any = None, dw: Any = None) -> "LCPGradients":
        """Return the gradients of a scalar in the data of the LCP.

        Parameters
        ----------
        dz, dw : (n,) array, optional
            The gradients of the scalar in z and w, 0 where absent.

        Returns
        -------
        LCPGradients
            In A, q, lower and upper; its `weak` and `singular` tell where the solution
            is not differentiable.

        Raises
        ------
        ValueError
            The status is not SOLVED, A is a LinearOperator, the result was pickled or
            copied, or an argument has a wrong shape.

        Notes
        -----
        The formulas stand in `namlcp.derivatives.lcp`. A call solves one linear system
        with the transposed matrix of the unknowns between their bounds, by factors that
        the first call makes, or by the multigrid hierarchy of the solve.

        Examples
        --------
        >>> import numpy as np
        >>> import namlcp
        >>> A = np.array([[2.0, 1.0], [0.0, 1.0]])
        >>> result = namlcp.solve_lcp(A, np.array([-4.0, 1.0]))  # z = (2, 0)
        >>> gradients = result.backward(dz=[1.0, 0.0])
        >>> gradients.q + 0.0, gradients.A[0] + 0.0
        (array([-0.5,  0. ]), array([-1.,  0.]))
        """
        return self.derivative.backward(dz, dw)

    def forward(
        self, *, dA: Any = None, dq: Any = None, dlower: Any = None, dupper: Any = None
    ) -> "LCPTangent":
        """Return the derivative of the solution along a direction of the data.

        Parameters
        ----------
        dA, dq, dlower, dupper : arrays, optional
            The direction, shaped as the data, 0 where absent; dA dense or sparse.

        Returns
        -------
        LCPTangent
            The derivatives of z and w.

        Raises
        ------
        ValueError
            As for `backward`.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_lcp([[2.0, 1.0], [0.0, 1.0]], [-4.0, 1.0])
        >>> result.forward(dq=[1.0, 0.0]).z
        array([-0.5,  0. ])
        """
        return self.derivative.forward(dA, dq, dlower, dupper)

    def directional(
        self, *, dA: Any = None, dq: Any = None, dlower: Any = None, dupper: Any = None
    ) -> "LCPTangent":
        """Return the one-sided derivative of the solution along a direction.

        It is exact where unknowns are at a bound with w = 0, too, and not linear in the
        direction there; elsewhere it is that of `forward`. One more LCP is solved.

        Parameters
        ----------
        dA, dq, dlower, dupper : arrays, optional
            As for `forward`. Those of an unknown with lower_i = upper_i must be equal.

        Returns
        -------
        LCPTangent
            The derivatives of z and w for a step of positive length.

        Raises
        ------
        ValueError
            As for `backward`, or the LCP has no solution along the direction.

        Examples
        --------
        >>> import namlcp
        >>> result = namlcp.solve_lcp([[1.0]], [0.0])  # z = w = 0
        >>> [float(result.directional(dq=[d]).z[0]) for d in (-1.0, 1.0)]
        [1.0, 0.0]
        """
        from namlcp.derivatives import lcp_directional

        return lcp_directional(self.derivative, dA, dq, dlower, dupper)

    @cached_property
    def derivative(self) -> "LCPDerivative":
        """The fixed unknowns and the factors of `backward` and `forward`."""
        from namlcp.derivatives import differentiate_lcp

        return differentiate_lcp(self)


class QPResult(ResultBase):
    """Result of `solve_qp`; read `status` first.

    Attributes
    ----------
    status : Status
        How the solve ended, and thus what the arrays hold.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Primal point and multipliers of Ax = b, Gx <= h and the bounds, in qpsolvers'
        signs: P x + q + G'z + A'y + z_box = 0, z >= 0, z_box <= 0 at a lower bound.
        PRIMAL_INFEASIBLE: x is NaN, (y, z, z_box) a Farkas certificate with
        b'y + h'z + lb'z_box^- + ub'z_box^+ = -1. DUAL_INFEASIBLE: x is a ray with
        q'x = -1 (it is not decided whether any x is feasible), the rest NaN. Where two
        bounds contradict each other (lb > ub, h = -inf) all are NaN and `message` names
        the bounds. Otherwise the best point found.
    obj : float
        1/2 x'Px + q'x; +inf when infeasible, -inf when unbounded.
    residuals : Residuals
        Recomputed on the user's unscaled data.
    iterations : int
        Pivots, sweeps or interior-point steps of the solver named by `form`.
    form : str
        The solver that gave the point: "bounds" (box LCP), "dual" (pivots) or "path"
        (interior point); "substitution" if time was over before any began.
    message : str
        A sentence that adds to the status, or "".
    setup_time, solve_time : float
        Seconds.
    history : structured array or None
        The rows of the verbose table, where the form has them.
    closest : ClosestPoint or None
        With PRIMAL_INFEASIBLE, the solution of the nearest feasible problem, if
        `Options.infeasible` asks for it.

    Notes
    -----
    `backward` and `forward` read the arrays that were given to the solve, and raise
    where those have been changed since. A result that is pickled or copied goes without
    them, and has no derivatives.

    Examples
    --------
    >>> import namlcp
    >>> result = namlcp.solve_qp([[2.0]], [-4.0], ub=[1.0])
    >>> result.status.value, result.x, result.z_box, result.obj
    ('solved', array([1.]), array([2.]), -3.0)
    >>> proof = namlcp.solve_qp([[2.0]], [0.0], A=[[2.0]], b=[1.0], lb=[1.0])
    >>> proof.status.value, proof.y, proof.z_box  # y b - 2 lb = -1
    ('primal_infeasible', array([1.]), array([-2.]))
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: float
    residuals: Residuals
    iterations: int
    form: str
    message: str
    setup_time: float
    solve_time: float
    history: np.ndarray | None
    closest: Any

    __slots__ = ()

    def backward(
        self, dx: Any = None, dy: Any = None, dz: Any = None, dz_box: Any = None
    ) -> "QPGradients":
        """Return the gradients of a scalar in the data of the QP.

        Parameters
        ----------
        dx, dy, dz, dz_box : (n,), (p,), (m,), (n,) array, optional
            The gradients of the scalar in x, y, z and z_box, 0 where absent.

        Returns
        -------
        QPGradients
            In P, q, G, h, A, b, lb and ub; its `weak` and `singular` tell where the
            solution is not differentiable.

        Raises
        ------
        ValueError
            The status is not SOLVED, an array of the QP was changed in place since,
            the result was pickled or copied, or an argument has a wrong shape.

        Notes
        -----
        The formulas stand in `namlcp.derivatives.qp`. The first call factors the KKT
        system of the active constraints; later calls, and `forward`, use its factors.

        Examples
        --------
        >>> import numpy as np
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.diag([1.0, 2.0]), [-1.0, -4.0], ub=[2.0, 1.0])
        >>> gradients = result.backward(dx=[1.0, 1.0])  # of x_1 + x_2, x = (1, 1)
        >>> gradients.q, gradients.ub
        (array([-1.,  0.]), array([0., 1.]))
        """
        return self.derivative.backward(dx, dy, dz, dz_box)

    def forward(
        self,
        *,
        dP: Any = None,
        dq: Any = None,
        dG: Any = None,
        dh: Any = None,
        dA: Any = None,
        db: Any = None,
        dlb: Any = None,
        dub: Any = None,
    ) -> "QPTangent":
        """Return the derivative of the solution along a direction of the data.

        Parameters
        ----------
        dP, dq, dG, dh, dA, db, dlb, dub : arrays, optional
            The direction, shaped as the data, 0 where absent; matrices dense or sparse,
            of dP the symmetric part counts.

        Returns
        -------
        QPTangent
            The derivatives of x, y, z and z_box.

        Raises
        ------
        ValueError
            As for `backward`.

        Examples
        --------
        >>> import numpy as np
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.diag([1.0, 2.0]), [-1.0, -4.0], ub=[2.0, 1.0])
        >>> result.forward(dq=[1.0, 0.0], dub=[0.0, 1.0]).x
        array([-1.,  1.])
        """
        changes = dict(P=dP, q=dq, G=dG, h=dh, A=dA, b=db, lb=dlb, ub=dub)
        return self.derivative.forward(changes)

    def directional(
        self,
        *,
        dP: Any = None,
        dq: Any = None,
        dG: Any = None,
        dh: Any = None,
        dA: Any = None,
        db: Any = None,
        dlb: Any = None,
        dub: Any = None,
    ) -> "QPTangent":
        """Return the one-sided derivative of the solution along a direction.

        It is exact where constraints are active with a multiplier 0, too, and not
        linear in the direction there; elsewhere it is that of `forward`.

        Parameters
        ----------
        dP, dq, dG, dh, dA, db, dlb, dub : arrays, optional
            As for `forward`. dlb and dub of a pinned variable must be equal.

        Returns
        -------
        QPTangent
            The derivatives of x, y, z and z_box for a step of positive length.

        Raises
        ------
        ValueError
            As for `backward`, or the QP has no solution along the direction.

        Notes
        -----
        One more QP is solved, see `namlcp.derivatives.directional`.

        Examples
        --------
        >>> import numpy as np
        >>> import namlcp
        >>> result = namlcp.solve_qp(np.eye(1), [0.0], lb=[0.0])  # x = 0, z_box = 0
        >>> [float(result.directional(dq=[d]).x[0]) for d in (-1.0, 1.0)]
        [1.0, 0.0]
        """
        from namlcp.derivatives import qp_directional

        changes = dict(P=dP, q=dq, G=dG, h=dh, A=dA, b=db, lb=dlb, ub=dub)
        return qp_directional(self.derivative, changes)

    @property
    def derivative(self) -> "QPDerivative":
        """The active constraints and factors of `backward` and `forward`."""
        from namlcp.derivatives import differentiate_qp

        return differentiate_qp(self)
