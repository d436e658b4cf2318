"""One Newton step: the residuals, the linear systems, the targets of W Z, and the move.

One-sided constraints are sign * t[place] + W = c with slacks W >= 0 and multipliers
Z >= 0; t = (x, Ax, Gx) and v = (net z_box, y, net z) have the layout of K. The Newton
direction for the target W dZ + Z dW = rc is, after elimination of dZ and dW and with
proximal terms rho, delta centred at the current point,

    tau = -rw - rc/Z,   omega = Z/(W + delta Z),
    weight[j] = sum of omega, g[j] = sum of sign omega tau over the constraints at j
    [P + rho + weight   A'       G'       ] [dx]   [-rd + g   ]
    [A                  -delta            ] [dy] = [-rp       ]
    [G                           -1/weight] [dv]   [g / weight]
    dZ = omega (sign * dt[place] - tau),   dW = (rc - W dZ)/Z

Residuals are measured as max |r_i| / max(1, |K~_ii|): rows of inactive constraints have
diagonals of 1e10 and more, and would outweigh all others. Factors of a nearly singular
K~ have a few wrong directions, on which refinement does not converge and GMRES needs a
few steps; with the factors as preconditioner from the right it reduces these residuals.

rho and delta, on the diagonal of K~, belong to proximal terms around the current point:
they shorten the steps but do not move the solution. They fall with mu to FLOOR. From
there inaccurate solves raise them, and accurate solves lower the one that dominates its
residual, if that residual or its share of the gap has to become smaller: below 1e-7
factorisations of K~ begin to fail.
"""

import cython
from cython.cimports.libc.math import INFINITY, NAN, fabs, sqrt

# Least weight of a row, whose reciprocal is on the diagonal of K~.
THIN = 1e-20
# Largest correction of dZ for the error of the linear solve, relative to Z.
MOST_LEFT = 0.1
# Gondzio's corrector aims at steps (1 + LENGTHENED) a + LENGTHENED and at products W Z
# there between LEAST_PRODUCT and MOST_PRODUCT times the target. It is tried if the sum
# of the primal and the dual step is below LONG, and kept if that grows by GAIN.
LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT, LONG, GAIN = 0.08, 0.1, 10.0, 1.8, 0.02
# FACTORISATIONS: those tried for one step, each with more regularisation.
# Fraction of the longest feasible step that is taken; a step has full length if the sum
# of the primal and the dual one exceeds FULL.
SHORT, FULL = 0.99, 1.9
# If all slacks and multipliers of the first solve are at most NEGLIGIBLE, all start
# from START_VALUE instead.
NEGLIGIBLE, START_VALUE = 1e-4, 0.1
# Where a refinement step did not reduce the residual, later refinements end at
# ABOVE_ATTAINED times that residual, which counts as the tolerance at most and is
# slowly forgotten. REFINEMENT_STEPS: most of them in a solve.
ABOVE_ATTAINED, FORGET = 2.0, 0.9
# Residuals are relative to the norm of the right-hand side, or to this if larger.
SMALL_RHS = 1e-8
# Relative residual after refinement above which GMRES is tried, KRYLOV_STEPS of it.
GMRES_ABOVE = 1e-6
# Part of a new product, once the earlier ones are taken out, that is rounding alone.
BREAKDOWN = 1e-14
# rho and delta at the start. They fall with mu down to FLOOR; then accurate solves, or
# steps without inequalities, lower them down to LOWEST. A bad solve raises them
# tenfold, up to TOP, and for WAIT iterations they are not lowered.
RHO, DELTA, FLOOR, LOWEST, TOP = 1e-6, 1e-4, 1e-7, 1e-16, 1e-6
# Relative residuals above which a solve is bad, and below which it is accurate; the
# latter after a step of full length, too, whose remainder is due to rho and delta.
POOR, ACCURATE, ACCURATE_FULL = 1e-5, 1e-8, 1e-6
# A residual has to become smaller above NEEDED times its tolerance, and above BEHIND
# times what the gap is over its own; its share of the gap above NEEDED times the
# largest of m mu and the tolerance of the gap.
NEEDED, BEHIND = 0.1, 1e-4


def multiply(m, x, v, Px, Ctv, t):
    """Set Px = P x, Ctv = C'v[n:] and t = (x, C x)."""
    indptr, indices, base = m.indptr, m.indices, m.base
    fill(Px, 0.0, m.n)
    fill(Ctv, 0.0, m.n)
    copy(x, t, m.n)
    for j in range(m.n):
        k, last = indptr[j], indptr[j + 1] - 1
        total = base[last] * x[j]
        Px[j] += add_line(total, base + k, indices + k, last - k, x, x[j], Px)
    for j in range(m.n, m.size):
        k, last = indptr[j], indptr[j + 1] - 1
        t[j] = add_line(0.0, base + k, indices + k, last - k, x, v[j], Ctv)


