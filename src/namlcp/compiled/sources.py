"""The stamp of the package: one hash over all of its source files.

A kernel contains the code of every function that it calls, from whatever file, so that
machine code depends on the package as a whole. It is kept in a folder named by the
stamp.
"""

import functools
import hashlib
import os
from pathlib import Path

PACKAGE = Path(os.path.abspath(__file__)).parents[1]


def source_files() -> list[Path]:
    """Return the package's source files; none where it is imported from a zip file."""
    return sorted(PACKAGE.rglob("*.py"))


@functools.cache
def hashed_files() -> tuple[str, dict[str, tuple[int, int]]]:
    """Return the stamp and the `state` of each file.

    Line ends count as LF, so that a checkout with CR LF has the same stamp. The stamp
    is "" where no files can be read.
    """
    sources = hashlib.sha256()
    states = {}
    try:
        for path in source_files():
            name = path.relative_to(PACKAGE).as_posix()
            states[name] = state(path)
            text = path.read_bytes().replace(b"\r\n", b"\n")
            sources.update(f"{name} {len(text)}\n".encode())
            sources.update(text)
    except OSError:  # a file went away between the list and its reading
        states.clear()
    return (sources.hexdigest()[:32] if states else ""), states


def state(path: str | os.PathLike[str]) -> tuple[int, int]:
    """Return the time of change [ns] and the size [bytes] of a file."""
    found = os.stat(path)
    return found.st_mtime_ns, found.st_size


def stamp() -> str:
    """Return the hash of the sources, computed at the first call."""
    return hashed_files()[0]


def are_unchanged() -> bool:
    """Tell whether the sources on disk are still those of the stamp.

    An upgrade or an edit may replace them while the process runs. Some modules in
    memory may then differ from the stamp, and nothing must be kept under it.
    """
    known = hashed_files()[1]
    try:
        found = {p.relative_to(PACKAGE).as_posix(): state(p) for p in source_files()}
    except OSError:
        return False
    return found == known


def is_unchanged(module: str, file: str) -> bool:
    """Tell whether the file of one module is as it was when the stamp was taken.

    The module's name identifies the file, which several paths may lead to.
    """
    name = f"{module.removeprefix('namlcp.').replace('.', '/')}.py"
    try:
        return hashed_files()[1].get(name) == state(file)
    except OSError:
        return False
