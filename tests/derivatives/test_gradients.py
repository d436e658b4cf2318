"""What gradients look like: their storage, shapes and words, alone and of batches."""

import pickle

import numpy as np
import pytest
import scipy.sparse as sp

from namlcp import Relaxation, solve_batch, solve_lcp, solve_qp
from validation.derivatives.cases import contradictory, regular_qp

ITEMS = 5


# ---- batches


def batch_data(seed=0, n=4, m=3):
    rng = np.random.default_rng(seed)
    B = rng.standard_normal((ITEMS, 2 * n, n))
    P = B.transpose(0, 2, 1) @ B
    q, h = 5.0 * rng.standard_normal((ITEMS, n)), rng.random((ITEMS, m))
    q[2, 0] = np.nan
    return P, q, rng.standard_normal((m, n)), h, -np.ones(n)


@pytest.mark.parametrize("threads", [1, 3])
def test_gradients_of_a_batch_are_those_of_the_items(threads):
    P, q, G, h, lb = batch_data()
    batch = solve_batch(P, q, G, h, lb=lb)
    dx, dz = np.ones_like(batch.x), np.ones_like(batch.z)
    found = batch.backward(dx=dx, dz=dz, threads=threads)
    assert found.used.tolist() == [True, True, False, True, True]
    assert not found.weak.any()
    assert not found.singular.any()
    total = {"G": 0.0, "lb": 0.0}
    for i in np.flatnonzero(found.used):
        alone = solve_qp(P[i], q[i], G, h[i], lb=lb)
        own = alone.backward(dx=dx[i], dz=dz[i])
        for name in ("P", "q", "h"):
            mine = getattr(found, name)[i]
            np.testing.assert_allclose(mine, getattr(own, name), 1e-12, 1e-12)
        total = {name: part + getattr(own, name) for name, part in total.items()}
    assert not found.P[2].any()
    assert not found.q[2].any()
    np.testing.assert_allclose(found.G, total["G"], atol=1e-12)
    np.testing.assert_allclose(found.lb, total["lb"], atol=1e-12)
    assert (found.A.shape, found.b.shape) == ((0, 4), (0,))


@pytest.mark.parametrize("threads", [1, 2])
def test_kinks_of_a_batch_are_those_of_the_items(threads):
    """x = max(c, 0): free, weak, and at two equal bounds, one of them a row of G."""
    q = np.array([[-1.0], [0.0], [1.0]])
    G, h = -np.ones((1, 1)), np.array([[1.0], [1.0], [0.0]])
    batch = solve_batch(np.eye(1), q, G, h, lb=np.zeros(1))
    found = batch.backward(dx=np.ones((3, 1)), threads=threads)
    for i, item in enumerate(batch):
        own = item.backward(dx=[1.0])
        assert (found.weak[i], found.singular[i]) == (own.weak, own.singular)
        assert np.array_equal(found.q[i], own.q)
        assert np.array_equal(found.h[i], own.h)
    assert found.weak.tolist() == [0, 1, 1]
    # the row x <= 1 twice: one of the two carries the multiplier
    q = np.array([[-2.0], [-3.0]])
    batch = solve_batch(np.eye(1), q, np.ones((2, 1)), np.ones(2))
    found = batch.backward(dx=np.ones((2, 1)))
    assert found.h.tolist() in ([2.0, 0.0], [0.0, 2.0])
    assert not found.q.any()


# ---- storage and shapes


