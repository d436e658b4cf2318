"""Properties that are computed when they are first read, and then kept."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from functools import cached_property as kept
else:

    class kept:
        """functools.cached_property without the lock that it takes up to Python 3.11.

        The lock takes more than half of the time of reading a constant, and tiny LCPs
        read eight properties. Two threads may both compute the value: the last is kept.
        """

        def __init__(self, function):
            self.function, self.name = function, function.__name__
            self.__doc__ = function.__doc__

        def __get__(self, instance, owner=None):
            """Compute the value and keep it beside the attributes of the instance."""
            if instance is None:
                return self
            value = instance.__dict__[self.name] = self.function(instance)
            return value
