"""Box LCPs: the route of a solve, and the methods that it chooses from."""

from namlcp.lcp.data import LCP, lcp_data
from namlcp.lcp.methods import LARGE_LCP, find_method, solve_auto
from namlcp.lcp.modulus.methods import SWEEPS, Parameters
from namlcp.lcp.multigrid.hierarchy import hierarchy_of
from namlcp.lcp.multigrid.krylov import FreeSystem
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting.driver import ACCURACY, Attempt
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.solve import solve_by_method
