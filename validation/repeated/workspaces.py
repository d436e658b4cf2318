"""Every solver by its own workspace: set up once, then update and solve.

`prepared` brings what changes into the solver's own form and is not timed; `step`,
which is, updates and solves from the last answer; `solution` is the answer, in
qpsolvers' form. The solvers are told what `harness.qp_solvers` says.
"""

from typing import Any

import numpy as np
import scipy.sparse as sp
from qpsolvers import Problem, Solution

import namlcp
from validation.harness import qp_solvers, qps

Vectors = dict[str, np.ndarray]
INFINITY = 1e30  # what DAQP and PIQP take for infinity


def told(solver: str, eps: float) -> dict[str, Any]:
    settings = qp_solvers.settings(solver, eps, np.inf)
    settings.pop("time_limit", None)
    return settings


def answered(problem: Problem, found: bool, x: Any, multipliers: Any) -> Solution:
    x, y, z, z_box = (np.array(part) for part in (x, *multipliers))
    z_box = z_box if problem.lb is not None or problem.ub is not None else np.empty(0)
    return Solution(problem, found=found, x=x, y=y, z=z, z_box=z_box)


class Workspace:
    """A `solver` that updates and solves; `answer` is what its `solve` returns."""

    solver: Any

    def prepared(self, vectors: Vectors) -> Vectors:
        return vectors

    def step(self, arguments: Vectors) -> None:
        self.solver.update(**arguments)
        self.answer = self.solver.solve()


class Kept(Workspace):
    """`namlcp.Solver`."""

    def __init__(self, problem: Problem, eps: float) -> None:
        self.solver = namlcp.Solver(*problem.unpack(), **told("nam", eps))
        self.answer = self.solver.solve()

    def solution(self, problem: Problem) -> Solution:
        r = self.answer
        found = r.status is namlcp.Status.SOLVED
        return answered(problem, found, r.x, (r.y, r.z, r.z_box))


class Calls(Kept):
    """`namlcp.solve_qp`, which starts from its last answer."""

    def __init__(self, problem: Problem, eps: float) -> None:
        self.data, self.options = qps.by_name(problem), told("nam", eps)
        self.answer = namlcp.solve_qp(**self.data, **self.options)

    def step(self, arguments: Vectors) -> None:
        self.data.update(arguments)
        given = self.data | self.options
        self.answer = namlcp.solve_qp(**given, warm_start=self.answer)


class Piqp(Workspace):
    """PIQP's dense or sparse solver."""

    def __init__(self, problem: Problem, eps: float) -> None:
        import piqp

        P, q, G, h, A, b, lb, ub = qps.parts(problem)
        sparse = sp.issparse(P)
        form = sp.csc_matrix if sparse else lambda M: np.asfortranarray(qps.dense(M))
        self.solver = piqp.SparseSolver() if sparse else piqp.DenseSolver()
        self.solved = piqp.PIQP_SOLVED
        for key, value in told("piqp", eps).items():
            setattr(self.solver.settings, key, value)
        bounds = (np.clip(side, -INFINITY, INFINITY) for side in (lb, ub))
        self.solver.setup(form(P), q, form(A), b, form(G), None, h, *bounds)
        self.answer = self.solver.solve()

    def prepared(self, vectors: Vectors) -> Vectors:
        names = {"q": "c", "h": "h_u", "b": "b", "lb": "x_l", "ub": "x_u"}
        return {names[key]: value for key, value in vectors.items()}

    def solution(self, problem: Problem) -> Solution:
        r = self.solver.result
        multipliers = r.y, r.z_u, r.z_bu - r.z_bl
        return answered(problem, self.answer == self.solved, r.x, multipliers)


