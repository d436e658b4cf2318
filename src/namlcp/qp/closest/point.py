"""What the search for the nearest feasible problem returns."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from namlcp.residuals import Residuals
from namlcp.result import Differentiable
from namlcp.status import Status

if TYPE_CHECKING:
    from namlcp.derivatives import ClosestDerivative, QPGradients


@dataclass(frozen=True, eq=False, kw_only=True)
class ClosestPoint(Differentiable):
    """The solution of the feasible problem nearest to an infeasible QP.

    That problem has the sides h + shift_h, b + shift_b, lb + shift_lb and ub +
    shift_ub, with the least shifts that leave some x feasible; `Relaxation` tells how
    they are measured. x, y, z, z_box and obj are named as in `QPResult`, so that
    ``(result.closest or result).x`` is the x to use in either case.

    Attributes
    ----------
    status : Status
        How the search ended. SOLVED: x has the least cost among all points with least
        shifts. DUAL_INFEASIBLE: that cost falls without bound along the ray x.
        PRIMAL_INFEASIBLE: the constraints that must not be shifted contradict each
        other, or an infinite shift is needed (h_i = -inf); all is NaN, obj inf.
        Otherwise x is
        the best point found, y, z, z_box are NaN, and `message` tells whether the
        shifts are the least ones.
    x, y, z, z_box : (n,), (p,), (m,), (n,) array
        Point and multipliers of the shifted problem. Of its many multipliers (shifted
        rows leave no room) those come with the least multiple of a certificate that
        gives all their sign.
    obj : float
        1/2 x'Px + q'x; -inf if unbounded.
    residuals : Residuals
        Of the shifted problem; NaN unless SOLVED.
    shift_h, shift_b, shift_lb, shift_ub : (m,), (p,), (n,), (n,) array
        The shifts, shift_h and shift_ub >= 0, shift_lb <= 0.
    norm : int
        2 or 1, the norm in which the shifts are least.
    message : str
        A sentence that adds to the status, or "".

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> G, h = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])  # x <= 0 and x >= 3
    >>> result = namlcp.solve_qp(np.eye(1), [0.0], G, h, infeasible="closest")
    >>> result.status.value, result.closest.x, result.closest.shift_h
    ('primal_infeasible', array([1.5]), array([1.5, 1.5]))
    """

    status: Status
    x: np.ndarray
    y: np.ndarray
    z: np.ndarray
    z_box: np.ndarray
    obj: float
    residuals: Residuals
    shift_h: np.ndarray
    shift_b: np.ndarray
    shift_lb: np.ndarray
    shift_ub: np.ndarray
    norm: int
    message: str
    problem: Any = field(default=None, repr=False)
    """The QP with (P, G, A) as they were given, and the stages, for `backward`."""

    def backward(
        self, dx: Any = None, dshift_h: Any = None, dshift_b: Any = None
    ) -> "QPGradients":
        """Return the gradients of a scalar in the data of the infeasible QP.

        Parameters
        ----------
        dx, dshift_h, dshift_b : (n,), (m,), (p,) array, optional
            The gradients of the scalar in x and the shifts, 0 where absent.

        Returns
        -------
        QPGradients
            In P, q, G, h, A, b, lb and ub. If it is `singular`, the shifts leave some
            freedom to x; the gradients in G and A then hold for changes that keep the
            rank of the shifted rows, others make shifts and x jump.

        Raises
        ------
        ValueError
            The status is not SOLVED, the shifts are not those of norm 2, the result
            was pickled or copied, or an argument has a wrong shape.

        Examples
        --------
        >>> import numpy as np
        >>> import namlcp
        >>> G, h = np.array([[1.0], [-1.0]]), np.array([0.0, -3.0])  # x <= 0, x >= 3
        >>> result = namlcp.solve_qp(np.eye(1), np.zeros(1), G, h, infeasible="closest")
        >>> result.closest.x, result.closest.backward(dx=[1.0]).h.round(9)
        (array([1.5]), array([ 0.5, -0.5]))
        """
        return self.derivative.backward(dx, dshift_h, dshift_b)

    @cached_property
    def derivative(self) -> "ClosestDerivative":
        """The factors of `backward`."""
        from namlcp.derivatives import differentiate_closest

        return differentiate_closest(self)
