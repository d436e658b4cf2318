"""The scenes of the validation at small sizes, against the values in their docstrings.

Solved by method="auto"; a value that only an independent solver gives comes from one.
"""

import numpy as np
import problems_lcp
import pytest
from scipy import sparse
from scipy.optimize import lsq_linear, nnls

from namlcp import Status, solve_lcp
from namlcp.residuals import natural_residual
from validation.harness.data_folder import MissingDataError
from validation.problems import known_scenes as known
from validation.problems import large_scenes as large
from validation.problems.data_sets import heart_scale


def solve(scene):
    result = solve_lcp(*scene)
    assert result.status is Status.SOLVED
    return result.z


def objective(scene, z):
    return 0.5 * z @ (scene.A @ z) + scene.q @ z


# ---- published values


@pytest.mark.parametrize(("ny", "value"), [(50, -0.4180876320), (100, -0.4182392134)])
def test_torsion(ny, value):
    scene = known.torsion(50, ny)
    z = solve(scene)
    assert objective(scene, z) == pytest.approx(value, abs=5e-11)
    if ny == 50:
        assert np.sum((z <= scene.lower) | (z >= scene.upper)) == 752


@pytest.mark.parametrize(
    ("nx", "ny", "e", "value"),
    [
        (8, 12, 0.1, -0.1834372196),
        (50, 50, 0.1, -0.1804879950),
        (50, 50, 0.99, -60.1509273215),
    ],
)
def test_journal_bearing(nx, ny, e, value):
    scene = known.journal_bearing(nx, ny, e)
    assert objective(scene, solve(scene)) == pytest.approx(value, abs=5e-11)


@pytest.mark.parametrize(
    ("m", "average", "worst"),
    [(17, 2.707e-3, 1.428e-2), (33, 8.182e-4, 5.747e-3), (129, 3.334e-5, 2.154e-4)],
)
def test_ball_obstacle(m, average, worst):
    z = solve(known.ball_obstacle(m)).reshape(m - 2, m - 2)
    error = np.abs(z - known.ball_solution(m)[1:-1, 1:-1])
    assert error.sum() / m**2 == pytest.approx(average, rel=2e-4)
    assert error.max() == pytest.approx(worst, rel=4e-4)


def test_dam():
    z = solve(known.dam()).reshape(3, 5)[:, ::-1].T
    table = [
        [2.53716015237691, 0.0, 0.0],
        [18.148640609503, 6.78414305345868, 0.0],
        [47.2732592321996, 24.9879316043211, 7.91201621181146],
    ]
    np.testing.assert_allclose(z[:3], table, rtol=0, atol=1.5e-11)
    exact = [7.912016211797040, 22.66013324288125, 44.74620883995199]
    np.testing.assert_allclose(z[2:, 2], exact, rtol=1e-14)
    finer = solve(known.dam(4)).reshape(15, 23)
    assert np.abs(finer[3::4, 3::4] - z[::-1].T).max() < 0.01 * z.max()


