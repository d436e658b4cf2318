"""What it is used for: large obstacles, contact, puts, models in CVXPY, pictures.

cvxpy_bench: models in CVXPY solved in child processes, their answers judged.
"""
