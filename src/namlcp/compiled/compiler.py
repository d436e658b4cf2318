"""numba's compiler, less what the functions of this package do not need.

A kernel is called from Python and has machine code of its own. A part is called by
compiled functions alone: its LLVM code is linked into each kernel that calls it and
optimised again there, so that machine code of its own is not made.

Two thirds of the time is numba's own translation, from Python to LLVM. Passes are left
out that prepare what no kernel has (closures, `with`, lists of several types), and the
type of an operation is found once per process, not at each place and each of the three
or more visits that numba pays to it until all types are known.

Like `internals`, this module was written from the sources of numba 0.59 to 0.68.
"""

import contextlib
import gc
import operator
from collections.abc import Callable, Iterator
from typing import Any

from numba import types
from numba.core import codegen, compiler

from namlcp.compiled.functions import translated
from namlcp.compiled.passes import Passes

PLAIN = (
    types.Number,
    types.Boolean,
    types.CPointer,
    types.Array,
    types.Record,
    types.BaseTuple,
)
"""Types of arguments for which what an operation returns depends on nothing else."""

RETURNED: dict[str, dict[tuple, Any]] = {}
"""Types of operations and attributes, by the compiler's flags, and by what is asked."""


class Remembering:
    """numba's typing context, which remembers what operations return."""

    def __init__(self, context: Any, flags: Any):
        self.context = context
        # what is compiled for an operation, such as a division, depends on the flags
        self.returned = RETURNED.setdefault(flags.summary(), {})

    def __getattr__(self, name: str) -> Any:
        """Return the attribute of the typing context."""
        return getattr(self.context, name)

    def resolve_function_type(self, function: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call; numba's interface."""
        resolve = self.context.resolve_function_type
        if isinstance(function, types.Dispatcher):
            # one part for all constants: numba would make one for each integer
            return resolve(function, tuple(map(types.unliteral, args)), kws)
        answer = translated(self.context, function, args, kws)
        if answer is not None:
            return answer
        bound = isinstance(function, types.BoundFunction)
        if bound or kws or not all(isinstance(kind, PLAIN) for kind in args):
            return resolve(function, args, kws)
        call = function, *args
        return self.remembered(call, lambda: resolve(function, args, kws))

    def resolve_getattr(self, kind: Any, name: str) -> Any:
        """Return the type of an attribute; numba's interface."""
        resolve = self.context.resolve_getattr
        if not isinstance(kind, types.Record):
            return resolve(kind, name)
        return self.remembered((kind, name), lambda: resolve(kind, name))

    def resolve_setitem(self, target: Any, index: Any, value: Any) -> Any:
        """Return the signature of an assignment to an entry; numba's interface."""
        resolve = self.context.resolve_setitem
        call = operator.setitem, target, index, value
        return self.remembered(call, lambda: resolve(target, index, value))

    def remembered(self, question: tuple, find: Callable[[], Any]) -> Any:
        """Return what `find` returns the first time that it is not None."""
        answer = self.returned.get(question)
        if answer is None:
            answer = find()
            if answer is not None:
                self.returned[question] = answer
        return answer


class KernelLibrary(codegen.JITCodeLibrary):
    """The code of a kernel.

    numba optimises each function alone, and then all functions of a kernel together.
    The wrapper that unpacks Python's arguments skips the first of these.
    """

    def _optimize_functions(self, module: Any) -> None:
        if module.name == "wrapper":
            module.data_layout = self._codegen._data_layout
        else:
            super()._optimize_functions(module)


class PartLibrary(KernelLibrary):
    """The code of a part, for kernels to link; it gets no machine code of its own."""

    @property
    def codegen(self) -> Any:
        """The code generator, with a `set_env` that does nothing."""
        return NoEnvironment(self._codegen)

    def get_pointer_to_function(self, name: str) -> int:
        """Return 0: there is no machine code."""
        self._ensure_finalized()
        return 0

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalize_dynamic_globals()
        self._verify_declare_only_symbols()
        self._finalized = True


class KernelCompiler(compiler.Compiler):
    """numba's compiler into a `KernelLibrary`, without the garbage collector.

    Compiling makes millions of small objects that live until its end; the collector
    would take a tenth of the time to visit them again and again.
    """

    library: type[KernelLibrary] = KernelLibrary

    def define_pipelines(self) -> list[Any]:
        """Return the needed ones of numba's passes, once."""
        pipelines = super().define_pipelines()
        for passes in pipelines:
            Passes.take(passes)
        return pipelines

    def compile_extra(self, function: Callable[..., Any]) -> Any:
        """Compile; numba's interface."""
        state = self.state
        state.typingctx = Remembering(state.typingctx, state.flags)
        if state.library is None:
            target = state.targetctx.codegen()
            state.library = self.library(target, function.__qualname__)
            state.library.enable_object_caching()
        with without_collector():
            return super().compile_extra(function)


class PartCompiler(KernelCompiler):
    """The compiler of parts."""

    library = PartLibrary


class NoEnvironment:
    """A code generator for parts, whose environments `Store.save_overload` sets."""

    def __init__(self, target: Any):
        self.target = target

    def __getattr__(self, name: str) -> Any:
        """Return the attribute of the code generator."""
        return getattr(self.target, name)

    def set_env(self, name: str, environment: Any) -> None:
        """Do nothing."""


@contextlib.contextmanager
def without_collector() -> Iterator[None]:
    """Switch the garbage collector off in the block."""
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if was_on:
            gc.enable()
