"""update and solve give what a fresh solve gives, whatever came before."""

import copy
import dataclasses
import pickle
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from problems_qp import assert_certificate, assert_solves_qp, complementary
from scipy import sparse

import namlcp
from namlcp import Solver, Status, solve_qp
from namlcp.qp.problem import qp_data
from namlcp.qp.responses import DenseResponses, Responses
from namlcp.qp.sequences import solver as module

NAMES = ("P", "q", "G", "h", "A", "b", "lb", "ub")


class Walk:
    """A QP that changes at random, as keyword arguments; `point` is feasible."""

    def __init__(self, seed, n, m, p, density):
        self.rng = np.random.default_rng(seed)
        known = complementary(seed, n, m, p, n, density)
        self.point = known.x
        self.data = dict(zip(NAMES, known.qp, strict=True))
        for name in "PGA":
            self.data[name] = self.data[name].toarray()
        self.data["P"] += np.eye(n)
        G = self.data["G"]
        G[1] = G[0] * self.rng.uniform(0.5, 1.0, n)  # so that it may become -G[0]
        self.data["h"][1] = G[1] @ known.x
        self.first = {name: value.copy() for name, value in self.data.items()}

    def step(self):
        """Return the changes of one step, by name."""
        kinds = [name for name in dir(self) if name.startswith("change_")]
        changes = getattr(self, self.rng.choice(kinds))()
        self.data.update(changes)
        return changes

    def noise(self, size, scale=0.3):
        return scale * self.rng.standard_normal(size)

    def change_q(self):
        q = self.data["q"]
        return {"q": q + self.noise(q.size)}

    def change_q_wholly(self):
        return {"q": self.noise(self.point.size, 3.0)}

    def change_all_vectors(self):
        """Move the feasible point, and what belongs to it."""
        self.point = self.point + self.noise(self.point.size)
        slack = self.rng.choice([0.0, 0.2, 1.0], self.data["h"].size)
        return {
            **self.change_q(),
            "h": self.data["G"] @ self.point + slack,
            "b": self.data["A"] @ self.point,
            **self.bounds(self.rng.choice([0.0, 0.5, np.inf], (2, self.point.size))),
        }

    def bounds(self, room):
        return {"lb": self.point - room[0], "ub": self.point + room[1]}

    def change_sides(self):
        """Some rows and bounds vanish, others appear."""
        h = self.data["G"] @ self.point + self.rng.choice(
            [0.1, 1.0, np.inf, 1e25], self.data["h"].size
        )
        room = self.rng.choice([0.0, 0.1, 2.0, np.inf], (2, self.point.size))
        return {"h": h, **self.bounds(room)}

    def change_fixed(self):
        """Some variables are fixed: lb = ub."""
        return self.bounds(
            self.rng.choice([0.0, 2.0], (1, self.point.size)) * [[1], [1]]
        )

    def change_to_infeasible(self):
        i = self.rng.integers(self.point.size)
        lb = self.data["ub"].copy()
        lb[~np.isfinite(lb)] = -np.inf
        lb[i] = self.point[i] + 1.0
        ub = self.data["ub"].copy()
        ub[i] = self.point[i] - 1.0
        return {"lb": lb, "ub": ub}

    def change_to_contradiction(self):
        """Two rows of G contradict each other, or no longer."""
        G, h = self.data["G"].copy(), self.data["h"].copy()
        G[1], h[1] = -G[0], -(G[0] @ self.point) - 1.0
        h[0] = G[0] @ self.point
        if self.rng.random() < 0.5:
            G[1] = self.first["G"][1]
            h[1] = G[1] @ self.point
        return {"G": G, "h": h}

    def change_to_singular(self):
        """P gets a null space; often the QP becomes unbounded."""
        P = self.first["P"].copy()
        keep = self.rng.random(self.point.size) < 0.5
        P[~keep] = P[:, ~keep] = 0.0
        return {"P": P}

    def change_to_flat(self):
        """No P, no bounds and no rows: unbounded."""
        n, m = self.point.size, self.data["h"].size
        P, infinite = np.zeros((n, n)), np.full(n, np.inf)
        return {"P": P, "h": np.full(m, np.inf), "lb": -infinite, "ub": infinite}

    def change_P(self):
        return {"P": self.first["P"] * self.rng.uniform(0.5, 2.0)}

    def change_G(self):
        G = self.first["G"] * self.rng.uniform(0.8, 1.2, self.first["G"].shape)
        G[self.rng.random(G.shape) < 0.1] = 0.0
        return {"G": G, "h": G @ self.point + self.rng.random(G.shape[0])}

    def change_A(self):
        A = self.first["A"] * self.rng.uniform(0.8, 1.2, self.first["A"].shape)
        return {"A": A, "b": A @ self.point}

    @property
    def is_definite(self):
        return np.linalg.eigvalsh(self.data["P"])[0] > 1e-3


