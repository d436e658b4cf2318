"""QPs by a dual active-set method, compiled: a dual Schur-complement method."""
