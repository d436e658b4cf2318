"""Block principal pivoting inside a proximal loop: the exact finish of method="auto".

Every unknown is at its lower bound (state -1), at its upper bound (1) or free (0). With
the bounded ones fixed, the free ones solve (A_FF + rho I) z_F = rhs; whoever has the
wrong sign then changes state: all of them (Judice and Pires, Computers Ops Res 21
(1994) 587-596), or only the last one (Murty 1974) when nothing else makes progress,
which ends after finitely many steps for every P-matrix. The proximal loop around it
(rho, relative to the unit diagonal) carries singular matrices and refines the others.
Where all at once goes too far for a symmetric A, `search` tells how far to go.

All of it is one compiled call, `pivot`, which comes back with a reason: see the codes.
"""

import numpy as np

from namlcp.compiled import kernel, part, pasted
from namlcp.lcp.pivoting import faces
from namlcp.lcp.pivoting.faces import analyse, face_order, refactor, solve_face
from namlcp.lcp.pivoting.line_search import begin_at, end_at, face_of, step_to
from namlcp.lcp.pivoting.work import (
    ASKED,
    BEST,
    BEST_Z,
    CENTRE,
    CONVEX,
    CURVATURE,
    EPS_ABS,
    EPS_REL,
    FACTORED,
    FEWEST,
    GOAL,
    MET,
    OUTER,
    OUTSIDE,
    PATHED,
    PATIENCE,
    RHO,
    RHS,
    SEARCHING,
    SHIFT,
    SIZE,
    STALE,
    STARTED,
    STATE,
    TOLERANCE,
    S,
    W,
    X,
    Z,
    ordering_in,
    problem_in,
)
from namlcp.linalg import (
    SLACK,
    add_product,
    all_finite,
    copy,
    largest_entry,
    scale_columns,
    write_diagonal,
)
from namlcp.residuals import natural_residuals

# Why `pivot` returns.
GO_ON = -1  # never returned
SOLVED = 0
MORE = 1  # the budget of factorisations is used up
STAGNATED = 2  # block pivoting makes no progress: for the caller to cure
FACE = 3  # the caller is to solve the face system, right side in RHS, answer to Z
RAY = 4  # RHS may prove that there is no solution
STUCK = 5  # nothing else to try

OMEGA = 1.4
SWEEPS = 30
STILL = 3
BLOCK_STEPS = 3
SEARCH_STEPS = 100
LEAST_RHO = 1e-8
MOST_RHO = 1.0
OUTER_STEPS = 200
EARLY_STEPS, FEW, SOME = 20, 64, 4  # see `is_near`
EXACT = 1e-15


@part
def relax(problem, z, w, state):
    """Sweep by projected SOR in residual form: w = A z + q is kept, not computed.

    An unknown that stays at its bound costs no more than its test. Ends after `SWEEPS`,
    or once the states stood still.
    """
    dense, data, indices, indptr = problem.columns
    lower, upper, unit = problem.lower, problem.upper, problem.unit
    still = 0
    for _ in range(SWEEPS):
        still += 1
        for i in range(z.size):
            if unit[i]:
                t = min(max(z[i] - OMEGA * w[i], lower[i]), upper[i])
                step = t - z[i]
                if step != 0.0:
                    z[i] = t
                    # Written out: a call costs more than the work on a sparse column.
                    if dense.shape[0] > 0:
                        for k in range(w.size):
                            w[k] += step * dense[i, k]
                    else:
                        for p in range(np.uint32(indptr[i]), np.uint32(indptr[i + 1])):
                            w[np.uint32(indices[p])] += step * data[p]
            s = z[i] - w[i]
            guess = -1 if s <= lower[i] else (1 if s >= upper[i] else 0)
            if guess != state[i]:
                state[i] = guess
                still = 0
        if still >= STILL:
            break


