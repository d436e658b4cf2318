"""Two-dimensional contact scenes of any size, without friction: heaps and walls.

Every scene is the LCP of one time step of rigid bodies (Moreau-Jean, no restitution).
With normals N (degrees of freedom x contacts), masses M and free velocity v after a
step of gravity, the impulses z >= 0 solve

    w = A z + q >= 0,   z'w = 0,   A = N'M^-1 N,   q = N'v.

All have a solution, for bodies at rest are feasible: the LCP is the dual of the nearest
velocity, in the norm of M, that separates no two bodies. More contacts than degrees of
freedom make A singular.
"""

from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from validation.problems.known_scenes import BoxLCP, nonnegative

STEP = 0.01  # gravity times the time step
JITTER = 0.1  # of the centres, the radius is 1
HOLES = 0.05  # share of the discs taken out


class Heap(NamedTuple):
    """Normals, masses and velocities by degree of freedom, and where the discs are."""

    N: sp.csr_array
    mass: np.ndarray
    velocity: np.ndarray
    centre: np.ndarray


def heap(
    contacts: int, *, sideways: bool = False, mass_ratio: float = 1e4, seed: int = 0
) -> BoxLCP:
    """Return a square heap of discs in a box, of about so many contacts.

    The centres are those of a hexagonal lattice, moved at random. A disc lies on two
    discs below, or on one and a wall: N has full rank, body by body from above. With
    `sideways` it touches both neighbours of its row too: A is singular. Some discs are
    taken out again and all move a little, so that contacts open.
    """
    return scene(*heap_of_discs(contacts, sideways, mass_ratio, seed)[:3])


def heap_of_discs(contacts: int, sideways: bool, mass_ratio: float, seed: int) -> Heap:
    """Return the bodies of `heap`."""
    rng = np.random.default_rng(seed)
    side = max(2, round(np.sqrt(contacts / (2.75 if sideways else 1.85))))
    discs = side * side
    body = np.arange(discs)
    row, place = np.divmod(body, side)
    centre = np.column_stack((2.0 * place + row % 2, np.sqrt(3.0) * row))
    centre += JITTER * rng.uniform(-1.0, 1.0, (discs, 2))
    first, second, direction = [], [], []

    def add(who: np.ndarray, step: np.ndarray, drop: int, wall: float) -> None:
        """Let discs touch those `step` places on, `drop` rows below, or else a wall."""
        at = place[who] + step
        inside = (at >= 0) & (at < side)
        other = np.where(inside, (row[who] - drop) * side + at, -1)
        line = centre[who] - centre[other]
        line[~inside] = wall, 0.0
        line /= np.linalg.norm(line, axis=1, keepdims=True)
        first.append(other)
        second.append(who)
        direction.append(line)

    upper = body[row > 0]
    add(upper, row[upper] % 2 - 1, 1, 1.0)
    add(upper, row[upper] % 2, 1, -1.0)
    if sideways:
        add(body, np.full(discs, -1), 0, 1.0)
    first.append(np.full(side, -1))
    second.append(body[:side])
    direction.append(np.tile([0.0, 1.0], (side, 1)))
    one, two, up = (np.concatenate(parts) for parts in (first, second, direction))
    present = rng.random(discs) >= HOLES
    there = present[two] & (present[one] | (one < 0))
    N = normals(one[there], two[there], -up[there], up[there], discs)
    mass = np.repeat(mass_ratio ** rng.random(discs), 2)
    velocity = 0.5 * STEP * rng.standard_normal(2 * discs)
    velocity[1::2] -= STEP
    return Heap(N, mass, velocity, centre)


def brick_wall(contacts: int, *, mass_ratio: float = 1e4, seed: int = 0) -> BoxLCP:
    """Return a dry wall of bricks 2 x 1 in running bond, of about so many contacts.

    A brick lies on the halves of two others, two points each, and touches both
    neighbours of its course in two points: six contacts a brick against three degrees
    of freedom. Single bricks are pushed at random.
    """
    rng = np.random.default_rng(seed)
    courses = max(2, round(np.sqrt(contacts / 6.0)))
    bricks = courses * courses
    row, place = np.divmod(np.arange(bricks), courses)
    x, y = 2.0 * place + row % 2, row + 0.5
    first, second, points, direction = [], [], [], []

    def add(lower: np.ndarray, upper: np.ndarray, at: np.ndarray, up: bool) -> None:
        """Add contacts of upper[i] on (or right of) lower[i] in the points at[i]."""
        first.append(lower)
        second.append(upper)
        points.append(at)
        direction.append(np.tile([0.0, 1.0] if up else [1.0, 0.0], (lower.size, 1)))

    own = np.arange(bricks)
    for shift in (-1.0, 1.0):
        floor = own[row == 0]
        at = np.column_stack((x + shift, y - 0.5))
        add(np.full(floor.size, -1), floor, at[floor], True)
        side = own[place > 0]
        at = np.column_stack((x - 1.0, y + 0.5 * shift))
        add(side - 1, side, at[side], False)
    for half in (-1, 1):  # the brick below on that side, and both ends of the overlap
        other = place + (half + 2 * (row % 2) - 1) // 2
        on = own[(row > 0) & (other >= 0) & (other < courses)]
        for end in (0.0, float(half)):
            at = np.column_stack((x + end, y - 0.5))
            add((row[on] - 1) * courses + other[on], on, at[on], True)
    lower, upper = np.concatenate(first), np.concatenate(second)
    at, up = np.concatenate(points), np.concatenate(direction)
    centre = np.column_stack((x, y))

    def wrench(body: np.ndarray) -> np.ndarray:
        """Return force and moment on those bodies of a unit force along `up`."""
        arm = at - centre[body]
        return np.column_stack((up, arm[:, 0] * up[:, 1] - arm[:, 1] * up[:, 0]))

    N = normals(lower, upper, -wrench(lower), wrench(upper), bricks)
    mass = mass_ratio ** rng.random(bricks)
    inertia = np.column_stack((mass, mass, mass * 5.0 / 12.0)).ravel()
    velocity = 0.5 * STEP * rng.standard_normal((bricks, 3))
    velocity[rng.random(bricks) < 0.9] = 0.0
    velocity[:, 1] -= STEP
    return scene(N, inertia, velocity.ravel())


def normals(
    first: np.ndarray,
    second: np.ndarray,
    on_first: np.ndarray,
    on_second: np.ndarray,
    bodies: int,
) -> sp.csr_array:
    """Return N: column c holds the forces of contact c on its bodies; -1 is fixed."""
    contacts, freedom = on_first.shape
    rows, columns, values = [], [], []
    for body, force in ((first, on_first), (second, on_second)):
        moving = np.flatnonzero(body >= 0)
        rows.append((freedom * body[moving, None] + np.arange(freedom)).ravel())
        columns.append(np.repeat(moving, freedom))
        values.append(force[moving].ravel())
    place = np.concatenate(rows), np.concatenate(columns)
    shape = freedom * bodies, contacts
    N = sp.csr_array((np.concatenate(values), place), shape=shape)
    N.eliminate_zeros()
    return N


def scene(N: sp.csr_array, mass: np.ndarray, v: np.ndarray) -> BoxLCP:
    """Return the LCP of normals, masses and velocities, both by degree of freedom."""
    A = sp.csr_array(N.T @ sp.diags_array(1.0 / mass) @ N)
    A.sort_indices()
    return nonnegative(A, N.T @ v)
