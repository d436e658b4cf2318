"""The command line, and the readers of problem files."""

from namlcp.cli.main import main
