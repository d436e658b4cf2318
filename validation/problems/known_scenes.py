"""Box LCPs from applications, with the values that are known of their solutions.

Each function returns BoxLCP(A, q, lower, upper): find z in [lower, upper] with
w = A z + q >= 0 where z_i = lower_i, w_i <= 0 where z_i = upper_i, and w_i = 0 in
between. Node (i, j) of a grid, counted along x and y, is entry (i, j) of
z.reshape(nx, ny); values given on a boundary are eliminated. Random ones are seeded.
tests/validation/test_scenes.py solves them and compares.

Below are families whose number of unknowns is free, FAMILIES by name and that number.
Five-point and similar matrices are on the unit square (cube), z = 0 on the boundary,
times h^2, with m nodes along a side inside; the load of most is that of the forced
obstacle, 50 sin(3 pi x) sin(3 pi y).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp


class BoxLCP(NamedTuple):
    """A is a csr_array, or dense where it is full."""

    A: sp.csr_array | np.ndarray
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray


def nonnegative(A: sp.csr_array | np.ndarray, q: np.ndarray) -> BoxLCP:
    return BoxLCP(A, q, np.zeros_like(q), np.full_like(q, np.inf))


def second_difference(m: int) -> sp.csr_array:
    return sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(m, m)).tocsr()


def five_point(nx: int, ny: int, cx: float = 1.0, cy: float = 1.0) -> sp.csr_array:
    """Return cx Tx + cy Ty, T = tridiag(-1, 2, -1), on nx x ny interior nodes."""
    x = sp.kron(second_difference(nx), cx * sp.eye_array(ny))
    return sp.csr_array(x + sp.kron(cy * sp.eye_array(nx), second_difference(ny)))


def torsion(nx: int, ny: int, c: float = 5.0) -> BoxLCP:
    """Return the stress function of an elastic-plastic bar under torsion.

    min 1/2 int |grad v|^2 - c int v on the unit square, |v| <= distance to the
    boundary; the bar is plastic where the bound is met (MINPACK-2 DEPT, COPS 15).
    1/2 z'Az + q'z at nx x ny interior nodes: 50 x 50 -0.4180876320 (published
    -4.18087e-1) with 752 nodes in contact, 50 x 100 -0.4182392134.
    """
    hx, hy = 1.0 / (nx + 1), 1.0 / (ny + 1)
    i, j = np.arange(1, nx + 1), np.arange(1, ny + 1)
    x, y = np.minimum(i, nx + 1 - i) * hx, np.minimum(j, ny + 1 - j) * hy
    distance = np.minimum(x[:, None], y).ravel()
    q = np.full(nx * ny, -c * hx * hy)
    return BoxLCP(five_point(nx, ny, hy / hx, hx / hy), q, -distance, distance)


def journal_bearing(nx: int, ny: int, e: float = 0.1, b: float = 10.0) -> BoxLCP:
    """Return the pressure of the film in a journal bearing of eccentricity e.

    min 1/2 int w |grad v|^2 - e int sin(x) v over v >= 0 on (0, 2 pi) x (0, 2 b),
    w = (1 + e cos x)^3, linear elements on right triangles (MINPACK-2 DPJB; PETSc/TAO
    jbearing2.c). 1/2 z'Az + q'z: 8 x 12, e = 0.1 -0.1834372196 (TAO -0.183437);
    50 x 50, e = 0.99 -60.1509273215 (TAO -60.1509); 50 x 50, e = 0.1 -0.1804879950.
    """
    hx, hy = 2.0 * np.pi / (nx + 1), 2.0 * b / (ny + 1)
    w = (1.0 + e * np.cos(hx * np.arange(nx + 2))) ** 3
    lower, upper = (2.0 * w[:-1] + w[1:]) / 3.0, (2.0 * w[1:] + w[:-1]) / 3.0
    along_x = 0.5 * (lower + upper)  # edge (i, i + 1), once in each of two triangles
    along_y = 0.5 * (lower[1:] + upper[:-1])  # edge from (i, j) to (i, j + 1)
    inner = -along_x[1:-1]
    X = sp.diags_array([inner, along_x[:-1] + along_x[1:], inner], offsets=[-1, 0, 1])
    A = sp.kron(X, (hy / hx) * sp.eye_array(ny))
    A += sp.kron(sp.diags_array((hx / hy) * along_y), second_difference(ny))
    load = e * hx * hy * np.sin(hx * np.arange(1, nx + 1))
    return nonnegative(sp.csr_array(A), np.repeat(-load, ny))


CONTACT_RADIUS = 0.697965148223374
BALL_A, BALL_B = 0.680259411891719, 0.471519893402112


def ball_obstacle(m: int) -> BoxLCP:
    """Return a membrane over a ball, m x m nodes, boundary included.

    (-2, 2)^2, -Lap u >= 0, u >= psi = sqrt(1 - r^2) for r <= 0.9 and its tangent
    beyond, u on the boundary from `ball_solution` (Bueler, PETSc for Partial
    Differential Equations, 2021, ch. 12; snes ex9). Error over all m x m nodes,
    average / max: m = 17 2.707e-3 / 1.428e-2 (published), 33 8.182e-4 / 5.747e-3,
    129 3.334e-5 / 2.154e-4. A is the Laplacian times h^2.
    """
    line = np.linspace(-2.0, 2.0, m)
    r = np.hypot(line[:, None], line)
    edge = np.sqrt(1.0 - 0.9**2)
    ball = np.sqrt(1.0 - np.minimum(r, 0.9) ** 2)
    psi = np.where(r <= 0.9, ball, edge - 0.9 / edge * (r - 0.9))
    inner = slice(1, -1)
    u = ball_solution(m)
    u[inner, inner] = 0.0
    q = -boundary_terms(u)
    A = five_point(m - 2, m - 2)
    return BoxLCP(A, q, psi[inner, inner].ravel(), np.full_like(q, np.inf))


def ball_solution(m: int) -> np.ndarray:
    """Return sqrt(1 - r^2) up to the contact radius, B - A ln r outside."""
    line = np.linspace(-2.0, 2.0, m)
    r = np.hypot(line[:, None], line)
    inside = np.sqrt(1.0 - np.minimum(r, CONTACT_RADIUS) ** 2)
    outside = BALL_B - BALL_A * np.log(np.maximum(r, CONTACT_RADIUS))
    return np.where(r <= CONTACT_RADIUS, inside, outside)


def boundary_terms(u: np.ndarray) -> np.ndarray:
    """Return the sum of the four neighbours of each interior node of a grid."""
    inner = slice(1, -1)
    return (u[:-2, inner] + u[2:, inner] + u[inner, :-2] + u[inner, 2:]).ravel()


def forced_obstacle(m: int) -> tuple[sp.csr_array, np.ndarray]:
    """Return A and q of `obstacle`."""
    h = 1.0 / (m + 1)
    wave = np.sin(3.0 * np.pi * h * np.arange(1, m + 1))
    return five_point(m, m), -50.0 * h**2 * np.outer(wave, wave).ravel()


def obstacle(m: int) -> BoxLCP:
    """Return the forced obstacle: z >= 0 under a load of changing sign.

    Unit square, A the five-point Laplacian times h^2 on m x m interior nodes, load
    50 sin(3 pi x) sin(3 pi y): 12 % of the nodes in contact, in four patches.
    """
    return nonnegative(*forced_obstacle(m))


def dam(refinement: int = 1) -> BoxLCP:
    """Return the seepage through a dam 16 wide, water 24 deep before and 4 behind it.

    u >= 0, -Lap u + 1 >= 0, u (1 - Lap u) = 0 (Baiocchi); u = (24 - y)^2 / 2 left,
    (4 - y)^2 / 2 right below y = 4 and 0 above, linear at the bottom, 0 at the top
    (Brandt and Cryer, SIAM J Sci Stat Comput 4 (1983) 655-684). The grid of 5 x 7
    nodes, boundary included, is refined by doubling. z of it in rational arithmetic,
    rows from the top: 2.537160152376977 0 0; 18.14864060950791 6.784143053453704 0;
    47.27325923220094 24.98793160430691 7.912016211797040; two more; the printed ones
    come from an iteration and differ by up to 1.5e-11. Active sets started cold take
    about twice the steps after each refinement.
    """
    a, y1, y2 = 16.0, 24.0, 4.0
    nx, ny = 4 * refinement + 1, 6 * refinement + 1
    h = a / (nx - 1)
    y = h * np.arange(ny)
    u = np.zeros((nx, ny))
    u[0], u[-1] = 0.5 * (y1 - y) ** 2, 0.5 * np.maximum(y2 - y, 0.0) ** 2
    u[:, 0] = np.linspace(0.5 * y1**2, 0.5 * y2**2, nx)
    return nonnegative(five_point(nx - 2, ny - 2), h**2 - boundary_terms(u))


def american_put(m: int, steps: int) -> BoxLCP:
    """Return the first implicit Euler step of an American put over one year.

    V >= max(K - S, 0), V_t <= L V in time to maturity, L V = sigma^2/2 (V_xx - V_x) +
    (r - d) V_x - r V, x = ln(S / K) in (-width, width) on m interior nodes, m odd, so
    that S = K is the middle one. A is tridiagonal and nonsymmetric, z = V; the next
    step has q + V_old - V_new for q. With r = d = 5 %, sigma = 25 %, S = K = 100:
    9.5694453 (Andersen, Lake and Offengenden, J Comput Finance 20 (2015) 39-87).
    """
    strike, rate, dividend, volatility, width = 100.0, 0.05, 0.05, 0.25, 2.0
    h, dt = 2.0 * width / (m + 1), 1.0 / steps
    x = -width + h * np.arange(m + 2)
    payoff = strike * np.maximum(1.0 - np.exp(x), 0.0)
    diffusion = 0.5 * volatility**2 / h**2
    drift = (rate - dividend - 0.5 * volatility**2) / (2.0 * h)
    below, above = -dt * (diffusion - drift), -dt * (diffusion + drift)
    middle = 1.0 + dt * (2.0 * diffusion + rate)
    A = sp.diags_array([below, middle, above], offsets=[-1, 0, 1], shape=(m, m))
    q = -payoff[1:-1]
    q[0] += below * payoff[0]
    return BoxLCP(A.tocsr(), q, payoff[1:-1], np.full(m, np.inf))


def input_bounded_mpc(steps: int = 100) -> BoxLCP:
    """Return the accelerations |u| <= 1 that bring a point mass to rest, condensed.

    x_{k+1} = [[1, .1], [0, 1]] x_k + [.005, .1] u_k; half the sum of x'Qx over x_1 to
    x_N and of u'Ru, Q = diag(1, .1), R = .01. With x'Qx of x_0 the whole sum for 100
    steps from (10, 0) is 2490.05936849, with 69 inputs at a bound. A is dense.
    """
    F, g = np.array([[1.0, 0.1], [0.0, 1.0]]), np.array([0.005, 0.1])
    G = np.zeros((steps, 2, steps))
    x = np.zeros((steps, 2))
    free = np.array([10.0, 0.0])
    for k in range(steps):
        free = F @ free
        x[k] = free
        if k:
            G[k] = F @ G[k - 1]
        G[k, :, k] = g
    weight = np.tile([1.0, 0.1], steps)[:, None]
    G = G.reshape(2 * steps, steps)
    A = G.T @ (weight * G) + 0.01 * np.eye(steps)
    q = G.T @ (weight[:, 0] * x.ravel())
    return BoxLCP(0.5 * (A + A.T), q, np.full(steps, -1.0), np.ones(steps))


def two_clouds(n: int, features: int = 5) -> tuple[np.ndarray, np.ndarray]:
    """Return points X and labels y = +-1 of two normal clouds that overlap."""
    rng = np.random.default_rng(0)
    y = np.where(rng.random(n) < 0.5, 1.0, -1.0)
    return rng.standard_normal((n, features)) + 0.7 * y[:, None], y


def svm_rbf(X: np.ndarray, y: np.ndarray, gamma: float, C: float = 1.0) -> BoxLCP:
    """Return the dual of a support vector machine with RBF kernel, without bias.

    min 1/2 z'Az - sum z, 0 <= z <= C, a_ij = y_i y_j exp(-gamma |x_i - x_j|^2).
    heart_scale (LIBSVM, 270 x 13), gamma = 1/13, C = 1: objective -101.1335996299, 129
    support vectors, 107 of them at C.
    """
    square = np.sum(X * X, axis=1)
    distance = np.maximum(square[:, None] + square - 2.0 * X @ X.T, 0.0)
    A = np.outer(y, y) * np.exp(-gamma * distance)
    return BoxLCP(A, -np.ones_like(y), np.zeros_like(y), np.full_like(y, C))


def svm_l2(X: np.ndarray, y: np.ndarray, C: float = 1.0) -> BoxLCP:
    """Return the dual with a linear kernel and squared hinge loss, an LCP.

    min 1/2 z'(Q + I/(2 C)) z - sum z, z >= 0, q_ij = y_i y_j x_i'x_j. heart_scale,
    C = 1: objective -121.13472444.
    """
    Xy = y[:, None] * X
    return nonnegative(Xy @ Xy.T + np.eye(y.size) / (2.0 * C), -np.ones_like(y))


# ---- families of any size

LOAD = 50.0


def nodes(m: int) -> np.ndarray:
    return np.arange(1, m + 1) / (m + 1)


def waves(m: int) -> np.ndarray:
    line = np.sin(3.0 * np.pi * nodes(m))
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
    from scipy.spatial import Delaunay

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
    factor = np.where(black % 2 == 0, 1.0, jump)
    factor /= 4.0 * np.maximum(area, 1e-6 * h * h)
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
    "biactive": lambda n: biactive(side(n))[0],
    "bilinear": lambda n: bilinear(side(n)),
    "stretched": lambda n: bilinear(side(n), 10.0),
    "transport": lambda n: transport(side(n)),
    "convection 20": lambda n: convection(side(n), 20.0),
    "convection 200": lambda n: convection(side(n), 200.0),
}
