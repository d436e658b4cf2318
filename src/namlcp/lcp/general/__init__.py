"""LCPs with matrices that are neither P nor semidefinite: games, friction, circuits.

| module | content |
|---|---|
| `tableau` | a dense tableau, and complementary pivoting in lexicographic order |
| `lemke` | Lemke's method |
| `games` | the method of Lemke and Howson for bimatrix games |
| `enumeration` | tiny problems: all complementary cones |
"""

from namlcp.lcp.general.lemke import solve_lemke
from namlcp.lcp.general.tableau import pivot_until
