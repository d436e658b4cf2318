"""Scenes and generators of problems; nothing here solves or compares.

A caller takes a module from this door: `from validation.problems import data_sets`.

==========================  ============================================================
draw                        QPs and LCPs around a known solution; the tests use it too
data_sets                   QPs and LCPs of the data folder
known_scenes                box LCPs whose solutions the literature gives
large_scenes                families of box LCPs of any size
contact_scenes              heaps of discs, walls of bricks
sweep_scenes                box LCPs of known class for the sweep methods
hertz                       a sphere on a half-space, without a matrix
planted                     random QPs around a planted solution; changed data
infeasible_cases            QPs without a solution, and some that only look so
families                    the families of the work-precision chart
osqp_classes                the seven classes of the OSQP paper, by size
general                     friction, games, diodes, copositive matrices (its own room)
fuzzed                      the problems of the campaign (a room of its own)
sequences                   the same matrices again and again (a room of its own)
models                      what people model in CVXPY (a room of its own)
==========================  ============================================================
"""
