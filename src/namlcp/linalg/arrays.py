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
    """Tell whether a value can go to compiled code as it is."""
    return _is_clean(value, cnp.NPY_DOUBLE, ndim)


def are_places(value):
    return _is_clean(value, cnp.NPY_INT32, 1)


def are_long(value):
    """Tell whether a value has such indices but for their 64 bits."""
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
    """Return a vector that is not set."""
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
    """Return where the `size` indices of an array of NumPy's own type for them are."""
    return cython.cast(cython.p_Py_ssize_t, _entries(array, cnp.NPY_INTP, size))


def signs(array, size):
    return cython.cast(cython.p_schar, _entries(array, cnp.NPY_INT8, size))


def _entries(array, kind, size):
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
