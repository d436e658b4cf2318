"""What is tried beside the steps: active sets, and certificates of infeasibility.

With the active one-sided constraints, at first those with Z > W, as equations and
without the others,

    [P  A'  G_a'] [x]   [-q ]
    [A          ] [y] = [b  ]      (variables at an active bound held there)
    [G_a        ] [v]   [c_a]

is solved by proximal iterations with the factors of its regularised matrix, which
converge for dependent active rows too. The next guess keeps the active constraints with
multipliers >= 0 and adds the violated ones: a primal-dual active-set method
(Hintermueller, Ito and Kunisch, SIAM J. Optim. 13 (2003) 865-888).

The unknowns are u = (x, y, net z); `held` marks what of them does not change.

Candidates for certificates are the parts of the last step, (dy, dZ) and dx, as they are
and projected by means of one factorisation of K. Those with small relative residuals
(`promises`) are tested by the judge, on unscaled data.
"""

import cython
import numpy as np
from cython.cimports.libc.math import INFINITY, fabs

from namlcp.qp.certificates import largest
from namlcp.status import Status

# Modulus of a diagonal entry of K~ that fixes a variable or drops a row.
OFF = 1e20
# Unscaled residual that ends the iterations. A first one below SMALL_ENOUGH counts as
# that in the demand for a tenfold reduction.
RESIDUAL_GOAL, SMALL_ENOUGH = 1e-14, 1e-11
# A scaled multiplier or slack below minus this has the wrong sign.
WRONG_SIGN = 1e-12
# Added to the diagonal of P, and subtracted for rows. The second is tried where L D L'
# breaks down with the first, or where the iterations do not reduce the residual
# tenfold: the KKT system of the active set is singular then. The third: for rays.
FIRST_SHIFT, SECOND_SHIFT, RAY_SHIFT = 1e-9, 1e-7, 1e-6
# Residual over its tolerance, on unscaled data, up to which no other set is tried.
GOOD_ENOUGH = 1e-2
# A residual converges if an iteration reduces it to this part: then there is no test
# for a certificate.
CONVERGING = 0.25
# A candidate for a certificate is tested where its relative residual fell to the part
# AGAIN of that at the last test, at first of PROMISING.
PROMISING, AGAIN = 0.1, 0.3
# In a projection of multipliers, the weight of the distance to the candidate, where the
# residual has weight 1. The refinement ends at a largest residual PROJECTED, where the
# largest multiplier is 1: a certificate needs 1e-12.
PROJECTION, PROJECTED = 1e-8, 1e-16
# A one-sided constraint is an equation in the projection of a ray d, max |d_j| = 1, if
# sign * C d, scaled, exceeds this.
NEARLY_ACTIVE = -1e-3


def refine(m):
    """Try active sets, beginning with the point `start` and its set.

    Offers the points found to the judge. A larger shift that succeeds stays.
    """
    best = INFINITY
    m.regularisation = FIRST_SHIFT
    for _ in range(MOST_SETS):
        with cython.nogil:
            solve_set(m)
            if m.regularisation == FIRST_SHIFT and not m.converged:
                m.regularisation = SECOND_SHIFT
                solve_set(m)
                if not m.converged:
                    m.regularisation = FIRST_SHIFT
        if m.over or not m.is_factored:
            return 0
        worst = offer(m, m.found)
        if worst <= GOOD_ENOUGH or not worst <= 0.5 * best or not m.set_changed:
            return 0
        best = worst
        look_at_clock(m)
        if m.over:
            return 0
        copy(m.found, m.start, m.length)
    return 0


def solve_set(m):
    """Solve the system of the set of `start`; set `found` to its point and next set.

    The iterations end when the residual is rounding, or twice in a row not halved.
    """
    hold(m)
    m.converged, m.is_factored = False, factor(m)
    if not m.is_factored:
        return
    first = least = INFINITY
    failures = 0
    for k in range(PROXIMAL_STEPS + 1):
        error = set_residual(m)
        failures = 0 if error < 0.5 * least else failures + 1
        if k == 0:
            first = max(error, SMALL_ENOUGH)
        if error < least or k == 0:
            least = error
            copy(m.u, m.least_u, m.size)
        if failures == 2 or k == PROXIMAL_STEPS or not RESIDUAL_GOAL < error < INFINITY:
            break
        m.factors.solve_into(m.r, m.answer)
        for j in range(m.size):
            if not m.held[j]:
                m.u[j] += m.answer[j]
    m.converged = least <= 0.1 * first
    choose_next_set(m)


