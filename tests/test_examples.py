"""The examples solve what they say, and can be drawn."""

import numpy as np
import pytest

from examples import (
    EXAMPLES,
    frontier,
    lasso,
    pendulum,
    show_example,
    tuning,
)


@pytest.mark.parametrize("name", EXAMPLES)
def test_examples_are_solved_and_drawn(name, tmp_path, capsys):
    pytest.importorskip("matplotlib")
    picture = tmp_path / "picture.png"
    assert show_example(name, str(picture)) == 0
    assert picture.stat().st_size > 10_000
    assert EXAMPLES[name][0] in capsys.readouterr().out


def test_an_example_needs_no_matplotlib(capsys, monkeypatch):
    monkeypatch.setattr("examples.find_spec", lambda name: None)
    assert show_example("lasso", None) == 0
    assert "--picture" in capsys.readouterr().out
    assert show_example("lasso", "x.png") == 2
    assert "needs matplotlib" in capsys.readouterr().out


def test_the_descent_ends_near_the_best_penalty():
    record = tuning.run(20)
    assert record.descent[-1, 1] <= record.scan[:, 1].min() + 0.05
    penalty, error, slope = record.scan.T
    steps = np.diff(error) / np.diff(np.log(penalty))
    between = (slope[1:] + slope[:-1]) / 2
    assert np.corrcoef(steps, between)[0, 1] > 0.98


def test_the_cart_arrives_and_keeps_its_limits():
    record = pendulum.run(120)
    assert abs(record.states[90:100, pendulum.POSITION] - 1.0).max() < 0.02
    assert abs(record.forces).max() <= pendulum.FORCE + 1e-9
    assert abs(record.states[:, pendulum.TILT]).max() <= pendulum.ANGLE + 0.02


def test_the_frontier_is_one():
    record = frontier.run(40)
    assert (np.diff(record.risks) >= -1e-12).all()
    assert (np.diff(record.returns) >= -1e-12).all()
    np.testing.assert_allclose(record.weights.sum(axis=1), 1.0, atol=1e-12)
    assert record.weights.min() >= 0.0
    assert record.weights.max() <= frontier.MOST + 1e-12


def test_the_path_solves_the_lasso():
    """At each penalty the subgradient condition of |Xw - y|^2/2 + penalty |w|_1."""
    X, y = lasso.regression()
    record = lasso.run(30)
    most = abs(X.T @ y).max()
    for share, w in zip(record.penalties, record.coefficients, strict=True):
        slope = X.T @ (y - X @ w)
        assert abs(slope).max() <= share * most + 1e-9
        np.testing.assert_allclose(slope @ w, share * most * abs(w).sum(), atol=1e-8)


def test_the_condensed_states_are_those_of_the_plant():
    F, B = pendulum.plant()
    S, T = pendulum.condensed(F, B)
    u = np.random.default_rng(0).standard_normal(pendulum.HORIZON)
    x = start = np.array([0.1, 0.0, 0.05, 0.0])
    for k in range(pendulum.HORIZON):
        x = F @ x + B[:, 0] * u[k]
        np.testing.assert_allclose(S[k] @ start + T[k] @ u, x, rtol=1e-9, atol=1e-9)
