#!/usr/bin/env python
# -*- coding: utf-8 -*-
#
# SPDX-License-Identifier: LGPL-3.0-or-later
# Copyright 2026 the qpsolvers contributors

"""Unit tests for namlcp."""

import unittest
import warnings

import numpy as np
import scipy.sparse as spa

from qpsolvers import Problem
from qpsolvers.exceptions import ParamError, ProblemError
from qpsolvers.problems import get_qpsut01

try:
    from qpsolvers.solvers.namlcp_ import namlcp_solve_problem, namlcp_solve_qp

    class TestNamlcp(unittest.TestCase):
        """Test fixture for the namlcp solver."""

        def setUp(self):
            """Prepare test fixture."""
            warnings.simplefilter("ignore", category=DeprecationWarning)

        def test_namlcp_options(self):
            """Options are forwarded; unknown and wrong ones are named."""
            problem, _ = get_qpsut01()
            solution = namlcp_solve_problem(
                problem, eps_abs=1e-8, eps_rel=0.0, max_iter=100, time_limit=9.0
            )
            self.assertTrue(solution.is_optimal(1e-8))
            with self.assertRaisesRegex(ParamError, "did you mean 'eps_abs'"):
                namlcp_solve_problem(problem, eps_ab=1e-8)
            with self.assertRaisesRegex(ParamError, "max_iter"):
                namlcp_solve_problem(problem, max_iter=0)

        def test_namlcp_warm_start(self):
            """A guess does not change the solution."""
            problem, _ = get_qpsut01()
            cold = namlcp_solve_problem(problem)
            for guess in (cold.x, np.zeros(cold.x.size)):
                warm = namlcp_solve_problem(problem, initvals=guess)
                self.assertLess(np.linalg.norm(warm.x - cold.x), 1e-10)

        def test_namlcp_sparse(self):
            """Dense and sparse matrices give the same solution and multipliers."""
            P, q, G, h, A, b, lb, ub = get_qpsut01()[0].unpack()
            dense = namlcp_solve_problem(Problem(P, q, G, h, A, b, lb, ub))
            P, G, A = (spa.csc_matrix(matrix) for matrix in (P, G, A))
            sparse = namlcp_solve_problem(Problem(P, q, G, h, A, b, lb, ub))
            for name in "x", "y", "z", "z_box":
                change = getattr(dense, name) - getattr(sparse, name)
                self.assertLess(np.linalg.norm(change), 1e-9)
            without = namlcp_solve_problem(Problem(np.eye(2), np.ones(2)))
            self.assertEqual(without.z_box.shape, (0,))

        def test_namlcp_infeasible(self):
            """An infeasible problem has a Farkas certificate, and no x."""
            G, h = np.array([[1.0, 1.0], [-1.0, -1.0]]), np.array([1.0, -2.0])
            problem = Problem(np.eye(2), np.zeros(2), G, h)
            solution = namlcp_solve_problem(problem)
            self.assertFalse(solution.found)
            self.assertIsNone(solution.x)
            z = solution.extras["certificate"]["z"]
            self.assertLess(np.abs(G.T @ z).max(), 1e-12)
            self.assertAlmostEqual(h @ z, -1.0)
            closest = namlcp_solve_problem(problem, infeasible="closest")
            shift = closest.extras["closest"].shift_h
            self.assertLess(np.abs(shift - 0.5).max(), 1e-9)

        def test_namlcp_unbounded(self):
            """An unbounded problem has a ray."""
            problem = Problem(np.zeros((2, 2)), np.array([-1.0, 0.0]))
            solution = namlcp_solve_problem(problem)
            self.assertEqual(solution.extras["status"], "dual_infeasible")
            self.assertAlmostEqual(solution.extras["certificate"]["x"][0], 1.0)

        def test_namlcp_malformed(self):
            """What is no convex QP raises a ProblemError."""
            with self.assertRaisesRegex(ProblemError, "positive semidefinite"):
                namlcp_solve_qp(-np.eye(2), np.ones(2))
            with self.assertRaisesRegex(ProblemError, "finite"):
                namlcp_solve_qp(np.eye(2), np.array([1.0, np.nan]))

except ImportError as exn:  # in case the solver is not installed
    warnings.warn(f"Skipping namlcp tests: {exn}")
