"""What results share: a problem kept for derivatives."""

from typing import Any


class Differentiable:
    """A result that keeps its problem by reference, for its derivatives.

    A pickled or copied result goes without the problem and the factors.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Leave the problem and the factors behind."""
        state = vars(self) | {"problem": None}
        state.pop("derivative", None)
        return state
