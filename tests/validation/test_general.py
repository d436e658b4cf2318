"""General LCPs of the validation: classes by their definitions, known answers."""

import itertools

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.optimize import linprog

from namlcp import Status, solve_lcp
from validation.general import benchmark, pictures, stepping
from validation.harness import Job, csv_files
from validation.problems.fuzzed import cases, general_lcps
from validation.problems.fuzzed.draw import Draw
from validation.problems.general import circuits, families, games
from validation.stress import campaign
from validation.stress import campaign_answers as answers
from validation.stress.campaign_judge import Answer, judge_lcp


@pytest.mark.parametrize("name", games.KNOWN)
def test_known_games(name):
    R, C, expected = games.KNOWN[name]
    A, q = games.lcp(R, C)
    result = solve_lcp(A, q)
    assert result.status is Status.SOLVED
    x, y = games.strategies(result.z, len(R))
    np.testing.assert_allclose(np.concatenate((x, y)), expected, atol=1e-9)
    assert games.regret(R, C, x, y) < 1e-9


def test_regret_is_what_a_change_of_mind_gains():
    R, C, _ = games.KNOWN["prisoner's dilemma"]
    both_silent = np.array([1.0, 0.0])
    assert games.regret(R, C, both_silent, both_silent) == 2.0


def test_diode_bridge():
    """The resistor sees the modulus of the voltage; energy only falls."""
    states, diodes = circuits.march(300, lambda A, q: solve_lcp(A, q).z)
    assert (np.diff(circuits.energy(states)) <= 1e-15).all()
    resistor = diodes[:, 0] + diodes[:, 1]
    np.testing.assert_allclose(resistor, np.abs(states[1:, 0]), atol=0.3)
    A, _ = circuits.diode_bridge(states[0])
    assert np.linalg.eigvalsh(A + A.T)[0] >= -1e-12


def is_strictly_copositive(A):
    """Every principal block has no eigenvector v > 0 of an eigenvalue <= 0 (Kaplan)."""
    n, S = len(A), A + A.T
    for size in range(1, n + 1):
        for F in itertools.combinations(range(n), size):
            values, vectors = np.linalg.eigh(S[np.ix_(F, F)])
            for value, v in zip(values, vectors.T, strict=True):
                if value <= 0.0 and ((v > 0.0).all() or (v < 0.0).all()):
                    return False
    return True


def test_copositive_matrices_are():
    assert not is_strictly_copositive(np.array([[1.0, -2.0], [-2.0, 1.0]]))
    for seed in range(5):
        assert is_strictly_copositive(families.copositive(6, seed)[0])


def test_p0_matrices_are():
    for seed in range(5):
        A, _ = families.p0(6, seed)
        for size in range(1, 7):
            for F in itertools.combinations(range(6), size):
                assert np.linalg.det(A[np.ix_(F, F)]) >= -1e-10


@pytest.mark.parametrize("name", families.FAMILIES)
def test_families_are_what_their_seeds_make(name):
    A, q = families.FAMILIES[name](30, 1)
    again = families.FAMILIES[name](30, 1)
    assert A.shape == (q.size, q.size)
    assert q.size >= 30
    assert abs(A - again[0]).max() == 0.0
    if name in families.FRICTION:
        heavy, _ = families.FAMILIES[name](30, 1, 1e4)
        assert abs(A - heavy).max() > 0.0


@pytest.mark.parametrize("name", ["pile", "cubes", "copositive", "copositive-plus"])
def test_lemke_solves_what_its_theory_covers(name):
    A, q = families.FAMILIES[name](50, 0)
    assert benchmark.residual(A, q, benchmark.by_lemke(A, q, 10.0)[1]) < 1e-9


@pytest.mark.parametrize("solver", benchmark.SOLVERS)
def test_rows_of_the_benchmark(solver):
    pytest.importorskip({"nam": "namlcp", "lemke": "namlcp"}.get(solver, solver))
    row = benchmark.work(Job(solver, 10.0, None, lambda: None), "copositive-plus", 6, 1)
    assert row["success"] == (row["said"] == "solved" and row["residual"] <= 1e-9)
    assert row["success"] or solver == "daqp"


def test_table_and_plot(tmp_path, capsys):
    file = tmp_path / "rows.csv"
    rows = [
        {"family": "pile", "n": 80, "seed": seed, "order": 88, "solver": solver,
         "success": seed == 0, "said": "solved", "residual": 0.0, "runtime": 0.004}
        for solver in ("nam", "daqp")
        for seed in range(2)
    ]  # fmt: skip
    csv_files.write(file, ["machine: none"], rows)
    assert benchmark.main(["table", "--csv", str(file)]) == 0
    assert "| pile | 88 | 1/2, 4 ms | 1/2, 4 ms |" in capsys.readouterr().out
    figures = ["--figures", str(tmp_path)]
    assert benchmark.main(["plot", "--csv", str(file), *figures]) == 0
    assert (tmp_path / "general-lcps.svg").exists()


@pytest.mark.parametrize("seed", range(5))
def test_unsolvable_general_has_its_proof(seed):
    """HiGHS finds no z >= 0 with A z + q >= 0."""
    lcp, truth = general_lcps.unsolvable_general(Draw(np.random.default_rng(seed)))
    assert truth == "unsolvable"
    n = lcp.q.size
    infeasible = 2
    assert linprog(np.zeros(n), A_ub=-lcp.A, b_ub=lcp.q).status == infeasible


@pytest.mark.parametrize(
    "kind", [general_lcps.friction, general_lcps.strictly_copositive]
)
def test_solvable_classes_are_solved(kind):
    for seed in range(3):
        lcp, truth = kind(Draw(np.random.default_rng(seed)))
        result = solve_lcp(*lcp)
        answer = answers.lcp_answer(result)
        assert judge_lcp(lcp, truth, answer, 1e-9) == ("right", "")


@pytest.mark.parametrize("index", [4657, 4822])
def test_pivoting_in_circles_is_ended(index):
    """Nonsymmetric and strictly copositive: Murty's rule took all its steps."""
    found = campaign.examine(cases.make(1, index, "general"), "nam", 1e-6, 10.0)
    assert found["outcome"] == "right", found


@pytest.mark.parametrize(
    ("truth", "outcome"),
    [("solvable", "wrong"), ("possible", "wrong"), ("unsolvable", "right"),
     ("near", "refused")],
)  # fmt: skip
def test_unsolvable_without_a_ray_is_taken_at_its_word(truth, outcome):
    assert judge_lcp(None, truth, Answer("exhausted"), 1e-9)[0] == outcome


def test_sparse_and_dense():
    A = sp.csr_array(np.eye(2))
    np.testing.assert_array_equal(benchmark.dense(A), np.eye(2))
    assert benchmark.residual(A, np.ones(2), None) == np.inf


def test_pictures(tmp_path):
    assert pictures.main(["--figures", str(tmp_path)]) == 0
    names = sorted(file.name for file in tmp_path.iterdir())
    assert names == ["friction-scenes.svg", "games-and-diodes.svg"]


def test_time_stepping(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(stepping, "STEPS", 40)
    monkeypatch.setattr(stepping, "DRAWN", 4)
    monkeypatch.setattr(stepping, "QUICK", (4,))
    file = str(tmp_path / "rows.csv")
    assert stepping.main(["run", "--quick", "--csv", file]) == 0
    assert stepping.main(["table", "--csv", file]) == 0
    assert "| 4 | last step | " in capsys.readouterr().out
    assert stepping.main(["plot", "--csv", file, "--figures", str(tmp_path)]) == 0
    assert (tmp_path / "time-stepping.png").exists()
