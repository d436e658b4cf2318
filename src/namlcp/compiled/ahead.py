"""Compile every kernel of the list before its first call, in several processes.

Each child process reads lines of the list from its standard input, compiles the kernel
of a line and answers with the same line.
"""

import contextlib
import os
import queue
import subprocess
import sys
import threading
from collections.abc import Iterator

from namlcp.compiled.signatures import all_modules, listed, read
from namlcp.compiled.store import kept_in

START = (
    "import sys; sys.path[:] = sys.argv[1:]; "
    "from namlcp.compiled.ahead import work; work()"
)
"""Code of a child process; its arguments are the sys.path of this process."""


def compile_line(line: str) -> None:
    """Compile the kernel of one line, or load it if its file is there."""
    dispatcher, arguments = read(line)
    dispatcher.compile(arguments)


def compile_all(processes: int) -> Iterator[str]:
    """Compile all kernels of the list; yield each line when it is done.

    Child processes hand over machine code by files. Where no file can be written, this
    process compiles for itself.
    """
    lines = listed()
    if processes > 1 and sys.executable and kept_in() is not None:
        yield from compile_in_processes(lines, processes)
        return
    all_modules()
    for line in lines:
        compile_line(line)
        yield line


def compile_in_processes(lines: list[str], processes: int) -> Iterator[str]:
    """Let child processes compile the lines; yield each when it is done."""
    waiting: queue.SimpleQueue[str] = queue.SimpleQueue()
    for line in lines:
        waiting.put(line)
    done: queue.SimpleQueue[str | Exception] = queue.SimpleQueue()
    threads = [
        threading.Thread(target=guarded, args=(waiting, done), daemon=True)
        for _ in range(min(processes, len(lines)))
    ]
    for thread in threads:
        thread.start()
    for _ in lines:
        answer = done.get()
        if isinstance(answer, Exception):
            raise answer
        yield answer


def guarded(waiting: queue.SimpleQueue, done: queue.SimpleQueue) -> None:
    """Run `serve`; if it raises, empty `waiting` and put the exception into `done`."""
    try:
        serve(waiting, done)
    except Exception as error:
        with contextlib.suppress(queue.Empty):
            while True:  # the other threads end as well
                waiting.get_nowait()
        done.put(error)


def serve(waiting: queue.SimpleQueue, done: queue.SimpleQueue) -> None:
    """Start a child process and send it one line after the other until none waits."""
    command = [sys.executable, "-c", START, *sys.path]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        while True:
            try:
                line = waiting.get_nowait()
            except queue.Empty:
                process.stdin.close()
                return
            process.stdin.write(f"{line}\n")
            process.stdin.flush()
            if process.stdout.readline() != f"{line}\n":
                raise RuntimeError(f"a process that compiled ended at {line}")
            done.put(line)


def work() -> None:
    """Compile the lines of standard input; whatever else prints goes to stderr."""
    with os.fdopen(os.dup(1), "w") as answers:
        os.dup2(2, 1)
        all_modules()
        for line in sys.stdin:
            compile_line(line.rstrip("\n"))
            print(line, end="", file=answers, flush=True)
