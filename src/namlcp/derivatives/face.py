"""The constraints of a solved QP that its derivative holds, as `qp` describes the rule.

They are the strictly active ones, if their KKT matrix is regular; else independent ones
among them, if need be with the weakly active ones.
"""

from namlcp.derivatives.dependent import basic, dependencies
from namlcp.derivatives.systems import (
    ActiveSet,
    CholeskySystem,
    DenseSystem,
    SparseSystem,
    active_sets,
)
from namlcp.qp import QP, Point


class Face:
    """The constraints held, and the factors of their KKT matrix K.

    Attributes
    ----------
    active, whole : ActiveSet
        The constraints held, and all that are active.
    at_lower, at_upper, fixed : (n,) bool array
        Which variables are held at a bound.
    point : Point
        The solution, with multipliers that are 0 for constraints that are not held.
    system : DenseSystem or SparseSystem
        The factors.
    weak : int
        How many constraints are active with a multiplier 0.
    singular : bool
        Whether K is singular with the strictly active constraints alone.
    """

    def __init__(
        self, qp: QP, solution: Point, factors: CholeskySystem | None = None
    ) -> None:
        """Choose the constraints, and factor unless `factors` of dense ones are there.

        These belong to the strictly active constraints.
        """
        self.qp = qp
        strict, self.whole, self.weak = active_sets(qp, solution)
        self.hold(strict, solution, factors)
        self.singular = not self.system.regular
        if self.singular:
            self.hold_independent()
        if not self.system.regular and self.weak:
            self.hold(self.whole, solution)
            self.hold_independent()

    def hold_independent(self) -> None:
        """Leave out active constraints that depend on others, if there are any."""
        found = dependencies(self.qp, self.active, self.system.null_space)
        if found.number:
            self.hold(*basic(self.qp, self.active, self.point, found))

    def hold(
        self, active: ActiveSet, point: Point, factors: CholeskySystem | None = None
    ) -> None:
        """Hold active constraints; `point` has their multipliers."""
        self.active, self.point = active, point
        self.at_lower, self.at_upper = active.side < 0, active.side > 0
        self.fixed = active.side != 0
        self.system = system_of(self.qp, active, factors)


def system_of(
    qp: QP, active: ActiveSet, factors: CholeskySystem | None = None
) -> DenseSystem | SparseSystem:
    """Return the KKT system of an active set, factored unless `factors` are there."""
    if qp.is_dense:
        return DenseSystem(qp, active, factors)
    return SparseSystem(qp, active)
