"""Truncated multigrid cycles for matrices like those of differential equations."""
