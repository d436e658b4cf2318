"""Block principal pivoting for box LCPs.

`driver.Attempt` is the entry point.

| module | content |
|---|---|
| `driver` | what the loop calls in Python: large free systems, the residual check |
| `pivot` | block pivoting inside a proximal-point loop |
| `free_system` | systems of the free unknowns; is A semidefinite? |
| `rays` | certificates that there is no solution |
| `small` | small dense LCPs as they come to `solve_lcp`, in one call |
| `state` | the memory of a solve, `Pivoting` |
"""
