"""Every QP of one table by every way a QP is solved: known answers and proofs."""

import families_qp as made
import numpy as np
import pytest
import scipy.sparse as sp
from cases_qp import CASES, REFUSED, simplex
from problems_lcp import laplacian
from problems_qp import (
    DATA,
    assert_certificate,
    assert_in_bounds,
    assert_solves_qp,
    complementary,
    dense,
    make_qp,
    maros_meszaros,
    residual_form,
    sparse,
)
from ways_qp import PARTIAL, WAYS, by_path

from namlcp import Status, qp_residuals, solve_qp

SOLVED, UNBOUNDED = Status.SOLVED, Status.DUAL_INFEASIBLE
PROVED = Status.PRIMAL_INFEASIBLE, UNBOUNDED


def judged(case, found, least=0.0):
    """All that is known of the case holds for what was found.

    least: the tolerance of a way that is asked alone, without the judge of `solve_qp`.
    """
    qp = case.qp
    allowed = case.status if isinstance(case.status, tuple) else (case.status,)
    assert found.status in allowed, (found.status, found.message)
    if case.says and found.message:
        assert case.says.split(".*")[0] in found.message
        assert case.says.split(".*")[-1] in found.message
    if found.status is not SOLVED:
        if found.status in PROVED:
            assert_certificate(sparse(qp), found)
        return
    assert_in_bounds(qp, found)
    unit = np.ones(qp.q.size) if case.unit is None else case.unit
    if case.plain is None:
        tol = max(case.tol, case.settings.get("eps_abs", 0.0), least)
        assert_solves_qp(qp, found, tol)
    else:
        there = unit * found.x, found.y, found.z, found.z_box / unit
        assert qp_residuals(*case.plain, *there).solved(1e-9, 1e-9)
    if case.obj is not None:
        value = 0.5 * found.x @ (qp.P @ found.x) + qp.q @ found.x
        assert value == pytest.approx(case.obj, rel=1e-8, abs=1e-8)
    for name, size in (("x", unit), ("z", 1.0), ("z_box", 1.0)):
        if getattr(case, name) is not None:
            mine = size * getattr(found, name)
            np.testing.assert_allclose(mine, getattr(case, name), 0.0, case.near)


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", CASES)
def test_each_way_gives_what_is_known(name, way):
    for case in CASES[name]:
        if way in case.ways:
            found = WAYS[way](case.qp, **case.settings)
            if found is not None:
                judged(case, found, 1e-9 if way in PARTIAL else 0.0)
            if case.form and way in ("dense", "batch"):
                assert found.form == case.form


# ---- what is refused


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("name", REFUSED)
def test_a_cost_that_is_not_convex_is_refused_by_each_way(name, way):
    qp = REFUSED[name]
    if way == "active set" and qp.q.size < 1000:
        assert WAYS[way](qp) is None
    elif way in PARTIAL:  # for sparse matrices the Solver asks before
        return
    elif qp.q.size < 1000 or way == "sparse":
        with pytest.raises(ValueError, match="P must be positive semidefinite"):
            WAYS[way](qp)


def test_the_threshold_of_convexity_is_named():
    with pytest.raises(ValueError, match="diagonal scaled to 1 is below -1e-06"):
        solve_qp(*dense(simplex(1.4e-6)))


def test_a_large_h_matrix_is_convex_without_a_factorisation(monkeypatch):
    """Badly scaled, so that its rows are not dominant."""
    d = sp.diags_array(10.0 ** np.random.default_rng(0).uniform(-2, 2, 400))
    P = make_qp(d @ laplacian(20) @ d, np.zeros(400)).P
    none = {"A": sp.eye_array(1, 400), "b": np.zeros(1), "max_iter": 1}
    monkeypatch.setattr("namlcp.qp.problem.MULTIGRID_ORDER", 400)
    with pytest.raises(ValueError, match="an eigenvalue of P"):
        solve_qp(P - 0.1 * (d @ d), np.ones(400), **none)
    monkeypatch.setattr("namlcp.qp.problem.has_positive_pivots", None)
    solve_qp(P, np.ones(400), **none)


V = np.append(np.array([1.0, 1.0, 100.0]), 0.0)


@pytest.mark.parametrize("way", sorted(WAYS.keys() - PARTIAL))
@pytest.mark.parametrize("scale", [1e-8, 1e-7, 1e-5, 1.0])
def test_what_is_convex_but_for_rounding_is_not_refused(scale, way):
    small = scale**2 * np.outer(V, V) + np.diag([0.0, 0.0, 0.0, 1.0])
    root = np.random.default_rng(0).standard_normal((20, 50))
    ones = {"lb": np.zeros(5), "ub": np.ones(5)}
    for qp in (
        simplex(0.7e-6),
        make_qp(small, np.zeros(4)),
        make_qp(np.ones((5, 5)), -np.ones(5), **ones),
        make_qp(root.T @ root, np.zeros(50)),
    ):
        assert WAYS[way](qp).status is SOLVED


# ---- how much work it takes, and where


SHORT = ["LP", "a degenerate vertex", "repeated rows", "one fixed"]


@pytest.mark.parametrize("way", ["path", "sparse", "general"])
@pytest.mark.parametrize("name", SHORT)
def test_a_start_at_the_solution_needs_no_iteration(name, way):
    (case,) = CASES[name]
    start = WAYS[way](case.qp)
    if way == "path":
        found = by_path(case.qp, start)
    else:
        found = solve_qp(*case.qp, warm_start=start, history=way == "general")
    judged(case, found)
    assert found.iterations == 0


