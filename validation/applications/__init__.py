"""What it is used for: large obstacles, contact, puts, models in CVXPY."""
