"""Sweeps and factor-once methods against plain matrix forms of the papers' formulas."""

import numpy as np
import pytest
from scipy import sparse
from sweeping import every_bounds, one_step, step_of, sweep

from namlcp.lcp.modulus.methods import METHODS
from namlcp.lcp.relaxation import relax_csr
from namlcp.residuals import natural_residual
from namlcp.status import Status

TRIANGULAR = [name for name, method in METHODS.items() if not method.factored]
FACTORED = [name for name, method in METHODS.items() if method.factored]
KINDS = {"dense": np.asarray, "csr": sparse.csr_array}


def paper_example(number, m, delta=4.0):
    """Examples 1 and 2 of the paper, n = m^2, as (A, q, lower, upper)."""
    below, above = {1: (-1.0, -1.0), 2: (-1.5, -0.5)}[number]
    T = sparse.diags_array([below, 0.0, above], offsets=[-1, 0, 1], shape=(m, m))
    I = sparse.eye_array(m)
    A = sparse.kron(I, T) + sparse.kron(T, I) + (4.0 + delta) * sparse.eye_array(m * m)
    A = sparse.csr_array(A)
    A.sort_indices()
    z = np.tile([1.0, 2.0], m * m // 2)
    return A, -(A @ z), np.zeros(m * m), np.full(m * m, np.inf)


def random_problem(seed, n=13):
    """Nonsymmetric A with holes, and every kind of bounds."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.5)
    np.fill_diagonal(A, rng.uniform(1.0, 9.0, n))
    lower, upper = every_bounds(rng, n)
    return A, 3.0 * rng.normal(size=n), lower, upper, rng.normal(size=n)


def parts(A):
    return np.diag(np.diag(A)), -np.tril(A, -1), -np.triu(A, 1)


def reflection(s, lower, upper):
    return 2.0 * np.clip(s, lower, upper) - s


def bai(A, M, Omega, q, lower, upper, s):
    """(M + Omega) s+ = N s + (Omega - A) R(s) - 2 q with any splitting A = M - N."""
    R = reflection(s, lower, upper)
    return np.linalg.solve(M + Omega, (M - A) @ s + (Omega - A) @ R - 2.0 * q)


def zheng_yin(A, M, Omega, q, lower, upper, s):
    """(M + Omega) s+ = N s + (Omega - D + U) R(s) + L R(s+) - 2 q, row after row."""
    D, L, U = parts(A)
    known = (M - A) @ s + (Omega - D + U) @ reflection(s, lower, upper) - 2.0 * q
    left = M + Omega
    new = np.zeros_like(s)
    R = np.zeros_like(s)
    for i in range(s.size):
        new[i] = (known[i] + L[i] @ R - left[i, :i] @ new[:i]) / left[i, i]
        R[i] = 2.0 * min(max(new[i], lower[i]), upper[i]) - new[i]
    return new


def one_sweep(A, q, lower, upper, method, s, **parameters):
    """s+, Res(z) and Omega of a method."""
    step = step_of(A, q, lower, upper, method, **parameters)
    return *one_step(step, s, lower, upper), step.omega


def assert_close(actual, expected, tolerance=1e-12):
    size = max(1.0, np.abs(expected).max())
    np.testing.assert_allclose(actual, expected, rtol=0.0, atol=tolerance * size)


# The paper's tables: n = 100 ... 10^4; iterations, printed residuals in units of 1e-7.
SIZES = (10, 30, 50, 60, 80, 100)
TABLES = {
    (1, "mgs", None): ((36, 40, 41, 41, 42, 42), (97, 80, 79, 89, 74, 84)),
    (1, "namgs", None): ((16, 17, 17, 17, 18, 18), (63, 63, 85, 95, 45, 51)),
    (1, "msor", 0.85): ((15, 17, 18, 18, 18, 19), (95, 76, 53, 65, 89, 43)),
    (1, "namsor", 0.91): ((12, 12, 13, 13, 13, 13), (27, 76, 32, 37, 48, 59)),
    (2, "mgs", None): ((24, 26, 26, 26, 27, 27), (90, 65, 87, 96, 65, 73)),
    (2, "namgs", None): ((12, 12, 13, 13, 13, 13), (38, 84, 31, 35, 44, 53)),
    (2, "msor", 0.88): ((14, 14, 15, 15, 15, 15), (38, 82, 41, 46, 55, 63)),
    (2, "namsor", 0.88): ((8, 9, 9, 9, 9, 9), (22, 15, 27, 37, 46, 59)),
}
# One printed residual is off by more than one unit of its last digit: 3.38e-6 is right.
MISPRINTS = {(2, "namsor", 60): 34}


@pytest.mark.parametrize(("example", "method", "alpha"), TABLES)
def test_tables_of_the_paper(example, method, alpha):
    counts, printed = TABLES[example, method, alpha]
    for m, count, digits in zip(SIZES, counts, printed, strict=True):
        A, q, lower, upper = paper_example(example, m)
        result = sweep(
            A, q, lower, upper, method, alpha=alpha, eps_abs=1e-5, max_iter=100,
            shift=1.0 if method.startswith("nam") else None,
            s0=np.tile([1.0, 0.0], m * m // 2),
        )  # fmt: skip
        assert result.status is Status.SOLVED
        assert result.iterations == count
        digits = MISPRINTS.get((example, method, m), digits)
        assert abs(result.residual * 1e7 - digits) <= 1.5
        np.testing.assert_allclose(result.z, np.tile([1.0, 2.0], m * m // 2), atol=1e-5)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", TRIANGULAR)
def test_sweep_is_the_formula(method, kind):
    for seed in range(5):
        A, q, lower, upper, s = random_problem(seed)
        D, L, _ = parts(A)
        takes = METHODS[method].takes
        alpha = 1.3 if "alpha" in takes else 1.0
        beta = 0.4 if "beta" in takes else 0.0 if method == "namj" else alpha
        omega = np.linspace(0.5, 4.0, q.size) if "omega" in takes else np.diag(D)
        shift = np.linspace(0.0, 2.0, q.size) if "shift" in takes else 0.0 * q
        values = {"alpha": alpha, "beta": beta, "omega": omega, "shift": shift}
        given = {name: values[name] for name in takes}
        Omega = np.diag(omega) if "omega" in takes else D / alpha
        M = (D - beta * L) / alpha
        if method.startswith("nam"):
            expected = bai(A, M + np.diag(shift) - L, Omega, q, lower, upper, s)
        elif method.startswith("m"):
            expected = bai(A, M, Omega, q, lower, upper, s)
        else:
            expected = zheng_yin(A, M, Omega, q, lower, upper, s)
        actual, residual, _ = one_sweep(
            KINDS[kind](A), q, lower, upper, method, s, **given
        )
        assert_close(actual, expected)
        z = np.clip(s, lower, upper)
        assert residual == pytest.approx(
            natural_residual(z, A @ z + q, lower, upper), rel=1e-13
        )


@pytest.mark.parametrize("alpha", [0.6, 1.0, 1.7])
def test_the_paper_s_sixth_variant(alpha):
    """Variant (6), NAMAOR, with the coefficients of L and |s| put right."""
    A, q, lower, upper, s = random_problem(9)
    lower, upper = np.zeros_like(q), np.full_like(q, np.inf)
    D, L, U = parts(A)
    I, beta = np.eye(q.size), 0.3
    Omega = D / (2.0 * alpha**2)
    expected = np.linalg.solve(
        D - (alpha + beta) * L + alpha * Omega + alpha * I,
        ((1 - alpha) * D - beta * L + alpha * U + alpha * I) @ s
        + alpha * (Omega - A) @ abs(s)
        - 2 * alpha * q,
    )
    actual, _, omega = one_sweep(
        A, q, lower, upper, "namaor", s, alpha=alpha, beta=beta, shift=1.0
    )
    assert_close(actual, expected)
    assert_close(omega, np.diag(Omega))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("alpha", [0.7, 1.0, 1.6])
def test_psor_and_its_short_kernel_are_the_formula(alpha, kind):
    """`tests/test_identities.py`: they are the accelerated method with D/alpha."""
    A, q, lower, upper, s = random_problem(3)
    z = np.clip(s, lower, upper)
    for i in range(q.size):
        w = A[i] @ z + q[i]
        z[i] = min(max(z[i] - alpha * w / A[i, i], lower[i]), upper[i])
    X = KINDS[kind](A)
    D = np.diag(A)
    for method in ("psor", "amsor"):
        s_next, _, omega = one_sweep(X, q, lower, upper, method, s, alpha=alpha)
        assert_close(np.clip(s_next, lower, upper), z)
        assert_close(omega, D / alpha)
    old = np.clip(s, lower, upper)
    relaxed = old.copy()
    C = sparse.csr_array(A)
    moved = relax_csr(C.indptr, C.indices, C.data, q, lower, upper, alpha, relaxed)
    assert_close(relaxed, z)
    assert moved == pytest.approx(np.linalg.norm(np.sqrt(D) * (z - old)))


@pytest.mark.parametrize("method", [*TRIANGULAR, "modulus"])
@pytest.mark.parametrize("scale", [1e-7, 3.0, 1e9])
def test_units_do_not_matter(method, scale):
    A, q, lower, upper, _ = random_problem(5)
    A += 20.0 * np.eye(q.size)
    for X in (A, sparse.csr_array(A)):
        one, other = (
            sweep(c * X, c * q, lower, upper, method, eps_abs=1e-300, max_iter=6)
            for c in (1.0, scale)
        )
        assert one.iterations == other.iterations
        assert_close(other.z, one.z)


def test_the_paper_s_own_shift_depends_on_units():
    A, q, lower, upper = paper_example(1, 10)
    counts = {}
    for c in (1.0, 1e-3):
        for shift in (None, 1.0):
            result = sweep(
                c * A, c * q, lower, upper, "namgs", shift=shift, eps_abs=c * 1e-5,
                max_iter=1000,
            )  # fmt: skip
            counts[c, shift] = result.iterations
    assert counts[1.0, None] == counts[1e-3, None]
    assert counts[1e-3, 1.0] > 10 * counts[1.0, 1.0]


def symmetric_problem(seed, n=9):
    A, q, lower, upper, s = random_problem(seed, n)
    return A + A.T + n * np.eye(n), q, lower, upper, s


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("build", [random_problem, symmetric_problem])
@pytest.mark.parametrize("method", FACTORED)
def test_factored_methods_are_the_formula(method, build, kind):
    A, q, lower, upper, s = build(11)
    _, L, _ = parts(A)
    I = np.eye(q.size)
    Omega = {"modulus": np.diag(np.diag(A)), "nam": I, "modified-nam": 0.8 * I}[method]
    M = A if method == "modulus" else A + I - L
    alpha = 0.8 if method == "modified-nam" else None
    for _ in range(3):
        result = sweep(
            KINDS[kind](A), q, lower, upper, method, alpha=alpha, s0=s,
            eps_abs=1e-300, max_iter=1,
        )  # fmt: skip
        s = bai(A, M, Omega, q, lower, upper, s)
        z = np.clip(s, lower, upper)
        residual = natural_residual(z, A @ z + q, lower, upper)
        assert result.history["residual"][1] == pytest.approx(residual, rel=1e-9)
        step = step_of(A, q, lower, upper, method, alpha=alpha)
        assert_close(step.omega, np.diag(Omega))
        if result.history["residual"][1] < result.history["residual"][0]:
            assert_close(result.s, s, 1e-11)


@pytest.mark.parametrize("kind", KINDS)
def test_factored_methods_accept_omega_and_shift(kind):
    A, q, lower, upper, s = random_problem(2)
    omega, shift = np.linspace(1, 2, q.size), np.linspace(0, 3, q.size)
    _, L, _ = parts(A)
    expected = bai(
        A, A + np.diag(shift) - L, np.diag(omega), q, lower, upper, s
    )  # fmt: skip
    result = sweep(
        KINDS[kind](A), q, lower, upper, "nam", omega=omega, shift=shift, s0=s,
        eps_abs=1e-300, max_iter=1,
    )  # fmt: skip
    z = np.clip(expected, lower, upper)
    assert result.history["residual"][1] == pytest.approx(
        natural_residual(z, A @ z + q, lower, upper), rel=1e-9
    )


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("method", METHODS)
def test_dominant_box_problem_is_solved(method, kind):
    rng = np.random.default_rng(1)
    n = 30
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < 0.2)
    A += np.diag(3.0 * np.abs(A).sum(axis=1) + 1.0)
    lower, upper = np.full(n, -1.0), np.full(n, 1.0)
    lower[::5], upper[::7] = -np.inf, np.inf
    z = np.clip(2.0 * rng.normal(size=n), lower, upper)
    w = np.where(z == lower, 1.0, np.where(z == upper, -1.0, 0.0))
    q = w - A @ z
    result = sweep(KINDS[kind](A), q, lower, upper, method, eps_abs=1e-11, max_iter=500)
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z, z, atol=1e-10)
    np.testing.assert_array_equal(result.z, np.clip(result.s, lower, upper))
    omega = step_of(A, q, lower, upper, method).omega
    np.testing.assert_allclose(omega * (result.z - result.s), w, atol=1e-9)
    again = sweep(
        KINDS[kind](A), q, lower, upper, method, eps_abs=1e-9, max_iter=500, z0=z
    )
    assert again.iterations == 0
    again = sweep(
        KINDS[kind](A), q, lower, upper, method, eps_abs=1e-9, max_iter=5, s0=result.s
    )
    assert again.iterations == 0
    np.testing.assert_array_equal(again.s, result.s)


def test_iterations_is_the_first_below_the_tolerance():
    A, q, lower, upper = paper_example(1, 10)
    result = sweep(A, q, lower, upper, "pgs", eps_abs=1e-6, max_iter=100)
    history = result.history
    assert history.dtype.names == ("iter", "residual", "active", "time")
    assert (history["residual"][:-1] >= 1e-6).all()
    assert history["residual"][-1] == result.residual < 1e-6
    assert history["iter"][-1] == result.iterations == len(history) - 1
    assert history["iter"].tolist() == list(range(len(history)))
    assert history["residual"][0] == pytest.approx(np.linalg.norm(q))
    assert history["active"][0] == 100
    again = sweep(
        A, q, lower, upper, "pgs", eps_abs=result.residual, max_iter=100
    )  # fmt: skip
    assert again.iterations == result.iterations + 1


def test_default_start_is_zero_clipped_into_the_box():
    A, q, lower, upper, _ = random_problem(4)
    result = sweep(A, q, lower, upper, "pgs", eps_abs=1e9, max_iter=1)
    assert result.iterations == 0
    np.testing.assert_array_equal(result.s, np.clip(0.0, lower, upper))


def test_inputs_stay_as_they_are():
    A, q, lower, upper, s = random_problem(4)
    A = sparse.csr_array(A)
    arrays = (A.indptr, A.indices, A.data, q, lower, upper, s)
    copies = [array.copy() for array in arrays]
    for name in METHODS:
        sweep(A, q, lower, upper, name, s0=s, eps_abs=1e-3, max_iter=5)
        sweep(A, q, lower, upper, name, z0=s, eps_abs=1e-3, max_iter=5)
    for array, copy in zip(arrays, copies, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_wide_indices_give_the_same_sweep():
    A, q, lower, upper, s = random_problem(6)
    A = sparse.csr_array(A)
    wide = A.copy()
    wide.indices, wide.indptr = A.indices.astype(np.int64), A.indptr.astype(np.int64)
    narrow_s = one_sweep(A, q, lower, upper, "namgs", s)[0]
    np.testing.assert_array_equal(
        one_sweep(wide, q, lower, upper, "namgs", s)[0], narrow_s
    )


@pytest.mark.parametrize("kind", KINDS)
def test_symmetric_indefinite_modulus_falls_back_on_lu(kind):
    A = np.array([[0.0, 3.0], [3.0, 0.0]])
    q, lower, upper = np.array([-1.0, 2.0]), -np.ones(2), np.ones(2)
    s = np.array([0.3, -0.4])
    result = sweep(
        KINDS[kind](A), q, lower, upper, "modulus", omega=1.0, s0=s, eps_abs=1e-300,
        max_iter=1,
    )  # fmt: skip
    z = np.clip(bai(A, A, np.eye(2), q, lower, upper, s), lower, upper)
    residual = natural_residual(z, A @ z + q, lower, upper)
    assert result.history["residual"][1] == pytest.approx(residual)
