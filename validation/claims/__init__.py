"""Every figure that the README files claim, computed from the rows of results.

`values(folder)` returns them by name (`measured_*`, a module for each kind of file),
`claims(folder)` those with limits; `marks` finds and renews them in a text. `python -m
validation.claims` prints the claims; `report --full` compares them with those of the
run before.
"""

from validation.claims.limits import Claim, claims, moved, summary
from validation.claims.marks import renewed, stale
from validation.claims.measured import values
