"""What goes with the next release."""

import warnings


def warmup(progress: bool = True, processes: int | None = None) -> None:
    """Do nothing: all there is to compile is compiled when namlcp is installed.

    This function goes with the next release; its arguments have no meaning.

    Examples
    --------
    >>> import namlcp
    >>> namlcp.warmup()  # doctest: +SKIP
    """
    warnings.warn(
        "namlcp.warmup() does nothing: namlcp is compiled when it is installed; the "
        "next release goes without it",
        DeprecationWarning,
        stacklevel=2,
    )
