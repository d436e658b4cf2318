"""The interior path and the smooth homotopy, and the exact finish at their ends."""

import numpy as np
import problems_general as problems
import pytest
from scipy import sparse

from namlcp.lcp.distances import Distances
from namlcp.lcp.general import arc
from namlcp.lcp.general.arc import Arc
from namlcp.lcp.general.finish import finish
from namlcp.lcp.general.mehrotra import mehrotra
from namlcp.lcp.general.pairs import Pairs
from namlcp.lcp.scaling import unit_diagonal_scale
from namlcp.lcp.shifted import Shifted

INF = np.inf


def model_of(A, q, lower=None, upper=None):
    n = q.size
    lower = np.zeros(n) if lower is None else lower
    upper = np.full(n, INF) if upper is None else upper
    return Distances(A, q, lower, upper, unit_diagonal_scale)


def ways(model):
    system = Shifted(model.M)
    return {
        "path": mehrotra(model, system),
        "arc": Arc(model, system, 1.0, 1.0).points(),
    }


def end(model, points):
    """Return the first point of a small Res, else the last, and its Res."""
    for p in points:
        residual = model.residual(p, model.F(p))
        if residual < 1e-9:
            break
    return p, residual


@pytest.mark.parametrize("way", ["path", "arc"])
@pytest.mark.parametrize("layout", [sparse.csr_array.toarray, sparse.csr_array])
@pytest.mark.parametrize("directions", [2, 4])
def test_friction(way, layout, directions):
    for seed in range(3):
        rng = np.random.default_rng(seed)
        A, q = problems.friction(rng, 8, (0.2, 0.5, 0.9)[seed], directions=directions)
        model = model_of(layout(A), q)
        p, residual = end(model, ways(model)[way])
        assert residual < 1e-8
        *_, x = finish(model, p)
        assert model.residual(x, model.F(x)) < 1e-13


def test_the_arc_with_memory_for_one_point(monkeypatch):
    monkeypatch.setattr(arc, "KEPT_ENTRIES", 1)
    model = model_of(*problems.copositive(np.random.default_rng(0), 40))
    assert end(model, ways(model)["arc"])[1] < 1e-8


@pytest.mark.parametrize("seed", range(6))
def test_the_arc_solves_copositive_problems(seed):
    model = model_of(*problems.copositive(np.random.default_rng(seed), 40))
    assert end(model, ways(model)["arc"])[1] < 1e-8


@pytest.mark.parametrize("way", ["path", "arc"])
def test_bounds_of_all_kinds(way):
    """Semidefinite, for both ways to be sure of a solution."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        A, q, lower, upper = problems.mixed(rng, 20)
        A, q = A @ A.T, A @ A.T @ rng.standard_normal(20)
        model = model_of(A, q, lower, upper)
        p, residual = end(model, ways(model)[way])
        assert residual < 1e-8
        *_, x = finish(model, p)
        assert model.residual(x, model.F(x)) < 1e-12
        z = model.z(x)
        assert ((lower <= z) & (z <= upper)).all()


def test_the_arc_turns():
    """Between two solutions, near (1, 0) and (0, 1), t rises for a while."""
    model = model_of(np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([-1.0, -1.01]))
    arc = Arc(model, Shifted(model.M), 1.0, 1.0)
    falls, look = [], arc.look

    def seen(at):
        here = look(at)
        falls.append(here.forward)
        return here

    arc.look = seen
    assert end(model, arc.points())[1] < 1e-8
    assert falls[0]
    assert falls[-1]
    assert not all(falls)


@pytest.mark.parametrize("bounds", [False, True])
def test_the_directions_of_the_arc_are_those_of_its_equations(bounds):
    """A short step along U stays on the curve; V leads back to it."""
    rng = np.random.default_rng(1)
    A, q, lower, upper = problems.mixed(rng, 15)
    model = model_of(A, q, lower, upper) if bounds else model_of(A, q)
    arc, pairs = Arc(model, Shifted(model.M), 1.0, 1.0), Pairs(model)

    def errors(at):
        linear = model.F(at.p) + at.t * arc.d - pairs.total(at.m)
        return np.append(linear, at.gaps * at.m - at.t * arc.products)

    at = arc.first
    assert np.abs(errors(at)).max() < 1e-12
    here = arc.look(at)
    assert here.error < 1e-9
    for h, bound in ((1e-2, 1e-3), (1e-3, 1e-5)):
        at.h = h
        assert np.abs(errors(here.move(0.0))).max() < bound
    off = here.move(0.0)
    off.m = off.m * (1.0 + 1e-3 * rng.random(off.m.size))
    off.h = 1e-9
    before = np.abs(errors(off)).max()
    assert np.abs(errors(arc.look(off).move(1.0))).max() < 0.01 * before


def test_the_finish_takes_many_faces():
    """From a point whose signs are all wrong."""
    rng = np.random.default_rng(2)
    B = rng.standard_normal((12, 12))
    A = B @ B.T + np.eye(12)
    z = np.maximum(rng.standard_normal(12), 0.0)
    q = np.where(z > 0.0, 0.0, 1.0) - A @ z
    model = model_of(A, q)
    points = list(finish(model, np.where(z > 0.0, 0.0, 1e-3)))
    assert 1 < len(points) <= 8
    np.testing.assert_allclose(model.z(points[-1]), z, atol=1e-10)


def test_the_finish_goes_to_the_nearest_solution_of_a_singular_face():
    model = model_of(np.ones((2, 2)), np.array([-2.0, -2.0]))
    *_, x = finish(model, np.array([0.8, 0.3]))
    np.testing.assert_allclose(model.z(x), [1.5, 0.5], rtol=1e-6)
