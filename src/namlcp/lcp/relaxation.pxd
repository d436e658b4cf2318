cpdef double relax_csr(object indptr, object indices, object data, object q, object lower, object upper, double alpha, object z) except? -1
cpdef int relax_back(object indptr, object indices, object data, object q, object lower, object upper, object z) except -1
