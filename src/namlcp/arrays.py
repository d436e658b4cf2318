"""Entries of NumPy's arrays: where they are, loops over them, and hashes of them.

An array of another type, size or order is refused: what is read at its address would
have no meaning. The loops return new arrays.
"""

import cython
import numpy as np
from cython import Py_ssize_t
from cython.cimports import numpy as cnp
from cython.cimports.libc.math import INFINITY, fabs
from scipy.sparse import csc_array, csr_array

cnp.import_array()

# Most entries of any matrix, the KKT matrix included: int32 counts them.
MOST_ENTRIES = 2**31 - 1
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


def new_vector(size):
    if size == 0:
        return NO_ENTRIES
    return cnp.PyArray_EMPTY(1, cython.address(size), cnp.NPY_DOUBLE, 0)


def new_places(size):
    return cnp.PyArray_EMPTY(1, cython.address(size), cnp.NPY_INT32, 0)


def same_places(size, value):
    """Return places that are all the same."""
    array = new_places(size)
    place = cython.cast(cython.p_int, cnp.PyArray_DATA(array))
    for i in range(size):
        place[i] = value
    return array


def new_indices(size):
    return cnp.PyArray_EMPTY(1, cython.address(size), cnp.NPY_INTP, 0)


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
    """Return a hash of the numbers of arrays, of sparse matrices without their places.

    total: that of arrays before them; None counts for nothing. It is 1 where others
    have taken their places: whoever holds a sparse matrix may replace its numbers.
    """
    for part in cython.cast(tuple, parts):
        if part is not None:
            array: cnp.ndarray = part if cnp.PyArray_CheckExact(part) else part.data
            kind = cnp.PyArray_TYPE(array)
            is_double = cnp.PyArray_EquivTypenums(kind, cnp.NPY_DOUBLE)
            if not (is_double and cnp.PyArray_ISONESEGMENT(array)):
                return 1
            total = hash_of(data_of(array), cnp.PyArray_SIZE(array), total)
    return total


def stamps_of_items(arrays, size: Py_ssize_t):
    """Return the hash of each item of contiguous float64 arrays that have so many."""
    stamps = np.zeros(size, np.uint64)
    total = cython.cast(cython.p_ulonglong, cnp.PyArray_DATA(stamps))
    for array in arrays:
        values, width = data_of(array), cnp.PyArray_SIZE(array) // max(size, 1)
        for i in range(size):
            total[i] = hash_of(values + i * width, width, total[i])
    return stamps


# ---- loops over all entries


def refuse_size(name, entries):
    if entries > MOST_ENTRIES:
        raise MemoryError(
            f"{name} would have {entries:.1e} entries of {8e-9 * entries:.0f} GB, "
            f"allowed are {MOST_ENTRIES:.1e}"
        )


def is_bad(array, infinite_allowed):
    """Tell whether a NaN (or an infinite value unless allowed) is among the numbers."""
    size, bad = array.size, cython.cast(Py_ssize_t, 0)
    values = numbers(array, size)
    for i in range(size):
        v = fabs(values[i])
        bad += not (v <= INFINITY if infinite_allowed else v < INFINITY)
    return bad > 0


def dense_asymmetry(P):
    """Return (max |P - P'|, max |P|), read in tiles that stay in the cache."""
    gap, size = 0.0, 0.0
    n: Py_ssize_t = P.shape[0]
    for first in range(0, n, TILE):
        for left in range(0, first + 1, TILE):
            for i in range(first, min(first + TILE, n)):
                for j in range(left, min(left + TILE, i + 1)):
                    gap = max(gap, fabs(P[i, j] - P[j, i]))
                    size = max(size, max(fabs(P[i, j]), fabs(P[j, i])))
    return gap, size


