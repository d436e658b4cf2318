"""One table of problems through every door: what each answers, proves and refuses."""

from importlib.util import find_spec
from types import SimpleNamespace

import cvxpy as cp
import numpy as np
import pytest
import qpsolvers
import scipy.sparse as sp
from cases_qp import CASES as TABLE
from cvxpy.error import SolverError
from problems_qp import assert_certificate, assert_solves_qp, dense, make_qp
from qpsolvers import problems as host
from qpsolvers.exceptions import ParamError, ProblemError

import namlcp
from namlcp.cvxpy import NAM
from namlcp.stack import AXES, Stack

INF = np.inf
POINT = "x", "y", "z", "z_box"
TEXTBOOK = {  # every kind of constraint, each of them active somewhere
    "P": np.array([[4.0, 1.0, 0.0], [1.0, 3.0, 0.0], [0.0, 0.0, 2.0]]),
    "q": np.array([-1.0, -6.0, 1.0]),
    "G": np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]),
    "h": np.array([2.0, 1.5]),
    "A": np.array([[1.0, 1.0, 1.0]]),
    "b": np.array([1.0]),
    "lb": np.array([-5.0, -5.0, 0.1]),
    "ub": np.array([0.2, 5.0, 5.0]),
}


def changed(data=TEXTBOOK, **parts):
    """Return a problem with other parts, `name=(place, value)` for one entry."""
    data = dict(data)
    for name, part in parts.items():
        if isinstance(part, tuple):
            place, value = part
            part = data[name].copy()
            part[place] = value
        data[name] = part
    return data


def of_host(name):
    """Return a problem of qpsolvers and its solution, None where it gives none."""
    problem, solution = getattr(host, f"get_{name}")()
    names = "P", "q", "G", "h", "A", "b", "lb", "ub"
    data = dict(zip(names, problem.unpack(), strict=True))
    x = None if name == "qpsut03" else solution.x  # known to six digits
    return {k: v for k, v in data.items() if v is not None}, x


def of_table(name):
    """Return a small QP of `cases_qp` without the parts that are absent, and x."""
    (case,) = TABLE[name]
    parts = dense(case.qp)._asdict()
    bounds = {k: v for k in ("lb", "ub") if np.isfinite(v := parts.pop(k)).any()}
    parts = {k: v for k, v in parts.items() if v.size}
    return parts | bounds, case.status.value, case.x


CHAIN = np.vstack([np.eye(3, 4), np.ones((1, 4)), [[0.0, 0.0, 0.0, 1.0]]])
CASES = {
    **{name: (data, "solved", x) for name in (
        "qpsut01", "qpsut02", "qpsut03", "qpsut04", "qpsut05", "qptest", "qpgurdu",
        "qpgurabs", "qpgureq",
    ) for data, x in [of_host(name)]},
    **{name: of_table(name) for name in (
        "nothing but P", "dependent equations", "LP", "zero objective",
        "infinite and empty rows", "bounds that cross", "lb = inf", "ub = -inf",
        "h = -inf", "opposite rows", "repeated equations",
    )},
    "textbook": (TEXTBOOK, "solved", None),
    "equations contradict": ({
        "P": np.eye(4), "q": np.zeros(4), "A": CHAIN,
        "b": np.array([1.0, 1.0, 1.0, 4.0, 2.0]),
    }, "primal_infeasible", None),
    "a ray and no point": ({
        "P": np.zeros((4, 4)), "q": np.array([0.0, 0.0, 0.0, 1.0]),
        "G": np.array([[1.0, 1.0, 1.0, 0.0]]), "h": np.ones(1),
        "lb": np.array([1.0, 0.5, 0.0, -INF]),
    }, "primal_infeasible", None),
    "unbounded": (
        {"P": np.diag([1.0, 0.0]), "q": np.array([0.0, -1.0]), "lb": np.zeros(2)},
        "dual_infeasible", None,
    ),
    "unbounded, dense": ({
        "P": np.array([[1.0, -1.0, 0.0], [-1.0, 1.0, 0.0], [0.0, 0.0, 0.0]]),
        "q": -np.ones(3), "G": np.array([[-1.0, -1.0, 0.0]]), "h": np.zeros(1),
        "ub": np.array([INF, INF, 1.0]),
    }, "dual_infeasible", None),
}  # fmt: skip


