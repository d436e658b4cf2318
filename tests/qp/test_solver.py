"""update and solve give what a fresh solve gives, whatever came before."""

import copy
import pickle
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.sparse as sp
from problems_qp import (
    QP,
    assert_certificate,
    assert_solves_qp,
    complementary,
    dense,
    sparse,
)
from walks_qp import FAMILIES, Walk, portfolio, sparse_portfolio

from namlcp import Options, QPResult, Solver, Status, qp_residuals, solve_qp
from namlcp.qp.intake import qp_data
from namlcp.qp.kkt import KKT
from validation.stress import campaign_relations

INF = np.inf


def arguments(data, form):
    return {k: form(v) if k in "PGA" else v for k, v in data.items()}


def assert_same(fresh, result, data):
    """One answer, right by the definition; one x where it is unique."""
    assert result.status is fresh.status
    qp = qp_data(**data)
    if result.status is Status.SOLVED:
        assert_solves_qp(qp, result, 1e-9)
        residuals = qp_residuals(*qp, result.x, result.y, result.z, result.z_box)
        np.testing.assert_allclose(result.residuals, residuals, 1e-9, 1e-9)
        assert result.obj == pytest.approx(fresh.obj, rel=1e-9, abs=1e-9)
        if np.linalg.eigvalsh(qp.P + qp.A.T @ qp.A)[0] > 1e-3:
            scale = 1.0 + np.abs(fresh.x).max()
            np.testing.assert_allclose(result.x, fresh.x, 0.0, 1e-9 * scale)
    elif np.isfinite(result.x).all() or np.isfinite(result.z_box).all():
        assert_certificate(sparse(qp), result)


FORMS = {"dense": np.array, "sparse": sp.csc_array}


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", FAMILIES)
def test_a_walk_gives_what_fresh_solves_give(name, form):
    found = []
    for seed in range(3):
        walk = Walk(name, seed)
        solver = Solver(**arguments(walk.data, FORMS[form]))
        for _ in range(25):
            solver.update(**arguments(walk.step(), FORMS[form]))
            result = solver.solve()
            fresh = solve_qp(**arguments(walk.data, FORMS[form]))
            assert_same(fresh, result, walk.data)
            found.append(result.status)
    assert len(set(found)) >= 3
    assert found.count(Status.SOLVED) > len(found) // 4


def steps_of(name, count=5, seed=0):
    """Return a Walk and problems that differ in q alone."""
    walk = Walk(name, seed)
    vary = [walk.noise(walk.point.size) for _ in range(count)]
    return walk.data, [{**walk.data, "q": walk.data["q"] + v} for v in vary]


DEFINITE = {"large": "dense", "portfolio": "dense", "heap": "sparse",
            "control": "sparse"}  # fmt: skip


@pytest.mark.parametrize(("name", "form"), DEFINITE.items())
def test_the_way_to_a_problem_leaves_no_trace(name, form):
    """The same bits whenever it comes again; a first solve is that of `solve_qp`."""
    first, others = steps_of(name)
    solver = Solver(**arguments(first, FORMS[form]))
    alone = solve_qp(**arguments(first, FORMS[form]))
    np.testing.assert_allclose(solver.solve().x, alone.x, 0.0, 1e-11)
    seen = []
    for other in others:
        for step in (other, first):
            solver.update(q=step["q"])
            found = solver.solve()
        seen.append(found)
    for found in seen[1:]:
        for part in ("x", "y", "z", "z_box"):
            np.testing.assert_array_equal(getattr(found, part), getattr(seen[0], part))


@pytest.mark.parametrize(("name", "form"), DEFINITE.items())
def test_a_point_solves_the_system_of_its_active_constraints(name, form):
    first, others = steps_of(name)
    solver = Solver(**arguments(first, FORMS[form]))
    for step in others:
        solver.update(q=step["q"])
        found, qp = solver.solve(), QP(**step)
        free, held = found.z_box == 0.0, found.z > 0.0
        C, d = np.vstack((qp.A, qp.G[held])), np.append(qp.b, qp.h[held])
        F, x = C[:, free], found.x
        K = np.block([[qp.P[np.ix_(free, free)], F.T], [F, np.zeros(2 * d.shape)]])
        rhs = -qp.q - qp.P[:, ~free] @ x[~free]
        right = np.append(rhs[free], d - C[:, ~free] @ x[~free])
        u = np.linalg.lstsq(K, right, rcond=None)[0]
        expected = np.concatenate((x[free], found.y, found.z[held]))
        np.testing.assert_allclose(u, expected, 0.0, 1e-10 * (1.0 + abs(u).max()))
        assert found.form == "dual"


