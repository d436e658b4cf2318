"""Maps from a QP to an easier one: substitution, presolve, scaling.

`Substitution`, `Presolved` and `ScaledQP` have methods of the same names: `point` maps
back to the problem before the transform, `guess` forward; see `namlcp.qp.route.Chain`.
"""