@part
def record(problem, work):
    """Judge z, w, keep z if it is the best so far; return whether it is much better."""
    number = work.scalar
    scaled, plain = natural_residuals(
        work.vectors[Z], work.vectors[W], problem.lower, problem.upper, problem.d
    )
    improved = scaled < 0.25 * number[BEST]
    if scaled < number[BEST]:
        number[BEST] = scaled
        copy(work.vectors[Z], work.vectors[BEST_Z])
        met = scaled <= number[EPS_REL] * number[SIZE] or plain < number[EPS_ABS]
        number[MET] = 1.0 if met else 0.0
    return improved


@part
def clip_rounding(problem, work):
    """Clip z if no free unknown is outside its bounds by more than the tolerance."""
    z, lower, upper = work.vectors[Z], problem.lower, problem.upper
    tolerance = work.scalar[TOLERANCE]
    for i in range(z.size):
        if not lower[i] - tolerance <= z[i] <= upper[i] + tolerance:
            return
    for i in range(z.size):
        z[i] = min(max(z[i], lower[i]), upper[i])


@pasted
def mark(problem, work):
    """Write to GOAL the state each unknown belongs to; return how many are wrong."""
    z, w, centre = work.vectors[Z], work.vectors[W], work.vectors[CENTRE]
    lower, upper = problem.lower, problem.upper
    state, goal = work.marks[STATE], work.marks[GOAL]
    rho, tolerance = work.scalar[RHO], work.scalar[TOLERANCE]
    wrong = 0
    for i in range(z.size):
        goal[i] = state[i]
        if state[i] == 0:
            if z[i] < lower[i] - tolerance:
                goal[i] = -1
            elif z[i] > upper[i] + tolerance:
                goal[i] = 1
        elif lower[i] < upper[i]:
            if state[i] * (w[i] + rho * (z[i] - centre[i])) > tolerance:
                goal[i] = 0
        wrong += goal[i] != state[i]
    return wrong


@part
def may_be_ray(problem, v):
    """Tell whether v leads down, and into infinite sides only (up to rounding)."""
    lower, upper = problem.lower, problem.upper
    least = 1e-9 * largest_entry(v)
    descent = 0.0
    for i in range(v.size):
        if (v[i] > least and upper[i] < np.inf) or (
            v[i] < -least and lower[i] > -np.inf
        ):
            return False
        descent += problem.q[i] * v[i]
    return descent < 0.0


@part
def restart(work, rho):
    """Count wrong signs afresh, with this rho."""
    count = work.counter
    count[FEWEST] = work.vectors.shape[1] + 1
    count[PATIENCE] = SEARCH_STEPS if count[SEARCHING] else BLOCK_STEPS
    if rho != work.scalar[RHO]:
        work.scalar[RHO] = rho
        count[STALE] = 1


@pasted
def close_outer(problem, work):
    """End an outer step: no or few signs wrong. Return a code; GO_ON for the next."""
    vectors, count, number = work.vectors, work.counter, work.scalar
    z, v, centre = vectors[Z], vectors[RHS], vectors[CENTRE]
    improved = record(problem, work)
    count[OUTER] += 1
    rho = number[RHO]
    exact = number[BEST] <= EXACT * number[SIZE]
    if number[MET] and (exact or rho == 0.0 or not improved):
        return SOLVED
    if count[OUTER] >= OUTER_STEPS:
        return STUCK
    for i in range(z.size):
        v[i] = z[i] - centre[i]
        centre[i] = z[i]
    restart(work, max((0.1 if count[SEARCHING] else 0.01) * rho, LEAST_RHO))
    begin_at(centre, vectors[W], number[RHO], vectors[X], vectors[S])
    # At 3, 6, 12, ...: what was no proof may become one, but asking costs a factor.
    turn = count[OUTER] // 3
    due = count[OUTER] == 3 * turn and turn > 0 and turn & (turn - 1) == 0
    if due and rho > 0.0 and may_be_ray(problem, v):
        return RAY
    return GO_ON


