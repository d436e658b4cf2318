"""Block principal pivoting for box LCPs: `driver.Attempt`, or one `solve_small`."""