# ---- the hosts: each returns status, the QP as it sees it, and its point


def answer(status, qp, point):
    """Return what the checks of `problems_qp` take."""
    if not isinstance(point, dict):
        point = {name: np.asarray(getattr(point, name)) for name in POINT}
    return SimpleNamespace(status=status, qp=qp, message="", **point)


def by_solve_qp(data, **settings):
    result = namlcp.solve_qp(**data, **settings)
    return answer(result.status, make_qp(**data), result)


def by_qpsolvers(data, **settings):
    problem = qpsolvers.Problem(**data)
    found = qpsolvers.solve_problem(problem, solver="nam", **settings)
    status = namlcp.Status(found.extras["status"])
    assert found.found == (status is namlcp.Status.SOLVED)
    if found.found:
        errors = [found.primal_residual(), found.dual_residual()]
        if np.isfinite(data.get("h", 0.0)).all():  # which the host multiplies by 0
            errors.append(found.duality_gap())
        assert max(errors) <= 1e-8
        point = {name: getattr(found, name) for name in POINT}
    else:
        nan = np.full(data["q"].size, np.nan)
        point = dict.fromkeys(POINT, nan) | found.extras.get("certificate", {})
    if "lb" not in data and "ub" not in data:
        point["z_box"] = np.zeros(data["q"].size)  # the host's is empty
    return answer(status, make_qp(**data), point)


def by_cvxpy(data, **settings):
    P, q = data["P"], data["q"]
    x = cp.Variable(q.size)
    cost = q @ x + (0.5 * cp.quad_form(x, cp.psd_wrap(P)) if np.any(P) else 0.0)
    rows = {
        "y": lambda: data["A"] @ x == data["b"],
        "z": lambda: data["G"] @ x <= data["h"],
        "ub": lambda: x <= data["ub"],
        "lb": lambda: x >= data["lb"],
    }
    given = {"y": "A", "z": "G"}
    rows = {k: row() for k, row in rows.items() if given.get(k, k) in data}
    problem = cp.Problem(cp.Minimize(cost), list(rows.values()))
    value = problem.solve(solver=NAM(), **settings)
    extra = problem.solver_stats.extra_stats
    status = namlcp.Status(extra["status"])
    if status is namlcp.Status.SOLVED:
        assert problem.status == "optimal"
        assert value == pytest.approx(problem.objective.value, abs=1e-8)
        dual = {k: np.ravel(row.dual_value) for k, row in rows.items()}
        box = dual.get("ub", 0.0) - dual.get("lb", np.zeros(q.size))
        point = {"x": x.value, "z_box": box}
        point |= {k: dual.get(k, np.empty(0)) for k in "yz"}
        return answer(status, make_qp(**data), point)
    words = {
        "primal_infeasible": ("infeasible", INF),
        "dual_infeasible": ("unbounded", -INF),
    }
    assert (problem.status, value) == words[status.value]
    assert x.value is None
    if "certificate" in extra and not cp.__version__.startswith(
        "1.8"
    ):  # it drops duals
        assert all(row.dual_value is not None for row in rows.values())
    parts = problem.get_problem_data(NAM())[0]  # what CVXPY hands over
    P, q, A, b, F, g = (parts[key] for key in ("P", "q", "A", "b", "F", "G"))
    point = {"x": np.full(q.size, np.nan), "z_box": np.zeros(q.size)}
    point |= extra.get("certificate", {}) | {"x": extra.get("ray", point["x"])}
    return answer(status, make_qp(P, q, F, g, A, b), point)


def arrays_of(data):
    return [
        v.toarray() if sp.issparse(v) else v for v in map(data.get, AXES)
    ]  # a stack has no sparse matrices


def of_layer(data, solution, is_solved):
    status = namlcp.Status.SOLVED if is_solved else None
    return answer(status, make_qp(**data), solution)


def by_stack(data, **settings):
    stack = Stack(arrays_of(data), settings)
    return of_layer(data, stack.solution, stack.solved)


def by_torch(data, **settings):
    import torch

    parts = [None if v is None else torch.tensor(v) for v in arrays_of(data)]
    found = namlcp.torch.solve_qp(*parts, **settings)
    return of_layer(data, found, bool(found.solved))