def evaluate(m):
    """Set the residuals of the iterate, their norms and ratios; keep the best iterate.

    rd = Px + q + C'v + z_box, rp = Ax - b, rw = sign t[place] - c + W.
    """
    n, t, unit = m.n, m.t, m.unit
    fill(m.v, 0.0, m.size)
    copy(m.y, m.v + n, m.p)
    for k in range(m.m):
        m.v[m.place[k]] += m.sign[k] * m.Z[k]
    multiply(m, m.x, m.v, m.Px, m.Ctv, t)
    primal = primal_size = dual = dual_size = dual_norm = row_norm = slack_norm = 0.0
    xPx = qx = by = support = complement = nan_test = dual_share = primal_share = 0.0
    for j in range(n):
        m.rd[j] = m.Px[j] + m.q[j] + m.Ctv[j] + m.v[j]
        xPx += m.x[j] * m.Px[j]
        qx += m.q[j] * m.x[j]
        nan_test += m.rd[j]
        dual_share += m.x[j] * m.rd[j]
        dual_norm = max(dual_norm, fabs(m.rd[j]))
        if fabs(m.rd[j]) > dual * unit[j]:
            dual = fabs(m.rd[j]) / unit[j]
        term = max(fabs(m.Px[j]), fabs(m.q[j]), fabs(m.Ctv[j]), fabs(m.v[j]))
        if term > dual_size * unit[j]:
            dual_size = term / unit[j]
        primal_size = max(primal_size, fabs(m.x[j]) * unit[j])
    for i in range(m.p):
        m.rp[i] = t[n + i] - m.b[i]
        by += m.b[i] * m.y[i]
        primal_share += m.y[i] * m.rp[i]
        row_norm = max(row_norm, fabs(m.rp[i]))
        primal = max(primal, fabs(m.rp[i]) * unit[n + i])
        term = max(fabs(m.b[i]), fabs(t[n + i]))
        primal_size = max(primal_size, term * unit[n + i])
    for k in range(m.m):
        j = m.place[k]
        excess = m.sign[k] * t[j] - m.c[k]
        m.rw[k] = excess + m.W[k]
        support += m.c[k] * m.Z[k]
        primal_share += m.Z[k] * m.rw[k]
        complement += m.W[k] * m.Z[k]
        slack_norm = max(slack_norm, fabs(m.rw[k]))
        primal = max(primal, excess * unit[j])
        if j >= n:
            primal_size = max(primal_size, fabs(t[j]) * unit[j])
    m.dual_norm, m.row_norm, m.slack_norm = dual_norm, row_norm, slack_norm
    m.dual_share, m.primal_share = fabs(dual_share), fabs(primal_share)
    m.mu = complement / m.m if m.m > 0 else 0.0
    m.primal, m.dual = primal, dual
    m.gap = fabs(xPx + qx + by + support)
    m.gap_size = max(fabs(xPx), fabs(qx), fabs(by), fabs(support))
    m.primal_ratio = primal / (m.eps_abs + m.eps_rel * primal_size)
    m.dual_ratio = dual / (m.eps_abs + m.eps_rel * dual_size)
    m.gap_ratio = m.gap / (m.eps_abs + m.eps_rel * m.gap_size)
    worst = max(m.primal_ratio, m.dual_ratio, m.gap_ratio)
    # maxima may ignore a NaN, sums do not
    is_finite: cython.bint = fabs(nan_test) + worst + m.gap < INFINITY
    m.worst = worst if is_finite else INFINITY
    if m.worst < m.best:
        m.best = worst
        copy(m.x, m.best_x, m.length)


def assemble(m):
    """Set omega, weight and the diagonal of K~."""
    rows, delta = m.n + m.p, m.delta
    weight, indptr, base, data = m.weight, m.indptr, m.base, m.data
    fill(weight, 0.0, m.size)
    for k in range(m.m):
        m.omega[k] = m.Z[k] / (m.W[k] + delta * m.Z[k])
        weight[m.place[k]] += m.omega[k]
    for j in range(m.n):
        data[indptr[j + 1] - 1] = base[indptr[j + 1] - 1] + m.rho + weight[j]
    for j in range(m.n, rows):
        data[indptr[j + 1] - 1] = -delta
    for j in range(rows, m.size):
        weight[j] = max(weight[j], THIN)
        data[indptr[j + 1] - 1] = -1.0 / weight[j]


