"""What the caller hands over stays as it is, nothing is printed, no warning is given.

Every message that refuses an argument is tested by its text.
"""

import socket
import subprocess
import sys
from decimal import Decimal
from fractions import Fraction
from itertools import islice

import numpy as np
import pytest
import qpsolvers
from problems_qp import complementary
from qpsolvers.exceptions import QPError
from scipy import sparse

from namlcp import (
    Prepared,
    Solver,
    converges,
    is_h_plus,
    solve_batch,
    solve_lcp,
    solve_qp,
)
from namlcp.scenes.friction import Bodies, Contacts, Scene, friction_lcp


def image(value):
    """Return all bytes of an argument, and its flags; the object where it is none."""
    if isinstance(value, np.ndarray):
        return value.tobytes(), value.strides, str(value.flags), value.dtype.str
    if sparse.issparse(value):
        state = vars(value).items()  # without what SciPy found out about it
        return {k: image(part) for k, part in state if k[:5] != "_has_"}, type(value)
    if isinstance(value, tuple | list):
        return [image(part) for part in value]
    return repr(value)


def forms(array):
    """Yield the same numbers in the shapes and kinds that people bring."""
    yield array
    yield np.asfortranarray(array)
    locked = array.copy()
    locked.flags.writeable = False
    yield locked
    yield np.ma.array(array)
    yield objects(array, Fraction)
    if array.ndim == 2:
        for kind in (
            sparse.csr_array, sparse.csc_array, sparse.coo_array, sparse.lil_array,
            sparse.dok_array, sparse.csr_matrix, sparse.csc_matrix, sparse.coo_matrix,
        ):  # fmt: skip
            yield kind(array)
        yield unsorted(array)


def objects(array, kind):
    """Return an array of objects of this kind."""
    parts = [kind(v) for v in array.ravel().tolist()]
    return np.array(parts, object).reshape(array.shape)


def unsorted(array):
    """Return a CSC matrix with unsorted and repeated entries."""
    once = sparse.csc_array(array)
    data, indices = (
        np.concatenate([np.tile(c[::-1], 2) for c in np.split(v, once.indptr[1:-1])])
        for v in (once.data / 2, once.indices)
    )
    return sparse.csc_array((data, indices, 2 * once.indptr), shape=array.shape)


def small_qp():
    """Return all arguments of a QP, dense."""
    qp = complementary(5, 6, 5, 2, 6).qp
    return [part.toarray() if sparse.issparse(part) else part for part in qp]


@pytest.mark.parametrize("place", [0, 2, 4])
def test_a_qp_stays_as_it_is(place, capfd):
    expected = solve_qp(*small_qp()).x
    for form in forms(small_qp()[place]):
        data = small_qp()
        data[place] = form
        before = image(data)
        result = solve_qp(*data, x0=expected)
        again = solve_qp(*data, warm_start=result)
        assert image(data) == before, type(form)
        np.testing.assert_allclose(again.x, expected, atol=1e-6)
    assert capfd.readouterr() == ("", "")


def test_an_infeasible_and_a_sparse_qp_stay_as_they_are(capfd):
    qp = list(complementary(3, 120, 90, 10, 40, 0.02).qp)
    before = image(qp)
    assert solve_qp(*qp).form == "path"
    assert image(qp) == before
    qp[3] = qp[3] - 1e3
    before = image(qp)
    solve_qp(*qp)
    assert image(qp) == before
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    "options",
    [
        {}, {"method": "psor"}, {"method": "namsor", "alpha": "auto"},
        {"method": "modulus"}, {"method": "nam"}, {"method": "multigrid"},
    ],
)  # fmt: skip
def test_an_lcp_stays_as_it_is(options, capfd):
    n = 40
    A = 2.5 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
    q, lower, upper = np.cos(np.arange(40.0)), np.zeros(n), np.full(n, 2.0)
    for form in forms(A):
        if options.get("method") == "multigrid" and not sparse.issparse(form):
            continue
        data = [form, q, lower, upper, np.ones(n)]
        before = image(data)
        solve_lcp(*data[:4], z0=data[4], **options)
        assert image(data) == before, type(form)
    assert capfd.readouterr() == ("", "")


