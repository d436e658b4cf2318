"""The theory as code: verdicts against definitions, witnesses in exact arithmetic."""

from fractions import Fraction

import numpy as np
import plain_sweeps
import pytest
from plain_sweeps import ACCELERATED, TAKES
from problems_lcp import paper_example
from scipy import sparse

from namlcp import Status, converges, is_h_plus, solve_lcp

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


def five_point(m, delta=0.0, number=1):
    """The paper's P + delta I of Example 1 or 2."""
    return paper_example(number, m, delta)[0]


def assert_proves(verdict, A):
    """Check the witness by rational numbers."""
    A = A.toarray() if sparse.issparse(A) else np.asarray(A)
    x = [Fraction(v) for v in verdict.witness.tolist()]
    rows = [
        sum(
            (1 if i == j else -1) * Fraction(abs(v) if i != j else v) * x[j]
            for j, v in enumerate(row)
        )
        for i, row in enumerate(A.tolist())
    ]
    if verdict.answer:
        assert all(v > 0 for v in x)
        assert all(row > 0 for row in rows)
    else:
        assert all(v >= 0 for v in x)
        assert any(v > 0 for v in x)
        assert all(row <= 0 for row in rows)


# ---- is_h_plus


@pytest.mark.parametrize("seed", range(8))
def test_is_h_plus_agrees_with_the_definition(seed):
    rng = np.random.default_rng(seed)
    for target in BORDER * 4:
        A, rho = random_matrix(rng, target)
        make = KINDS[rng.choice(list(KINDS))]
        verdict = is_h_plus(make(A))
        assert verdict.answer is (rho < 1.0), (len(A), rho, verdict.checked)
        assert bool(verdict) is verdict.answer
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
    for corner, answer in ((-3.0, True), (-5.0, False)):  # Z-matrices
        assert is_h_plus([[2.0, -1.0], [corner, 2.0]]).answer is answer
    ring = 2.0 * np.eye(5) - np.roll(np.eye(5), 1, 1) - np.roll(np.eye(5), -1, 1)
    verdict = is_h_plus(ring)  # exactly singular
    assert (verdict.answer, verdict.bound) == (False, 1.0)
    assert_proves(verdict, ring)
    stored_zeros = sparse.csr_array(np.ones((3, 3)))
    stored_zeros.data[:] = np.eye(3).ravel()
    assert is_h_plus(stored_zeros).answer is True
    read_only = sparse.csr_array(np.array([[2.0, -3.0], [-1.0, 2.0]]))
    read_only.data.flags.writeable = False
    assert is_h_plus(read_only).answer is True
    with pytest.raises(ValueError, match="A must be square"):
        is_h_plus(np.ones((2, 3)))
    with pytest.raises(ValueError, match="A must be finite"):
        is_h_plus([[np.nan]])


def test_witnesses_may_need_the_range_of_floating_point():
    # Reducible: v grows by more than 10 from row to row; irreducible: Perron vectors.
    n = 200
    reducible = np.eye(n) + 10.0 * np.eye(n, k=-1)
    for upper, answer in ((0.0, True), (0.02, True), (0.03, False)):
        A = sparse.csr_array(reducible + upper * np.eye(n, k=1))
        verdict = is_h_plus(A)
        assert verdict.answer is answer
        assert_proves(verdict, A)


@pytest.mark.parametrize(
    ("delta", "number", "answer"),
    [(4.0, 1, True), (0.0, 1, True), (-0.1, 1, False), (0.0, 2, True)],
)
def test_large_sparse_matrices_by_multigrid(delta, number, answer, capfd):
    A = five_point(150, delta, number)
    verdict = is_h_plus(A)
    assert verdict.answer is answer
    rows = (2.0 * sparse.diags_array(A.diagonal()) - abs(A)) @ verdict.witness
    assert np.all(rows > 0.0) if answer else np.all(rows <= 0.0)
    assert capfd.readouterr() == ("", "")


# ---- converges


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
    takes, given = TAKES[method].split(), {}
    if "alpha" in takes and rng.random() < 0.8:
        given["alpha"] = rng.uniform(0.2, 1.9)
    if "beta" in takes and rng.random() < 0.8:
        given["beta"] = rng.uniform(0.0, 1.9)
    if "omega" in takes and rng.random() < 0.7 and "alpha" not in given:
        given["omega"] = rng.choice([0.3, 0.5, 1.0, 2.0]) * D
    if "shift" in takes and rng.random() < 0.5:
        given["shift"] = rng.choice([0.0, 0.3, 1.0])
    return given


