"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python check the deadline between two iterations. A compiled function that may
run long is called by `Deadline.run`, and checks it by a callback: `is_over`. The
callback runs in Python, where Ctrl-C raises KeyboardInterrupt.
"""

import ctypes
import functools
import math
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, TypeVar

from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from namlcp.compiled import part
from namlcp.progress import Report

OFTEN = 4_000_000
"""Operations of compiled code between two checks of the deadline: some milliseconds."""

WATCH_SIZE = 3
"""Numbers of the state of `is_over`."""

Callback = ctypes.CFUNCTYPE(ctypes.c_int32)
"""Type of the function that compiled code calls to check the deadline."""

F = TypeVar("F", bound=Callable[..., Any])


def now() -> float:
    """Return time.perf_counter() [s].

    As it is a function in Python, handlers of signals run when it is called, and a
    thread takes an exception that another one has raised in it.
    """
    return time.perf_counter()


class Deadline:
    """The end of a solve: a value of time.perf_counter().

    Loops call `reached` between two iterations, and return the best point after it.
    """

    def __init__(self, at: float = math.inf) -> None:
        self.at = at

    def reached(self) -> bool:
        """Tell whether to stop."""
        return time.perf_counter() >= self.at

    def answers(self, errors: list[BaseException]) -> Iterator[bool]:
        """Yield whether the compiled loop has to stop, at each check after the first.

        An exception in a callback of compiled code, such as KeyboardInterrupt, is lost,
        so it is kept in `errors`. The callback is the __next__ of this generator, which
        resumes inside its `try`: a function could be interrupted by a signal's handler
        before it entered one.
        """
        try:
            yield False
            while True:
                yield self.reached()
        except GeneratorExit:
            return
        except BaseException as error:
            errors.append(error)
        yield True

    def run(self, kernel: Callable[..., Any], *arguments: Any) -> Any:
        """Return kernel(*arguments, address) of a compiled function.

        The kernel gives `address` to `begin_watch`.
        """
        errors: list[BaseException] = []
        answers = self.answers(errors)
        next(answers)
        answer = Callback(answers.__next__)
        address = ctypes.c_void_p.from_buffer(answer).value
        found = kernel(*arguments, address)
        if errors:
            raise errors.pop()  # kept, it would keep the arguments: it has this frame
        return found


NEVER = Deadline()


def silent(kernel: Any) -> None:
    """Do nothing, in place of `Progress.announce`."""


class Limits(NamedTuple):
    """When a solve ends, and who is told of its iterations.

    eps_abs, eps_rel: tolerances as `Options` and `solve_lcp` define them. max_iter:
    iterations at most; None is the default of the method that runs. report: called
    for every iteration as `Progress.row`, unless None. announce: called with the first
    kernel of a method before that runs, as `Progress.announce`.
    """

    eps_abs: float = 0.0
    eps_rel: float = 0.0
    max_iter: int | None = None
    deadline: Deadline = NEVER
    report: Report = None
    announce: Callable[[Any], None] = silent

    @property
    def tolerances(self) -> tuple[float, float]:
        """The pair (eps_abs, eps_rel)."""
        return self.eps_abs, self.eps_rel


def cause_of(error: SystemError) -> BaseException:
    """Return KeyboardInterrupt if that is the cause of a chain of errors, else error.

    For `interruptible`, and for those who have no time for its wrapper.
    """
    cause: BaseException | None = error
    while isinstance(cause, SystemError):
        cause = cause.__cause__
    return KeyboardInterrupt() if isinstance(cause, KeyboardInterrupt) else error


def interruptible(function: F) -> F:
    """Raise KeyboardInterrupt where compiled code turned it into a SystemError.

    That happens if a signal's handler raises while compiled code returns its result;
    the KeyboardInterrupt may be the cause of a chain of such errors.
    """

    @functools.wraps(function)
    def guarded(*arguments: Any, **settings: Any) -> Any:
        try:
            return function(*arguments, **settings)
        except SystemError as error:
            raise cause_of(error) from None

    return guarded  # type: ignore[return-value]


@intrinsic
def called(typingctx, address):
    """Return the int32 of the C function at `address`, which has no arguments."""

    def codegen(context, builder, signature, arguments):
        function = ir.FunctionType(ir.IntType(32), [])
        pointer = builder.inttoptr(arguments[0], function.as_pointer())
        return builder.call(pointer, [])

    return types.int32(types.int64), codegen


def interpreted_call(address):
    """Return what `called` returns, where nothing is compiled."""
    return Callback(address)()


call = interpreted_call if config.DISABLE_JIT else called


@part
def begin_watch(watch, address):
    """Set the state of `is_over`: (address, operations since the last check, over).

    Where the address is 0, `is_over` is always False.
    """
    watch[0], watch[1], watch[2] = address, 0, 0


@part
def is_over(watch, operations):
    """Count `operations` in `watch`; tell whether to stop. Once True, always True."""
    if watch[0] == 0:
        return False
    watch[1] += operations
    if watch[2] == 0 and watch[1] >= OFTEN:
        watch[1] = 0
        watch[2] = call(watch[0])
    return watch[2] != 0