def find_step(m):
    """Solve the Newton system for the target rc."""
    n, rows, rhs = m.n, m.n + m.p, m.rhs
    for j in range(n):
        rhs[j] = -m.rd[j]
    for i in range(m.p):
        rhs[n + i] = -m.rp[i]
    fill(rhs + rows, 0.0, m.size - rows)
    for k in range(m.m):
        m.tau[k] = -m.rw[k] - m.rc[k] / m.Z[k]
    for k in range(m.m):
        rhs[m.place[k]] += m.sign[k] * m.omega[k] * m.tau[k]
    for j in range(rows, m.size):
        rhs[j] /= m.weight[j]
    solve(m)
    set_step(m)


# ---- linear systems


def factor(m):
    """Factor K~ unless its factors are at hand; tell if that succeeds."""
    is_known: cython.bint = True
    for j in range(m.size):
        diagonal = m.data[m.indptr[j + 1] - 1]
        m.row_size[j] = max(1.0, fabs(diagonal))
        if diagonal != m.factored[j]:
            is_known, m.factored[j] = False, diagonal
    if is_known or m.factors.factor_values(m.data, m):
        return True
    m.factored[m.size - 1] = NAN  # unlike any number
    return False


def weighted_norm(r, weight, size):
    """Return max |r_i| / weight_i, NaN if an entry is NaN."""
    worst = 0.0
    for i in range(size):
        if not fabs(r[i]) <= worst * weight[i]:  # few divisions are needed
            worst = fabs(r[i]) / weight[i]
            if worst != worst:
                break
    return worst


def set_remainder(m, b, u, r):
    """Set r = b - K~ u; return its norm max |r_i| / row_size_i."""
    indptr, indices, data = m.indptr, m.indices, m.data
    copy(b, r, m.size)
    for j in range(m.size):
        k, last = indptr[j], indptr[j + 1] - 1
        total = data[last] * u[j]
        r[j] -= add_line(total, data + k, indices + k, last - k, u, -u[j], r)
    return weighted_norm(r, m.row_size, m.size)


def solve(m):
    """Set du to the solution of K~ du = rhs, refined, and r to its residual.

    The refinement ends at the accuracy wanted, or where a step does not halve the
    residual.
    """
    copy(m.rhs, m.r, m.size)
    fill(m.step.du, 0.0, m.size)
    m.rhs_norm = max(SMALL_RHS, weighted_norm(m.rhs, m.row_size, m.size))
    m.step.error = INFINITY
    for k in range(REFINEMENT_STEPS + 1):
        m.factors.solve_into(m.r, m.answer)
        for j in range(m.size):
            m.trial[j] = m.step.du[j] + m.answer[j]
        error = set_remainder(m, m.rhs, m.trial, m.trial_r) / m.rhs_norm
        if k > 0 and not error < m.step.error:
            m.attained = min(m.step.error, m.tol)
            break
        gained: cython.bint = k == 0 or error <= 0.5 * m.step.error
        accept(m, error)
        if error <= m.accuracy or not gained or k == REFINEMENT_STEPS:
            break
        if error <= ABOVE_ATTAINED * m.attained:
            m.attained *= FORGET
            break
    if m.krylov_pays and not m.step.error <= GMRES_ABOVE:
        improve(m)


def accept(m, error):
    """Take the trial point, whose residual is trial_r."""
    m.step.error = error
    m.step.du, m.trial = m.trial, m.step.du
    m.r, m.trial_r = m.trial_r, m.r


def improve(m):
    """Reduce the residual r of du by GMRES, where it can be halved.

    In the form of generalised conjugate residuals (S.C. Eisenstat, H.C. Elman and M.H.
    Schultz, SIAM J. Numer. Anal. 20, 1983) each step solves for what is left, and the
    products of K~ with all corrections, over row_size, are made orthonormal.
    """
    size, weight, trial, r = m.size, m.row_size, m.trial, m.trial_r
    copy(m.step.du, trial, size)
    copy(m.r, r, size)
    for k in range(KRYLOV_STEPS):
        correction = m.krylov + 2 * k * size
        product = correction + size
        m.factors.solve_into(r, correction)
        fill(m.dt, 0.0, size)
        set_remainder(m, m.dt, correction, product)
        for j in range(size):
            product[j] /= -weight[j]
        first = sqrt(dot(product, product, size))
        for _ in range(2):  # orthogonalised twice against rounding
            for i in range(k):
                earlier = m.krylov + 2 * i * size
                part = dot(earlier + size, product, size)
                add_scaled(-part, earlier, correction, 2 * size)
        norm = sqrt(dot(product, product, size))
        if not BREAKDOWN * first < norm < INFINITY:
            break
        part = 0.0
        for j in range(size):
            correction[j] /= norm
            product[j] /= norm
            part += product[j] * r[j] / weight[j]
        add_scaled(part, correction, trial, size)
        for j in range(size):
            r[j] -= part * weight[j] * product[j]
    error = set_remainder(m, m.rhs, trial, m.trial_r) / m.rhs_norm
    m.krylov_pays = error <= 0.5 * m.step.error
    if error < m.step.error:
        accept(m, error)


