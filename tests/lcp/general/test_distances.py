"""The LCP of distances from bounds says what the box LCP says."""

import numpy as np
import problems_general as problems
import pytest
from scipy import sparse

from namlcp.lcp.distances import Distances
from namlcp.lcp.scaling import equilibrating_scale, unit_diagonal_scale


@pytest.mark.parametrize("layout", [np.asarray, sparse.csr_array])
@pytest.mark.parametrize("scaling", [equilibrating_scale, unit_diagonal_scale])
def test_the_same_problem(layout, scaling):
    rng = np.random.default_rng(0)
    A, q, lower, upper = problems.mixed(rng, 15)
    model = Distances(layout(A), q, lower, upper, scaling)
    z = np.clip(rng.standard_normal(15), lower, upper)
    p = model.p(z)
    np.testing.assert_allclose(model.z(p), z)
    assert np.abs(model.c).max() == pytest.approx(1.0)
    w = (A @ z + q)[model.kept]
    np.testing.assert_allclose(model.F(p), model.scale * w / model.unit)
    assert ((model.lower <= p) & (p <= model.upper)).all()
    np.testing.assert_array_equal(np.isfinite(model.lower), model.signed)
    np.testing.assert_array_equal(np.isfinite(model.upper), model.boxed)


def test_bounds_are_met_exactly():
    lower, upper = np.array([0.1, -np.inf, 0.3]), np.array([0.7, 0.9, np.inf])
    A = np.diag([3.0, 7.0, 0.0])
    model = Distances(A, np.ones(3), lower, upper, unit_diagonal_scale)
    np.testing.assert_array_equal(model.z(np.zeros(3)), [0.1, 0.9, 0.3])
    assert model.z(model.r)[0] == 0.7