@pytest.mark.parametrize(("name", "form"), DEFINITE.items())
def test_active_rows_are_kept_where_they_help(name, form):
    """Through infeasible steps, other values of matrices, and in a warm start."""
    first, _ = steps_of(name)
    data = arguments(first, FORMS[form])
    solver, n = Solver(**data), first["q"].size
    start = solver.solve()
    assert start.iterations > 0
    solver.update(lb=np.full(n, 5.0), ub=np.full(n, -5.0))
    assert solver.solve().status is Status.PRIMAL_INFEASIBLE
    solver.update(lb=first["lb"], ub=first["ub"])
    assert solver.solve().iterations == 0
    for factor in (1.01, 1.02, 1.03):  # x stays
        solver.update(P=factor * data["P"], q=factor * data["q"])
        found = solver.solve()
        assert found.iterations < start.iterations
        np.testing.assert_allclose(found.x, start.x, 0.0, 1e-9)
    other = Solver(**data)
    assert other.solve(start).iterations == 0
    with pytest.raises(ValueError, match=r"warm_start.x must have shape"):
        other.solve(Solver(np.eye(1), np.zeros(1)).solve())
    assert other.solve().iterations == 0


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("name", ["store", "lasso", "wide lasso"])
def test_a_singular_cost_of_another_size(name, form):
    """The proximal weight follows the vectors; the same active rows need no pivot."""
    data = Walk(name, 4).data
    solver = Solver(**arguments(data, FORMS[form]))
    for size in (1.0, 1e5, 1.0):
        step = data | {"q": size * data["q"]}
        solver.update(q=step["q"])
        first, again = solver.solve(), solver.solve()
        assert_same(solve_qp(**step), first, step)
        assert again.iterations == 0
        assert again.obj == pytest.approx(first.obj)


@pytest.mark.parametrize("p", [0, 3])
def test_large_terms_are_summed_in_the_order_of_numpy(p):
    """Residuals of a solve are those of the definition to the last bits."""
    for seed in range(10):
        walk = Walk("large", seed)
        data = walk.data | {"A": walk.data["A"][:p], "b": walk.data["b"][:p]}
        data |= {"q": 1e7 * data["q"], "P": 1e7 * data["P"]}
        found = solve_qp(**data, eps_abs=1e-7, eps_rel=0.0)
        expected = qp_residuals(**data, x=found.x, y=found.y, z=found.z,
                                z_box=found.z_box)  # fmt: skip
        size = max(expected.dual_size, expected.gap_size)
        np.testing.assert_allclose(found.residuals, expected, 0.0, 1e-15 * size)


def test_a_bound_on_what_the_equations_fix():
    """x_0 = 1 by an equation; a bound on it holds or contradicts it."""
    data, _ = steps_of("control")
    data["lb"][:27], data["ub"][:27], data["b"][:3] = -INF, INF, -1.0
    data["h"][:] = INF
    solver = Solver(**arguments(data, sp.csc_array))
    for bound in (1.5, 0.5, 1.0):
        data["ub"] = np.where(np.arange(data["q"].size) == 0, bound, data["ub"])
        solver.update(ub=data["ub"])
        found = solver.solve()
        assert_same(solve_qp(**data), found, data)
        assert (found.status is Status.SOLVED) == (bound >= 1.0)


@pytest.mark.parametrize("form", FORMS)
def test_active_rows_that_depend_on_each_other(form):
    """The same row three times, and x_1 = 1 by two bounds and two rows."""
    G = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 1.0], [1.0, 0.0], [-1.0, 0.0]])
    P, G = FORMS[form](np.diag([1.0, 0.0])), FORMS[form](G)
    solver = Solver(P, [-3.0, -1.0], G, np.ones(5), lb=[1.0, 0.0], ub=[1.0, 2.0])
    for top in (1.5, 1.2, 2.0, 1.0):
        solver.update(h=np.array([top, top, top, 1.0, -1.0]))
        np.testing.assert_allclose(solver.solve().x, [1.0, top - 1.0], atol=1e-9)


@pytest.mark.parametrize(
    ("size", "form"), [((400, 5), "dense"), ((300, 80), "sparse"), ((300, 5), "sparse")]
)
def test_large_portfolios(size, form):
    """Hundreds of free variables, dense rows, or most variables at bounds."""
    make = portfolio if form == "dense" else sparse_portfolio
    P, _, A = make(np.random.default_rng(25), *size)
    n = len(P)
    b = np.append(np.zeros(len(A) - 1), 1.0)
    lb = np.where(np.arange(n) < size[0], 0.0, -INF)
    q = -0.1 * np.cos(np.arange(float(n)) ** 2)
    P, A = FORMS[form](P), FORMS[form](A)
    solver = Solver(P, q, A=A, b=b, lb=lb)
    for k in range(9):
        solver.update(q=q + 0.02 * np.cos(np.arange(float(n)) + k))
        found = solver.solve()
        if k % 3 == 2:
            fresh = solve_qp(*solver.qp)
            np.testing.assert_allclose(found.x, fresh.x, 0.0, 1e-10)


