"""Time and judge one solver on one problem, in a child process with a time limit."""

import multiprocessing as mp
import os
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
from qpsolvers import Problem, Solution

import problems
from settings import solve, solver_settings

GRACE = 2.0  # [s] on top of the time limit before a child process is ended
LOADING = 120.0  # [s] to read a problem, warm up and, once, compile
MEMORY = 8 << 30  # bytes of address space of a child process
SLOW = 2.0  # [s] a first call that takes longer is not repeated
REPEATS, REPEAT_TIME = 5, 0.5  # calls, [s]: repeat until either is reached,
QUICK_TIME = 0.05  # [s] and quick calls at least that long


def median_time(
    call: Callable[[], Any], clock: Callable[[], float] = time.perf_counter
) -> tuple[Any, float, float]:
    """Return the first result of a call, its time and the median time of the others.

    The first call stands for the median where it is too slow to be repeated.
    """
    start = clock()
    first = call()
    cold = clock() - start
    times: list[float] = []
    while cold < SLOW and sum(times) < REPEAT_TIME:
        start = clock()
        call()
        times.append(clock() - start)
        if len(times) >= REPEATS and sum(times) >= QUICK_TIME:
            break
    return first, cold, statistics.median(times or [cold])


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
    """Return found, the residuals, success and a status in words.

    Our own solver also says how many iterations it took and in which form.
    """
    extras = solution.extras or {}
    row: dict[str, Any] = {"found": bool(solution.found)}
    row |= {key: extras[key] for key in ("iterations", "form") if key in extras}
    if not row["found"] or solution.x is None:
        said = extras.get("status", getattr(extras.get("info"), "status", ""))
        return row | failure(f"not found {said}".strip())
    errors = {
        "primal_residual": float(solution.primal_residual()),
        "dual_residual": float(solution.dual_residual()),
        "duality_gap": float(solution.duality_gap()),
        "sign_violation": sign_violation(problem, solution),
    }
    row |= errors
    row["success"] = all(error <= eps for error in errors.values())
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
        return solve(problem, solver, **settings)

    for tiny in problems.tiny_problems(problem):
        try:
            solve(tiny, solver, **settings)
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


def silence() -> None:
    """Discard the standard output of this process: some solvers print unasked."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def serve(
    pipe: Connection,
    data: Path,
    solver: str,
    limit: float,
    load: Callable[[Path, str, str], Problem] = problems.load,
) -> None:
    """Answer requests (set, problem, eps) until None comes: the child process.

    load(data, set, name) returns a problem.
    """
    warnings.simplefilter("ignore")
    silence()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if solver == "nam":
        import namlcp  # noqa: F401
    for problem_set, name, eps in iter(pipe.recv, None):
        problem = load(data, problem_set, name)
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

    work = staticmethod(serve)  # what the child process does

    def __init__(self, data: Path, solver: str, limit: float) -> None:
        self.data, self.solver, self.limit = data, solver, limit
        self.start()

    def start(self) -> None:
        """Start the child process."""
        context = mp.get_context("spawn")
        self.pipe, child_end = context.Pipe()
        arguments = (child_end, self.data, self.solver, self.limit)
        process = context.Process(target=self.work, args=arguments, daemon=True)
        self.process: Any = process
        self.process.start()
        child_end.close()

    def stop(self) -> None:
        """End the child process, whatever it is doing."""
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def run(self, problem_set: str, name: str, eps: float) -> dict[str, Any]:
        """Return the row of one problem."""
        key = {"problem": name, "set": problem_set, "solver": self.solver, "eps": eps}
        return key | self.ask((problem_set, name, eps))

    def ask(self, request: Any) -> dict[str, Any]:
        """Return the answer to a request; a hang or a crash is a failure."""
        try:
            self.pipe.send(request)
            answer = self.wait(LOADING)
            if answer == "ready":
                answer = self.wait(self.limit + GRACE)
        except TimeoutError:
            answer = {"found": False} | failure("timeout")
            self.restart()
        except (EOFError, ConnectionError):
            answer = {"found": False} | failure("crashed")
            self.restart()
        return answer

    def restart(self) -> None:
        """Replace the child process."""
        self.stop()
        self.start()

    def wait(self, seconds: float) -> Any:
        """Return the next message of the child process."""
        if not self.pipe.poll(seconds):
            raise TimeoutError
        return self.pipe.recv()


@contextmanager
def bench(
    data: Path, solver: str, limit: float, kind: type[Bench] = Bench
) -> Iterator[Bench]:
    """Hold a child process with one solver open.

    A subclass has its problems from elsewhere: work = partial(serve, load=...).
    """
    child = kind(data, solver, limit)
    try:
        yield child
    finally:
        child.stop()
