"""Families of sparse box LCPs whose number of unknowns is free.

Each function returns BoxLCP(A, q, lower, upper), see `known_scenes`. Five-point and
similar matrices are on the unit square (cube), z = 0 on the boundary, times h^2, with
m nodes along a side inside; the load of most is that of the forced obstacle,
50 sin(3 pi x) sin(3 pi y). FAMILIES has them by name and number of unknowns.
"""

from collections.abc import Callable

import numpy as np
import scipy.sparse as sp
from scipy.spatial import Delaunay

from validation.problems.known_scenes import (
    BoxLCP,
    ball_obstacle,
    five_point,
    nonnegative,
    obstacle,
    second_difference,
    torsion,
)

LOAD = 50.0


def nodes(m: int) -> np.ndarray:
    return np.arange(1, m + 1) / (m + 1)


def waves(m: int, number: float = 3.0) -> np.ndarray:
    line = np.sin(number * np.pi * nodes(m))
    return np.outer(line, line).ravel()


def forced_load(m: int) -> np.ndarray:
    return -LOAD / (m + 1) ** 2 * waves(m)


def box_3d(m: int) -> BoxLCP:
    """Return the forced obstacle in the cube, seven-point matrix, m^3 unknowns."""
    A = sp.kron(five_point(m, m), sp.eye_array(m))
    A += sp.kron(sp.eye_array(m * m), second_difference(m))
    q = np.outer(forced_load(m), np.sin(3.0 * np.pi * nodes(m)))
    return nonnegative(sp.csr_array(A), q.ravel())


def anisotropic(m: int, epsilon: float = 0.01) -> BoxLCP:
    """Return the forced obstacle with -u_xx - epsilon u_yy."""
    return nonnegative(five_point(m, m, 1.0, epsilon), forced_load(m))


def bilinear(m: int, aspect: float = 1.0) -> BoxLCP:
    """Return the forced obstacle with bilinear elements, width = aspect * height.

    Nine-point matrix; from aspect = sqrt(2) on some off-diagonals are positive, so
    that it is not an M-matrix.
    """
    K = second_difference(m)
    M = sp.eye_array(m) - K / 6.0
    A = sp.kron(K / aspect, M) + sp.kron(M, aspect * K)
    return nonnegative(sp.csr_array(A), forced_load(m))


