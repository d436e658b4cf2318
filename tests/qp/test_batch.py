"""A batch gives what single solves give, item by item."""

import numpy as np
import pytest
from problems_qp import (
    QP,
    assert_certificate,
    complementary,
    dense,
    infeasible,
    unbounded,
)
from scipy import sparse

from namlcp import Status, qp_residuals, solve_batch, solve_qp

NAMES = QP._fields
PARTS = "x", "y", "z", "z_box"
SIZES = {"n": 8, "m": 12, "p": 2}


def as_arguments(qp):
    """Return a QP as keyword arguments, its matrices dense."""
    return dense(qp)._asdict()


def stack(problems):
    return {name: np.array([one[name] for one in problems]) for name in NAMES}


@pytest.fixture(scope="module")
def mixed():
    """Solvable, infeasible and unbounded QPs of one size."""
    problems = [
        as_arguments(complementary(seed, **SIZES, rank=seed % 9).qp)
        for seed in range(20)
    ]
    problems[3] = as_arguments(infeasible(3, **SIZES, rank=8))
    problems[11] = as_arguments(unbounded(11, **SIZES, rank=3))
    return problems


def assert_equals_single(batch, problems):
    assert len(batch) == len(problems)
    for found, problem in zip(batch, problems, strict=True):
        single = solve_qp(**problem)
        assert found.status is single.status
        assert found.obj == pytest.approx(single.obj, rel=1e-9, abs=1e-9)
        if single.status is Status.SOLVED:
            assert found.residuals.solved(1e-9, 1e-10)
            point = found.x, found.y, found.z, found.z_box
            exact = qp_residuals(**problem, **dict(zip(PARTS, point, strict=True)))
            np.testing.assert_allclose(found.residuals, exact, 1e-9, 1e-9)
            if np.linalg.eigvalsh(problem["P"])[0] > 1e-3:
                np.testing.assert_allclose(found.x, single.x, rtol=0, atol=1e-9)
                assert found.iterations == single.iterations


def test_items_that_differ_in_all(mixed):
    batch = solve_batch(**stack(mixed))
    assert_equals_single(batch, mixed)
    assert batch.statuses[3] is Status.PRIMAL_INFEASIBLE
    assert batch.statuses[11] is Status.DUAL_INFEASIBLE
    assert batch.solved.sum() == 18
    assert batch[-1].x.tolist() == batch.x[19].tolist()
    for number in (20, -21):
        with pytest.raises(IndexError, match=f"20 items, got item {number}"):
            batch[number]


@pytest.mark.parametrize("rank", [0, 3, 7])
def test_items_without_a_solution_have_certificates(rank):
    """So has one with x_1 >= 1 by its bounds, x_1 <= 0 by a row, or lb_1 > ub_1."""
    sizes = {**SIZES, "rank": rank}
    one, row, bound = (as_arguments(complementary(1, **sizes).qp) for _ in range(3))
    row["G"][0], row["h"][0] = np.eye(8)[0], 0.0
    row["lb"][0], row["ub"][0] = 1.0, 2.0
    bound["lb"][0], bound["ub"][0] = 2.0, 1.0
    others = [as_arguments(make(2, **sizes)) for make in (infeasible, unbounded)]
    problems = [one, others[0], row, bound, others[1], one]
    batch = solve_batch(**stack(problems))
    assert_equals_single(batch, problems)
    assert batch.solved.tolist() == [True, False, False, False, False, True]
    for i in (1, 2, 3, 4):
        found, single = batch[i], solve_qp(**problems[i])
        assert_certificate(QP(**problems[i]), found)
        assert found.residuals.dual <= 1e-12
        assert found.residuals[2:] == pytest.approx(single.residuals[2:], nan_ok=True)
        for name in ("obj", "form", "message"):
            assert getattr(found, name) == getattr(single, name)


@pytest.mark.parametrize("store", [np.array, sparse.csr_array], ids=["dense", "sparse"])
def test_matrices_shared_by_all(mixed, store):
    rng = np.random.default_rng(0)
    one = mixed[17]
    shared = {k: v if v.ndim == 1 else store(v) for k, v in one.items()}
    q = one["q"] + rng.standard_normal((15, one["q"].size))
    batch = solve_batch(**{**shared, "q": q})
    assert_equals_single(batch, [{**one, "q": q_i} for q_i in q])


def test_any_argument_may_be_stacked_alone(mixed):
    for name in NAMES:
        stacked = np.array([mixed[17][name]] * 3)
        batch = solve_batch(**{**mixed[17], name: stacked})
        assert_equals_single(batch, [mixed[17]] * 3)


def bits(batch):
    arrays = (batch.codes, batch.x, batch.y, batch.z, batch.z_box, batch.residuals)
    return [array.tobytes() for array in arrays], batch.messages


