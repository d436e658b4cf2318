"""Properties that are computed when they are first read, and then kept."""

from collections.abc import Callable
from typing import Any, Generic, TypeVar

T = TypeVar("T")


class kept(Generic[T]):
    """functools.cached_property without the lock that it takes up to Python 3.11.

    The lock takes more than half of the time of reading a constant, and tiny LCPs
    read eight properties. Two threads may both compute the value: the last is kept.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function, self.name = function, function.__name__
        self.__doc__ = function.__doc__

    def __get__(self, instance: Any, owner: Any = None) -> T:
        """Compute the value and keep it beside the attributes of the instance."""
        if instance is None:
            return self  # type: ignore[return-value]
        value = instance.__dict__[self.name] = self.function(instance)
        return value