def test_american_put():
    m, steps = 401, 400
    scene = known.american_put(m, steps)
    z = scene.lower
    for _ in range(steps):
        q = scene.q + scene.lower - z
        z = solve(scene._replace(q=q))
    assert z[m // 2] == pytest.approx(9.5694453, abs=0.01)  # first order in time


def test_input_bounded_mpc():
    scene = known.input_bounded_mpc()
    z = solve(scene)
    start = np.array([10.0, 0.0])
    total, x = 0.0, start
    for u in z:
        total += x @ ([1.0, 0.1] * x) + 0.01 * u * u
        x = np.array([[1.0, 0.1], [0.0, 1.0]]) @ x + [0.005 * u, 0.1 * u]
    total += x @ ([1.0, 0.1] * x)
    assert total == pytest.approx(2490.05936849, abs=5e-9)
    assert np.sum(np.abs(z) > 1.0 - 1e-12) == 69


def test_svm_heart():
    try:
        X, y = heart_scale(problems_lcp.DATA)
    except MissingDataError as error:
        pytest.skip(str(error))
    scene = known.svm_rbf(X, y, 1.0 / 13.0)
    z = solve(scene)
    assert objective(scene, z) == pytest.approx(-101.1335996299, abs=5e-11)
    assert (np.sum(z > 0.0), np.sum(z >= 1.0)) == (129, 107)
    scene = known.svm_l2(X, y)
    assert objective(scene, solve(scene)) == pytest.approx(-121.13472444, abs=5e-9)


# ---- independent solvers, optimality by its own definition


def test_svm_without_data(tmp_path):
    X, y = known.svm_data(tmp_path, 60)
    np.testing.assert_array_equal(X, known.two_clouds(60)[0])
    scene = known.svm_l2(X, y)
    root = np.linalg.cholesky(scene.A)
    oracle = nnls(root.T, np.linalg.solve(root, -scene.q))[0]
    np.testing.assert_allclose(solve(scene), oracle, atol=1e-10)
    scene = known.svm_rbf(X, y, 0.2)
    root = np.linalg.cholesky(scene.A + 1e-14 * np.eye(60))
    oracle = lsq_linear(root.T, np.linalg.solve(root, -scene.q), (0.0, 1.0), tol=1e-14)
    assert objective(scene, solve(scene)) == pytest.approx(
        objective(scene, oracle.x), rel=1e-9
    )


def test_nonnegative_least_squares():
    scene, B, b = known.nonnegative_least_squares(120, 40)
    z = solve(scene)
    np.testing.assert_allclose(z, nnls(B, b)[0], atol=1e-12)
    assert 0 < np.sum(z == 0.0) < 40


def test_portfolio_has_the_largest_sharpe_ratio():
    scene = known.portfolio(40)
    x = solve(scene)
    assert 0 < np.sum(x > 0.0) < 40

    def sharpe(x):
        return -scene.q @ x / np.sqrt(x @ scene.A @ x)

    rng = np.random.default_rng(0)
    for other in rng.dirichlet(np.full(40, 0.1), 200):
        mixed = x / x.sum() + 0.05 * (other - x / x.sum())
        assert max(sharpe(other), sharpe(mixed)) < sharpe(x)


# ---- families


@pytest.mark.parametrize("name", large.FAMILIES)
def test_family(name):
    scene = large.FAMILIES[name](400)
    A = scene.A
    assert A.format == "csr"
    assert A.has_canonical_format
    assert A.indices.dtype == np.int32
    assert abs(A.shape[0] - 400) <= 60
    again = large.FAMILIES[name](400)
    assert (A != again.A).nnz == 0
    for one, other in zip(scene[1:], again[1:], strict=True):
        np.testing.assert_array_equal(one, other)
    symmetric = "transport" not in name and "convection" not in name
    gap = abs(A - A.T).max()
    assert gap <= 1e-13 * abs(A).max() if symmetric else gap > 0.1
    z = solve(scene)
    assert natural_residual(z, A @ z + scene.q, scene.lower, scene.upper) < 1e-11
    active = np.mean((z <= scene.lower) | (z >= scene.upper))
    assert 0.02 < active < 0.8


def test_meshes_are_the_laplacian():
    scene = large.triangles(15, 7.0)
    m = 15
    inside = slice(1, -1)
    A = scene.A.toarray()
    assert np.linalg.eigvalsh(A)[0] > 0.0
    # rows of nodes away from the boundary sum to zero: constants have no gradient
    sums = A.sum(axis=1).reshape(m, m)[inside, inside]
    assert np.abs(sums).max() < 1e-12
    plain = large.triangles(15).A
    assert (plain - sparse.diags_array(plain.diagonal())).max() <= 1e-14
    assert (scene.A - sparse.diags_array(scene.A.diagonal())).max() > 0.1


def test_grids_are_second_differences():
    """A z of z = x (1 - x) y (1 - y), exact for second differences."""
    m = 9
    x = large.nodes(m)
    bump, two = x * (1.0 - x), np.full(m, 2.0)
    plane = np.outer(bump, bump)
    curved = np.outer(two, bump), np.outer(bump, two)
    h2 = 1.0 / (m + 1) ** 2

    def check(A, z, value):
        np.testing.assert_allclose(A @ z.ravel(), value.ravel(), atol=1e-13)

    check(large.anisotropic(m, 0.1).A, plane, h2 * (curved[0] + 0.1 * curved[1]))
    cube = plane[:, :, None] * bump
    value = sum(part[:, :, None] * bump for part in curved) + plane[:, :, None] * two
    check(large.box_3d(m).A, cube, h2 * value)
    mass = bump - h2 / 3.0  # (4 b_i + b_{i-1} + b_{i+1}) / 6
    mixed = np.outer(two, mass) / 10.0, 10.0 * np.outer(mass, two)
    check(large.bilinear(m, 10.0).A, plane, h2 * (mixed[0] + mixed[1]))
    slope = 1.0 - 2.0 * x
    wind = np.outer(slope, bump) + np.outer(bump, slope)
    check(large.convection(m, 3.0).A, plane, h2 * (sum(curved) + 3.0 * wind))


def test_transport_is_example_2():
    A = large.transport(4).A.toarray()
    assert {float(v) for v in np.unique(A).round(12)} == {-1.5, -0.5, 0.0, 4.0}
    assert A[1, 0] == A[4, 0] == -1.5


def test_biactive_knows_its_solution():
    scene, z = large.biactive(40)
    w = scene.A @ z + scene.q
    both = (np.abs(z) <= 1e-14) & (np.abs(w) <= 1e-14)
    assert 0.45 < both.mean() < 0.55
    assert natural_residual(z, w, scene.lower, scene.upper) < 1e-12
    np.testing.assert_allclose(solve(scene), z, atol=1e-12)
