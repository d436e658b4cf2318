"""Block principal pivoting for box LCPs.

`driver.Attempt` is the entry point. It calls compiled stages, mostly `pivot`.

| module | content |
|---|---|
| `driver` | the loop around the compiled stages, the residual check |
| `pivot` | block pivoting inside a proximal-point loop |
| `free_system`, `large_system` | systems of the free unknowns; is A semidefinite? |
| `rays` | certificates that there is no solution |
| `state` | the numbers and vectors that all stages share |

Compiled functions take one record of numbers and addresses, `state.PivotState`.
"""
