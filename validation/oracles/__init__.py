"""Every scene solved by independent solvers and compared with known values."""