def by_jax(data, **settings):
    import jax

    with jax.enable_x64(True):
        parts = [None if v is None else jax.numpy.asarray(v) for v in arrays_of(data)]
        found = namlcp.jax.solve_qp(*parts, **settings)
        return of_layer(data, found, bool(found.solved))


HOSTS = {
    "solve_qp": by_solve_qp, "qpsolvers": by_qpsolvers, "cvxpy": by_cvxpy,
    "stack": by_stack, "torch": by_torch, "jax": by_jax,
}  # fmt: skip
LAYERS = "stack", "torch", "jax"  # which do not tell why an item is not solved
DOORS = [
    pytest.param(name, marks=pytest.mark.skipif(
        name in ("torch", "jax") and find_spec(name) is None, reason=f"no {name}"
    ))
    for name in HOSTS
]  # fmt: skip
every_door = pytest.mark.parametrize("door", DOORS)


@every_door
@pytest.mark.parametrize("name", CASES)
def test_every_problem_through_every_door(name, door):
    data, status, x = CASES[name]
    before = {key: value.copy() for key, value in data.items()}
    found = HOSTS[door](data)
    for one, other in zip(arrays_of(data), arrays_of(before), strict=True):
        np.testing.assert_array_equal(one, other)
    if status == "solved":
        assert_solves_qp(found.qp, found, 1e-8)
        if x is not None:
            np.testing.assert_allclose(found.x, x, atol=1e-8)
    elif door in LAYERS:
        assert found.status is None
        assert np.isnan(found.x).all()
    else:
        assert found.status.value == status
        assert_certificate(found.qp, found)


# as `test_inputs` has more of them for `solve_qp`
REFUSED = [
    ({"h": np.ones(3)}, r"h must have shape \(2,\) to match G of shape \(2, 3\)"),
    ({"q": np.array([1j, 0, 0])}, "q must be an array of real numbers"),
]


@pytest.mark.parametrize(("change", "text"), REFUSED)
def test_malformed_problems_are_named(change, text):
    with pytest.raises(ProblemError, match=text):
        by_qpsolvers(changed(**change))


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("n", [2, 101])
@every_door
def test_negative_curvature_is_refused_at_any_scale(scale, n, door):
    P = scale * np.diag(np.append(np.ones(n - 1), -1e-3))
    data = {"P": P, "q": np.zeros(n), "lb": -np.ones(n), "ub": np.ones(n)}
    own = {"qpsolvers": ProblemError, "cvxpy": SolverError, "jax": RuntimeError}
    error = own.get(door, ValueError)
    with pytest.raises(error, match="P must be positive semidefinite"):
        HOSTS[door](data)
    if door == "qpsolvers":
        with pytest.raises(error, match="positive semidefinite"):
            by_qpsolvers(data | {"P": sp.csc_matrix(P)})


SETTINGS = [
    ({"maxiter": 3}, "unknown option 'maxiter'; did you mean 'max_iter'"),
    ({"polish": True}, "unknown option 'polish'; known: "),
    ({"eps_abs": -1.0}, "eps_abs must be >= 0, got -1.0"),
    ({"eps_abs": 0.0, "eps_rel": 0.0}, "must not both be 0"),
    ({"max_iter": 1.5}, "max_iter must be an integer, got 1.5"),
]


@pytest.mark.parametrize(("settings", "text"), SETTINGS)
@every_door
def test_bad_settings_are_named(settings, text, door):
    own = {"qpsolvers": ParamError, "jax": RuntimeError}  # jax wraps what is raised
    error = own.get(door, (TypeError, ValueError))
    with pytest.raises(error, match=text):
        HOSTS[door](TEXTBOOK, **settings)


@every_door
def test_nothing_is_printed_unless_asked(capsys, door):
    HOSTS[door](TEXTBOOK)
    assert capsys.readouterr() == ("", "")
    HOSTS[door](TEXTBOOK, **{"solver_verbose" if door == "cvxpy" else "verbose": True})
    lines = capsys.readouterr().out.splitlines()
    first = [line.startswith("namlcp  QP: n = 3") for line in lines].index(True)
    assert first == 0 or door == "cvxpy"  # which says more around it
    assert any(line.startswith("solved: ") for line in lines)
    assert max(map(len, lines)) <= 79
