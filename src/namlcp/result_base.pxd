from namlcp.measure cimport Numbers

cdef extern from "Python.h":
    ctypedef struct PyTypeObject:
        pass
    ctypedef object (*newfunc)(PyTypeObject* kind, object arguments, void* names)
    void* PyType_GetSlot(PyTypeObject* kind, int slot)
    int Py_tp_new

cdef class ResultBase:
    cdef:
        readonly object status, x, y, z, z_box, form, message
        readonly object history, closest, problem
        public object factors, stamp
        readonly Py_ssize_t iterations
        readonly double obj, setup_time, solve_time
        public object kept
        Numbers numbers


# problem: the checked LCP and A as it was given, or what `solve_small` has of these.
cdef class LCPResultBase:
    cdef:
        readonly object status, z, w, s, method, ray, message, history, problem, stamp
        readonly Py_ssize_t iterations
        readonly double residual, setup_time, solve_time
        public object kept


cdef object new_tuple
cdef object made(object kind)
