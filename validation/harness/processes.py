"""A solver in a child process with a time limit: a hang or a crash is a failure."""

import multiprocessing as mp
import os
import warnings
from collections.abc import Callable
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

from validation.harness.machine import wait_until_quiet
from validation.harness.tables import Row

GRACE = 2.0  # [s] on top of the time limit before a child process is ended
LOADING = 120.0  # [s] to read a problem, warm up and, once, compile
MEMORY = 8 << 30  # bytes of address space of a child process
LATE = {"timeout", "too slow"}  # what a row says that ran into the time limit
OURS = ("nam", "sweep")  # first words of what is ours
READY = "ready"  # the message with which the clock of a request starts


class Job(NamedTuple):
    """What a child process is for. It calls `ready()` when a solve begins."""

    solver: str
    limit: float  # [s] of the solve that is asked for
    data: Any
    ready: Callable[[], None]


Work = Callable[..., Any]
"""work(job, *request) returns the row, or whatever answers the request."""


def failure(status: str) -> Row:
    return {"success": False, "status": " ".join(status.split())[:120]}


def raised(error: Exception) -> Row:
    return {"found": False} | failure(f"{type(error).__name__}: {error}")


def serve(pipe: Connection, work: Work, solver: str, data: Any) -> None:
    """Answer requests, each after its time limit: what the child process does."""
    import resource  # Windows has none, where tests import the other functions

    warnings.simplefilter("ignore")
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # some solvers print unasked
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    if solver == "nam":
        import namlcp  # noqa: F401  (makes it known to qpsolvers)
    for limit, *request in iter(pipe.recv, None):
        job = Job(solver, limit, data, lambda: pipe.send(READY))
        try:
            answer = work(job, *request)
        except Exception as error:
            answer = raised(error)
        pipe.send(answer)


class Bench:
    """A child process with one solver, replaced when it hangs or dies.

    work, a function of a module, is what the child does with a request; limit, the time
    of one solve [s], may be changed between requests; data is what else it needs.
    """

    def __init__(self, work: Work, solver: str, limit: float, data: Any = None) -> None:
        self.work, self.solver, self.limit, self.data = work, solver, limit, data
        self.start()

    def start(self) -> None:
        context = mp.get_context("spawn")
        self.pipe, child_end = context.Pipe()
        arguments = (child_end, self.work, self.solver, self.data)
        self.process: Any = context.Process(target=serve, args=arguments, daemon=True)
        self.process.start()
        child_end.close()

    def stop(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()

    def ask(self, *request: Any) -> Row:
        """Return the answer to a request; a hang or a crash is a failure."""
        wait_until_quiet()
        try:
            self.pipe.send((self.limit, *request))
            answer = self.wait(LOADING)
            if answer == READY:
                answer = self.wait(self.limit + GRACE)
        except (TimeoutError, EOFError, ConnectionError) as error:
            late = isinstance(error, TimeoutError)
            answer = {"found": False} | failure("timeout" if late else "crashed")
            self.stop()
            self.start()
        return answer

    def wait(self, seconds: float) -> Any:
        if not self.pipe.poll(seconds):
            raise TimeoutError
        return self.pipe.recv()
