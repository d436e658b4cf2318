"""Box LCPs: `solve_lcp` and the methods that it chooses from."""

from namlcp.lcp.auto import LARGE_LCP, solve_auto
from namlcp.lcp.data import LCP, Outcome
from namlcp.lcp.modulus import METHODS, Parameters, checked_parameters, find_method
from namlcp.lcp.multigrid import FreeSystem
from namlcp.lcp.operators import Operator
from namlcp.lcp.pivoting import ACCURACY, Attempt, pivot
from namlcp.lcp.prepared import Prepared
from namlcp.lcp.relaxation import relax_csr
from namlcp.lcp.solve import solve_lcp
