"""numba's private parts, except its compiler: a cache, dispatchers, views of arrays.

With `cache=True` numba notices changes of the one file that defines a function, but not
of a callee in another file. A dispatcher asks its `_cache` for the machine code of each
signature; here that is a `Store`, whose files hold what numba would write, less what
makes loading slow.

This module was written from the sources of numba 0.59 to 0.68; with another version it
is not imported, see `decorators`.
"""

import contextlib
import functools
import hashlib
import pickle
import sys
import time
from collections.abc import Callable
from importlib.machinery import EXTENSION_SUFFIXES
from typing import Any

import llvmlite
import numba
import numpy as np
from llvmlite import binding
from numba import from_dtype, types
from numba.core import cgutils, codegen, compiler, config, event, serialize
from numba.core.runtime import rtsys
from numba.extending import intrinsic

from namlcp.compiled.compiler import KernelCompiler, PartCompiler
from namlcp.compiled.sources import are_unchanged, is_unchanged, stamp
from namlcp.compiled.store import SUFFIX, folders

SETTINGS = (
    "OPT BOUNDSCHECK DEBUGINFO_DEFAULT DISABLE_INTEL_SVML ENABLE_PROFILING "
    "LLVM_REFPRUNE_FLAGS LLVM_REFPRUNE_PASS LOOP_VECTORIZE NRT_STATS SLP_VECTORIZE "
    "USE_LLVMLITE_MEMORY_MANAGER USING_SVML"
).split()
"""Settings of numba that the machine code depends on."""


# ---- files


def environment() -> tuple:
    """Return what all machine code depends on, except the processor."""
    return (
        stamp(),
        sys.implementation.cache_tag,
        EXTENSION_SUFFIXES[0],
        numba.__version__,
        llvmlite.__version__,
        np.__version__.split(".")[:2],
        [str(getattr(config, name, None)) for name in SETTINGS],
    )


class Store:
    """The `_cache` of a dispatcher, in place of numba's `FunctionCache`.

    `name` is what `decorators.name_of` returns. Machine code is kept in files unless
    the module has changed since the stamp was taken.
    """

    cache_path = None

    def __init__(self, function: Callable[..., Any], name: str):
        self.name = name
        self.code = function.__code__.co_code
        file = function.__code__.co_filename
        self.keeps = is_unchanged(function.__module__, file)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled function from a file, None if there is none."""
        # numba's own cache refreshes the typing context here, which takes 0.17 s; the
        # compiler does that anyway when it is needed.
        rtsys.initialize(context)
        if not (self.keeps and were_unchanged()):
            return None
        key = self.key(signature, context.codegen().magic_tuple())
        for folder in folders():
            payload = folder.read(self.file(key))
            result = None if payload is None else rebuilt(payload, key, context)
            if result is not None:
                return result
        return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Set the constants of a compiled function's parts, and write it to a file."""
        for inside in result._find_referenced_environments():
            result.library.codegen.set_env(inside.env_name, inside)
        holds_addresses = result.lifted or result.library.has_dynamic_globals
        if not self.keeps or holds_addresses or not are_unchanged():
            return
        with contextlib.suppress(Exception):  # the kernel works without a file
            key = self.key(signature, result.library.codegen.magic_tuple())
            payload = serialize.dumps((key, reduced(result)))
            any(folder.write(self.file(key), payload) for folder in folders())

    def key(self, signature: Any, processor: tuple) -> bytes:
        """Return everything that this machine code depends on, as bytes."""
        parts = (self.name, self.code, str(signature), processor, environment())
        return repr(parts).encode()

    def file(self, key: bytes) -> str:
        """Return the name of the file for a key."""
        return f"{self.name}-{hashlib.sha256(key).hexdigest()[:32]}{SUFFIX}"

    def is_at_hand(self) -> bool:
        """Tell whether there is a file for this kernel, of any signature."""
        where = folders() if self.keeps else []
        return any(folder.has(f"{self.name}-") for folder in where)

    def enable(self) -> None:
        """Do nothing; numba's interface."""

    disable = flush = enable


@functools.cache
def were_unchanged() -> bool:
    """Tell whether the stamp was still true when the first kernel was looked for."""
    return are_unchanged()


def reduced(result: Any) -> tuple:
    """Return a compiled function as a tuple that can be pickled; clear its type maps.

    Of the environments of all functions inside, a hundred in a large kernel, only those
    with constants are needed.
    """
    library = result.library
    environments = result._find_referenced_environments()
    bitcode = library._get_module_for_linking().as_bitcode()
    result.fndesc.typemap = result.fndesc.calltypes = None
    return (
        (library.name, library._get_compiled_object(), bitcode),
        result.fndesc,
        result.environment,
        result.signature,
        tuple(result.reload_init),
        tuple(e for e in environments if e.consts),
    )


