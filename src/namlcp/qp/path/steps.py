"""Vector operations of one interior-point iteration, compiled, without allocation.

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

from namlcp.compiled import kernel
from namlcp.qp.kkt import products

# Indices in the `norms` of `evaluate`: the mean of W Z, norms of the scaled residuals
# rd, rp and rw, then the first six numbers of `Residuals`.
MU, DUAL_NORM, ROW_NORM, SLACK_NORM = range(4)
PRIMAL, DUAL, GAP, PRIMAL_SIZE, DUAL_SIZE, GAP_SIZE = range(4, 10)
# Least weight of a row, whose reciprocal is on the diagonal of K~.
THIN = 1e-20
# Gondzio's corrector aims at steps (1 + LENGTHENED) a + LENGTHENED and at products W Z
# there between LEAST_PRODUCT and MOST_PRODUCT times the target.
LENGTHENED, LEAST_PRODUCT, MOST_PRODUCT = 0.08, 0.1, 10.0
# If all scaled slacks and multipliers of the first solve are at most NEGLIGIBLE, all
# start from START_VALUE instead.
NEGLIGIBLE, START_VALUE = 1e-4, 0.1


@kernel
def evaluate(
    indptr, indices, base, unit, q, b, place, sign, c, x, y, W, Z,
    v, Px, Ctv, t, rd, rp, rw, norms,
):  # fmt: skip
    """Set rd, rp, rw and norms to the residuals of the iterate; v, Px, Ctv, t are work.

    rd = Px + q + C'v + z_box, rp = Ax - b, rw = sign t[place] - c + W; `norms` has the
    indices named above. The numbers of `Residuals` are unscaled and measure the
    violation without W. A NaN in rd ends the function with NaN as dual residual.
    """
    n, p = x.size, y.size
    v[:] = 0.0
    for i in range(p):
        v[n + i] = y[i]
    for k in range(place.size):
        v[place[k]] += sign[k] * Z[k]
    products(indptr, indices, base, x, v, Px, Ctv, t)
    norms[:] = 0.0
    xPx, qx = 0.0, 0.0
    for j in range(n):
        rd[j] = Px[j] + q[j] + Ctv[j] + v[j]
        xPx += x[j] * Px[j]
        qx += q[j] * x[j]
        norms[DUAL_NORM] = max(norms[DUAL_NORM], abs(rd[j]))
        norms[DUAL] = max(norms[DUAL], abs(rd[j]) / unit[j])
        term = max(abs(Px[j]), abs(q[j]), abs(Ctv[j]), abs(v[j]))
        norms[DUAL_SIZE] = max(norms[DUAL_SIZE], term / unit[j])
        norms[PRIMAL_SIZE] = max(norms[PRIMAL_SIZE], abs(x[j]) * unit[j])
        if rd[j] != rd[j]:
            norms[DUAL] = np.nan
            return
    by = 0.0
    for i in range(p):
        rp[i] = t[n + i] - b[i]
        by += b[i] * y[i]
        norms[ROW_NORM] = max(norms[ROW_NORM], abs(rp[i]))
        norms[PRIMAL] = max(norms[PRIMAL], abs(rp[i]) * unit[n + i])
        term = max(abs(b[i]), abs(t[n + i]))
        norms[PRIMAL_SIZE] = max(norms[PRIMAL_SIZE], term * unit[n + i])
    support, complement = 0.0, 0.0
    for k in range(place.size):
        j = place[k]
        excess = sign[k] * t[j] - c[k]
        rw[k] = excess + W[k]
        support += c[k] * Z[k]
        complement += W[k] * Z[k]
        norms[SLACK_NORM] = max(norms[SLACK_NORM], abs(rw[k]))
        norms[PRIMAL] = max(norms[PRIMAL], excess * unit[j])
        if j >= n:
            norms[PRIMAL_SIZE] = max(norms[PRIMAL_SIZE], abs(t[j]) * unit[j])
    if place.size > 0:
        norms[MU] = complement / place.size
    norms[GAP] = abs(xPx + qx + by + support)
    norms[GAP_SIZE] = max(abs(xPx), abs(qx), abs(by), abs(support))


@kernel
def assemble(base, diagonal, n, p, place, W, Z, rho, delta, omega, weight, data):
    """Set omega, weight (size,) and the diagonal of K~ in `data`."""
    weight[:] = 0.0
    for k in range(place.size):
        omega[k] = Z[k] / (W[k] + delta * Z[k])
        weight[place[k]] += omega[k]
    for j in range(n):
        data[diagonal[j]] = base[diagonal[j]] + rho + weight[j]
    for j in range(n, n + p):
        data[diagonal[j]] = -delta
    for j in range(n + p, weight.size):
        weight[j] = max(weight[j], THIN)
        data[diagonal[j]] = -1.0 / weight[j]


@kernel
def newton_right_side(rd, rp, rw, rc, place, sign, Z, omega, weight, tau, rhs):
    """Set tau and the right-hand side of the Newton system for the target rc."""
    n, p = rd.size, rp.size
    for j in range(n):
        rhs[j] = -rd[j]
    for i in range(p):
        rhs[n + i] = -rp[i]
    rhs[n + p :] = 0.0
    for k in range(place.size):
        tau[k] = -rw[k] - rc[k] / Z[k]
        rhs[place[k]] += sign[k] * omega[k] * tau[k]
    for j in range(n + p, rhs.size):
        rhs[j] /= weight[j]


@kernel
def slack_step(
    indptr, indices, base, n, du, place, sign, omega, tau, rc, W, Z, dt, dW, dZ, out
):
    """Set dt = (dx, C dx), dW, dZ and out = (a, a', (W + a dW)'(Z + a' dZ)).

    a and a' are the longest steps <= 1 with W + a dW >= 0 and Z + a' dZ >= 0.
    """
    for j in range(n):
        dt[j] = du[j]
    for j in range(n, dt.size):
        total = 0.0
        for k in range(indptr[j], indptr[j + 1] - 1):
            total += base[k] * du[indices[k]]
        dt[j] = total
    primal, dual = 1.0, 1.0
    ww, wz, zw, zz = 0.0, 0.0, 0.0, 0.0
    for k in range(place.size):
        dZ[k] = omega[k] * (sign[k] * dt[place[k]] - tau[k])
        dW[k] = (rc[k] - W[k] * dZ[k]) / Z[k]
        if W[k] + primal * dW[k] < 0.0:
            primal = -W[k] / dW[k]
        if Z[k] + dual * dZ[k] < 0.0:
            dual = -Z[k] / dZ[k]
        ww += W[k] * Z[k]
        wz += W[k] * dZ[k]
        zw += dW[k] * Z[k]
        zz += dW[k] * dZ[k]
    out[0] = primal
    out[1] = dual
    out[2] = ww + dual * wz + primal * zw + primal * dual * zz


@kernel
def centred_target(W, Z, dW, dZ, primal, dual, smu, rc):
    """Add Gondzio's corrector to the target rc, for the mean smu of W Z.

    Products at longer steps are moved towards [LEAST_PRODUCT, MOST_PRODUCT] smu.
    """
    a = min(1.0, (1.0 + LENGTHENED) * primal + LENGTHENED)
    z = min(1.0, (1.0 + LENGTHENED) * dual + LENGTHENED)
    for k in range(W.size):
        product = (W[k] + a * dW[k]) * (Z[k] + z * dZ[k])
        change = min(max(product, LEAST_PRODUCT * smu), MOST_PRODUCT * smu) - product
        rc[k] += max(change, -MOST_PRODUCT * smu)


@kernel
def take_step(n, du, dW, dZ, primal, dual, x, y, W, Z, out):
    """Add the step to x, y, W, Z; out = (largest change of x, that of y and Z)."""
    out[0] = 0.0
    out[1] = 0.0
    for j in range(n):
        x[j] += primal * du[j]
        out[0] = max(out[0], primal * abs(du[j]))
    for i in range(y.size):
        y[i] += dual * du[n + i]
        out[1] = max(out[1], dual * abs(du[n + i]))
    for k in range(W.size):
        W[k] += primal * dW[k]
        Z[k] += dual * dZ[k]
        out[1] = max(out[1], dual * abs(dZ[k]))


def shifted_inside(W: np.ndarray, Z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return W and Z made positive by Mehrotra's shift (SIAM J. Optim. 2, sec. 7)."""
    if max(np.abs(W).max(), np.abs(Z).max()) <= NEGLIGIBLE:
        return np.full(W.size, START_VALUE), np.full(Z.size, START_VALUE)
    W = W + max(0.0, -1.5 * W.min())
    Z = Z + max(0.0, -1.5 * Z.min())
    product, sum_w, sum_z = W @ Z, W.sum(), Z.sum()
    return W + 0.5 * product / sum_z, Z + 0.5 * product / sum_w
