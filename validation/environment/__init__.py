"""The environment: package versions, first calls, BLAS threads."""