class FlatWalk(Walk):
    """P is singular all the time: zero for the last half of the variables."""

    def __init__(self, *sizes):
        super().__init__(*sizes)
        n = self.point.size
        P = self.data["P"]
        P[n // 2 :] = P[:, n // 2 :] = 0.0
        self.first["P"] = P.copy()
        self.data.update(self.bounds(np.ones((2, n))))

    def change_back(self):
        """A step that is solved."""
        return {
            "q": self.first["q"] + self.noise(self.point.size, 0.05),
            "h": self.data["G"] @ self.point + 0.3,
            **self.bounds(np.ones((2, self.point.size))),
        }

    change_again = change_once_more = change_back


def arguments(data, store):
    return {k: store(v) if k in "PGA" else v for k, v in data.items()}


def assert_same(fresh, result, data, is_definite):
    qp = qp_data(**data)
    assert result.status is fresh.status
    if result.status is Status.SOLVED:
        assert_solves_qp(qp, result, 1e-9)
        assert result.obj == pytest.approx(fresh.obj, rel=1e-9, abs=1e-9)
        if is_definite:
            scale = 1.0 + np.abs(fresh.x).max()
            np.testing.assert_allclose(result.x, fresh.x, rtol=0, atol=1e-9 * scale)
    else:
        sparse_qp = qp._replace(**{k: sparse.csc_array(data[k]) for k in "PGA"})
        if np.isfinite(result.x).all() or np.isfinite(result.z).all():
            assert_certificate(sparse_qp, result)


SIZES = [(3, 5, 1, 1.0), (6, 12, 2, 0.5), (12, 8, 0, 0.4), (20, 30, 5, 0.2)]


@pytest.mark.parametrize("store", [np.array, sparse.csc_array], ids=["dense", "sparse"])
@pytest.mark.parametrize(("n", "m", "p", "density"), SIZES)
@pytest.mark.parametrize("kind", [Walk, FlatWalk])
def test_a_walk_gives_what_fresh_solves_give(store, n, m, p, density, kind):
    found = []
    for seed in range(4):
        walk = kind(seed, n, m, p, density)
        solver = Solver(**arguments(walk.data, store))
        for _ in range(25):
            solver.update(**arguments(walk.step(), store))
            fresh = solve_qp(**arguments(walk.data, store))
            result = solver.solve()
            assert_same(fresh, result, walk.data, walk.is_definite)
            found.append(result.status)
    assert len(set(found)) >= 3
    assert found.count(Status.SOLVED) > len(found) // 4


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


def test_an_argument_that_the_problem_has_not_is_refused():
    solver = Solver(np.eye(2), np.ones(2))
    for changes in ({"h": [1.0]}, {"G": np.ones((1, 2))}):
        with pytest.raises(ValueError, match="must have shape"):
            solver.update(**changes)
    solver.update(lb=np.zeros(2))
    assert solver.solve().x.tolist() == [0.0, 0.0]


def test_arguments_are_copied_and_not_changed():
    P, q, lb = np.eye(2), np.array([-1.0, 1.0]), np.zeros(2)
    solver = Solver(P, q, lb=lb)
    q2, P2 = np.array([-2.0, 1.0]), 2.0 * np.eye(2)
    solver.update(q=q2, P=P2)
    for array in (P, q, lb, P2, q2):
        array[...] = np.nan
    np.testing.assert_allclose(solver.solve().x, [1.0, 0.0], atol=1e-15)


def test_a_pickled_vector_needs_no_more_checks_than_others(monkeypatch):
    """Its dtype equals that of others, and is another object."""
    solver = Solver(np.eye(2), np.array([-1.0, 1.0]), lb=np.zeros(2))
    monkeypatch.setattr(module, "vector", None)
    solver.update(q=pickle.loads(pickle.dumps(np.array([-3.0, 1.0]))))
    assert solver.solve().x.tolist() == [3.0, 0.0]


def test_a_sparse_pattern_stays():
    P = sparse.csc_array(np.diag([1.0, 2.0, 3.0]))
    G = sparse.csr_array(np.array([[1.0, 0.0, 1.0], [0.0, 1.0, 1.0]]))
    solver = Solver(P, -np.ones(3), G, np.ones(2))
    fewer = np.array([[1.0, 0.0, 1.0], [0.0, 0.0, 1.0]])
    for other in (fewer, sparse.coo_array(fewer)):
        solver.update(G=other)
        expected = solve_qp(P, -np.ones(3), fewer, np.ones(2))
        np.testing.assert_allclose(solver.solve().x, expected.x, atol=1e-12)
    with pytest.raises(ValueError, match="outside the pattern of the first G"):
        solver.update(G=np.ones((2, 3)))
    solver.update(G=G)
    expected = solve_qp(P, -np.ones(3), G, np.ones(2))
    np.testing.assert_allclose(solver.solve().x, expected.x, atol=1e-12)


def test_what_a_result_makes_later_is_what_a_fresh_solve_says():
    """Each attribute can be the first one that is asked for."""
    walk = Walk(1, 8, 12, 2, 0.5)
    solver, fresh = Solver(**walk.data), solve_qp(**walk.data)
    names = [field.name for field in dataclasses.fields(fresh)]
    for name in set(names) - {"setup_time", "solve_time", "problem"}:
        first = getattr(solver.solve(), name)
        expected = getattr(fresh, name)
        if isinstance(expected, (np.ndarray, float, tuple)):
            np.testing.assert_allclose(first, expected, rtol=1e-9, atol=1e-9)
        elif name != "iterations":
            assert first == expected
    assert set(names) <= set(dir(solver.solve()))
    result = solver.solve()
    assert result.y is result.y
    assert 0.0 <= result.solve_time < 10.0
    result = solver.solve()
    others = copy.copy(result), pickle.loads(pickle.dumps(solver.solve()))
    replaced = dataclasses.replace(result, message="same")
    for other in (*others, replaced):
        np.testing.assert_array_equal(other.z, result.z)
        assert other.residuals.solved(1e-9, 0.0)
    for name in ("later_on", "__deepcopy__"):
        with pytest.raises(AttributeError, match=f"'QPResult' object has no .*{name}"):
            getattr(solver.solve(), name)
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.z = result.z


def test_a_copy_and_a_pickle_go_their_own_way():
    solver = simple()
    solver.solve()
    others = [copy.copy(solver), copy.deepcopy(solver)]
    others.append(pickle.loads(pickle.dumps(solver)))
    for k, other in enumerate(others):
        other.update(q=np.full(3, float(k)), P=2.0 * np.eye(3))
        np.testing.assert_allclose(other.solve().x, 0.0, atol=1e-12)
    np.testing.assert_allclose(solver.solve().x, 2 / 3, atol=1e-12)


def test_a_warm_start_can_be_given():
    solver = simple()
    near = solve_qp(np.eye(3), -np.ones(3), lb=np.zeros(3), ub=np.ones(3))
    with pytest.raises(ValueError, match=r"warm_start\.y must have shape"):
        solver.solve(near)
    result = solver.solve()
    np.testing.assert_allclose(solver.solve(result).x, result.x, atol=1e-14)


@pytest.mark.parametrize("store", [np.array, sparse.csc_array], ids=["dense", "sparse"])
def test_an_interrupted_solve_leaves_the_solver_usable(store, monkeypatch):
    walk = Walk(0, 20, 30, 5, 0.2)
    solver = Solver(**arguments(walk.data, store))
    solver.solve()

    def interrupted(solve):
        def wrapped(*arguments, **names):
            solve(*arguments, **names)
            raise KeyboardInterrupt

        return wrapped

    for _ in range(5):
        solver.update(**arguments(walk.change_all_vectors(), store))
        with monkeypatch.context() as patch:
            for place, name in (
                (module, "solve_checked"),
                (Responses, "run"),
                (DenseResponses, "run_again"),
            ):
                patch.setattr(place, name, interrupted(getattr(place, name)))
            with pytest.raises(KeyboardInterrupt):
                solver.solve()
        fresh = solve_qp(**arguments(solver_data(solver), store))
        assert_same(fresh, solver.solve(), solver_data(solver), True)


def test_what_the_quick_way_does_not_solve_goes_the_other_way():
    """Steps without a solution between quick ones, a Ctrl-C and other matrices."""
    rows, sides = np.array([[1.0, 1.0], [-1.0, -1.0]]), np.ones(2)
    solver = Solver(np.eye(2), -np.ones(2), rows, sides)
    solver.solve()
    assert solver.quick is not None
    for h in (sides, np.array([-2.0, 1.0]), 2.0 * sides, np.array([-1.0, -1.0]), sides):
        solver.update(h=h)
        fresh, found = solve_qp(np.eye(2), -np.ones(2), rows, h), solver.solve()
        assert found.status is fresh.status
        np.testing.assert_allclose(found.x, fresh.x, atol=1e-12)
        np.testing.assert_allclose(found.z, fresh.z, atol=1e-12)
        assert (solver.quick is not None) == (found.status is Status.SOLVED)
    solver.update(P=2.0 * np.eye(2))
    assert solver.quick is None
    np.testing.assert_allclose(solver.solve().x, 0.5, atol=1e-12)
    with pytest.raises(TypeError, match="derivative must be True or False"):
        solver.solve(derivative=1)


def test_ctrl_c_in_compiled_code_is_ctrl_c(monkeypatch):
    def pressed(*_):
        raise SystemError("result with an exception set") from KeyboardInterrupt()

    solver = Solver(np.eye(2), np.ones(2))
    with monkeypatch.context() as patch:
        patch.setattr(DenseResponses, "kernel", staticmethod(pressed))
        with pytest.raises(KeyboardInterrupt):
            solver.solve()
    np.testing.assert_array_equal(solver.solve().x, [-1.0, -1.0])
    assert solver.quick is not None
    with monkeypatch.context() as patch:
        patch.setattr(DenseResponses, "kernel", staticmethod(pressed))
        with pytest.raises(KeyboardInterrupt):
            solver.solve()
    assert solver.quick is None
    np.testing.assert_array_equal(solver.solve().x, [-1.0, -1.0])


def solver_data(solver):
    """Return the problem that a Solver holds, its matrices dense."""
    names = zip(NAMES, solver.qp, strict=True)
    return {k: v.toarray() if sparse.issparse(v) else v for k, v in names}


def test_a_late_solve_leaves_the_solver_usable():
    known = complementary(3, 120, 90, 10, 40, 0.02)
    late = Solver(*known.qp, time_limit=1e-9)
    assert late.solve().status is Status.TIME_LIMIT
    late.set_options(namlcp.Options())
    assert late.solve().obj == pytest.approx(solve_qp(*known.qp).obj, abs=1e-9)


def test_solvers_in_many_threads():
    def run(seed):
        walk = Walk(seed, 12, 20, 2, 0.5)
        solver = Solver(**walk.data)
        results = []
        for _ in range(20):
            solver.update(**walk.step())
            results.append(solver.solve().x.tobytes())
        return results

    expected = [run(seed) for seed in range(4)]
    with ThreadPoolExecutor(4) as pool:
        assert list(pool.map(run, range(4))) == expected


def test_a_solve_lets_other_threads_run():
    """Another thread runs during a solve, although none is made to yield."""
    known = complementary(0, 300, 600, 0, 300)
    solver = Solver(*(M.toarray() if sparse.issparse(M) else M for M in known.qp))
    ready, go, ran = threading.Event(), threading.Event(), []

    def work():
        ready.set()
        go.wait()
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