@pytest.mark.parametrize(("mean", "form"), [(0.0, "dual"), (3.0, "path")])
def test_new_matrices_where_few_and_where_most_variables_are_at_bounds(mean, form):
    """Each active row would need a response anew: a step took 10 times a cold solve."""
    P, _, A = sparse_portfolio(np.random.default_rng(25), 300, 5)
    b, lb = np.append(np.zeros(5), 1.0), np.append(np.zeros(300), np.full(5, -INF))
    q = np.append(-mean * np.cos(np.arange(300.0)), np.zeros(5))
    solver = Solver(sp.csc_array(P), q, A=sp.csc_array(A), b=b, lb=lb)
    for scale in (1.0, 1.1, 1.2):
        solver.update(P=sp.csc_array(scale * P))
        found = solver.solve()
        fresh = solve_qp(*solver.qp)
        np.testing.assert_allclose(found.x, fresh.x, 0.0, 1e-10)
    assert found.form == form


def test_a_problem_too_large_for_what_a_solver_keeps():
    n = 30_000
    solver = Solver(sp.eye_array(n, format="csc"), -np.ones(n), ub=np.full(n, 0.5))
    for size in (1.0, 0.2):
        solver.update(q=np.full(n, -size))
        np.testing.assert_allclose(solver.solve().x, min(size, 0.5))


# ---- what a user may do with a Solver


def simple(**options):
    """min 1/2 |x|^2 + q'x in three variables, with a row, an equation and bounds."""
    return Solver(
        np.eye(3), -np.ones(3), np.ones((1, 3)), [2.0], np.array([[1.0, -1.0, 0.0]]),
        [0.0], np.zeros(3), np.ones(3), **options,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q": [1.0, np.nan, 0.0]}, r"q must be finite, got nan at \(1\)"),
        ({"q": np.ones(3), "h": [np.nan]}, "h must not hold NaN"),
        ({"b": [np.inf]}, "b must be finite"),
        ({"lb": np.zeros(2)}, r"lb must have shape \(3,\) to match P"),
        ({"P": np.eye(4)}, r"P must have shape \(3, 3\) as before"),
        ({"G": np.ones((2, 3)), "h": np.ones(1)}, r"G must .* make a new Solver"),
        ({"A": np.full((1, 3), np.nan)}, "A must be finite"),
        ({"P": np.tri(3)}, "P must be symmetric"),
        ({"P": -np.eye(3), "q": np.zeros(3)}, "P must be positive semidefinite"),
    ],
)
def test_a_bad_update_changes_nothing(changes, message):
    solver = simple()
    before = solver.solve()
    with pytest.raises(ValueError, match=message):
        solver.update(**changes)
    assert solver.solve().x.tolist() == before.x.tolist()
    solver.update(q=np.zeros(3))
    assert solver.solve().x.tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("form", FORMS)
def test_a_huge_side_is_read_with_the_rows_that_come_with_it(form):
    """1e21 x <= 1e20 is a constraint, x <= 1e20 is none."""
    steep, flat = (FORMS[form](np.full((1, 1), entry)) for entry in (1e21, 1.0))
    huge, none = np.array([1e20]), np.array([INF])
    solver = Solver(np.eye(1), np.array([-5.0]), flat, np.ones(1))
    with pytest.raises(ValueError, match=r"h must be \+inf where there is no"):
        solver.update(G=steep, h=huge)
    assert solver.solve().x == 1.0
    solver.update(G=steep, h=none)
    solver.update(G=flat, h=huge)
    assert solver.solve().x == 5.0


def test_arguments_are_refused_that_have_no_meaning():
    solver = Solver(np.eye(2), np.ones(2))
    for changes in ({"h": [1.0]}, {"G": np.ones((1, 2))}):
        with pytest.raises(ValueError, match="must have shape"):
            solver.update(**changes)
    solver.update(lb=np.zeros(2))
    assert solver.solve().x.tolist() == [0.0, 0.0]
    with pytest.raises(TypeError, match="derivative must be True or False"):
        solver.solve(derivative=1)
    near = solve_qp(np.eye(3), -np.ones(3), lb=np.zeros(3), ub=np.ones(3))
    with pytest.raises(ValueError, match=r"warm_start\.y must have shape"):
        simple().solve(near)


