"""One QP solved again and again, while its vectors and values change.

The active-set method of `qp/active` is tried first: it keeps what it computes, and
begins with the active constraints of the last solution. What it does not decide goes
the way of `solve_qp`, which can use of the solves before what depends on matrices alone
(transforms, orders, factors: `Memory`) and the last point that solved the problem
(`Guess`). An answer SOLVED has been judged on the data as they are now, so it stands,
however it was found; any other of the general solve is replaced by the answer of a
solve without memory, which is the one of `solve_qp`.
"""

from math import inf
from typing import Any

from scipy.sparse import csc_array

from namlcp.limits import Deadline
from namlcp.options import DEFAULT_OPTIONS, Options
from namlcp.qp.active.engine import Code
from namlcp.qp.active.once import answer_of, is_slow_anew, kept_for, renew
from namlcp.qp.active.solve import solve, suggest, updated
from namlcp.qp.intake import qp_data
from namlcp.qp.judge import Judge, are_own
from namlcp.qp.problem import NO_GUESS, QP, Guess, check_convex, make_guess
from namlcp.qp.route import Memory, is_small, solve_checked
from namlcp.qp.sequences.pattern import (
    copied,
    has_pattern_of,
    in_place_of,
    is_unchanged,
    within_pattern,
)
from namlcp.status import ENDS, Outcome, Status

SOLVED = Status.SOLVED
# What a copy shares and a pickle holds: arrays that never change.
STATE = "matrices", "given", "is_own", "vectors", "options", "last"
# Solves that are left to other methods without trying, after 0, 1, 2, ... were tried in
# a row and left to these.
PAUSES = 0, 0, 1, 3, 7, 15
# Statuses that a solve without a start would not improve on.
SETTLED = (SOLVED, Status.TIME_LIMIT)


class QPSequence:
    """The QP of a `Solver` as it is now, and what is kept from solve to solve."""

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
        self.matrices = qp.P, qp.G, qp.A
        self.given = tuple(  # the QP's own where they are stored alike
            own if type(own) is csc_array and has_pattern_of(M, own) else M
            for M, own in zip(given, self.matrices, strict=True)
        )
        self.is_own = are_own(self.given, qp)

    def begin(self) -> None:
        """Keep nothing of earlier solves but the last result."""
        qp = self.qp
        self.sizes = qp.q.size, qp.h.size, qp.b.size
        self.memory = Memory(qp.P)
        # What solves, see `qp.active`, None if that is nothing for these matrices;
        # whether it has still to take new ones; whether it found `last`.
        self.active_set: Any = kept_for(qp) if not qp.is_dense or is_small(qp) else None
        self.is_renewed = self.is_current = False
        # Solves that it has tried in a row and left to others; those that are left to
        # these from now on without trying.
        self.left, self.pause = 0, 0.0
        self.is_whole = True  # not after an error in a solve

    def __getstate__(self) -> dict[str, Any]:
        return {name: vars(self)[name] for name in STATE}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Keep nothing of another Solver's solves but its last result."""
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
        vectors = updated(self.vectors, self.sizes, q, h, b, lb, ub)
        if vectors is None:
            changes = {"q": q, "h": h, "b": b, "lb": lb, "ub": ub}
            new = {name: v for name, v in changes.items() if v is not None}
            vectors = qp_data(**{**self.qp._asdict(), **new}).joined()
        if not (P is None and G is None and A is None):
            self.take_matrices({"P": P, "G": G, "A": A})
        self.vectors = vectors

    def take_matrices(self, changes: dict[str, Any]) -> None:
        """Check and take those matrices that are new."""
        given, kept = dict(zip("PGA", self.given, strict=True)), self.qp._asdict()
        new = {}
        for name, M in changes.items():
            if M is not None and not is_unchanged(M, given[name]):
                given[name] = copied(name, M)
                new[name] = in_place_of(name, given[name], kept[name])
        if not new:
            return
        qp = qp_data(*self.qp._replace(**new))
        if not qp.is_dense:  # P + P' is stored without zeros
            qp = qp._replace(P=within_pattern(qp.P, kept["P"]))
        if "P" in new:
            check_convex(qp.P)
        self.hold_matrices(qp, tuple(given.values()))
        self.memory.convex = qp.P
        self.is_renewed, self.is_current = True, False
        if self.pause == inf:  # the old ones were not suited
            self.pause = 0.0
        if self.active_set is not None and is_slow_anew(self.active_set):
            self.pause = max(self.pause, 1.0)  # others are quicker with new ones

    def solve_with_care(
        self, guess: Guess | None, start: float, is_tried: bool
    ) -> Outcome:
        """Return the answer of what is kept, of the general solve where that fails.

        That is one from the guess or the last result, then one from nothing.
        """
        self.is_current, answer = False, None
        if guess is not None:
            self.suggest(guess)
        if self.active_set is not None and not self.options.verbose:
            answer = self.solve_by_active_set(start, is_tried)
        if answer is not None:
            return answer
        qp, options, given = self.qp, self.options, self.given
        if guess is None:
            guess = make_guess(qp, None, self.last)
        answer = solve_checked(qp, options, guess, start, None, self.memory, given)
        if answer.status not in SETTLED and answer.closest is None:
            answer = solve_checked(qp, options, NO_GUESS, start, given=given)
        if answer.status is SOLVED:
            self.suggest(make_guess(qp, None, answer.point))
        return answer

    def suggest(self, guess: Guess) -> None:
        """Let the next solve begin with the active rows of a guess."""
        if self.active_set is not None:
            suggest(self.active_set, guess.active)

    def solve_by_active_set(self, start: float, is_tried: bool) -> Outcome | None:
        """Return the answer of what is kept, which may have tried; None if it fails."""
        m, qp, options = self.active_set, self.qp, self.options
        deadline = Deadline(start + options.time_limit)
        if not is_tried:
            if self.pause > 0:
                self.pause -= 1
                return None
            if self.is_renewed:  # not before: a pause goes on with other values
                self.is_renewed = False
                renew(m, qp)
            solve(m, self.vectors, options.settings, deadline.at)
        self.left = self.left + 1 if m.code == Code.STUCK else 0
        self.pause = PAUSES[min(self.left, len(PAUSES) - 1)] if m.is_ready else inf
        limits = options.limits(deadline)
        answer = answer_of(m, Judge(qp, limits, self.given))
        if answer is None or answer.status not in ENDS:
            return None
        if options.relaxation and answer.status is Status.PRIMAL_INFEASIBLE:
            return None  # the general solve finds the closest point
        self.is_current = answer.status is SOLVED
        return answer
