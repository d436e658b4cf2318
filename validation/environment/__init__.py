"""The environment: package versions, first calls, BLAS threads."""

__all__: list[str] = []
