"""Box LCPs of known class on which the sweep methods are compared.

Every function returns a Scene: find z in [lower, upper] with w = A z + q >= 0 where
z_i = lower_i, w_i <= 0 where z_i = upper_i, and w_i = 0 in between.
"""

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp

from validation.problems import data_sets, draw, hertz
from validation.problems.classics import disc_pile, forced_obstacle
from validation.problems.contact_scenes import brick_wall
from validation.problems.known_scenes import svm_rbf


class Scene(NamedTuple):
    """A problem; s0 is the start that a source prescribes."""

    name: str
    A: Any
    q: np.ndarray
    lower: np.ndarray
    upper: np.ndarray
    s0: np.ndarray | None = None


def halfline(name: str, A: Any, q: np.ndarray, s0: np.ndarray | None = None) -> Scene:
    """Return the scene with z >= 0, the matrix in canonical form."""
    if not isinstance(A, np.ndarray):
        A = sp.csr_array(A)
        A.sum_duplicates()
    return Scene(name, A, q, np.zeros_like(q), np.full_like(q, np.inf), s0)


def paper_example(number: int, m: int, delta: float = 4.0) -> Scene:
    """Return Example 1 or 2 of the paper, n = m^2, m even, with its start.

    Five-point matrix + delta I with entries -1 (Example 1), or -1.5 below and -0.5
    above the diagonal (2); z* = (1, 2, 1, 2, ...), so that w* = 0.
    """
    below, above = {1: (-1.0, -1.0), 2: (-1.5, -0.5)}[number]
    line = sp.diags_array([below, above], offsets=[-1, 1], shape=(m, m))
    A = sp.csr_array(sp.kronsum(line, line) + (4.0 + delta) * sp.eye_array(m * m))
    z = np.tile([1.0, 2.0], m * m // 2)
    s0 = np.tile([1.0, 0.0], m * m // 2)
    return halfline(f"Example {number}, delta = {delta:g}", A, -(A @ z), s0)


def with_contact(scene: Scene, seed: int = 0) -> Scene:
    """Return the scene with another q, so that about half of the z*_i are zero.

    Strictly complementary z*, w*: exponentially distributed, w*_i in units of a_ii.
    """
    rng = np.random.default_rng(seed)
    free, size = rng.random(scene.q.size) < 0.5, rng.exponential(size=scene.q.size)
    z, w = size * free, size * ~free * scene.A.diagonal()
    return scene._replace(q=w - scene.A @ z, s0=None)


def contact(data: Path, name: str) -> Scene:
    A, q = data_sets.contact_lcp(data, name)
    return halfline(name, A, q)


def random_spd(n: int, condition: float = 100.0, seed: int = 0) -> Scene:
    """Return a dense SPD matrix with that condition number, random eigenvectors."""
    A = draw.definite(np.random.default_rng(seed), n, condition)
    return with_contact(halfline("random SPD", A, np.zeros(n)), seed)


def spd_not_h(n: int, per_row: int = 4, seed: int = 0) -> Scene:
    """Return sparse A = B B' + 0.1 I, SPD, with rho(|I - D^-1 A|) well above 1."""
    rng = np.random.default_rng(seed)
    rows = np.repeat(np.arange(n), per_row)
    columns = rng.integers(0, n, n * per_row)
    values = rng.standard_normal(n * per_row)
    B = sp.csr_array((values, (rows, columns)), shape=(n, n))
    scene = halfline("SPD, not H", B @ B.T + 0.1 * sp.eye_array(n), np.zeros(n))
    return with_contact(scene, seed)


def svm_heart(data: Path) -> Scene:
    """Return the SVM dual of heart_scale: RBF kernel, gamma = 1/13, C = 1, no bias."""
    return Scene("SVM heart", *svm_rbf(*data_sets.heart_scale(data), 1.0 / 13.0))


def badly_scaled(m: int, decades: float = 3.0, seed: int = 0) -> Scene:
    """Return Example 1, delta = 1, with row i of A and q times 10^(+-decades)."""
    scene = with_contact(paper_example(1, m, 1.0), seed)
    exponent = np.random.default_rng(seed).uniform(-decades, decades, m * m)
    rows = 10.0**exponent
    A = sp.csr_array(sp.diags_array(rows) @ scene.A)
    return halfline("badly scaled rows", A, rows * scene.q)


def nonsymmetric_h_plus(n: int, radius: float = 0.9, seed: int = 0) -> Scene:
    """Return sparse A with random signs and rho(|I - D^-1 A|) = radius < 1: H+."""
    rng = np.random.default_rng(seed)
    B = sp.random_array((n, n), density=6.0 / n, rng=rng, format="csr")
    B.data = rng.standard_normal(B.nnz)
    B.setdiag(0.0)
    B.eliminate_zeros()
    vector, size = np.ones(n), 1.0
    for _ in range(500):  # power iteration, shifted because |B| may be periodic
        vector = abs(B) @ vector + vector
        size = float(np.max(vector))
        vector /= size
    B *= radius / (size - 1.0)
    diagonal = sp.diags_array(rng.uniform(0.5, 2.0, n))
    scene = halfline("nonsymmetric H+", diagonal @ (sp.eye_array(n) + B), np.zeros(n))
    return with_contact(scene, seed)


def problem_classes() -> list[Scene]:
    """Return one scene of each class of the stability map, none of which needs data.

    Laplacian and dominant M-matrix, SPD not H, two singular contact scenes (one nearly
    an M-matrix, one with entries of both signs), rows in other units, H+ without
    symmetry, dense and positive.
    """
    dominant = with_contact(paper_example(1, 20, 4.0))
    return [
        dominant._replace(name="dominant M-matrix"),
        halfline("Laplacian", *forced_obstacle(20)),
        spd_not_h(300),
        halfline("singular contact, discs", *disc_pile(14)),
        halfline("singular contact, bricks", *brick_wall(240, mass_ratio=4.0)[:2]),
        badly_scaled(20),
        nonsymmetric_h_plus(400),
        halfline("dense positive", *hertz.half_space(16)),
    ]