def sparse_asymmetry(indptr, indices, data):
    """Return (max |P - P'|, max |P|) of a canonical square CSR or CSC matrix."""
    n: Py_ssize_t = indptr.size - 1
    nnz: Py_ssize_t = data.size
    start, row, value = places(indptr, n + 1), places(indices, nnz), numbers(data, nnz)
    room = new_places(n)
    following = places(room, n)  # after what has been met of each upper column
    gap = size = 0.0
    for j in range(n):
        following[j] = start[j]
    for j in range(n):
        for t in range(start[j], start[j + 1]):
            i = row[t]
            size = max(size, fabs(value[t]))
            if i < j and t >= following[j]:  # alone
                gap = max(gap, fabs(value[t]))
            elif i > j:
                s, end = following[i], start[i + 1]
                while s < end and row[s] < j:  # alone
                    gap = max(gap, fabs(value[s]))
                    s += 1
                other = 0.0
                if s < end and row[s] == j:
                    other = value[s]
                    s += 1
                gap, following[i] = max(gap, fabs(value[t] - other)), s
    return gap, size


# ---- compressed sparse matrices: CSC, or CSR with rows for columns


def index_order(indptr, indices, major, minor):
    """Return the `Order` of `major` columns of indices below `minor`.

    CORRUPT ones are out of range, which no loop checks later. CANONICAL ones ascend in
    every column, so that there are no duplicates.
    """
    order = CANONICAL
    size: Py_ssize_t = indices.size
    if indptr.size != major + 1 or indptr[0] != 0:
        return CORRUPT
    start, place = places(indptr, major + 1), places(indices, size)
    for j in range(major):
        if not start[j] <= start[j + 1] <= size:
            return CORRUPT
        before = -1
        for t in range(start[j], start[j + 1]):
            i = place[t]
            if i < 0 or i >= minor:
                return CORRUPT
            if i <= before:
                order = UNSORTED
            before = i
    return order


def narrowed(indices):
    """Return indices of 64 bits in 32, None if one does not fit."""
    found = new_places(indices.shape[0])
    short = places(found, indices.shape[0])
    for t in range(indices.shape[0]):
        short[t] = indices[t]
        if short[t] != indices[t]:
            return None
    return found


def transposed(indptr, indices, data, rows):
    """Return (indptr, indices, data) of M' for M in CSC with that many rows."""
    n: Py_ssize_t = indptr.size - 1
    size: Py_ssize_t = indices.size
    start, row = places(indptr, n + 1), places(indices, size)
    value = numbers(data, size)
    end = start[n]
    found = same_places(rows + 1, 0), new_places(end), new_vector(end)
    turned, columns = places(found[0], rows + 1), places(found[1], end)
    values = numbers(found[2], end)
    for t in range(end):
        turned[row[t]] += 1
    for i in range(rows):  # turned[i] is the end of column i, then its beginning
        turned[i + 1] += turned[i]
    for j in range(n - 1, -1, -1):
        for t in range(start[j + 1] - 1, start[j] - 1, -1):
            k = turned[row[t]] - 1
            columns[k] = j
            values[k] = value[t]
            turned[row[t]] = k
    return found


def compressed(C):
    """Return the CSC arrays (indptr, indices, data) of a dense matrix."""
    rows, columns = C.shape[0], C.shape[1]
    count = np.count_nonzero(C)
    found = same_places(columns + 1, 0), new_places(count), new_vector(count)
    indptr, indices = places(found[0], columns + 1), places(found[1], count)
    data = numbers(found[2], count)
    k: Py_ssize_t = 0
    for j in range(columns):
        for i in range(rows):
            if C[i, j] != 0.0:
                indices[k] = i
                data[k] = C[i, j]
                k += 1
        indptr[j + 1] = k
    return found


# Matrices that `from_arrays` copies; that their format is canonical is noted in them.
EMPTY = {kind: kind((0, 0)) for kind in (csc_array, csr_array)}
for M in EMPTY.values():
    M.has_canonical_format = True


def from_arrays(parts, shape, kind=csc_array):
    """Return (indptr, indices, data), sorted and without duplicates, as a matrix.

    `kind` is csc_array or csr_array. Its constructor would take 13 us for checks.
    """
    M = object.__new__(kind)
    M.__dict__.update(EMPTY[kind].__dict__)
    M.indptr, M.indices, M.data = parts
    M._shape = shape
    return M


def constant(n, value, kind=float):
    """Return np.full(n, value, kind), in a third of its time."""
    array = np.empty(n, kind)
    array.fill(value)
    return array
