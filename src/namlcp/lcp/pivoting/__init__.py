"""Block principal pivoting for box LCPs: `driver.Attempt`, in one call `small`."""
