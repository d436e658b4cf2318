"""Beside other solvers: success, time and accuracy on sets of problems."""
