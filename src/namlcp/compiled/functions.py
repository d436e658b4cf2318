"""max, min, range and new arrays in compiled functions, typed and translated here.

numba compiles most of them as functions of its own, anew for each set of types: a tenth
of a second each with all that surrounds them, though three instructions would do. What
is not foreseen here, such as the largest entry of a tuple, is left to numba.

Like `compiler`, this module was written from the sources of numba 0.59 to 0.68.
"""

import functools
from collections.abc import Callable
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import Signature

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


# ---- loops over range

RANGES = {
    types.int32: types.range_state32_type,
    types.int64: types.range_state64_type,
}
"""numba's types of ranges, by those of their numbers."""


def loop(context: Any, args: tuple, kws: dict) -> Any:
    """Return the signature of range(stop) or range(start, stop)."""
    kinds = tuple(map(types.unliteral, args))
    kind = context.unify_types(types.int32, *kinds)
    if kws or len(kinds) not in (1, 2) or kind not in RANGES:
        return None
    return Translated(range_of, RANGES[kind], *(kind for _ in kinds))


def range_of(context: Any, builder: Any, signature: Any, values: list) -> Any:
    """Return a range: where it starts and stops, and the step, which is 1."""
    *start, stop = values
    first = start[0] if start else stop.type(0)
    return cgutils.make_anonymous_struct(builder, [first, stop, stop.type(1)])


def iterator_of(builder: Any, numbers: Any) -> Any:
    """Return an iterator over a range of step 1.

    The next number and how many are left are kept in memory, as numba keeps them. It
    finds how many by a division and four branches, which LLVM has to remove again.
    """
    start, stop, step = cgutils.unpack_tuple(builder, numbers)
    place = cgutils.alloca_once_value(builder, start)
    left = cgutils.alloca_once_value(builder, builder.sub(stop, start))
    return cgutils.make_anonymous_struct(builder, [place, stop, step, left])


def next_of(builder: Any, iterator: Any) -> Any:
    """Return the next number of an iterator over a range, and whether there is one."""
    place, _, step, left = cgutils.unpack_tuple(builder, iterator)
    value, count = builder.load(place), builder.load(left)
    is_inside = builder.icmp_signed(">", count, count.type(0))
    with builder.if_then(is_inside):
        builder.store(builder.sub(count, count.type(1), flags=["nsw"]), left)
        builder.store(builder.add(value, step), place)
    return cgutils.make_anonymous_struct(builder, [value, is_inside])


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
    from numba.np import arrayobj  # takes long: not where nothing is compiled

    sizes = arrayobj._parse_shape(context, builder, signature.args[0], values[0])
    array = arrayobj._empty_nd_impl(context, builder, signature.return_type, sizes)
    if is_zero:
        size = builder.mul(array.itemsize, array.nitems)
        cgutils.memset(builder, array.data, size, 0)
    return array._getvalue()


FUNCTIONS: dict[Any, Callable[..., Any]] = {
    max: functools.partial(extreme, ">"),
    min: functools.partial(extreme, "<"),
    range: loop,
    np.empty: functools.partial(new_array, False),
    np.zeros: functools.partial(new_array, True),
}
"""What returns the signature of a call, by the function called."""