@pytest.mark.parametrize("kind", ["spd", "positive real", "Z", "any"])
@pytest.mark.parametrize("seed", range(3))
def test_what_provably_converges_does(kind, seed):
    rng = np.random.default_rng(seed)
    proven = 0
    for method in TAKES:
        A, q, lower, upper = random_problem(rng, kind)
        given = random_parameters(rng, method, np.diag(A))
        make = KINDS[rng.choice(list(KINDS))]
        verdict = converges(make(A), method, **given)
        if verdict:
            proven += 1
            eps = 1e-9 * max(1.0, np.abs(A).max())
            limits = {"eps_abs": eps, "max_iter": 100_000}
            result = solve_lcp(
                A, q, lower, upper, method=method, **given, **limits,
                s0=10.0 * rng.normal(size=q.size),
            )  # fmt: skip
            assert result.status is Status.SOLVED, (method, given, verdict)
            assert_contracts(verdict, A, q, lower, upper, method, given, rng)
        elif verdict.answer is False:
            e = np.ones(q.size)
            result = solve_lcp(
                A, verdict.witness, method=method, **given, eps_abs=1e-10,
                max_iter=3000, z0=e + 1e-3 * rng.normal(size=q.size),
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
    M, omega = plain_sweeps.split(A, method, **given)
    left, Z = M + np.diag(omega), np.zeros_like(A)
    if method not in ACCELERATED and witness.ndim == 1:
        T = np.abs(np.linalg.solve(left, M - A))
        T += np.abs(np.linalg.solve(left, np.diag(omega) - A))
        assert radius(T) <= verdict.bound * (1.0 + 1e-9) < 1.0 + 1e-9
    if witness.ndim == 2 and method in ACCELERATED:
        Z = np.linalg.solve(left, -np.tril(A, -1))
    step = plain_sweeps.step(A, q, lower, upper, method, **given)
    for _ in range(10):
        pair = rng.normal(size=(2, q.size)) * rng.choice([0.1, 1.0, 10.0])
        sizes = []
        for s, t in (pair, [step(s) for s in pair]):
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
    big = sparse.block_diag([sparse.csr_array(A)] * 40, format="csr")
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
    result = solve_lcp(A, q, method="psor", alpha=1.2, eps_abs=1e-9, max_iter=100_000)
    assert result.status is Status.SOLVED


def test_rounded_symmetry_is_named():
    A = np.full((3, 3), 0.9) + 0.1 * np.eye(3)
    A[0, 1] += 1e-15
    verdict = converges(A, "psor", alpha=1.7)
    assert verdict.answer is not True or "bounded real" in verdict.theorem
    assert "A is not symmetric" in converges(A, "psor", alpha=1.98).checked


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


def test_theorem_4_1_where_the_comparison_fails():
    found = [
        converges(random_problem(np.random.default_rng(seed), "any")[0], method).theorem
        for seed in range(40)
        for method in ("mgs", "namgs", "namj", "nam", "modulus")
    ]
    assert sum("(Theorem 4.1)" in theorem for theorem in found) > 1


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("delta", [4.0, 0.0])
def test_the_papers_runs_converge(number, delta):
    """Where no comparison proves it, in the norm of a quadratic function."""
    A = five_point(6, delta, number)
    rng = np.random.default_rng(0)
    for method, given in (
        ("mgs", {}),
        ("namgs", {"shift": 1.0}),
        ("namsor", {"alpha": 0.91, "shift": 1.0}),
    ):
        verdict = converges(A, method, **given)
        assert verdict.answer is True
        if method == "namgs" and delta == 0.0:
            assert "bounded real lemma" in verdict.theorem
            assert verdict.bound < 1.0
        q, lower, upper = -np.ones(36), np.zeros(36), np.full(36, np.inf)
        data = A.toarray(), q, lower, upper
        assert_contracts(verdict, *data, method, given, rng)


def test_wrong_arguments_are_named():
    A = np.eye(2)
    for given, message in (
        ({"method": "auto"}, "method must be a sweep method"),
        ({"method": "mgs", "omega": "auto"}, "omega must be given in numbers"),
        ({"method": "pgs", "omega": 1.0}, "omega is not a parameter of method 'pgs'"),
        ({"method": "psor", "alpha": 2.0}, r"alpha must lie in \(0, 2\)"),
    ):
        with pytest.raises(ValueError, match=message):
            converges(A, **given)
    with pytest.raises(ValueError, match="A must have a positive diagonal"):
        converges(-A, "pgs")


def test_undecided_verdicts_say_what_was_tried():
    verdict = converges(five_point(30), "namgs")
    assert verdict.answer is None
    assert not verdict
    assert "K = C - W is not an M-matrix" in verdict.checked
