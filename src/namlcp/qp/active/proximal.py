"""To be written."""
from cython.cimports.namlcp.qp.active.state import STUCK


def solve_by_rounds(m):
    return STUCK


def refine_contradiction(m):
    pass


def contradicts_equations(m):
    return False


def leaves_equations(m):
    return False
