"""The KKT matrix K, its varying diagonal, its LDL' factors and solves with them.

        [P  A'  G']          [P + dx   A'   G']
    K = [A  0   0 ],   K~ =  [A       -dy    0],   dx, dy, dv > 0 (quasi-definite).
        [G  0   0 ]          [G        0   -dv]

K is kept as the upper triangle in CSC, so column n + i is row i of C = [A; G] and the
diagonal is the last entry of every column. Iterative refinement measures residuals as
max |r_i| / max(1, |K~_ii|): rows of inactive constraints have diagonals of 1e10 and
more, and would outweigh all others. If refinement ends early, GMRES(8), preconditioned
by the factors, continues.
"""

import numpy as np
from scipy.sparse import csc_array, csr_array

from namlcp.checks import refuse_size
from namlcp.compiled import kernel
from namlcp.linalg import Factors, arrays_of, factor

# Most refinement steps of a solve; `KKT.accuracy` unless the caller changes it.
REFINEMENT_STEPS, DEFAULT_ACCURACY = 11, 1e-14
# Relative residual after refinement above which GMRES runs, and its iterations.
GMRES_ABOVE, KRYLOV = 1e-9, 8
# Residuals are relative to the norm of the right-hand side, or to this if larger.
SMALL_RHS = 1e-8


class KKT:
    """K with the factors of K~.

    Attributes
    ----------
    indptr, indices, base : upper triangle of K in CSC, all diagonal entries stored
    triangle : these three
    data : values of K~; the caller writes its diagonal, data[diagonal]
    diagonal : positions of the diagonal entries in `base` and `data`
    factored : the `data` that `factors` belong to
    accuracy : relative residual at which refinement stops
    n, size : order of P; order of K
    """

    def __init__(
        self, P: csc_array, A: csr_array, G: csr_array, last: "KKT | None" = None
    ) -> None:
        """Lay out K for P (both triangles stored), A and G.

        It shares the factors of `last` if that has the same pattern.
        """
        self.accuracy = DEFAULT_ACCURACY
        self.n = P.shape[0]
        self.size = self.n + A.shape[0] + G.shape[0]
        entries = P.nnz + A.nnz + G.nnz + self.size
        refuse_size("the KKT matrix", entries)
        self.indptr = np.zeros(self.size + 1, dtype=np.int32)
        indices, base = np.empty(entries, dtype=np.int32), np.empty(entries)
        upper_triangle(*map(arrays_of, (P, A, G)), self.indptr, indices, base)
        self.indices = indices[: self.indptr[-1]].copy()
        self.base = base[: self.indptr[-1]].copy()
        self.triangle = self.indptr, self.indices, self.base
        self.diagonal = self.indptr[1:] - 1
        self.matrix = csc_array(
            (self.base.copy(), self.indices, self.indptr), shape=(self.size, self.size)
        )
        self.data = self.matrix.data
        self.factors: Factors | None = None
        self.factored = np.full(self.data.size, np.nan)  # unlike any data
        if last is not None and (
            np.array_equal(last.indptr, self.indptr)
            and np.array_equal(last.indices, self.indices)
        ):
            self.factors, self.factored = last.factors, last.factored
        self.weight = np.ones(self.size)
        self.residual = np.empty(self.size)
        self.trial = np.empty(self.size)

    def factor(self) -> bool:
        """Factor K~ unless `data` are factored already; False if a pivot vanishes."""
        if set_weights(self.data, self.diagonal, self.factored, self.weight):
            return True
        self.factored[-1] = np.nan  # should this fail, no data match
        try:
            if self.factors is None:
                self.factors = factor(self.matrix)
            else:
                self.factors.refactor(self.data)
        except (RuntimeError, ValueError):
            return False
        self.factored[:] = self.data
        return True

    def solve_once(self, rhs: np.ndarray) -> np.ndarray:
        """Return the solution of K~ u = rhs without refinement."""
        assert self.factors is not None
        return self.factors.solve(rhs)

    def remainder(self, rhs: np.ndarray, u: np.ndarray, r: np.ndarray) -> float:
        """Set r = rhs - K~ u; return its weighted norm."""
        K = self.indptr, self.indices, self.data
        return set_remainder(*K, self.weight, rhs, u, r)

    def solve(self, rhs: np.ndarray) -> tuple[np.ndarray, float]:
        """Return a refined solution u of K~ u = rhs and its relative residual."""
        size = max(SMALL_RHS, weighted_norm(rhs, self.weight))
        u = self.solve_once(rhs)
        r, other = self.residual, self.trial
        error = self.remainder(rhs, u, r) / size
        for _ in range(REFINEMENT_STEPS):
            if error <= self.accuracy:
                break
            better = self.solve_once(r)
            better += u
            new = self.remainder(rhs, better, other) / size
            if not new < error:
                break
            gained = new <= 0.5 * error
            u, error, r, other = better, new, other, r
            if not gained:
                break
        if not error <= GMRES_ABOVE:
            u, error = self.gmres(rhs, u, error, size)
        return u, error

    def gmres(
        self, rhs: np.ndarray, u: np.ndarray, error: float, size: float
    ) -> tuple[np.ndarray, float]:
        """Return the better of u and one cycle of GMRES(8) from it, and its error."""
        r = np.empty(self.size)
        self.remainder(rhs, u, r)
        r /= self.weight
        beta = float(np.linalg.norm(r))
        if not 0.0 < beta < np.inf:
            return u, error
        basis = np.zeros((KRYLOV + 1, self.size))
        steps = np.zeros((KRYLOV, self.size))
        H = np.zeros((KRYLOV + 1, KRYLOV))
        basis[0] = r / beta
        zero = np.zeros(self.size)
        used = 0
        for k in range(KRYLOV):
            steps[k] = self.solve_once(basis[k] * self.weight)
            self.remainder(zero, steps[k], r)
            r /= -self.weight
            for _ in range(2):  # orthogonalised twice against rounding
                h = basis[: k + 1] @ r
                r -= h @ basis[: k + 1]
                H[: k + 1, k] += h
            H[k + 1, k] = np.linalg.norm(r)
            if not np.isfinite(H[: k + 2, k]).all():
                break
            used = k + 1
            if H[k + 1, k] <= 1e-14 * beta:
                break
            basis[k + 1] = r / H[k + 1, k]
        if used == 0:
            return u, error
        first = np.zeros(used + 1)
        first[0] = beta
        weights = np.linalg.lstsq(H[: used + 1, :used], first, rcond=None)[0]
        better = u + weights @ steps[:used]
        new = self.remainder(rhs, better, r) / size
        return (better, new) if new < error else (u, error)


