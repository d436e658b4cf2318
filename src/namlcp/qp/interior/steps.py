"""The parts of one interior-point iteration.

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
"""

import cython
from cython.cimports.libc.math import INFINITY
from cython.cimports.namlcp.linalg.vectors import add_line, copy, fill, times_line

# Least weight of a row, whose reciprocal is on the diagonal of K~.
THIN = 1e-20
# Largest correction of dZ for the error of the linear solve, relative to Z.
MOST_LEFT = 0.1
# Gondzio's corrector aims at steps (1 + LENGTHENED) a + LENGTHENED and at products W Z
# there between LEAST_PRODUCT and MOST_PRODUCT times the target.
LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT = 0.08, 0.1, 10.0
# Fraction of the longest feasible step that is taken; a step has full length if the sum
# of the primal and the dual one exceeds FULL.
SHORT, FULL = 0.99, 1.9
# If all scaled slacks and multipliers of the first solve are at most NEGLIGIBLE, all
# start from START_VALUE instead.
NEGLIGIBLE, START_VALUE = 1e-4, 0.1


def multiply(m, x, v, Px, Ctv, t):
    """Set Px = P x, Ctv = C'v[n:] and t = (x, C x)."""
    indptr, indices, base = m.indptr, m.indices, m.base
    for j in range(m.n):
        Px[j] = 0.0
        Ctv[j] = 0.0
        t[j] = x[j]
    for j in range(m.n):
        k, last = indptr[j], indptr[j + 1] - 1
        total = base[last] * x[j]
        Px[j] += add_line(total, base + k, indices + k, last - k, x, x[j], Px)
    for j in range(m.n, m.size):
        k, last = indptr[j], indptr[j + 1] - 1
        t[j] = add_line(0.0, base + k, indices + k, last - k, x, v[j], Ctv)


def evaluate(m):
    """Set the residuals of the iterate, their norms and ratios; keep the best iterate.

    rd = Px + q + C'v + z_box, rp = Ax - b, rw = sign t[place] - c + W. The numbers of
    `Residuals` are unscaled and measure the violation without W.
    """
    n, t, unit = m.n, m.t, m.unit
    fill(m.v, 0.0, m.size)
    copy(m.y, m.v + n, m.p)
    for k in range(m.m):
        m.v[m.place[k]] += m.sign[k] * m.Z[k]
    multiply(m, m.x, m.v, m.Px, m.Ctv, t)
    primal: cython.double = 0.0
    primal_size: cython.double = 0.0
    dual: cython.double = 0.0
    dual_size: cython.double = 0.0
    dual_norm: cython.double = 0.0
    row_norm: cython.double = 0.0
    slack_norm: cython.double = 0.0
    xPx = qx = by = support = complement = nan_test = dual_share = primal_share = 0.0
    for j in range(n):
        m.rd[j] = m.Px[j] + m.q[j] + m.Ctv[j] + m.v[j]
        xPx += m.x[j] * m.Px[j]
        qx += m.q[j] * m.x[j]
        nan_test += m.rd[j]
        dual_share += m.x[j] * m.rd[j]
        dual_norm = max(dual_norm, abs(m.rd[j]))
        dual = max(dual, abs(m.rd[j]) / unit[j])
        term = max(abs(m.Px[j]), abs(m.q[j]), abs(m.Ctv[j]), abs(m.v[j]))
        dual_size = max(dual_size, term / unit[j])
        primal_size = max(primal_size, abs(m.x[j]) * unit[j])
    for i in range(m.p):
        m.rp[i] = t[n + i] - m.b[i]
        by += m.b[i] * m.y[i]
        primal_share += m.y[i] * m.rp[i]
        row_norm = max(row_norm, abs(m.rp[i]))
        primal = max(primal, abs(m.rp[i]) * unit[n + i])
        term = max(abs(m.b[i]), abs(t[n + i]))
        primal_size = max(primal_size, term * unit[n + i])
    for k in range(m.m):
        j = m.place[k]
        excess = m.sign[k] * t[j] - m.c[k]
        m.rw[k] = excess + m.W[k]
        support += m.c[k] * m.Z[k]
        primal_share += m.Z[k] * m.rw[k]
        complement += m.W[k] * m.Z[k]
        slack_norm = max(slack_norm, abs(m.rw[k]))
        primal = max(primal, excess * unit[j])
        if j >= n:
            primal_size = max(primal_size, abs(t[j]) * unit[j])
    m.dual_norm, m.row_norm, m.slack_norm = dual_norm, row_norm, slack_norm
    m.dual_share, m.primal_share = abs(dual_share), abs(primal_share)
    m.mu = complement / m.m if m.m > 0 else 0.0
    m.primal, m.dual = primal, dual
    m.gap = abs(xPx + qx + by + support)
    m.gap_size = max(abs(xPx), abs(qx), abs(by), abs(support))
    m.primal_ratio = primal / (m.eps_abs + m.eps_rel * primal_size)
    m.dual_ratio = dual / (m.eps_abs + m.eps_rel * dual_size)
    m.gap_ratio = m.gap / (m.eps_abs + m.eps_rel * m.gap_size)
    worst = max(m.primal_ratio, m.dual_ratio, m.gap_ratio)
    # maxima may ignore a NaN, sums do not
    is_finite: cython.bint = abs(nan_test) + worst + m.gap < INFINITY
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


