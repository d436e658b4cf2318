"""Derivatives of the solutions of QPs and LCPs in all of their data.

`result.py` opens this room when a result is asked for a derivative, not before.
"""

from namlcp.derivatives.batch import (
    BatchGradients,
    Found,
    Solved,
    differentiate_batch,
    differentiate_items,
)
from namlcp.derivatives.closest import ClosestDerivative, differentiate_closest
from namlcp.derivatives.directional import lcp_directional, qp_directional
from namlcp.derivatives.gradients import (
    LCPGradients,
    LCPTangent,
    QPGradients,
    QPTangent,
    product_of,
)
from namlcp.derivatives.lcp import LCPDerivative, differentiate_lcp
from namlcp.derivatives.qp import QPDerivative, differentiate_qp
