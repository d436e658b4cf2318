"""Sweep methods: modulus-based matrix splittings for box LCPs, and their parameters."""
