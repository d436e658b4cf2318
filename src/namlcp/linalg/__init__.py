"""BLAS and LAPACK in compiled code, sparse columns, orderings, factorisations.

Functions that take the arrays of a compressed matrix take them in the order indptr,
indices, data; where a dense form goes with them it stands first.
"""
