"""Vectors in code that numba compiles."""

from namlcp.compiled import part


@part
def copy(a, out):
    """Set out[:a.size] to a; a plain loop compiles faster than a slice assignment."""
    for i in range(a.size):
        out[i] = a[i]