def test_theory_and_preparation_leave_the_matrix_alone(capfd):
    A = np.array([[2.0, -1.0], [-1.0, 2.0]])
    for form in forms(A):
        before = image(form)
        solve_lcp(Prepared(form), np.ones(2))
        assert converges(form, "pgs").answer
        assert is_h_plus(form).answer
        assert image(form) == before
    assert capfd.readouterr() == ("", "")


# ---- what is refused, and in which words

EYE, ONE = np.eye(2), np.ones(2)
V, T = ValueError, TypeError
ROW = np.ones((1, 2))
ENDLESS = np.broadcast_to(1.0, (50_000, 50_000))
QP_REFUSALS = [
    ((ONE, ONE), {}, V, r"P must be square, got shape \(2,\)"),
    ((EYE, np.ones(3)), {}, V,
     r"q must have shape \(2,\) to match P of shape \(2, 2\), got \(3,\)"),
    ((EYE, ONE, ROW, ONE), {}, V,
     r"h must have shape \(1,\) to match G of shape \(1, 2\), got \(2,\)"),
    ((EYE, ONE, np.ones((1, 3)), ONE[:1]), {}, V,
     r"G must have 2 columns to match q of shape \(2,\), got \(1, 3\)"),
    ((sparse.csc_array(EYE), ONE, ROW), {}, V, "G was given without h: pass both"),
    ((EYE, ONE, None, None, None, ONE[:1]), {}, V,
     "b was given without A: pass both or neither"),
    ((np.array([[1.0, 2.0], [0.5, 1.0]]), ONE), {}, V,
     r"P must be symmetric: max \|P - P'\| = 1\.5e\+00; pass \(P \+ P\.T\) / 2"),
    ((np.array([[1.0, 1e-5], [0.0, 1.0]]), ONE), {}, V, "P must be symmetric: max"),
    ((np.diag([1e9, 1.0, 1.0]) + np.eye(3, k=1), np.ones(3)), {}, V,
     "P must be symmetric: max"),
    ((ENDLESS, np.ones(50_000)), {}, MemoryError,
     "P would have 2.5e[+]09 entries of 20 GB, allowed are 2.1e[+]09"),
    ((EYE, ONE, np.broadcast_to(1.0, (2_000_000_000, 2)), ONE), {}, MemoryError,
     "G would have 4.0e[+]09 entries"),
    ((-EYE, ONE), {}, V,
     "P must be positive semidefinite: its diagonal entry 0 is negative"),
    ((EYE, np.array([1.0, np.inf])), {}, V, r"q must be finite, got inf at \(1\)"),
    ((EYE, ONE, ROW, [np.nan]), {}, V, r"h must not hold NaN, got nan at \(0\)"),
    ((EYE, ONE, 1e300 * ROW, [1e299]), {}, V,
     r"h must be \+inf where there is no constraint, got 1\.0e\+299 at \(0\), "
     r"where G has entries of 1\.0e\+300: divide this row and h by that"),
    ((sparse.csc_array(EYE), ONE, sparse.csc_array(-1e300 * ROW), [1e299]), {}, V,
     r"h must be \+inf where there is no constraint"),
    ((EYE, ONE, None, None, -np.inf * ROW, ONE[:1]), {}, V,
     r"A must be finite, got -inf at \(0, 0\)"),
    ((EYE[:1, :1], ONE[:1], None, None, [[np.inf]], ONE[:1]), {}, V,
     r"A must be finite, got inf at \(0, 0\)"),
    ((EYE, ["a", "b"]), {}, T, "q must be an array of real numbers, got dtype <U1"),
    ((EYE * 1j, ONE), {}, T,
     "P must be an array of real numbers, got dtype complex128"),
    ((sparse.csc_array(EYE * 1j), ONE), {}, T,
     "P must hold real numbers, got dtype complex128"),
    ((EYE, None), {}, T, "q must be an array of real numbers, got None$"),
    ((EYE, ONE, None, None, EYE), {"l": ONE, "u": ONE}, T,
     r"unknown option 'l'; rows l <= C x <= u are given as G = \[C; -C\]"),
    ((EYE, ONE), {"eps": 1e-6}, T, "unknown option 'eps'; did you mean 'eps_abs'?"),
    ((np.ones((1, 2, 2)), ONE), {}, V,
     r"P must have two dimensions, got shape \(1, 2, 2\)"),
    ((EYE, ONE), {"maxiter": 3}, T,
     "unknown option 'maxiter'; did you mean 'max_iter'?"),
    ((EYE, ONE), {"max_iter": 0}, V, "max_iter must be >= 1, got 0"),
    ((EYE, ONE), {"max_iter": 2.5}, T, "max_iter must be an integer, got 2.5"),
    ((EYE, ONE), {"threads": 0}, V, "threads must be >= 1, got 0"),
    ((EYE, ONE), {"threads": 2.0}, T, r"threads must be an integer, got 2\.0"),
    ((EYE, ONE), {"eps_abs": -1.0}, V, "eps_abs must be >= 0, got -1.0"),
    ((EYE, ONE), {"eps_abs": 0.0, "eps_rel": 0.0}, V,
     "eps_abs and eps_rel must not both be 0"),
    ((EYE, ONE), {"eps_rel": np.inf}, V, "eps_rel must be finite, got inf"),
    ((EYE, ONE), {"time_limit": 0.0}, V, "time_limit must be > 0, got 0.0"),
    ((EYE, ONE), {"time_limit": "1"}, T, "time_limit must be a number, got"),
    ((EYE, ONE), {"verbose": 1}, T, "verbose must be True or False, got 1"),
    ((EYE, ONE), {"history": None}, T, "history must be True or False"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "options", "error", "text"), QP_REFUSALS)
