"""Principal pivoting in blocks, with interior paths where it stagnates.

`solve_box` is the door; `driver` calls the compiled stages, of which `pivot` does
nearly all of the work.

| module | what |
|---|---|
| `driver` | the loop around the compiled stages, the check, the second attempt |
| `pivot`, `line_search` | block pivoting within a proximal loop |
| `free_system`, `large_system` | the systems of the free unknowns |
| `interior`, `homogeneous` | interior paths: for definite A, for monotone A |
| `rays` | proofs that there is no solution |
| `work` | the memory of all stages, by name |

Compiled functions take one NamedTuple of named rows, `work.Work`, whose arrays have no
reference count (`compiled.uncounted`), and a record of scalars. Three ways were timed
on `pivot` alone with n = 5: rows of one array, found by constants, took 10.7 us; the
same NamedTuple with reference counts 15.5 us; without them 8.7 us. All three compile in
8.6 to 9.3 s.
"""

from namlcp.lcp.pivoting.driver import ACCURACY, solve_box
from namlcp.lcp.pivoting.pivot import pivot

__all__ = ["ACCURACY", "pivot", "solve_box"]
