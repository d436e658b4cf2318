"""Contact scenes of any size: heaps, walls, piles and columns, with friction or not.

Each is one time step of rigid bodies (Moreau-Jean, no restitution), as a
`namlcp.scenes.friction.Scene`, of which `friction_lcp` makes the LCP. Gravity times the
step is STEP, and bodies are pushed at random, so that some contacts stick, some slide
and some open. All have a solution: no gap is negative and bodies at rest are feasible.

Without friction, in the plane (`heap`, `brick_wall`, `disc_pile`), impulses z >= 0
along the normals N between masses M, with the free velocity v after a step of gravity,
solve

    w = A z + q >= 0,   z'w = 0,   A = N'M^-1 N,   q = N'v,

the dual of the nearest velocity, in the norm of M, that separates no two bodies. More
contacts than degrees of freedom make A singular. With Coulomb friction, in the plane
and in space, there are piles, walls, chains and columns (`pile_of_discs` and below).
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp.scenes.friction import Bodies, Contacts, Scene, friction_lcp
from validation.problems.known_scenes import BoxLCP, nonnegative

Array = np.ndarray

STEP = 0.01  # gravity times the length of the step
JITTER = 0.1  # of the centres of a heap, the radius is 1
HOLES = 0.05  # share of the discs of a heap that are taken out
PUSH = 1.0  # standard deviation of the velocities of `pushed`, in units of STEP
BELOW = np.array([0.0, -1.0, 0.0])  # gravity in the plane; in space it is along -z

Place = tuple[int, ...]
Touch = tuple[int, int, Sequence[float], Sequence[float]]
"""A contact: first and second body, point, normal."""


def scene_of(
    bodies: Bodies, touches: Any, mu: float = 0.0, directions: int = 2
) -> Scene:
    """Return the scene of contacts: first and second bodies, points, normals."""
    first, second, point, normal = map(np.array, touches)
    rough, gap = np.full(first.size, mu), np.zeros(first.size)
    return Scene(bodies, Contacts(first, second, point, normal, rough, gap), directions)


# ---- without friction

INERTIA = 1.0, 1.0, 5.0 / 12.0  # of bodies 2 x 1, over their masses


def heap(contacts: int, *, sideways: bool = False, seed: int = 0) -> BoxLCP:
    """Return a square heap of discs in a box, of about so many contacts.

    The centres are those of a hexagonal lattice, moved at random. A disc lies on two
    discs below, or on one and a wall: N has full rank, body by body from above. With
    `sideways` it touches both neighbours of its row too: A is singular. Some discs are
    taken out again and all move a little, so that contacts open. Masses up to 1e4.
    """
    return nonnegative(*friction_lcp(heap_of_discs(contacts, sideways, 1e4, seed)))


def heap_of_discs(contacts: int, sideways: bool, mass_ratio: float, seed: int) -> Scene:
    """Return the scene of `heap`."""
    rng = np.random.default_rng(seed)
    side = max(2, round(np.sqrt(contacts / (2.75 if sideways else 1.85))))
    discs = side * side
    body = np.arange(discs)
    row, place = np.divmod(body, side)
    centre = np.column_stack((2.0 * place + row % 2, np.sqrt(3.0) * row, 0.0 * row))
    centre[:, :2] += JITTER * rng.uniform(-1.0, 1.0, (discs, 2))
    upper = body[row > 0]
    pairs = [(upper, row[upper] % 2 - 1, 1, 1.0), (upper, row[upper] % 2, 1, -1.0)]
    pairs += [(body, np.full(discs, -1), 0, 1.0)] if sideways else []
    found = []
    for who, step, drop, wall in pairs:  # `step` places on, or else a wall
        at = place[who] + step
        inside = (at >= 0) & (at < side)
        other = np.where(inside, (row[who] - drop) * side + at, -1)
        line = centre[who] - centre[other]
        line[~inside] = wall, 0.0, 0.0
        found.append((other, who, line / np.linalg.norm(line, axis=1, keepdims=True)))
    floor = np.full(side, -1), body[:side], np.tile([0.0, 1.0, 0.0], (side, 1))
    one, two, up = map(np.concatenate, zip(*found, floor, strict=True))
    present = rng.random(discs) >= HOLES
    there = present[two] & (present[one] | (one < 0))
    touches = one[there], two[there], centre[two[there]], up[there]
    mass, velocity = mass_ratio ** rng.random(discs), np.zeros((discs, 6))
    velocity[:, :2] = 0.5 * STEP * rng.standard_normal((discs, 2))
    velocity[:, 1] -= STEP
    return scene_of(Bodies(centre, mass, np.outer(mass, INERTIA), velocity), touches)


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
    centre = np.column_stack((2.0 * place + row % 2, row + 0.5, 0.0 * row))
    touches, (along, up, _) = [], np.eye(3)

    def add(first: Any, second: Array, x: float, y: float, normal: Array) -> None:
        first = np.broadcast_to(first, second.shape)
        at, normals = centre[second] + (x, y, 0.0), np.tile(normal, (second.size, 1))
        touches.append((first, second, at, normals))

    floor, side = own[row == 0], own[place > 0]
    for shift in (-1.0, 1.0):
        add(-1, floor, shift, -0.5, up)
        add(side - 1, side, -1.0, 0.5 * shift, along)
    for half in (-1, 1):  # the brick below on that side, and both ends of the overlap
        other = place + (half + 2 * (row % 2) - 1) // 2
        on = own[(row > 0) & (other >= 0) & (other < courses)]
        for end in (0.0, float(half)):
            add((row[on] - 1) * courses + other[on], on, end, -0.5, up)
    mass, velocity = mass_ratio ** rng.random(own.size), np.zeros((own.size, 6))
    velocity[:, [0, 1, 5]] = 0.5 * STEP * rng.standard_normal((own.size, 3))
    velocity[rng.random(own.size) < 0.9] = 0.0
    velocity[:, 1] -= STEP
    bodies = Bodies(centre, mass, np.outer(mass, INERTIA), velocity)
    scene = scene_of(bodies, map(np.concatenate, zip(*touches, strict=True)))
    return nonnegative(*friction_lcp(scene))


def disc_pile(rows: int) -> tuple[sp.csr_array, Array]:
    """Return LCP(q, A): frictionless contact forces in a hexagonal pile of discs.

    Unit discs of random mass (seed 0) lie in `rows` rows of decreasing length on a
    floor and between the walls of a wedge. A is singular.
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


