"""Sparse L D L' of quasi-definite matrices of one pattern, factored many times.

`analyse` lays out all indices once (`pattern`); `ldl_factor` and `ldl_solve_into`, for
compiled callers, then only compute (`factor`, `solve`). They take pointers,
which need no sign test of an index. They do not count references (_nrt=False): counting
them in every chunk takes as long as the arithmetic. Those for one chunk are inlined.

The matrix K is given by its upper triangle in CSC, with all diagonal entries, which are
the last of their columns. Every symmetric permutation of a quasi-definite matrix has an
L D L' without pivoting (R. Vanderbei, SIAM J. Optim. 5 (1995) 100-113); L has ones on
its diagonal.
"""
