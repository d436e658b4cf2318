"""Maps from a QP to an easier one: substitution, presolve, scaling, huge bounds.

`Substitution`, `Presolved` and `ScaledQP` have the same methods: `point` maps a point
back to the problem it was made from, `certificate` multipliers that prove it to be
infeasible, `ray` a direction of x; `guess` maps a guess forward.
"""

from namlcp.qp.transforms.huge_bounds import without_huge_bounds
from namlcp.qp.transforms.presolve import Contradiction, Presolved, presolve
from namlcp.qp.transforms.scaling import UNITS, ScaledQP, equilibrate
from namlcp.qp.transforms.substitution import Substitution, substitute

__all__ = [
    "UNITS",
    "Contradiction",
    "Presolved",
    "ScaledQP",
    "Substitution",
    "equilibrate",
    "presolve",
    "substitute",
    "without_huge_bounds",
]
