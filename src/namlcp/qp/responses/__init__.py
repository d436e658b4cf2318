"""QPs with the same matrices, one after another, by a dual Schur-complement method.

A solve keeps what depends on the matrices alone: the solution operator of the QP
without inequalities, and the responses to the rows that have been active. The next
solve starts from the active rows of the last solved QP (`active` has the method); what
it returns depends on the data alone, not on the solves before, up to the rounding
errors of degenerate QPs and of those that `free` solves. `solve_once` is for a single
QP (`is_brief`: one that ends so soon that nobody need look at the clock; `Held` keeps
its factors for derivatives, which `solve_held` solves with), `Stack` for a batch. A
class of this room, `DenseResponses` for arrays, `SparseResponses` for sparse matrices,
has

- ``of(qp)``: for the matrices of a QP, None where they are not suited. The arrays are
  not copied, and must not change;
- ``run(vectors, limits)``: solve the QP with these vectors, see `QP.joined`, of the
  right sizes; returns a code and an array of numbers. After the code DONE
  the QP is SOLVED, and `parted` takes the numbers apart: most of a short solve is
  wrapping them. Whatever the code, the active rows of the last solved QP are kept;
- ``answer(code, numbers, qp, limits) -> Answer | None``: the verdict of `run`, judged
  on the data as given. None: another method has to solve this QP, or it has numbers
  that are not allowed;
- ``renew(qp)``: after a change of the matrices' values, sizes as before. The active
  rows are kept as a hint; nothing is computed before a solve that is tried;
- ``are_unsuited``: the last solve found that the matrices are not suited;
- ``suggest(guess)``: start the next solve from the active rows of a `Guess`.

It can be copied and pickled (a copy starts without history), and is for one thread.
`state` (the record), `active` (the loop), `rows`, `matrices` and `judgement` (the
point, measured and refined) know neither how the base problem is solved nor how a
response is made; `dense` does for arrays, `sparse` for sparse matrices, and `run` has
the kernels. `course` is what a solve consists of, whatever the matrices are stored as;
`proximal` where P has no good factor. After a dense QP with most variables at bounds,
`free` solves the next one by a face of few variables instead of many responses.
"""

from namlcp.qp.responses.active import DONE
from namlcp.qp.responses.fresh import (
    MOST_ORDER,
    Solutions,
    Stack,
    Verdict,
    is_brief,
    solve_once,
    solve_unwrapped,
)
from namlcp.qp.responses.judgement import parts_of_result
from namlcp.qp.responses.run import accepts, least_pivot, solve_held
from namlcp.qp.responses.solve import (
    DenseResponses,
    Done,
    Held,
    Responses,
    parted,
    wrapped,
)
from namlcp.qp.responses.sparse_solve import SparseResponses
from namlcp.qp.responses.state import state_at
