"""SciPy's BLAS and LAPACK, called from compiled code without Python.

numba's np.linalg allocates and checks on every call, which is slow for small systems.
SciPy exports the addresses of its BLAS and LAPACK for Cython; here they get names that
compiled, cached code can link to. Matrices are **row-major**: LAPACK sees their
transpose, so that its "upper" triangle is the lower one here, and no copy is made.
"""

import ctypes
from typing import Any

from llvmlite import binding
from numba import config, types
from numba.extending import get_cython_function_address, intrinsic

from namlcp.compiled import part

# The letters that BLAS and LAPACK take as options.
UPPER = UNIT = ord("U")
FROM_LEFT, PLAIN, TRANSPOSED = (ord(letter) for letter in "LNT")


def declare(module: str, name: str, arguments: str, value: Any = None) -> Any:
    """Return a function of a Cython module under a symbol that compiled code can link.

    `arguments` has i for every pointer to integers (or letters), d for one to doubles,
    n for a size; `value` is the letter of what it returns, i for an int. Without numba
    it is called by ctypes.
    """
    address = get_cython_function_address(module, name)
    if config.DISABLE_JIT:
        returned = ctypes.c_double if value == "d" else None
        return ctypes.CFUNCTYPE(returned)(address)
    symbol = f"namlcp_{name}"
    binding.add_symbol(symbol, address)
    kinds = {"i": types.int32, "d": types.float64}
    given = [
        types.intp if letter == "n" else types.CPointer(kinds[letter])
        for letter in arguments
    ]
    return types.ExternalFunction(symbol, kinds.get(value, types.void)(*given))


LAPACK, BLAS = "scipy.linalg.cython_lapack", "scipy.linalg.cython_blas"
_dpotrf = declare(LAPACK, "dpotrf", "iidii")
_dpotrs = declare(LAPACK, "dpotrs", "iiididii")
_dgetrf = declare(LAPACK, "dgetrf", "iidiii")
_dgetrs = declare(LAPACK, "dgetrs", "iiidiidii")
_dgemm = declare(BLAS, "dgemm", "iiiiiddididdi")
_dtrsm = declare(BLAS, "dtrsm", "iiiiiiddidi")
_ddot = declare(BLAS, "ddot", "ididi", "d")


if config.DISABLE_JIT:

    def _address(value):
        """Return a pointer to a double or an int32, as Fortran wants."""
        kind = ctypes.c_double if isinstance(value, float) else ctypes.c_int32
        return ctypes.byref(kind(value))

    def _integer_at(pointer):
        """Return the int32 at an address."""
        return pointer._obj.value

else:

    @intrinsic
    def _address(typingctx, value):
        """Return a pointer to a double or an int32 on the stack, as Fortran wants."""
        kind = types.float64 if isinstance(value, types.Float) else types.int32

        def codegen(context, builder, signature, args):
            with builder.goto_entry_block():
                place = builder.alloca(args[0].type)
            builder.store(args[0], place)
            return place

        return types.CPointer(kind)(kind), codegen

    @intrinsic
    def _integer_at(typingctx, pointer):
        """Return the int32 at an address."""

        def codegen(context, builder, signature, args):
            return builder.load(args[0])

        return types.int32(types.CPointer(types.int32)), codegen


# Any order of the sum is allowed, so that it vectorises; NaN keeps its meaning.
@part(fastmath={"reassoc"})
def dot(a, b):
    """Return a'b."""
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
def add_scaled(scale, a, out):
    """Add scale * a to out (n,)."""
    for j in range(out.size):
        out[j] += scale * a[j]


@part
def blas_dot(a, b):
    """Return a'b with the sum of a.dot(b)."""
    one = _address(1)
    return _ddot(_address(a.size), a.ctypes, one, b.ctypes, one)


@part
def cholesky(A):
    """Overwrite the lower triangle of A (n, n) by L, A = L L'; return 0 if L exists.

    The upper triangle is neither read nor written. A result k > 0 means that the
    leading minor of order k is not positive.
    """
    if A.shape[0] == 0:
        return 0
    n, info = _address(A.shape[0]), _address(0)
    _dpotrf(_address(UPPER), n, A.ctypes, n, info)
    return _integer_at(info)


@part
def cholesky_solve(L, b):
    """Overwrite b (n,) by the solution of L L' x = b."""
    if b.size > 0:
        n, one, info = _address(L.shape[0]), _address(1), _address(0)
        _dpotrs(_address(UPPER), n, one, L.ctypes, n, b.ctypes, n, info)


@part
def lu(A, pivots):
    """Overwrite A (n, n) and pivots (n,) int32 by the LU factors of A'.

    Returns 0, or k > 0 if the k-th pivot is exactly zero.
    """
    if A.shape[0] == 0:
        return 0
    n, info = _address(A.shape[0]), _address(0)
    _dgetrf(n, n, A.ctypes, n, pivots.ctypes, info)
    return _integer_at(info)


@part
def lu_solve(factors, pivots, b):
    """Overwrite b (n,) by the solution of A x = b, with factors from `lu`."""
    if b.size > 0:
        n, one, info = _address(factors.shape[0]), _address(1), _address(0)
        _dgetrs(
            _address(TRANSPOSED), n, one, factors.ctypes, n, pivots.ctypes, b.ctypes, n,
            info,
        )  # fmt: skip


@part
def product(alpha, A, B, beta, C):
    """Overwrite C (m, n) by alpha A B' + beta C for A (m, k), B (n, k).

    Rows may be strided. With beta = 0, C need not be finite on entry.
    """
    if C.shape[0] > 0 and C.shape[1] > 0:
        _dgemm(
            _address(TRANSPOSED), _address(PLAIN), _address(C.shape[1]),
            _address(C.shape[0]), _address(A.shape[1]), _address(alpha), B.ctypes,
            _address(B.strides[0] // 8), A.ctypes, _address(A.strides[0] // 8),
            _address(beta), C.ctypes, _address(C.strides[0] // 8),
        )  # fmt: skip


@part
def solve_rows(L, unit, X):
    """Overwrite X (m, k) by X L'^-1, L (k, k) lower triangular; rows may be strided.

    With `unit` the diagonal of L is taken as 1 and not read.
    """
    if X.shape[0] > 0 and X.shape[1] > 0:
        _dtrsm(
            _address(FROM_LEFT), _address(UPPER), _address(TRANSPOSED),
            _address(UNIT if unit else PLAIN), _address(X.shape[1]),
            _address(X.shape[0]), _address(1.0), L.ctypes,
            _address(L.strides[0] // 8), X.ctypes, _address(X.strides[0] // 8),
        )  # fmt: skip
