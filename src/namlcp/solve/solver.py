"""The public class `Solver`: one QP solved again and again.

The active-set method of `qp/active` is tried first: it keeps what it computes, and
begins with the active constraints of the last solution. What it does not decide goes
the way of `solve_qp`, with the last point that solved the problem and what depends on
the matrices alone (`Memory`). A solution or certificate has been judged on the data as
they are now, so it stands; any other answer is replaced by that of a solve without
memory, which is the one of `solve_qp`.
"""

from math import inf
from time import perf_counter
from typing import Any

import numpy as np
from scipy.sparse import issparse

from namlcp.checks import as_sparse, from_arrays, matrix, real_array, refuse_view
from namlcp.linalg.csc import as_dense
from namlcp.options import DEFAULT_OPTIONS, Options, check_flag
from namlcp.qp.active import solve as active
from namlcp.qp.active.engine import Code
from namlcp.qp.intake import qp_data
from namlcp.qp.judge import Judge, are_own
from namlcp.qp.problem import NO_GUESS, QP, Guess, check_convex, make_guess
from namlcp.qp.route import NO_TRANSFORMS, Memory, is_small, solve_checked, threads_for
from namlcp.results import Public, QPResult, qp_result
from namlcp.status import ENDS, Status

SOLVED = Status.SOLVED
# What a copy shares and a pickle holds: arrays that never change.
STATE = "matrices", "given", "is_own", "vectors", "options", "last"
# Solves that are left to other methods without trying, after 0, 1, 2, ... were tried in
# a row and left to these.
PAUSES = 0, 0, 1, 3, 7, 15


class OtherShape(ValueError):
    """A matrix has another shape or other places of entries than before.

    Examples
    --------
    >>> import numpy as np
    >>> import namlcp
    >>> solver = namlcp.Solver(np.eye(2), np.zeros(2))
    >>> try:
    ...     solver.update(P=np.eye(3))
    ... except namlcp.OtherShape:
    ...     print("make another Solver")
    make another Solver
    """


