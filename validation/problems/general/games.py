"""Bimatrix games as LCPs: random ones, whole numbers with ties, and known ones.

Two players with payoffs R and C (p x r) choose rows and columns at random, with
probabilities x and y. In costs r_ij = max R - R_ij + 1 > 0 and likewise c,

    w = [0 r; c' 0] (x, y) - 1 >= 0,   (x, y) >= 0,   (x, y)'w = 0

has the equilibria as its solutions, with x and y divided by their sums.
"""

from pathlib import Path

import numpy as np

from validation.harness import MissingDataError


def costs(R: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return R.max() - R + 1.0, C.max() - C + 1.0


def lcp(R: np.ndarray, C: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    R, C = costs(np.array(R, dtype=float), np.array(C, dtype=float))
    p, r = R.shape
    A = np.block([[np.zeros((p, p)), R], [C.T, np.zeros((r, r))]])
    return A, np.full(p + r, -1.0)


def payoffs(
    rows: int, columns: int, seed: int, whole: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """Return random payoffs: uniform, or whole numbers from 0 to 4, with many ties."""
    rng = np.random.default_rng(seed)
    shape = 2, rows, columns
    R, C = rng.integers(0, 5, shape).astype(float) if whole else rng.random(shape)
    return R, C


def gambit(data: Path) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return Gambit's games of the data folder: payoffs by name."""
    files = sorted((data / "general").glob("game_*.npz"))
    if not files:
        raise MissingDataError(f"no game_*.npz in {data / 'general'}")
    loaded = {file.stem.removeprefix("game_"): np.load(file) for file in files}
    return {name: (game["R"], game["C"]) for name, game in loaded.items()}
