"""The table of QPs with what is known of them, and that of costs that are refused."""

import families_qp as made
import numpy as np
import scipy.sparse as sp
from families_qp import INFEASIBLE, UNBOUNDED, Case, box, some_free, with_kink
from problems_qp import (
    HOCK_SCHITTKOWSKI,
    infeasible,
    least_squares,
    make_qp,
    residual_form,
    singular_block,
    unbounded,
)
from ways_qp import PATHS, WAYS

INF = np.inf
I1, I2, I3, O2 = np.eye(1), np.eye(2), np.eye(3), np.zeros((2, 2))
ANGLE = np.linspace(0.0, np.pi / 2, 40)
PLANES = np.column_stack((np.cos(ANGLE), np.sin(ANGLE)))
SLOW = make_qp(
    np.diag([1, 1e-4, 1e-8, 0]), [-1, -1e-4, -1e-8, -1], np.ones((1, 4)), [10]
)
BEALE = [[0.25, -60.0, -0.04, 9.0], [0.5, -90.0, -0.02, 3.0], [0.0, 0.0, 1.0, 0.0]]
BOX = np.repeat([1.0, INF], [39, 1])
LASSO = residual_form(3, 12, 4, lower=0.0)[0]

CASES: dict[str, list[Case]] = {
    # W. Hock, K. Schittkowski, Test Examples for Nonlinear Programming Codes, 1981
    f"HS{number}": [Case(qp, obj=optimum - constant)]
    for number, (qp, constant, optimum) in HOCK_SCHITTKOWSKI.items()
} | {
    "Goldfarb and Idnani (1983), section 5": [
        Case(
            make_qp([[4, -2], [-2, 4]], [6, 0], [[-1, -1]], [-2], lb=[0, 0]),
            [0.5, 1.5],
            z=[5.0],
            z_box=[0.0, 0.0],
            near=1e-12,
        )
    ],
    "Clarabel's basic QP": [
        Case(
            make_qp(
                [[4, 1], [1, 2]], [1, 1], A=[[1, 1]], b=[1], lb=[0, 0], ub=[0.7, 0.7]
            ),
            [0.3, 0.7],
            obj=1.88,
        )
    ],
    "Vanderbei, Linear Programming, section 2.1": [
        Case(
            make_qp(
                np.zeros((3, 3)),
                [-5, -4, -3],
                [[2, 3, 1], [4, 1, 2], [3, 4, 2]],
                [5, 11, 8],
                lb=[0, 0, 0],
            ),
            [2, 0, 1],
            z=[1, 0, 1],
            z_box=[0, -3, 0],
            near=1e-12,
        )
    ],
    "Beale (1955), where the simplex method cycles": [
        Case(
            make_qp(
                np.zeros((4, 4)), [-0.75, 150, -0.02, 6], BEALE, [0, 0, 1], lb=[0] * 4
            ),
            [0.04, 0, 1, 0],
            obj=-0.05,
            near=1e-12,
        )
    ],
    "known answers": [
        made.known(seed, *sizes, density)
        for seed in range(3)
        for *sizes, density in (
            (5, 8, 2, 5, 1.0),
            (20, 30, 5, 20, 1.0),
            (20, 30, 5, 7, 1.0),
            (30, 60, 0, 0, 1.0),
            (60, 80, 10, 60, 0.1),
            (60, 80, 10, 20, 0.1),
            (40, 0, 10, 10, 0.3),
            (40, 0, 0, 40, 0.3),
        )
    ],
    "weakly active rows": [
        made.known(s, 20, 40, 0, 20, tol=1e-9, weak=5) for s in range(3)
    ],
    "degenerate": [
        Case(made.degenerate(s), tol=1e-10, form="dual" if s % 8 < 5 else "")
        for s in range(60)
    ],
    "singular": [made.singular(s) for s in range(80)],
    "zero but for a block": [Case(singular_block(0, 20).qp, tol=1e-11)],
    "all active sets": [made.by_enumeration(s) for s in range(15)],
    "definite where A x = 0": [made.definite_on_equations(s) for s in range(10)],
    "forty planes in a point": [
        Case(make_qp(I2, [-3, -3], PLANES, PLANES @ [1, 1]), [1, 1])
    ],
    "slow centres": [
        # x_i = 1 - z / P_ii where that is not pushed down: z = 1 by the last column
        Case(SLOW, z=[1.0], near=1e-11, ways=set(WAYS) - PATHS)
    ],
    "a controller": [
        made.fitted(5, 30, 8, lower=0.0),
        made.fitted(1, 40, 6, lower=-0.1, upper=0.1),
    ],
    "least squares": [
        made.fitted(0, 30, 8),
        made.fitted(0, 8, 30),
        made.fitted(7, 50, 5),
    ],
    "lasso": [made.fitted(2, 5, 40, weight=0.1)],
    "single rows and free columns": [
        *map(made.planted, range(5)),
        made.short_and_long_rows(),
    ],
    "large and full": [made.spread()],
    "bounds alone": [
        *(made.known(n, n, 0, 0, n // 2, 3.0 / n) for n in (60, 300)),
        *(Case(with_kink(off, **box(b))) for off in (0.5, 1.0) for b in (0.1, 10.0)),
        *(Case(with_kink(0.6, 0.6, **some_free(at))) for at in (0, 100, 197)),
        Case(made.blocks(0.5), ways={"sparse", "general"}),
        made.large_terms(),
    ],
    "a relative tolerance alone": [
        Case(make_qp(np.eye(n), c * np.ones(n)), settings={"eps_abs": 0.0})
        for n in (2, 60)
        for c in (0.0, 1.0)
    ],
    "a polynomial": [made.polynomial()],
    "residuals with bounds alone": [
        made.fitted(9, 300, 200, lower=0.0)._replace(
            ways={"sparse", "general", "qpsolvers"}
        )
    ],
    "a dense row": [Case(least_squares(3000), ways={"sparse", "path"})],
    "dense columns": [made.support_vectors()],
    "a weak tridiagonal LCP": [made.weak_tridiagonal()],
    "columns in other units": [made.columns_apart(s) for s in range(8)],
    "rows and columns in other units": [made.all_apart(s) for s in range(2)],
    "odd units": [made.odd_units(s, u) for s in range(10) for u in (1e-8, 1e8)],
    "a variable that counts in large units": [
        made.ray_in_units(u) for u in (1.0, 1e4, 1e-4)
    ],
    "no proof by a huge side": [made.beside_a_huge_side(h) for h in (1e10, 1e14, 1e18)],
    "infeasible": [
        Case(infeasible(s, 10, 20, 3, r), status=INFEASIBLE)
        for s in range(4)
        for r in (0, 2, 4, 10)
    ],
    "unbounded": [
        Case(unbounded(s, 10, 20, 3, r), status=UNBOUNDED)
        for s in range(3)
        for r in (0, 4, 8)
    ],
    "unbounded by other scales": [
        Case(qp._replace(q=c * qp.q, h=c * qp.h, b=c * qp.b), status=UNBOUNDED)
        for c in (1e-6, 1e6)
        for qp in (unbounded(s, 8, 5, 2, 3 * s) for s in range(2))
    ],
    "unbounded between bounds": [
        Case(unbounded(s, 50, 100, 10, 25, True), status=UNBOUNDED) for s in range(3)
    ]
    + [
        # bounds on both sides outnumber the rows and columns of the KKT matrix
        Case(
            make_qp(
                np.diag(1.0 - np.isinf(BOX)),
                -30.0 * np.cos(np.arange(40.0)),
                lb=-BOX,
                ub=BOX,
            ),
            status=UNBOUNDED,
        )
    ],
    "contradictions within the tolerance": [
        made.with_sums(s, *shape, off)
        for s in range(2)
        for shape in ((20, 30, 5, 7), (30, 60, 6, 0), (60, 80, 10, 20), (40, 0, 10, 10))
        for off in (1e-8, 1e-7)
    ],
    "contradictions beyond the tolerance": [
        made.with_sums(0, *shape, off)
        for shape in ((20, 30, 5, 7), (30, 60, 6, 0), (60, 80, 10, 20), (40, 0, 10, 10))
        for off in (1e-5, 1e-3)
    ],
    "proportional equations": [
        made.proportional(off, ratio) for off in (0.5e-6, 1e-4) for ratio in (1.0, -3.0)
    ],
}
CASES |= {
    name: [Case(qp, x, tol=1e-10)]
    for name, (qp, x) in {
        "no variables": (make_qp(np.zeros((0, 0)), []), []),
        "nothing but P": (make_qp(I2, [1, 2]), [-1, -2]),
        "equations only": (make_qp(I2, [1, 2], A=[[1, 1]], b=[1]), [1, 0]),
        "dependent equations": (
            make_qp(I3, [0, 0, 0], A=[[1, 1, 0], [2, 2, 0], [0, 0, 1]], b=[2, 4, 1]),
            [1, 1, 1],
        ),
        "singular, equations only": (
            make_qp(np.diag([1.0, 0.0]), [1, 0], A=[[1, 1]], b=[1]), [-1, 2],
        ),
        "LP": (make_qp(O2, [-1, -1], [[1, 2], [3, 1]], [4, 6], lb=[0, 0]), [1.6, 1.2]),
        "zero objective": (make_qp(O2, [0, 0], [[1, 1]], [-1]), None),
        "no cost at all": (make_qp(O2, [0, 0], A=[[1, 1]], b=[3]), None),
        "infinite and empty rows": (
            make_qp(I2, [-3, -1], [[1, 1], [0, 0], [1, 0]], [INF, 1, 1]), [1, 1],
        ),
        "an empty row": (
            make_qp(O2, [-1, -2], [[1, 1], [0, 0], [-1, 0], [0, -1]], [4, 1, 0, 0]),
            [0, 4],
        ),
        "repeated rows": (
            make_qp(I2, [-5, -5], [[1, 1], [2, 2], [1, 1], [-1, -1]], [3, 5, 4, 0]),
            [1.25, 1.25],
        ),
        "fixed": (
            make_qp(I2, [1, 2], [[1, 1]], [5], [[1, -1]], [-1], lb=[1, 2], ub=[1, 2]),
            [1, 2],
        ),
        "one fixed": (
            make_qp([[2, 1], [1, 2]], [1, 2], [[-1, -1]], [-5], lb=[1, -9], ub=[1, 9]),
            [1, 4],
        ),
        "pinned": (make_qp(I2, [1, 1], lb=[3, -9], ub=[3, 9]), [3, -1]),
        "a degenerate vertex": (
            make_qp(I2, [-2, -2], [[1, 0], [0, 1], [1, 1], [1, 2]], [1, 1, 2, 3]),
            [1, 1],
        ),
        "huge": (make_qp(1e8 * I2, [-1e8, -2e8], [[1e6, 1e6]], [1e6]), [0, 1]),
        "tiny": (make_qp(1e-8 * I2, [-1e-8, -2e-8], [[1e-6, 1e-6]], [1e-6]), None),
        "flat": (make_qp([[1e-9]], [-1.0]), None),
        "underflow": (make_qp([[4e-164, 1e-164], [1e-164, 2e-164]], [0, 0]), None),
        "stored zeros": (
            make_qp(I2, [-1, 0], sp.csr_array(([0.0, 1.0], [0, 1], [0, 2])), [3]),
            [1, 0],
        ),
        "an equation that bounds one variable": (
            make_qp(I2, [1, 1], A=[[2, 0], [1, 1]], b=[2, 3]), [1, 2],
        ),
    }.items()
}  # fmt: skip
CASES |= {
    name: [Case(qp, status=INFEASIBLE, says=says)]
    for name, (qp, says) in {
        "opposite rows": (make_qp(I2, [0, 0], [[1, 1], [-2, -2]], [1, -4]), ""),
        "three rows": (
            make_qp(I2, [0, 0], [[1, 1], [-1, 0], [0, -1]], [1, -1, -1]), "",
        ),
        "row against bounds": (make_qp(I2, [0, 0], [[1, 1]], [-1], lb=[0, 0]), ""),
        "repeated equations": (make_qp(O2, [1, 0], A=[[1, 1], [2, 2]], b=[1, 3]), ""),
        "dependent equations that contradict": (
            make_qp(I3, [0, 0, 0], A=[[1, 1, 0], [0, 1, 1], [1, 2, 1]], b=[1, 1, 3]),
            "",
        ),
        "empty row of A": (make_qp(I2, [0, 0], A=[[0, 0]], b=[-1]), ""),
        "empty row of G": (make_qp(I2, [0, 0], [[0, 0]], [-1]), ""),
        "all fixed": (make_qp(I2, [0, 0], [[1, 1]], [2], lb=[1, 2], ub=[1, 2]), ""),
        "margin 1e-3": (make_qp(I1, [0], [[1], [-1]], [0, -1e-3]), ""),
        "single rows": (
            make_qp(I2, [1, 1], [[1, 0], [-2, 0], [1, 1]], [1, -2.002, 5]), "",
        ),
        "equations of one variable": (
            make_qp(I2, [1, 1], A=[[2, 0], [4, 0]], b=[2, 5]), "",
        ),
        "equations that contradict across a singular P": (
            make_qp(np.diag([1.0, 0.0]), [1, 1], A=[[0, 1], [0, 2]], b=[1, 3]), "",
        ),
        "a row too low for residuals": (
            make_qp(
                LASSO.P, LASSO.q,
                sp.vstack((LASSO.G, sp.csc_array([[0.0] * 12 + [1.0] * 4]))),
                np.append(LASSO.h, -1.0), LASSO.A, LASSO.b,
            ),
            "",
        ),
        "bounds that cross": (
            make_qp(I2, [1, 1], lb=[0, 1], ub=[1, 0]), "x[1] .*lb = 1.0, ub = 0.0",
        ),
        "lb = inf": (make_qp(I2, [1, 1], lb=[0, INF]), "x[1] .*lb = inf"),
        "lb = ub = inf": (
            make_qp(O2, [0, -1], lb=[0, INF], ub=[INF, INF]), "x[1] .*lb = inf",
        ),
        "lb = ub = inf, zero cost": (
            make_qp(I2, [0, 0], lb=[0, INF], ub=[INF, INF]), "x[1] .*lb = inf",
        ),
        "ub = -inf": (make_qp(I2, [1, 1], ub=[-INF, 0]), "x[0] .*ub = -inf"),
        "h = -inf": (make_qp(I2, [1, 1], [[1, 1]], [-INF]), "row 0 of G has h = -inf"),
        "h = -inf beside its multiple": (
            make_qp(I2, [1, 1], [[1, 1], [1, 1], [-1, -1]], [1, -INF, INF]), "row 1",
        ),
    }.items()
}  # fmt: skip


def simplex(wrong):
    """P with eigenvalues -wrong and above, once its diagonal is scaled to 1."""
    P = (4.0 / 3.0 + wrong / 3.0) * np.eye(4) - (1.0 + wrong) * np.ones((4, 4)) / 3.0
    return make_qp(1e3 * P / P[0, 0], np.ones(4), lb=-np.ones(4), ub=np.ones(4))


REFUSED = {
    "negative": make_qp(-I2, [0, 0]),
    "a pair": make_qp([[1, 2], [2, 1]], [0, 0]),
    "no diagonal": make_qp([[0, 1], [1, 0]], [1, 1], lb=[0, 0], ub=[1, 1]),
    "a triple": make_qp([[1, 0.9, -0.9], [0.9, 1, 0.9], [-0.9, 0.9, 1]], [0, 0, 0]),
    "with rows": make_qp(np.diag([1, -1]), [1, 1], [[1, 1]], [1], lb=[0, 0]),
    "hidden by equations": make_qp(np.diag([1, -1]), [1, 1], A=[[0, 1]], b=[1]),
    "hidden by few": make_qp(np.diag([1, -1e-3]), [1, 1], A=[[0, 1]], b=[1]),
    "hidden by a square": make_qp(np.diag([-1, 2]), [1, 1], A=[[1, -1]], b=[0]),
    "by 1.4e-6": simplex(1.4e-6),
    "free": with_kink(1.00001, **box(10.0)),
    "coupled": with_kink(2.0, **box(0.1)),
    **{f"at {k}": with_kink(0.8, 0.8, **some_free(k)) for k in (0, 100, 197)},
    "fixed": made.blocks(2.0),
}
