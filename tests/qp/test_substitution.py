"""Free columns: taken out, put back exactly, and kept for later."""

import numpy as np
import pytest
from problems_qp import (
    assert_certificate,
    assert_solves_qp,
    complementary,
    make_qp,
    residual_form,
)
from scipy.sparse import csc_array, csr_array, eye_array, hstack, random_array, vstack

import namlcp
from namlcp.checks import transposed
from namlcp.linalg.csc import (
    add_transposed,
    by_rows,
    submatrix,
    times,
    with_squares,
    without_zeros,
)
from namlcp.options import DEFAULT_OPTIONS
from namlcp.qp.guess import NO_GUESS, make_guess
from namlcp.qp.solve import solve_checked
from namlcp.qp.transforms import substitution
from namlcp.qp.transforms.substitution import Substitution, substitute
from namlcp.status import Status


def canonical(M):
    return make_qp(np.zeros((M.shape[1],) * 2), np.zeros(M.shape[1]), G=M, h=0).G


def solve(qp, guess=NO_GUESS, memory=None):
    return solve_checked(qp, DEFAULT_OPTIONS, guess, 0.0, memory=memory)


@pytest.mark.parametrize(("rows", "n"), [(30, 8), (300, 8), (8, 30)])
def test_least_squares(rows, n):
    qp, B, c = residual_form(0, rows, n)
    smaller = substitute(qp)
    assert smaller.problem.q.size == n
    assert smaller.problem.b.size == 0
    np.testing.assert_allclose(smaller.problem.P.toarray(), 2 * B.T @ B, atol=1e-12)
    result = solve(qp)
    assert_solves_qp(qp, result, 1e-11)
    if rows > n:
        x = np.linalg.lstsq(B, c, rcond=None)[0]
        np.testing.assert_allclose(result.x[rows:], x, atol=1e-12)