@part
def search(problem, work):
    """Go towards Z, which solves the face system; GOAL is for where that ends."""
    vectors, rho = work.vectors, work.scalar[RHO]
    z, x, s, s_end = vectors[Z], vectors[X], vectors[S], vectors[RHS]
    state, goal = work.marks[STATE], work.marks[GOAL]
    lower, upper = problem.lower, problem.upper
    end_at(z, vectors[CENTRE], vectors[W], rho, state, s_end)
    if step_to(x, s, z, s_end, lower, upper) < 1.0:
        face_of(s, lower, upper, rho, work.scalar[TOLERANCE], state, goal)


@pasted
def flip(problem, work, wrong, single):
    """Change states towards GOAL: all, or only the last one where that stagnated."""
    count, state, goal = work.counter, work.marks[STATE], work.marks[GOAL]
    first = 0
    if count[SEARCHING] and not count[OUTSIDE] and count[PATIENCE] > 0:
        count[PATIENCE] -= 1
        search(problem, work)
    elif wrong < count[FEWEST]:
        count[FEWEST] = wrong
        count[PATIENCE] = BLOCK_STEPS
    elif count[PATIENCE] > 0:
        count[PATIENCE] -= 1
    elif single:
        first = state.size - 1
        while goal[first] == state[first]:
            first -= 1
    else:
        return STAGNATED
    for i in range(first, state.size):
        state[i] = goal[i]
    count[STALE] = 1
    return GO_ON


@part
def is_near(problem, work, wrong):
    """Tell whether an outer step of a symmetric A may end with one sign in FEW wrong.

    The centre moves anyway, with the factor at hand; to be exact before it has come
    near costs factorisations. Not before there have been some: most faces need no more.
    """
    count, early = work.counter, problem.symmetric and work.scalar[RHO] > 0.0
    early &= count[FACTORED] > SOME
    falls = wrong < count[FEWEST] and count[OUTER] < EARLY_STEPS
    return early and falls and not count[PATHED] and FEW * wrong <= problem.q.size


@pasted
def judge(problem, work):
    """With the face system solved, flip what is wrong or end the outer step."""
    z, w, rho = work.vectors[Z], work.vectors[W], work.scalar[RHO]
    clip_rounding(problem, work)
    copy(problem.q, w)
    add_product(problem.columns, z, w)
    if not all_finite(w):
        if rho > 0.0:
            return STUCK
        # The face is singular: on from the best point with rho > 0.
        copy(work.vectors[BEST_Z], work.vectors[CENTRE])
        restart(work, LEAST_RHO)
        return GO_ON
    wrong = mark(problem, work)
    if wrong == 0 or is_near(problem, work, wrong):
        return close_outer(problem, work)
    if work.scalar[MET]:
        return SOLVED
    # A larger rho is left to try only where A is symmetric.
    last_resort = work.counter[PATHED] and (rho >= MOST_RHO or not problem.symmetric)
    return flip(problem, work, wrong, last_resort)


@part
def set_face(problem, work):
    """Put bounded unknowns at their bounds, write the right side of the face system."""
    z, centre, rhs = work.vectors[Z], work.vectors[CENTRE], work.vectors[RHS]
    state, rho = work.marks[STATE], work.scalar[RHO]
    copy(problem.q, rhs)
    for i in range(z.size):
        z[i] = 0.0
        if state[i] != 0:
            z[i] = problem.lower[i] if state[i] < 0 else problem.upper[i]
    add_product(problem.columns, z, rhs)
    for i in range(z.size):
        rhs[i] = rho * centre[i] - rhs[i]


