"""The interior-point method for sparse QPs, with an active-set refinement."""