def test_a_qp_is_refused_in_words(arguments, options, error, text, capfd):
    with pytest.raises(error, match=text):
        solve_qp(*arguments, **options)
    assert capfd.readouterr() == ("", "")


class Like:
    """An array-like, as tensors and data frames are."""

    ndim = 1

    def __init__(self, values, **attributes):
        self.values = values
        vars(self).update(attributes)

    def __array__(self, *_, **__):
        return np.array(self.values, object)


def update(P, q):
    solver = Solver(P, ONE)
    solver.update(q=q)
    return solver.solve().x


DOORS = {
    "solve_qp": lambda P, q: solve_qp(P, q).x,
    "x0": lambda P, q: solve_qp(EYE, -ONE, x0=q).x,
    "Solver": lambda P, q: Solver(P, q).solve().x,
    "update": update,
    "solve_batch": lambda P, q: solve_batch(P, q).x[0],
    "qpsolvers": lambda P, q: qpsolvers.solve_qp(P, q, solver="nam"),
    "solve_lcp": lambda P, q: solve_lcp(P, q).z,
    "Prepared": lambda P, q: solve_lcp(Prepared(P), q).z,
}
TAKEN = (
    np.ma.array, lambda v: objects(v, int), lambda v: objects(v, Decimal),
    lambda v: Like(v.tolist()),
)  # fmt: skip
REFUSED = {
    "masked entries": np.ma.array(ONE, mask=[True, False]),
    r"Fraction at \(1\) that is no float64; np.asarray\(\w+, float\) rounds it":
        Like([1, Fraction(1, 3)]),
    r"Decimal at \(0\) that": Like([Decimal("0.1"), 1]),
    r"int at \(0\)": Like([10**400, 1]),
    r"NoneType at \(1\)": Like([1.0, None]),
    "namlcp.torch.solve_qp differentiates": Like(ONE, requires_grad=True),
}  # fmt: skip


@pytest.mark.parametrize("door", DOORS)
def test_containers_that_lose_nothing_are_taken_in_every_door(door):
    solve = DOORS[door]
    for take in TAKEN:
        assert solve(EYE, take(-ONE)).tolist() == solve(EYE, -ONE).tolist()
    assert solve(np.ma.array(EYE), -ONE).tolist() == solve(EYE, -ONE).tolist()


