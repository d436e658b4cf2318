"""The kernels: from the last solved QP's face to that of the next one."""

import numpy as np

from namlcp.compiled import floats_at, kernel, longs_at
from namlcp.limits import WATCH_SIZE, begin_watch, is_over
from namlcp.qp.responses.active import DONE, STUCK
from namlcp.qp.responses.course import SUMMED
from namlcp.qp.responses.faces.sides import (
    find_point,
    go_on,
    keep,
    recall,
    set_result,
)
from namlcp.qp.responses.faces.state import face_at
from namlcp.qp.responses.faces.system import factor_face
from namlcp.qp.responses.judgement import is_certain, is_solved
from namlcp.qp.responses.run import FAULTY, UNSUITED, attach_vectors, is_faulty

# Most faces that are tried; another method is quicker if these do not suffice.
MOST_FACES = 12


@kernel
def begin_at(address, x, y, z, active):
    """Let the next solve begin with a point and its active rows, as in `Guess`."""
    m = face_at(address)
    u, side = floats_at(m.kept_u, m.size), longs_at(m.kept_side, m.rows)
    for j in range(m.n):
        u[j] = x[j]
    for i in range(m.p):
        u[m.n + i] = y[i]
    for i in range(m.m):
        u[m.n + m.p + i] = z[i]
    for i in range(m.rows):
        side[i] = active[i]
    for i in range(m.m, m.rows):  # these were the lower bounds
        side[i] = 1 if active[i + m.n] else -active[i]


@kernel(error_model="numpy")
def run_faces(address, vectors, out, clock):
    """Solve the QP with these vectors; clock: see `Deadline.run`.

    Returns DONE or SUMMED, see `course`, with the result in `out`, or why there is
    none: codes of `active` and `run`. The last solved point is kept then.
    """
    m = face_at(address)
    attach_vectors(m, vectors, out)
    if not m.is_ready:
        return UNSUITED
    if is_faulty(m):
        return FAULTY
    watch = np.empty(WATCH_SIZE, dtype=np.int64)
    begin_watch(watch, clock)
    recall(m)
    m.pivots = -1
    while m.pivots + 1 < min(MOST_FACES, m.max_iter):
        m.pivots += 1
        if not factor_face(m):
            return STUCK
        find_point(m)
        if not go_on(m):
            set_result(m)
            if not is_solved(m):
                return STUCK
            keep(m)
            return DONE if is_certain(m) else SUMMED
        if is_over(watch, m.face_work):
            return STUCK
    return STUCK
