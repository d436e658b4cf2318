"""Derivatives of the solutions of QPs and LCPs in all of their data.

They take problems, points and factors; the methods of results call them.
"""
