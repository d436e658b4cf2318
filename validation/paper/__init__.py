"""The paper: its tables and errors, convergence theory, parameters, stability."""

__all__: list[str] = []
