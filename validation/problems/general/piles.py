"""Piles, walls and columns with Coulomb friction, in the plane and in space.

Each is a `namlcp.scenes.friction.Scene`: one time step, of which `friction_lcp` makes
the LCP. Gravity times the step is STEP, and bodies are pushed at random, so that some
contacts stick, some slide and some open. All have a solution: no gap is negative and
bodies at rest are feasible.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from namlcp.scenes.friction import Bodies, Contacts, Scene

Array = np.ndarray

STEP = 0.01  # gravity times the length of the step
PUSH = 1.0  # standard deviation of the random velocities, in units of STEP
BELOW = np.array([0.0, -1.0, 0.0])  # gravity in the plane; in space it is along -z

Place = tuple[int, ...]
Touch = tuple[int, int, Sequence[float], Sequence[float]]
"""A contact: first and second body, point, normal."""


def scene_of(
    bodies: Bodies, touches: Iterator[Touch], mu: float, directions: int = 2
) -> Scene:
    first, second, point, normal = zip(*touches, strict=True)
    ends, m = (np.array(first), np.array(second)), len(first)
    at, normals = np.array(point, dtype=float), np.array(normal, dtype=float)
    contacts = Contacts(*ends, at, normals, np.full(m, mu), np.zeros(m))
    return Scene(bodies, contacts, directions)


def moved(centre: Array, unit: float, ratio: float, seed: int, down: Array) -> Bodies:
    """Return bodies of random masses, pushed; unit: inertia of unit masses."""
    rng = np.random.default_rng(seed)
    mass = ratio ** rng.random(len(centre))
    velocity = PUSH * STEP * rng.standard_normal((len(centre), 6))
    velocity[:, :3] += STEP * down
    if down is BELOW:
        velocity[:, 2:5] = 0.0
    return Bodies(centre, mass, np.outer(mass, np.full(3, unit)), velocity)


def lattice(
    place: list[Place], centre: np.ndarray, steps: Sequence[Place], up: np.ndarray
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
    return scene_of(moved(centre, 0.5, ratio, seed, BELOW), touches, mu)


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

    return scene_of(moved(centre, 5.0 / 12.0, ratio, seed, BELOW), touches(), mu)


def pressed_chain(links: int, mu: float, ratio: float = 2.0, seed: int = 0) -> Scene:
    """Return a row of unit discs on a floor, pushed together from both ends."""
    centre = np.column_stack((2.0 * np.arange(links), np.ones(links), np.zeros(links)))
    bodies = moved(centre, 0.5, ratio, seed, BELOW)
    bodies.velocity[[0, -1], 0] = np.array([30.0, -30.0]) * STEP

    def touches() -> Iterator[Touch]:
        for k in range(links):
            yield -1, k, centre[k] + BELOW, -BELOW
            if k:
                yield k - 1, k, centre[k] - (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)

    return scene_of(bodies, touches(), mu)


def pile_of_balls(
    layers: int, mu: float, directions: int = 4, ratio: float = 2.0, seed: int = 0
) -> Scene:
    """Return unit balls in a square pyramid; each lies on four, or on the floor."""
    sides = ((r, range(layers - r)) for r in range(layers))
    place = [(i, j, r) for r, side in sides for i in side for j in side]
    up = np.array([0.0, 0.0, 1.0])
    centre = np.array(
        [(2.0 * i + r, 2.0 * j + r, 1.0 + np.sqrt(2.0) * r) for i, j, r in place]
    )
    below = [(a, b, -1) for a in (0, 1) for b in (0, 1)]
    touches = lattice(place, centre, [(-1, 0, 0), (0, -1, 0), *below], up)
    return scene_of(moved(centre, 0.4, ratio, seed, -up), touches, mu, directions)


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

    bodies = moved(centre, 1.0 / 6.0, ratio, seed, -up)
    return scene_of(bodies, touches(), mu, directions)