@pytest.mark.parametrize("seed", range(80))
def test_a_start_at_a_degenerate_solution_needs_few(seed):
    case = made.singular(seed)
    start = solve_qp(*case.qp)
    found = solve_qp(*case.qp, warm_start=start)
    judged(case, found)
    assert found.iterations <= max(1, start.iterations)


@pytest.mark.parametrize("way", ["dense", "sparse", "Solver", "batch"])
@pytest.mark.parametrize("n", [2, 50])
def test_zero_at_all_bounds_takes_a_pivot_for_each(n, way):
    """There x is nothing but rounding."""
    root = np.random.default_rng(0).standard_normal((n, 2 * n))
    for P in (root @ root.T, np.eye(n) + 1.0):
        found = WAYS[way](make_qp(P, np.ones(n), lb=np.zeros(n)))
        assert found.x.tolist() == [0.0] * n
        assert found.iterations <= n


def test_each_form_is_taken_where_it_pays():
    n = 110
    few = make_qp(np.eye(n), np.ones(n), np.eye(n)[:5] - np.eye(n)[1:6], np.ones(5))
    full = dense(few)._replace(P=np.eye(n) + 1e-3)
    residuals = residual_form(7, 50, 5, lower=0.0)[0]
    for qp, form in (
        (few, "path"), (full, "dual"), (residuals, "dual"), (made.spread().qp, "dual"),
        (made.large_terms().qp, "bounds"), (made.blocks(0.5), "bounds"),
    ):  # fmt: skip
        assert solve_qp(*qp).form == form


def test_many_pivots_give_way_to_interior_points():
    """Support vectors: a pivot for each, or more; of a box with few active, few."""
    rng, n = np.random.default_rng(3), 240
    X = rng.standard_normal((n, 4))
    sign = np.where(X[:, 0] + 0.5 * rng.standard_normal(n) > 0.0, 1.0, -1.0)
    far = ((X[:, None] - X) ** 2).sum(axis=2)
    kernel = np.outer(sign, sign) * np.exp(-far / 16.0)
    G, h = np.vstack((np.eye(n), -np.eye(n))), np.repeat([1.0, 0.0], n)
    definite = 0.1 * np.eye(n) + X @ X.T / n
    for P, q, form in ((kernel, -1.0, "path"), (definite, -0.1, "dual")):
        qp = make_qp(P, np.full(n, q), G, h, sign[None], np.zeros(1))
        found = solve_qp(*dense(qp))
        assert (found.status, found.form) == (SOLVED, form)
        assert_solves_qp(qp, found)


def test_full_rows_are_condensed_whatever_the_cost_is(monkeypatch):
    """No other factors are planned; with equations, and with bounds."""
    monkeypatch.setattr("namlcp.qp.kkt.plan_factors", None)
    for seed, rank in ((1, 40), (2, 12)):
        qp = complementary(seed, 40, 60, 4, rank).qp
        found = by_path(qp)
        assert found.status is SOLVED
        assert_solves_qp(qp, found, 1e-8)


def test_a_gap_whose_terms_cancel_in_the_data_of_the_user():
    """Without the residuals t = Bx - c, x'Px and q'x are 10^3 times those of the user.

    Points within that tolerance are refused, until products of slacks and multipliers
    are as small as his data need them.
    """
    rng, rows, n = np.random.default_rng(0), 40, 120
    B = rng.standard_normal((rows, n))
    c = 30.0 * (B @ rng.standard_normal(n) + rng.standard_normal(rows))
    P = np.diag(np.repeat([2e-8, 2.0], (n, rows)))
    bound = np.repeat([30.0, np.inf], (n, rows))
    A = np.hstack((B, -np.eye(rows)))
    qp = sparse(make_qp(P, np.zeros(n + rows), A=A, b=c, lb=-bound, ub=bound))
    found = solve_qp(*qp)
    assert (found.status, found.form) == (SOLVED, "path")
    assert 0 < found.iterations < 40
    assert_solves_qp(qp, found)


# ---- problems of other people


needs_data = pytest.mark.skipif(
    not (DATA / "maros_meszaros").is_dir(),
    reason="no Maros-Meszaros data: set NAMLCP_DATA to the data folder",
)
FAMOUS = [
    "AUG3DCQP", "CONT-050", "CVXQP1_S", "DUALC1", "HS118", "HUES-MOD", "KSIP",
    "LASER", "LISWET3", "MOSARQP2", "PRIMAL1", "QADLITTL", "QAFIRO", "QBANDM",
    "QCAPRI", "QPCBLEND", "QPCBOEI2", "QRECIPE", "QSCTAP1", "YAO", "QPILOTNO", "UBH1",
]  # fmt: skip
# Where full steps would go on in vain: other scaling, smaller proximal terms.
MOST = {"QPILOTNO": 150, "UBH1": 15}


@needs_data
@pytest.mark.parametrize("name", FAMOUS)
def test_maros_meszaros(name):
    qp = maros_meszaros(name)
    found = solve_qp(*qp, eps_abs=1e-6, eps_rel=0.0)
    assert found.status is Status.SOLVED
    point = found.x, found.y, found.z, found.z_box
    assert qp_residuals(*qp, *point).solved(1e-6, 0.0)
    assert found.iterations <= MOST.get(name, 1000)


def test_a_dense_linear_program_of_many_variables():
    """Interior points take a tenth of the iterations of pivots."""
    for n, form in ((60, "dual"), (100, "path")):
        known = complementary(2, n, 2 * n, 5, 0)
        found = solve_qp(*dense(known.qp))
        assert (found.status, found.form) == (SOLVED, form)
        assert_solves_qp(known.qp, found, 1e-8)
