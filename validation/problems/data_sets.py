"""The problem sets of the benchmark, read from the data folder.

Every set is a list of names and a loader from name to `qpsolvers.Problem`:

- mpc: model-predictive control, dense, as saved by `Problem.save`;
- contact: min 1/2 z'Az + q'z, z >= 0 with the symmetrised normal part A of a Delassus
  matrix, sparse;
- small, strict, all: Maros-Meszaros; the 19 strictly convex ones of at most 1000
  variables, inequalities and equalities, dense; the 44 strictly convex ones; all 137.
  Of the last two the dense subset of the collection is dense, the rest sparse.
"""

from pathlib import Path

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem
from scipy.io import loadmat

from namlcp.files import two_sided
from validation.harness import MissingDataError, cli, tables

INFINITY = 9e19  # 1e20 in the collection, in places rounded to slightly less


def set_names(data: Path, problem_set: str) -> list[str]:
    if problem_set in ("mpc", "contact"):
        names = sorted(f.stem for f in cli.require(data / problem_set).glob("*.npz"))
    else:
        names = sorted(maros_index(data, problem_set))
    if not names:
        raise MissingDataError(f"no problem of the set {problem_set!r} in {data}")
    return names


def load(data: Path, problem_set: str, name: str) -> Problem:
    """Return one problem of a set, dense or sparse (csc_matrix) as the set has it."""
    if problem_set == "mpc":
        return Problem.load(cli.require(data / "mpc" / f"{name}.npz"))
    if problem_set == "contact":
        A, q = contact_lcp(data, name)
        return Problem(sp.csc_matrix(A), q, lb=np.zeros(q.size))
    row = maros_index(data, problem_set)[name]
    dense = problem_set == "small" or row["subset"] == "dense_subset"
    return maros_problem(data, name, dense)


def contact_lcp(data: Path, name: str) -> tuple[sp.csr_matrix, np.ndarray]:
    """Return A and q of the frictionless LCP of a contact scene.

    A = W[::dim, ::dim], q = q[::dim], where every contact has `dim` rows of the
    Delassus matrix, the normal one first; scenes without `dim` are used whole.
    """
    scene = np.load(cli.require(data / "contact" / f"{name}.npz"))
    dim = int(scene["dim"]) if "dim" in scene else 1
    arrays = (scene["data"], scene["indices"], scene["indptr"])
    W = sp.csr_matrix(arrays, shape=tuple(scene["shape"]))
    A = W[::dim, ::dim]
    A = sp.csr_matrix(0.5 * (A + A.T))
    A.sort_indices()
    return A, np.ascontiguousarray(scene["q"][::dim], dtype=float)


def heart_scale(data: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return points (270 x 13) and labels of heart_scale, in LIBSVM's format."""
    text = cli.require(data / "svm" / "heart_scale").read_text()
    lines = [line.split() for line in text.splitlines() if line.strip()]
    y = np.array([float(words[0]) for words in lines])
    X = np.zeros((y.size, 13))
    for row, words in zip(X, lines, strict=True):
        for word in words[1:]:
            feature, value = word.split(":")
            row[int(feature) - 1] = float(value)
    return X, y


def maros_index(data: Path, problem_set: str) -> dict[str, dict[str, str]]:
    """Return the rows of index.csv that belong to a set, by problem name."""
    index = tables.read(cli.require(data / "maros_meszaros" / "index.csv"))
    rows = {Path(row["file"]).stem: row for row in index}
    if problem_set == "all":
        return rows
    strict = {name: row for name, row in rows.items() if row["def"] == "pd"}
    if problem_set == "strict":
        return strict
    return {
        name: row
        for name, row in strict.items()
        if max(int(row["n"]), int(row["mG"]), int(row["mA"])) <= 1000
    }


def mat_problem(path: Path) -> Problem:
    """Read l <= A x <= u as the collection stores it: its last rows are the bounds."""
    data = loadmat(path, spmatrix=False)
    P, C = sp.csc_matrix(data["P"]), sp.csr_matrix(data["A"])
    q, low, high = (np.array(data[name], float).ravel() for name in "qlu")
    low[low <= -INFINITY], high[high >= INFINITY] = -np.inf, np.inf
    m = C.shape[0] - q.size
    return two_sided(P, q, C[:m], low[:m], high[:m], low[m:], high[m:])


def maros_problem(data: Path, name: str, dense: bool) -> Problem:
    """Read NAME.mat; bounds that are all infinite become None."""
    path = cli.require(data / "maros_meszaros" / f"{name}.mat")
    P, q, G, h, A, b, lb, ub = mat_problem(path).unpack()
    if dense:
        P, G, A = (None if M is None else M.toarray() for M in (P, G, A))
    bounds = (v if np.isfinite(v).any() else None for v in (lb, ub))
    return Problem(P, q, G, h, A, b, *bounds)
