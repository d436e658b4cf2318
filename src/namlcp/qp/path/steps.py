"""The parts of one interior-point iteration, compiled; m is the record of `Workspace`.

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

import numpy as np

from namlcp.compiled import floats_at, ints_at, part

# Least weight of a row, whose reciprocal is on the diagonal of K~.
THIN = 1e-20
# Largest correction of dZ for the error of the linear solve, relative to Z.
MOST_LEFT = 0.1
# Gondzio's corrector aims at steps (1 + LENGTHENED) a + LENGTHENED and at products W Z
# there between LEAST_PRODUCT and MOST_PRODUCT times the target.
LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT = 0.08, 0.1, 10.0
# Fraction of the longest feasible step that is taken.
SHORT = 0.99
# Least target of W'Z, relative to the tolerance of the gap.
LEAST_TARGET = 0.01
# If all scaled slacks and multipliers of the first solve are at most NEGLIGIBLE, all
# start from START_VALUE instead.
NEGLIGIBLE, START_VALUE = 1e-4, 0.1


# Bytes of a number in a vector.
WIDTH = 8


@part
def put(a, size, out):
    """Set out[:size] to a."""
    for i in range(size):
        out[i] = a[i]


@part
def multiply(m, x, v, Px, Ctv, t):
    """Set Px = P x, Ctv = C'v[n:] and t = (x, C x)."""
    n, indptr = m.n, ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    indices, base = ints_at(m.indices, nnz), floats_at(m.base, nnz)
    for j in range(n):
        Px[j] = 0.0
        Ctv[j] = 0.0
        t[j] = x[j]
    for j in range(n):
        last = indptr[j + 1] - 1
        xj = x[j]
        total = base[last] * xj
        for k in range(indptr[j], last):
            i = indices[k]
            Px[i] += base[k] * xj
            total += base[k] * x[i]
        Px[j] += total
    for j in range(n, m.size):
        vj = v[j]
        total = 0.0
        for k in range(indptr[j], indptr[j + 1] - 1):
            i = indices[k]
            Ctv[i] += base[k] * vj
            total += base[k] * x[i]
        t[j] = total