@kernel
def upper_triangle(P, A, G, indptr, indices, data):
    """Write the upper triangle of K from P in CSC (both triangles), A and G in CSR.

    indptr, indices and data take the triangle; indptr[0] is 0 on entry.
    """
    n = P.indptr.size - 1
    k = 0
    for j in range(n):
        diagonal = 0.0
        for t in range(P.indptr[j], P.indptr[j + 1]):
            if P.indices[t] < j:
                indices[k] = P.indices[t]
                data[k] = P.data[t]
                k += 1
            elif P.indices[t] == j:
                diagonal = P.data[t]
        indices[k] = j
        data[k] = diagonal
        k += 1
        indptr[j + 1] = k
    column = n
    for C in (A, G):
        for i in range(C.indptr.size - 1):
            for t in range(C.indptr[i], C.indptr[i + 1]):
                indices[k] = C.indices[t]
                data[k] = C.data[t]
                k += 1
            indices[k] = column
            data[k] = 0.0
            k += 1
            column += 1
            indptr[column] = k


@kernel
def set_weights(data, diagonal, factored, weight):
    """Set weight_i = max(1, |K~_ii|); tell whether `data` equal `factored`."""
    for i in range(weight.size):
        weight[i] = max(1.0, abs(data[diagonal[i]]))
    for t in range(data.size - 1, -1, -1):
        if data[t] != factored[t]:
            return False
    return True


@kernel
def weighted_norm(r, weight):
    """Return max |r_i| / weight_i, NaN if an entry is."""
    worst = 0.0
    for i in range(r.size):
        value = abs(r[i]) / weight[i]
        if not value <= worst:
            worst = value
            if value != value:
                break
    return worst


@kernel
def set_remainder(indptr, indices, data, weight, rhs, u, r):
    """Set r = rhs - K~ u; return its norm max |r_i| / weight_i."""
    for i in range(r.size):
        r[i] = rhs[i]
    for j in range(r.size):
        last = indptr[j + 1] - 1
        uj = u[j]
        total = data[last] * uj
        for t in range(indptr[j], last):
            i = indices[t]
            r[i] -= data[t] * uj
            total += data[t] * u[i]
        r[j] -= total
    return weighted_norm(r, weight)


@kernel
def products(indptr, indices, base, x, v, Px, Ctv, t):
    """Set Px = P x, Ctv = C'v[n:] and t = (x, C x); x, Px, Ctv are (n,), v, t (size,).

    indptr, indices, base are the upper triangle of K.
    """
    n = x.size
    for j in range(n):
        Px[j] = 0.0
        Ctv[j] = 0.0
        t[j] = x[j]
    for j in range(n):
        last = indptr[j + 1] - 1
        xj = x[j]
        total = base[last] * xj
        for k in range(indptr[j], last):
            i = indices[k]
            Px[i] += base[k] * xj
            total += base[k] * x[i]
        Px[j] += total
    for j in range(n, t.size):
        vj = v[j]
        total = 0.0
        for k in range(indptr[j], indptr[j + 1] - 1):
            i = indices[k]
            Ctv[i] += base[k] * vj
            total += base[k] * x[i]
        t[j] = total
