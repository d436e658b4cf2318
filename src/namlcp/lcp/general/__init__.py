"""LCPs with matrices that are neither P nor semidefinite: games, friction, circuits.

`namlcp.lcp.methods` tries them in its order; `solve_lemke` is one by name.

| module | content |
|---|---|
| `search` | the problem, limits and best point, which the methods share |
| `distances` | an LCP in distances from bounds: for paths, and plain for the tableau |
| `tableau` | a dense tableau, and complementary pivoting in lexicographic order |
| `lemke` | Lemke's method |
| `games` | the method of Lemke and Howson for bimatrix games |
| `enumeration` | tiny problems: all complementary cones |
| `cones` | factors for contact with friction, its cones eliminated first |
| `interior` | infeasible interior paths, and proofs that there is no solution |
| `arc` | Lemke's homotopy as a smooth curve |
| `exact` | the exact solution near an interior point |
"""
