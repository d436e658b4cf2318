"""The theory as code: verdicts against definitions, witnesses in exact arithmetic."""

from fractions import Fraction

import numpy as np
import pytest
from scipy import sparse
from sweeping import one_step, step_of, sweep

from namlcp import converges, is_h_plus
from namlcp.lcp.modulus.methods import METHODS
from namlcp.status import Status
from namlcp.theory.comparison import is_m_matrix, radius_bounds
from namlcp.theory.convergence import dense_parts, lyapunov_function
from namlcp.theory.splittings import splitting
from validation.paper.theorem_three import is_h_compatible, theorem_3

KINDS = {"dense": np.asarray, "csr": sparse.csr_array, "csc": sparse.csc_array}
BORDER = (0.3, 0.99, 1 - 1e-6, 1 - 1e-9, 1 + 1e-9, 1 + 1e-6, 1.01, 3.0)


def jacobi(A):
    """J = D^-1 |A - D|, dense."""
    D = np.diag(A)
    return np.abs(A - np.diag(D)) / D[:, None]


def radius(T):
    return np.abs(np.linalg.eigvals(T)).max(initial=0.0)


def random_matrix(rng, target):
    """Matrix of any structure and scaling with rho(J) = target where it is not 0."""
    n = int(rng.integers(1, 25))
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < rng.choice([0.1, 0.3, 1.0]))
    np.fill_diagonal(A, rng.uniform(0.5, 2.0, n))
    if rng.random() < 0.3:  # reducible: some of the unknowns do not see the others
        k = n // 2
        A[:k, k:] = 0.0
    rho = radius(jacobi(A))
    if rho < 1e-3:  # nilpotent but for rounding
        return np.eye(n) * np.diag(A) + np.triu(A, 1), 0.0
    A = np.where(np.eye(n, dtype=bool), A, A * (target / rho))
    if rng.random() < 0.4:
        s = 10.0 ** rng.uniform(-6.0, 6.0, n)
        A = A * s / s[:, None] if rng.random() < 0.5 else A * s[:, None]
    return A, target


def assert_proves(verdict, A):
    """Check the witness by rational numbers."""
    A = np.asarray(A.toarray() if sparse.issparse(A) else A)
    x = [Fraction(v) for v in verdict.witness]
    a = [[Fraction(v) for v in row] for row in A.tolist()]
    n = len(x)
    rows = [
        a[i][i] * x[i] - sum(abs(a[i][j]) * x[j] for j in range(n) if j != i)
        for i in range(n)
    ]
    if verdict.answer:
        assert all(v > 0 for v in x)
        assert all(row > 0 for row in rows)
    else:
        assert all(v >= 0 for v in x)
        assert any(v > 0 for v in x)
        assert all(row <= 0 for row in rows)


@pytest.mark.parametrize("seed", range(8))
def test_is_h_plus_agrees_with_the_definition(seed):
    rng = np.random.default_rng(seed)
    for target in BORDER * 4:
        A, rho = random_matrix(rng, target)
        make = KINDS[rng.choice(list(KINDS))]
        verdict = is_h_plus(make(A))
        assert verdict.answer is (rho < 1.0), (len(A), rho, verdict.checked)
        assert_proves(verdict, A)
        assert (verdict.bound < 1.0) is verdict.answer


@pytest.mark.parametrize("distance", [1e-15, 1e-13, 1e-12, 1e-11])
def test_nearer_than_1e10_the_answer_is_right_or_none(distance):
    rng = np.random.default_rng(5)
    for _ in range(10):
        A, _ = random_matrix(rng, 1.0 + rng.choice([-1.0, 1.0]) * distance)
        verdict = is_h_plus(A)
        if verdict.answer is not None:
            assert_proves(verdict, A)


def five_point(m, delta=0.0, below=-1.0, above=-1.0):
    """The paper's P + delta I; (-1, -1) Example 1, (-1.5, -0.5) Example 2."""
    T = sparse.diags_array([below, 0.0, above], offsets=[-1, 0, 1], shape=(m, m))
    I = sparse.eye_array(m)
    A = sparse.kron(I, T) + sparse.kron(T, I) + (4.0 + delta) * sparse.eye_array(m * m)
    return sparse.csr_array(A)


