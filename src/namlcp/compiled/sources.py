"""The stamp of the package: one hash over all of its source files.

A kernel holds the code of every function that it calls, in whatever file they stand, so
machine code belongs to the package as a whole. It is kept under the stamp, and another
stamp never finds it.
"""

import functools
import hashlib
import os
from pathlib import Path

PACKAGE = Path(os.path.abspath(__file__)).parents[1]


def source_files() -> list[Path]:
    """Return the package's source files; none where it is not kept in files (a zip)."""
    return sorted(PACKAGE.rglob("*.py"))


@functools.cache
def hashed_files() -> tuple[str, dict[str, tuple[int, int]]]:
    """Return the stamp and, for each file, its time of change and its size.

    Line ends count as LF, so that a checkout with CR LF has the same stamp. The stamp
    is "" where there are no files to read.
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
    """Return what changes when a file is written: its time and its size."""
    found = os.stat(path)
    return found.st_mtime_ns, found.st_size


def stamp() -> str:
    """Return the hash of the sources as they were when it was asked for first."""
    return hashed_files()[0]


def are_unchanged() -> bool:
    """Tell whether the sources on disk are still those of the stamp.

    They may be replaced while the process runs, by an upgrade or an edit. The modules
    in memory are then not all of the stamp, and their code must not be kept under it.
    """
    known = hashed_files()[1]
    try:
        found = {p.relative_to(PACKAGE).as_posix(): state(p) for p in source_files()}
    except OSError:
        return False
    return found == known


def is_unchanged(module: str, file: str) -> bool:
    """Tell whether the file of one module is as it was when the stamp was taken.

    It is known by the module's name: a file may be reached by several paths.
    """
    name = f"{module.removeprefix('namlcp.').replace('.', '/')}.py"
    try:
        return hashed_files()[1].get(name) == state(file)
    except OSError:
        return False