def test_sparse_gradients_stand_on_the_users_pattern():
    qp = regular_qp(3)
    P, G, A = (np.where(np.abs(M) > 0.4, M, 0.0) for M in (qp.P, qp.G, qp.A))
    P = P + 20.0 * np.eye(P.shape[0])
    exact = {"eps_abs": 1e-13, "eps_rel": 1e-13}
    given = sp.csr_array(P), sp.coo_array(G), A
    dense = solve_qp(P, qp.q, G, qp.h, A, qp.b, **exact)
    mixed = solve_qp(given[0], qp.q, given[1], qp.h, A, qp.b, **exact)
    gx = np.ones(qp.q.size)
    full, found = dense.backward(dx=gx), mixed.backward(dx=gx)
    assert (found.P.format, found.G.format, type(found.A)) == ("csr", "csc", np.ndarray)
    for own, user, whole in ((found.P, P, full.P), (found.G, G, full.G)):
        assert own.nnz == np.count_nonzero(user)
        np.testing.assert_allclose(own.toarray(), np.where(user != 0.0, whole, 0.0))
    np.testing.assert_allclose(found.A, full.A)


def test_a_sparse_matrix_shared_by_a_batch_keeps_its_pattern():
    _, q, _, h, lb = batch_data()
    G = sp.csr_array(np.eye(3, 4))
    batch = solve_batch(sp.eye_array(4, format="csc"), q, G, h, lb=lb)
    found = batch.backward(dx=np.ones_like(batch.x))
    assert (found.G.format, found.G.nnz, found.P.nnz) == ("csr", 3, 4)


def test_gradients_of_closest_points_are_on_the_entries_of_sparse_matrices():
    dense = contradictory(0, 5, 14)
    dense["G"][dense["G"] < -1.0] = 0.0
    dense["h"][1] = -dense["h"][0] - 9.0
    sparse = dense | {k: sp.csr_array(dense[k]) for k in "PGA"}
    full, found = (closest(d, "closest").backward(np.ones(5)) for d in (dense, sparse))
    assert found.G.format == "csr"
    assert found.G.nnz == sparse["G"].nnz
    at = dense["G"] != 0.0
    np.testing.assert_allclose(found.G.toarray()[at], full.G[at], atol=1e-9)


def test_what_is_absent_or_inactive_has_no_gradient():
    result = solve_qp(np.eye(2), [1.0, -1.0])
    found = result.backward(dx=[1.0, 2.0])
    assert found.q.tolist() == [-1.0, -2.0]
    assert (found.G.shape, found.h.shape, found.A.shape) == ((0, 2), (0,), (0, 2))
    result = solve_qp(np.eye(2), [1.0, -1.0], [[1.0, 1.0], [0, 1]], [np.inf, 9])
    found = result.backward(dx=[1.0, 2.0], dz=[1.0, 1.0])
    for name in ("lb", "ub", "h", "G"):
        assert not getattr(found, name).any()


def test_without_variables_multipliers_stay():
    result = solve_qp(np.zeros((0, 0)), [], A=np.zeros((2, 0)), b=[0.0, 0.0])
    for tangent in result.forward(db=[1.0, 2.0]), result.directional(db=[0.0, 0.0]):
        assert tangent.x.size == 0
        assert tangent.y.tolist() == [0.0, 0.0]


KINDS = [np.array, sp.csr_array, sp.csc_array]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("skew", [0.0, 1.0])
def test_without_a_free_unknown_the_bounds_alone_move(kind, skew):
    result = solve_qp(kind(np.eye(2)), [1.0, 2.0], lb=[0.0, 0.0], ub=[5.0, 5.0])
    found = result.backward(dx=[1.0, 2.0])
    assert not found.q.any()
    assert found.lb.tolist() == [1.0, 2.0]
    assert not found.ub.any()
    result = solve_lcp(kind(np.array([[2.0, skew], [-skew, 2.0]])), [1.0, 2.0])
    found = result.backward(dz=[1.0, 2.0], dw=[1.0, 0.0])
    assert found.q.tolist() == [1.0, 0.0]
    np.testing.assert_allclose(found.lower, [3.0, 2.0 + skew])
    assert type(found.A) is (np.ndarray if kind is np.array else kind)
    assert result.forward(dq=[1.0, 1.0]).w.tolist() == [1.0, 1.0]


