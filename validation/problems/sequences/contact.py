"""Time steps of discs in a box that is shaken (Moreau's scheme, without friction).

    minimise  v'M v / 2 - v'M(v_old + dt g + kicks)   subject to  N'v >= -gap / dt

for the velocities v; then positions += dt v. The normals N stay those of the heap at
rest, for small motions, so that only q and h change. The gaps are open at first; then
the discs rattle, and contacts close and open. Units: dt = g = 1.
"""

import itertools

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem

from validation.problems.contact_scenes import heap_of_discs
from validation.problems.sequences.sequence import LEVELS, Sequence, Steps

KICK = dict(zip(LEVELS, (0.01, 0.1, 1.0), strict=True))
"""Standard deviation of random changes of the velocities, over dt g."""
GAP = 1.0  # the gaps of the heap at rest: what a disc falls in the first step
MASSES = 10.0  # the largest mass over the least


def shaken_heap(contacts: int, level: str) -> Sequence:
    """Return the sequence with about so many contacts, sparse."""
    heap = heap_of_discs(contacts, True, MASSES, seed=contacts)
    G = sp.csc_matrix(-heap.N.T)
    n, m = heap.mass.size, G.shape[0]
    mass = heap.mass
    problem = Problem(
        sp.csc_matrix(sp.diags_array(mass)), np.zeros(n), G, np.full(m, GAP)
    )

    def steps() -> Steps:
        rng = np.random.default_rng(contacts)
        v, moved = np.zeros(n), np.zeros(n)
        for _ in itertools.count():
            free = v + KICK[level] * rng.standard_normal(n)
            free[1::2] -= 1.0
            h = GAP - G @ moved
            found = yield {"q": -mass * free, "h": h}
            v = np.zeros(n) if found is None else found
            moved = moved + v

    return Sequence(problem, steps())