def test_a_sparse_pattern_stays():
    P = sp.csc_array(np.diag([1.0, 2.0, 3.0]))
    G = sp.csr_array(np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
    solver = Solver(P, -np.ones(3), G, np.ones(2))
    fewer = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    for other in (fewer, sp.coo_array(fewer), G):
        solver.update(G=other)
        expected = solve_qp(P, -np.ones(3), other, np.ones(2))
        np.testing.assert_allclose(solver.solve().x, expected.x, atol=1e-12)
        with pytest.raises(ValueError, match="outside the pattern of the first G"):
            solver.update(G=np.ones((2, 3)))


def test_a_step_has_the_attributes_of_a_fresh_solve():
    data = Walk("half full", 1).data
    solver, fresh = Solver(**data), solve_qp(**data)
    names = list(QPResult.__annotations__)
    for name in set(names) - {"setup_time", "solve_time", "problem"}:
        first, expected = getattr(solver.solve(), name), getattr(fresh, name)
        if isinstance(expected, np.ndarray | float | tuple):
            np.testing.assert_allclose(first, expected, rtol=1e-9, atol=1e-9)
        elif name != "iterations":
            assert first == expected
    assert set(names) <= set(dir(solver.solve()))
    result = solver.solve()
    assert result.y is result.y
    assert 0.0 <= result.solve_time < 10.0
    result = solver.solve()
    for other in (copy.copy(result), pickle.loads(pickle.dumps(solver.solve()))):
        np.testing.assert_array_equal(other.z, result.z)
        assert other.residuals.solved(1e-9, 0.0)
    for name in ("later_on", "__deepcopy__"):
        with pytest.raises(AttributeError, match=f"'QPResult' object has no .*{name}"):
            getattr(solver.solve(), name)
    with pytest.raises(AttributeError, match="not writable"):
        result.z = result.z


@pytest.mark.parametrize("name", ["small", "flat", "portfolio", "control", "lasso"])
@pytest.mark.parametrize("form", FORMS)
def test_a_copy_and_a_pickle_go_their_own_way(name, form):
    first, (other, *_) = steps_of(name)
    solver = Solver(**arguments(first, FORMS[form]))
    expected = [solver.solve() for _ in range(3)][-1].obj
    others = [copy.copy(solver), copy.deepcopy(solver)]
    others.append(pickle.loads(pickle.dumps(solver)))
    for k, mine in enumerate(others):
        assert mine.solve().obj == pytest.approx(expected, abs=1e-9)
        factor = 2.0 + k
        mine.update(q=factor * other["q"], P=factor * solver.qp.P)
        fresh = factor * solve_qp(**other).obj
        assert mine.solve().obj == pytest.approx(fresh, rel=1e-9, abs=1e-8)
    assert solver.solve().obj == pytest.approx(expected, abs=1e-9)


def test_a_late_solve_leaves_the_solver_usable():
    known = complementary(3, 120, 90, 10, 40, 0.02)
    late = Solver(*known.qp, time_limit=1e-9)
    assert late.solve().status is Status.TIME_LIMIT
    late.options = Options()
    assert late.solve().obj == pytest.approx(solve_qp(*known.qp).obj, abs=1e-9)


def test_ctrl_c_ends_a_factorisation_with_another_weight(monkeypatch):
    """That of P + W, which a compiled solve makes."""
    P, factor, calls = sp.diags_array([1.0, 0.0], format="csc"), KKT.factor, []
    solver = Solver(P, [1.0, -1.0], ub=[1.0, 1.0])

    def interrupt(kkt):
        calls.append(kkt)
        if len(calls) == 1:
            raise KeyboardInterrupt
        return factor(kkt)

    monkeypatch.setattr(KKT, "factor", interrupt)
    with pytest.raises(KeyboardInterrupt):
        solver.solve()
    np.testing.assert_allclose(solver.solve().x, [-1.0, 1.0], atol=1e-9)


def test_solvers_in_many_threads():
    def run(seed):
        walk = Walk("no equations", seed)
        solver = Solver(**walk.data)
        results = []
        for _ in range(20):
            solver.update(**walk.step())
            results.append(solver.solve().x.tobytes())
        return results

    expected = [run(seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(4))) == expected


def test_a_solve_lets_other_threads_run_and_refuses_to_be_disturbed():
    """Another thread runs during a solve, although none is made to yield."""
    solver = Solver(*dense(complementary(0, 300, 600, 0, 300).qp))
    ready, go, ran = threading.Event(), threading.Event(), []

    def work():
        ready.set()
        go.wait()
        with pytest.raises(RuntimeError, match="one thread at a time"):
            solver.solve()
        ran.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    ready.wait()
    before = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    try:
        go.set()
        solver.solve()
        during = list(ran)
    finally:
        sys.setswitchinterval(before)
    thread.join()
    assert during


def test_large_weights_lose_no_digits_of_the_residuals():
    """A step with x ~ 10^9 leaves them; P + W less W was taken for a sparse P."""
    assert campaign_relations.examine(1, 6027, "sequences")[0] == "right"
