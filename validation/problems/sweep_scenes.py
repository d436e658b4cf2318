"""Box LCPs of known class on which the sweep methods are compared."""

from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from validation.problems import data_sets, draw, hertz
from validation.problems.contact_scenes import brick_wall, disc_pile
from validation.problems.known_scenes import BoxLCP, nonnegative, obstacle


def canonical(A: Any) -> Any:
    if not isinstance(A, np.ndarray):
        A = sp.csr_array(A)
        A.sum_duplicates()
    return A


def halfline(A: Any, q: np.ndarray) -> BoxLCP:
    return nonnegative(canonical(A), q)


def paper_example(number: int, m: int, delta: float = 4.0) -> BoxLCP:
    """Return Example 1 or 2 of the paper, n = m^2, m even; its start: `paper_start`.

    Five-point matrix + delta I with entries -1 (Example 1), or -1.5 below and -0.5
    above the diagonal (2); z* = (1, 2, 1, 2, ...), so that w* = 0.
    """
    below, above = {1: (-1.0, -1.0), 2: (-1.5, -0.5)}[number]
    line = sp.diags_array([below, above], offsets=[-1, 1], shape=(m, m))
    A = sp.csr_array(sp.kronsum(line, line) + (4.0 + delta) * sp.eye_array(m * m))
    return halfline(A, -(A @ paper_solution(m)))


def paper_solution(m: int) -> np.ndarray:
    return np.tile([1.0, 2.0], m * m // 2)


def paper_start(m: int) -> np.ndarray:
    return np.tile([1.0, 0.0], m * m // 2)


def with_contact(A: Any) -> BoxLCP:
    """Return an LCP, strictly complementary, in which about half the z*_i are zero."""
    A, n, rng = canonical(A), A.shape[0], np.random.default_rng(0)
    free, size = rng.random(n) < 0.5, rng.exponential(size=n)
    z, w = size * free, size * ~free * A.diagonal()
    return nonnegative(A, w - A @ z)


def contact(data: Path, name: str) -> BoxLCP:
    return halfline(*data_sets.contact_lcp(data, name))


def random_spd(n: int, condition: float = 100.0) -> BoxLCP:
    return with_contact(draw.definite(np.random.default_rng(0), n, condition))


def spd_not_h(n: int, per_row: int = 4) -> BoxLCP:
    """Return sparse A = B B' + 0.1 I, SPD, with rho(|I - D^-1 A|) well above 1."""
    rng = np.random.default_rng(0)
    rows = np.repeat(np.arange(n), per_row)
    columns = rng.integers(0, n, n * per_row)
    values = rng.standard_normal(n * per_row)
    B = sp.csr_array((values, (rows, columns)), shape=(n, n))
    return with_contact(B @ B.T + 0.1 * sp.eye_array(n))


def badly_scaled(m: int, decades: float = 3.0) -> BoxLCP:
    """Return Example 1, delta = 1, with row i of A and q times 10^(+-decades)."""
    A, q, *_ = with_contact(paper_example(1, m, 1.0).A)
    rows = 10.0 ** np.random.default_rng(0).uniform(-decades, decades, m * m)
    return halfline(sp.diags_array(rows) @ A, rows * q)


def nonsymmetric_h_plus(n: int, radius: float = 0.9) -> BoxLCP:
    """Return sparse A with random signs and rho(|I - D^-1 A|) = radius < 1: H+."""
    rng = np.random.default_rng(0)
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
    return with_contact(diagonal @ (sp.eye_array(n) + B))


def problem_classes() -> dict[str, BoxLCP]:
    """Return one scene of each class of the stability map, none of which needs data."""
    return {
        "dominant M-matrix": with_contact(paper_example(1, 20).A),
        "Laplacian": obstacle(20),
        "SPD, not H": spd_not_h(300),
        "singular contact, discs": halfline(*disc_pile(14)),
        "singular contact, bricks": brick_wall(240, mass_ratio=4.0),
        "badly scaled rows": badly_scaled(20),
        "nonsymmetric H+": nonsymmetric_h_plus(400),
        "dense positive": nonnegative(*hertz.half_space(16)),
    }
