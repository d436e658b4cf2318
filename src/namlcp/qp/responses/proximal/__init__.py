"""QPs whose P has no good factor: proximal rounds, and faces within them.

With P + W in place of P, W = rho D as in `weight`, the base problem has a factor. A
round with the centre c, at first 0,

1. minimises 1/2 x'Px + q'x + 1/2 (x - c)'W(x - c) by `active`, from the active rows of
   the round before: its base solution is K^-1 (W c - q, b) (`rounds`);
2. minimises the cost without W on the face of the active rows F, by conjugate gradients
   with the operator K_F, that of P + W on the face, as preconditioner (`face`). They
   end after as many passes as there are curvatures on the face that are not large
   against W: one to three, mostly.

If the point at hand has the right signs and violates no row, the QP is solved. Else it
is the next centre; so is the point where the second step meets the first row that is
not active. Every centre is feasible and the cost falls from round to round, so that no
F comes back (Rockafellar, SIAM J. Control Optim. 14 (1976) 877-898). The answer depends
on the data alone, as c = 0 at the beginning of every solve.

On the face, with r = P x + q + G'z + A'y, and mu for the multipliers of active rows, a
pass takes

    (dx, dy) = K^-1 (-r, b - A x),   dmu = S^-1 (dx_F + s_F - d_F),   s = (G x, x, y),
    p = dx - sum dmu_i w_i + (e / e_old) p_old,   e = dx'(P + W) dx,

mu += dmu, y += dy, x += e / p'Pp p. A direction without curvature along which no row is
met and the cost falls is a ray: the QP is unbounded (`certificates`).
"""

from namlcp.qp.responses.proximal.certificates import (
    contradicts_equations,
    leaves_equations,
    refine_contradiction,
)
from namlcp.qp.responses.proximal.rounds import UNBOUNDED, solve_by_rounds
