"""What the figures of the README are made of: what counts as wrong, best, fallen."""

import csv

import numpy as np
import pytest

from validation.claims import Claim, measured, measured_qps, measured_trust, moved
from validation.claims import values as figures_of
from validation.claims.limits import LIMITS
from validation.claims.ratios import figures, mean, over
from validation.harness import cli

TABLES = {
    # tenfold off is wrong, less is a miss; one that says so is neither
    "answers": (measured_qps.of_maros_meszaros, """
        limit,problem,set,solver,eps,runtime,found,primal_residual,dual_residual,duality_gap,sign_violation,success
        10.0,a,all,nam,1e-06,1e-4,True,0,9e-6,0,0,False
        10.0,b,all,nam,1e-06,1e-4,True,0,0,2e-5,0,False
        10.0,c,all,nam,1e-06,1e-4,True,nan,0,0,0,False
        10.0,d,all,nam,1e-06,9.0,False,1,1,1,1,False
        10.0,e,all,nam,1e-06,2e-3,True,0,0,0,0,True
        10.0,e,all,piqp,1e-06,4e-3,True,0,0,0,0,True
        10.0,b,all,piqp,1e-06,1e-4,True,0,0,1,0,False
        100.0,b,all,nam,1e-06,1e-4,True,0,0,1,0,False
        """, {
            "Maros-Meszaros problems": 5, "Maros-Meszaros wrong": 2,
            "Maros-Meszaros solved at 1e-6": 1,
            "Maros-Meszaros over piqp, 1 to 10 ms": 0.5,
            "Maros-Meszaros over piqp, below 1 ms": np.nan,
        }),
    # the best peer is that of each problem, of those that solve it
    "classes": (measured_qps.of_classes, """
        problem,set,solver,runtime,success,entries
        1,lasso,nam,2.0,True,1000
        1,lasso,piqp,1.0,True,1000
        1,lasso,osqp,0.1,False,1000
        2,lasso,nam,1.0,True,10000
        2,lasso,piqp,4.0,True,10000
        2,lasso,osqp,2.0,True,10000
        3,lasso,nam,1.0,True,100000
        """, {
            "classes solved": 3, "classes above 1.3": 1, "classes over best peer": 1.0,
            "classes over best peer, worst from 10^4 entries": 0.5,
        }),
    "campaign": (measured_trust.of_campaign, """
        seed,set,solver,class,truth,outcome,count
        1,every,nam,,,done,10
        1,general,nam,,,done,5
        1,every,nam,QP dense,solvable,right,8
        2,every,nam,QP dense,solvable,right,7
        2,every,nam,QP dense,solvable,refused,1
        2,every,nam,QP rows,both,right,2
        1,general,nam,LCP general,solvable,wrong,1
        1,every,osqp,QP dense,solvable,wrong,3
        """, {
            "campaign problems": 15, "campaign wrong": 1,
            "campaign, QPs solvable": 16, "campaign, QPs solvable, right": 15,
            "campaign, QPs without a solution": 2,
        }),
    "stress": (measured_trust.of_stress, """
        row,solver,outcome
        easy,nam,right
        easy,piqp,right
        hard,nam,gave up
        hard,piqp,right
        worst,nam,right
        worst,piqp,wrong
        """, {
            "stress not right": 1, "stress wrong by piqp": 1,
            "stress kinds behind a peer": 1,
        }),
}  # fmt: skip


@pytest.mark.parametrize("name", TABLES)
def test_rows_are_counted_by_what_they_say(name):
    source, text, expected = TABLES[name]
    rows = list(csv.DictReader(line.strip() for line in text.strip().splitlines()))
    found = source(rows)
    known = {key: found[key] for key in expected}
    assert known == pytest.approx(expected, nan_ok=True)


def test_every_figure_has_one_source_and_every_limit_a_figure(tmp_path):
    alone = [figures(cli.RESULTS, source.FILES) for source in measured.SOURCES]
    assert sum(map(len, alone)) == len(set().union(*alone))
    assert set(LIMITS) <= set(figures_of())
    assert figures_of(tmp_path) == {}  # nothing is measured without files


def test_ratio_of_times_counts_what_both_solve():
    columns = "problem", "solver", "runtime", "success"
    rows = [
        dict(zip(columns, line.split(), strict=True)) | {"set": "s"}
        for line in (
            "a nam 1.0 True", "a piqp 4.0 True", "b nam 1.0 True", "b piqp 1.0 True",
            "c nam 1.0 True", "c piqp 9.0 False", "d piqp 1.0 True",
        )
    ]  # fmt: skip
    assert mean(over(rows, "piqp")) == pytest.approx(0.5)
    assert np.isnan(mean(over(rows, "osqp")))


def test_claims_that_fell_are_marked():
    before = [Claim("time", 0.9, "<=", 1.0), Claim("solved", 7, ">=", 8)]
    now = [before[0]._replace(value=1.1), before[1]._replace(value=float("nan"))]
    text = moved(before, now)
    assert "| time | <= 1 | 0.9 | 1.1 | FELL |" in text
    assert "| solved | >= 8 | 7 | nan | falls short |" in text