class Solver(metaclass=Public):
    """A convex QP that is solved again and again, with other vectors or values.

    ``minimise 1/2 x'Px + q'x  subject to  Gx <= h,  Ax = b,  lb <= x <= ub``

    `update` changes any of the arguments, `solve` solves. A solve gives what `solve_qp`
    gives for the same problem, at a fraction of the time: it begins with the active
    constraints of the last solution, and what depends on the matrices alone is not done
    again while they stay.

    Parameters
    ----------
    P, q, G, h, A, b, lb, ub
        The problem, as for `solve_qp`; all are copied. The sizes stay, and so does the
        pattern of sparse matrices.
    **settings
        The fields of `Options`, for all solves.

    Raises
    ------
    ValueError, TypeError, MemoryError
        As `solve_qp`. A P that is not positive semidefinite is refused here.

    Notes
    -----
    Where P is singular a problem may have many solutions; then two solves may return
    different ones, with the same objective. A Solver can be copied and pickled. One
    Solver is for one thread at a time; Solvers in several threads run side by side, as
    compiled code releases Python's lock.

    Examples
    --------
    >>> import numpy as np
    >>> from namlcp import Solver
    >>> solver = Solver(np.eye(2), np.zeros(2), lb=np.zeros(2))
    >>> for step in range(3):
    ...     solver.update(q=np.array([-1.0, step - 1.0]))
    ...     print(solver.solve().x + 0.0)
    [1. 1.]
    [1. 0.]
    [1. 0.]
    """

    PUBLIC = "solve", "update"

    def __init__(
        self,
        P: Any,
        q: Any,
        G: Any = None,
        h: Any = None,
        A: Any = None,
        b: Any = None,
        lb: Any = None,
        ub: Any = None,
        **settings: Any,
    ) -> None:
        self.options = Options.from_names(settings) if settings else DEFAULT_OPTIONS
        given = P, G, A = copied("P", P), copied("G", G), copied("A", A)
        qp = qp_data(P, q, G, h, A, b, lb, ub)
        with threads_for(qp, self.options):
            check_convex(qp.P)
        self.hold_matrices(qp, given)
        self.vectors = qp.joined()  # replaced, never changed: results keep it
        self.last: Any = None  # the last result that is a solution
        self.begin()

    @property
    def qp(self) -> QP:
        """The problem as it is now, checked."""
        return QP.of(self.matrices, self.vectors)

    def hold_matrices(self, qp: QP, given: tuple[Any, ...]) -> None:
        """Take the matrices of a checked QP, `given` in the user's own storage."""
        self.matrices, self.given = (qp.P, qp.G, qp.A), given
        self.is_own = are_own(given, qp)

    def begin(self) -> None:
        """Keep nothing of earlier solves but the last result."""
        qp = self.qp
        self.sizes = tuple(v.size for v in (qp.q, qp.h, qp.b, qp.lb, qp.ub))
        self.memory = Memory(qp.P)
        # What solves, see `qp.active`, None if that is nothing for these matrices;
        # whether it has still to take new ones.
        suits = not qp.is_dense or is_small(qp)
        with threads_for(qp, self.options):
            self.active_set: Any = active.kept_for(qp) if suits else None
        self.is_renewed, self.is_solving = False, False
        # Solves that it has tried in a row and left to others; those that are left to
        # these from now on without trying.
        self.left, self.pause = 0, inf if self.active_set is None else 0.0

    def __getstate__(self) -> dict[str, Any]:
        return {name: vars(self)[name] for name in STATE}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self.begin()

    def update(
        self,
        *,
        q: Any = None,
        h: Any = None,
        b: Any = None,
        lb: Any = None,
        ub: Any = None,
        P: Any = None,
        G: Any = None,
        A: Any = None,
    ) -> None:
        """Change arguments of the problem; what is None stays as it is.

        An infinite entry of h, lb or ub means no constraint, and may become finite in a
        later update. An entry of a sparse matrix may become zero, but those outside the
        first pattern stay zeros.

        Parameters
        ----------
        q, h, b, lb, ub : arrays, optional
            As for `solve_qp`. They are copied.
        P, G, A : arrays or sparse matrices, optional
            The same, with other values. They are copied, and compared first: equal
            ones cost little.

        Raises
        ------
        ValueError, TypeError
            An argument is malformed, of another size or pattern, or P is not positive
            semidefinite. The problem then stays as it was.

        Examples
        --------
        >>> import numpy as np
        >>> from namlcp import Solver
        >>> solver = Solver(np.eye(1), np.array([-4.0]), ub=np.array([3.0]))
        >>> solver.update(P=2.0 * np.eye(1))
        >>> solver.solve().x
        array([2.])
        """
        parts = q, h, b, lb, ub
        vectors = active.updated(self.vectors, parts, self.sizes)
        if vectors is None:
            named = zip(("q", "h", "b", "lb", "ub"), parts, strict=True)
            new = {name: v for name, v in named if v is not None}
            vectors = self.changed(self.qp, new, P, G, A).joined()
        elif not (P is None and G is None and A is None):
            self.changed(QP.of(self.matrices, vectors), {}, P, G, A)
        self.vectors = vectors

    def changed(self, qp: QP, new: dict[str, Any], *matrices: Any) -> QP:
        """Take new matrices, unless None; return the QP with them and new vectors.

        All are checked together: what a huge h_i means depends on G.
        """
        given, kept = dict(zip("PGA", self.given, strict=True)), qp
        for name, M in zip("PGA", matrices, strict=True):
            if M is not None and not is_unchanged(M, given[name]):
                given[name] = copied(name, M)
                new[name] = in_place_of(name, given[name], getattr(kept, name))
        if new:
            qp = qp_data(*kept._replace(**new))
        if given.keys().isdisjoint(new):
            return qp
        if not qp.is_dense:  # P + P' is stored without zeros
            qp = qp._replace(P=within_pattern("P", qp.P, kept.P))
        if "P" in new:
            with threads_for(qp, self.options):
                check_convex(qp.P)
        self.memory.convex = qp.P
        self.hold_matrices(qp, tuple(given.values()))
        self.is_renewed = True
        if self.active_set is not None:
            if self.pause == inf:  # the old ones were not suited
                self.pause = 0.0
            if active.is_slow_anew(self.active_set):  # others are quicker with new ones
                self.pause = max(self.pause, 1.0)
        return qp

    def solve(self, warm_start: Any = None, derivative: bool = False) -> QPResult:
        """Solve the problem as it is now.

        Parameters
        ----------
        warm_start : QPResult or qpsolvers.Solution, optional
            The solution of a similar problem of the same sizes, to begin with instead
            of the last solution.
        derivative : bool
            Let the result of a dense QP have a copy of the Solver's factors, so that
            `backward` need not make them. It is for one thread at a time.

        Returns
        -------
        QPResult
            What `solve_qp` returns.

        Raises
        ------
        ValueError, TypeError
            warm_start is no solution of a problem of these sizes.
        KeyboardInterrupt
            Ctrl-C was pressed. The Solver can be used all the same.
        RuntimeError
            The Solver is solving in another thread.

        Examples
        --------
        >>> import numpy as np
        >>> from namlcp import Solver
        >>> solver = Solver(np.eye(1), np.array([-4.0]), ub=np.array([3.0]))
        >>> solver.solve().z_box
        array([1.])
        """
        start = perf_counter()
        if derivative is not False:
            check_flag("derivative", derivative)
        m, options, result, guess = self.active_set, self.options, None, None
        if warm_start is not None:
            guess = make_guess(self.qp, None, warm_start)
        if self.is_solving:
            raise RuntimeError("a Solver is for one thread at a time: copy it for each")
        self.is_solving = True
        try:
            if guess is not None and m is not None:
                active.suggest(m, guess)
            if self.pause > 0.0 or options.verbose:
                self.pause = max(self.pause - 1.0, 0.0)
            else:
                if self.is_renewed:  # not before: a pause goes on with other values
                    self.is_renewed = False
                    with threads_for(self.qp, options):
                        active.renew(m, self.qp)
                result = active.solve_next(
                    m, QPResult, (self.matrices, self.vectors, self.given),
                    options.settings, start, options.threads,
                )  # fmt: skip
                if result is None or not self.is_own:
                    result = self.judged(start)
                else:
                    self.left = 0
                if derivative and result is not None and result.status is SOLVED:
                    if self.qp.is_dense:
                        result.factors = active.factors_of(m)
            if result is None:
                result = self.solve_in_general(guess, start)
        except BaseException:
            self.begin()  # as some of what is kept may be half done
            raise
        finally:
            self.is_solving = False
        if result.status is SOLVED:
            self.last = result
        return result

    def judged(self, start: float) -> QPResult | None:
        """Return the result of what `active` has tried, None where others are asked."""
        m, qp, options = self.active_set, self.qp, self.options
        self.left = self.left + 1 if m.code == Code.STUCK else 0
        self.pause = PAUSES[min(self.left, len(PAUSES) - 1)] if m.is_ready else inf
        judge = Judge(qp, options.limits(start), self.given)
        answer = active.answer_of(m, judge, NO_TRANSFORMS)
        if answer is None or answer.status not in ENDS:
            return None
        if options.relaxation and answer.status is Status.PRIMAL_INFEASIBLE:
            return None  # the general solve finds the closest point
        return qp_result(answer, (qp, self.given), start, start)

    def solve_in_general(self, guess: Guess | None, start: float) -> QPResult:
        """Return the result of a solve from a guess, the last result, or nothing."""
        qp, options, given = self.qp, self.options, self.given
        if guess is None:
            guess = make_guess(qp, None, self.last)
        answer = solve_checked(qp, options, guess, start, None, self.memory, given)
        if answer.status not in ENDS:
            answer = solve_checked(qp, options, NO_GUESS, start, given=given)
        if self.active_set is not None and answer.status is SOLVED:
            active.suggest(self.active_set, make_guess(qp, None, answer.point))
        return qp_result(answer, (qp, given), start, start)