def triangles(m: int, jump: float = 1.0, seed: int = 0) -> BoxLCP:
    """Return the forced obstacle on a random mesh, linear elements, m^2 unknowns.

    Delaunay triangles of nodes moved by up to 0.35 h in x and y; the coefficient is
    `jump` on the black squares of a chess board and 1 elsewhere, which makes some
    off-diagonals positive.
    """
    h = 1.0 / (m + 1)
    i, j = (axis.ravel() for axis in np.indices((m + 2, m + 2)))
    inside = (i > 0) & (i <= m) & (j > 0) & (j <= m)
    points = h * np.column_stack((i, j))
    move = np.random.default_rng(seed).uniform(-0.35 * h, 0.35 * h, (m * m, 2))
    points[inside] += move
    corner = Delaunay(points).simplices
    x, y = points[corner].transpose(2, 0, 1)
    # gradient of the hat function of corner k times twice the area: the opposite edge
    b = np.roll(y, -1, axis=1) - np.roll(y, -2, axis=1)
    c = np.roll(x, -2, axis=1) - np.roll(x, -1, axis=1)
    area = 0.5 * np.abs(b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
    black = np.floor(8.0 * x.mean(axis=1)) + np.floor(8.0 * y.mean(axis=1))
    factor = np.where(black % 2 == 0, 1.0, jump) / (
        4.0 * np.maximum(area, 1e-6 * h * h)
    )
    number = np.full(points.shape[0], -1, dtype=np.int32)
    number[inside] = np.arange(m * m)
    own = number[corner]
    rows, columns = np.repeat(own, 3, axis=1).ravel(), np.tile(own, 3).ravel()
    local = b[:, :, None] * b[:, None, :] + c[:, :, None] * c[:, None, :]
    values = (factor[:, None, None] * local).ravel()
    keep = (rows >= 0) & (columns >= 0)
    entries = values[keep], (rows[keep], columns[keep])
    A = sp.csr_array(sp.coo_array(entries, shape=(m * m, m * m)))
    lumped = np.bincount(corner.ravel(), np.repeat(area / 3.0, 3))[inside]
    px, py = points[inside].T
    load = LOAD * np.sin(3.0 * np.pi * px) * np.sin(3.0 * np.pi * py)
    return nonnegative(A, -load * lumped)


def rough_obstacle(m: int, seed: int = 0) -> BoxLCP:
    """Return a membrane pressed on a floor of random height at every node.

    Load -8, which alone would bend it by 0.59; the floor is uniform in (-0.4, -0.3), so
    that single nodes touch: few contacts, far from each other.
    """
    floor = np.random.default_rng(seed).uniform(-0.4, -0.3, m * m)
    q = np.full(m * m, 8.0 / (m + 1) ** 2)
    return BoxLCP(five_point(m, m), q, floor, np.full(m * m, np.inf))


def random_load(m: int, seed: int = 0) -> BoxLCP:
    """Return z >= 0 under a random load at every node, normal, of size h."""
    q = np.random.default_rng(seed).standard_normal(m * m) / (m + 1)
    return nonnegative(five_point(m, m), q)


def biactive(m: int) -> tuple[BoxLCP, np.ndarray]:
    """Return an obstacle problem with z_i = w_i = 0 for half the nodes, and z.

    With s = sin(3 pi x) sin(3 pi y) and t the median of |s|: z = max(s - t, 0),
    w = 50 h^2 max(-s - t, 0), q = w - A z.
    """
    A, s = five_point(m, m), waves(m)
    t = np.median(np.abs(s))
    z = np.maximum(s - t, 0.0)
    w = LOAD / (m + 1) ** 2 * np.maximum(-s - t, 0.0)
    return nonnegative(A, w - A @ z), z


def islands(m: int) -> BoxLCP:
    """Return an obstacle problem with 60 % of the nodes active.

    Load 400 (sin(8 pi x) sin(8 pi y) - 0.45): z > 0 on 32 islands.
    """
    load = 400.0 / (m + 1) ** 2 * (waves(m, 8.0) - 0.45)
    return nonnegative(five_point(m, m), -load)


def transport(m: int) -> BoxLCP:
    """Return Example 2 of the paper at delta = 0 with a load that activates bounds.

    Entries -1.5 below and -0.5 above the diagonal in both directions, 4 on it, load
    5 h sin(3 pi x) sin(3 pi y): convection as strong as diffusion in every cell.
    """
    return convection(m, float(m + 1), 5.0 * (m + 1))


def convection(m: int, b: float, load: float = LOAD) -> BoxLCP:
    """Return the forced obstacle with convection: -Lap u + b (u_x + u_y), central.

    Entries -1 -+ c with c = b h / 2: an M-matrix where b h <= 2.
    """
    c = 0.5 * b / (m + 1)
    line = sp.diags_array([-1.0 - c, 2.0, -1.0 + c], offsets=[-1, 0, 1], shape=(m, m))
    A = sp.csr_array(sp.kron(line, sp.eye_array(m)) + sp.kron(sp.eye_array(m), line))
    return nonnegative(A, -load / (m + 1) ** 2 * waves(m))


def side(n: int, dimensions: int = 2) -> int:
    """Return the nodes on a side of a grid with about n nodes."""
    return round(n ** (1.0 / dimensions))


FAMILIES: dict[str, Callable[[int], BoxLCP]] = {
    "forced": lambda n: obstacle(side(n)),
    "ball": lambda n: ball_obstacle(side(n) + 2),
    "torsion": lambda n: torsion(side(n), side(n)),
    "3-D": lambda n: box_3d(side(n, 3)),
    "anisotropic": lambda n: anisotropic(side(n)),
    "mesh": lambda n: triangles(side(n)),
    "mesh, jumps": lambda n: triangles(side(n), 1000.0),
    "rough": lambda n: rough_obstacle(side(n)),
    "random load": lambda n: random_load(side(n)),
    "biactive": lambda n: biactive(side(n))[0],
    "islands": lambda n: islands(side(n)),
    "bilinear": lambda n: bilinear(side(n)),
    "stretched": lambda n: bilinear(side(n), 10.0),
    "transport": lambda n: transport(side(n)),
    "convection 20": lambda n: convection(side(n), 20.0),
    "convection 200": lambda n: convection(side(n), 200.0),
}
"""Scenes by name, of about n unknowns."""
