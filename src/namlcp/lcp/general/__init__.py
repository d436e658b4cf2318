"""LCPs with matrices neither P nor semidefinite: games, friction, circuits."""
