"""Every solver by its own workspace: set up once, then update and solve.

`prepared` brings what changes into the solver's own form and is not timed; `step`,
which is, updates and solves; `solution` is the last answer, in qpsolvers' form. The
solvers are told what `harness.qp_solvers` says, and start from their last answer where
they can. A module of a solver is imported where it is used.
"""

from typing import Any, Protocol

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem, Solution

import namlcp
from validation.harness import qp_solvers, qps

Vectors = dict[str, np.ndarray]
INFINITY = 1e30  # what DAQP and PIQP take for infinity


class Workspace(Protocol):
    """A solver and the QP that it was set up with."""

    def __init__(self, problem: Problem, eps: float) -> None:
        """Set up for absolute tolerance eps."""

    def prepared(self, vectors: Vectors) -> Any:
        """Return the arguments of `step` for new values of some of q, h, b, lb, ub."""

    def step(self, arguments: Any) -> None:
        """Update, and solve."""

    def solution(self, problem: Problem) -> Solution:
        """Return the last answer, to a problem with all vectors as they are now."""


def told(solver: str, eps: float) -> dict[str, Any]:
    """Return the settings of a solver, without a time limit."""
    settings = qp_solvers.settings(solver, eps, np.inf)
    return {key: value for key, value in settings.items() if "time_limit" not in key}


def answered(
    problem: Problem, found: bool, x: Any, multipliers: tuple[Any, Any, Any]
) -> Solution:
    """Return a Solution; `multipliers` are y, z and z_box."""
    y, z, z_box = (np.asarray(part) for part in multipliers)
    z_box = z_box if problem.lb is not None or problem.ub is not None else np.empty(0)
    return Solution(
        problem, found=found, x=np.asarray(x).copy(), y=y.copy(), z=z.copy(),
        z_box=z_box.copy(),
    )  # fmt: skip


class Calls:
    """`namlcp.solve_qp`, which starts from its last answer."""

    def __init__(self, problem: Problem, eps: float) -> None:
        self.data = qps.by_name(problem)
        self.options = told("nam", eps)
        self.result = namlcp.solve_qp(**self.data, **self.options)

    def prepared(self, vectors: Vectors) -> Vectors:
        return vectors

    def step(self, vectors: Vectors) -> None:
        self.data.update(vectors)
        self.result = namlcp.solve_qp(
            **self.data, warm_start=self.result, **self.options
        )

    def solution(self, problem: Problem) -> Solution:
        r = self.result
        found = r.status is namlcp.Status.SOLVED
        return answered(problem, found, r.x, (r.y, r.z, r.z_box))


class Kept(Calls):
    """`namlcp.Solver`."""

    def __init__(self, problem: Problem, eps: float) -> None:
        self.solver = namlcp.Solver(*problem.unpack(), **told("nam", eps))
        self.result = self.solver.solve()

    def step(self, vectors: Vectors) -> None:
        self.solver.update(**vectors)
        self.result = self.solver.solve()


class Daqp:
    """DAQP's Model; rows: bounds, G, A."""

    def __init__(self, problem: Problem, eps: float) -> None:
        import daqp

        P, q, G, h, A, b, lb, ub = qps.parts(qps.filled(problem))
        self.vectors = {"q": q, "h": h, "b": b, "lb": lb, "ub": ub}
        rows = np.vstack([C.toarray() if sp.issparse(C) else C for C in (G, A)])
        sense = np.zeros(q.size + h.size + b.size, dtype=np.int32)
        sense[q.size + h.size :] = 5  # equations
        self.model = daqp.Model()
        f, upper, lower = self.prepared({})
        self.model.setup(P, f, rows, upper, lower, sense)
        self.model.settings = told("daqp", eps)
        self.answer = self.model.solve()

    def prepared(self, vectors: Vectors) -> tuple[Any, Any, Any]:
        self.vectors = now = self.vectors | vectors
        if set(vectors) == {"q"}:
            return now["q"], None, None
        upper = np.concatenate((now["ub"], now["h"], now["b"]))
        lower = np.concatenate((now["lb"], np.full(now["h"].size, -INFINITY), now["b"]))
        f = now["q"] if "q" in vectors or not vectors else None
        return (
            f,
            np.clip(upper, -INFINITY, INFINITY),
            np.clip(lower, -INFINITY, INFINITY),
        )

    def step(self, arguments: tuple[Any, Any, Any]) -> None:
        f, upper, lower = arguments
        self.model.update(f=f, bupper=upper, blower=lower)
        self.answer = self.model.solve()

    def solution(self, problem: Problem) -> Solution:
        x, _, flag, info = self.answer
        n, m = problem.q.size, 0 if problem.h is None else problem.h.size
        lam = info["lam"]
        return answered(problem, flag > 0, x, (lam[n + m :], lam[n : n + m], lam[:n]))


