"""Large dense QPs: what `prepare` makes by BLAS equals plain products."""

import numpy as np
import pytest

import namlcp
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.problem import qp_data
from namlcp.qp.responses.active import DONE
from namlcp.qp.responses.large import prepare
from namlcp.qp.responses.solve import DenseResponses, parted

LIMITS = DEFAULT_OPTIONS.limits()


def spread_qp(seed, n=8, m=12):
    """A QP whose unconstrained minimum violates several rows."""
    rng = np.random.default_rng(seed)
    B, G = rng.standard_normal((2 * n, n)), rng.standard_normal((m, n))
    q, h = 20.0 * rng.standard_normal(n), rng.random(m)
    P = B.T @ B
    return qp_data(0.5 * (P + P.T), q, G, h, None, None, -np.ones(n), None)


def space_of(qp):
    space = DenseResponses(qp.P, qp.G, qp.A)
    space.now.is_single = True
    return space


def vector(address, size, kind):
    found = (kind * size).from_address(address)
    return np.frombuffer(found, kind).copy()


@pytest.mark.parametrize("seed", range(5))
def test_a_prepared_solve_gives_the_same(seed):
    qp = spread_qp(seed)
    points = []
    for is_prepared in (False, True):
        space = space_of(qp)
        if is_prepared:
            assert prepare(space.address, qp.joined())
            assert space.now.next_place > 0
        code, numbers = space.run(qp.joined(), LIMITS)
        assert code == DONE
        points.append(parted(numbers, qp.q.size, qp.h.size, 0)[0])
    for own, other in zip(*points, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-10, atol=1e-12)


def test_responses_are_plain_products():
    qp = spread_qp(0)
    space = space_of(qp)
    assert prepare(space.address, qp.joined())
    now, n, m = space.now, qp.q.size, qp.h.size
    inverse = np.linalg.inv(qp.P)
    violated = np.flatnonzero(qp.G @ -(inverse @ qp.q) > qp.h)
    owner = vector(now.owner, violated.size, np.ctypeslib.as_ctypes_type(np.int64))
    assert owner.tolist() == violated.tolist()
    kind = np.ctypeslib.as_ctypes_type(np.float64)
    found = vector(now.responses, violated.size * now.length, kind)
    U = qp.G[violated] @ inverse
    expected = np.hstack((U @ qp.G.T, U))
    assert now.length == n + m
    np.testing.assert_allclose(found.reshape(expected.shape), expected, atol=1e-12)
    assert now.is_ready
    assert now.is_inverted


@pytest.mark.parametrize("fault", ["nan", "asymmetric", "indefinite"])
def test_matrices_that_are_not_suited(fault):
    qp = spread_qp(1)
    P, n = qp.P.copy(), qp.q.size
    if fault == "nan":
        P[0, 0] = np.nan
    elif fault == "asymmetric":
        P[0, 1] += 1e-3
    else:
        P = np.diag(np.r_[np.ones(n - 1), -1.0])
    qp = qp._replace(P=P)
    assert not prepare(space_of(qp).address, qp.joined())


@pytest.mark.parametrize("kind", ["equations", "many rows", "singular"])
def test_some_are_prepared_without_responses(kind):
    qp = spread_qp(1, *((4, 9) if kind == "many rows" else (8, 12)))
    if kind == "equations":
        qp = qp._replace(A=qp.G[:2], b=np.zeros(2))
    elif kind == "singular":
        qp = qp._replace(P=np.diag([0.0, *np.ones(7)]))
    space = space_of(qp)
    assert prepare(space.address, qp.joined())
    assert space.now.next_place == 0
    code, numbers = space.run(qp.joined(), LIMITS)
    assert code == DONE
    point = parted(numbers, qp.q.size, qp.h.size, qp.b.size)[0]
    np.testing.assert_allclose(point.x, namlcp.solve_qp(*qp).x, atol=1e-10)