@part
def evaluate(m):
    """Set the residuals of the iterate, their norms and ratios; keep the best iterate.

    rd = Px + q + C'v + z_box, rp = Ax - b, rw = sign t[place] - c + W. The numbers of
    `Residuals` are unscaled and measure the violation without W.
    """
    n, p, size = m.n, m.p, m.size
    x, y = floats_at(m.x, n), floats_at(m.y, p)
    W, Z = floats_at(m.W, m.m), floats_at(m.Z, m.m)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    unit = floats_at(m.unit, size)
    v, t = floats_at(m.v, size), floats_at(m.t, size)
    Px, Ctv = floats_at(m.Px, n), floats_at(m.Ctv, n)
    for j in range(size):
        v[j] = 0.0
    for i in range(p):
        v[n + i] = y[i]
    for k in range(m.m):
        v[place[k]] += sign[k] * Z[k]
    multiply(m, x, v, Px, Ctv, t)
    primal = primal_size = dual = dual_size = 0.0
    dual_norm = row_norm = slack_norm = 0.0
    xPx = qx = by = support = complement = nan_test = 0.0
    dual_share = primal_share = 0.0
    q, rd = floats_at(m.q, n), floats_at(m.rd, n)
    for j in range(n):
        rd[j] = Px[j] + q[j] + Ctv[j] + v[j]
        xPx += x[j] * Px[j]
        qx += q[j] * x[j]
        nan_test += rd[j]
        dual_share += x[j] * rd[j]
        dual_norm = max(dual_norm, abs(rd[j]))
        dual = max(dual, abs(rd[j]) / unit[j])
        term = max(abs(Px[j]), abs(q[j]), abs(Ctv[j]), abs(v[j]))
        dual_size = max(dual_size, term / unit[j])
        primal_size = max(primal_size, abs(x[j]) * unit[j])
    b, rp = floats_at(m.b, p), floats_at(m.rp, p)
    for i in range(p):
        rp[i] = t[n + i] - b[i]
        by += b[i] * y[i]
        primal_share += y[i] * rp[i]
        row_norm = max(row_norm, abs(rp[i]))
        primal = max(primal, abs(rp[i]) * unit[n + i])
        term = max(abs(b[i]), abs(t[n + i]))
        primal_size = max(primal_size, term * unit[n + i])
    c, rw = floats_at(m.c, m.m), floats_at(m.rw, m.m)
    for k in range(m.m):
        j = place[k]
        excess = sign[k] * t[j] - c[k]
        rw[k] = excess + W[k]
        support += c[k] * Z[k]
        primal_share += Z[k] * rw[k]
        complement += W[k] * Z[k]
        slack_norm = max(slack_norm, abs(rw[k]))
        primal = max(primal, excess * unit[j])
        if j >= n:
            primal_size = max(primal_size, abs(t[j]) * unit[j])
    m.dual_norm, m.row_norm, m.slack_norm = dual_norm, row_norm, slack_norm
    m.dual_share, m.primal_share = abs(dual_share), abs(primal_share)
    m.mu = complement / m.m if m.m > 0 else 0.0
    m.primal, m.primal_size = primal, primal_size
    m.dual, m.dual_size = dual, dual_size
    m.gap = abs(xPx + qx + by + support)
    m.gap_size = max(abs(xPx), abs(qx), abs(by), abs(support))
    m.primal_ratio = primal / (m.eps_abs + m.eps_rel * primal_size)
    m.dual_ratio = dual / (m.eps_abs + m.eps_rel * dual_size)
    m.gap_ratio = m.gap / (m.eps_abs + m.eps_rel * m.gap_size)
    worst = max(m.primal_ratio, m.dual_ratio, m.gap_ratio)
    # maxima may ignore a NaN, sums do not
    finite = abs(nan_test) + worst + m.gap < np.inf
    m.worst = worst if finite else np.inf
    if m.worst < m.best:
        m.best = worst
        put(x, n, floats_at(m.best_x, n))
        put(y, p, floats_at(m.best_y, p))
        put(Z, m.m, floats_at(m.best_Z, m.m))


@part
def assemble(m):
    """Set omega, weight and the diagonal of K~."""
    n, rows = m.n, m.n + m.p
    weight, indptr = floats_at(m.weight, m.size), ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    base, data = floats_at(m.base, nnz), floats_at(m.data, nnz)
    W, Z, omega = floats_at(m.W, m.m), floats_at(m.Z, m.m), floats_at(m.omega, m.m)
    place = ints_at(m.place, m.m)
    for j in range(m.size):
        weight[j] = 0.0
    for k in range(m.m):
        omega[k] = Z[k] / (W[k] + m.delta * Z[k])
        weight[place[k]] += omega[k]
    for j in range(n):
        data[indptr[j + 1] - 1] = base[indptr[j + 1] - 1] + m.rho + weight[j]
    for j in range(n, rows):
        data[indptr[j + 1] - 1] = -m.delta
    for j in range(rows, m.size):
        weight[j] = max(weight[j], THIN)
        data[indptr[j + 1] - 1] = -1.0 / weight[j]


@part
def set_right_side(m):
    """Set tau and the right-hand side of the Newton system for the target rc."""
    n, p = m.n, m.p
    rhs, weight = floats_at(m.rhs, m.size), floats_at(m.weight, m.size)
    rd, rp = floats_at(m.rd, n), floats_at(m.rp, p)
    rw, rc = floats_at(m.rw, m.m), floats_at(m.rc, m.m)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    Z, omega, tau = floats_at(m.Z, m.m), floats_at(m.omega, m.m), floats_at(m.tau, m.m)
    for j in range(n):
        rhs[j] = -rd[j]
    for i in range(p):
        rhs[n + i] = -rp[i]
    for j in range(n + p, m.size):
        rhs[j] = 0.0
    for k in range(m.m):
        tau[k] = -rw[k] - rc[k] / Z[k]
        rhs[place[k]] += sign[k] * omega[k] * tau[k]
    for j in range(n + p, m.size):
        rhs[j] /= weight[j]