def test_exactly_singular_comparison_matrices_are_decided():
    ring = 2.0 * np.eye(5) - np.roll(np.eye(5), 1, 1) - np.roll(np.eye(5), -1, 1)
    verdict = is_h_plus(ring)
    assert (verdict.answer, verdict.bound) == (False, 1.0)
    assert_proves(verdict, ring)


@pytest.mark.parametrize("wrong", [0.0, -1.0, -0.0])
def test_a_nonpositive_diagonal_entry_is_a_witness(wrong):
    A = np.diag([1.0, wrong, 2.0])
    verdict = is_h_plus(A)
    assert verdict.answer is False
    assert_proves(verdict, A)
    assert "entry (1, 1)" in verdict.checked


def test_edges_of_is_h_plus():
    assert is_h_plus(np.empty((0, 0))).answer is True
    assert is_h_plus([[3]]).answer is True
    assert is_h_plus(sparse.csr_array((2, 2))).answer is False
    stored_zeros = sparse.csr_array(np.ones((3, 3)))
    stored_zeros.data[:] = np.eye(3).ravel()
    assert is_h_plus(stored_zeros).answer is True
    with pytest.raises(ValueError, match="A must be square"):
        is_h_plus(np.ones((2, 3)))
    with pytest.raises(ValueError, match="A must be finite"):
        is_h_plus([[np.nan]])


def test_the_callers_matrix_is_left_alone():
    A = sparse.csr_array(np.array([[2.0, -3.0], [-1.0, 2.0]]))
    A.data.flags.writeable = False
    assert is_h_plus(A).answer is True


def test_witnesses_may_need_nearly_the_range_of_floating_point():
    # Reducible: v grows by more than 10 from row to row; irreducible: Perron vectors.
    n = 400
    reducible = np.eye(n) + 10.0 * np.eye(n, k=-1)
    verdict = is_h_plus(sparse.csr_array(reducible))
    assert verdict.answer is True
    assert_proves(verdict, reducible)
    for upper, answer in ((0.02, True), (0.03, False)):
        A = sparse.csr_array(reducible + upper * np.eye(n, k=1))
        verdict = is_h_plus(A)
        assert verdict.answer is answer
        assert_proves(verdict, A)


@pytest.mark.parametrize(
    ("delta", "slope", "answer"),
    [(4.0, 0.0, True), (0.0, 0.0, True), (-0.1, 0.0, False), (0.0, 0.5, True)],
)
def test_large_sparse_matrices_by_multigrid(delta, slope, answer, capfd):
    A = five_point(150, delta, -1.0 - slope, -1.0 + slope)
    verdict = is_h_plus(A)
    assert verdict.answer is answer
    rows = (2.0 * sparse.diags_array(A.diagonal()) - abs(A)) @ verdict.witness
    assert np.all(rows > 0.0) if answer else np.all(rows <= 0.0)
    assert capfd.readouterr() == ("", "")


def test_m_matrices():
    assert is_m_matrix(np.array([[2.0, -1.0], [-3.0, 2.0]])).answer is True
    assert is_m_matrix(np.array([[2.0, -1.0], [-5.0, 2.0]])).answer is False
    verdict = is_m_matrix(np.array([[2.0, 1.0], [0.0, 2.0]]))
    assert (verdict.answer, verdict.witness) == (False, None)
    assert "K[0, 1] = 1 > 0" in verdict.checked


