"""Positive vectors that enclose the spectral radius of each irreducible block of J.

J = D^-1 |A - D| is the Jacobi matrix of a comparison matrix. In an irreducible block
min (J x)_i / x_i <= rho(J) <= max (J x)_i / x_i for every x > 0 (Collatz and Wielandt),
and x <- (lambda I - J)^-1 x with lambda the upper bound closes in quadratically and
keeps x > 0 (Noda, Numer. Math. 17 (1971) 382-386; Elsner, Linear Algebra Appl. 15
(1976) 235-242). Power steps come first, while they shrink the interval. All blocks are
iterated together, after balancing. Perron vectors of badly scaled matrices leave the
range of floating point, so vectors are written x 2^exponent.
"""

import contextlib
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from namlcp.compiled import kernel

NODA_ROUNDS = 40
"""Most rounds. A round is power steps of all blocks, or one step of Noda's iteration of
the open ones: those whose interval is wide and reaches up to 1."""

POWERS_A_ROUND, POWER_HELPS = 10, 0.7
"""Power steps of a round. They go on while a round reduces the largest log(high/low) of
the open blocks below POWER_HELPS times its size; then Noda's iteration begins."""

BALANCE_SWEEPS, BALANCED = 10, 0.1
"""Most sweeps of balancing, and the largest change of an exponent (base 2) at which
they end."""

NARROW = 4e-15
"""Relative width of an interval around rho(J) below which rounding errors dominate."""

LEAST_OF_BLOCK = 1e-250
"""Least entry of a vector whose largest entry in each block is 1."""

LARGEST_FACTORED = 20_000
"""Largest order of linear systems that are factored; multigrid solves larger ones."""

LARGEST_DENSE_LU = 3000
"""Largest order at which a matrix with over a quarter of entries gets a dense LU."""

CYCLES, PROGRESS = 12, 0.9
"""Most multigrid cycles for one system; they end when a cycle reduces the residual by a
factor of less than 1/PROGRESS."""

Candidate = tuple[np.ndarray, np.ndarray, float, float]


def row_numbers(A: Any) -> np.ndarray:
    """Return the row of every stored entry."""
    return np.repeat(np.arange(A.shape[0]), np.diff(A.indptr))


def block_vectors(A: Any, D: np.ndarray) -> Iterator[Candidate]:
    """Yield (x, exponent, low, high): possible witnesses y = x 2^exponent for <A>.

    If every block has rho(J) < 1, x is positive and <A> y > 0 is expected. If a block
    has rho(J) >= 1, x is positive on it alone, and <A> y <= 0 is expected there. The
    last x is empty, with the last bounds. low and high are the largest lower and upper
    bound of rho(J) among the blocks. D = diag(A) is positive.
    """
    label, K = blocks(A)
    count = int(label.max()) + 1
    rows, columns = row_numbers(K), K.indices
    logarithm = np.log2(K.data) - np.log2(D[rows])
    potential = balanced(with_entries(K, logarithm))
    exponent = np.rint(potential).astype(np.int64)
    mantissa = np.exp2(potential - exponent)
    J = with_entries(K, np.exp2(logarithm + potential[columns] - potential[rows]))
    x = np.ones(D.size)
    low, high = np.zeros(count), np.full(count, np.inf)
    before = np.inf
    for _ in range(NODA_ROUNDS):
        quotient = (J @ x) / x
        high = np.minimum(high, block_extreme(np.maximum, quotient, label, count))
        low = np.maximum(low, block_extreme(np.minimum, quotient, label, count))
        worst = int(np.argmax(low))
        bounds = float(low[worst]), float(high.max())
        if low[worst] >= 1.0:
            yield np.where(label == worst, x * mantissa, 0.0), exponent, *bounds
        elif np.all(high < 1.0):
            power = stacked(A, x * mantissa, exponent, label, 1.0 - quotient)
            yield x * mantissa, power, *bounds
        width = (high - low) / np.maximum(high, LEAST_OF_BLOCK)
        open_ = (width > NARROW) & (high >= 1.0 - NARROW)
        here = np.flatnonzero(open_[label])
        if not here.size:
            break
        gap = float(np.log(high[open_] / low[open_]).max())
        if gap < POWER_HELPS * before or before == np.inf:
            before, x = gap, powered(J, x, label, high)
            continue
        before = 0.0
        found = inverted(J, x, here, label, high)
        if found is None:
            break
        x = found
    yield np.empty(0), exponent, *bounds


