"""Block principal pivoting for box LCPs.

`driver.Attempt` is the entry point.

| module | content |
|---|---|
| `driver` | what the loop calls in Python, the residual check |
| `pivot` | block pivoting inside a proximal-point loop |
| `free_system` | systems of the free unknowns; is A semidefinite? |
| `large_system` | the same of large problems, in Python |
| `rays` | certificates that there is no solution |
| `state` | the memory of a solve, `Pivoting` |
"""
