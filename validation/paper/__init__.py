"""The paper: its tables and errors, convergence theory, parameters, stability."""