def rebuilt(payload: bytes, key: bytes, context: Any) -> Any:
    """Return the compiled function of a file; None if broken or of another key."""
    try:
        saved, parts = pickle.loads(payload)
        if saved != key:
            return None
        code, description, own, signature, at_load, environments = parts
        for prepare in at_load:
            prepare()
        library = LoadedLibrary(context.codegen(), code[0])
        library.load(*code[1:])
        entry = context.get_executable(library, description, own)
        for inside in environments:
            library.codegen.set_env(inside.env_name, inside)
    except Exception:
        return None
    return compiler.compile_result(
        target_context=context,
        typing_context=context.typing_context,
        library=library,
        environment=own,
        entry_point=entry,
        fndesc=description,
        type_annotation="",
        signature=signature,
        objectmode=False,
        lifted=(),
        reload_init=list(at_load),
        referenced_envs=environments,
    )


class LoadedLibrary(codegen.JITCodeLibrary):
    """Machine code from a file; its bitcode is parsed when another kernel links it."""

    _shared_module: Any

    def load(self, machine_code: bytes, bitcode: bytes) -> None:
        """Load the machine code into this process."""
        self.bitcode = bitcode
        self.enable_object_caching()
        self._set_compiled_object(machine_code)
        self._finalize_final_module()

    def get_pointer_to_function(self, name: str) -> int:
        """Return the address of a function; numba's interface."""
        return self._codegen._engine.get_function_address(name)

    def _get_module_for_linking(self) -> Any:
        if self._shared_module is None:
            self._shared_module = binding.parse_bitcode(self.bitcode)
            self._codegen._engine._load_defined_symbols(self._shared_module)
        return self._shared_module


# ---- dispatchers


def dispatcher_of(
    function: Callable[..., Any],
    name: str,
    is_part: bool,
    is_kernel: bool,
    **options: Any,
) -> Any:
    """Return the dispatcher of a kernel, of a part, or of what is pasted."""
    pipeline = PartCompiler if is_part else KernelCompiler
    dispatcher = numba.njit(pipeline_class=pipeline, **options)(function)
    if is_kernel:
        dispatcher._cache = Store(function, name)
    if is_part:
        # A part has no entry point that Python could call.
        dispatcher._insert = lambda *_: None
        dispatcher._compile_for_args = functools.partial(refuse_call, name)
    return dispatcher


def refuse_call(name: str, *_: Any) -> None:
    """Raise where Python calls a part."""
    raise TypeError(f"{name} is called by compiled functions alone, see its py_func")


class Clock(event.Listener):
    """Adds up the seconds that numba takes to compile functions of this package."""

    def __init__(self) -> None:
        self.total, self.depth, self.since = 0.0, 0, 0.0

    def on_start(self, compiling: Any) -> None:
        """Start at the outermost function of the package; numba's interface."""
        if is_ours(compiling):
            if self.depth == 0:
                self.since = time.perf_counter()
            self.depth += 1

    def on_end(self, compiling: Any) -> None:
        """Stop at its end; numba's interface."""
        if is_ours(compiling):
            self.depth -= 1
            if self.depth == 0:
                self.total += time.perf_counter() - self.since


def is_ours(compiling: Any) -> bool:
    """Tell whether the function being compiled belongs to this package."""
    # Functions made by `exec` may have None as their module.
    return (compiling.data["dispatcher"].__module__ or "").startswith("namlcp.")


CLOCK = Clock()
event.register("numba:compile", CLOCK)


# ---- views of arrays


@intrinsic
def entries(typingctx: Any, array: Any) -> Any:
    """Return the pointer to the entries of a contiguous array of numbers."""

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return context.make_array(array)(context, builder, arguments[0]).data

    return types.CPointer(array.dtype)(array), codegen


def arrays_at(kind: type) -> Any:
    """Return the compiled function of (address, shape) for the array in memory there.

    A record of addresses is one argument of a compiled function, where every array
    counts as seven: this halves the time of compilation, and of a call from Python. The
    caller of the kernel must keep the memory alive.
    """
    entry = from_dtype(np.dtype(kind))
    width = np.dtype(kind).itemsize

    @intrinsic
    def at(typingctx: Any, address: Any, shape: Any) -> Any:
        is_vector = isinstance(shape, types.Integer)
        order = 1 if is_vector else len(shape)
        array = types.Array(entry, order, "C")
        lengths = types.int64 if is_vector else types.UniTuple(types.int64, order)

        def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            found = context.make_array(array)(context, builder)
            found.data = builder.inttoptr(arguments[0], found.data.type)
            sizes = [arguments[1]]
            if not is_vector:
                sizes = cgutils.unpack_tuple(builder, arguments[1])
            found.itemsize = step = context.get_constant(types.intp, width)
            found.nitems = context.get_constant(types.intp, 1)
            strides: list[Any] = []
            for size in reversed(sizes):
                strides.insert(0, step)
                step = builder.mul(step, size)
                found.nitems = builder.mul(found.nitems, size)
            found.shape = cgutils.pack_array(builder, sizes)
            found.strides = cgutils.pack_array(builder, strides)
            found.meminfo = cgutils.get_null_value(found.meminfo.type)
            found.parent = cgutils.get_null_value(found.parent.type)
            return found._getvalue()

        return array(types.int64, lengths), codegen

    return at
