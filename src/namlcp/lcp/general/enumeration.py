"""Tiny LCPs by all their complementary cones: a solution, or a proof of none.

LCP(q, A) has a solution if and only if q lies in one of the 2^n cones pos C(F), where F
is a set of indices and C(F) has the columns -A e_i for i in F, e_i for the others:
then z_F and w_B with C(F) (z_F, w_B) = q solve it. If C(F) is regular, each row r of
its inverse with r q < 0 is a plane that separates q from the cone, at the distance
-r q / |r|. Where that leaves it open, the distance is found by least squares.

References
----------
Cottle, Pang and Stone, The Linear Complementarity Problem (1992), section 1.3.
"""

import numpy as np

from namlcp.lcp.general.search import Search
from namlcp.status import Outcome, Status

# Largest order: its 4096 cones take some hundredths of a second.
LARGEST_ENUMERATION = 12
# Message of a proof.
ENUMERATED = "no complementary cone contains q: all were enumerated"
# Distance of q from a cone, relative to |q|, that rounding cannot explain.
OUTSIDE = 1e-9


def solve_by_enumeration(search: Search) -> Outcome | None:
    """Return a solution, or UNSOLVABLE if q is clearly outside every cone, else None.

    None, too, if the plain form is of a larger order. Iterations are the cones.
    """
    lcp, plain = search.lcp, search.plain
    if plain is None or not 1 <= plain.r.size <= LARGEST_ENUMERATION:
        return None
    m = plain.r.size
    from scipy.optimize import nnls  # takes long to import

    size = float(np.linalg.norm(plain.r)) or 1.0
    faces = (np.arange(2**m)[:, None] >> np.arange(m)) % 2 == 1
    cones = np.where(faces[:, None, :], -plain.M, np.eye(m))
    best, nearest = lcp.start(), np.inf
    least = np.zeros(2**m)  # distance of q, at least, 0 where the cone is singular
    regular = np.linalg.slogdet(cones)[0] != 0.0
    inverse = np.linalg.inv(cones[regular])
    apart = -(inverse @ plain.r) / np.linalg.norm(inverse, axis=2)
    least[regular] = apart.max(axis=1)
    for k in np.flatnonzero(least <= OUTSIDE * size):
        if search.limits.deadline.reached():
            return None
        x, distance = nnls(cones[k], plain.r)
        z = lcp.start(plain.z(np.where(faces[k], x, 0.0)))
        if distance < nearest:
            nearest, best = distance, z
        if distance <= OUTSIDE * size and search.accepts(z, lcp.w(z)):
            count = int(k) + 1
            return lcp.outcome(Status.SOLVED, z, lcp.w(z), count, "enumeration")
    if nearest <= OUTSIDE * size:
        return None
    status, w = Status.UNSOLVABLE, lcp.w(best)
    return lcp.outcome(status, best, w, 2**m, "enumeration", ENUMERATED)
