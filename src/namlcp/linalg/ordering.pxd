from namlcp.arrays cimport indices as longs, new_places, places, same_places
from namlcp.limits cimport Watched, is_over, raise_kept

cdef double ABOVE_ROOT, ABOVE_MEAN, OPERATIONS
cdef enum:
    NONE = -1
    VARIABLE = -1
    HUB = -2

cdef struct Quotient:
    # The quotient graph; a node is a variable or, once eliminated, an element. All
    # pointers but `adjacent` are to an entry for each row. The neighbours of node i are
    # adjacent[p] for p in start[i] : start[i] + length[i], where `adjacent` has `end`
    # entries and room for `room`; of a variable, the first elements[i] of them are
    # elements, of an element all are variables. weight[i] tells how many rows a
    # supervariable stands for, 0 if it is part of another; it is negative while i belongs
    # to the element being formed. degree[i] bounds the rows beside i. The rows that i
    # stands for are i, following[i], following[following[i]], ..., last[i]. hubs[i] counts
    # the hubs beside i. mark[e] is 0 for an element that has been absorbed, all marks are
    # below `tag`. place[i] is VARIABLE or HUB until i has a place.
    #
    # Variables of equal listed degree d, see `listed_degree`, form a list: head[d],
    # after[head[d]], ...; `before` links back. While an element is formed, its variables
    # are in no such list: they are in lists of equal keys, from bucket[key] on, and
    # before[i] is the key of i.
    Py_ssize_t size, room, end, tag
    Py_ssize_t *start, *mark, *degree
    int *place, *length, *elements, *weight, *following, *last, *hubs, *head
    int *after, *before, *bucket, *adjacent

cdef bint order_by_degree(const int* indptr, const int* indices, Py_ssize_t size, int* place, Watched watch) noexcept nogil
cdef Py_ssize_t write_graph(Quotient* g, const int* indptr, const int* indices) noexcept nogil
cdef bint eliminate_all(Quotient* g, Py_ssize_t left, Watched watch) noexcept nogil
cdef Py_ssize_t listed_degree(Quotient* g, Py_ssize_t i) noexcept nogil
cdef void insert(Quotient* g, Py_ssize_t i, Py_ssize_t d) noexcept nogil
cdef void remove(Quotient* g, Py_ssize_t i, Py_ssize_t d) noexcept nogil
cdef bint reserve(Quotient* g, Py_ssize_t pivot) noexcept nogil
cdef void form_element(Quotient* g, Py_ssize_t pivot) noexcept nogil
cdef void update(Quotient* g, Py_ssize_t pivot) noexcept nogil
cdef void append(Quotient* g, Py_ssize_t j, Py_ssize_t i) noexcept nogil
cdef void merge_alike(Quotient* g, Py_ssize_t begin) noexcept nogil
cdef Py_ssize_t link_all(Quotient* g, Py_ssize_t pivot, Py_ssize_t left) noexcept nogil
cpdef tuple permuted(object indptr, object indices, object place, bint is_strict)
cdef tuple elimination_tree(object indptr, object indices)
cdef void postorder(Py_ssize_t size, const int* parent, int* place, int* room) noexcept
cdef object merged(const int[::1] parent, const int[::1] counts, const int[::1] lower, const int[::1] below)
cdef bint are_twins(Py_ssize_t i, Py_ssize_t j, const int[::1] parent, const int[::1] lower, const int[::1] below) noexcept
cdef void append_rows(Py_ssize_t n, const int* indptr, const int* indices, const int* parent, const int* node, int* seen, Py_ssize_t* end, int* rows) noexcept nogil
