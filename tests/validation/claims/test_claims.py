"""The figures of the results, each from a file of a few rows."""

import csv
import math

import pytest

from validation.claims import measured_qps, measured_repeated, measured_trust, values


def table(text):
    """Return lines as the rows of a CSV file."""
    return list(csv.DictReader(line.strip() for line in text.strip().splitlines()))


def test_nothing_is_measured_without_files(tmp_path):
    assert values(tmp_path) == {}


def test_answers_that_are_tenfold_off_are_wrong():
    rows = table("""
        limit,problem,set,solver,eps,runtime,found,primal_residual,dual_residual,duality_gap,sign_violation,success
        10.0,a,all,nam,1e-06,1e-4,True,0,9e-6,0,0,False
        10.0,b,all,nam,1e-06,1e-4,True,0,0,2e-5,0,False
        10.0,c,all,nam,1e-06,1e-4,True,nan,0,0,0,False
        10.0,d,all,nam,1e-06,9.0,False,1,1,1,1,False
        10.0,e,all,nam,1e-06,2e-3,True,0,0,0,0,True
        10.0,e,all,piqp,1e-06,4e-3,True,0,0,0,0,True
        10.0,b,all,piqp,1e-06,1e-4,True,0,0,1,0,False
        100.0,b,all,nam,1e-06,1e-4,True,0,0,1,0,False
    """)
    found = measured_qps.of_maros_meszaros(rows)
    assert found["Maros-Meszaros problems"] == 5
    assert found["Maros-Meszaros wrong"] == 2
    assert found["Maros-Meszaros solved at 1e-6"] == 1
    assert found["Maros-Meszaros over piqp, 1 to 10 ms"] == pytest.approx(0.5)
    assert math.isnan(found["Maros-Meszaros over piqp, below 1 ms"])


def test_classes_are_compared_with_the_best_peer():
    rows = table("""
        problem,set,solver,runtime,success,entries
        1,lasso,nam,2.0,True,1000
        1,lasso,piqp,1.0,True,1000
        1,lasso,osqp,0.1,False,1000
        2,lasso,nam,1.0,True,10000
        2,lasso,piqp,4.0,True,10000
        2,lasso,osqp,2.0,True,10000
        3,lasso,nam,1.0,True,100000
    """)
    found = measured_qps.of_classes(rows)
    assert found["classes solved"] == 3
    assert found["classes above 1.3"] == 1
    assert found["classes over best peer"] == pytest.approx(1.0)
    assert found["classes over best peer, worst from 10^4 entries"] == 0.5


def test_sequences_by_scene_and_size():
    rows = table("""
        scene,size,level,solver,microseconds,residual,difference
        contact,30,stays,nam,4.0,1e-12,3e-9
        contact,30,stays,daqp,1.0,1e-12,0
        contact,500,stays,nam,1.0,1e-12,0
        contact,500,stays,daqp,1.0,1e-12,0
        portfolio,50,stays,nam,1.0,5e-10,2e-10
        portfolio,50,stays,daqp,,,
    """)
    found = measured_repeated.of_sequences(rows)
    assert found["contact sequences over daqp"] == pytest.approx(2.0)
    assert found["contact sequences 30 over daqp"] == pytest.approx(4.0)
    assert math.isnan(found["portfolio over daqp"])
    assert found["sequences, worst residual"] == 5e-10
    assert found["sequences, worst difference"] == 3e-9
    assert found["sequences, worst difference but in contact"] == 2e-10


def test_small_calls_beside_the_best_that_solves_all():
    rows = table("""
        n,solver,microseconds,solved,problems
        100,nam,6.0,3,3
        100,nam by calls,1.0,3,3
        100,daqp,12.0,3,3
        100,piqp,2.0,2,3
        100,osqp,,,
    """)
    found = measured_repeated.of_latency(rows)
    assert found["one QP of 100 over best other"] == 0.5
    assert found["one QP of 100 by daqp, us"] == 12.0
    assert math.isnan(found["one QP of 5, us"])


def test_known_values_and_misses_of_oracles():
    rows = table("""
        scene,solver,quantity,source,agrees,why
        dam,nam,objective,Bueler,True,
        dam,osqp,objective,Bueler,True,
        dam,piqp,objective,Bueler,False,gave up
        ball,nam,objective,scenes.md,True,
        ball,nam,error,scenes.md,True,
        ball,osqp,error,scenes.md,False,
        heap,nam,objective,osqp,False,
        heap,osqp,objective,osqp,True,
    """)
    found = measured_trust.of_oracles(rows)
    assert found["oracles, scenes"] == 3
    assert found["oracles, quantities"] == 4
    assert found["oracles, quantities that agree"] == 3
    assert found["oracles, known values"] == 3
    assert found["oracles, known values by another"] == 1
    assert found["oracles, misses of peers"] == 2
    assert found["oracles, misses without a reason"] == 1


def test_stress_is_counted_by_kind():
    rows = table("""
        row,solver,outcome
        easy,nam,right
        easy,piqp,right
        hard,nam,gave up
        hard,piqp,right
        worst,nam,right
        worst,piqp,wrong
    """)
    found = measured_trust.of_stress(rows)
    assert found["stress not right"] == 1
    assert found["stress wrong by piqp"] == 1
    assert found["stress kinds behind a peer"] == 1


def test_campaign_of_several_seeds():
    rows = table("""
        seed,set,solver,class,truth,outcome,count
        1,every,nam,,,done,10
        2,every,nam,,,done,10
        1,general,nam,,,done,5
        1,every,nam,QP dense,solvable,right,8
        2,every,nam,QP dense,solvable,right,7
        2,every,nam,QP dense,solvable,refused,1
        2,every,nam,QP rows,both,right,2
        1,every,nam,LCP PSD,solvable,right,2
        1,general,nam,LCP general,solvable,refused,4
        1,general,nam,LCP general,solvable,wrong,1
        1,every,osqp,QP dense,solvable,wrong,3
    """)
    found = measured_trust.of_campaign(rows)
    assert found["campaign problems"] == 25
    assert found["campaign wrong"] == 1
    assert found["campaign, QPs solvable"] == 16
    assert found["campaign, QPs solvable, right"] == 15
    assert found["campaign, QPs without a solution"] == 2
    assert found["campaign, LCPs solvable"] == 2
