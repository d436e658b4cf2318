"""Starts, repeats, limits, copies and prepared matrices change no answer."""

import copy
import pickle

import numpy as np
import problems_lcp as problems
import pytest
from lcp_cases import all_cases
from lcp_definition import (
    assert_consistent,
    assert_proves_unsolvable,
    assert_solves_lcp,
)
from plain_sweeps import TAKES
from scipy import sparse
from scipy.sparse.linalg import aslinearoperator
from solves import BANDS
from test_every_method import METHODS, sweeping

from namlcp import Prepared, Status, solve_lcp

CASES = all_cases()
UNIQUE = [
    name for name, case in CASES.items() if case.truth in ("P", "dominant")
    and 0 < case.q.size <= 60 and "far solution" not in name and "1e+12" not in name
]  # fmt: skip


# ---- starts


@pytest.mark.parametrize("name", UNIQUE)
def test_restart_at_the_answer(name):
    A, q, lower, upper = CASES[name].data
    first = solve_lcp(A, q, lower, upper)
    again = solve_lcp(A, q, lower, upper, z0=first.z)
    assert again.status is Status.SOLVED
    assert again.iterations <= 1
    near = solve_lcp(A, q * (1.0 + 1e-9), lower, upper, z0=first.z)
    assert near.iterations <= max(first.iterations, 2)
    far = solve_lcp(A, q, lower, upper, z0=1e3 * np.cos(np.arange(q.size)))
    assert_solves_lcp(far, A, q, lower, upper)


@pytest.mark.parametrize("way", TAKES)
@pytest.mark.parametrize("name", ["dominant box", "dominant free"])
def test_sweeps_stay_at_the_answer(name, way):
    """Where A z + q = Omega (z - s)."""
    case = CASES[name]
    A, q, lower, upper = case.data
    options = {"method": way, "eps_abs": 1e-9}
    again = solve_lcp(A, q, lower, upper, z0=case.z, **options)
    assert again.iterations == 0
    first = solve_lcp(A, q, lower, upper, method=way, eps_abs=1e-11)
    np.testing.assert_array_equal(first.z, np.clip(first.s, lower, upper))
    again = solve_lcp(A, q, lower, upper, s0=first.s, **options)
    assert again.iterations == 0
    np.testing.assert_array_equal(again.s, first.s)


def test_a_start_is_returned_only_if_it_is_far_better_than_asked_for():
    # Otherwise errors would add up from one problem of a sequence to the next.
    A, z = np.ones((3, 3)) + 3.0 * np.eye(3), np.array([1.0, 2.0, 3.0])
    near, nearer = z + 1e-8, z + 1e-10
    assert solve_lcp(A, -A @ z, z0=near, eps_abs=1e-6).residual < 1e-14
    result = solve_lcp(A, -A @ z, z0=nearer, eps_abs=1e-6)
    np.testing.assert_array_equal(result.z, nearer)


@pytest.mark.parametrize("size", [1e-8, 1e8])
def test_a_start_is_measured_in_the_units_of_the_data(size):
    """Where eps_abs is between Res as given and scaled to a unit diagonal."""
    A, start = size * np.array([[2.0, 1.0], [1.0, 2.0]]), np.array([1.0, 1.0 + 1e-10])
    error = np.linalg.norm(A @ (start - 1.0))
    eps_abs = 1e3 * error if size < 1.0 else 0.1 * error
    result = solve_lcp(A, A @ [-1.0, -1.0], z0=start, eps_abs=eps_abs)
    assert (result.status, result.method) == (Status.SOLVED, "pivoting")
    assert (result.iterations == 0) == (size < 1.0)


def test_a_start_at_the_solution_of_a_general_lcp_takes_one_factorisation():
    """Of a path, which ends inside a face; a vertex of Lemke's may take more."""
    A, q, *_ = CASES["friction 40 1e+00 0.2"].data
    z = solve_lcp(A, q).z
    again = solve_lcp(A, q * (1.0 + 1e-6), z0=z)
    assert_solves_lcp(again, A, q * (1.0 + 1e-6))
    assert (again.method, again.iterations) == ("start", 1)


