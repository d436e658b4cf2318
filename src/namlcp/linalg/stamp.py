"""A hash of numbers, to notice arrays that were changed in place."""

import cython
from cython.cimports import numpy as cnp
from cython.cimports.namlcp.linalg.vectors import hash_of

cnp.import_array()


def stamp_of_arrays(arrays):
    """Return the hash of contiguous float64 arrays, one after another."""
    total = cython.cast(cython.ulonglong, 0)
    for array in arrays:
        own: cnp.ndarray = array
        values = cython.cast(cython.p_double, cnp.PyArray_DATA(own))
        total = hash_of(values, cnp.PyArray_SIZE(own), total)
    return total
