from namlcp.arrays cimport numbers

cpdef bint is_box_open(object lower, object upper) except -1
