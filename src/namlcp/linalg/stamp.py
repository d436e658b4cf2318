"""A hash of numbers, to notice arrays that were changed in place."""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.namlcp.linalg.vectors import hash_of

cnp.import_array()


def stamp_of_arrays(arrays, total: cython.ulonglong = 0):
    """Return the hash of contiguous float64 arrays, one after another.

    total: that of those before them.
    """
    for array in arrays:
        own: cnp.ndarray = array
        values = cython.cast(cython.p_double, cnp.PyArray_DATA(own))
        total = hash_of(values, cnp.PyArray_SIZE(own), total)
    return total


def stamps_of_items(arrays, size: Py_ssize_t):
    """Return the hash of each item of contiguous float64 arrays that have so many."""
    stamps = np.zeros(size, np.uint64)
    total = cython.cast(cython.p_ulonglong, cnp.PyArray_DATA(stamps))
    for array in arrays:
        own: cnp.ndarray = array
        values = cython.cast(cython.p_double, cnp.PyArray_DATA(own))
        width = cnp.PyArray_SIZE(own) // max(size, 1)
        for i in range(size):
            total[i] = hash_of(values + i * width, width, total[i])
    return stamps