@pytest.mark.parametrize("seed", range(5))
def test_points_and_multipliers_of_random_problems(seed):
    """Planted free columns beside rows with one entry; the optimum is known."""
    rng = np.random.default_rng(seed)
    known = complementary(seed, 12, 10, 3, 5, 0.5)
    base = known.qp
    k = 6  # residuals t = Ex - f, half of them with a linear cost only
    E = rng.standard_normal((k, 12)) * (rng.random((k, 12)) < 0.4)
    p = np.where(np.arange(k) % 2, 0.5 + rng.random(k), 0.0)
    t = rng.standard_normal(k)
    y_t = rng.standard_normal(k)
    entry = rng.uniform(0.5, 2.0, k) * rng.choice((-1, 1), k)
    P = np.zeros((12 + k, 12 + k))
    P[:12, :12] = base.P.toarray()
    P[12:, 12:] = np.diag(p)
    q = np.concatenate((base.q - E.T @ y_t, -p * t - entry * y_t))
    A = np.block([[base.A.toarray(), np.zeros((3, k))], [E, np.diag(entry)]])
    b = np.concatenate((base.b, E @ known.x + entry * t))
    finite = np.isfinite(base.ub)
    single = np.eye(12)[finite] * 3.0
    G = np.vstack((base.G.toarray(), single))
    G = np.hstack((G, np.zeros((G.shape[0], k))))
    h = np.concatenate((base.h, 3.0 * base.ub[finite]))
    lb = np.concatenate((base.lb, np.full(k, -np.inf)))
    qp = make_qp(P, q, G, h, A, b, lb)
    smaller = substitute(qp)
    assert smaller.columns.size == k
    assert smaller.problem.h.size == h.size
    result = solve(qp)
    assert_solves_qp(qp, result, 1e-10)
    x = np.append(known.x, t)
    optimum = 0.5 * x @ P @ x + q @ x
    assert result.obj == pytest.approx(optimum, abs=1e-9)
    again = solve(qp, make_guess(qp, None, result))
    assert again.status is Status.SOLVED
    assert again.iterations <= max(1, result.iterations // 2)  # P is singular


def test_short_rows_are_substituted_where_long_ones_would_fill_in():
    qp, _, _ = residual_form(2, 5, 200, weight=0.1)
    assert substitute(qp) is None
    short = csr_array(([1.0, -1.0, 1.0], ([0, 0, 1], [5, 6, 7])), shape=(2, 405))
    P = np.diag(np.concatenate((qp.P.diagonal(), np.ones(2))))
    A = vstack((hstack((qp.A, csr_array((5, 2)))), hstack((short, -eye_array(2)))))
    G = hstack((qp.G, csr_array((400, 2))))
    wide = make_qp(P, np.append(qp.q, [0, 0]), G, qp.h, A, np.append(qp.b, [1.0, 2.0]))
    smaller = substitute(wide)
    np.testing.assert_array_equal(smaller.by, [5, 6])
    assert_solves_qp(wide, solve(wide), 1e-10)


def test_a_negative_direction_is_not_hidden_by_a_square():
    # x1 = t: the substituted P would be 2 - 1 > 0
    A = np.array([[1.0, -1.0]])
    qp = make_qp(np.diag([-1.0, 2.0]), np.ones(2), A=A, b=np.zeros(1))
    with pytest.raises(ValueError, match="P must be positive semidefinite"):
        solve(qp)


@pytest.mark.parametrize("offset", [1e-3, 1.0])
def test_contradicting_single_rows_are_proved(offset):
    G = np.array([[1.0, 0.0], [-2.0, 0.0], [1.0, 1.0]])
    h = np.array([1.0, -2.0 - 2 * offset, 5.0])
    qp = make_qp(np.eye(2), np.ones(2), G, h)
    result = solve(qp)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert_certificate(qp, result)


def test_contradicting_equations_of_one_variable_are_proved():
    A = np.array([[2.0, 0.0], [4.0, 0.0]])
    qp = make_qp(np.eye(2), np.ones(2), A=A, b=np.array([2.0, 5.0]))
    result = solve(qp)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert_certificate(qp, result)


def test_proofs_come_back_from_the_smaller_problem():
    qp, _, _ = residual_form(3, 12, 4, lower=0.0)
    G = vstack((qp.G, hstack((csr_array((1, 12)), csr_array(np.ones((1, 4)))))))
    impossible = make_qp(
        qp.P.toarray(), qp.q, G, np.append(qp.h, -1.0), qp.A.toarray(), qp.b
    )
    result = solve(impossible)
    assert result.status is Status.PRIMAL_INFEASIBLE
    assert_certificate(impossible, result)
    # x5 is not in the residuals and costs -1
    P = np.diag(np.append(qp.P.diagonal(), 0.0))
    wide = hstack((qp.A, csr_array((12, 1))))
    unbounded = make_qp(
        P, np.append(qp.q, -1.0), hstack((qp.G, csr_array((4, 1)))), qp.h, wide, qp.b
    )
    result = solve(unbounded)
    assert result.status is Status.DUAL_INFEASIBLE
    assert_certificate(unbounded, result)
    assert (result.x.size, result.y.size, result.z.size) == (17, 12, 4)


def test_contradicting_bounds_of_the_user_are_left_to_presolve():
    qp, _, _ = residual_form(4, 5, 2)
    lb = np.full(7, -np.inf)
    lb[6] = 2.0
    ub = np.full(7, np.inf)
    ub[6] = 1.0
    assert substitute(qp._replace(lb=lb, ub=ub)) is None
    assert solve(qp._replace(lb=lb, ub=ub)).status is Status.PRIMAL_INFEASIBLE


def test_ill_conditioned_residuals_are_still_exact():
    """A polynomial of degree 9 on 60 points: cond(B'B) is 1e14."""
    x = np.linspace(0.0, 1.0, 60)
    B = np.vander(x, 10)
    P = np.diag(np.concatenate((np.ones(60), np.zeros(10))))
    qp = make_qp(P, np.zeros(70), A=np.hstack((-np.eye(60), B)), b=np.sin(5 * x))
    result = solve(qp)
    assert_solves_qp(qp, result, 1e-9)
    best = np.linalg.lstsq(B, np.sin(5 * x), rcond=None)[1][0]
    assert 2 * result.obj == pytest.approx(best, rel=1e-4)


def test_kernels_are_scipys():
    rng = np.random.default_rng(0)
    M = canonical(random_array((30, 20), density=0.2, rng=rng))
    B = canonical(random_array((30, 20), density=0.1, rng=rng))
    rows, columns = np.array([1, 4, 29]), np.array([0, 7, 8, 19])
    np.testing.assert_array_equal(
        submatrix(M, rows, columns).toarray(), M.toarray()[np.ix_(rows, columns)]
    )
    assert submatrix(M, np.arange(30), np.arange(20)) is M
    np.testing.assert_array_equal(by_rows(M).toarray(), M.toarray())
    indptr, indices, data = transposed(M.indptr, M.indices, M.data, 30)
    turned = csc_array((data, indices, indptr), shape=(20, 30))
    np.testing.assert_array_equal(turned.toarray(), M.toarray().T)
    P = canonical(M.T @ M)
    weight = rng.random(30)
    for rest in (B, canonical(csc_array(rng.random((30, 20))))):
        S = with_squares(P, rest, weight)
        exact = P.toarray() + rest.toarray().T @ np.diag(weight) @ rest.toarray()
        np.testing.assert_allclose(S.toarray(), exact, atol=1e-13)
        assert S.has_sorted_indices
    M.data[3] = 0.0
    assert without_zeros(M).nnz == M.nnz - 1
    assert without_zeros(B) is B


def test_products_sum_in_scipys_order():
    rng = np.random.default_rng(1)
    M = canonical(random_array((40, 30), density=0.3, rng=rng))
    x, z = rng.standard_normal(30), rng.standard_normal(40)
    np.testing.assert_array_equal(times(M, x), M @ x)
    out = np.zeros(30)
    add_transposed(M, z, out)
    np.testing.assert_array_equal(out, M.T @ z)
    dense = M.toarray()
    np.testing.assert_allclose(times(dense, x), M @ x, atol=1e-14)
    add_transposed(dense, z, out)
    np.testing.assert_allclose(out, 2 * (M.T @ z), atol=1e-13)


def test_public_call_takes_the_same_way():
    qp, B, _ = residual_form(7, 50, 5, lower=0.0)
    result = namlcp.solve_qp(*qp)
    assert result.form == "dual"
    assert result.x.size == 55
    assert_solves_qp(qp, result, 1e-11)
    np.testing.assert_allclose(result.x[:50], B @ result.x[50:] - qp.b, atol=1e-12)


def test_full_rows_are_squared_in_blocks(monkeypatch):
    rng = np.random.default_rng(2)
    B = canonical(csc_array(rng.random((50, 6))))
    P = canonical(csc_array(np.eye(6)))
    monkeypatch.setattr("namlcp.linalg.csc.MOST_DENSE", 40)
    exact = np.eye(6) + B.toarray().T @ B.toarray()
    found = with_squares(P, B, np.ones(50)).toarray()
    np.testing.assert_allclose(found, exact, atol=1e-12)


def test_what_does_not_pass_the_judge_is_solved_as_it_came(monkeypatch):
    qp, _, _ = residual_form(11, 30, 8, lower=0.0)
    point = Substitution.point

    def spoilt(self, inner):
        outer = point(self, inner)
        return outer._replace(x=outer.x + 1e-3)

    monkeypatch.setattr(Substitution, "point", spoilt)
    result = solve(qp)
    assert result.form == "dual"
    assert_solves_qp(qp, result, 1e-10)


@pytest.mark.parametrize("kind", ["infeasible", "unbounded"])
def test_a_proof_that_does_not_pass_is_looked_for_again(monkeypatch, kind):
    G = np.array([[1.0, 1.0], [-1.0, -1.0], [1.0, 0.0]])
    h = np.array([1.0, -2.0, 5.0]) if kind == "infeasible" else np.array([1.0, 9, 5])
    P = np.eye(2) if kind == "infeasible" else np.zeros((2, 2))
    qp = make_qp(P, np.array([1.0, -1.0]), G, h)
    spoilt = {"infeasible": "certificate", "unbounded": "ray"}[kind]
    wrong = {
        "certificate": lambda self, point: point._replace(z=np.zeros(3)),
        "ray": lambda self, d: np.ones(2),
    }[spoilt]
    monkeypatch.setattr(Substitution, spoilt, wrong)
    result = solve(qp)
    assert_certificate(qp, result)


def test_row_without_end_beside_its_multiple():
    """h = -inf beside a proportional row: a proof at sight, and no warning."""
    G = np.array([[1.0, 1.0], [1.0, 1.0], [-1.0, -1.0]])
    qp = make_qp(np.eye(2), np.ones(2), G, np.array([1.0, -np.inf, np.inf]))
    assert solve(qp).status is Status.PRIMAL_INFEASIBLE
    G = np.array([[1.0, 1.0], [-1.0, -1.0]])
    qp = make_qp(np.eye(2), np.ones(2), G, np.array([-np.inf, -np.inf]))
    assert solve(qp).status is Status.PRIMAL_INFEASIBLE


def plain_choice(qp):
    """Return {row of A: column} as the docstrings define them."""
    P, G, A = (M.toarray() for M in (qp.P, qp.G, qp.A))
    C, pairs = np.vstack((G, A)), {}
    for i in range(qp.b.size):
        free = [
            j
            for j in np.flatnonzero(A[i])
            if np.isinf([qp.lb[j], qp.ub[j]]).all()
            and np.count_nonzero(C[:, j]) == 1
            and not np.delete(P[:, j], j).any()
            and P[j, j] >= 0.0
            and abs(A[i, j]) >= substitution.PIVOT * abs(A[i]).max()
        ]
        if free:
            pairs[i] = int(max(free, key=lambda j: abs(A[i, j])))
    squared = [i for i, j in pairs.items() if P[j, j] > 0.0]
    length = {i: np.count_nonzero(A[i]) - 1 for i in pairs}
    width = np.count_nonzero(A[squared].any(axis=0)) - len(squared)
    least = min(sum(length[i] ** 2 for i in squared), width**2)
    allowed = substitution.FILL * sum(length[i] for i in squared) + substitution.SMALL
    if least > allowed:
        for i in squared:
            if length[i] > substitution.SHORT:
                del pairs[i]
    return pairs


@pytest.mark.parametrize("seed", range(40))
def test_what_is_substituted_is_what_the_definition_says(seed):
    """Rows and columns of few entries, some infinite sides, stored zeros."""
    rng = np.random.default_rng(seed)
    n, m, p = rng.integers(1, 12), rng.integers(0, 8), rng.integers(0, 6)
    G, A = (
        rng.integers(-2, 3, (k, n)) * (rng.random((k, n)) < 1.5 / n) for k in (m, p)
    )
    A = A + (rng.random((p, n)) < 0.1) * 1e-4
    P = np.diag(rng.integers(0, 3, n) * 1.0)
    P[0, 0] += 1.0
    h = np.where(rng.random(m) < 0.2, np.inf, rng.integers(-1, 4, m) * 1.0)
    lb = np.where(rng.random(n) < 0.7, -np.inf, -1.0)
    ub = np.where(rng.random(n) < 0.7, np.inf, 1.0)
    q, b = rng.standard_normal(n), rng.integers(-1, 2, p) * 1.0
    qp = make_qp(P, q, G.astype(float), h, A.astype(float), b, lb, ub)
    for M in (qp.G, qp.A):
        if M.nnz > 2:
            M.data[rng.integers(M.nnz)] = 0.0
    pairs = plain_choice(qp)
    found = substitute(qp)
    if not pairs:
        assert found is None
        return
    assert dict(zip(found.by.tolist(), found.columns.tolist(), strict=True)) == pairs


def test_a_tiny_problem_is_solved_as_it_came(monkeypatch):
    """The dense form is quicker than a look for a substitution."""
    qp, _, _ = residual_form(12, 5, 3, lower=0.0)
    assert substitute(qp) is not None
    expected = solve(qp)
    monkeypatch.setattr("namlcp.qp.solve.substitute", lambda *arguments: 1 / 0)
    result = solve(qp)
    assert_solves_qp(qp, result, 1e-11)
    assert (result.form, result.obj) == ("dual", expected.obj)


def test_a_tiny_problem_that_the_dense_form_leaves_is_substituted(monkeypatch):
    qp, _, _ = residual_form(12, 5, 3, lower=0.0)
    monkeypatch.setattr("namlcp.qp.solve.solve_once", lambda *arguments: None)
    assert_solves_qp(qp, solve(qp), 1e-11)
