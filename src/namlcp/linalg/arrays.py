"""Where the entries of NumPy's arrays are, and hashes of them.

An array of another type, size or order is refused: what is read at its address would
have no meaning.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.namlcp.linalg.vectors import hash_of

cnp.import_array()

NO_ENTRIES = np.empty(0)


def fits(value, ndim):
    """Tell whether compiled code can take a value as it is: `ndim` axes of doubles."""
    return _is_clean(value, cnp.NPY_DOUBLE, ndim)


def are_places(value):
    return _is_clean(value, cnp.NPY_INT32, 1)


def are_long(value):
    return _is_clean(value, cnp.NPY_INT64, 1)


def _is_clean(value, kind, ndim):
    if not cnp.PyArray_CheckExact(value):
        return False
    array: cnp.ndarray = value
    return (
        cnp.PyArray_EquivTypenums(cnp.PyArray_TYPE(array), kind)
        and cnp.PyArray_NDIM(array) == ndim
        and cnp.PyArray_ISCARRAY_RO(array)
    )


def new_zeros(rows, columns):
    shape = cython.declare(cnp.npy_intp[2])
    shape[0], shape[1] = rows, columns
    return cnp.PyArray_ZEROS(2, shape, cnp.NPY_DOUBLE, 0)


def new_vector(size):
    if size == 0:
        return NO_ENTRIES
    return cnp.PyArray_EMPTY(1, cython.address(size), cnp.NPY_DOUBLE, 0)


def data_of(array):
    """Return where the entries are of an array that `fits`, which is not checked."""
    return cython.cast(cython.p_double, cnp.PyArray_DATA(array))


def numbers(array, size):
    return cython.cast(cython.p_double, _entries(array, cnp.NPY_DOUBLE, size))


def places(array, size):
    return cython.cast(cython.p_int, _entries(array, cnp.NPY_INT32, size))


def indices(array, size):
    return cython.cast(cython.p_Py_ssize_t, _entries(array, cnp.NPY_INTP, size))


def signs(array, size):
    return cython.cast(cython.p_schar, _entries(array, cnp.NPY_INT8, size))


def _entries(array, kind, size):
    """Return where the `size` entries of an array are; ValueError if it is another."""
    own: cnp.ndarray = array
    is_right: cython.bint = (
        cnp.PyArray_EquivTypenums(cnp.PyArray_TYPE(own), kind)
        and cnp.PyArray_ISCARRAY_RO(own)
        and cnp.PyArray_SIZE(own) == size
    )
    if not is_right:
        raise ValueError(
            f"{size} contiguous numbers are needed, got {array.dtype} of shape "
            f"{array.shape} with strides {array.strides}"
        )
    return cnp.PyArray_DATA(own)


# ---- hashes, to notice arrays that were changed in place


def stamp_of(parts, total=0):
    """Return a hash of a tuple of clean arrays; of sparse matrices, without places.

    None has no part in it; `total` is the hash of what comes before. Two QPs of one
    stamp are the same but for a rare chance.
    """
    for part in cython.cast(tuple, parts):
        if part is not None:
            array: cnp.ndarray = part if cnp.PyArray_CheckExact(part) else part.data
            total = hash_of(data_of(array), cnp.PyArray_SIZE(array), total)
    return total


def stamps_of_items(arrays, size: Py_ssize_t):
    """Return the hash of each item of contiguous float64 arrays that have so many."""
    stamps = np.zeros(size, np.uint64)
    total = cython.cast(cython.p_ulonglong, cnp.PyArray_DATA(stamps))
    for array in arrays:
        width = cnp.PyArray_SIZE(array) // max(size, 1)
        for i in range(size):
            total[i] = hash_of(data_of(array) + i * width, width, total[i])
    return stamps
