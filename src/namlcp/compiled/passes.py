"""numba's passes over a function, less what they do for others than our kernels.

numba describes the lives of all variables anew in each pass, for generators and object
mode, and for the statements that delete variables; those count references. Here lives
are computed once, and only what holds a reference to memory is deleted: an array, or a
tuple of arrays, but no number, pointer or record.

Like `compiler`, this module was written from the sources of numba 0.59 to 0.68.
"""

from typing import Any

from numba.core import compiler_machinery, ir
from numba.core.ir_utils import build_definitions, check_and_legalize_ir
from numba.core.rewrites import rewrite_registry
from numba.core.ssa import reconstruct_ssa
from numba.core.typed_passes import IRLegalization, NativeLowering, PreLowerStripPhis
from numba.core.untyped_passes import GenericRewrites, ReconstructSSA

from namlcp.compiled.lowering import Lower

UNUSED = frozenset(
    "IRProcessing WithLifting InlineClosureLikes RewriteSemanticConstants "
    "RewriteDynamicRaises MakeFunctionToJitFunction FindLiterallyCalls LiteralUnroll "
    "LiteralPropagationSubPipelinePass InlineOverloads NopythonRewrites "
    "NoPythonSupportedFeatureValidation AnnotateTypes DumpParforDiagnostics".split()
)
"""Names of the passes left out. A function that needs one fails when it is compiled;
whole-array expressions (NopythonRewrites) are evaluated term by term instead."""

PASSED_ON = frozenset(
    "build_tuple cast exhaust_iter getattr getiter iternext pair_first pair_second phi "
    "static_getitem".split()
)
"""Operations that return no references but those that they are given."""


class Rewrites(GenericRewrites):
    """Rewriting of what depends on constants, such as the items of a tuple."""

    def run_pass(self, state: Any) -> bool:
        """Apply each rule to each block as often as it matches."""
        blocks = state.func_ir.blocks
        for rule_class in rewrite_registry.rewrites["before-inference"]:
            rule = rule_class(state)
            for key, block in blocks.items():
                while rule.match(state.func_ir, block, None, None):
                    blocks[key] = block = rule.apply()
        return True


class SingleAssignments(ReconstructSSA):
    """Renaming of variables, so that each has one definition."""

    def run_pass(self, state: Any) -> bool:
        """Rename them."""
        state.func_ir = reconstruct_ssa(state.func_ir)
        self._patch_locals(state)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


class Merges(PreLowerStripPhis):
    """Assignments in place of what merges the definitions of a variable."""

    def run_pass(self, state: Any) -> bool:
        """Replace the merges."""
        state.func_ir = self._strip_phi_nodes(state.func_ir)
        state.func_ir._definitions = build_definitions(state.func_ir.blocks)
        return True


class References(IRLegalization):
    """The choice whether references are counted, and deletions where they are.

    What a function is given, its caller keeps alive. So a function counts references
    only if it makes arrays, gets them from another one, returns or copies them.
    """

    def run_pass(self, state: Any) -> bool:
        """Delete variables with references after their last use, or count none."""
        if self.are_needed(state):
            check_and_legalize_ir(state.func_ir, flags=state.flags)
            for block in state.func_ir.blocks.values():
                block.body = [
                    one
                    for one in block.body
                    if not isinstance(one, ir.Del) or self.has(state, one.value)
                ]
        else:
            state.flags.nrt = False
            state.targetctx = state.targetctx.subtarget(enable_nrt=False)
            vars(state.targetctx).pop("nrt", None)  # kept from before
        return True

    def are_needed(self, state: Any) -> bool:
        """Tell whether the function must count references."""
        models = state.targetctx.data_model_manager
        if models[state.return_type].contains_nrt_meminfo():
            return True
        for block in state.func_ir.blocks.values():
            for one in block.body:
                if isinstance(one, ir.Assign) and isinstance(one.value, ir.Expr):
                    made = one.value.op not in PASSED_ON and one.target
                else:  # arrays are copied into others, by way of memory of their own
                    made = isinstance(one, ir.SetItem | ir.StaticSetItem) and one.value
                if made and self.has(state, made.name):
                    return True
        return False

    def has(self, state: Any, name: str) -> bool:
        """Tell whether a variable holds references."""
        kind = state.typemap[name]
        return state.targetctx.data_model_manager[kind].contains_nrt_meminfo()


class Lowering(NativeLowering):
    """Translation to LLVM's language by `Lower`."""

    lowering_class = property(lambda _: Lower)


OWN = {
    "GenericRewrites": Rewrites(),
    "ReconstructSSA": SingleAssignments(),
    "PreLowerStripPhis": Merges(),
    "IRLegalization": References(),
    "NativeLowering": Lowering(),
}
"""Our passes, by the name of the class of numba's."""


class Passes(compiler_machinery.PassManager):
    """The passes of a compilation, which tell nobody that they run.

    numba's own make a text of all types of arguments for that, at each pass.
    """

    def _runPass(self, index: int, one: Any, state: Any) -> None:
        one = OWN.get(type(one).__name__, one)
        one.analysis = self._analysis
        one.run_initialization(state)
        one.run_pass(state)
        one.run_finalizer(state)

    @classmethod
    def take(cls, passes: compiler_machinery.PassManager) -> None:
        """Turn numba's passes into these: without the unused ones, and each once."""
        passes.__class__ = cls
        kept = (pair for pair in passes.passes if pair[0].__name__ not in UNUSED)
        passes.passes = list(dict(kept).items())
