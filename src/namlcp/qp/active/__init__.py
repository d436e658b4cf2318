"""QPs by a dual active-set method, compiled: a dual Schur-complement method.

`engine` has the method, `state` its memory, `dense` and `sparse` the operators; `rows`,
`judgement`, `certificates`, `proximal` (where P has no good factor; `face`, `weight`)
and `null` (most variables at bounds) are parts of it, and `run` is a whole solve.
`solve` is the door from the user's arrays, `once` has the answer.
"""

from namlcp.qp.active.once import solve_dense
from namlcp.qp.active.solve import (
    MOST_ORDER,
    OUTCOMES,
    attach,
    factors_of,
    solve_items,
    solve_small,
    step,
    updated,
)