def random_problem(rng, kind):
    """A of a kind, q, bounds of every sort."""
    n = int(rng.integers(1, 10))
    A = rng.normal(size=(n, n)) * (rng.random((n, n)) < rng.choice([0.3, 1.0]))
    if kind == "spd":
        A = A @ A.T + 0.1 * np.eye(n)
    elif kind == "positive real":
        A = A - A.T + np.diag(rng.uniform(0.3, 2.0, n))
    else:
        np.fill_diagonal(A, 0.0)
        if kind == "Z":
            A = -np.abs(A)
        A = A * rng.uniform(0.3, 1.2) + np.diag(np.abs(A).sum(axis=1) + 0.1)
    lower = np.where(rng.random(n) < 0.3, -np.inf, rng.normal(size=n))
    upper = np.where(rng.random(n) < 0.3, np.inf, lower + rng.exponential(size=n))
    upper[lower == -np.inf] = 1.0
    return A, 3.0 * rng.normal(size=n), lower, upper


def random_parameters(rng, method, D):
    """Some of the parameters that a method has."""
    takes, given = METHODS[method].takes, {}
    if "alpha" in takes and rng.random() < 0.8:
        given["alpha"] = rng.uniform(0.2, 1.9)
    if "beta" in takes and rng.random() < 0.8:
        given["beta"] = rng.uniform(0.0, 1.9)
    if "omega" in takes and rng.random() < 0.7 and "alpha" not in given:
        given["omega"] = rng.choice([0.3, 0.5, 1.0, 2.0]) * D
    if "shift" in takes and rng.random() < 0.5:
        given["shift"] = rng.choice([0.0, 0.3, 1.0])
    return given


def one_sweep(A, q, lower, upper, method, given, s):
    """s+ by the formula of the module, or by the kernel for the accelerated family."""
    parts = splitting(A, method, **given)
    if parts.H:
        step = step_of(A, q, lower, upper, method, **given)
        return one_step(step, s, lower, upper)[0]
    left, N, right = dense_parts(parts)
    R = 2.0 * np.clip(s, lower, upper) - s
    return np.linalg.solve(left, N @ s + right @ R - 2.0 * q)


@pytest.mark.parametrize("method", METHODS)
def test_splittings_are_those_of_the_sweeps(method):
    rng = np.random.default_rng(3)
    A, q, lower, upper = random_problem(rng, "any")
    given = random_parameters(rng, method, np.diag(A))
    parts = splitting(sparse.csr_array(A), method, **given)
    np.testing.assert_allclose((parts.M - parts.N).toarray(), A, atol=1e-14)
    s = rng.normal(size=q.size)
    if not parts.H:
        once = {"s0": s, "eps_abs": 1e-300, "max_iter": 1}
        swept = sweep(A, q, lower, upper, method, **once, **given)
        other = one_sweep(A, q, lower, upper, method, given, s)
        ends = (swept.s, s, other)  # the better of the two iterates comes back
        assert min(np.abs(ends[0] - end).max() for end in ends[1:]) < 1e-12


@pytest.mark.parametrize("kind", ["spd", "positive real", "Z", "any"])
@pytest.mark.parametrize("seed", range(3))
def test_what_provably_converges_does(kind, seed):
    rng = np.random.default_rng(seed)
    proven = 0
    for method in METHODS:
        A, q, lower, upper = random_problem(rng, kind)
        given = random_parameters(rng, method, np.diag(A))
        make = KINDS[rng.choice(list(KINDS))]
        verdict = converges(make(A), method, **given)
        if verdict:
            proven += 1
            eps = 1e-9 * max(1.0, np.abs(A).max())
            s0 = 10.0 * rng.normal(size=q.size)
            limits = {"eps_abs": eps, "max_iter": 100_000, "s0": s0}
            result = sweep(A, q, lower, upper, method, **given, **limits)
            assert result.status is Status.SOLVED, (method, given, verdict)
            assert_contracts(verdict, A, q, lower, upper, method, given, rng)
        elif verdict.answer is False:
            e = np.ones(q.size)
            result = sweep(
                A, verdict.witness, 0.0 * e, np.inf * e, method, **given,
                z0=e + 1e-3 * rng.normal(size=q.size), eps_abs=1e-10, max_iter=3000,
            )  # fmt: skip
            elsewhere = np.abs(result.z - e).max() > 1e-7
            assert elsewhere or result.status is not Status.SOLVED
            assert verdict.bound > 1.0
    assert proven > 2


