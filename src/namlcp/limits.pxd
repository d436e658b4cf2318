cdef class Settings:
    cdef readonly double eps_abs, eps_rel, time_limit
    cdef readonly Py_ssize_t max_iter
