"""Factors for contact with friction, whose cones are eliminated first.

| module | content |
|---|---|
| `contacts` | the contacts found in a matrix |
| `condensed` | elimination of their cones, and the linear systems of the paths |
| `fronts` | factors of what remains |
"""

from namlcp.lcp.general.cones.condensed import system_of