class Piqp:
    """PIQP's dense or sparse solver."""

    def __init__(self, problem: Problem, eps: float) -> None:
        import piqp

        P, q, G, h, A, b, lb, ub = qps.parts(problem)
        sparse = sp.issparse(P)
        form = sp.csc_matrix if sparse else np.asfortranarray
        if not sparse:
            G, A = (C.toarray() if sp.issparse(C) else C for C in (G, A))
        self.solver = piqp.SparseSolver() if sparse else piqp.DenseSolver()
        self.solved = piqp.PIQP_SOLVED
        for key, value in told("piqp", eps).items():
            setattr(self.solver.settings, key, value)
        rows = form(A), b, form(G), None, h
        self.solver.setup(form(P), q, *rows, *self.finite(lb, ub))
        self.status = self.solver.solve()

    @staticmethod
    def finite(*sides: np.ndarray) -> list[np.ndarray]:
        return [np.clip(side, -INFINITY, INFINITY) for side in sides]

    def prepared(self, vectors: Vectors) -> Vectors:
        names = {"q": "c", "h": "h_u", "b": "b", "lb": "x_l", "ub": "x_u"}
        return {names[key]: value for key, value in vectors.items()}

    def step(self, arguments: Vectors) -> None:
        self.solver.update(**arguments)
        self.status = self.solver.solve()

    def solution(self, problem: Problem) -> Solution:
        r = self.solver.result
        multipliers = r.y, r.z_u, r.z_bu - r.z_bl
        return answered(problem, self.status == self.solved, r.x, multipliers)


class Proxqp:
    """ProxQP's dense or sparse solver; rows: G, bounds."""

    def __init__(self, problem: Problem, eps: float) -> None:
        from proxsuite import proxqp

        P, q, G, h, A, b, lb, ub = qps.parts(problem)
        n = q.size
        self.vectors = {"q": q, "h": h, "b": b, "lb": lb, "ub": ub}
        self.bounded = problem.lb is not None or problem.ub is not None
        room = proxqp.sparse if sp.issparse(P) else proxqp.dense
        C = sp.vstack((G, sp.eye(n))) if self.bounded else G
        form = sp.csc_matrix
        if not sp.issparse(P):
            A, C = (M.toarray() if sp.issparse(M) else M for M in (A, C))
            form = np.asarray
        self.qp = room.QP(n, b.size, C.shape[0])
        for key, value in told("proxqp", eps).items():
            setattr(self.qp.settings, key, value)
        start = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self.qp.settings.initial_guess = start
        self.solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        arguments = self.prepared(self.vectors)
        sides = arguments["l"], arguments["u"]
        rows = (form(A), b) if b.size else (None, None)
        self.qp.init(form(P), q, *rows, form(C), *sides)
        self.qp.solve()

    def prepared(self, vectors: Vectors) -> Vectors:
        self.vectors = now = self.vectors | vectors
        arguments = {}
        if "q" in vectors:
            arguments["g"] = now["q"]
        if "b" in vectors and now["b"].size:
            arguments["b"] = now["b"]
        if vectors.keys() & {"h", "lb", "ub"}:
            none = np.full(now["h"].size, -np.inf)
            lower, upper = [none], [now["h"]]
            if self.bounded:
                lower, upper = [none, now["lb"]], [now["h"], now["ub"]]
            arguments["l"] = np.maximum(np.concatenate(lower), -1e20)
            arguments["u"] = np.minimum(np.concatenate(upper), 1e20)
        return arguments

    def step(self, arguments: Vectors) -> None:
        self.qp.update(**arguments)
        self.qp.solve()

    def solution(self, problem: Problem) -> Solution:
        r = self.qp.results
        m = self.vectors["h"].size
        return answered(
            problem, r.info.status == self.solved, r.x, (r.y, r.z[:m], r.z[m:])
        )


class Osqp:
    """OSQP; rows: G, A, bounds."""

    def __init__(self, problem: Problem, eps: float) -> None:
        import osqp

        P, q, G, h, A, b, lb, ub = qps.parts(problem)
        self.vectors = {"q": q, "h": h, "b": b, "lb": lb, "ub": ub}
        C = sp.vstack([sp.csc_matrix(M) for M in (G, A, sp.eye(q.size))], format="csc")
        self.solver = osqp.OSQP()
        sides = self.prepared(self.vectors)
        options = told("osqp", eps) | {"max_iter": 100_000}
        P = sp.triu(P, format="csc")
        self.solver.setup(P=P, A=C, **sides, verbose=False, **options)
        self.answer = self.solver.solve(raise_error=False)

    def prepared(self, vectors: Vectors) -> Vectors:
        self.vectors = now = self.vectors | vectors
        arguments = {"q": now["q"]} if "q" in vectors else {}
        if vectors.keys() & {"h", "b", "lb", "ub"}:
            none = np.full(now["h"].size, -np.inf)
            arguments["l"] = np.concatenate((none, now["b"], now["lb"]))
            arguments["u"] = np.concatenate((now["h"], now["b"], now["ub"]))
        return arguments

    def step(self, arguments: Vectors) -> None:
        self.solver.update(**arguments)
        self.answer = self.solver.solve(raise_error=False)

    def solution(self, problem: Problem) -> Solution:
        r = self.answer
        m, p = self.vectors["h"].size, self.vectors["b"].size
        parts = r.y[m : m + p], r.y[:m], r.y[m + p :]
        return answered(problem, r.info.status == "solved", r.x, parts)


WORKSPACES: dict[str, type[Workspace]] = {
    "nam": Kept,
    "nam by calls": Calls,
    "daqp": Daqp,
    "piqp": Piqp,
    "proxqp": Proxqp,
    "osqp": Osqp,
}
"""The solvers by name; "nam" keeps what it can from step to step."""