@pytest.mark.parametrize("kind", KINDS)
def test_a_linear_program_moves_with_its_vertex(kind):
    """min x_1 + x_2, 2 x_1 + x_2 >= 3, x_1 + 2 x_2 >= 3: x = (1, 1)."""
    G = np.array([[-2.0, -1.0], [-1.0, -2.0]])
    result = solve_qp(kind(np.zeros((2, 2))), np.ones(2), kind(G), [-3.0, -3.0])
    tangent = result.forward(dh=[1.0, 0.0])
    np.testing.assert_allclose(tangent.x, np.linalg.solve(G, [1.0, 0.0]))
    assert (tangent.weak, tangent.singular) == (0, False)


# ---- what is refused


def closest(data, choice):
    exact = {"eps_abs": 1e-12, "eps_rel": 1e-13}
    return solve_qp(**data, infeasible=choice, **exact).closest


TWO, NAN = np.ones(2), np.array([[np.nan], [1.0]])
DATA = contradictory(0, 5, 14)
HARD = Relaxation(h=np.inf, b=np.inf)
RESULTS = {
    "QP": lambda: solve_qp(np.eye(2), [1.0, -1.0]),
    "LCP": lambda: solve_lcp(np.eye(2), [1.0, -1.0]),
    "infeasible": lambda: solve_qp(np.eye(1), [0.0], lb=[1.0], ub=[0.0]),
    "batch": lambda: solve_batch(*batch_data()[:2]),
    "nan in a batch": lambda: solve_batch(np.eye(1), np.array([[-1.0], [np.nan]])),
    "closest": lambda: closest(DATA, "closest"),
    "elastic": lambda: closest(DATA, "elastic"),
    "hard": lambda: closest(DATA, HARD),
    "operator": lambda: solve_lcp(sp.linalg.aslinearoperator(np.eye(2)), [1.0, -1.0]),
}


@pytest.mark.parametrize(
    ("name", "call", "message"),
    [
        ("QP", lambda r: r.backward(dx=np.ones(3)), r"dx must have shape \(2,\) to"),
        ("QP", lambda r: r.forward(dq=np.ones(3)), r"dq must have shape \(2,\) to"),
        ("QP", lambda r: r.forward(dP=np.ones((3, 2))), r"dP must have shape \(2, 2\)"),
        ("QP", lambda r: r.backward(dx=[np.nan, 0.0]), "dx must be finite, got nan"),
        ("LCP", lambda r: r.backward(dz=np.ones(3)), r"dz must have shape \(2,\) to"),
        ("LCP", lambda r: r.forward(dA=np.ones((3, 2))), r"dA must have shape \(2, 2"),
        ("infeasible", lambda r: r.backward(dx=[1.0]), "solved, got primal_infeasible"),
        ("hard", lambda r: r.backward(np.ones(5)), "solved, got primal_infeasible"),
        ("batch", lambda r: r.backward(dx=np.ones(4)), r"dx must have shape \(5, 4\)"),
        ("nan in a batch", lambda r: r.backward(dx=NAN), r"finite, got nan at \(0, 0"),
        ("closest", lambda r: r.backward(None, np.ones(3)), "dshift_h must have shape"),
        ("elastic", lambda r: r.backward(np.ones(5)), "shifts of norm 2, got those of"),
        ("operator", lambda r: r.backward(), "the entries of A, got a LinearOperator"),
    ],
)  # fmt: skip
def test_errors_name_what_is_wrong(name, call, message):
    with pytest.raises(ValueError, match=message):
        call(RESULTS[name]())


@pytest.mark.parametrize("name", ["QP", "LCP", "batch", "closest"])
def test_a_pickled_result_has_lost_its_problem(name):
    with pytest.raises(ValueError, match="has lost"):
        pickle.loads(pickle.dumps(RESULTS[name]())).backward(np.ones(5)[:2])


def test_an_item_that_is_not_finite_harms_no_other():
    found = RESULTS["nan in a batch"]().backward(dx=np.array([[1.0], [np.nan]]))
    assert found.q.tolist() == [[-1.0], [0.0]]
