"""QPs as differentiable functions of other packages, each imported at its first use.

``namlcp.jax``, ``namlcp.torch`` and ``namlcp.cvxpylayers`` are the modules of this
room; the first two share `Stack`.
"""

__all__ = ["cvxpylayers", "jax", "torch"]
