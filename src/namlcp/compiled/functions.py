"""max, min, np.empty and np.zeros in compiled functions, typed and translated here.

numba has them as functions of its own, compiled anew for each set of types: a tenth of
a second each with all that surrounds them, though three instructions would do. What is
not foreseen here, such as the largest entry of a tuple, is left to numba.

Like `compiler`, this module was written from the sources of numba 0.59 to 0.68.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import Signature
from numba.np.arrayobj import _empty_nd_impl, _parse_shape

DTYPES = types.NumberClass, types.DType
"""Types of what may be the dtype of a new array: np.int32 and the like, a.dtype."""


class Translated(Signature):
    """The signature of a call, with what translates it."""

    __slots__ = ("code",)

    def __init__(self, code: Callable[..., Any], returned: Any, *kinds: Any):
        super().__init__(returned, kinds, None)
        # (target context, LLVM's builder, signature, values of the arguments) -> value
        self.code = code


def translated(context: Any, function: Any, args: tuple, kws: dict) -> Any:
    """Return the signature of a call of one of FUNCTIONS, None if it is left to numba.

    `function`, `args` and `kws` are numba types, `context` its typing context.
    """
    if not isinstance(function, types.Function):
        return None
    found = FUNCTIONS.get(function.typing_key)
    return None if found is None else found(context, args, kws)


# ---- max and min


def extreme(relation: str, context: Any, args: tuple, kws: dict) -> Any:
    """Return the signature of max (relation ">") or min ("<") of signed numbers."""
    kinds = tuple(map(types.unliteral, args))
    if kws or len(kinds) < 2 or not all(map(is_signed, kinds)):
        return None
    kind = context.unify_types(*kinds)
    code = functools.partial(extreme_of, relation)
    return Translated(code, kind, *(kind for _ in kinds))


def is_signed(kind: Any) -> bool:
    """Tell whether a type is that of signed or floating numbers."""
    return isinstance(kind, types.Float) or getattr(kind, "signed", False)


def extreme_of(
    relation: str, context: Any, builder: Any, signature: Any, values: list
) -> Any:
    """Return the extreme value, by Python's rule, which matters for NaN and -0.

    The next value replaces the extreme one so far where the relation holds.
    """
    is_real = isinstance(signature.return_type, types.Float)
    compare = builder.fcmp_ordered if is_real else builder.icmp_signed
    found = values[0]
    for value in values[1:]:
        found = builder.select(compare(relation, value, found), value, found)
    return found


# ---- new arrays


def new_array(is_zero: bool, context: Any, args: tuple, kws: dict) -> Any:
    """Return the signature of np.empty or np.zeros, of (shape) or (shape, dtype)."""
    if not args or kws.keys() - {"dtype"}:
        return None
    shape, *rest = args
    entry = kws.get("dtype", rest[0] if rest else types.NumberClass(types.float64))
    sizes = shape.dtype if isinstance(shape, types.UniTuple) else shape
    if not isinstance(sizes, types.Integer) or not isinstance(entry, DTYPES):
        return None
    order = len(shape) if isinstance(shape, types.UniTuple) else 1
    array = types.Array(entry.dtype, order, "C")
    code = functools.partial(allocated, is_zero)
    return Translated(code, array, types.unliteral(shape))


def allocated(
    is_zero: bool, context: Any, builder: Any, signature: Any, values: list
) -> Any:
    """Return a new array."""
    sizes = _parse_shape(context, builder, signature.args[0], values[0])
    array = _empty_nd_impl(context, builder, signature.return_type, sizes)
    if is_zero:
        size = builder.mul(array.itemsize, array.nitems)
        cgutils.memset(builder, array.data, size, 0)
    return array._getvalue()


FUNCTIONS = {
    max: functools.partial(extreme, ">"),
    min: functools.partial(extreme, "<"),
    np.empty: functools.partial(new_array, False),
    np.zeros: functools.partial(new_array, True),
}
"""What returns the signature of a call, by the function called."""
