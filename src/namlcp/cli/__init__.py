"""The command line, and the files it reads."""

from namlcp.cli.main import main

__all__ = ["main"]
