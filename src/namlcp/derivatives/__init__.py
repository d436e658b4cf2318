"""Derivatives of the solutions of QPs and LCPs in all of their data."""
