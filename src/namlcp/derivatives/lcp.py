"""The derivative of the solution of a box LCP in all of its data.

Let B be the unknowns at a bound with w != 0 (and those that lower = upper fixes) and F
the others, where w = 0. Backward, from the gradients (gz, gw) of a scalar in z and w:

    rho_B = gw_B,   A_FF' rho_F = -(gz + A_BF' gw_B)_F,   mu = gz + A'rho  (0 on F)
    g_q = rho,   g_A = rho z',   g_lower, g_upper = mu at the bounds active there

Forward, along a direction of the data, with r = dA z + dq:

    dz_B = dlower or dupper,   A_FF dz_F = -(r + A_FB dz_B)_F,   dw_B = (A dz + r)_B

These hold where no unknown is at a bound with w = 0 and A_FF is regular. Elsewhere the
solution has kinks, and an element of the generalised Jacobian is chosen as for QPs:
unknowns at a bound with w = 0 count as free, or as fixed where A_FF is singular with
them.
"""

from typing import Any

import numpy as np

from namlcp.checks import finite_matrix, finite_vector
from namlcp.derivatives.free_matrix import FreeMatrix, free_matrix
from namlcp.derivatives.gradients import LCPGradients, LCPTangent, RankTwo
from namlcp.derivatives.systems.marks import sides_of_lcp
from namlcp.lcp import LCP, Operator


class LCPDerivative:
    """The derivative of one solution: its fixed unknowns, and the factors of A_FF.

    Attributes
    ----------
    weak : int
        How many unknowns are at a bound with w = 0.
    singular : bool
        Whether A_FF is singular, F all unknowns with w = 0.
    """

    def __init__(self, lcp: LCP, given: Any, z: np.ndarray, w: np.ndarray) -> None:
        """Choose F and factor A_FF; `given`: A as the user holds it."""
        if isinstance(lcp.A, Operator):
            raise ValueError("derivatives need the entries of A, got a LinearOperator")
        self.lcp, self.given, self.z = lcp, given, z
        side, self.weak_side = sides_of_lcp(lcp, z, w)
        self.strict_side = side
        self.weak = int(np.count_nonzero(self.weak_side) - np.count_nonzero(side))
        self.hold(side)
        self.singular = not self.system.regular
        if self.singular and self.weak:
            self.hold(self.weak_side)

    def hold(self, side: np.ndarray) -> None:
        """Factor A_FF for the unknowns with side 0."""
        self.side, self.fixed = side, np.flatnonzero(side)
        self.free = np.flatnonzero(side == 0)
        self.system: FreeMatrix = free_matrix(self.lcp.matrix, self.free)

    def backward(self, dz: Any, dw: Any) -> LCPGradients:
        """Return the gradients of a scalar in the data from those in the solution."""
        A, fixed, side = self.lcp.A, self.fixed, self.side
        gz, gw = self.vector("dz", dz), self.vector("dw", dw)
        rho = np.zeros(gz.size)
        rho[fixed] = gw[fixed]
        right = gz + rho @ A if rho.any() else gz
        rho[self.free] = self.system.solve(-right[self.free], transposed=True)
        lower, upper = np.zeros((2, gz.size))
        if fixed.size:
            mu = gz + rho @ A
            lower[side < 0], upper[side > 0] = mu[side < 0], mu[side > 0]
        matrix = RankTwo(1.0, rho, self.z, 0.0, rho, self.z), self.given
        return LCPGradients((rho, lower, upper), matrix, self.weak, self.singular)

    def forward(self, dA: Any, dq: Any, dlower: Any, dupper: Any) -> LCPTangent:
        """Return the derivative of the solution along a direction of the data."""
        A, fixed, side = self.lcp.A, self.fixed, self.side
        r, dl, du = self.direction(dA, dq, dlower, dupper)
        dz = np.where(side < 0, dl, np.where(side > 0, du, 0.0))
        right = r + A @ dz if dz.any() else r
        dz[self.free] = self.system.solve(-right[self.free], transposed=False)
        dw = np.zeros(dz.size)
        if fixed.size:
            dw[fixed] = (A @ dz + r)[fixed]
        return LCPTangent(dz, dw, self.weak, self.singular)

    def direction(
        self, dA: Any, dq: Any, dlower: Any, dupper: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return dA z + dq, dlower and dupper for a direction of the data."""
        r = self.vector("dq", dq)
        if dA is not None:
            r = r + finite_matrix("dA", dA, "A", self.lcp.A.shape) @ self.z
        return r, self.vector("dlower", dlower), self.vector("dupper", dupper)

    def vector(self, name: str, value: Any) -> np.ndarray:
        """Return a vector of the caller checked, 0 if it is None."""
        if value is None:
            return np.zeros(self.z.size)
        return finite_vector(name, value, self.z.size, "q", self.lcp.q.shape)
