"""LCPs whose matrices are neither P nor semidefinite: friction, games, circuits.

==========  ============================================================================
piles       piles, walls and columns of bodies with friction, in the plane and in space
games       bimatrix games
circuits    a bridge of four diodes
families    random matrices of known classes; all of them by name and size
==========  ============================================================================
"""
