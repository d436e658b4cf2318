"""When the sweeps converge: H+ matrices, splittings and the paper's theorems."""
