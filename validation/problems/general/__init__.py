"""LCPs whose matrices are neither P nor semidefinite: friction and games.

==========  ============================================================================
piles       piles, walls and columns of bodies with friction, in the plane and in space
games       bimatrix games
families    random matrices of known classes; all of them by name and size
==========  ============================================================================
"""