def test_the_bits_do_not_depend_on_the_threads_or_on_the_neighbours(mixed):
    stacked = stack(mixed)
    expected = bits(solve_batch(**stacked, threads=1))
    for threads in (2, 3, 50):
        assert bits(solve_batch(**stacked, threads=threads)) == expected
    order = np.random.default_rng(0).permutation(len(mixed))
    permuted = solve_batch(**{name: array[order] for name, array in stacked.items()})
    assert permuted.x.tobytes() == solve_batch(**stacked).x[order].tobytes()


def test_a_weight_of_the_item_before_is_not_used():
    """Equations that contradict each other, after an item with others."""
    P, A = np.diag([0.0, 2.0]), np.array([[-2.0, 0], [-1, -2], [6, 4], [-6, -4]])
    b = np.array([[-0.004, 3.998, -7.988, 7.988], [0.0, 3.7, -7.7, 8.2]])
    q = np.array([[18.002, 11.998], [18.0, 11.8]])
    both, alone = solve_batch(P, q, A=A, b=b), solve_batch(P, q[1:], A=A, b=b[1:])
    assert alone.statuses == [Status.PRIMAL_INFEASIBLE]
    assert both.y[1].tobytes() == alone.y[0].tobytes()


def test_the_entries_of_the_first_item_do_not_choose_the_way_of_others():
    """Of two QPs with a singular P only the full one is for the dual method."""
    problems = []
    for fill in (1.0, 0.05):
        rng = np.random.default_rng(1)
        F, G = (
            rng.normal(size=shape) * (rng.random(shape) < fill)
            for shape in ((90, 20), (30, 90))
        )
        P, q, one = F @ F.T, rng.normal(size=90), np.ones(90)
        problems.append(QP(0.5 * (P + P.T), q, G, one[:30], None, None, -one, one))
    for order in (problems, problems[::-1]):
        parts = {k: np.array(v) for k, *v in zip(NAMES, *order, strict=True)}
        both = solve_batch(**parts | {"A": None, "b": None})
        for found, problem in zip(both, order, strict=True):
            assert found.form == solve_qp(*problem).form


def test_a_bad_item_harms_no_other(mixed):
    expected = bits(solve_batch(**stack(mixed)))
    stacked = stack(mixed)
    stacked["P"][2] *= -1.0
    stacked["q"][5, 1] = np.nan
    stacked["G"][6, 0, 0] = np.inf
    stacked["P"][7, 0, 1] += 1.0
    stacked["lb"][8, 0] = stacked["ub"][8, 0] = 1.0
    stacked["lb"][8, 0] = 2.0
    batch = solve_batch(**stacked)
    bad = [2, 5, 6, 7, 8]
    invalid = [Status.INVALID] * 4
    assert [batch.statuses[i] for i in bad] == [*invalid, Status.PRIMAL_INFEASIBLE]
    assert "positive semidefinite" in batch.messages[2]
    assert {type(number) for number in batch.messages} == {int}
    assert batch[5].message == "q must be finite, got nan at (1)"
    assert batch[6].message == "G must be finite, got inf at (0, 0)"
    assert np.isnan(batch.x[bad]).all()
    others = np.delete(np.arange(20), bad)
    assert batch.x[others].tobytes() == solve_batch(**stack(mixed)).x[others].tobytes()
    assert bits(solve_batch(**stack(mixed))) == expected


@pytest.mark.parametrize("shape", [(1,), (2, 1)])
def test_a_huge_side_that_all_share_is_a_row_of_each_item(shape):
    """1e21 x <= 1e20 is a constraint, x <= 1e20 is none."""
    G, h = np.array([[[1e21]], [[1.0]]]), np.full(shape, 1e20)
    batch = solve_batch(np.eye(1), np.array([-5.0]), G, h)
    assert [status.value for status in batch.statuses] == ["invalid", "solved"]
    assert "h must be +inf where there is no constraint" in batch.messages[0]
    assert batch.x[1] == 5.0
    assert batch.backward(dx=np.ones((2, 1))).q.sum() == -1.0


