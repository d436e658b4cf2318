"""The public class `Solver`: one QP solved again and again."""

from time import perf_counter
from typing import Any

from namlcp.options import check_flag
from namlcp.qp import QPSequence, factors_of, make_guess, step
from namlcp.results import Public, QPResult, qp_result
from namlcp.status import Status

SOLVED = Status.SOLVED


class Solver(QPSequence, metaclass=Public):
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
        try:
            if not self.is_whole:
                self.begin()
            result, is_tried = None, False
            if self.is_current and self.is_own and warm_start is None:
                is_tried = True
                problem = self.matrices, self.vectors, self.given
                result = step(
                    self.active_set, QPResult, self.vectors, problem,
                    self.options.settings, start,
                )  # fmt: skip
            if result is None:
                qp, guess = self.qp, None
                if warm_start is not None:
                    guess = make_guess(qp, None, warm_start)
                answer = self.solve_with_care(guess, start, is_tried)
                result = qp_result(answer, (qp, self.given), start, start)
            elif not derivative:
                self.last = result
                return result
        except BaseException:
            self.is_whole = False  # so the next solve begins anew
            raise
        if result.status is SOLVED:
            self.last = result
            if derivative and self.is_current and self.qp.is_dense:
                result.factors = factors_of(self.active_set)
        return result