def test_the_start_is_zero_clipped_into_the_box():
    case = CASES["dominant box"]
    lower = case.lower + 0.5
    result = solve_lcp(case.A, case.q, lower, method="pgs", eps_abs=1e9)
    assert result.iterations == 0
    np.testing.assert_array_equal(result.s, np.clip(0.0, lower, np.inf))


# ---- repeats and layouts


@pytest.mark.parametrize("way", METHODS)
def test_what_may_only_be_read_is_enough(way):
    """Arrays that refuse to be written, and wide indices; the answers are the same."""
    A, q, lower, upper = (np.array(x) for x in CASES["dominant box"].data)
    if way in ("multigrid", "mprgp"):
        A = problems.laplacian(6, 4.0).toarray()
        q, lower, upper = np.cos(np.arange(36.0)), np.zeros(36), np.full(36, np.inf)
    z0 = None if way.startswith("lemke") else np.full(q.size, 0.1)
    C = sparse.csr_array(A)
    wide = C.copy()
    wide.indices, wide.indptr = C.indices.astype(np.int64), C.indptr.astype(np.int64)
    for array in (A, q, lower, upper, z0, C.data, C.indices, C.indptr, wide.data):
        if array is not None:
            array.flags.writeable = False
    found = [
        solve_lcp(METHODS[way].given(X), q, lower, upper, z0=z0, **METHODS[way].options)
        for X in ([C, wide] if way == "auto, dense" else [A, C, wide])
    ]
    for other in found[1:]:
        np.testing.assert_allclose(other.z, found[0].z, atol=1e-8)
    np.testing.assert_array_equal(found[-1].z, found[-2].z)


@pytest.mark.parametrize("name", UNIQUE)
def test_the_order_of_the_unknowns_does_not_matter(name):
    case = CASES[name]
    p = np.random.default_rng(0).permutation(case.q.size)
    A = sparse.csr_array(case.A).toarray()
    q, lower, upper = case.q, case.lower, case.upper
    permuted = A[np.ix_(p, p)], q[p], lower[p], upper[p]
    other = solve_lcp(*permuted)
    assert_solves_lcp(other, *permuted)
    if "rescaled" not in name and "1e+06" not in name:
        z = solve_lcp(A, q, lower, upper).z
        np.testing.assert_allclose(other.z, z[p], atol=1e-6 * (1.0 + np.abs(z).max()))


@pytest.mark.parametrize("layout", [np.asarray, sparse.csr_array])
def test_powers_of_two_are_exact(layout):
    A = layout(3.0 * np.eye(30) - np.eye(30, k=1) - np.eye(30, k=-1))
    q = np.cos(np.arange(30.0))
    plain, huge = solve_lcp(A, q), solve_lcp(A, q * 2.0**600)
    np.testing.assert_array_equal(huge.z, plain.z * 2.0**600)


@pytest.mark.parametrize("layout", [np.asarray, sparse.csr_array])
@pytest.mark.parametrize("tiny", [0.0, 1e-120, 1e-160, 1e-200, 5e-324])
def test_a_tiny_q_changes_nothing_where_bounds_are_none(layout, tiny):
    A = layout([[2.0, -1.0], [-1.0, 2.0]])
    result = solve_lcp(A, np.full(2, tiny), [1.0, 0.0])
    assert result.status is Status.SOLVED
    np.testing.assert_allclose(result.z, [1.0, 0.5])


@pytest.mark.parametrize("bounds", [(1e10, np.inf), (0.0, 1e10), (-np.inf, -1e10)])
def test_bounds_beyond_the_range_in_units_of_q_are_kept(bounds):
    result = solve_lcp([[1.0]], [-1e-300], *bounds)
    assert result.status is Status.SOLVED
    assert result.z[0] == np.clip(1e-300, *bounds)


# ---- limits, history, accuracy

