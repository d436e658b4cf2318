"""Hertz contact of a sphere and a half-space, a matrix-free LCP solved with the FFT.

Find pressures p >= 0 on a square grid of cells with side h such that the gaps
w = K p + (x^2 + y^2) / (2 R) - delta are nonnegative and p'w = 0. K_ij is the
deflection of the half-space at the centre of cell i under a unit pressure on cell j
(Love 1929):

    K = 1 / (pi E*) integral over the cell of dA / r,

which depends on the distance of the cells alone: K is block-Toeplitz with Toeplitz
blocks, and a product with it costs two FFTs of four times the size. Nobody stores K:
with 1024^2 cells it would have 10^12 entries.

Hertz (1882): the contact is a circle of radius a = sqrt(R delta), the force is
F = 4/3 E* sqrt(R) delta^(3/2), that is a^3 = 3 F R / (4 E*), and the largest pressure
p0 = 3 F / (2 pi a^2). Here R = E* = 1.

References
----------
A. E. H. Love, Phil. Trans. R. Soc. A 228 (1929) 377-420; K. L. Johnson, Contact
Mechanics (1985), sections 3.1 and 4.2.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy import fft
from scipy.sparse.linalg import LinearOperator

WIDTH = 3.0  # side of the square grid, in units of the exact contact radius
DELTA = 1e-2  # how far the sphere comes down


class Hertz(NamedTuple):
    """A grid of the problem: operator, its diagonal, q, and what Hertz says."""

    A: LinearOperator
    diagonal: np.ndarray
    q: np.ndarray
    side: float
    radius: float
    force: float
    pressure: float


def hertz(cells: int, delta: float = DELTA) -> Hertz:
    radius = math.sqrt(delta)
    h = WIDTH * radius / cells
    deflection = love(np.arange(cells) * h, h)
    x = (np.arange(cells) - 0.5 * (cells - 1)) * h
    q = 0.5 * (x[:, None] ** 2 + x[None, :] ** 2) - delta
    force = 4.0 / 3.0 * delta**1.5
    diagonal = np.full(cells * cells, deflection[0, 0])
    pressure = 1.5 * force / (math.pi * radius**2)
    A = toeplitz_operator(deflection)
    return Hertz(A, diagonal, q.ravel(), h, radius, force, pressure)


def half_space(cells: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix written out, dense and positive, no H-matrix, and q."""
    problem = hertz(cells)
    A = problem.A @ np.eye(cells * cells)
    return 0.5 * (A + A.T), problem.q


def love(distance: np.ndarray, h: float) -> np.ndarray:
    """Return the deflections at (distance_i, distance_j) under pressure 1 on a cell."""
    near, far = distance - 0.5 * h, distance + 0.5 * h
    total = np.zeros((distance.size, distance.size))
    for x, sign_x in ((far, 1.0), (near, -1.0)):
        for y, sign_y in ((far, 1.0), (near, -1.0)):
            X, Y = x[:, None], y[None, :]
            # X arsinh(Y / |X|) + Y arsinh(X / |Y|) has the cell's integral as its
            # second difference
            corner = X * np.arcsinh(Y / np.abs(X)) + Y * np.arcsinh(X / np.abs(Y))
            total += sign_x * sign_y * corner
    return total / math.pi


def toeplitz_operator(first: np.ndarray) -> LinearOperator:
    """Return the symmetric block-Toeplitz operator with K_(0,0),(i,j) = first_ij."""
    cells = first.shape[0]
    size = fft.next_fast_len(2 * cells - 1, real=True)
    kernel = np.zeros((size, size))
    index = np.arange(cells)
    for rows in (index, -index):
        for columns in (index, -index):
            kernel[np.ix_(rows, columns)] = first
    symbol = fft.rfft2(kernel).real  # the kernel is even

    def product(p: np.ndarray) -> np.ndarray:
        transformed = fft.rfft2(p.reshape(cells, cells), s=(size, size))
        transformed *= symbol
        return fft.irfft2(transformed, s=(size, size))[:cells, :cells].ravel()

    n = cells * cells
    return LinearOperator((n, n), matvec=product, rmatvec=product, dtype=np.float64)


def measured(problem: Hertz, p: np.ndarray) -> dict[str, float]:
    h = problem.side
    radius = math.sqrt(np.count_nonzero(p) * h * h / math.pi)
    return {
        "radius_error": radius / problem.radius - 1.0,
        "force_error": float(p.sum()) * h * h / problem.force - 1.0,
        "pressure_error": float(p.max()) / problem.pressure - 1.0,
    }
