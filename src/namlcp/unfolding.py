"""What results share: a problem kept for derivatives, attributes made when asked."""

from collections.abc import Iterable
from typing import Any


class Differentiable:
    """A result that keeps its problem by reference, for its derivatives.

    A pickled or copied result goes without the problem and the factors.
    """

    def __getstate__(self) -> dict[str, Any]:
        """Leave the problem and the factors behind."""
        state = vars(self) | {"problem": None}
        for name in ("derivative", "factors", "stamp"):
            state.pop(name, None)
        return state


class Unfolding(Differentiable):
    """A result whose attributes may be made when the first of them is asked for.

    A small QP is solved in less time than it takes to wrap all that is known of it. An
    attribute `later` = (function, argument, ...) makes the others: function(argument,
    ...) returns them in a dict.
    """

    def __getattr__(self, name: str) -> Any:
        """Return an attribute that has not been made, or raise AttributeError."""
        self.unfold()
        if name not in vars(self):
            kind = type(self).__name__
            raise AttributeError(f"{kind!r} object has no attribute {name!r}")
        return vars(self)[name]

    def unfold(self) -> None:
        """Make all attributes that are missing."""
        function, *arguments = vars(self).get("later", (dict,))
        for name, value in function(*arguments).items():
            vars(self).setdefault(name, value)  # another thread may have made it

    def __dir__(self) -> Iterable[str]:
        """List the attributes that are missing, too."""
        self.unfold()
        return super().__dir__()

    def __getstate__(self) -> dict[str, Any]:
        """Leave the function behind, too, but not what it makes."""
        self.unfold()
        state = super().__getstate__()
        state.pop("later", None)
        return state