class Stacked(Workspace):
    """A solver of rows lower <= C x <= upper: those of G, of A, and bounds.

    `order` has the parts that are rows, by their vectors; `names` are those of q, lower
    and upper in an update.
    """

    order: tuple[str, ...] = ("h", "b", "box")
    names = "q", "l", "u"
    infinity = np.inf

    def __init__(self, problem: Problem, eps: float) -> None:
        P, q, G, h, A, b, lb, ub = qps.parts(problem)
        self.now = {"q": q, "h": h, "b": b, "lb": lb, "ub": ub}
        if problem.lb is None and problem.ub is None and self.names[0] == "g":
            self.order = ("h",)
        rows = {"h": G, "b": A, "box": sp.eye(q.size)}
        C = sp.vstack([sp.csc_matrix(rows[part]) for part in self.order], format="csc")
        self.setup(P, A, C, self.prepared(self.now), eps)

    def sides(self, part: str) -> tuple[np.ndarray, np.ndarray]:
        now = self.now
        if part == "h":
            return np.full(now["h"].size, -np.inf), now["h"]
        return (now["b"], now["b"]) if part == "b" else (now["lb"], now["ub"])

    def prepared(self, vectors: Vectors) -> Vectors:
        self.now = self.now | vectors
        q, l, u = self.names
        arguments = {q: vectors["q"]} if "q" in vectors else {}
        changed = vectors.keys() - {"q"}
        if "b" in changed and "b" not in self.order:
            changed -= {"b"}
            arguments |= {"b": vectors["b"]} if vectors["b"].size else {}
        if changed:
            lower, upper = zip(*map(self.sides, self.order), strict=True)
            arguments[l] = np.maximum(np.concatenate(lower), -self.infinity)
            arguments[u] = np.minimum(np.concatenate(upper), self.infinity)
        return arguments

    def answered(self, problem: Problem, found: bool, x: Any, v: Any, y: Any) -> Any:
        sizes = [self.sides(part)[0].size for part in self.order]
        parts = np.split(np.asarray(v), np.cumsum(sizes)[:-1])
        named = {"b": y, "box": np.zeros(0)} | dict(zip(self.order, parts, strict=True))
        return answered(problem, found, x, (named["b"], named["h"], named["box"]))


class Daqp(Stacked):
    """DAQP's Model."""

    order = ("box", "h", "b")
    names = "f", "blower", "bupper"
    infinity = INFINITY

    def setup(self, P: Any, A: Any, C: Any, now: Vectors, eps: float) -> None:
        import daqp

        rows = C.toarray()[P.shape[0] :]  # the bounds are not among them
        sense = np.zeros(C.shape[0], dtype=np.int32)
        sense[C.shape[0] - A.shape[0] :] = 5  # equations
        self.solver = daqp.Model()
        sides = now["bupper"], now["blower"]
        self.solver.setup(qps.dense(P), now["f"], rows, *sides, sense)
        self.solver.settings = told("daqp", eps)
        self.answer = self.solver.solve()

    def solution(self, problem: Problem) -> Solution:
        x, _, flag, info = self.answer
        return self.answered(problem, flag > 0, x, info["lam"], None)


class Proxqp(Stacked):
    """ProxQP's dense or sparse solver; equations are no rows."""

    order = ("h", "box")
    names = "g", "l", "u"
    infinity = 1e20

    def setup(self, P: Any, A: Any, C: Any, now: Vectors, eps: float) -> None:
        from proxsuite import proxqp

        room = proxqp.sparse if sp.issparse(P) else proxqp.dense
        form = sp.csc_matrix if sp.issparse(P) else qps.dense
        self.solver = room.QP(P.shape[0], A.shape[0], C.shape[0])
        for key, value in told("proxqp", eps).items():
            setattr(self.solver.settings, key, value)
        start = proxqp.InitialGuess.WARM_START_WITH_PREVIOUS_RESULT
        self.solver.settings.initial_guess = start
        self.solved = proxqp.QPSolverOutput.PROXQP_SOLVED
        equations = (form(A), now["b"]) if A.shape[0] else (None, None)
        self.solver.init(form(P), now["g"], *equations, form(C), now["l"], now["u"])
        self.solver.solve()

    def solution(self, problem: Problem) -> Solution:
        r = self.solver.results
        return self.answered(problem, r.info.status == self.solved, r.x, r.z, r.y)


class Osqp(Stacked):
    """OSQP."""

    def setup(self, P: Any, A: Any, C: Any, now: Vectors, eps: float) -> None:
        import osqp

        self.solver = osqp.OSQP()
        options = told("osqp", eps) | {"max_iter": 100_000, "verbose": False}
        P = sp.triu(sp.csc_matrix(P), format="csc")
        self.solver.setup(P=P, A=C, **now, **options)
        self.answer = self.solver.solve(raise_error=False)

    def step(self, arguments: Vectors) -> None:
        self.solver.update(**arguments)
        self.answer = self.solver.solve(raise_error=False)

    def solution(self, problem: Problem) -> Solution:
        r = self.answer
        return self.answered(problem, r.info.status == "solved", r.x, r.y, None)


WORKSPACES: dict[str, Any] = {"nam": Kept, "nam by calls": Calls}
WORKSPACES |= {"daqp": Daqp, "piqp": Piqp, "proxqp": Proxqp, "osqp": Osqp}
"""The solvers by name; "nam" keeps what it can from step to step."""
