"""Bimatrix games as LCPs: random ones, whole numbers with ties, and known ones.

Two players with payoffs R and C (p x r) choose rows and columns at random, with
probabilities x and y. In costs r_ij = max R - R_ij + 1 > 0 and likewise c,

    w = [0 r; c' 0] (x, y) - 1 >= 0,   (x, y) >= 0,   (x, y)'w = 0

has the equilibria as its solutions, with x and y divided by their sums.
"""

from pathlib import Path

import numpy as np

from validation.harness import MissingDataError


def lcp(R: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    R, C = (M.max() - M + 1.0 for M in np.array((R, C), dtype=float))
    p, r = R.shape
    A = np.block([[np.zeros((p, p)), R], [C.T, np.zeros((r, r))]])
    return A, np.full(p + r, -1.0)


def random_lcp(
    rows: int, columns: int, seed: int, whole: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Return the LCP of uniform payoffs, or whole ones from 0 to 4, with many ties."""
    rng = np.random.default_rng(seed)
    shape = 2, rows, columns
    return lcp(*(rng.integers(0, 5, shape) if whole else rng.random(shape)))


def gambit(data: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return Gambit's games of the data folder: payoffs by name."""
    files = sorted((data / "general").glob("game_*.npz"))
    if not files:
        raise MissingDataError(f"no game_*.npz in {data / 'general'}")
    loaded = {file.stem.removeprefix("game_"): np.load(file) for file in files}
    return {name: (game["R"], game["C"]) for name, game in loaded.items()}
