"""Derivatives of the solutions of QPs and LCPs in all of their data.

They take problems, points and factors; the methods of results call them.
"""

from namlcp.derivatives.gradients import (
    BatchGradients,
    LCPGradients,
    LCPTangent,
    QPGradients,
    QPTangent,
    right_sides,
)
from namlcp.derivatives.lcp import LCPDerivative
from namlcp.derivatives.qp import (
    BatchDerivative,
    ClosestDerivative,
    QPDerivative,
)
