"""LCPs whose matrices are neither P nor semidefinite: friction, games."""
