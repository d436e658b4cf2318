"""The sweep methods as splittings A = M - N, and the matrices that bound a sweep.

The sweep is (1) of `convergence`, with M and N here for M + E - L and N + E - L of the
nam* methods; the accelerated family has L R(s+) in place of L R(s).
"""

import math
from typing import Any, NamedTuple

import numpy as np
from scipy import sparse

from namlcp.checks import finite_square_matrix
from namlcp.lcp import SWEEPS, Parameters, find_method
from namlcp.lcp.modulus.methods import checked_parameters


class Splitting(NamedTuple):
    """A method on a matrix: the quantities of (1), and those of its sweep.

    A, M and N are those of (1), E and L included; csr_array. omega is the diagonal of
    Omega. alpha, G and H are those of `namlcp.lcp.modulus.sweeps` where M is
    triangular; G is NaN where M = A or A + E - L. H = 0 except in the accelerated
    family.
    """

    A: Any
    M: Any
    N: Any
    omega: np.ndarray
    alpha: float
    G: float
    H: float


def splitting(A: Any, method: str, parameters: Parameters) -> Splitting:
    """Return the splitting of a method, checked; arguments as in `converges`."""
    values = parameters._asdict()
    find_method(method, [name for name in values if values[name] is not None])
    for name, value in values.items():
        if isinstance(value, str) and name in ("alpha", "omega"):
            raise ValueError(
                f"{name} must be given in numbers, got {value!r}: no theorem is about "
                "parameters that change from sweep to sweep"
            )
    if method not in SWEEPS:
        raise ValueError(f"method must be a sweep method, got {method!r}")
    chosen = SWEEPS[method]
    A = finite_square_matrix("A", A, "csr")
    n = A.shape[0]
    alpha, beta, omega, shift = checked_parameters(A, method, parameters)
    E = np.zeros(n) if shift is None else shift
    A = sparse.csr_array(A)
    if chosen.factored:
        addition = sparse.diags_array(E) + chosen.own * sparse.tril(A, -1)
        M, N = sparse.csr_array(A + addition), sparse.csr_array(addition)
        return Splitting(A, M, N, omega, 1.0, math.nan, 0.0)
    own = max(chosen.own, 0.0)  # the accelerated family splits A as Zheng and Yin do
    weight = beta / alpha + own
    D = A.diagonal()
    lower, upper = sparse.tril(A, -1), sparse.triu(A, 1)
    M = sparse.diags_array(D / alpha + E) + weight * lower
    N = sparse.diags_array((1.0 / alpha - 1.0) * D + E) - upper
    N = N + (weight - 1.0) * lower
    M, N = sparse.csr_array(M), sparse.csr_array(N)
    return Splitting(A, M, N, omega, alpha, beta / alpha + chosen.own, chosen.reflected)


def comparison(parts: Splitting) -> tuple[Any, Any]:
    """Return C and W, T <= C^-1 W, as in `namlcp.theory.convergence`."""
    A, M, N, omega, alpha, G, H = parts
    D = A.diagonal()
    if H:
        lower, upper = abs(sparse.tril(A, -1)), abs(sparse.triu(A, 1))
        C = sparse.diags_array(D / alpha + omega) - (G + H) * lower
        weight = abs(1.0 / alpha - 1.0) * D + np.abs(omega - D)
        W = sparse.diags_array(weight) + abs(G) * lower + 2.0 * upper
        return sparse.csr_array(C), sparse.csr_array(W)
    X = sparse.csr_array(M + sparse.diags_array(omega))
    C = 2.0 * sparse.diags_array(np.abs(X.diagonal())) - abs(X)  # <X>
    W = abs(N) + abs(sparse.diags_array(omega) - A)
    return sparse.csr_array(C), sparse.csr_array(W)
