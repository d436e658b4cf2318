"""Whether the symmetric matrix of a solved box LCP is positive semidefinite.

The factorisations of the solve show it of A_FF, F the free unknowns of each. As A falls
into diagonal blocks without common entries, only those that have a bounded unknown are
left to be factored.
"""

from namlcp.compiled import floats, ints, part
from namlcp.lcp.pivoting.free_system import analyse, free_order, refactor
from namlcp.lcp.pivoting.state import matrix_of
from namlcp.linalg.definite import PSD_SLACK


@part
def has_unit_diagonal(m):
    """Tell whether all a_ii > 0, which are 1 after scaling."""
    has_unit = ints(m.has_unit, m.n)
    for i in range(m.n):
        if not has_unit[i]:
            return False
    return True


@part
def is_definite(m, is_known):
    """Tell whether A + `PSD_SLACK` I is positive definite; False where an a_ii <= 0.

    is_known: whether that is known of A_FF, F the free unknowns.
    """
    if not has_unit_diagonal(m):
        return False
    state, shift = ints(m.state, m.n), floats(m.shift, m.n)
    if is_known and not m.is_dense:
        free_blocks_of_bounded(m)
    else:
        for i in range(m.n):
            state[i] = 0
    for i in range(m.n):
        shift[i] = PSD_SLACK
    factor = analyse(m, free_order(m, state))
    return refactor(m, shift, factor)


@part
def free_blocks_of_bounded(m):
    """Free each diagonal block of A that has a bounded unknown; bound all the others.

    Contacts of separate bodies make many blocks, few of which have one.
    """
    state, queue = ints(m.state, m.n), ints(m.goal, m.n)
    _, indptr, indices, _ = matrix_of(m, m.scaled)
    count, done = 0, 0
    for i in range(m.n):
        if state[i] != 0:
            queue[count] = i
            count += 1
        state[i] = 1 if state[i] == 0 else 0
    while done < count:
        i = queue[done]
        done += 1
        for p in range(indptr[i], indptr[i + 1]):
            j = indices[p]
            if state[j] != 0:
                state[j] = 0
                queue[count] = j
                count += 1
