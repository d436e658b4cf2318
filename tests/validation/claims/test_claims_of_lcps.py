"""Figures of the claims on LCPs and derivatives, from rows whose answers are known."""

import pytest

from validation.claims import (
    measured,
    measured_derivatives,
    measured_lcps,
    measured_paper,
)
from validation.claims.ratios import figures
from validation.harness import cli


def file(folder, name, text):
    """Write lines as a CSV file with a header like those of the results."""
    lines = [line.strip() for line in text.strip().splitlines()]
    (folder / f"{name}.csv").write_text("\n".join(["# date: today", *lines]) + "\n")


def test_files_that_are_missing_or_empty_have_no_figures(tmp_path):
    file(tmp_path, "hertz", "n,products")
    assert figures(tmp_path, measured_lcps.FILES) == {}


def test_every_figure_has_one_source():
    alone = [figures(cli.RESULTS, source.FILES) for source in measured.SOURCES]
    assert sum(map(len, alone)) == len(set().union(*alone))


def test_general_lcps_are_counted_by_solver(tmp_path):
    file(tmp_path, "general-lcps", """
        family,n,seed,order,solver,success,said,residual,runtime
        pile,80,0,88,nam,True,solved,1e-16,0.5
        pile,80,1,84,nam,False,timeout,,
        pile,80,0,88,lemke,False,ray,1,0.1
        pile,80,1,84,lemke,True,solved,1e-16,0.1
        pile,6000,0,6468,nam,True,solved,1e-16,9.0
        pile,6000,1,,nam,False,timeout,,
        wall,6000,0,6088,nam,True,solved,1e-16,0.25
        games,4,0,4,nam,True,solved,1e-16,0.001
        games,4,1,4,nam,True,solved,1e-16,0.004
        games,10,0,10,nam,True,solved,1e-16,0.008
    """)  # fmt: skip
    found = figures(tmp_path, measured_lcps.FILES)
    assert found["friction LCPs asked of nam"] == 2
    assert found["friction LCPs solved by nam"] == 1
    assert found["friction LCPs solved by lemke"] == 1
    assert found["friction LCPs, largest n"] == 88
    assert found["general LCPs that others alone solve"] == 1
    assert found["large friction LCPs solved by nam"] == 2
    assert found["large pile, asked"] == 2
    assert found["large pile, solved"] == 1
    assert found["large pile, n"] == 6468
    assert found["walls, most seconds"] == 0.25
    assert found["games, least ms"] == pytest.approx(2.0)
    assert found["games, most ms"] == pytest.approx(8.0)
    assert "copositive LCPs asked of nam" not in found


def test_energy_of_steps_is_compared_within_a_run(tmp_path):
    file(tmp_path, "time-stepping", """
        discs,start,step,n,status,method,residual,seconds,energy,overlap
        5,last step,0,4,solved,pivoting,0,0.001,3.0,0.0
        5,last step,1,4,solved,pivoting,0,0.003,3.5,1e-12
        5,nothing,0,4,solved,pivoting,0,0.005,9.0,0.0
        5,nothing,1,4,stalled,pivoting,0,0.005,8.0,0.0
    """)  # fmt: skip
    found = figures(tmp_path, measured_lcps.FILES)
    assert found["steps, most energy gained"] == 0.5
    assert found["steps solved"] == 3
    assert found["steps, warm, most ms"] == pytest.approx(2.0)
    assert found["steps, deepest overlap"] == 1e-12


def test_exponents_begin_at_large_piles(tmp_path):
    columns = "scene,n,solver,method,status,iterations,seconds,ratio,memory"
    file(tmp_path, "large", f"""
        {columns}
        wall,900,nam,pivoting,solved,11,1.0,,5
        wall,10000,nam,pivoting,solved,31,2.0,,5
        wall,90000,nam,pivoting,solved,30,54.0,,5
        forced,90000,nam,multigrid,solved,3,0.5,1.1,7
        forced,90000,piqp,piqp,solved,,6.0,,
        forced,90000,osqp,osqp,solved,,9.0,,
        forced,90000,clarabel,clarabel,inaccurate,,1.0,,
        put,4000,nam,error 2e-6,solved,5,1e-5,2.5,
    """)  # fmt: skip
    found = figures(tmp_path, measured_lcps.FILES)
    assert found["wall, exponent"] == pytest.approx(1.5)  # 27 times for 9 times n
    assert found["wall, factorisations"] == 30
    assert found["forced obstacle, fastest peer over nam"] == 12.0
    assert found["put over Brennan and Schwartz, a step"] == 2.5
    assert found["obstacles solved"] == 0


def test_closest_points_that_are_right(tmp_path):
    file(tmp_path, "closest", """
        problem,group,norm,clarabel,piqp,conditions,closest,feasible,ratio,soft,proxqp,excess,said
        a,"MPC, stagewise",1,1e-6,1e-9,1e-10,0.008,0.002,4,,,,
        b,"MPC, stagewise",1,1e-12,1e-9,1e-8,0.002,0.002,1,,,,
        c,small,1,inf,1e-9,1e-10,0.0005,0.0001,5,0.001,0.004,0.25,solved
        d,"Maros-Meszaros, row",,,,,,,,,,,The search ended
        e,small,,,,,,,,,,,No shift helps: they contradict each other
    """)  # fmt: skip
    found = figures(tmp_path, measured_derivatives.FILES)
    assert found["closest problems"] == 5
    assert found["closest problems of Maros-Meszaros"] == 1
    assert found["closest points"] == 4
    assert found["closest points right"] == 2  # b misses the conditions
    assert found["closest over feasible"] == pytest.approx(2.0)
    assert found["closest over feasible, above three"] == 1
    assert found["quick closest, most ms"] == pytest.approx(0.5)
    assert found["proxqp over closest"] == pytest.approx(4.0)
    assert found["proxqp, most percent above the least norm"] == 25.0


def test_the_best_peer_is_that_of_solve_and_backward_together(tmp_path):
    file(tmp_path, "derivatives-peers", """
        case,solver,solve,backward,error,ratio,linear
        band,nam,2.0,1.0,1e-15,0.5,
        band,dqp,1.0,9.0,1e-12,9,
        band,qpth,5.0,1.0,1e-4,0.2,
        band,proxqp,,,,,
        obstacle,nam,4.0,3.0,1e-13,0.75,2.0
    """)  # fmt: skip
    found = figures(tmp_path, measured_derivatives.FILES)
    assert found["backward over best peer, band"] == 0.5
    assert found["backward over linear solve, obstacle"] == 1.5
    assert found["backward, most error of nam"] == 1e-15
    assert found["backward, least error of others"] == 1e-4


def test_pairs_without_a_best_point_do_not_count(tmp_path):
    file(tmp_path, "parameters-held-out", """
        scene,grid_sweeps,auto_sweeps,ratio,ratio_with_products,within
        a,10,12,1.2,1.5,True
        a,none,none,nan,nan,True
        b,10,20,2.0,2.0,False
        b,10,none,inf,inf,False
    """)  # fmt: skip
    found = figures(tmp_path, measured_paper.FILES)
    assert found == {
        "auto held-out pairs": 3,
        "auto held-out pairs within": 1,
        "auto held-out pairs beyond": 2,
        "auto held-out pairs not solved": 1,
    }