def powered(J: Any, x: np.ndarray, label: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return x after steps with J + high/2, which is primitive."""
    scale = np.where(high > 0.0, high, 1.0)[label]
    for _ in range(POWERS_A_ROUND):
        x = (J @ x) / scale + 0.5 * x
    return normalised(x, label)


def inverted(
    J: Any, x: np.ndarray, here: np.ndarray, label: np.ndarray, high: np.ndarray
) -> np.ndarray | None:
    """Return x after a step of Noda's iteration on the unknowns `here`, None if none.

    Approximate solutions are refined only until the bounds of rho(J) decide about 1.
    """
    count = high.size
    shift = sparse.diags_array(high[label[here]] * (1.0 + 1e-15))
    trial = None
    inner = J if here.size == x.size else J[here][:, here]
    for y in solutions(sparse.csr_array(shift - inner), x[here]):
        if not np.all(np.isfinite(y)):
            break
        trial = x.copy()
        trial[here] = np.abs(y)
        trial = normalised(trial, label)
        quotient = (J @ trial) / trial
        below = bool(np.all(quotient < 1.0))
        if below or block_extreme(np.minimum, quotient, label, count).max() >= 1.0:
            break
    return trial


def normalised(x: np.ndarray, label: np.ndarray) -> np.ndarray:
    """Return x with largest entry 1 in every block, entries at least LEAST_OF_BLOCK."""
    top = block_extreme(np.maximum, x, label, int(label.max()) + 1)
    return np.maximum(x / top[label], LEAST_OF_BLOCK)


def block_extreme(
    choose: Any, values: np.ndarray, label: np.ndarray, count: int
) -> Any:
    """Return the largest (np.maximum) or least (np.minimum) value of each block."""
    result = np.full(count, -np.inf if choose is np.maximum else np.inf)
    choose.at(result, label, values)
    return result


def blocks(A: Any) -> tuple[np.ndarray, Any]:
    """Return the irreducible block of each unknown, and |A - D| within the blocks."""
    rows = row_numbers(A)
    coupled = (A.data != 0.0) & (rows != A.indices)
    _, label = connected_components(chosen_entries(A, coupled), connection="strong")
    inside = label[rows] == label[A.indices]
    return label, chosen_entries(A, coupled & inside)


def chosen_entries(A: Any, chosen: np.ndarray) -> Any:
    """Return |A| restricted to the stored entries that are `chosen`."""
    start = np.concatenate(([0], np.cumsum(chosen)))[A.indptr].astype(A.indptr.dtype)
    entries = np.abs(A.data[chosen]), A.indices[chosen], start
    return sparse.csr_array(entries, shape=A.shape)


def with_entries(A: Any, data: np.ndarray) -> Any:
    """Return a matrix with the pattern of A and these entries."""
    return sparse.csr_array((data, A.indices, A.indptr), shape=A.shape)


def balanced(L: Any) -> np.ndarray:
    """Return e that balances 2^-e J 2^e: row i and column i have equal largest entries.

    L has the logarithms to base 2 of the entries of J. Along trees of pairs j_ij, j_ji
    a symmetrisable J becomes symmetric; the rest is balanced as by Osborne, J. ACM 7
    (1960) 338-345.
    """
    exponent = np.zeros(L.shape[0])
    T = L.tocsc()
    matrix = L.indptr, L.indices, L.data, T.indptr, T.indices, T.data
    symmetrise(*matrix, exponent)
    for _ in range(BALANCE_SWEEPS):
        if osborne(*matrix, exponent) < BALANCED:
            break
    return exponent


@kernel
def symmetrise(indptr, indices, entry, indptr_c, indices_c, entry_c, e):
    """Overwrite e so that j_ij and j_ji become equal along trees of such pairs.

    The arrays are CSR and CSC of a matrix of logarithms, as in `balanced`.
    """
    n = e.size
    seen = np.zeros(n, dtype=np.bool_)
    queue = np.empty(n, dtype=np.int64)
    for root in range(n):
        if seen[root]:
            continue
        seen[root] = True
        queue[0] = root
        first, last = 0, 1
        while first < last:
            i = queue[first]
            first += 1
            t = indptr_c[i]
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                while t < indptr_c[i + 1] and indices_c[t] < j:
                    t += 1
                if t < indptr_c[i + 1] and indices_c[t] == j and not seen[j]:
                    seen[j] = True
                    e[j] = e[i] + 0.5 * (entry_c[t] - entry[k])
                    queue[last] = j
                    last += 1


@kernel
def osborne(indptr, indices, entry, indptr_c, indices_c, entry_c, e):
    """Make the largest entries of row i and column i equal, for i upwards, then down.

    Entries are logarithms; those of row i become entry + e_j - e_i. Overwrites e and
    returns its largest change.
    """
    n = e.size
    largest = 0.0
    for t in range(2 * n):
        i = t if t < n else 2 * n - 1 - t
        row = -np.inf
        for k in range(indptr[i], indptr[i + 1]):
            row = max(row, entry[k] + e[indices[k]])
        column = -np.inf
        for k in range(indptr_c[i], indptr_c[i + 1]):
            column = max(column, entry_c[k] - e[indices_c[k]])
        if row > -np.inf and column > -np.inf:
            new = 0.5 * (row - column)
            largest = max(largest, abs(new - e[i]))
            e[i] = new
    return largest


def stacked(
    A: Any, x: np.ndarray, exponent: np.ndarray, label: np.ndarray, rest: np.ndarray
) -> np.ndarray:
    """Return exponents that join the blocks' vectors into one v with <A> v > 0.

    The block's own part of row i of <A> v is rest_i d_i v_i. Each block is scaled up
    until the other blocks subtract at most half of that. The labels are in topological
    order or its reverse, which keeps the number of passes small.
    """
    size = np.log2(x) + exponent
    spare = np.log2(rest) + np.log2(A.diagonal()) + size - 1.0
    spare -= np.log2(np.diff(A.indptr))  # each entry of a row may take as much
    scale = np.zeros(int(label.max()) + 1)
    order = np.argsort(label, kind="stable")
    matrix = A.indptr, A.indices, A.data
    for _ in range(scale.size + 1):
        for rows in (order, order[::-1].copy()):
            if not raise_blocks(*matrix, size, spare, label, rows, scale):
                return exponent + scale[label].astype(np.int64)
    return exponent


@kernel
def raise_blocks(indptr, indices, data, size, spare, label, order, scale):
    """Raise the exponents `scale` of the blocks, row by row; tell whether one changed.

    `size` is log2 of v before scaling, `spare` log2 of what one entry outside the block
    may subtract from a row. Overwrites `scale`.
    """
    changed = False
    for i in order:
        most = -np.inf
        for k in range(indptr[i], indptr[i + 1]):
            j = indices[k]
            if label[j] != label[i] and data[k] != 0.0:
                most = max(most, np.log2(abs(data[k])) + size[j] + scale[label[j]])
        needed = np.ceil(most - spare[i])
        if needed > scale[label[i]]:
            scale[label[i]] = needed
            changed = True
    return changed


def solutions(K: Any, b: np.ndarray) -> Iterator[np.ndarray]:
    """Yield approximations of K^-1 b for a Z-matrix K with a positive diagonal."""
    n = K.shape[0]
    if n > LARGEST_FACTORED:
        yield from cycles(K, b)
        return
    if n <= LARGEST_DENSE_LU and K.nnz > n * n // 4:
        with contextlib.suppress(np.linalg.LinAlgError):
            yield np.linalg.solve(K.toarray(), b)
        return
    for threshold in (0.0, 1.0):  # pivots from the diagonal do not depend on scaling
        try:
            factor = splu(
                sparse.csc_array(K),
                permc_spec="MMD_AT_PLUS_A",
                diag_pivot_thresh=threshold,
                options={"SymmetricMode": threshold == 0.0},
            )
        except RuntimeError:  # exactly singular
            continue
        yield factor.solve(b)


def cycles(K: Any, b: np.ndarray) -> Iterator[np.ndarray]:
    """Yield x after each multigrid cycle for K x = b (Ruge and Stueben coarsening)."""
    import pyamg  # takes 0.5 s to import

    K = sparse.csr_matrix(K)
    D = K.diagonal()
    x = np.zeros_like(b)
    size = np.linalg.norm(b)
    before = np.inf
    levels = None
    for _ in range(CYCLES):
        try:
            if levels is None:
                levels = pyamg.ruge_stuben_solver(
                    K, interpolation="direct", coarse_solver="splu", max_coarse=500
                )
            x = levels.solve(b, x0=x, maxiter=1, tol=1e-16)
        except (ValueError, RuntimeError, np.linalg.LinAlgError):
            return  # a level is singular: K is not an M-matrix
        if not np.all(np.isfinite(x)):
            return
        yield x
        comparison_sweep(K.indptr, K.indices, K.data, b / D, x)
        residual = float(np.linalg.norm(b - K @ x))
        if residual <= 1e-13 * size or not residual < PROGRESS * before:
            return
        before = residual


@kernel
def comparison_sweep(indptr, indices, data, c, v):
    """Overwrite v by a forward and a backward Gauss-Seidel sweep on <A> v = D c.

    Returns the largest change of an entry in the backward sweep.
    """
    n = v.size
    largest = 0.0
    for backward in range(2):
        largest = 0.0
        for t in range(n):
            i = n - 1 - t if backward else t
            d, r = 1.0, 0.0
            for k in range(indptr[i], indptr[i + 1]):
                j = indices[k]
                if j == i:
                    d = data[k]
                else:
                    r += abs(data[k]) * v[j]
            new = c[i] + r / d
            largest = max(largest, abs(new - v[i]))
            v[i] = new
    return largest
