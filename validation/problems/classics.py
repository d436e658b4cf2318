"""Two LCPs without friction: a membrane and a pile of discs."""

import numpy as np
import scipy.sparse as sp


def forced_obstacle(m: int) -> tuple[sp.csr_array, np.ndarray]:
    """Return LCP(q, A): a membrane on the unit square that may not go below zero.

    A is the five-point Laplacian on m x m interior nodes times h^2; the load is
    50 sin(3 pi x) sin(3 pi y), h = 1/(m + 1).
    """
    h = 1.0 / (m + 1)
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(m, m))
    one = sp.eye_array(m)
    A = sp.csr_array(sp.kron(line, one) + sp.kron(one, line))
    wave = np.sin(3.0 * np.pi * h * np.arange(1, m + 1))
    return A, -50.0 * h**2 * np.outer(wave, wave).ravel()


def disc_pile(rows: int) -> tuple[sp.csr_array, np.ndarray]:
    """Return LCP(q, A): frictionless contact forces in a hexagonal pile of discs.

    Unit discs of random mass (seed 0) lie in `rows` rows of decreasing length on a
    floor and between the walls of a wedge. With normals N (2 bodies x contacts), masses
    M and free velocity v after one step of gravity, the impulses z >= 0 solve
    N'M^-1 N z + N'v >= 0 (Moreau-Jean, no restitution). There are more contacts than
    degrees of freedom, so that A is singular.
    """
    place = [(2 * i + r, r) for r in range(rows) for i in range(rows - r)]
    index, high = {at: k for k, at in enumerate(place)}, np.sqrt(0.75)
    steps = ((2, 0), (1.0, 0.0)), ((1, 1), (0.5, high)), ((-1, 1), (-0.5, high))
    touches = []
    for (i, r), k in index.items():
        for step, normal in steps:
            other = index.get((i + step[0], r + step[1]))
            if other is not None:
                touches.append((k, other, normal))
        sides = (
            (r == 0, (0.0, 1.0)),
            (i == r, (high, -0.5)),
            (i == 2 * rows - 2 - r, (-high, -0.5)),
        )
        touches += [(-1, k, normal) for is_there, normal in sides if is_there]
    first, second, normals = map(np.array, zip(*touches, strict=True))
    body, along = np.append(first, second), np.vstack((-normals, normals))
    moved = np.flatnonzero(body >= 0)
    rows_of_N = 2 * body[moved, None] + np.arange(2)
    columns_of_N = np.repeat(moved % len(touches), 2)
    entries = along[moved].ravel(), (rows_of_N.ravel(), columns_of_N)
    size = 2 * len(place)
    N = sp.csr_array(entries, shape=(size, len(touches)))
    mass = np.repeat(np.random.default_rng(0).uniform(0.5, 2.0, len(place)), 2)
    velocity = np.zeros(size)
    velocity[1::2] = -9.81e-3
    A = sp.csr_array(N.T @ sp.diags_array(1.0 / mass) @ N)
    return A, N.T @ velocity
