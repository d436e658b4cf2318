"""Translation of statements to LLVM's language, by numba's with shorter ways.

numba finds how an operation is translated anew at each place: by the types of its
operands, among all that it knows. Here the most frequent are translated at once: fields
of records, entries of vectors, items of tuples and loops over `range`; what else is
found, is found once.

Like `compiler`, this module was written from the sources of numba 0.59 to 0.68.
"""

from typing import Any

from numba import types
from numba.core import cgutils, ir, lowering
from numba.core.errors import new_error_context  # type: ignore[attr-defined]
from numba.core.ir_utils import get_definition, guard
from numba.core.typing import signature as call_of

from namlcp.compiled.functions import Translated, iterator_of, next_of

FOUND: dict[tuple, Any] = {}
"""numba's type of an operator, by the operator and the types of the operands, if it has
been translated for these types before."""


class Lower(lowering.Lower):
    """numba's translation, without what it notes for errors and debuggers."""

    def lower_block(self, block: Any) -> None:
        """Translate the statements; numba's interface."""
        self.pre_block(block)
        with new_error_context("translating {name}", name=self.fndesc.qualname):
            for one in block.body:
                self.loc = one.loc
                self.lower_inst(one)
        self.post_block(block)

    def lower_inst(self, inst: Any) -> None:
        """Translate a statement; numba's interface.

        numba makes a text of each one, for its developers.
        """
        if isinstance(inst, ir.Assign):
            self.debuginfo.mark_location(self.builder, self.loc.line)
            name, value = inst.target.name, inst.value
            place = value.index + 1 if isinstance(value, ir.Arg) else None
            self.storevar(self.lower_assign(self.typeof(name), inst), name, place)
        elif not (isinstance(inst, ir.SetAttr) and self.is_set(inst)):
            super().lower_inst(inst)

    def is_set(self, inst: Any) -> bool:
        """Translate r.a = b for a record r; tell whether it is one."""
        kind = self.typeof(inst.target.name)
        if not isinstance(kind, types.Record):
            return False
        entry = kind.typeof(inst.attr)
        value = self._cast_var(inst.value, entry)
        values = self.loadvar(inst.target.name), value
        signature = call_of(types.void, kind, entry)
        field_of_record("set")(self.context, self.builder, signature, values, inst.attr)
        return True

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Translate an expression, the most frequent at once; numba's interface."""
        value = None
        if expr.op in SHORTER:
            kind, source = self.typeof(expr.value.name), self.loadvar(expr.value.name)
            value = SHORTER[expr.op](self, expr, kind, source)
        return super().lower_expr(resty, expr) if value is None else value

    def attribute(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate value.attr of records and named tuples, and an array's size."""
        if isinstance(kind, types.Record):
            read = field_of_record("get")
            return read(self.context, self.builder, kind, value, expr.attr)
        if isinstance(kind, types.BaseNamedTuple) and expr.attr in kind.fields:
            index = kind.fields.index(expr.attr)
            return self.part(kind[index], value, index)
        if type(kind) is types.Array and expr.attr in ARRAY_FIELDS:
            field = self.context.data_model_manager[kind].get_field_position
            return self.builder.extract_value(value, field(ARRAY_FIELDS[expr.attr]))
        return None

    def item(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate value[k] of tuples."""
        if not isinstance(kind, types.BaseTuple) or not isinstance(expr.index, int):
            return None
        index = range(len(kind))[expr.index]
        return self.part(kind[index], value, index)

    def iterator(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate the begin of a loop over a range of step 1."""
        if not isinstance(kind, types.RangeType):
            return None
        made = guard(get_definition, self.func_ir, expr.value)
        is_ours = isinstance(self.fndesc.calltypes.get(made), Translated)
        return iterator_of(self.builder, value) if is_ours else None

    def pair(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate the step of a loop over a range: a number and whether it is one."""
        is_range = isinstance(kind, types.RangeIteratorType)
        return next_of(self.builder, value) if is_range else None

    def first(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate what the step of any loop gives."""
        return self.part(kind.first_type, value, 0)

    def second(self, expr: Any, kind: Any, value: Any) -> Any:
        """Translate whether the loop goes on."""
        return self.part(kind.second_type, value, 1)

    def part(self, kind: Any, value: Any, index: int) -> Any:
        """Return the part of a value, of this type, with one more reference."""
        found = self.builder.extract_value(value, index)
        self.incref(kind, found)
        return found

    def lower_call(self, resty: Any, expr: Any) -> Any:
        """Translate a call, one of `functions` at once; numba's interface."""
        signature = self.fndesc.calltypes[expr]
        if not isinstance(signature, Translated):
            return super().lower_call(resty, expr)
        function = self.typeof(expr.func.name)
        values = self.fold_call_args(function, signature, expr.args, expr.vararg, ())
        value = signature.code(self.context, self.builder, signature, values)
        return self.context.cast(self.builder, value, signature.return_type, resty)

    def lower_binop(self, resty: Any, expr: Any, operator: Any) -> Any:
        """Translate an operation, in a known way if there is one; numba's interface."""
        signature = self.fndesc.calltypes[expr]
        if expr.static_lhs is not ir.UNDEFINED or expr.static_rhs is not ir.UNDEFINED:
            return super().lower_binop(resty, expr, operator)
        question = operator, signature.args
        if question not in FOUND:
            value = super().lower_binop(resty, expr, operator)
            FOUND[question] = self.context.typing_context.resolve_value_type(operator)
            return value
        implementation = self.context.get_function(FOUND[question], signature)
        values = [
            self._cast_var(operand, kind)
            for operand, kind in zip((expr.lhs, expr.rhs), signature.args, strict=True)
        ]
        value = implementation(self.builder, values)
        return self.context.cast(self.builder, value, signature.return_type, resty)

    def lower_getitem(
        self, resty: Any, expr: Any, value: Any, index: Any, signature: Any
    ) -> Any:
        """Translate a[i], of a vector at once; numba's interface."""
        place = self.entry(value, index)
        if place is None:
            return super().lower_getitem(resty, expr, value, index, signature)
        entry = self.typeof(value.name).dtype
        return self.context.unpack_value(self.builder, entry, place)

    def lower_setitem(
        self, target_var: Any, index_var: Any, value_var: Any, signature: Any
    ) -> Any:
        """Translate a[i] = b, of a vector at once; numba's interface."""
        place = self.entry(target_var, index_var)
        if place is None:
            return super().lower_setitem(target_var, index_var, value_var, signature)
        entry, kind = self.typeof(target_var.name).dtype, self.typeof(value_var.name)
        value = self.loadvar(value_var.name)
        value = self.context.cast(self.builder, value, kind, entry)
        return self.context.pack_value(self.builder, entry, value, place)

    def entry(self, array: Any, index: Any) -> Any:
        """Return the address of a vector's or pointer's entry; None for all others.

        numba finds the types of such an operation anew at each place, and unpacks all
        that describes the array.
        """
        kind, place = self.typeof(array.name), self.typeof(index.name)
        is_pointer = isinstance(kind, types.CPointer)
        if not (is_pointer or is_vector(kind)) or not isinstance(place, types.Integer):
            return None
        if not isinstance(kind.dtype, types.Number) or self.context.enable_boundscheck:
            return None
        builder, data = self.builder, self.loadvar(array.name)
        wide = types.intp if place.signed else types.uintp
        at = self.context.cast(builder, self.loadvar(index.name), place, wide)
        if not is_pointer:
            field = self.context.data_model_manager[kind].get_field_position
            if place.signed:
                size = builder.extract_value(data, [field("shape"), 0])
                from_end = builder.icmp_signed("<", at, at.type(0))
                at = builder.select(from_end, builder.add(at, size), at)
            data = builder.extract_value(data, field("data"))
        return builder.gep(data, [at])

    def alloca_lltype(self, name: str, lltype: Any, datamodel: Any = None) -> Any:
        """Return the memory of a variable; numba's interface."""
        return cgutils.alloca_once(self.builder, lltype, name=name, zfill=False)

    def storevar(self, value: Any, name: str, argidx: int | None = None) -> None:
        """Set a variable; numba's interface.

        numba reads its old value, for references, and asks LLVM for the size of an
        argument, for debuggers.
        """
        if self._disable_sroa_like_opt or self.is_counted(self.typeof(name)):
            super().storevar(value, name, argidx)
        elif name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(value, self.getvar(name))

    def incref(self, kind: Any, value: Any) -> None:
        """Count a reference; numba's interface."""
        if self.is_counted(kind):
            super().incref(kind, value)

    def decref(self, kind: Any, value: Any) -> None:
        """Count one reference less; numba's interface."""
        if self.is_counted(kind):
            super().decref(kind, value)

    def is_counted(self, kind: Any) -> bool:
        """Tell whether references are counted to what has this type."""
        if not self.context.enable_nrt:
            return False
        return self.context.data_model_manager[kind].contains_nrt_meminfo()


def field_of_record(way: str) -> Any:
    """Return numba's function that translates r.a ("get") or r.a = b ("set")."""
    from numba.np import arrayobj  # takes long: not where nothing is compiled

    return arrayobj.record_getattr if way == "get" else arrayobj.record_setattr


SHORTER = {
    "getattr": Lower.attribute,
    "static_getitem": Lower.item,
    "getiter": Lower.iterator,
    "iternext": Lower.pair,
    "pair_first": Lower.first,
    "pair_second": Lower.second,
}
"""What translates an expression at once, by its kind: a function of the translation,
the expression, and type and value of what it is about. None is left to numba."""

ARRAY_FIELDS = {"size": "nitems", "shape": "shape"}
"""Attributes of arrays that are kept with them, with numba's names."""


def is_vector(kind: Any) -> bool:
    """Tell whether a type is that of a vector without gaps between its entries."""
    if not isinstance(kind, types.Array):
        return False
    return kind.ndim == 1 and kind.layout == "C" and kind.aligned
