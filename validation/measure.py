"""Time and judge one solver on one problem, in a child process with a time limit."""

import multiprocessing as mp
import resource
import statistics
import time
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np
import problems
import qpsolvers
from qpsolvers import Problem, Solution
from settings import solver_settings

GRACE = 2.0  # [s] on top of the time limit before a child process is ended
LOADING = 120.0  # [s] to read a problem, warm up and, once, compile
MEMORY = 8 << 30  # bytes of address space of a child process
REPEATS, REPEAT_TIME = 5, 0.5  # repeat until either is reached,
QUICK_TIME = 0.05  # [s] and quick problems at least that long


def median_time(call: Callable[[], Any]) -> tuple[Any, float, float]:
    """Return the first result of a call, the time of that one and the median time [s].

    The first call is not repeated if it took longer than all repeats may; otherwise
    it does not count in the median.
    """
    times: list[float] = []
    first: Any = None
    while True:
        start = time.perf_counter()
        result = call()
        times.append(time.perf_counter() - start)
        if len(times) == 1:
            first = result
            if times[0] >= REPEAT_TIME:
                return first, times[0], times[0]
        spent, repeats = sum(times[1:]), len(times) - 1
        if spent >= (QUICK_TIME if repeats >= REPEATS else REPEAT_TIME):
            return first, times[0], statistics.median(times[1:])


def sign_violation(problem: Problem, solution: Solution) -> float:
    """Return the largest entry of a multiplier with a sign that it must not have.

    z >= 0; z_box <= 0 without an upper bound, >= 0 without a lower one, else free.
    """
    n = problem.q.size
    lb = np.full(n, -np.inf) if problem.lb is None else problem.lb
    ub = np.full(n, np.inf) if problem.ub is None else problem.ub
    z = np.zeros(0) if solution.z is None else np.asarray(solution.z)
    z_box = np.zeros(0) if solution.z_box is None else np.asarray(solution.z_box)
    wrong = [np.zeros(1), -z]
    if z_box.size:
        wrong += [z_box[np.isinf(ub)], -z_box[np.isinf(lb)]]
    return float(np.max(np.concatenate(wrong)))


def judge(problem: Problem, solution: Solution, eps: float) -> dict[str, Any]:
    """Return found, the residuals, success and a status in words."""
    row: dict[str, Any] = {"found": bool(solution.found)}
    if not row["found"] or solution.x is None:
        extras = solution.extras or {}
        said = extras.get("status", getattr(extras.get("info"), "status", ""))
        return row | failure(f"not found {said}".strip())
    row |= {
        "primal_residual": float(solution.primal_residual()),
        "dual_residual": float(solution.dual_residual()),
        "duality_gap": float(solution.duality_gap()),
        "sign_violation": sign_violation(problem, solution),
    }
    errors = list(row.values())[1:]
    row["success"] = all(error <= eps for error in errors)
    row["status"] = "solved" if row["success"] else "inaccurate"
    return row


def failure(status: str) -> dict[str, Any]:
    """Return the row of a failure that has no residuals."""
    return {"success": False, "status": " ".join(status.split())[:120]}


def measure(
    pipe: Connection, solver: str, problem: Problem, eps: float, limit: float
) -> dict[str, Any]:
    """Time a solver on a problem and judge its first answer."""
    settings = solver_settings(solver, eps, limit)

    def call() -> Solution:
        return qpsolvers.solve_problem(problem, solver=solver, **settings)

    for tiny in problems.tiny_problems(problem):
        try:
            qpsolvers.solve_problem(tiny, solver=solver, **settings)
        except Exception:  # what the solver refuses cannot warm it up
            continue
    pipe.send("ready")
    try:
        solution, cold, runtime = median_time(call)
        row = judge(problem, solution, eps)
    except Exception as error:
        return {"found": False} | failure(f"{type(error).__name__}: {error}")
    if cold > limit:
        row |= failure("too slow")
    return row | {"runtime": runtime, "cold": cold}


def serve(pipe: Connection, data: Path, solver: str, limit: float) -> None:
    """Answer requests (set, problem, eps) until None comes: the child process."""
    warnings.simplefilter("ignore")
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if solver == "nam":
        import namlcp  # noqa: F401
    for problem_set, name, eps in iter(pipe.recv, None):
        problem = problems.load(data, problem_set, name)
        pipe.send(measure(pipe, solver, problem, eps, limit))


class Bench:
    """A child process with one solver, replaced when it hangs or dies.

    Parameters
    ----------
    data : Path
        The data folder.
    solver : str
        Keyword in qpsolvers.
    limit : float
        Time limit of one solve [s].
    """

    def __init__(self, data: Path, solver: str, limit: float) -> None:
        self.data, self.solver, self.limit = data, solver, limit
        self.process: Any = None
        self.start()

    def start(self) -> None:
        """Start the child process."""
        context = mp.get_context("spawn")
        self.pipe, child_end = context.Pipe()
        arguments = (child_end, self.data, self.solver, self.limit)
        self.process = context.Process(target=serve, args=arguments, daemon=True)
        self.process.start()
        child_end.close()

    def stop(self) -> None:
        """End the child process, whatever it is doing."""
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def run(self, problem_set: str, name: str, eps: float) -> dict[str, Any]:
        """Return the row of one problem; a hang or a crash is a failure."""
        self.pipe.send((problem_set, name, eps))
        try:
            answer = self.wait(LOADING)
            if answer == "ready":
                answer = self.wait(self.limit + GRACE)
        except TimeoutError:
            answer = failure("timeout") | {"runtime": self.limit, "cold": self.limit}
        except (EOFError, ConnectionError):
            self.process.join()
            answer = failure(f"crashed, exit code {self.process.exitcode}")
        if "found" not in answer:
            self.stop()
            self.start()
        key = {"problem": name, "set": problem_set, "solver": self.solver, "eps": eps}
        return key | {"found": False} | answer

    def wait(self, seconds: float) -> Any:
        """Return the next message of the child process."""
        if not self.pipe.poll(seconds):
            raise TimeoutError
        return self.pipe.recv()


@contextmanager
def bench(data: Path, solver: str, limit: float) -> Iterator[Bench]:
    """Hold a child process with one solver open."""
    child = Bench(data, solver, limit)
    try:
        yield child
    finally:
        child.stop()
