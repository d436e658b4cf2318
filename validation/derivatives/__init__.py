"""Derivatives of solutions: whether they are right, and their cost beside others.

============  ==========================================================================
cases         differentiable solutions, and families of kinks
differences   against differences in extended precision; at kinks, one-sided ones
packages      time and error of backward passes beside proxsuite, qpth, diffcp and dQP
closest       the closest point of infeasible QPs beside other solvers, and its cost
============  ==========================================================================
"""
