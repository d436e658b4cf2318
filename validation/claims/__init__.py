"""Every figure that the README files claim, from one table, claims.toml."""

from validation.claims.documents import DOCUMENTS, faults, written
from validation.claims.figures import specs, values