# ---- steps and their targets


def set_step(m):
    """Set dW and dZ from du, the longest steps a, a' <= 1, and W'Z after them.

    They keep W + a dW >= 0 and Z + a' dZ >= 0; `product` = (W + a dW)'(Z + a' dZ).
    What the linear solve left, r, is taken out of dZ where weights are large: it would
    come back in the dual residual, times omega, and spoils the product W Z less.
    """
    du, dW, dZ, dt = m.step.du, m.step.dW, m.step.dZ, m.dt
    copy(du, dt, m.n)
    for j in range(m.n, m.size):
        k, last = m.indptr[j], m.indptr[j + 1] - 1
        dt[j] = times_line(0.0, m.base + k, m.indices + k, last - k, du)
    W, Z, weight = m.W, m.Z, m.weight
    primal, dual = 1.0, 1.0
    ww = wz = zw = zz = 0.0
    for k in range(m.m):
        dZ[k] = m.omega[k] * (m.sign[k] * dt[m.place[k]] - m.tau[k])
    for k in range(m.m):  # a loop of its own, for divisions two at a time
        dW[k] = (m.rc[k] - W[k] * dZ[k]) / Z[k]
    for k in range(m.m):
        i = m.place[k]
        if weight[i] > 1.0:
            left = m.r[i] / weight[i] if i < m.n else m.r[i]
            most = MOST_LEFT * Z[k]
            dZ[k] += min(max(m.sign[k] * m.omega[k] * left, -most), most)
        if W[k] + primal * dW[k] < 0.0:
            primal = -W[k] / dW[k]
        if Z[k] + dual * dZ[k] < 0.0:
            dual = -Z[k] / dZ[k]
        ww += W[k] * Z[k]
        wz += W[k] * dZ[k]
        zw += dW[k] * Z[k]
        zz += dW[k] * dZ[k]
    m.step.primal, m.step.dual = primal, dual
    m.product = ww + dual * wz + primal * zw + primal * dual * zz


def aim_at_centre(m):
    """Set Mehrotra's target: W Z + W dZ + Z dW = sigma mu - the predictor's dW dZ."""
    ratio = min(max(m.product / (m.m * m.mu), 0.0), 1.0)
    sigma = ratio * ratio * ratio
    gap = m.eps_abs + m.eps_rel * m.gap_size
    target = max(sigma * m.mu, m.least_target * gap / m.m, m.lift * m.gap / m.m)
    m.target = target
    for k in range(m.m):
        m.rc[k] = target - m.W[k] * m.Z[k] - m.step.dW[k] * m.step.dZ[k]


def aim_at_longer_step(m):
    """Add Gondzio's corrector to the target.

    Products at longer steps are moved towards [LEAST_PRODUCT, MOST_PRODUCT] target.
    """
    a = min(1.0, (1.0 + LENGTHENED) * m.step.primal + LENGTHENED)
    z = min(1.0, (1.0 + LENGTHENED) * m.step.dual + LENGTHENED)
    least, most = LEAST_PRODUCT * m.target, MOST_PRODUCT * m.target
    for k in range(m.m):
        product = (m.W[k] + a * m.step.dW[k]) * (m.Z[k] + z * m.step.dZ[k])
        nearest = min(max(product, least), most)
        m.rc[k] += max(nearest - product, -most)


def move(m):
    """Add the step, shortened, to x, y, W and Z; measure the changes."""
    n = m.n
    primal, dual = 1.0, 1.0
    if m.m > 0:
        primal, dual = SHORT * m.step.primal, SHORT * m.step.dual
    du, dW, dZ = m.step.du, m.step.dW, m.step.dZ
    change_x = change_yz = 0.0
    for j in range(n):
        m.x[j] += primal * du[j]
        change_x = max(change_x, primal * fabs(du[j]))
    for i in range(m.p):
        m.y[i] += dual * du[n + i]
        change_yz = max(change_yz, dual * fabs(du[n + i]))
    for k in range(m.m):
        m.W[k] += primal * dW[k]
        m.Z[k] += dual * dZ[k]
        change_yz = max(change_yz, dual * fabs(dZ[k]))
    m.change_x, m.change_yz = change_x, change_yz
    m.has_full_step = m.step.primal + m.step.dual > FULL


