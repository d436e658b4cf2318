"""Beside other solvers: success, time and accuracy on sets of problems."""

__all__: list[str] = []
