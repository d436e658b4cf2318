"""Two-dimensional contact scenes of any size, without friction: heaps and walls.

Each is one time step of rigid bodies (Moreau-Jean, no restitution), as a
`namlcp.scenes.friction.Scene` without friction: impulses z >= 0 along the normals N
between masses M, with the free velocity v after a step of gravity, solve

    w = A z + q >= 0,   z'w = 0,   A = N'M^-1 N,   q = N'v.

All have a solution, for bodies at rest are feasible: the LCP is the dual of the nearest
velocity, in the norm of M, that separates no two bodies. More contacts than degrees of
freedom make A singular.
"""

from typing import Any

import numpy as np

from namlcp.scenes.friction import Bodies, Contacts, Scene, friction_lcp
from validation.problems.known_scenes import BoxLCP, nonnegative

Array = np.ndarray

STEP = 0.01  # gravity times the time step
JITTER = 0.1  # of the centres, the radius is 1
HOLES = 0.05  # share of the discs taken out


def scene_of(contacts: Any, centre: Array, mass: Array, v: Array) -> Scene:
    """Return the scene of bodies 2 x 1; v has velocities along x, y and about z.

    Contacts as (first, second, points, normals): second[i] lies on (or right of)
    first[i], -1 the ground.
    """

    def spatial(plane: Array) -> Array:
        return np.column_stack((plane, np.zeros(len(plane))))

    first, second, at, normal = contacts
    velocity, none = np.zeros((len(v), 6)), np.zeros(second.size)
    velocity[:, [0, 1, 5]] = v
    inertia = np.outer(mass, [1.0, 1.0, 5.0 / 12.0])
    touching = Contacts(first, second, spatial(at), spatial(normal), none, none)
    return Scene(Bodies(spatial(centre), mass, inertia, velocity), touching)


def heap(contacts: int, *, sideways: bool = False, seed: int = 0) -> BoxLCP:
    """Return a square heap of discs in a box, of about so many contacts.

    The centres are those of a hexagonal lattice, moved at random. A disc lies on two
    discs below, or on one and a wall: N has full rank, body by body from above. With
    `sideways` it touches both neighbours of its row too: A is singular. Some discs are
    taken out again and all move a little, so that contacts open. Masses up to 1e4.
    """
    return nonnegative(*friction_lcp(heap_of_discs(contacts, sideways, 1e4, seed)))


def heap_of_discs(contacts: int, sideways: bool, mass_ratio: float, seed: int) -> Scene:
    """Return the bodies of `heap`."""
    rng = np.random.default_rng(seed)
    side = max(2, round(np.sqrt(contacts / (2.75 if sideways else 1.85))))
    discs = side * side
    body = np.arange(discs)
    row, place = np.divmod(body, side)
    centre = np.column_stack((2.0 * place + row % 2, np.sqrt(3.0) * row))
    centre += JITTER * rng.uniform(-1.0, 1.0, (discs, 2))
    upper = body[row > 0]
    pairs = [(upper, row[upper] % 2 - 1, 1, 1.0), (upper, row[upper] % 2, 1, -1.0)]
    pairs += [(body, np.full(discs, -1), 0, 1.0)] if sideways else []
    found = []
    for who, step, drop, wall in pairs:  # `step` places on, or else a wall
        at = place[who] + step
        inside = (at >= 0) & (at < side)
        other = np.where(inside, (row[who] - drop) * side + at, -1)
        line = centre[who] - centre[other]
        line[~inside] = wall, 0.0
        found.append((other, who, line / np.linalg.norm(line, axis=1, keepdims=True)))
    floor = np.full(side, -1), body[:side], np.tile([0.0, 1.0], (side, 1))
    one, two, up = map(np.concatenate, zip(*found, floor, strict=True))
    present = rng.random(discs) >= HOLES
    there = present[two] & (present[one] | (one < 0))
    contacts = one[there], two[there], centre[two[there]], up[there]
    mass = mass_ratio ** rng.random(discs)
    velocity = 0.5 * STEP * rng.standard_normal(2 * discs)
    velocity[1::2] -= STEP
    v = np.column_stack((velocity.reshape(-1, 2), np.zeros(discs)))
    return scene_of(contacts, centre, mass, v)


def brick_wall(contacts: int, *, mass_ratio: float = 1e4, seed: int = 0) -> BoxLCP:
    """Return a dry wall of bricks 2 x 1 in running bond, of about so many contacts.

    A brick lies on the halves of two others, two points each, and touches both
    neighbours of its course in two points: six contacts a brick against three degrees
    of freedom. Single bricks are pushed at random.
    """
    rng = np.random.default_rng(seed)
    courses = max(2, round(np.sqrt(contacts / 6.0)))
    own = np.arange(courses * courses)
    row, place = np.divmod(own, courses)
    centre = np.column_stack((2.0 * place + row % 2, row + 0.5))
    touches, along, up = [], np.eye(2)[:1], np.eye(2)[1:]

    def add(first: Array, second: Array, at: tuple, normal: Array) -> None:
        normals = np.repeat(normal, second.size, axis=0)
        first = np.broadcast_to(first, second.shape)
        touches.append((first, second, centre[second] + at, normals))

    floor, side = own[row == 0], own[place > 0]
    for shift in (-1.0, 1.0):
        add(np.full(1, -1), floor, (shift, -0.5), up)
        add(side - 1, side, (-1.0, 0.5 * shift), along)
    for half in (-1, 1):  # the brick below on that side, and both ends of the overlap
        other = place + (half + 2 * (row % 2) - 1) // 2
        on = own[(row > 0) & (other >= 0) & (other < courses)]
        for end in (0.0, float(half)):
            add((row[on] - 1) * courses + other[on], on, (end, -0.5), up)
    mass = mass_ratio ** rng.random(own.size)
    velocity = 0.5 * STEP * rng.standard_normal((own.size, 3))
    velocity[rng.random(own.size) < 0.9] = 0.0
    velocity[:, 1] -= STEP
    contacts = map(np.concatenate, zip(*touches, strict=True))
    return nonnegative(*friction_lcp(scene_of(contacts, centre, mass, velocity)))
