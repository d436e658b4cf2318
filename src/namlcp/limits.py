"""When a solve ends: tolerances, a count, a time limit or Ctrl-C.

Loops in Python check the deadline between two iterations. A compiled function that may
run long is called by `Deadline.run`, and checks it by a callback: `is_over`.
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

from llvmlite import ir
from numba import config, types
from numba.extending import intrinsic

from namlcp.compiled import part
from namlcp.progress import Report
from namlcp.status import Status

OFTEN = 4_000_000
"""Operations of compiled code between two checks of the deadline: some milliseconds."""

SPEED, UNCHECKED_TIME = 5e8, 0.25
"""Least speed of compiled code [operations/s], and a time [s]. A kernel that ends at
this speed within min(time left, UNCHECKED_TIME) does not check the deadline."""

WATCH_SIZE = 3
"""Numbers of the state of `is_over`."""

Callback = ctypes.CFUNCTYPE(ctypes.c_int32)
"""Type of the function that compiled code calls to check the deadline."""

F = TypeVar("F", bound=Callable[..., Any])


class Deadline:
    """The end of a solve: a value of time.perf_counter(), or the first Ctrl-C.

    Loops call `reached` between two iterations. After Ctrl-C they stop as after the
    time limit, with complete arrays and the best point.
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
        """Let the first Ctrl-C in the block set `interrupted`; the next one raises."""
        listens = self.listen()
        try:
            yield
        finally:
            if listens:
                set_handler(SIGINT, default_int_handler)

    def listen(self) -> bool:
        """Begin to listen, see `listening`; tell whether a handler was replaced.

        Only Python's default handler is replaced, and only in the main thread.
        """
        ours = threading.current_thread() is threading.main_thread()
        if not ours or getsignal(SIGINT) is not default_int_handler:
            return False
        set_handler(SIGINT, self.interrupt)
        return True

    def interrupt(self, number: int, frame: FrameType | None) -> None:
        """Handle SIGINT (the interface of `signal.signal`)."""
        if self.interrupted:
            raise KeyboardInterrupt
        self.interrupted = True

    def answers(self) -> Iterator[int]:
        """Yield 0, then at each check 1 if the compiled loop has to stop, else 0.

        An exception in a callback of compiled code is lost, so it is kept in `error`.
        The callback is the __next__ of this generator, which resumes inside its `try`:
        a function could be interrupted by a signal's handler before it entered one.
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

    def leaves_time_for(self, work: float) -> bool:
        """Tell whether a kernel of so many operations needs not check the deadline."""
        time_left = UNCHECKED_TIME
        if self.at < math.inf:
            time_left = min(self.at - time.perf_counter(), UNCHECKED_TIME)
        return work <= SPEED * time_left

    def run(self, kernel: Callable[..., Any], work: float, *arguments: Any) -> Any:
        """Return kernel(*arguments, address) of a compiled function.

        The kernel does at most `work` operations and gives `address` to `begin_watch`;
        `address` is 0 where `work` is so little that no check is needed.
        """
        if self.leaves_time_for(work):
            return kernel(*arguments, 0)
        answers = self.answers()
        next(answers)
        answer = Callback(answers.__next__)
        address = ctypes.c_void_p.from_buffer(answer).value
        listens = self.listen()  # as `listening`, in half of its time
        try:
            found = kernel(*arguments, address)
        finally:
            if listens:
                set_handler(SIGINT, default_int_handler)
        if self.error is not None:
            raise self.error
        return found

    def verdict(self, status: Status) -> Status:
        """Return the status, with INTERRUPTED for a TIME_LIMIT caused by Ctrl-C.

        If the solve ended for another reason after Ctrl-C, KeyboardInterrupt is raised,
        so that Ctrl-C ends a loop over small problems.
        """
        if not self.interrupted:
            return status
        if status is Status.TIME_LIMIT:
            return Status.INTERRUPTED
        raise KeyboardInterrupt


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
