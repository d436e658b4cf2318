"""LCPs with matrices that are neither P nor semidefinite.

A problem is (A, q) or (A, q, lower, upper); a generator takes a numpy Generator.
"""

import numpy as np
from problems_lcp import DATA
from scipy import sparse

INF = np.inf


def friction(rng, bodies, mu=0.5, ratio=1.0, directions=2, others=0):
    """Return A, q of a time step with friction, three random contacts a body.

    Stewart and Trinkle, Int. J. Numer. Meth. Engng 39 (1996) 2673-2691: z = (normal
    impulses, tangential ones in pairs of opposite directions, those of `others`,
    sliding speeds). Bodies have masses between 1 and `ratio`, and two or three degrees
    of freedom.
    """
    freedoms = 2 if directions == 2 else 3
    count = 3 * bodies
    pairs = np.stack([np.arange(count) % bodies, rng.integers(-1, bodies, count)])
    normals, tangents = [], []
    for a, b in pairs.T:
        frame = np.linalg.qr(rng.standard_normal((freedoms, freedoms)))[0]
        normal, tangent = frame[0], frame[1:]
        if b < 0 and normal[-1] < 0.0:
            normal = -normal  # from the ground up
        row = np.zeros((1 + directions, bodies, freedoms))
        angles = 2.0 * np.pi * np.arange(directions) / directions
        circle = np.stack([np.cos(angles), np.sin(angles)], 1)[:, : freedoms - 1]
        row[:, a] = np.vstack([normal, circle @ tangent])
        if b >= 0 and b != a:
            row[:, b] = -row[:, a]
        normals.append(row[0].ravel())
        tangents.append(row[1:].reshape(directions, -1))
    ends = rng.standard_normal((others, bodies * freedoms))
    J = np.vstack([*normals, *tangents, ends * (rng.random(ends.shape) < 2.0 / bodies)])
    masses = ratio ** rng.random(bodies)
    W = J / np.repeat(masses, freedoms) @ J.T
    velocity = rng.standard_normal((bodies, freedoms))
    velocity[:, -1] -= 1.0
    E = sparse.kron(sparse.eye_array(count), np.ones((directions, 1)))
    nothing = sparse.csr_array((count, others))
    left = sparse.hstack([mu * sparse.eye_array(count), -E.T, nothing])
    right = sparse.vstack([sparse.csr_array((count, count)), E, nothing.T])
    A = sparse.csr_array(sparse.block_array([[W, right], [left, None]]))
    return A, np.concatenate([J @ velocity.ravel(), np.zeros(count)])


def machine(rng, bodies, joints, motors):
    """Return A, q, lower, upper of `friction` with joints and with motors that slip."""
    A, q = friction(rng, bodies, others=joints + motors)
    lower, upper = np.zeros(q.size), np.full(q.size, INF)
    first = 9 * bodies
    lower[first : first + joints] = -INF
    motor = slice(first + joints, first + joints + motors)
    lower[motor], upper[motor] = -0.3, 0.3
    return A, q, lower, upper


def mixed(rng, n):
    """Return A, q, lower, upper with planted z: unknowns with all kinds of bounds.

    A is not semidefinite: B'B plus entries of any sign.
    """
    B, N = rng.standard_normal((2, n, n))
    A = B.T @ B / n + 0.5 * N
    kind = np.arange(n) % 5  # free, lower, upper, two bounds, fixed
    z = rng.standard_normal(n)
    lower = np.where((kind == 0) | (kind == 2), -INF, z - rng.random(n))
    upper = np.where((kind == 0) | (kind == 1), INF, z + rng.random(n))
    lower[kind == 4] = upper[kind == 4] = z[kind == 4]
    at_lower = (rng.random(n) < 0.4) & (lower > -INF) & (kind != 4)
    at_upper = (rng.random(n) < 0.4) & (upper < INF) & (kind != 4) & ~at_lower
    lower[at_lower], upper[at_upper] = z[at_lower], z[at_upper]
    w = rng.random(n) * (1.0 * at_lower - 1.0 * at_upper)
    return A, w - A @ z, lower, upper


def closing_walls(mu=0.5):
    """Return A, q of two blocks that two walls press together faster than they yield.

    Unknowns: the impulses at three frictionless contacts in a row and at a wall that
    moves; no impulse stops the walls: W v = 0 and q'v < 0 for v = (1, 1, 1).
    """
    J = np.array([[1.0, 0.0], [-1.0, 1.0], [0.0, -1.0]])
    W = np.block([[J @ J.T, np.zeros((3, 1))], [np.zeros((1, 3)), np.zeros((1, 1))]])
    W[3, :3] = mu  # not semidefinite: a row without its column
    return W, np.array([-1.0, 0.0, -1.0, 1.0])


def game(R, S):
    """Return A, q of the equilibria of two players with costs x'R y and x'S y, > 0."""
    zero = np.zeros((R.shape[0],) * 2), np.zeros((R.shape[1],) * 2)
    return np.block([[zero[0], R], [S.T, zero[1]]]), -np.ones(sum(R.shape))


def collection():
    """Return {name: (A, q)} of the general problems in the data folder."""
    found = {}
    for path in sorted((DATA / "general").glob("*.npz")):
        with np.load(path) as f:
            if "A" in f:
                found[path.stem] = np.ascontiguousarray(f["A"]), f["q"]
                continue
            # payoffs of two players; costs must be positive
            found[path.stem] = game(*(f[name].max() - f[name] + 1.0 for name in "RC"))
    return found
