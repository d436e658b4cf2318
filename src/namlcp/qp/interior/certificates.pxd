from namlcp.qp.interior.state cimport Interior

cdef double RAY_SHIFT, PROJECTION, PROJECTED, NEARLY_ACTIVE, VIOLATED
cdef enum:
    PROJECTION_STEPS = 15
    RAY_PROJECTIONS = 3

cdef object find_proof(Interior m)
cdef bint proves(Interior m, int k, tuple candidate) except -1
cdef tuple products(Interior m, object x, object v)
cdef list project_multipliers(Interior m, tuple candidate)
cdef list project_ray(Interior m, tuple candidate)
cdef object change_of_constraints(Interior m, object d)
cdef object sums(Interior m, object values)
