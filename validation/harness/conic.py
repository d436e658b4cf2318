"""QPs in conic form.

``minimise 1/2 x'Px + q'x  subject to  C x + s = d``, s = 0 in the first p rows, s >= 0
below: the equalities, Gx <= h, then the finite upper and lower bounds.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem, Solution

from validation.harness import qps


def stacked(problem: Problem) -> tuple[sp.csr_array, np.ndarray, int]:
    """Return C, d and p of the conic form; infinite h stay in d."""
    _, q, G, h, A, b, lb, ub = qps.parts(problem)
    eye = sp.csr_array(sp.eye_array(q.size, format="csr"))
    up, low = np.isfinite(ub), np.isfinite(lb)
    C = sp.vstack([sp.csr_array(A), sp.csr_array(G), eye[up], -eye[low]])
    return sp.csr_array(C), np.concatenate([b, h, ub[up], -lb[low]]), b.size


def unstacked(problem: Problem, x: Any, multipliers: Any, found: bool) -> Solution:
    """Return x and the multipliers of the rows of C as a solution of qpsolvers."""
    *_, h, _, b, lb, ub = qps.parts(problem)
    up, low = np.isfinite(ub), np.isfinite(lb)
    v = np.asarray(multipliers, dtype=float)
    y, z, above, below = np.split(v, np.cumsum([b.size, h.size, up.sum()]))
    answer = Solution(problem, found=found, x=np.asarray(x, dtype=float), y=y, z=z)
    answer.z_box = np.zeros(answer.x.size)
    answer.z_box[up] += above
    answer.z_box[low] -= below
    return answer
