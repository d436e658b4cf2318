"""The public functions that solve: engines below, results in the end."""
