"""The command line, its demonstration, and the readers of problem files."""

from namlcp.cli.main import main