# ---- matrices with new values in the storage and the pattern of old ones


def copied(name: str, M: Any) -> Any:
    """Return a copy of a user's matrix in its own order, None for None."""
    if M is None or issparse(M):
        return M if M is None else M.copy()
    refuse_view(name, M)
    return np.array(M if type(M) is np.ndarray else real_array(name, M))


def is_unchanged(new: Any, old: Any) -> bool:
    """Tell whether two matrices are stored alike and equal."""
    if getattr(new, "format", "") in ("csc", "csr"):
        return has_pattern_of(new, old) and are_equal(new.data, old.data)
    return type(new) is type(old) is np.ndarray and are_equal(new, old)


def has_pattern_of(new: Any, old: Any) -> bool:
    return (
        type(new) is type(old)
        and new.shape == old.shape
        and are_equal(new.indptr, old.indptr)
        and are_equal(new.indices, old.indices)
    )


def are_equal(v: np.ndarray, w: np.ndarray) -> bool:
    """Return np.array_equal(v, w), of short vectors in a fifth of its time."""
    return v is w or (v.shape == w.shape and np.count_nonzero(v == w) == v.size)


def in_place_of(name: str, value: Any, kept: Any) -> Any:
    """Return a user's matrix checked, as `kept` is stored: dense, or in its pattern."""
    new = matrix(name, value, "csc")
    if new.shape != kept.shape:
        raise OtherShape(
            f"{name} must have shape {kept.shape} as before, got {new.shape}: "
            "make a new Solver for a problem of another size"
        )
    if type(kept) is np.ndarray:
        return new if type(new) is np.ndarray else as_dense(new)
    return within_pattern(name, as_sparse(new), kept)


def within_pattern(name: str, new: Any, kept: Any) -> Any:
    """Return a matrix with the pattern of `kept` and the entries of `new`, both CSC.

    It is `new` itself where the patterns are equal.
    """
    if has_pattern_of(new, kept):
        return new
    wanted, present = (  # row + rows * column of each entry: both ascend
        C.indices + C.shape[0] * np.repeat(np.arange(C.shape[1]), np.diff(C.indptr))
        for C in (kept, new)
    )
    inside = np.isin(present, wanted)
    if new.data[~inside].any():
        raise OtherShape(
            f"{name} must have no entries outside the pattern of the first {name}: "
            "make a new Solver, or store zeros there from the start"
        )
    data = np.zeros(kept.data.size)
    data[np.isin(wanted, present)] = new.data[inside]
    return from_arrays((kept.indptr, kept.indices, data), kept.shape)
