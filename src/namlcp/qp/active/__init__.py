"""QPs by a dual active-set method, compiled: a dual Schur-complement method.

`engine` has the method and its memory, `dense` and `sparse` the operators and a whole
solve, `judgement` the point; `proximal` is for a P without a good factor, `null` for
most variables at bounds. `solve` is the door.
"""

from namlcp.qp.active.solve import solve_dense, solve_small
