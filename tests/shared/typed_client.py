"""A program that uses namlcp as typed code does; mypy --strict has no complaint.

`assert_type` fails, for mypy, where a hint of the package is lost on the way.
"""

from typing import assert_type

import numpy as np

import namlcp
from namlcp import LCPResult, Options, QPResult, Relaxation, Solver, Status, Verdict


def cost(result: QPResult) -> float:
    """Return the objective, infinite where there is no solution."""
    assert_type(result.status, Status)
    assert_type(result.x, np.ndarray)
    return result.obj if result.status is Status.SOLVED else np.inf


def solved_step(solver: Solver, q: np.ndarray) -> QPResult:
    """Return the next solution of a sequence."""
    solver.update(q=q)
    return solver.solve()


def main() -> None:
    """Use every public name once."""
    eye, ones = np.eye(2), np.ones(2)
    result = namlcp.solve_qp(eye, -ones, ub=0.5 * ones, eps_abs=1e-8)
    assert_type(result, QPResult)
    assert cost(result) < 0.0
    assert_type(result.backward(dx=ones).q, np.ndarray)
    assert_type(result.forward(dq=ones).x, np.ndarray)
    assert_type(result.residuals.solved(1e-9, 0.0), bool)
    result = solved_step(Solver(eye, ones, lb=0.0 * ones), -ones)
    batch = namlcp.solve_batch(eye, np.stack([ones, -ones]))
    assert_type(batch[0], QPResult)
    lcp = namlcp.solve_lcp(namlcp.Prepared(eye), -ones)
    assert_type(lcp, LCPResult)
    assert_type(lcp.ray, np.ndarray | None)
    every = np.zeros(2), np.full(2, np.inf)
    assert_type(namlcp.natural_residual(lcp.z, lcp.w, *every), float)
    verdict = namlcp.is_h_plus(eye)
    assert_type(verdict, Verdict)
    assert_type(verdict.answer, bool | None)
    assert namlcp.converges(eye, "psor")
    options = Options(infeasible=Relaxation(norm=1))
    assert_type(options.eps_abs, float)


if __name__ == "__main__":
    main()
