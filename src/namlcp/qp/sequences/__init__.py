"""Many QPs: one after the other by a `QPSequence`, or at once by `solve_items`."""

from namlcp.qp.sequences.batch import (
    STATUSES,
    Items,
    available_cores,
    chunks_of,
    on_threads,
    solve_items,
)
from namlcp.qp.sequences.pattern import OtherShape
from namlcp.qp.sequences.sequence import QPSequence