@pytest.mark.parametrize("text", REFUSED)
@pytest.mark.parametrize("door", DOORS)
def test_containers_that_lose_something_are_refused_in_a_line(door, text):
    with pytest.raises((T, QPError), match=text) as info:
        DOORS[door](EYE, REFUSED[text])
    name = {"x0": "x0"}.get(door, "q")
    assert str(info.value).startswith(f"{name} ")
    assert "\n" not in str(info.value)


@pytest.mark.parametrize(
    "x",
    [
        solve_qp(EYE, -ONE, lb=0.0, ub=0.5).x,
        Solver(EYE, -ONE, lb=0.0, ub=0.5).solve().x,
        solve_batch(EYE, -ONE[None, :], lb=0.0, ub=0.5).x[0],
        qpsolvers.solve_qp(EYE, -ONE, ub=np.float64(0.5), solver="nam"),
        solve_lcp(EYE, -ONE, 0.0, 0.5).z,
    ],
)
def test_a_bound_may_be_a_number(x):
    assert x.tolist() == [0.5, 0.5]


def test_a_side_that_switches_off_a_constraint_is_refused_in_a_sequence_too():
    solver = Solver(EYE, -ONE, 1e12 * ROW, [1e12])
    with pytest.raises(ValueError, match=r"h must be \+inf where"):
        solver.update(h=[1e21])
    solver.update(h=[np.inf])
    assert solver.solve().x == pytest.approx(ONE)
    h = np.array([[1e12], [1e21], [np.inf]])
    batch = solve_batch(EYE, -ONE, 1e12 * ROW, h)
    assert [s.value for s in batch.statuses] == ["solved", "invalid", "solved"]


@pytest.mark.parametrize("side", [1e20, 1e30, 1e299, np.inf])
def test_a_row_is_switched_off_by_a_huge_side(side):
    assert solve_qp(EYE, -ONE, 1e3 * ROW, [side]).x == pytest.approx(ONE)


@pytest.mark.parametrize("form", [np.asarray, sparse.csc_array, sparse.csr_matrix])
def test_an_asymmetry_of_single_precision_is_taken_out(form):
    """In rows of any size; other backends of qpsolvers read one triangle."""
    for units in (np.ones(2), np.array([1e3, 1e-3])):
        P = np.array([[2.0, 1.0 + 1e-7], [1.0 - 1e-7, 2.0]]) * np.outer(units, units)
        expected = solve_qp((P + P.T) / 2, -units).x
        solver = Solver(form(P + P.T), -units)
        solver.update(P=form(P))
        found = [solve_qp(form(P), -units), Solver(form(P), -units).solve()]
        found += [solver.solve(), solve_batch(form(P), -units[None, :])[0]]
        for one in found:
            assert one.x == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("form", [np.asarray, sparse.csc_array])
def test_rows_of_1e308_give_no_warning(form):
    rows = form(1e308 * ROW), [-1e308]
    for place in (rows, (None, None, *rows)):
        found = solve_qp(form(EYE), ONE, *place, max_iter=20)
        said = found.status.value
        assert said in ("solved", "stalled", "max_iter", "numerical_error")
        assert np.isnan(found.x).any() == (said == "numerical_error")


