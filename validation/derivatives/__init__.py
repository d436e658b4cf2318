"""Derivatives of solutions: whether they are right, and their cost beside others."""
