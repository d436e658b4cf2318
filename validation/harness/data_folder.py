"""The data folder, which is no part of this repository."""

from pathlib import Path


class MissingDataError(Exception):
    """The data folder lacks something; the message says what."""


def require(path: Path) -> Path:
    if not path.exists():
        raise MissingDataError(f"{path} is missing")
    return path
