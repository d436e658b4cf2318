"""Maps from a QP to an easier one: substitution, presolve, scaling, far sides."""

from namlcp.qp.transforms.far_sides import confirmed, without_far_sides
from namlcp.qp.transforms.presolve import Contradiction, Presolved, presolve
from namlcp.qp.transforms.scaling import UNITS, ScaledQP, equilibrate
from namlcp.qp.transforms.substitution import Substitution, substitute

__all__ = [
    "UNITS",
    "Contradiction",
    "Presolved",
    "ScaledQP",
    "Substitution",
    "confirmed",
    "equilibrate",
    "presolve",
    "substitute",
    "without_far_sides",
]