def hold(m):
    """Set the diagonal of K~, `held`, the right-hand side `goal` and the first u.

    That is (x, y, net z) of `start`, with x moved to its active bounds and z of active
    rows alone.
    """
    n, rows, held, goal, u = m.n, m.n + m.p, m.held, m.goal, m.u
    indptr, base, data, shift = m.indptr, m.base, m.data, m.regularisation
    Z = m.start + rows
    active = Z + m.m
    copy(m.start, u, rows)
    copy(m.goal_b, goal + n, m.p)
    fill(held, 0.0, rows)
    fill(held + rows, 1.0, m.size - rows)
    fill(u + rows, 0.0, m.size - rows)
    for k in range(m.m):
        if active[k]:
            i = m.place[k]
            held[i] = i < n
            goal[i] = m.sign[k] * m.goal_c[k]
            u[i] = goal[i] if i < n else m.sign[k] * Z[k]
    for j in range(n):
        last = indptr[j + 1] - 1
        data[last] = OFF if held[j] else base[last] + shift
    for j in range(n, m.size):
        data[indptr[j + 1] - 1] = -OFF if held[j] else -shift


def set_residual(m):
    """Set r to minus the residual of the system; return its unscaled max norm."""
    r, unit = m.r, m.unit
    multiply(m, m.u, m.u, m.Pdx, m.Ctdv, m.dv)
    worst = size = 0.0
    for j in range(m.size):
        r[j] = 0.0
        if not m.held[j]:
            if j < m.n:
                r[j] = -(m.Pdx[j] + m.cost[j] + m.Ctdv[j])
                size = fabs(r[j]) / unit[j]
            else:
                r[j] = m.goal[j] - m.dv[j]
                size = fabs(r[j]) * unit[j]
            if not size <= worst:
                worst = size
    return worst


def choose_next_set(m):
    """Set `found`: the point, and the next active set.

    The multiplier of a bound follows from stationarity.
    """
    u, t, sign, rows = m.least_u, m.dv, m.sign, m.n + m.p
    active, Z = m.start + rows + m.m, m.found + rows
    chosen = Z + m.m
    multiply(m, u, u, m.Pdx, m.Ctdv, t)
    copy(u, m.found, rows)
    m.set_changed = False
    for k in range(m.m):
        j = m.place[k]
        if active[k]:
            gradient = u[j] if j >= m.n else -(m.Pdx[j] + m.cost[j] + m.Ctdv[j])
            multiplier = sign[k] * gradient
            chosen[k] = multiplier > -WRONG_SIGN
            Z[k] = max(multiplier, 0.0)
        else:
            slack = m.goal_c[k] - sign[k] * t[j]
            chosen[k] = slack < -WRONG_SIGN
            Z[k] = 0.0
        if chosen[k] != active[k]:
            m.set_changed = True


# ---- certificates


def promises(m):
    """Set the ratios of the candidates to test, inf of others; tell if there is one.

    In an infeasible (unbounded) problem the primal (dual) residual cannot vanish. While
    it is within the tolerance or falls to a quarter, no candidate is tested.
    """
    dual_norm, primal_norm = m.dual_norm, max(m.row_norm, m.slack_norm)
    dual: cython.bint = dual_norm > CONVERGING * m.old_dual_norm and m.dual > m.tol
    primal: cython.bint = (
        primal_norm > CONVERGING * m.old_primal_norm and m.primal > m.tol
    )
    m.old_dual_norm, m.old_primal_norm = dual_norm, primal_norm
    if not (primal or dual):
        return False
    du, dZ, dv, ratios = m.step.du, m.step.dZ, m.dv, m.ratios
    fill(dv, 0.0, m.size)
    copy(du + m.n, dv + m.n, m.p)
    for k in range(m.m):
        dv[m.place[k]] += m.sign[k] * max(dZ[k], 0.0)
    multiply(m, du, dv, m.Pdx, m.Ctdv, m.dt)
    ratios[0] = farkas_ratio(m) if primal else INFINITY
    ratios[1] = ray_ratio(m) if dual else INFINITY
    found: cython.bint = False
    for k in range(2):
        if ratios[k] <= AGAIN * m.tested[k]:
            found, m.tested[k] = True, ratios[k]
        else:
            ratios[k] = INFINITY
    return found


def farkas_ratio(m):
    """Return min(|r| |x| / -value, |r| / |multipliers|), inf if value >= 0."""
    dy, dZ = m.step.du + m.n, m.step.dZ
    value = most = residual = 0.0
    for i in range(m.p):
        value += m.b[i] * dy[i]
        most = max(most, fabs(dy[i]))
    for k in range(m.m):
        value += m.c[k] * max(dZ[k], 0.0)
        most = max(most, dZ[k])
    if not value < 0.0:
        return INFINITY
    for j in range(m.n):
        residual = max(residual, fabs(m.Ctdv[j] + m.dv[j]))
    size = max(1.0, largest_entry(m.x, m.n))
    return min(residual * size / -value, residual / most)


