"""When the sweeps converge: H+ matrices, splittings and the paper's theorems."""

from namlcp.theory.comparison import Verdict, is_h_plus
from namlcp.theory.convergence import converges
