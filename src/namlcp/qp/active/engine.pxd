from namlcp.limits cimport Watched, is_over
from namlcp.linalg.dense cimport append_to_triangle, remove_from_triangle
from namlcp.linalg.dense cimport triangle_solve, triangle_solve_transposed
from namlcp.linalg.vectors cimport add_four, add_scaled, copy, dot, fill
from namlcp.measure cimport Numbers

cdef double DEPENDENT, VIOLATION_ROUNDING, NOISE, MOST_ROUNDING
cdef double CERTAIN, ROUND_ROUNDING, MOST_ROUND_ROUNDING, BASE_ROUNDING
cdef enum:
    MOST_NUMBERS = 8_000_000
    MOST_SORTED = 64


cpdef enum Code:
    # How a part of a solve ended. STUCK: another form or method has to solve the QP.
    # SUMMED: as DONE, but the terms are so large that the order of their sums matters.
    # CONTRADICTION, UNBOUNDED: there is a candidate for a certificate; of a dense QP at
    # last the certificate itself, else UNPROVED.
    DONE
    CONTRADICTION
    LATE
    STUCK
    SUMMED
    UNBOUNDED
    UNPROVED


cdef class ActiveSet(Watched):
    cdef:
        # The vectors of the problem, and where the point is to be; not owned.
        const double *q, *h, *b, *lb, *ub
        double *x, *y, *z, *z_box
        # rows = m + n inequalities and bounds; numbers of a response, all rows + p or
        # G u alone; the most active rows and responses; equations that depend on others.
        Py_ssize_t n, m, p, rows, length, most, capacity, skipped
        # Values at the base point and now, their change for a multiplier that grows, or
        # from the last centre to the next; 1 over the norms of the rows.
        double *s0, *s, *direction, *scale
        # Active rows: index, multiplier, the triangle L with L L' = S; side of every row:
        # 1 at h or ub, -1 at lb, 0 if not active.
        Py_ssize_t *active, *side
        double *multiplier, *triangle
        # Active rows; rows of a hint, in the place of active ones until the next solve.
        Py_ssize_t k, hints
        # L^-1 w_F and solutions with S, or Givens rotations.
        double *coefficient, *ratio
        # Responses, the place of each row's (-1: none), the row of each place.
        double *responses
        Py_ssize_t *place, *owner
        Py_ssize_t next_place
        # Products of the point; right-hand sides; a refinement.
        double *Px, *Gx, *Ax, *Gtz, *Aty, *rhs, *change
        # Of `rounds`: W, what it is made of; (G x, x) for the centre x.
        double *weight, *shape, *reach, *centre
        # rho in W, 0 without W; what it is to be over that of the data, 0 for W only
        # where P has no good factor, NO_WEIGHT for never; the largest diagonal entry of P.
        double rho, wanted, largest
        # The row that enters (-1: none) and its side, its multiplier so far.
        Py_ssize_t entering, entering_side, pivots, max_iter
        double own
        # The violation over its terms that counts as rounding; curvature of a row of norm
        # 1 up to which the equations fix it; `size_of` s0, 0 on the face of `dense`.
        double level, least_curvature, base_size
        double operations, most_operations, eps_abs, eps_rel
        # Whether mu and s are not those of the rows; no other solve follows; the point is
        # on the face of `dense`; what depends on the matrices is there.
        bint changed, is_single, on_face
        readonly bint is_ready
        Numbers found
        char *memory
        size_t memory_end
        # What keeps the arrays behind the pointers alive; the point that was made last.
        object matrices, vectors, point
        readonly int code

    cdef void lay_out(self) noexcept nogil
    cdef Code decide(self) noexcept nogil
    cdef bint set_up(self) noexcept nogil
    cdef void set_values(self, const double* rhs, double* values) noexcept nogil
    cdef void make_response(self, Py_ssize_t row) noexcept nogil
    cdef void set_products(self, bint is_base) noexcept nogil
    cdef void times_cost(self, const double* x, double* Px) noexcept nogil
    cdef bint begin(self) noexcept nogil
    cdef double project(self, Py_ssize_t row) noexcept nogil
    cdef bint append(self, Py_ssize_t row, Py_ssize_t side, double multiplier, double rest) noexcept nogil
    cdef bint remove(self, Py_ssize_t i) noexcept nogil
    cdef void set_multipliers(self) noexcept nogil
    cdef void set_point_values(self) noexcept nogil
    cdef void set_x(self, const double* rhs, const double* factor, double* values) noexcept nogil
    cdef bint finish(self) noexcept nogil


cdef double* reals(ActiveSet m, Py_ssize_t count) noexcept nogil
cdef Py_ssize_t* indices(ActiveSet m, Py_ssize_t count) noexcept nogil
cdef void lay_out_rows(ActiveSet m) noexcept nogil
cdef int make_room(ActiveSet m) except -1
cdef double goal_of(ActiveSet m, Py_ssize_t row, Py_ssize_t side) noexcept nogil
cdef bint is_pinned(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef double* response_of(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef double* claim_place(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef void forget_responses(ActiveSet m) noexcept nogil
cdef void forget_rows(ActiveSet m) noexcept nogil
cdef void subtract_responses(ActiveSet m, const double* factor, Py_ssize_t k, double* s) noexcept nogil
cdef double rest_of(ActiveSet m, Py_ssize_t row) noexcept nogil
cdef bint is_independent(ActiveSet m, Py_ssize_t row, double rest) noexcept nogil
cdef void insert_place(ActiveSet m, Py_ssize_t at, Py_ssize_t row, Py_ssize_t side, double multiplier) noexcept nogil
cdef void remove_place(ActiveSet m, Py_ssize_t i) noexcept nogil
cdef void set_base_values(ActiveSet m) noexcept nogil
cdef bint drop_wrong_signs(ActiveSet m) noexcept nogil
cdef double size_of(ActiveSet m, const double* values) noexcept nogil
cdef void choose_entering(ActiveSet m) noexcept nogil
cdef bint is_beyond(ActiveSet m, double share, double size) noexcept nogil
cdef Code step(ActiveSet m) noexcept nogil
cdef Code excuse(ActiveSet m) noexcept nogil
cdef Code pivot(ActiveSet m) noexcept nogil
cdef void set_contradiction(ActiveSet m) noexcept nogil
