"""A hash of numbers, to notice arrays that were changed in place."""

import cython
from cython.cimports import numpy as cnp

cnp.import_array()


def add_stamp(values, count, total):
    """Add a hash of the bits and places of numbers to a sum (mod 2^64).

    Each term is two rounds of the mixing of SplitMix64 (Steele, Lea and Flood, 2014).
    """
    bits = cython.cast(cython.pointer(cython.ulonglong), values)
    v: cython.ulonglong
    step: cython.ulonglong = 0x9E3779B97F4A7C15
    factor: cython.ulonglong = 0xBF58476D1CE4E5B9
    for i in range(count):
        v = bits[i] + cython.cast(cython.ulonglong, i) * step
        v = (v ^ (v >> 32)) * factor
        total += v ^ (v >> 29)
    return total


def stamp_of_arrays(arrays):
    """Return the hash of contiguous float64 arrays, one after another."""
    total = cython.cast(cython.ulonglong, 0)
    for array in arrays:
        own: cnp.ndarray = array
        values = cython.cast(cython.p_double, cnp.PyArray_DATA(own))
        total = add_stamp(values, cnp.PyArray_SIZE(own), total)
    return total