@part
def set_step(m):
    """Set dW and dZ from du, the longest steps a, a' <= 1, and W'Z after them.

    They keep W + a dW >= 0 and Z + a' dZ >= 0; `product` = (W + a dW)'(Z + a' dZ).
    What the linear solve left, r, is taken out of dZ where weights are large: it would
    come back in the dual residual, times omega, and spoils the product W Z less.
    """
    n = m.n
    du, dt = floats_at(m.du, m.size), floats_at(m.dt, m.size)
    indptr = ints_at(m.indptr, m.size + 1)
    nnz = np.int64(indptr[m.size])
    indices, base = ints_at(m.indices, nnz), floats_at(m.base, nnz)
    for j in range(n):
        dt[j] = du[j]
    for j in range(n, m.size):
        total = 0.0
        for k in range(indptr[j], indptr[j + 1] - 1):
            total += base[k] * du[indices[k]]
        dt[j] = total
    W, Z = floats_at(m.W, m.m), floats_at(m.Z, m.m)
    dW, dZ = floats_at(m.dW, m.m), floats_at(m.dZ, m.m)
    rc, omega = floats_at(m.rc, m.m), floats_at(m.omega, m.m)
    tau = floats_at(m.tau, m.m)
    place, sign = ints_at(m.place, m.m), floats_at(m.sign, m.m)
    weight, r = floats_at(m.weight, m.size), floats_at(m.r, m.size)
    primal, dual = 1.0, 1.0
    ww = wz = zw = zz = 0.0
    for k in range(m.m):
        j = place[k]
        dZ[k] = omega[k] * (sign[k] * dt[j] - tau[k])
        dW[k] = (rc[k] - W[k] * dZ[k]) / Z[k]
        if weight[j] > 1.0:
            left = r[j] / weight[j] if j < n else r[j]
            most = MOST_LEFT * Z[k]
            dZ[k] += min(max(sign[k] * omega[k] * left, -most), most)
        if W[k] + primal * dW[k] < 0.0:
            primal = -W[k] / dW[k]
        if Z[k] + dual * dZ[k] < 0.0:
            dual = -Z[k] / dZ[k]
        ww += W[k] * Z[k]
        wz += W[k] * dZ[k]
        zw += dW[k] * Z[k]
        zz += dW[k] * dZ[k]
    m.primal_step, m.dual_step = primal, dual
    m.product = ww + dual * wz + primal * zw + primal * dual * zz


@part
def aim_at_zero(m):
    """Set the target of the predictor: W Z + W dZ + Z dW = 0."""
    W, Z, rc = floats_at(m.W, m.m), floats_at(m.Z, m.m), floats_at(m.rc, m.m)
    for k in range(m.m):
        rc[k] = -W[k] * Z[k]


@part
def aim_at_centre(m):
    """Set Mehrotra's target: W Z + W dZ + Z dW = sigma mu - the predictor's dW dZ."""
    ratio = min(max(m.product / (m.m * m.mu), 0.0), 1.0)
    sigma = ratio * ratio * ratio
    gap = m.eps_abs + m.eps_rel * m.gap_size
    m.target = max(sigma * m.mu, LEAST_TARGET * gap / m.m, m.lift * m.gap / m.m)
    W, Z, rc = floats_at(m.W, m.m), floats_at(m.Z, m.m), floats_at(m.rc, m.m)
    dW, dZ = floats_at(m.dW, m.m), floats_at(m.dZ, m.m)
    for k in range(m.m):
        rc[k] = m.target - W[k] * Z[k] - dW[k] * dZ[k]


