"""
Copyright 2026, the CVXPY Authors

Licensed under the Apache License, Version 2.0 (the "License");
you may not use this file except in compliance with the License.
You may obtain a copy of the License at

    http://www.apache.org/licenses/LICENSE-2.0

Unless required by applicable law or agreed to in writing, software
distributed under the License is distributed on an "AS IS" BASIS,
WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
See the License for the specific language governing permissions and
limitations under the License.
"""

import cvxpy.settings as s
from cvxpy.error import SolverError
from cvxpy.reductions.solution import Solution, failure_solution
from cvxpy.reductions.solvers import utilities
from cvxpy.reductions.solvers.qp_solvers.qp_solver import QpSolver
from cvxpy.utilities.citations import CITATION_DICT


class NAMLCP(QpSolver):
    """QP interface for the namlcp solver"""

    MIP_CAPABLE = False
    BOUNDED_VARIABLES = True

    # Map of namlcp status to CVXPY status.
    STATUS_MAP = {
        "solved": s.OPTIMAL,
        "primal_infeasible": s.INFEASIBLE,
        "dual_infeasible": s.UNBOUNDED,
        "max_iter": s.USER_LIMIT,
        "time_limit": s.USER_LIMIT,
        "stalled": s.USER_LIMIT,
    }

    def name(self):
        return s.NAMLCP

    def import_solver(self) -> None:
        import namlcp  # noqa: F401

    def invert(self, solution, inverse_data):
        attr = {
            s.SOLVE_TIME: solution.solve_time,
            s.SETUP_TIME: solution.setup_time,
            s.NUM_ITERS: int(solution.iterations),
            s.EXTRA_STATS: {"solution": solution},
        }

        # Map namlcp statuses back to CVXPY statuses
        status = self.STATUS_MAP.get(solution.status.value, s.SOLVER_ERROR)

        if status in s.SOLUTION_PRESENT:
            opt_val = solution.obj + inverse_data[s.OFFSET]
            primal_vars = {NAMLCP.VAR_ID: solution.x}
            dual_vars = utilities.get_dual_values(
                solution.y, utilities.extract_dual_value, inverse_data[self.EQ_CONSTR]
            )
            dual_vars.update(
                utilities.get_dual_values(
                    solution.z,
                    utilities.extract_dual_value,
                    inverse_data[self.NEQ_CONSTR],
                )
            )
            return Solution(status, opt_val, primal_vars, dual_vars, attr)
        return failure_solution(status, attr)

    def solve_via_data(
        self, data, warm_start: bool, verbose: bool, solver_opts, solver_cache=None
    ):
        import namlcp

        parts = dict(
            P=data[s.P],
            q=data[s.Q],
            G=data[s.F],
            h=data[s.G],
            A=data[s.A],
            b=data[s.B],
            lb=data.get(s.LOWER_BOUNDS),
            ub=data.get(s.UPPER_BOUNDS),
        )
        parts = {name: part for name, part in parts.items() if part is not None}
        opts = {name: v for name, v in solver_opts.items() if name != "use_quad_obj"}
        opts["verbose"] = bool(verbose)

        # A solver kept from the last solve begins with its active constraints.
        solver = None
        if warm_start and solver_cache is not None and self.name() in solver_cache:
            solver, old_opts = solver_cache[self.name()]
            if old_opts != opts:
                solver = None
        try:
            if solver is not None:
                try:
                    solver.update(**parts)
                except namlcp.OtherShape:
                    solver = None
            if solver is None:
                solver = namlcp.Solver(**parts, **opts)
            result = solver.solve()
        except namlcp.NotConvex as error:
            raise SolverError(str(error)) from error
        if solver_cache is not None:
            solver_cache[self.name()] = (solver, opts)
        return result

    def cite(self, data):
        """Returns bibtex citation for the solver.

        Parameters
        ----------
        data : dict
            Data generated via an apply call.
        """
        return CITATION_DICT["NAMLCP"]
