"""Large dense QPs: what a solve begins with, made by BLAS and LAPACK."""

from namlcp.qp.responses.large.prepare import prepare
