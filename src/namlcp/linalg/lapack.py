"""BLAS and LAPACK from compiled code: SciPy's own library, called without Python.

numba's np.linalg allocates and checks on every call, which small dense systems feel.
SciPy exports the addresses of its BLAS and LAPACK for Cython; here they get a name that
compiled, cached code can link against. Matrices are **row-major** (n, n) arrays: LAPACK
sees their transpose, so its "upper" is our lower triangle, and no copy is made.

With NUMBA_DISABLE_JIT=1 the same names fall back on scipy.linalg.
"""

import numpy as np
from llvmlite import binding
from numba import config, types
from numba.core import cgutils
from numba.extending import get_cython_function_address, intrinsic

from namlcp.compiled import part

_POINTER = types.CPointer(types.float64)
_INTEGER = types.CPointer(types.int32)


def _declare(module: str, name: str, arguments: tuple) -> types.ExternalFunction:
    """Return SciPy's routine `name` under a symbol that compiled code can link."""
    symbol = f"namlcp_{name}"
    binding.add_symbol(
        symbol, get_cython_function_address(f"scipy.linalg.{module}", name)
    )
    return types.ExternalFunction(symbol, types.void(*arguments))


if not config.DISABLE_JIT:
    _dpotrf = _declare(
        "cython_lapack", "dpotrf", (_INTEGER, _INTEGER, _POINTER, _INTEGER, _INTEGER)
    )
    _dpotrs = _declare(
        "cython_lapack",
        "dpotrs",
        (
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _POINTER,
            _INTEGER,
            _POINTER,
            _INTEGER,
            _INTEGER,
        ),
    )
    _dgetrf = _declare(
        "cython_lapack",
        "dgetrf",
        (_INTEGER, _INTEGER, _POINTER, _INTEGER, _INTEGER, _INTEGER),
    )
    _dgetrs = _declare(
        "cython_lapack",
        "dgetrs",
        (
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _POINTER,
            _INTEGER,
            _INTEGER,
            _POINTER,
            _INTEGER,
            _INTEGER,
        ),
    )

    _dgemm = _declare(
        "cython_blas",
        "dgemm",
        (
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _POINTER,
            _POINTER,
            _INTEGER,
            _POINTER,
            _INTEGER,
            _POINTER,
            _POINTER,
            _INTEGER,
        ),
    )
    _dtrsm = _declare(
        "cython_blas",
        "dtrsm",
        (
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _INTEGER,
            _POINTER,
            _POINTER,
            _INTEGER,
            _POINTER,
            _INTEGER,
        ),
    )

    @intrinsic
    def _number_address(typingctx, value):
        """Return a pointer to a double on the stack."""

        def codegen(context, builder, signature, args):
            return cgutils.alloca_once_value(builder, args[0])

        return _POINTER(types.float64), codegen

    @intrinsic
    def _address(typingctx, value):
        """Return a pointer to an int32 on the stack (Fortran passes by reference)."""

        def codegen(context, builder, signature, args):
            return cgutils.alloca_once_value(builder, args[0])

        return _INTEGER(types.int32), codegen

    @intrinsic
    def _integer_at(typingctx, pointer):
        """Return the int32 at an address."""

        def codegen(context, builder, signature, args):
            return builder.load(args[0])

        return types.int32(_INTEGER), codegen


# Any order of the sum is allowed, so that it vectorises; NaN keeps its meaning.
@part(fastmath={"reassoc"})
def dot(a, b):
    """Return a'b; the one reduction of the kernels that is worth vectorising."""
    total = 0.0
    for i in range(a.size):
        total += a[i] * b[i]
    return total


@part
def copy(a, out):
    """Set out[:a.size] to a; a plain loop compiles faster than a slice assignment."""
    for i in range(a.size):
        out[i] = a[i]


@part
def matvec(A, x, out):
    """Set out (m,) to A x for a row-major A (m, n)."""
    for i in range(A.shape[0]):
        out[i] = dot(A[i], x)


@part
def add_rmatvec(A, y, out):
    """Add A'y to out (n,), skipping the zeros of y (m,)."""
    for i in range(A.shape[0]):
        if y[i] != 0.0:
            add_scaled(y[i], A[i], out)


@part
def add_scaled(scale, a, out):
    """Add scale * a to out (n,)."""
    for j in range(out.size):
        out[j] += scale * a[j]


@part
def cholesky(A):
    """Overwrite the lower triangle of A (n, n) by L, A = L L'. Return 0 if it exists.

    Only the lower triangle is read or written; k > 0 means that the leading minor of
    order k is not positive.
    """
    n = np.int32(A.shape[0])
    if n == 0:
        return 0
    info = _address(np.int32(0))
    _dpotrf(_address(np.int32(85)), _address(n), A.ctypes, _address(n), info)
    return _integer_at(info)


