from numpy cimport ndarray, npy_intp

cdef extern from "vectors.h" nogil:
    unsigned long long hash_of(
        const double* values, Py_ssize_t n, unsigned long long total
    ) noexcept

cpdef enum Order:
    CORRUPT
    UNSORTED
    CANONICAL

cdef enum:
    TILE = 32

cdef object NO_ENTRIES

cpdef bint fits(object value, int ndim)
cdef bint are_places(object value)
cdef bint are_long(object value)
cdef bint _is_clean(object value, int kind, int ndim)
cdef ndarray new_vector(npy_intp size)
cdef ndarray new_places(npy_intp size)
cdef ndarray same_places(npy_intp size, int value)
cdef ndarray new_indices(npy_intp size)
cdef double* data_of(ndarray array) noexcept
cdef double* numbers(object array, Py_ssize_t size) except NULL
cdef int* places(object array, Py_ssize_t size) except NULL
cdef Py_ssize_t* indices(object array, Py_ssize_t size) except NULL
cdef signed char* signs(object array, Py_ssize_t size) except NULL
cpdef unsigned long long stamp_of(object parts, unsigned long long total=*)
cdef void* _entries(object array, int kind, Py_ssize_t size) except NULL
cpdef bint is_bad(ndarray array, bint infinite_allowed) except -1
cpdef tuple dense_asymmetry(const double[:, ::1] P)
cpdef tuple sparse_asymmetry(object indptr, object indices, object data)
cpdef Order index_order(object indptr, object indices, Py_ssize_t major, Py_ssize_t minor)
cpdef object narrowed(const long long[::1] indices)
cpdef tuple transposed(object indptr, object indices, object data, Py_ssize_t rows)
cpdef tuple compressed(const double[:, ::1] C)
