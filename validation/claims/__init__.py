"""Every figure that the README files claim, from one table, claims.toml.

`figures` computes them from the rows of results, `documents` writes them into the
README files. `python -m validation.claims --check` says which claims do not hold, and
where a document differs from the results.
"""

from validation.claims.documents import DOCUMENTS, faults, written
from validation.claims.figures import Claim, claims, moved, specs, values