def set_right_side(m):
    """Set tau and the right-hand side of the Newton system for the target rc."""
    n, rows, rhs = m.n, m.n + m.p, m.rhs
    for j in range(n):
        rhs[j] = -m.rd[j]
    for i in range(m.p):
        rhs[n + i] = -m.rp[i]
    for j in range(rows, m.size):
        rhs[j] = 0.0
    for k in range(m.m):
        m.tau[k] = -m.rw[k] - m.rc[k] / m.Z[k]
        rhs[m.place[k]] += m.sign[k] * m.omega[k] * m.tau[k]
    for j in range(rows, m.size):
        rhs[j] /= m.weight[j]


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
        i = m.place[k]
        dZ[k] = m.omega[k] * (m.sign[k] * dt[i] - m.tau[k])
        dW[k] = (m.rc[k] - W[k] * dZ[k]) / Z[k]
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
    change_x: cython.double = 0.0
    change_yz: cython.double = 0.0
    for j in range(n):
        m.x[j] += primal * du[j]
        change_x = max(change_x, primal * abs(du[j]))
    for i in range(m.p):
        m.y[i] += dual * du[n + i]
        change_yz = max(change_yz, dual * abs(du[n + i]))
    for k in range(m.m):
        m.W[k] += primal * dW[k]
        m.Z[k] += dual * dZ[k]
        change_yz = max(change_yz, dual * abs(dZ[k]))
    m.change_x, m.change_yz = change_x, change_yz
    m.has_full_step = m.step.primal + m.step.dual > FULL


def prepare_start(m):
    """Set W = Z = 1 and the residuals so that the Newton step leads to a first point.

    It minimises the cost plus half the squares of the slacks.
    """
    for k in range(m.m):
        m.W[k], m.Z[k], m.rw[k], m.rc[k] = 1.0, 1.0, -m.c[k], 0.0
    copy(m.q, m.rd, m.n)
    for i in range(m.p):
        m.rp[i] = -m.b[i]


def start_inside(m):
    """Take the step of `prepare_start` as the point, with W and Z made positive.

    The shift is Mehrotra's (SIAM J. Optim. 2, 1992, section 7).
    """
    W, Z, du, dZ = m.W, m.Z, m.step.du, m.step.dZ
    copy(du, m.x, m.n)
    copy(du + m.n, m.y, m.p)
    fill(du, 0.0, m.size)
    least: cython.double = 0.0
    most: cython.double = 0.0
    for k in range(m.m):
        Z[k] = dZ[k]
        dZ[k] = 0.0
        least, most = min(least, Z[k]), max(most, Z[k])
    if max(most, -least) <= NEGLIGIBLE:
        fill(W, START_VALUE, m.m)
        fill(Z, START_VALUE, m.m)
        return
    product = sum_w = sum_z = 0.0
    for k in range(m.m):  # W = -Z before
        W[k] = -Z[k] + 1.5 * most
        Z[k] -= 1.5 * least
        product += W[k] * Z[k]
        sum_w += W[k]
        sum_z += Z[k]
    for k in range(m.m):
        W[k] += 0.5 * product / sum_z
        Z[k] += 0.5 * product / sum_w