@part
def aim_at_longer_step(m):
    """Add Gondzio's corrector to the target.

    Products at longer steps are moved towards [LEAST_PRODUCT, MOST_PRODUCT] target.
    """
    W, Z, rc = floats_at(m.W, m.m), floats_at(m.Z, m.m), floats_at(m.rc, m.m)
    dW, dZ, target = floats_at(m.dW, m.m), floats_at(m.dZ, m.m), m.target
    a = min(1.0, (1.0 + LENGTHENED) * m.primal_step + LENGTHENED)
    z = min(1.0, (1.0 + LENGTHENED) * m.dual_step + LENGTHENED)
    for k in range(m.m):
        product = (W[k] + a * dW[k]) * (Z[k] + z * dZ[k])
        nearest = min(max(product, LEAST_PRODUCT * target), MOST_PRODUCT * target)
        rc[k] += max(nearest - product, -MOST_PRODUCT * target)


@part
def exchange_steps(m):
    """Exchange the step with the other one."""
    m.du, m.other_du = m.other_du, m.du
    m.dW, m.other_dW = m.other_dW, m.dW
    m.dZ, m.other_dZ = m.other_dZ, m.dZ
    m.primal_step, m.other_primal_step = m.other_primal_step, m.primal_step
    m.dual_step, m.other_dual_step = m.other_dual_step, m.dual_step
    m.error, m.other_error = m.other_error, m.error


@part
def move(m):
    """Add the step, shortened, to x, y, W and Z; measure the changes."""
    n, p = m.n, m.p
    primal, dual = 1.0, 1.0
    if m.m > 0:
        primal, dual = SHORT * m.primal_step, SHORT * m.dual_step
    x, y, du = floats_at(m.x, n), floats_at(m.y, p), floats_at(m.du, m.size)
    W, Z = floats_at(m.W, m.m), floats_at(m.Z, m.m)
    dW, dZ = floats_at(m.dW, m.m), floats_at(m.dZ, m.m)
    change_x = change_yz = 0.0
    for j in range(n):
        x[j] += primal * du[j]
        change_x = max(change_x, primal * abs(du[j]))
    for i in range(p):
        y[i] += dual * du[n + i]
        change_yz = max(change_yz, dual * abs(du[n + i]))
    for k in range(m.m):
        W[k] += primal * dW[k]
        Z[k] += dual * dZ[k]
        change_yz = max(change_yz, dual * abs(dZ[k]))
    m.change_x, m.change_yz = change_x, change_yz


@part
def prepare_start(m):
    """Set W = Z = 1 and the residuals so that the Newton step leads to a first point.

    It minimises the cost plus half the squares of the slacks.
    """
    n, p = m.n, m.p
    W, Z = floats_at(m.W, m.m), floats_at(m.Z, m.m)
    rw, rc = floats_at(m.rw, m.m), floats_at(m.rc, m.m)
    rd, rp = floats_at(m.rd, n), floats_at(m.rp, p)
    q, b = floats_at(m.q, n), floats_at(m.b, p)
    c = floats_at(m.c, m.m)
    for k in range(m.m):
        W[k], Z[k], rw[k], rc[k] = 1.0, 1.0, -c[k], 0.0
    for j in range(n):
        rd[j] = q[j]
    for i in range(p):
        rp[i] = -b[i]


@part
def start_inside(m):
    """Take the step of `prepare_start` as the point, with W and Z made positive.

    The shift is Mehrotra's (SIAM J. Optim. 2, 1992, section 7).
    """
    n, p = m.n, m.p
    x, y, du = floats_at(m.x, n), floats_at(m.y, p), floats_at(m.du, m.size)
    W, Z, dZ = floats_at(m.W, m.m), floats_at(m.Z, m.m), floats_at(m.dZ, m.m)
    put(du, n, x)
    put(floats_at(m.du + WIDTH * n, p), p, y)
    for j in range(m.size):
        du[j] = 0.0
    least, most = 0.0, 0.0
    for k in range(m.m):
        Z[k] = dZ[k]
        dZ[k] = 0.0
        least, most = min(least, Z[k]), max(most, Z[k])
    if max(most, -least) <= NEGLIGIBLE:
        for k in range(m.m):
            W[k], Z[k] = START_VALUE, START_VALUE
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