def ray_ratio(m):
    """Return max(|P dx|, |A dx|, (C dx)+) / |dx|, inf if q'dx >= 0."""
    dx, t = m.step.du, m.dt
    value = 0.0
    for j in range(m.n):
        value += m.q[j] * dx[j]
    if not value < 0.0:
        return INFINITY
    residual = max(largest_entry(m.Pdx, m.n), largest_entry(t + m.n, m.p))
    for k in range(m.m):
        residual = max(residual, m.sign[k] * t[m.place[k]])
    return residual / largest_entry(dx, m.n)


def find_proof(m):
    """Return the verdict of the first candidate, or projection, that is a proof."""
    n, rows = m.n, m.n + m.p
    du, dZ = as_array(m.step.du, m.size).copy(), as_array(m.step.dZ, m.m)
    none = np.zeros(n), np.zeros(m.p), np.zeros(m.m)
    multipliers = none[0], du[n:rows], np.maximum(dZ, 0.0)
    for k, candidate in enumerate((multipliers, (du[:n], *none[1:]))):
        if not m.ratios[k] < INFINITY:
            continue
        verdict = Status.DUAL_INFEASIBLE if k else Status.PRIMAL_INFEASIBLE
        project = project_ray if k else project_multipliers
        if proves(m, k, candidate) or proves(m, k, project(m, candidate)):
            return verdict
    return None


def proves(m, k, candidate):
    """Tell whether scaled (d, y, Z) are a proof, of which d or (y, Z) is 0; keep it."""
    x, y, _, Z = m.point
    near, proof = m.chain.point(x, y, Z), m.chain.point(*candidate, data=0.0)
    if k == 0:
        return m.judge.accept_multipliers(near.x, proof.y, proof.z)
    return m.judge.accept_ray(proof.x, near)


def products(m, x, v):
    """Return P x, C'v and (x, C x) for scaled x and v, until the next call."""
    multiply(m, numbers(x, m.n), numbers(v, m.size), m.Pdx, m.Ctdv, m.dv)
    return as_array(m.Pdx, m.n), as_array(m.Ctdv, m.n), as_array(m.dv, m.size)


def project_multipliers(m, candidate):
    """Project on the Farkas system A'y + C'Z = 0, in a norm with w = sqrt(Z).

    min |A'(y + dy) + C'(Z + dZ)|^2/(2 eps) + |dy|^2/2 + sum dZ^2/(2 w), with eps =
    PROJECTION, is solved again and again.
    """
    problem, kkt, n, rows = m.problem, m.kkt, m.n, m.n + m.p
    none, y, Z = candidate
    size = largest(y, Z)
    y, Z = y / size, Z / size
    w = np.sqrt(Z)
    weight = sums(m, w)
    kkt.data[: kkt.indptr[n]] = 0.0
    diagonal = np.full(kkt.size, -1.0)
    diagonal[:n] = PROJECTION + weight[:n]
    diagonal[rows:] = -1.0 / np.maximum(weight[rows:], THIN)
    kkt.data[kkt.diagonal] = diagonal
    is_factored: cython.bint = m.factors.factor_values(m.data, m)
    kkt.data[:] = kkt.base
    kkt.factored[:] = np.nan  # these factors are those of no K~
    best, last, rhs, u = (y, Z), INFINITY, np.zeros(kkt.size), np.empty(kkt.size)
    for _ in range(PROJECTION_STEPS if is_factored else 0):
        v = sums(m, problem.sign * Z)
        v[n:rows] = y
        r = products(m, np.zeros(n), v)[1] + v[:n]
        residual = largest(r)
        if not residual <= 0.5 * last:
            break
        best, last = (y, Z), residual
        if last <= PROJECTED:
            break
        rhs[:n] = -r
        m.factors.solve_into(numbers(rhs, m.size), numbers(u, m.size))
        t = products(m, u[:n], v)[2]
        y = y + u[n:rows]
        Z = np.maximum(Z + w * problem.sign * t[problem.place], 0.0)
    return none, *best


def project_ray(m, candidate):
    """Project d on P d = 0, A d = 0 and, for nearly active constraints, C d = 0."""
    d, *none = candidate
    d = d / largest(d)
    t = products(m, d, np.zeros(m.size))[2]
    active = m.problem.sign * t[m.problem.place] > NEARLY_ACTIVE
    zero = np.zeros(max(m.size, m.m))  # goal_c has m entries
    m.cost = m.goal_b = m.goal_c = numbers(zero, zero.size)
    m.regularisation = RAY_SHIFT
    as_array(m.start, m.length)[:] = np.concatenate((d, np.zeros(m.p + m.m), active))
    solve_set(m)
    m.cost, m.goal_b, m.goal_c = m.q, m.b, m.c
    return (as_array(m.found, m.n).copy(), *none) if m.is_factored else candidate


def sums(m, values):
    """Add up the values of the one-sided constraints that share a row of K."""
    place = m.problem.place
    return np.bincount(place, values, minlength=m.size).astype(float, copy=False)