def assert_contracts(verdict, A, q, lower, upper, method, given, rng):
    """Check the factor that a verdict claims on pairs of iterates."""
    witness = verdict.witness
    if witness is None:
        return
    parts = splitting(A, method, **given)
    Z = np.zeros_like(A)
    if witness.ndim == 2 and parts.H:
        Z = np.linalg.solve(dense_parts(parts)[0], -np.tril(A, -1))
    for _ in range(10):
        pair = rng.normal(size=(2, q.size)) * rng.choice([0.1, 1.0, 10.0])
        after = [one_sweep(A, q, lower, upper, method, given, s) for s in pair]
        sizes = []
        for s, t in (pair, after):
            difference = s - t
            reflected = 2.0 * (np.clip(s, lower, upper) - np.clip(t, lower, upper))
            e = difference - Z @ (reflected - difference)
            if witness.ndim == 2:
                sizes.append(np.sqrt(e @ witness @ e))
            else:
                sizes.append(np.max(np.abs(difference) / witness))
        assert sizes[1] <= verdict.bound * sizes[0] * (1.0 + 1e-9) + 1e-12


def test_definite_matrices():
    rng = np.random.default_rng(0)
    X = rng.normal(size=(30, 40))
    A = X @ X.T  # not an H-matrix
    assert not is_h_plus(A)
    for alpha in (0.1, 1.0, 1.99):
        assert converges(A, "psor", alpha=alpha).answer is True
    assert "Cryer" in converges(A, "amsor", alpha=1.3).theorem  # its default is PSOR
    assert "modulus" in converges(A, "modulus", omega=1e-3).theorem
    skew = np.triu(X[:, :30], 1)
    assert "modulus" in converges(A + skew - skew.T, "modulus").theorem
    big = sparse.block_diag([A] * 40, format="csr")
    assert "LDL'" in converges(big, "pgs").checked


def test_semidefinite_matrices_are_left_undecided_unless_it_is_exact():
    X = np.random.default_rng(1).normal(size=(8, 5))
    A = X @ X.T
    assert converges(A, "psor", alpha=1.2).answer is None
    verdict = converges(A, "psor", alpha=1.2, semidefinite=True)
    assert verdict.answer is True
    assert "for every q with a solution" in verdict.theorem
    ring = 2.0 * np.eye(5) - np.roll(np.eye(5), 1, 1) - np.roll(np.eye(5), -1, 1)
    assert converges(ring, "pgs").answer is True  # weakly dominant, seen exactly
    z = np.array([1.0, 0.0, 2.0, 0.0, 0.0, 3.0, 0.0, 0.0])
    q = np.where(z > 0.0, 0.0, 1.0) - A @ z
    bounds = np.zeros(8), np.full(8, np.inf)
    result = sweep(A, q, *bounds, "psor", alpha=1.2, eps_abs=1e-9, max_iter=100_000)
    assert result.status is Status.SOLVED


def test_rounded_symmetry_is_named():
    A = np.full((3, 3), 0.9) + 0.1 * np.eye(3)
    A[0, 1] += 1e-15
    verdict = converges(A, "psor", alpha=1.7)
    assert verdict.answer is not True or "bounded real" in verdict.theorem
    assert "A is not symmetric" in converges(A, "psor", alpha=1.98).checked


@pytest.mark.parametrize("method", ["mgs", "namgs", "maor", "namj", "nam", "modulus"])
def test_bounds_of_theorem_2_hold(method):
    rng = np.random.default_rng(7)
    for kind in ("any", "Z"):
        A, *_ = random_problem(rng, kind)
        parts = splitting(A, method)
        left, N, right = dense_parts(parts)
        T = np.abs(np.linalg.inv(left)) @ (np.abs(N) + np.abs(right))
        lower, upper, _ = radius_bounds(T, rtol=1e-9)
        rho = radius(T)
        assert lower <= rho * (1.0 + 1e-9) <= upper * (1.0 + 2e-9)


