"""Views of arrays without a reference count, for the NamedTuples of a kernel."""

from numba import config
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def view(typingctx, array):
    """Return a view of an array that does not keep it alive.

    Whenever one compiled function passes a tuple to another, numba counts references of
    every array in it, which takes longer than the work of a small kernel. These views
    are not counted; the caller of the kernel must keep the array alive.
    """

    def codegen(context, builder, signature, arguments):
        found = context.make_array(array)(context, builder, arguments[0])
        found.meminfo = cgutils.get_null_value(found.meminfo.type)
        found.parent = cgutils.get_null_value(found.parent.type)
        return found._getvalue()

    return array(array), codegen


def interpreted_view(array):
    """Return the array itself, where nothing is compiled."""
    return array


uncounted = interpreted_view if config.DISABLE_JIT else view
