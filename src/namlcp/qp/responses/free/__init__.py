"""The dual active-set method for dense QPs with most variables at bounds.

It takes the same steps as `active` does with responses, and shares its rules, its
tolerances and the judgement of the point, but what it computes with is the face of the
active rows: the variables F not at bounds (B: all others) and the *held* rows C x = d,
which are the equations and the active rows of G. The multipliers r of these and x_F
solve

    [P_FF  C_F'] [x_F]   [-q_F - P_FB x_B]
    [C_F   0   ] [ r ] = [d - C_B x_B    ]

by L L' = P_FF, T = C_F L'^-1 and R R' = T T'; the multipliers of the active bounds are
minus the gradient. An entering row c changes x_F by -t z and r by -t v, where z and v
solve the same system for (c_F, 0); the rest of the row orthogonal to the active ones is
c_F'z, and the multipliers of bounds change by -t (c - P z - C'v)_B. So a step costs
n nf operations instead of n k for k active rows, and bounds cost nothing: this pays
where nf and the held rows are fewer than k (`are_most_at_bounds`), for nf up to 2/3 n.

A variable that becomes free is appended to L; one that is fixed is removed by Givens
rotations. T and R are computed anew, as few rows are held where most variables are at
bounds. `face` has these factors, `steps` the method, `run` the kernel.
"""

from namlcp.qp.responses.free.run import run_free
from namlcp.qp.responses.free.steps import MOST_WORK, WIDE
