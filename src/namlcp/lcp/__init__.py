"""Box LCPs: the route of a solve, and the methods that it chooses from."""

from namlcp.lcp.data import LCP, lcp_data
from namlcp.lcp.methods import LARGE_LCP, find_method, solve_auto, solve_by_method
from namlcp.lcp.modulus.methods import SWEEPS, Parameters
from namlcp.lcp.multigrid.hierarchy import FreeSystem, hierarchy_of
from namlcp.lcp.pivoting.driver import Attempt
from namlcp.lcp.pivoting.pivot import ACCURACY, solve_small
from namlcp.lcp.prepared import Operator, Prepared
