"""What a solve returns: a `QPResult` or an `LCPResult` without its methods."""

import cython

from namlcp.residuals import Residuals

new_tuple = tuple.__new__


class ResultBase:
    """How a solve ended, and the point; the attributes are those of `QPResult`."""

    def __init__(
        self, *, status, x, y, z, z_box, obj, residuals, iterations, form, message="",
        setup_time=0.0, solve_time=0.0, history=None, closest=None, problem=None,
        factors=None, stamp=None,
    ):  # fmt: skip
        self.status, self.x, self.y, self.z, self.z_box = status, x, y, z, z_box
        self.obj, self.iterations, self.form = obj, iterations, form
        self.message, self.history, self.closest = message, history, closest
        self.setup_time, self.solve_time = setup_time, solve_time
        self.problem, self.factors, self.stamp = problem, factors, stamp
        self.numbers = residuals._asdict()

    @property
    def residuals(self):
        """The `Residuals`, on the user's unscaled data."""
        r = self.numbers
        parts = (
            r.primal, r.dual, r.gap, r.primal_size, r.dual_size, r.gap_size, r.objective
        )  # fmt: skip
        return new_tuple(Residuals, parts)  # in half the time of Residuals(*parts)

    def summary(self):
        """Return how the solve ended, as a dict."""
        return {
            "status": self.status._value_,  # which is the value, without a descriptor
            "message": self.message or self.status.explanation,
            "iterations": self.iterations, "form": self.form,
            "residuals": self.residuals,
        }  # fmt: skip


class LCPResultBase:
    """How a solve ended, and the point; the attributes are those of `LCPResult`."""

    def __init__(
        self, *, status, z, w, s, iterations, residual, method, setup_time, solve_time,
        ray=None, message="", history=None, problem=None, stamp=None,
    ):  # fmt: skip
        self.status, self.z, self.w, self.s = status, z, w, s
        self.iterations, self.residual, self.method = iterations, residual, method
        self.setup_time, self.solve_time, self.ray = setup_time, solve_time, ray
        self.message, self.history, self.problem = message, history, problem
        self.stamp = stamp


def made(kind):
    """Return an object of a class, without attributes; `kind()` takes 0.2 us more."""
    of = cython.cast(cython.pointer(PyTypeObject), kind)
    make = cython.cast(newfunc, PyType_GetSlot(of, Py_tp_new))
    return make(of, (), cython.NULL)
