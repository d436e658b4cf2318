"""The ways by which a QP is solved: calls that a user can make, with one signature.

``way(qp, **options)`` takes the fields of `Options` and returns what has the attributes
of a `QPResult`. Where one method fails, `solve_qp` takes the next, and is right all the
same. Hence the ways of the `path` and of the active set, which go to the doors of these
two engines; the latter leaves some QPs to others and returns None.
"""

from time import perf_counter
from types import SimpleNamespace

import numpy as np
import qpsolvers
from problems_qp import NO_GUESS, Options, dense, solve_sparse, sparse

from namlcp import Solver, Status, solve_batch, solve_qp
from namlcp.qp.active.solve import answer_of, kept_for, solve
from namlcp.qp.intake import qp_data
from namlcp.qp.judge import Judge
from namlcp.qp.problem import make_guess
from namlcp.qp.route import NO_TRANSFORMS

INF = np.inf


def nonsense(qp):
    """A start that is no solution: multipliers at all rows, and of both signs."""
    wave = np.cos(np.arange(qp.q.size))
    y, z = np.ones(qp.b.size), np.ones(qp.h.size)
    return SimpleNamespace(x=10.0 * wave, y=y, z=z, z_box=wave)


def by_warm_start(qp, **settings):
    first = solve_qp(*sparse(qp), **settings)
    return solve_qp(*sparse(qp), warm_start=first, **settings)


def by_solver(qp, **settings):
    """After steps with other vectors, one of which has no side."""
    solver = Solver(*qp._replace(q=qp.q + 1.0), **settings)
    solver.solve()
    none = np.full(qp.q.size, INF)
    solver.update(q=qp.q - 1.0, h=np.full(qp.h.size, INF), lb=-none, ub=none)
    solver.solve()
    solver.update(q=qp.q, h=qp.h, lb=qp.lb, ub=qp.ub)
    solver.solve()
    return solver.solve()


def by_renewed_solver(qp, **settings):
    """After a step with other matrices, of the same pattern."""
    other = {k: getattr(qp, k) * 2.0 for k in "PGA"}
    solver = Solver(*qp._replace(**other), **settings)
    solver.solve()
    solver.update(**{k: getattr(qp, k) for k in "PGA"})
    return solver.solve()


def by_batch(qp, **settings):
    """Between two others that have all rows and bounds in common with it."""
    stacked = {k: np.array([v, v, v]) for k, v in dense(qp)._asdict().items()}
    stacked["q"][0] += 1.0
    stacked["q"][2] = 0.0
    found = solve_batch(**stacked, **settings)[1]
    if found.status is Status.INVALID:
        raise ValueError(found.message)
    return found


def by_qpsolvers(qp, **settings):
    """All that the host is told, as a result."""
    problem = qpsolvers.Problem(*qp)
    try:
        answer = qpsolvers.solve_problem(problem, solver="nam", **settings)
    except qpsolvers.exceptions.ProblemError as error:
        raise ValueError(str(error)) from None
    nan = {name: np.full(v.size, np.nan) for name, v in
           (("x", qp.q), ("y", qp.b), ("z", qp.h), ("z_box", qp.q))}  # fmt: skip
    status, message = Status(answer.extras["status"]), answer.extras["message"]
    message = message.replace(status.explanation, "")
    assert answer.found == (status is Status.SOLVED)
    point = {k: getattr(answer, k) for k in nan if getattr(answer, k) is not None}
    point |= answer.extras.get("certificate", {})
    return SimpleNamespace(status=status, message=message, **(nan | point))


def by_path(qp, start=None, **settings):
    guess = NO_GUESS if start is None else make_guess(qp, None, start)
    return solve_sparse(sparse(qp), Options(**settings).limits(), guess)


def by_active_set(qp, **settings):
    """After a step with another cost; None where it is left to other methods."""
    qp, options, found = qp_data(*qp), Options(**settings), None
    kept = kept_for(qp)
    for step in () if kept is None else (qp._replace(q=qp.q + 1.0), qp):
        until = perf_counter() + options.time_limit
        solve(kept, step.joined(), options.settings, until)
        found = answer_of(kept, Judge(step, options.limits()), NO_TRANSFORMS)
    if found is not None:
        fields = found._asdict() | found.point._asdict()
        found = SimpleNamespace(**fields)
    return found


WAYS = {
    "dense": lambda qp, **s: solve_qp(*dense(qp), **s),
    "sparse": lambda qp, **s: solve_qp(*sparse(qp), **s),
    "general": lambda qp, **s: solve_qp(*sparse(qp), history=True, **s),
    "path": by_path,
    "warm start": by_warm_start,
    "wrong start": lambda qp, **s: solve_qp(*dense(qp), warm_start=nonsense(qp), **s),
    "wrong start of the path": lambda qp, **s: by_path(qp, nonsense(qp), **s),
    "Solver": lambda qp, **s: by_solver(dense(qp), **s),
    "Solver, sparse": lambda qp, **s: by_solver(sparse(qp), **s),
    "Solver, renewed": lambda qp, **s: by_renewed_solver(dense(qp), **s),
    "Solver, renewed, sparse": lambda qp, **s: by_renewed_solver(sparse(qp), **s),
    "active set": lambda qp, **s: by_active_set(dense(qp), **s),
    "sparse active set": lambda qp, **s: by_active_set(sparse(qp), **s),
    "batch": by_batch,
    "qpsolvers": lambda qp, **s: by_qpsolvers(dense(qp), **s),
}
PATHS = {"path", "wrong start of the path"}
DENSE = {"dense", "wrong start", "Solver", "Solver, renewed", "batch", "qpsolvers"}
PARTIAL = {"active set", "sparse active set"}  # None: left to other methods
