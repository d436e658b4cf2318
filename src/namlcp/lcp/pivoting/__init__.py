"""Block principal pivoting for box LCPs; interior-point methods where it stagnates.

`solve_box` is the entry point. It calls compiled stages, mostly `pivot`.

| module | content |
|---|---|
| `driver` | the loop around the compiled stages, the residual check, the retry |
| `pivot`, `line_search` | block pivoting inside a proximal-point loop |
| `convexity` | whether A is positive semidefinite |
| `free_system`, `large_system` | the linear systems of the free unknowns |
| `interior` | an interior-point method for when block pivoting stagnates |
| `homogeneous` | the same for semidefinite nonsymmetric A, with certificates |
| `rays` | certificates that there is no solution |
| `state` | the numbers and vectors that all stages share |

Compiled functions take one record of numbers and addresses, `state.PivotState`.
"""

from namlcp.lcp.pivoting.driver import ACCURACY, UNSEEN, Attempt, outcome_of, solve_box
from namlcp.lcp.pivoting.homogeneous import CLEAR, CLEARER, homogeneous_path
from namlcp.lcp.pivoting.pivot import pivot
from namlcp.lcp.pivoting.rays import proof
