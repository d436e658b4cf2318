from namlcp.arrays cimport numbers, places
from namlcp.limits cimport Watched
from namlcp.linalg.sparse_ldl cimport Factors, as_array

cdef enum:
    KRYLOV_STEPS = 8

cdef struct Step:
    double *du, *dW, *dZ
    # The longest steps a, a' <= 1, and the relative residual of du.
    double primal, dual, error


cdef class Interior(Watched):
    cdef:
        # n variables, p equations, m one-sided constraints, the order of K and its
        # entries; the length of a point (x, y, Z, flags of the active constraints).
        readonly Py_ssize_t n, p, m, size, nnz, length
        readonly object problem, chain, judge, limits
        object kkt
        Factors factors
        # The problem: K and K~ without and with its varying diagonal, the diagonal that
        # is factored; one-sided constraints are sign * t[place] + W = c with slacks W >= 0
        # and multipliers Z >= 0, where t = (x, Ax, Gx) and v = (net z_box, y, net z) have
        # the layout of K. cost, goal_b and goal_c are q, b and c of active-set systems.
        const int *indptr, *indices
        const double *base
        double *data, *factored
        const int *place
        const double *sign, *unit, *q, *b, *c, *cost, *goal_b, *goal_c
        # The iterate and the best one; the residuals, and the products P x and C'v; the
        # target rc of W dZ + Z dW, tau and omega of `newton`.
        double *x, *y, *W, *Z, *active, *best_x, *rd, *rp, *rw, *Px, *Ctv, *v, *t
        double *rc, *tau, *omega
        # The step; the one before the last corrector; P dx, C'dv and C dx of it.
        Step step, other
        double *dv, *dt, *Pdx, *Ctdv
        # Linear solves (`newton`): sums of omega, max(1, |K~_ii|), the right-hand side,
        # the residual and the solution of the last solve, another solution and its
        # residual; the vectors of GMRES, and whether it halved the residual when it was
        # last tried.
        double *weight, *row_size, *rhs, *r, *answer, *trial, *trial_r, *krylov
        double rhs_norm
        bint krylov_pays
        # Relative residuals of the candidates for certificates, now and at the last test.
        double ratios[2]
        double tested[2]
        # The active-set system (`candidates`): the point where it starts, with its active
        # set, and the one found, with the next set; its unknowns, those of the least
        # residual, the right-hand side of rows; flags of what is held; its regularisation;
        # whether it was factored, whether its residual fell tenfold, whether the next
        # active set is another.
        double *start, *found, *u, *least_u, *goal, *held
        double regularisation
        bint is_factored, converged, set_changed
        # Tolerances, the larger one, and the relative residual that ends a refinement;
        # that at which refinement last came to a halt.
        double eps_abs, eps_rel, tol, accuracy, attained
        readonly Py_ssize_t iterations, max_iter
        bint reports
        # The mean of W Z, norms of the scaled residuals, and these one iteration before;
        # |x'rd| and |y'rp + Z'rw|, the shares of the residuals in the gap; the unscaled
        # residuals, as in `Residuals`, and these over their tolerances.
        double mu, dual_norm, row_norm, slack_norm, old_dual_norm, old_primal_norm
        double dual_share, primal_share, primal, dual, gap, gap_size
        double primal_ratio, dual_ratio, gap_ratio
        # The largest of the three, inf for NaN; the least one since the last restart, the
        # one at the last active-set refinement, and the one that must be halved, with the
        # iterations since it was and the most of them.
        double worst, best, last_refined, reference
        Py_ssize_t since_halved, patience
        # W'Z after the longest steps; the target of W Z; its least values over the gap,
        # and over the tolerance of that; iterates that the judge refused.
        double product, target, lift, least_target
        Py_ssize_t refused
        # Largest change of x, and of y and Z, by the last step; whether that had full
        # length.
        double change_x, change_yz
        bint has_full_step
        # Regularisation, and iterations left without lowering it.
        readonly double rho, delta
        Py_ssize_t wait
        # Whether the start was warm; cold starts after the first.
        bint is_warm
        Py_ssize_t restarts
        # The array of all vectors, where it begins, how many numbers are taken.
        object memory
        double *begin
        Py_ssize_t taken


cdef double ACCURACY, ACCURACY_EXACT, MOST_ACCURATE, LEAST_ACCURATE, EXACT, LEAST_TARGET

cdef double* reals(Interior m, Py_ssize_t count) noexcept nogil
cdef void lay_out(Interior m) noexcept nogil
cdef int attach(Interior m) except -1
cdef double offer(Interior m, double* point) except? -1.0
