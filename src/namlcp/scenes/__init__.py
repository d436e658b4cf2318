"""Contact with friction as LCPs, and the problems of the demonstration.

| module | content |
|---|---|
| `classics` | an obstacle, a pile of discs without friction, a walking robot |
| `friction` | rigid bodies with Coulomb friction as an LCP, in the plane and in space |
| `stepping` | discs that fall, roll and come to rest: an LCP a time step |
"""

from namlcp.scenes.classics import disc_pile, forced_obstacle, preview_control
from namlcp.scenes.stepping import FallingDiscs
