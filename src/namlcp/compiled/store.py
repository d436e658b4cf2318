"""Files of machine code: where they are kept, which are trusted, when they are removed.

One file holds one kernel for one signature. Its name ends with the hash of its key, and
it begins with the SHA-256 of the rest, so that a truncated or changed file is rejected.
There is no index that two processes could write at once, and a file appears under its
name only when it is complete.

A loaded file is executed. It is therefore read only if the file, its folder and the
folder above belong to this user, to root or to the owner of the package, and nobody
else may write to them.
"""

import contextlib
import functools
import hashlib
import os
import shutil
import stat
import sys
import time
from pathlib import Path

from namlcp.compiled.sources import PACKAGE, stamp

SUFFIX = ".kernel"

DIGEST = hashlib.sha256().digest_size

READING = os.O_RDONLY | sum(
    getattr(os, name, 0) for name in ("O_NOFOLLOW", "O_NONBLOCK", "O_BINARY")
)
"""Flags to open a file without following a link or waiting for the writer of a pipe."""

KEPT = 30 * 86400.0
"""Time [s] without use after which machine code of other stamps is removed."""

USED = 86400.0
"""Least age [s] of a folder's time of change that a use sets anew."""


class Folder:
    """The folder for the machine code of the present stamp, one of those in `parent`.

    The folders of other stamps stay there for `patience` [s] after their last use.
    """

    def __init__(self, parent: Path, patience: float = KEPT):
        self.parent, self.patience = parent, patience
        self.path = parent / stamp()
        self.is_used = False

    def read(self, name: str) -> bytes | None:
        """Return what was written under the name; None unless complete and trusted."""
        try:
            with open(os.open(self.path / name, READING), "rb") as file:
                trusted = is_trusted(os.fstat(file.fileno())) and self.is_safe()
                content = file.read() if trusted else b""
        except OSError:
            return None
        payload = content[DIGEST:]
        if not payload or hashlib.sha256(payload).digest() != content[:DIGEST]:
            return None
        if not self.is_used:
            self.note_use()
        return payload

    def write(self, name: str, payload: bytes) -> bool:
        """Write a file that others see completely or not at all; tell if it worked."""
        if not self.prepare():
            return False
        draft = self.path / f"{name}.{os.urandom(8).hex()}"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
        try:
            try:
                with open(os.open(draft, flags, 0o644), "wb") as file:
                    file.write(hashlib.sha256(payload).digest() + payload)
                os.replace(draft, self.path / name)
            finally:
                draft.unlink(missing_ok=True)
        except OSError:  # read-only, full, or in use by another process (Windows)
            return False
        return True

    def prepare(self) -> bool:
        """Make the folder unless it is there; tell whether it may be written to."""
        try:
            if not os.path.isdir(self.path):
                self.parent.parent.mkdir(parents=True, exist_ok=True)
                for place in (self.parent, self.path):
                    place.mkdir(0o755, exist_ok=True)
                self.remove_others()
            return self.is_safe()
        except OSError:
            return False

    def is_safe(self) -> bool:
        """Tell whether the folder and the one above are trusted."""
        return all(is_trusted(os.lstat(place)) for place in (self.path, self.parent))

    def has(self, prefix: str) -> bool:
        """Tell whether there is a file whose name begins with `prefix`."""
        try:
            names = os.listdir(self.path)
        except OSError:
            return False
        return any(name.startswith(prefix) for name in names)

    def note_use(self) -> None:
        """Set the folder's time of change, which `remove_others` looks at."""
        self.is_used = True
        with contextlib.suppress(OSError):
            if time.time() - self.path.stat().st_mtime > USED:
                os.utime(self.path)

    def remove_others(self) -> None:
        """Remove the folders of other stamps that were not used for `patience`."""
        for other in self.parent.iterdir():
            if other != self.path and is_stamp(other.name):
                with contextlib.suppress(OSError):
                    if time.time() - other.stat().st_mtime > self.patience:
                        shutil.rmtree(other, ignore_errors=True)


def is_stamp(name: str) -> bool:
    """Tell whether a folder's name is a stamp."""
    return len(name) == len(stamp()) and set(name) <= set("0123456789abcdef")


def is_trusted(found: os.stat_result) -> bool:
    """Tell whether a file or folder belongs to a trusted user and no other may write.

    On Windows nothing is checked: the user's own folders are closed to others.
    """
    if not hasattr(os, "getuid"):
        return True
    writable_by_others = found.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    kind = stat.S_ISREG(found.st_mode) or stat.S_ISDIR(found.st_mode)
    return kind and not writable_by_others and found.st_uid in trusted_owners()


@functools.cache
def trusted_owners() -> set[int]:
    """Return the users whose files may be run: this one, root, the package's owner."""
    return {os.getuid(), os.geteuid(), 0, os.stat(PACKAGE).st_uid}


def user_folder() -> Path | None:
    """Return the operating system's folder for a user's caches; None without a home."""
    try:
        home = Path.home()
    except RuntimeError:
        return None
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local")
    if sys.platform == "darwin":
        return home / "Library" / "Caches"
    given = os.environ.get("XDG_CACHE_HOME", "")
    return Path(given) if os.path.isabs(given) else home / ".cache"


@functools.cache
def folders() -> list[Folder]:
    """Return the folders to read machine code from and to write it to, in this order.

    They are NUMBA_CACHE_DIR alone where it is set, else the folder beside the package
    and then the user's folder for caches. Beside the package, code of other stamps is
    removed at once, because its sources are gone.
    """
    if not stamp():
        return []
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        return [Folder(Path(given) / "namlcp")]
    beside = Folder(PACKAGE / "__pycache__" / "kernels", patience=0.0)
    user = user_folder()
    return [beside] if user is None else [beside, Folder(user / "namlcp")]


def kept_in() -> Path | None:
    """Return the first folder that can be written, which is made; None without any."""
    return next((folder.path for folder in folders() if folder.prepare()), None)
