"""Every figure that README claims, computed from the rows of validation/results.

`values(folder)` returns them by name, `claims(folder)` with their limits. `python -m
validation.claims` prints the claims; `report --full` compares them with those of the
run before.
"""

from validation.claims.limits import Claim, claims, moved, summary
from validation.claims.marks import renewed, stale
from validation.claims.measured import values
