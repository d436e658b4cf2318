"""Views of arrays without a reference count, for the NamedTuples of a kernel."""

from numba import config
from numba.core import cgutils
from numba.extending import intrinsic


@intrinsic
def view(typingctx, array):
    """Return a view of an array that does not keep it alive.

    numba counts the references of every array of a tuple whenever one compiled function
    hands it to another, which costs small kernels more than their work. These views
    have no count. They may be used as long as the caller of the kernel has the array.
    """

    def codegen(context, builder, signature, arguments):
        found = context.make_array(array)(context, builder, arguments[0])
        found.meminfo = cgutils.get_null_value(found.meminfo.type)
        found.parent = cgutils.get_null_value(found.parent.type)
        return found._getvalue()

    return array(array), codegen


def interpreted_view(array):
    """Return the array where nothing is compiled."""
    return array


uncounted = interpreted_view if config.DISABLE_JIT else view
