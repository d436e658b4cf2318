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

# The letters that LAPACK takes as options.
UPPER, TRANSPOSED = ord("U"), ord("T")


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


LAPACK = "scipy.linalg.cython_lapack"
_dpotrf = declare(LAPACK, "dpotrf", "iidii")
_dpotrs = declare(LAPACK, "dpotrs", "iiididii")
_dgetrf = declare(LAPACK, "dgetrf", "iidiii")
_dgetrs = declare(LAPACK, "dgetrs", "iiidiidii")


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


@part
def copy(a, out):
    """Set out[:a.size] to a; a plain loop compiles faster than a slice assignment."""
    for i in range(a.size):
        out[i] = a[i]


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
