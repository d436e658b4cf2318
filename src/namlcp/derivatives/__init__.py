"""Derivatives of the solutions of QPs and LCPs in all of their data.

`result.py` opens this room when a result is asked for a derivative, not before.
"""

from namlcp.derivatives.gradients import QPGradients, QPTangent
from namlcp.derivatives.qp import QPDerivative, differentiate_qp