def step(m):
    """Make a step; False if K~ has no good factors."""
    if not predict(m):
        return False
    error = m.step.error
    if m.m > 0:
        aim_at_centre(m)
        find_step(m)
    if m.m > 0 and m.step.primal + m.step.dual < LONG:
        aim_at_longer_step(m)
        m.step, m.other = m.other, m.step
        find_step(m)
        longer = m.step.primal + m.step.dual
        if not longer >= m.other.primal + m.other.dual + GAIN:
            m.step, m.other = m.other, m.step
    m.step.error = max(m.step.error, error)
    move(m)
    m.iterations += 1
    return True


def predict(m):
    """Make Mehrotra's predictor, the step for W Z + W dZ + Z dW = 0."""
    for _ in range(FACTORISATIONS):
        assemble(m)
        m.step.error = INFINITY
        if factor(m):
            for k in range(m.m):
                m.rc[k] = -m.W[k] * m.Z[k]
            find_step(m)
            if m.step.error <= POOR:
                return True
        strengthen(m)
    return m.step.error < INFINITY


def start(m):
    """Set the first point; False if K~ has no factors.

    The Newton step from W = Z = 1, with residuals for that, minimises the cost plus
    half the squares of the slacks. Then W = -Z and Z are made positive by Mehrotra's
    shift (SIAM J. Optim. 2, 1992, section 7).
    """
    W, Z = m.W, m.Z
    for k in range(m.m):
        W[k], Z[k], m.rw[k], m.rc[k] = 1.0, 1.0, -m.c[k], 0.0
    copy(m.q, m.rd, m.n)
    for i in range(m.p):
        m.rp[i] = -m.b[i]
    assemble(m)
    if not factor(m):
        return False
    find_step(m)
    du, dZ = m.step.du, m.step.dZ
    copy(du, m.x, m.n)
    copy(du + m.n, m.y, m.p)
    fill(du, 0.0, m.size)
    least = most = 0.0
    for k in range(m.m):
        Z[k] = dZ[k]
        dZ[k] = 0.0
        least, most = min(least, Z[k]), max(most, Z[k])
    if max(most, -least) <= NEGLIGIBLE:
        fill(W, START_VALUE, m.m)
        fill(Z, START_VALUE, m.m)
        return True
    product = sum_w = sum_z = 0.0
    for k in range(m.m):
        W[k] = -Z[k] + 1.5 * most
        Z[k] -= 1.5 * least
        product += W[k] * Z[k]
        sum_w += W[k]
        sum_z += Z[k]
    for k in range(m.m):
        W[k] += 0.5 * product / sum_z
        Z[k] += 0.5 * product / sum_w
    return True


# ---- regularisation


def regularise(m, old_mu):
    """Adapt rho and delta after a step, to its effect on mu and on the residuals."""
    if m.m == 0:
        lower(m, True, True)
        return
    factor = max(0.0, 1.0 - fabs(old_mu - m.mu) / old_mu) if old_mu > 0.0 else 0.0
    m.rho = max(m.rho * factor, min(m.rho, FLOOR))
    m.delta = max(m.delta * factor, min(m.delta, FLOOR))
    if not m.step.error <= POOR:
        strengthen(m)
    elif m.wait > 0:
        m.wait -= 1
    elif m.step.error < (ACCURATE_FULL if m.has_full_step else ACCURATE):
        dual, primal = m.dual_norm, max(m.row_norm, m.slack_norm)
        rho_dominates: cython.bint = m.rho * m.change_x > 0.5 * dual
        delta_dominates: cython.bint = m.delta * m.change_yz > 0.5 * primal
        gap = NEEDED * max(m.mu * m.m, m.eps_abs + m.eps_rel * m.gap_size)
        needed = max(NEEDED, BEHIND * m.gap_ratio)
        lower(
            m,
            rho_dominates and (m.dual_ratio > needed or m.dual_share > gap),
            delta_dominates and (m.primal_ratio > needed or m.primal_share > gap),
        )


def lower(m, rho, delta):
    if rho:
        m.rho = max(0.1 * m.rho, LOWEST)
    if delta:
        m.delta = max(0.1 * m.delta, LOWEST)


def strengthen(m):
    m.rho = max(m.rho, min(10.0 * m.rho, TOP))
    m.delta = max(m.delta, min(10.0 * m.delta, TOP))
    m.wait = WAIT