def test_a_warm_start_saves_iterations(mixed):
    problems = [problem for i, problem in enumerate(mixed) if i not in (3, 11)]
    first = solve_batch(**stack(problems))
    second = solve_batch(**stack(problems), warm_start=first)
    assert second.iterations.sum() < first.iterations.sum()
    np.testing.assert_allclose(second.obj, first.obj, atol=1e-9)
    solve_batch(**stack(mixed), warm_start=solve_batch(**stack(mixed)))
    with pytest.raises(ValueError, match="warm_start must have 20 items, got 18"):
        solve_batch(**stack(mixed), warm_start=first)
    for other in (solve_qp([[1.0]], [1.0]), solve_batch(np.eye(1), np.ones((20, 1)))):
        with pytest.raises(ValueError, match=r"^warm_start.x must have shape \(8,\)"):
            solve_batch(**stack(mixed), warm_start=other)
    with pytest.raises(TypeError, match="warm_start must be a QPResult"):
        solve_batch(**stack(mixed), warm_start=1.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"q": np.zeros((3, 8))}, "q must have 20 items to match P, got 3"),
        ({"q": 1.0}, r"q must have shape \(8,\), or \(N, 8\) .*, got \(\)"),
        ({"h": np.zeros((20, 5))},
         r"h must have shape \(12,\), or \(N, 12\) for N items, to match G of shape "
         r"\(12, 8\), got \(20, 5\)"),
        ({"h": np.zeros((20, 1, 1, 12))}, r"h must have shape .*got \(20, 1, 1, 12\)"),
        ({"G": np.zeros((1, 20, 12, 8))}, r"G must have two dimensions, or three"),
        ({"G": None}, "h was given without G: pass both or neither"),
        ({"lb": np.full(8, np.nan)}, "lb must not hold NaN"),
        ({"P": -np.eye(8)}, "P must be positive semidefinite"),
        ({"verbose": True}, "verbose is for"),
        ({"threads": 0}, "threads must be >= 1"),
    ],
)  # fmt: skip
def test_what_all_share_is_checked_at_once(mixed, changes, message):
    with pytest.raises(ValueError, match=message):
        solve_batch(**{**stack(mixed), **changes})


def test_without_a_batch_axis_there_is_one_item(mixed):
    for problem in mixed:
        columns = {k: v[:, None] if v.ndim == 1 else v for k, v in problem.items()}
        for data in (problem, columns):
            batch = solve_batch(**data)
            assert batch.x.shape == (1, 8)
            assert_equals_single(batch, [problem])
    gradients = solve_batch(**mixed[0]).backward(dx=np.ones((1, 8)))
    assert gradients.P.shape == (8, 8)


def test_what_solve_qp_takes_a_batch_takes(mixed):
    """One row as a vector; columns and rows of vectors, of all items and of each."""
    data = mixed[17] | {"A": np.zeros((0, 8)), "b": np.zeros(0)}
    data |= {"G": np.ones(8), "q": np.array([one["q"] for one in mixed])}
    h = np.linspace(-1.0, 1.0, 20)
    own = data | {"G": np.ones((1, 8))}
    singles = [{**own, "q": q, "h": h[i : i + 1]} for i, q in enumerate(data["q"])]
    for shape in ((20, 1), (20, 1, 1)):
        for q in (data["q"], data["q"][:, :, None], data["q"][:, None, :]):
            batch = solve_batch(**{**data, "q": q, "h": h.reshape(shape)})
            assert_equals_single(batch, singles)


def test_items_too_large_to_be_solved_together():
    G = np.random.default_rng(0).standard_normal((2000, 2))
    problem = {"P": np.eye(2), "q": np.ones(2), "G": G, "h": np.ones(2000)}
    q = np.array([[1.0, 1.0], [-2.0, 1.0], [3.0, -4.0]])
    batch = solve_batch(**{**problem, "q": q})
    for found, q_i in zip(batch, q, strict=True):
        single = solve_qp(**{**problem, "q": q_i})
        np.testing.assert_allclose(found.x, single.x, atol=1e-12)


@pytest.mark.parametrize("P", [np.eye(3), np.empty((0, 3, 3))])
def test_an_empty_batch_has_an_empty_result(P):
    batch = solve_batch(P, np.empty((0, 3)))
    assert len(batch) == 0
    assert batch.x.shape == (0, 3)
    assert list(batch) == []
    assert batch.backward(dx=np.empty((0, 3))).P.shape == P.shape


def test_infeasible_items_have_their_closest_points(mixed):
    batch = solve_batch(**stack(mixed), infeasible="closest")
    assert set(batch.closest) == {3}
    single = solve_qp(**mixed[3], infeasible="closest").closest
    np.testing.assert_allclose(batch[3].closest.x, single.x, atol=1e-9)
    assert batch[4].closest is None


def test_ctrl_c_ends_a_batch(mixed, monkeypatch):
    """An error that is no Exception ends all threads."""
    calls = []

    def interrupt(*arguments, **names):
        calls.append(1)
        raise KeyboardInterrupt

    monkeypatch.setattr("namlcp.qp.batch.solve_checked", interrupt)
    with pytest.raises(KeyboardInterrupt):
        solve_batch(**stack(mixed), threads=2, time_limit=1e3)
    assert len(calls) <= 16
