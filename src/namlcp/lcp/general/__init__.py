"""LCPs with matrices that are neither P nor semidefinite: games, friction, circuits.

`namlcp.lcp.methods` tries them in its order, with what `search` shares among them.
"""