PAIR = EYE, ONE
LCP_REFUSALS = [
    ((np.ones((2, 3)), np.ones(3)), {}, V, "A must be square"),
    ((np.diag([1, np.nan]), ONE), {}, V, r"A must be finite.*\(1, 1"),
    ((ENDLESS, np.ones(50_000)), {}, MemoryError, "A would have 2.5e[+]09 entries"),
    ((EYE, np.ones(3)), {}, V, r"q must have shape \(2,\)"),
    ((EYE, [1, np.inf]), {}, V, r"q must be finite.*\(1\)"),
    ((EYE, ["a", "b"]), {}, T, "q must be an array of real"),
    ((EYE, [[1], [1, 2]]), {}, T, "q must be an array of real"),
    ((*PAIR, [2, 0], 1.0), {}, V,
     r"lower must not exceed upper.*lower\[0\] = 2, upper\[0\] = 1"),
    ((*PAIR, np.inf), {}, V, "lower be < inf"),
    ((*PAIR, np.nan), {}, V, "lower must not hold NaN"),
    (PAIR, {"maxiter": 3}, T, "maxiter"),
    (PAIR, {"eps_abs": -1.0}, V, "eps_abs must be > 0"),
    (PAIR, {"max_iter": 0}, V, "max_iter must be >= 1"),
    (PAIR, {"method": "pgs", "eps_rel": 1e-3}, V,
     "eps_rel is not a parameter of method 'pgs', only of auto"),
    (PAIR, {"s0": ONE}, V, "s0 is not a parameter of method 'auto', only of mgs"),
    (PAIR, {"method": "multigrid", "s0": ONE}, V,
     "s0 is not a parameter of method 'multigrid'"),
    (PAIR, {"z0": np.ones(3)}, V, r"z0 must have shape \(2,\)"),
    (PAIR, {"method": "pgs", "z0": ONE, "s0": ONE}, V,
     "s0 and z0 must not both be given"),
    (PAIR, {"diagonal": ONE}, V, "diagonal is for a LinearOperator"),
    (PAIR, {"max_iter": True}, T, "max_iter must be an integer, got True"),
    (PAIR, {"time_limit": -1}, V, "time_limit must be > 0, got -1"),
    (PAIR, {"verbose": "yes"}, T, "verbose must be True or False, got 'yes'"),
]  # fmt: skip


@pytest.mark.parametrize(("arguments", "options", "error", "text"), LCP_REFUSALS)
def test_an_lcp_is_refused_in_words(arguments, options, error, text):
    with pytest.raises(error, match=text):
        solve_lcp(*arguments, **options)


def block(**changes):
    """Return a block on the ground, in the plane, with some arrays changed."""
    parts = {
        "centre": np.zeros((1, 3)), "mass": np.ones(1), "inertia": np.ones((1, 3)),
        "velocity": np.zeros((1, 6)), "first": np.array([-1]), "second": np.array([0]),
        "point": np.zeros((1, 3)), "normal": np.eye(3)[1:2], "mu": np.ones(1),
        "gap": np.zeros(1),
    } | changes  # fmt: skip
    values = iter(parts.values())
    bodies, contacts = (kind(*islice(values, k)) for kind, k in KINDS)
    return Scene(bodies, contacts, *values)


KINDS = (Bodies, 4), (Contacts, 6)


@pytest.mark.parametrize(
    ("changes", "error", "text"),
    [
        ({"normal": np.eye(3)[2:]}, V, "plane z = 0 where directions = 2, got 1 at"),
        ({"normal": 2.0 * np.eye(3)[1:2]}, V, r"unit vectors, got 2 at \(0\)"),
        ({"mu": -np.ones(1)}, V, "Contacts.mu must not be negative, got -1"),
        ({"mass": np.zeros(1)}, V, "Bodies.mass must be positive, got 0"),
        ({"first": -np.ones(1)}, T, "Contacts.first must hold integers, got float64"),
        ({"second": np.array([1])}, V, "second must be negative.* less than 1"),
        ({"point": np.zeros(3)}, V, r"Contacts.point must have shape \(1, 3\), got"),
        ({"gap": [0.0]}, T, r"Contacts.gap must be an array, got \[0.0\]"),
        ({"directions": 3}, V, "directions must be 2, in the plane, 4, 6, ..., got 3"),
    ],
)  # fmt: skip
def test_a_scene_without_a_meaning_is_refused(changes, error, text):
    friction_lcp(block())
    with pytest.raises(error, match=text):
        friction_lcp(block(**changes))


# ---- where it runs


def test_nothing_is_sent(monkeypatch):
    """No network at run time."""

    def refuse(*_, **__):
        raise AssertionError("a socket was opened")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    solve_qp(*small_qp())
    solve_lcp(EYE, ONE)
    code = (
        "import socket, sys\n"
        "sys.addaudithook(lambda event, _: event[:7] == 'socket.' and sys.exit(3))\n"
        "import namlcp, namlcp.__main__, numpy as np\n"
        "namlcp.solve_lcp(np.eye(2), -np.ones(2))\n"
    )
    done = subprocess.run([sys.executable, "-W", "error", "-c", code], check=False)
    assert done.returncode == 0
