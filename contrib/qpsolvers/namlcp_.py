#!/usr/bin/env python
# -*- coding: utf-8 -*-
#
# SPDX-License-Identifier: LGPL-3.0-or-later
# Copyright 2026 the qpsolvers contributors

"""Solver interface for namlcp.

namlcp solves dense and sparse convex QPs by a dual active-set or an
interior-point method, and solves the linear system of the active constraints
at the end, so that answers are accurate to rounding whatever tolerance is
asked for. Infeasible and unbounded problems come back with a certificate.

**Warm-start:** this solver interface supports warm starting 🔥
"""

import time
from typing import Optional, Union

import namlcp
import numpy as np
import scipy.sparse as spa

from ..exceptions import ParamError, ProblemError
from ..problem import Problem
from ..solution import Solution


def namlcp_solve_problem(
    problem: Problem,
    initvals: Optional[np.ndarray] = None,
    verbose: bool = False,
    **kwargs,
) -> Solution:
    """Solve a quadratic program using namlcp.

    Parameters
    ----------
    problem :
        Quadratic program to solve.
    initvals :
        Warm-start guess vector for the primal solution. Constraints active
        there are tried first.
    verbose :
        Set to `True` to print out extra information.

    Returns
    -------
    :
        Solution to the QP, if found, otherwise ``None``. Its ``extras`` have
        the ``status``, a ``message``, the number of ``iterations``, and the
        ``certificate`` of an infeasible or unbounded problem.

    Raises
    ------
    ParamError
        If a keyword argument is no option of namlcp, or has a wrong value.
    ProblemError
        If the problem is ill-formed or its cost matrix is not positive
        semidefinite.

    Notes
    -----
    Keyword arguments are forwarded to namlcp:

    .. list-table::
       :widths: 30 70
       :header-rows: 1

       * - Name
         - Effect
       * - ``eps_abs``
         - Absolute tolerance on primal residual, dual residual and gap.
       * - ``eps_rel``
         - Tolerance relative to the size of their terms.
       * - ``max_iter``
         - Limit on the iterations of any one loop.
       * - ``time_limit``
         - Limit on the time of the solve, in seconds.
       * - ``threads``
         - Threads that BLAS may use.
       * - ``infeasible``
         - ``"certificate"``, or ``"closest"`` or ``"elastic"`` to solve the
           nearest feasible problem as well (``extras["closest"]``).

    Check out the documentation of namlcp for details.
    """
    build_start_time = time.perf_counter()
    P, q, G, h, A, b, lb, ub = problem.unpack()
    try:
        namlcp.Options.from_names({**kwargs, "verbose": verbose})
    except (TypeError, ValueError) as error:
        raise ParamError(str(error)) from error
    solve_start_time = time.perf_counter()
    try:
        result = namlcp.solve_qp(
            P, q, G, h, A, b, lb, ub, x0=initvals, verbose=verbose, **kwargs
        )
    except (TypeError, ValueError) as error:
        raise ProblemError(str(error)) from error
    solve_end_time = time.perf_counter()

    status = result.status
    solution = Solution(problem)
    solution.extras = {
        "status": status.value,
        "message": result.message or status.explanation,
        "iterations": result.iterations,
    }
    solution.found = status is namlcp.Status.SOLVED
    if status is namlcp.Status.PRIMAL_INFEASIBLE:
        solution.extras["certificate"] = {
            "y": result.y,
            "z": result.z,
            "z_box": result.z_box,
        }
        if result.closest is not None:
            solution.extras["closest"] = result.closest
    elif status is namlcp.Status.DUAL_INFEASIBLE:
        solution.extras["certificate"] = {"x": result.x}
    else:
        has_box = lb is not None or ub is not None
        solution.x = result.x
        solution.y = result.y
        solution.z = result.z
        solution.z_box = result.z_box if has_box else np.empty((0,))
        solution.obj = result.obj
    solution.build_time = solve_start_time - build_start_time
    solution.solve_time = solve_end_time - solve_start_time
    return solution


def namlcp_solve_qp(
    P: Union[np.ndarray, spa.csc_matrix],
    q: np.ndarray,
    G: Optional[Union[np.ndarray, spa.csc_matrix]] = None,
    h: Optional[np.ndarray] = None,
    A: Optional[Union[np.ndarray, spa.csc_matrix]] = None,
    b: Optional[np.ndarray] = None,
    lb: Optional[np.ndarray] = None,
    ub: Optional[np.ndarray] = None,
    initvals: Optional[np.ndarray] = None,
    verbose: bool = False,
    **kwargs,
) -> Optional[np.ndarray]:
    r"""Solve a quadratic program using namlcp.

    The quadratic program is defined as:

    .. math::

        \begin{split}\begin{array}{ll}
            \underset{\mbox{minimize}}{x} &
                \frac{1}{2} x^T P x + q^T x \\
            \mbox{subject to}
                & G x \leq h                \\
                & A x = b                   \\
                & lb \leq x \leq ub
        \end{array}\end{split}

    Parameters
    ----------
    P :
        Positive semidefinite cost matrix.
    q :
        Cost vector.
    G :
        Linear inequality constraint matrix.
    h :
        Linear inequality constraint vector.
    A :
        Linear equality constraint matrix.
    b :
        Linear equality constraint vector.
    lb :
        Lower bound constraint vector.
    ub :
        Upper bound constraint vector.
    initvals :
        Warm-start guess vector for the primal solution.
    verbose :
        Set to `True` to print out extra information.

    Returns
    -------
    :
        Primal solution to the QP, if found, otherwise ``None``.
    """
    problem = Problem(P, q, G, h, A, b, lb, ub)
    solution = namlcp_solve_problem(problem, initvals, verbose, **kwargs)
    return solution.x if solution.found else None