@part
def cholesky_solve(L, b):
    """Overwrite b (n,) by the solution of L L' x = b."""
    n = np.int32(L.shape[0])
    if n == 0:
        return
    _dpotrs(
        _address(np.int32(85)),
        _address(n),
        _address(np.int32(1)),
        L.ctypes,
        _address(n),
        b.ctypes,
        _address(n),
        _address(np.int32(0)),
    )


@part
def forward_solve(L, b):
    """Overwrite b (n,) by the solution of L x = b, L lower triangular."""
    for i in range(b.size):
        b[i] = (b[i] - dot(L[i, :i], b[:i])) / L[i, i]


@part
def backward_solve(L, b):
    """Overwrite b (n,) by the solution of L' x = b, L lower triangular."""
    for i in range(b.size - 1, -1, -1):
        b[i] /= L[i, i]
        add_scaled(-b[i], L[i, :i], b[:i])


@part
def lu(A, pivots):
    """Overwrite A (n, n) by the LU factors of A', pivots (n,) int32; 0 if regular.

    k > 0 means that the k-th pivot is exactly zero.
    """
    n = np.int32(A.shape[0])
    if n == 0:
        return 0
    info = _address(np.int32(0))
    _dgetrf(_address(n), _address(n), A.ctypes, _address(n), pivots.ctypes, info)
    return _integer_at(info)


@part
def lu_solve(factors, pivots, b):
    """Overwrite b (n,) by the solution of A x = b, with factors from `lu`."""
    n = np.int32(factors.shape[0])
    if n == 0:
        return
    _dgetrs(
        _address(np.int32(84)),
        _address(n),
        _address(np.int32(1)),
        factors.ctypes,
        _address(n),
        pivots.ctypes,
        b.ctypes,
        _address(n),
        _address(np.int32(0)),
    )


@part
def product(alpha, A, B, beta, C):
    """Overwrite C (m, n) by alpha A B' + beta C; A (m, k), B (n, k), rows may be apart.

    With beta = 0 C need not be finite on entry.
    """
    m, n = np.int32(C.shape[0]), np.int32(C.shape[1])
    if m == 0 or n == 0:
        return
    _dgemm(
        _address(np.int32(84)),
        _address(np.int32(78)),
        _address(n),
        _address(m),
        _address(np.int32(A.shape[1])),
        _number_address(alpha),
        B.ctypes,
        _address(np.int32(B.strides[0] // 8)),
        A.ctypes,
        _address(np.int32(A.strides[0] // 8)),
        _number_address(beta),
        C.ctypes,
        _address(np.int32(C.strides[0] // 8)),
    )


@part
def solve_rows(L, unit, X):
    """Overwrite X (m, k) by X L'^-1, L (k, k) lower triangular, rows may be apart.

    With `unit` its diagonal counts as 1, whatever stands there.
    """
    m, k = np.int32(X.shape[0]), np.int32(X.shape[1])
    if m == 0 or k == 0:
        return
    _dtrsm(
        _address(np.int32(76)),
        _address(np.int32(85)),
        _address(np.int32(84)),
        _address(np.int32(85 if unit else 78)),
        _address(k),
        _address(m),
        _number_address(1.0),
        L.ctypes,
        _address(np.int32(L.strides[0] // 8)),
        X.ctypes,
        _address(np.int32(X.strides[0] // 8)),
    )


if config.DISABLE_JIT:
    from scipy.linalg import lapack as _lapack
    from scipy.linalg import solve_triangular

    def cholesky(A):  # type: ignore[no-redef]
        """Overwrite the lower triangle of A by L, A = L L'. Return 0 if it exists."""
        if A.shape[0] == 0:
            return 0
        L, info = _lapack.dpotrf(A, lower=1, clean=0)
        A[:] = np.tril(L) + np.triu(A, 1)
        return info

    def cholesky_solve(L, b):  # type: ignore[no-redef]
        """Overwrite b (n,) by the solution of L L' x = b."""
        if b.size:
            b[:] = _lapack.dpotrs(L, b, lower=1)[0]

    def lu(A, pivots):  # type: ignore[no-redef]
        """Overwrite A by the LU factors of A', pivots (n,) int32."""
        if A.shape[0] == 0:
            return 0
        factors, piv, info = _lapack.dgetrf(A.T)
        A[:] = factors.T
        pivots[:] = piv
        return info

    def lu_solve(factors, pivots, b):  # type: ignore[no-redef]
        """Overwrite b (n,) by the solution of A x = b, with factors from `lu`."""
        if b.size:
            b[:] = _lapack.dgetrs(factors.T, pivots, b, trans=1)[0]

    def product(alpha, A, B, beta, C):  # type: ignore[no-redef]
        """Overwrite C by alpha A B' + beta C."""
        C[:] = alpha * (A @ B.T) + (beta * C if beta else 0.0)

    def solve_rows(L, unit, X):  # type: ignore[no-redef]
        """Overwrite X (m, k) by X L'^-1, L lower triangular."""
        if X.size:
            X[:] = solve_triangular(L, X.T, lower=True, unit_diagonal=unit).T
