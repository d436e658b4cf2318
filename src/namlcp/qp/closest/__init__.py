"""The nearest feasible problem of an infeasible QP, and its solution.

All rows in one matrix, C = [G; A], d = [h; b], with shifts r of d, r >= 0 in a row of
G. Stage 1 (`rows`) finds the least ones,

    minimise  1/2 sum w_i r_i^2  (norm 2)  or  sum w_i |r_i|  (norm 1)
    subject to  G x <= h + r_G,  A x = b + r_A,  lb <= x <= ub,

a convex QP or an LP. Its multipliers v of the rows and v_box of the bounds satisfy
C'v + v_box = 0: they prove that no x is feasible without shifts, and they describe all
solutions (`face`). Stage 2 minimises the cost over the x of all solutions.

Rows of infinite weight are not shifted. Bounds of finite weight become rows (`rows`).
The closest feasible problem in norm 2 is that of Chiche and Gilbert, J. Convex Anal. 23
(2016) 425-459; norm 1 is known as elastic programming (Chinneck, Feasibility and
Infeasibility in Optimization, 2008).
"""

from namlcp.qp.closest.face import Face
from namlcp.qp.closest.rows import weights_of
from namlcp.qp.closest.solve import Nearest, StageOne, contradiction, nearest