def test_h_plus_matrices_with_omega_above_d():
    """Bai's and Zheng and Yin's theorems; Ahn's for projected SOR."""
    rng = np.random.default_rng(2)
    A, rho = random_matrix(rng, 0.9)
    D = np.diag(A)
    for method in ("mgs", "amgs", "modulus"):
        assert "K v > 0" in converges(A, method, omega=1.7 * D).theorem
    limit = 2.0 / (1.0 + rho)
    assert "K v > 0" in converges(A, "psor", alpha=limit - 1e-3).theorem
    assert "K v > 0" not in converges(A, "psor", alpha=limit + 1e-3).theorem


def test_theorem_3_piece_by_piece():
    A = five_point(8, 4.0)
    D = A.diagonal()
    own = theorem_3(A, "namgs", shift=1.0)  # the paper's Omega is D/2
    assert own.h_plus.answer is True
    assert own.h_compatible.answer is own.repaired.answer is False
    assert own.case_1.answer is own.case_2_stated.answer is False
    assert not own.applies
    assert not own.applies_as_proved
    above = theorem_3(A, "namgs", shift=1.0, omega=D)
    assert above.case_1.answer is above.repaired.answer is True
    assert not above.applies
    jacobi = theorem_3(A, "namj", shift=1.0, omega=D)  # the one it does cover
    assert jacobi.h_compatible.answer is True
    assert jacobi.applies
    below = theorem_3(A, "namj", shift=1.0, omega=0.8 * D)
    assert below.case_2_stated.answer is True
    assert below.applies
    between = theorem_3(A, "namj", shift=1.0, omega=0.6 * D)
    assert between.case_2_stated.answer is False
    assert between.case_2_proved.answer is True
    assert between.applies_as_proved
    assert not between.applies
    assert theorem_3(five_point(8), "namgs", omega=D).repaired.answer is False
    with pytest.raises(ValueError, match="theorem_3 is about nam"):
        theorem_3(A, "pgs")


@pytest.mark.parametrize("example", [(-1.0, -1.0), (-1.5, -0.5)])
@pytest.mark.parametrize("delta", [4.0, 0.0])
def test_the_papers_runs_have_a_lyapunov_function(example, delta):
    A = five_point(10, delta, *example)
    for method, given in (
        ("mgs", {}),
        ("namgs", {"shift": 1.0}),
        ("namsor", {"alpha": 0.91, "shift": 1.0}),
    ):
        assert converges(A, method, **given).answer is True
        found = lyapunov_function(splitting(A, method, **given))
        assert found is not None
        assert found.factor < 1.0


def test_h_compatible_splittings():
    A = five_point(4, 1.0)
    D = sparse.diags_array(A.diagonal())
    assert is_h_compatible(D, D - A).answer is True
    assert is_h_compatible(abs(A), abs(A) - A).answer is False
    parts = splitting(A, "namgs")
    assert is_h_compatible(parts.M, parts.N).answer is False
    parts = splitting(A, "msor", alpha=0.8)
    assert is_h_compatible(parts.M, parts.N).answer is True


def test_wrong_arguments_are_named():
    A = np.eye(2)
    with pytest.raises(ValueError, match="method must be a sweep method"):
        converges(A, "auto")
    with pytest.raises(ValueError, match="omega must be given in numbers"):
        converges(A, "mgs", omega="auto")
    with pytest.raises(ValueError, match="omega is not a parameter of method 'pgs'"):
        converges(A, "pgs", omega=1.0)
    with pytest.raises(ValueError, match="A must have a positive diagonal"):
        converges(-A, "pgs")
    with pytest.raises(ValueError, match=r"alpha must lie in \(0, 2\)"):
        converges(A, "psor", alpha=2.0)


def test_undecided_verdicts_say_what_was_tried():
    verdict = converges(five_point(30), "namgs")
    assert verdict.answer is None
    assert not verdict
    assert "K = C - W is not an M-matrix" in verdict.checked