@pasted
def begin(columns, problem, work):
    """Scale, then sweep from the user's z, which vectors[Z] holds. Return a code."""
    vectors, count, number = work.vectors, work.counter, work.scalar
    z, w, d = vectors[Z], vectors[W], problem.d
    n = z.size
    write_diagonal(columns, d)
    for i in range(n):
        problem.unit[i] = d[i] > 0.0
        d[i] = 1.0 / np.sqrt(d[i]) if d[i] > 0.0 else 1.0
        problem.q[i] *= d[i]
        problem.lower[i] /= d[i]
        problem.upper[i] /= d[i]
        # First z = clip(0), which gives the size of the problem; then the start.
        vectors[CENTRE, i] = min(max(z[i] / d[i], problem.lower[i]), problem.upper[i])
        z[i] = min(max(0.0, problem.lower[i]), problem.upper[i])
    scale_columns(columns, d, problem.columns)
    number[BEST] = np.inf
    for start in range(2):
        copy(problem.q, w)
        add_product(problem.columns, z, w)
        record(problem, work)
        if start == 0:
            number[SIZE] = number[BEST]
            copy(vectors[CENTRE], z)
        if number[SIZE] == 0.0 or number[MET]:
            return SOLVED
    eps = 0.01 * number[EPS_REL] * number[SIZE] / np.sqrt(n)
    number[TOLERANCE] = max(1e-14 * largest_entry(problem.q), eps)
    copy(z, vectors[CENTRE])
    copy(w, vectors[RHS])
    before = number[BEST]
    relax(problem, z, w, work.marks[STATE])
    record(problem, work)
    if number[BEST] == before and not problem.symmetric:
        copy(vectors[CENTRE], z)
        copy(vectors[RHS], w)
    for i in range(n):
        s = z[i] - w[i]
        guess = -1 if s <= problem.lower[i] else (1 if s >= problem.upper[i] else 0)
        work.marks[STATE, i] = guess
        vectors[CENTRE, i] = z[i]
    count[STALE] = 1
    restart(work, LEAST_RHO if problem.symmetric else 0.0)
    return GO_ON


@kernel(error_model="numpy")
def pivot(columns, symmetric, work, budget, outside):
    """Begin or go on until solved, or for `budget` factorisations. Return a code.

    Parameters
    ----------
    columns : Columns
        The user's matrix.
    work : Work
        First call: vectors[Q, LOWER, UPPER] hold the user's problem, vectors[Z] the
        start, number[EPS_ABS] and [EPS_REL] the tolerances. On return vectors[BEST_Z]
        is the best z of the problem scaled by vectors[D].
    outside : bool
        The caller solves the face systems, then calls `resume`.

    With counter[ASKED] = 1 a solved symmetric problem is followed by one factorisation
    of A + `SLACK` I: counter[CONVEX] = 1 if that is positive definite.
    """
    problem = problem_in(work, symmetric)
    ordering = ordering_in(work)
    count = work.counter
    if not count[STARTED]:
        count[STARTED] = 1
        if begin(columns, problem, work) == SOLVED:
            if not count[ASKED]:
                return SOLVED
            count[CURVATURE] = 1
            budget += 1
    if outside:
        set_face(problem, work)
        return FACE
    state, shift = work.marks[STATE], work.vectors[SHIFT]
    while budget > 0:
        budget -= 1
        for i in range(shift.size):
            shift[i] = SLACK if count[CURVATURE] else work.scalar[RHO]
            if count[CURVATURE]:
                state[i] = 0
                if not problem.unit[i]:
                    return SOLVED  # zero or negative diagonal: not decided here
        order = face_order(problem.columns, symmetric, state, ordering)
        factor = analyse(problem.columns, symmetric, order, ordering)
        quality = refactor(problem.columns, symmetric, shift, factor, ordering.local)
        if count[CURVATURE]:
            count[CONVEX] = quality == faces.REGULAR
            return SOLVED
        count[FACTORED] += 1
        count[OUTSIDE] |= quality == faces.INDEFINITE
        count[STALE] = 0
        while not count[STALE]:
            set_face(problem, work)
            solve_face(symmetric, factor, work.vectors[RHS], work.vectors[Z])
            code = judge(problem, work)
            if code == SOLVED and count[ASKED]:
                count[CURVATURE] = 1
                budget += 1
                break
            if code != GO_ON:
                return code
    return MORE


@kernel(error_model="numpy")
def resume(symmetric, work):
    """Take the caller's solution of the face system in vectors[Z]. Return a code."""
    return judge(problem_in(work, symmetric), work)
