"""QPs with the same matrices, one after another, by the active-set method."""

from typing import Any

import numpy as np

from namlcp.limits import Limits
from namlcp.qp.active import solve
from namlcp.qp.active.null import NullSpace
from namlcp.qp.active.once import answer_of
from namlcp.qp.active.sparse import active_set_of
from namlcp.qp.active.state import Code
from namlcp.qp.answer import Answer
from namlcp.qp.guess import Guess
from namlcp.qp.problem import QP
from namlcp.settings import Settings

# Solves that are left to other methods without trying, after 1, 2, ... were tried in a
# row and left to these.
PAUSES = 0, 1, 3, 7, 15


class Kept:
    """What is kept from one QP to the next, and when it is not worth trying.

    It holds the arrays of its matrices, which must not change, and is for one thread.

    Attributes
    ----------
    active_set : NullSpace or SparseActiveSet
        What solves, see `steps`.
    """

    def __init__(self, qp: QP) -> None:
        """Take the matrices."""
        self.left = self.pause = 0
        self.renewed: QP | None = None  # with matrices that are still to be taken
        if qp.is_dense:
            self.active_set: Any = NullSpace()
            solve.attach(self.active_set, qp.P, qp.G, qp.A, False)
        else:
            self.active_set = active_set_of(qp)

    @property
    def are_unsuited(self) -> bool:
        """Whether the last solve found that the matrices are not suited."""
        return not self.active_set.is_ready

    @property
    def is_slow_anew(self) -> bool:
        """Whether other methods are quicker with other matrices."""
        return getattr(self.active_set, "is_slow_anew", False)

    def renew(self, qp: QP) -> None:
        """Let the next solve that is tried take other values of the matrices.

        The active rows of the last solved QP are tried first there, and a pause goes
        on: other values seldom make a solve much easier.
        """
        self.renewed = qp

    def take_renewed(self, qp: QP) -> None:
        """Take other matrices of the same sizes; the active rows become a hint."""
        m, self.renewed, self.pause = self.active_set, None, 0
        hints = max(m.kept_k, m.hints)
        if qp.is_dense:
            solve.attach(m, qp.P, qp.G, qp.A, False)
        else:
            m.attach(qp.P, qp.G, qp.A)
        m.hints = hints  # the numbers of the rows are still in memory

    def suggest(self, guess: Guess) -> None:
        """Let the next solve begin with the active rows of a guess."""
        solve.suggest(self.active_set, guess.active)

    def solve(self, vectors: np.ndarray, settings: Settings, until: float) -> bool:
        """Try to solve the QP with these vectors, see `QP.joined`; False in a pause."""
        if self.pause > 0:
            self.pause -= 1
            return False
        if self.renewed is not None:
            self.take_renewed(self.renewed)
        solve.solve(self.active_set, vectors, settings, until)
        return True

    def count(self) -> None:
        """Note whether the last solve was left to others, for the pauses."""
        self.left = self.left + 1 if self.active_set.code == Code.STUCK else 0
        self.pause = PAUSES[min(self.left, len(PAUSES)) - 1] if self.left else 0

    def answer(self, qp: QP, limits: Limits) -> Answer | None:
        """Return the answer after a `solve`; None if another method has to find it."""
        self.count()
        return answer_of(self.active_set, qp, limits)