WHOLE = {  # problems of every engine that take several iterations
    "pivoting": (*CASES["triangular_p 60"].data, {}),
    "symmetric pivoting": (*CASES["spd 150 1e+06"].data, {}),
    "skew": (*CASES["skew 50 1e-04"].data, {}),
    "unbounded": (*CASES["unbounded 15 1.0 0"].data, {}),
    "friction": (*CASES["friction 40 1e+00 0.2"].data, {}),
    "lemke": (*CASES["copositive 40 0"].data, {"method": "lemke"}),
    "tridiagonal": (
        sparse.csr_array(BANDS), np.cos(np.arange(400.0) ** 2), 0.0, np.inf, {},
    ),
    "multigrid": (
        problems.laplacian(40), np.cos(np.arange(1600.0)) - 0.1, 0.0, np.inf,
        {"method": "multigrid", "eps_rel": 1e-13},
    ),
    "mprgp": (
        aslinearoperator(problems.laplacian(20)), -np.cos(np.arange(400.0)), 0.0,
        np.inf, {},
    ),
} | {way: (*CASES["dominant box"].data, sweeping(way)) for way in TAKES}  # fmt: skip


@pytest.mark.parametrize("name", WHOLE)
def test_limits(name):
    """Small factorisations, up to 50 of them, go by without a look at the clock."""
    *data, options = WHOLE[name]
    A = problems.laplacian(20) if name == "mprgp" else data[0]
    whole = solve_lcp(*data, **options)
    for most in {1, 2, whole.iterations // 2}:
        if 0 < most < whole.iterations:
            result = solve_lcp(*data, **options, max_iter=most)
            assert_consistent(result, A, *data[1:])
            if result.status is Status.SOLVED and "method" not in options:
                assert result.iterations <= most  # the next engine came sooner
            else:
                assert (result.status, result.iterations) == (Status.MAX_ITER, most)
    last = 0 if "method" in options else 1  # "auto" may ask for a proof once more
    enough = solve_lcp(*data, **options, max_iter=whole.iterations + last)
    assert (enough.status, enough.iterations) == (whole.status, whole.iterations)
    late = solve_lcp(*data, **options, time_limit=1e-9)
    unseen = late.status is whole.status and "method" not in options
    assert late.status is Status.TIME_LIMIT or unseen
    assert late.iterations <= (1 if "method" in options else 50)
    assert_consistent(late, A, *data[1:])


@pytest.mark.parametrize("name", WHOLE)
def test_history(name, capsys):
    *data, options = WHOLE[name]
    result = solve_lcp(*data, **options, history=True, verbose=True)
    history = result.history
    assert history.dtype.names == ("iter", "residual", "active", "time")
    assert (np.diff(history["time"]) >= 0.0).all()
    assert history["iter"][-1] <= result.iterations
    if name in TAKES:
        assert history["iter"].tolist() == list(range(result.iterations + 1))
        assert history["residual"][-1] == pytest.approx(result.residual, rel=1e-3)
        assert (history["residual"][:-1] >= options["eps_abs"]).all()
        at_bound = (result.z == data[2]) | (result.z == data[3])
        assert history["active"][-1] == at_bound.sum()
    said = capsys.readouterr().out
    assert f"{result.status.value}: {result.method}" in said


@pytest.mark.parametrize("name", [name for name in WHOLE if name != "unbounded"])
def test_an_accuracy_beyond_rounding_is_not_claimed(name):
    *data, options = WHOLE[name]
    options = {"method": options.get("method", "auto"), "eps_abs": 1e-40}
    result = solve_lcp(*data, **options)
    assert result.residual < 1e-9 * np.abs(data[1]).max()
    if result.status is not Status.SOLVED:
        assert result.status in (Status.STALLED, Status.DIVERGED)
    else:
        assert result.residual < 1e-40


# ---- prepared matrices, copies

SEQUENCES = {
    "dense": CASES["spd 40 1e+02"].data[:2],
    "P-matrix": (
        problems.triangular_p(np.random.default_rng(1), 12, 2.0),
        -np.ones(12),
    ),
    "singular": CASES["pile of discs 5"].data[:2],
    "large": (problems.laplacian(12), -np.ones(144)),
    "tridiagonal": (CASES["neumann 40"].A + sparse.eye_array(40), -np.ones(40)),
}


def moving(A, q, steps=20):
    """Yield vectors near q, the free velocities of contacts that are pushed."""
    rng = np.random.default_rng(0)
    for _ in range(steps):
        yield q + 0.02 * np.abs(q).max() * (A @ rng.standard_normal(q.size))


@pytest.mark.parametrize("name", SEQUENCES)
def test_a_prepared_matrix_serves_many_problems(name):
    A, q = SEQUENCES[name]
    matrix = Prepared(A)
    assert solve_lcp(matrix, q, method="namgs", max_iter=3).method == "namgs"
    assert matrix.symmetric == (name != "P-matrix")
    first = solve_lcp(matrix, q)
    np.testing.assert_allclose(first.w, solve_lcp(A, q).w, atol=1e-9)
    for one in moving(A, q):
        fresh, result = solve_lcp(A, one), solve_lcp(matrix, one)
        assert result.status is fresh.status is Status.SOLVED
        np.testing.assert_allclose(result.w, fresh.w, atol=1e-9 * np.abs(one).max())
        assert result.residual <= 1e-9 * np.abs(one).max()
    for upper in (0.3, np.inf):
        result, fresh = solve_lcp(matrix, q, upper=upper), solve_lcp(A, q, upper=upper)
        np.testing.assert_allclose(result.w, fresh.w, atol=1e-9 * np.abs(q).max())


def test_the_last_face_saves_factorisations():
    A, q = SEQUENCES["P-matrix"]
    matrix = Prepared(A)
    cold = sum(solve_lcp(A, one).iterations for one in moving(A, q))
    warm = sum(solve_lcp(matrix, one).iterations for one in moving(A, q))
    assert warm < cold / 2


def test_an_lcp_without_a_solution_is_proved_between_others():
    A = np.array([[1.0, -1.0], [-1.0, 1.0]])
    matrix = Prepared(A)
    for q, status in (
        ([-1.0, 2.0], Status.SOLVED),
        ([-1.0, -1.0], Status.UNSOLVABLE),
        ([-2.0, 2.5], Status.SOLVED),
    ):
        result = solve_lcp(matrix, q)
        assert result.status is status
        if status is Status.UNSOLVABLE:
            assert_proves_unsolvable(result.ray, A, q)


def test_a_start_that_is_given_comes_first():
    A, q = SEQUENCES["dense"]
    matrix = Prepared(A)
    expected = solve_lcp(matrix, q)
    solve_lcp(matrix, -q)
    result = solve_lcp(matrix, q, z0=expected.z)
    assert result.iterations <= 1
    np.testing.assert_allclose(result.z, expected.z, atol=1e-10)


def copies(x):
    return copy.copy(x), copy.deepcopy(x), pickle.loads(pickle.dumps(x))


@pytest.mark.parametrize("method", ["auto", "multigrid"])
@pytest.mark.parametrize("name", SEQUENCES)
def test_copies_and_pickles(name, method):
    """Of a matrix that was used, of one that was not, and of results."""
    A, q = SEQUENCES[name]
    if method == "multigrid" and name not in ("large", "tridiagonal"):
        return
    used = Prepared(A)
    expected = solve_lcp(used, q, method=method)
    for matrix in (*copies(used), *copies(Prepared(A))):
        result = solve_lcp(matrix, q, method=method)
        np.testing.assert_allclose(result.w, expected.w, atol=1e-9)
    for result in copies(expected):
        assert result.status is expected.status
        np.testing.assert_array_equal(result.z, expected.z)
        np.testing.assert_array_equal(result.s, expected.s)


def test_a_prepared_matrix_is_checked_at_once():
    with pytest.raises(ValueError, match=r"A must be square, got shape \(2, 3\)"):
        Prepared(np.ones((2, 3)))