# ---- with friction


def pushed(
    centre: Array, unit: float, touches: Iterator[Touch], mu: float, ratio: float,
    seed: int, directions: int = 2,
) -> Scene:  # fmt: skip
    """Return bodies of random masses, pushed; unit: inertia of unit masses."""
    rng = np.random.default_rng(seed)
    mass = ratio ** rng.random(len(centre))
    velocity = PUSH * STEP * rng.standard_normal((len(centre), 6))
    if directions == 2:
        velocity[:, 2:5] = 0.0
    velocity[:, 1 if directions == 2 else 2] -= STEP
    bodies = Bodies(centre, mass, np.outer(mass, np.full(3, unit)), velocity)
    return scene_of(bodies, zip(*touches, strict=True), mu, directions)


def lattice(
    place: list[Place], centre: Array, steps: Sequence[Place], up: Array
) -> Iterator[Touch]:
    """Yield the contacts on the floor and `steps` away; a place ends with its row."""
    index = {at: k for k, at in enumerate(place)}
    for at, k in index.items():
        if at[-1] == 0:
            yield -1, k, centre[k] - up, up
        for step in steps:
            other = index.get(tuple(a + b for a, b in zip(at, step, strict=True)))
            if other is not None:
                line = (centre[k] - centre[other]) / 2.0
                yield other, k, centre[k] - line, line


def pile_of_discs(rows: int, mu: float, ratio: float = 2.0, seed: int = 0) -> Scene:
    """Return unit discs in rows; each touches its neighbours and two discs below."""
    place = [(i, r) for r in range(rows) for i in range(rows - r)]
    centre = np.array([(2.0 * i + r, 1.0 + np.sqrt(3.0) * r, 0.0) for i, r in place])
    touches = lattice(place, centre, ((-1, 0), (0, -1), (1, -1)), -BELOW)
    return pushed(centre, 0.5, touches, mu, ratio, seed)


def wall_of_bricks(rows: int, mu: float, ratio: float = 2.0, seed: int = 0) -> Scene:
    """Return bricks 2 x 1 in running bond, each on the halves of two others."""
    place = [(i, r) for r in range(rows) for i in range(rows)]
    index = {at: k for k, at in enumerate(place)}
    centre = np.array([(2.0 * i + r % 2, r + 0.5, 0.0) for i, r in place])

    def touches() -> Iterator[Touch]:
        for (i, r), k in index.items():
            x, y, _ = centre[k]
            if r == 0:
                for end in (-1.0, 1.0):
                    yield -1, k, (x + end, 0.0, 0.0), -BELOW
            for half in (-1, 0):
                below = index.get((i + half + r % 2, r - 1))
                if below is not None:
                    for end in (float(half), half + 1.0):
                        yield below, k, (x + end, y - 0.5, 0.0), -BELOW

    return pushed(centre, 5.0 / 12.0, touches(), mu, ratio, seed)


def pressed_chain(links: int, mu: float, ratio: float = 2.0, seed: int = 0) -> Scene:
    """Return a row of unit discs on a floor, pushed together from both ends."""
    centre = np.column_stack((2.0 * np.arange(links), np.ones(links), np.zeros(links)))

    def touches() -> Iterator[Touch]:
        for k in range(links):
            yield -1, k, centre[k] + BELOW, -BELOW
            if k:
                yield k - 1, k, centre[k] - (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)

    scene = pushed(centre, 0.5, touches(), mu, ratio, seed)
    scene.bodies.velocity[[0, -1], 0] = np.array([30.0, -30.0]) * STEP
    return scene


def pile_of_balls(
    layers: int, mu: float, directions: int = 4, ratio: float = 2.0, seed: int = 0
) -> Scene:
    """Return unit balls in a square pyramid; each lies on four, or on the floor."""
    sides = ((r, range(layers - r)) for r in range(layers))
    place = [(i, j, r) for r, side in sides for i in side for j in side]
    up = np.array([0.0, 0.0, 1.0])
    i, j, r = np.array(place).T
    centre = np.column_stack((2.0 * i + r, 2.0 * j + r, 1.0 + np.sqrt(2.0) * r))
    below = [(a, b, -1) for a in (0, 1) for b in (0, 1)]
    touches = lattice(place, centre, [(-1, 0, 0), (0, -1, 0), *below], up)
    return pushed(centre, 0.4, touches, mu, ratio, seed, directions)


def column_of_cubes(
    levels: int, mu: float, directions: int = 4, ratio: float = 2.0, seed: int = 0
) -> Scene:
    """Return unit cubes one on another, four corners an interface."""
    up = np.array([0.0, 0.0, 1.0])
    centre = np.array([(0.0, 0.0, 0.5 + r) for r in range(levels)])

    def touches() -> Iterator[Touch]:
        for k in range(levels):
            for x in (-0.5, 0.5):
                for y in (-0.5, 0.5):
                    yield k - 1, k, (x, y, float(k)), up

    return pushed(centre, 1.0 / 6.0, touches(), mu, ratio, seed, directions)
