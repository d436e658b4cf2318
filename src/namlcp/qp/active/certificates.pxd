from namlcp.qp.active.dense cimport DenseActiveSet

cdef bint prove_infeasible(DenseActiveSet m) noexcept nogil
cdef bint contradicts(DenseActiveSet m, const double* units, double margin, double moduli) noexcept nogil
cdef bint prove_unbounded(DenseActiveSet m) noexcept nogil
cdef bint is_recession(DenseActiveSet m, const double* units, const double* sizes, double margin, double moduli, double left) noexcept nogil
cdef double uncancelled(const double* C, const double* d, const double* Cd, Py_ssize_t count, Py_ssize_t n) noexcept nogil
cdef void scale_by(double factor, double* v, Py_ssize_t n) noexcept nogil
cdef double size_of(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef double largest_in_units(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef double largest_per_unit(const double* v, const double* units, Py_ssize_t n) noexcept nogil
cdef double* equilibrate(DenseActiveSet m, bint has_cost) noexcept nogil
cdef void note_rows(const double* C, Py_ssize_t count, Py_ssize_t n, const double* scale, Py_ssize_t at, double* largest) noexcept nogil
cdef double next_factors(const double* scale, double* largest, Py_ssize_t size) noexcept nogil
