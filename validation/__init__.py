"""Is it good? The claims of README.md, one script each; run as README.md there says.

Rooms, each entered by its door (`__init__.py`) alone, imports pointing downwards:
oracles, stress, peers, paper, environment; applications; problems; harness.
"""
