"""Translation of statements to LLVM's language, by numba's with shorter ways.

numba finds how an operation is translated anew at each place: by the types of its
operands, among all that it knows. Here fields of records and entries of vectors, by far
the most frequent, are translated at once, and what else is found, once.

Like `compiler`, this module was written from the sources of numba 0.59 to 0.68.
"""

from typing import Any

from numba import types
from numba.core import cgutils, ir, lowering
from numba.core.errors import new_error_context  # type: ignore[attr-defined]
from numba.np.arrayobj import record_getattr

from namlcp.compiled.functions import Translated

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

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """Translate an expression, fields of records at once; numba's interface."""
        if expr.op == "getattr":
            kind = self.typeof(expr.value.name)
            if isinstance(kind, types.Record):
                record = self.loadvar(expr.value.name)
                return record_getattr(
                    self.context, self.builder, kind, record, expr.attr
                )
        return super().lower_expr(resty, expr)

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

    def incref(self, kind: Any, value: Any) -> None:
        """Count a reference; numba's interface."""
        if self.context.data_model_manager[kind].contains_nrt_meminfo():
            super().incref(kind, value)

    def decref(self, kind: Any, value: Any) -> None:
        """Count one reference less; numba's interface."""
        if self.context.data_model_manager[kind].contains_nrt_meminfo():
            super().decref(kind, value)


def is_vector(kind: Any) -> bool:
    """Tell whether a type is that of a vector without gaps between its entries."""
    if not isinstance(kind, types.Array):
        return False
    return kind.ndim == 1 and kind.layout == "C" and kind.aligned
