"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python look between two iterations. A compiled function that may take long by
itself is called by `Deadline.run` and asks back: `is_over`.
"""

import ctypes
import functools
import math
import threading
import time

# The module `signal` converts all values to enumerations, 20 us a solve.
from _signal import SIGINT, default_int_handler, getsignal
from _signal import signal as set_handler
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any, NamedTuple, TypeVar

import numpy as np
from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from namlcp.compiled import part
from namlcp.progress import Report
from namlcp.status import Status

OFTEN = 4_000_000
"""Operations of compiled code between two looks at the deadline, some milliseconds."""

SPEED, PATIENCE = 5e8, 0.25
"""Operations a second that compiled code does at least, and a time [s]: a kernel sure
to end before min(time left, PATIENCE) does not look at the deadline."""

Callback = ctypes.CFUNCTYPE(ctypes.c_int32)
"""What compiled code calls for a look at the deadline."""

F = TypeVar("F", bound=Callable[..., Any])


class Deadline:
    """The end of a solve: a value of time.perf_counter(), or the first Ctrl-C.

    Loops call `reached` between two iterations, so that they stop for the user where
    they stop for the time: with whole arrays and the best point.
    """

    def __init__(self, at: float = math.inf) -> None:
        self.at = at
        self.interrupted = False
        self.error: BaseException | None = None  # raised by a signal's handler

    def reached(self) -> bool:
        """Tell whether to stop."""
        return self.interrupted or time.perf_counter() >= self.at

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Let the first Ctrl-C in the block set `interrupted`; the next one raises.

        Only Python's own handler is replaced, and only where it runs: in the main
        thread.
        """
        ours = threading.current_thread() is threading.main_thread()
        if not ours or getsignal(SIGINT) is not default_int_handler:
            yield
            return
        set_handler(SIGINT, self.interrupt)
        try:
            yield
        finally:
            set_handler(SIGINT, default_int_handler)

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal."""
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True

    def answers(self) -> Iterator[int]:
        """Yield 0, then whether a compiled loop has to stop, 1 or 0, at each look.

        Compiled code drops an exception that its callback raises. A generator resumes
        within its `try`, where a signal's handler is then run; a function would be
        interrupted before it could enter one.
        """
        over = 0
        while True:
            try:
                yield over
                over = int(self.reached())
            except GeneratorExit:
                return
            except BaseException as error:
                self.error, over = error, 1

    def run(self, kernel: Callable[..., Any], work: float, *arguments: Any) -> Any:
        """Return kernel(*arguments, address) of a compiled function.

        The kernel does `work` operations at most and hands `address` to `new_watch`. It
        is 0 where so few operations need no look at the deadline.
        """
        left = self.at - time.perf_counter()
        if work <= SPEED * (left if left < PATIENCE else PATIENCE):
            return kernel(*arguments, 0)
        answers = self.answers()
        next(answers)
        answer = Callback(answers.__next__)
        with self.listening():
            found = kernel(*arguments, ctypes.c_void_p.from_buffer(answer).value)
        if self.error is not None:
            raise self.error
        return found

    def verdict(self, status: Status) -> Status:
        """Return INTERRUPTED where Ctrl-C, not the time, ended the solve.

        Where the solve had ended before it noticed, Ctrl-C raises KeyboardInterrupt as
        everywhere else, so that a loop over small problems can be left.
        """
        if not self.interrupted:
            return status
        if status is Status.TIME_LIMIT:
            return Status.INTERRUPTED
        raise KeyboardInterrupt


NEVER = Deadline()


def silent(kernel: Any) -> None:
    """Announce nothing."""


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


def interruptible(function: F) -> F:
    """Raise KeyboardInterrupt where compiled code made a SystemError of it.

    It does if a signal's handler raises while it hands over a result; there may be a
    chain of such errors.
    """

    @functools.wraps(function)
    def guarded(*arguments: Any, **settings: Any) -> Any:
        try:
            return function(*arguments, **settings)
        except SystemError as error:
            cause: BaseException | None = error
            while isinstance(cause, SystemError):
                cause = cause.__cause__
            if isinstance(cause, KeyboardInterrupt):
                raise KeyboardInterrupt from None
            raise

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
    """Return the same where nothing is compiled."""
    return Callback(address)()


call = interpreted_call if config.DISABLE_JIT else called


@part
def new_watch(address):
    """Return what `is_over` needs: the address, operations since the last look, over.

    Where the address is 0, `is_over` is always False.
    """
    watch = np.zeros(3, dtype=np.int64)
    watch[0] = address
    return watch


@part
def is_over(watch, operations):
    """Tell whether to stop, after `operations` more; once over, always over."""
    if watch[0] == 0:
        return False
    watch[1] += operations
    if watch[2] == 0 and watch[1] >= OFTEN:
        watch[1] = 0
        watch[2] = call(watch[0])
    return watch[2] != 0
