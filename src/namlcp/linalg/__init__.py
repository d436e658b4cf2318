"""BLAS and LAPACK in compiled code, sparse columns, orderings, factorisations.

Functions that take the arrays of a compressed matrix take them in the order indptr,
indices, data.
"""
