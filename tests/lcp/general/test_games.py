"""Bimatrix games: equilibria by the definition, recognition, degenerate ones."""

import numpy as np
import problems_lcp as problems
import pytest
from scipy import sparse

from namlcp import Prepared, Status
from namlcp.lcp.data import lcp_data
from namlcp.lcp.general import games
from namlcp.lcp.general.games import game_of, solve_game
from namlcp.limits import Deadline, Limits

LIMITS = Limits(0.0, 1e-9)
FILES = sorted((problems.DATA / "general").glob("game_*.npz"))


def game_lcp(R, S, order=None, sparsely=False):
    """Return the LCP of two players' positive costs, its unknowns in another order."""
    A = np.block([[np.zeros((len(R),) * 2), R], [S.T, np.zeros((R.shape[1],) * 2)]])
    if order is not None:
        A = A[np.ix_(order, order)]
    A = sparse.csr_array(A) if sparsely else A
    return lcp_data(Prepared(A), -np.ones(A.shape[0]), None, None)


def assert_is_equilibrium(R, S, z):
    """Neither player has a pure strategy that costs less: x'R y, x'S y."""
    x, y = z[: len(R)], z[len(R) :]
    assert (z >= 0.0).all()
    x, y = x / x.sum(), y / y.sum()
    for mixed, pure in ((x @ R @ y, R @ y), (x @ S @ y, x @ S)):
        assert mixed <= pure.min() + 1e-9 * np.abs(pure).max()


def assert_solves(R, S):
    outcome = solve_game(game_lcp(R, S), None, LIMITS)
    assert outcome.status is Status.SOLVED
    assert_is_equilibrium(R, S, outcome.z)
    return outcome


@pytest.mark.skipif(not FILES, reason="no data folder")
@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_gambit(file):
    payoff = np.load(file)
    assert_solves(*(payoff[name].max() + 1.0 - payoff[name] for name in "RC"))


@pytest.mark.parametrize("integer", [False, True])
@pytest.mark.parametrize("shape", [(1, 1), (2, 2), (3, 5), (8, 10), (60, 80)])
def test_random(shape, integer):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        R, S = rng.uniform(0.1, 1.0, (2, *shape))
        if integer:
            R, S = np.ceil(3.0 * R), np.ceil(3.0 * S)
        assert_solves(R, S)


def test_known_equilibrium():
    """Matching pennies in costs 1 and 2: both players mix evenly."""
    R = np.array([[1.0, 2.0], [2.0, 1.0]])
    z = assert_solves(R, 3.0 - R).z
    np.testing.assert_allclose(z, np.full(4, 1.0 / 3.0))


def test_all_strategies_alike():
    assert_solves(np.ones((4, 3)), np.ones((4, 3)))


@pytest.mark.parametrize("sparsely", [False, True])
def test_the_order_of_the_unknowns_is_free(sparsely):
    rng = np.random.default_rng(3)
    R, S = rng.uniform(0.1, 1.0, (2, 3, 4))
    order = rng.permutation(7)
    outcome = solve_game(game_lcp(R, S, order, sparsely), None, LIMITS)
    z = np.empty(7)
    z[order] = outcome.z
    assert_is_equilibrium(R, S, z)


def test_stored_zeros_are_zeros():
    lcp = game_lcp(np.ones((2, 3)), np.ones((2, 3)), sparsely=True)
    A = sparse.csr_array(np.ones((5, 5)))
    A.data[:] = lcp.A.toarray().ravel()
    assert game_of(lcp_data(Prepared(A), lcp.q, None, None)) is not None


@pytest.mark.parametrize("k", range(7))
def test_every_label_leads_to_an_equilibrium(k, monkeypatch):
    rng = np.random.default_rng(k)
    R, S = rng.uniform(0.1, 1.0, (2, 3, 4))
    followed = games.follow_label
    monkeypatch.setattr(
        games, "follow_label", lambda *given: followed(*given[:2], k, given[3])
    )
    assert_solves(R, S)


@pytest.mark.parametrize(
    ("i", "j", "value"), [(0, 0, 1.0), (0, 2, -1.0), (1, 3, 0.0), (4, 3, 1.0)]
)
@pytest.mark.parametrize("sparsely", [False, True])
def test_other_matrices_are_no_games(i, j, value, sparsely):
    lcp = game_lcp(np.ones((2, 3)), np.ones((2, 3)))
    A = lcp.A.copy()
    A[i, j] = value
    A = sparse.csr_array(A) if sparsely else A
    other = lcp_data(Prepared(A), lcp.q, None, None)
    assert game_of(other) is None
    assert solve_game(other, None, LIMITS) is None


def test_other_vectors_are_no_games():
    A = game_lcp(np.ones((2, 3)), np.ones((2, 3))).matrix
    q = -np.ones(5)
    assert game_of(lcp_data(A, q, None, None)) is not None
    assert game_of(lcp_data(A, q, None, 1.0)) is None
    assert game_of(lcp_data(A, np.zeros(5), None, None)) is None


def test_limits():
    lcp = game_lcp(*np.random.default_rng(0).uniform(0.1, 1.0, (2, 8, 10)))
    late = LIMITS._replace(deadline=Deadline(0.0))
    assert solve_game(lcp, None, late) is None
    pennies = np.array([[1.0, 2.0], [2.0, 1.0]])  # needs 4 pivots
    lcp = game_lcp(pennies, 3.0 - pennies)
    assert solve_game(lcp, None, LIMITS._replace(max_iter=4)).iterations == 4
    assert solve_game(lcp, None, LIMITS._replace(max_iter=3)) is None
