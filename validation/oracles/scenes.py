"""The scenes on which solvers are compared, with what is known of each.

`SCENES` has every box LCP by name. Known values come from the docstrings of
`known_scenes`, which give their sources; a value printed with k decimals is known to
half a unit of the last. Where none is known two independent solvers have to agree.
Scenes from files return None without the data folder.
"""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp

from namlcp.scenes import disc_pile
from validation.harness import MissingDataError
from validation.problems import (
    contact_scenes,
    data_sets,
    hertz,
    known_scenes,
    large_scenes,
    sweep_scenes,
)

QUICK_FAMILIES = ("3-D", "mesh, jumps", "biactive", "transport")
Make = Callable[[Path | None], known_scenes.BoxLCP | None]


class Known(NamedTuple):
    """A quantity, how it follows from (scene, z), its value, and how well it is known.

    `absolute` is half a unit of the last digit, or what the source states.
    """

    quantity: str
    of: Callable[[known_scenes.BoxLCP, np.ndarray], float]
    value: float
    absolute: float
    source: str


class Scene(NamedTuple):
    """A scene: how to make it and what is known of it.

    `unique`: z is; w = A z + q is unique for every symmetric semidefinite A. Scenes
    that are not `quick` take more than a few seconds with some solver.
    """

    make: Make
    known: tuple[Known, ...] = ()
    unique: bool = True
    quick: bool = True


def objective(scene: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return 1/2 z'Az + q'z."""
    return float(0.5 * z @ (scene.A @ z) + scene.q @ z)


def sides(scene: known_scenes.BoxLCP, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell who is at the lower and who at the upper bound: nearer to it than w is to 0.

    Interior methods stay a little off.
    """
    w = scene.A @ z + scene.q
    return z - scene.lower <= w, scene.upper - z <= -w


def at_bounds(scene: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return the number of unknowns at a bound."""
    low, high = sides(scene, z)
    return float(np.sum(low | high))


def above_lower(scene: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return the number of unknowns that are not at the lower bound."""
    return float(np.sum(~sides(scene, z)[0]))


def at_upper(scene: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return the number of unknowns at the upper bound."""
    return float(np.sum(sides(scene, z)[1]))


def ball_error(_: known_scenes.BoxLCP, z: np.ndarray, m: int, worst: bool) -> float:
    """Return the largest or the average error against the exact membrane."""
    inner = known_scenes.ball_solution(m)[1:-1, 1:-1].ravel()
    error = np.abs(z - inner)
    return float(error.max() if worst else error.sum() / m**2)


def dam_error(_: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return the largest difference from the three printed rows of the dam."""
    printed = [
        [2.53716015237691, 0.0, 0.0],
        [18.148640609503, 6.78414305345868, 0.0],
        [47.2732592321996, 24.9879316043211, 7.91201621181146],
    ]
    rows = z.reshape(3, 5)[:, ::-1].T[:3]
    return float(np.abs(rows - printed).max())


def control_cost(_: known_scenes.BoxLCP, z: np.ndarray) -> float:
    """Return the sum of x'Qx over x_0 to x_N and of u'Ru, by simulation."""
    x, total = np.array([10.0, 0.0]), 0.0
    for u in z:
        total += float(x @ ([1.0, 0.1] * x) + 0.01 * u * u)
        x = np.array([[1.0, 0.1], [0.0, 1.0]]) @ x + np.array([0.005, 0.1]) * u
    return total + float(x @ ([1.0, 0.1] * x))


def value(number: float, decimals: int, source: str = "scenes.md") -> Known:
    return Known("objective", objective, number, 0.5 * 10.0**-decimals, source)


def ball(m: int, average: float, worst: float, *, quick: bool = True) -> Scene:
    """Return the ball obstacle with its errors, known to four digits."""
    errors = (("average error", False, average), ("largest error", True, worst))
    found = tuple(
        Known(name, partial(ball_error, m=m, worst=k), error, 4e-4 * error, "Bueler")
        for name, k, error in errors
    )
    return Scene(lambda _: known_scenes.ball_obstacle(m), found, quick=quick)


def from_data(
    make: Callable[[Path], known_scenes.BoxLCP], data: Path | None
) -> known_scenes.BoxLCP | None:
    try:
        return None if data is None else make(data)
    except MissingDataError:
        return None


def heart(data: Path, linear: bool) -> known_scenes.BoxLCP:
    X, y = data_sets.heart_scale(data)
    if linear:
        return known_scenes.svm_l2(X, y)
    return known_scenes.svm_rbf(X, y, 1.0 / X.shape[1])


def contact(data: Path, name: str) -> known_scenes.BoxLCP:
    A, q = data_sets.contact_lcp(data, name)
    return known_scenes.nonnegative(sp.csr_array(A), q)


def of_matrix(make: Callable[[], tuple]) -> Make:
    """Return a maker from one that returns A and q first."""

    def call(_: Path | None) -> known_scenes.BoxLCP:
        A, q = make()[:2]
        return known_scenes.nonnegative(A, q)

    return call


def contact_known(data: Path | None) -> dict[str, tuple[Known, ...]]:
    """Return the reference objectives of the contact scenes in the data folder."""
    file = None if data is None else data / "contact" / "index.json"
    if file is None or not file.exists():
        return {}
    found = {}
    for entry in json.loads(file.read_text()):
        number = entry.get("frictionless_obj") or entry.get("obj")
        known_to = 1e-9 * (abs(number) + 1e-300)
        found[entry["name"]] = (
            Known("objective", objective, number, known_to, "index.json"),
        )
    return found


def scenes(data: Path | None) -> dict[str, Scene]:
    found = dict(SCENES)
    for name, numbers in contact_known(data).items():
        make = partial(from_data, partial(contact, name=name))
        found[f"contact {name}"] = Scene(make, numbers, unique=False)
    for scene in sweep_scenes.problem_classes():
        lcp = known_scenes.BoxLCP(*scene[1:5])
        unique = "contact" not in scene.name
        found[f"class: {scene.name}"] = Scene(lambda _, lcp=lcp: lcp, (), unique)
    return found


SCENES: dict[str, Scene] = {
    "torsion 50 x 50": Scene(
        lambda _: known_scenes.torsion(50, 50),
        (
            value(-0.4180876320, 10),
            Known("in contact", at_bounds, 752.0, 0.0, "scenes.md"),
        ),
    ),
    "torsion 50 x 100": Scene(
        lambda _: known_scenes.torsion(50, 100),
        (value(-0.4182392134, 10),),
        quick=False,
    ),
    "journal bearing 8 x 12, e = 0.1": Scene(
        lambda _: known_scenes.journal_bearing(8, 12, 0.1), (value(-0.1834372196, 10),)
    ),
    "journal bearing 50 x 50, e = 0.99": Scene(
        lambda _: known_scenes.journal_bearing(50, 50, 0.99),
        (value(-60.1509273215, 10),),
    ),
    "journal bearing 50 x 50, e = 0.1": Scene(
        lambda _: known_scenes.journal_bearing(50, 50, 0.1), (value(-0.1804879950, 10),)
    ),
    "ball 17 x 17": ball(17, 2.707e-3, 1.428e-2),
    "ball 33 x 33": ball(33, 8.182e-4, 5.747e-3),
    "ball 129 x 129": ball(129, 3.334e-5, 2.154e-4, quick=False),
    "forced obstacle 50 x 50": Scene(lambda _: known_scenes.obstacle(50)),
    "forced obstacle 100 x 100": Scene(
        lambda _: known_scenes.obstacle(100), quick=False
    ),
    "dam 5 x 7": Scene(
        lambda _: known_scenes.dam(),
        (Known("largest difference", dam_error, 0.0, 1.5e-11, "scenes.md"),),
    ),
    "dam 33 x 49": Scene(lambda _: known_scenes.dam(8)),
    "American put, one step": Scene(lambda _: known_scenes.american_put(199, 200)),
    "Hertz contact 20 x 20": Scene(of_matrix(lambda: hertz.half_space(20))),
    "heap, 200 contacts": Scene(of_matrix(lambda: contact_scenes.heap(200))),
    "full heap, 200 contacts": Scene(
        of_matrix(lambda: contact_scenes.heap(200, sideways=True)), unique=False
    ),
    "brick wall, 200 contacts": Scene(
        of_matrix(lambda: contact_scenes.brick_wall(200)), unique=False
    ),
    "wedge, 16 rows": Scene(of_matrix(lambda: disc_pile(16)), unique=False),
    "full heap, 2000 contacts": Scene(
        of_matrix(lambda: contact_scenes.heap(2000, sideways=True)),
        unique=False,
        quick=False,
    ),
    "SVM heart, RBF": Scene(
        partial(from_data, partial(heart, linear=False)),
        (
            value(-101.1335996299, 10),
            Known("support vectors", above_lower, 129.0, 0.0, "scenes.md"),
            Known("at the bound", at_upper, 107.0, 0.0, "scenes.md"),
        ),
    ),
    "SVM heart, linear, L2": Scene(
        partial(from_data, partial(heart, linear=True)), (value(-121.13472444, 8),)
    ),
    "input-bounded MPC": Scene(
        lambda _: known_scenes.input_bounded_mpc(),
        (
            Known("cost", control_cost, 2490.05936849, 5e-9, "scenes.md"),
            Known("at a bound", at_bounds, 69.0, 0.0, "scenes.md"),
        ),
    ),
    "NNLS 400 x 100": Scene(
        lambda _: known_scenes.nonnegative_least_squares(400, 100)[0]
    ),
    "portfolio 200": Scene(lambda _: known_scenes.portfolio(200)),
    **{
        f"family: {name}": Scene(
            lambda _, make=make: make(900), quick=name in QUICK_FAMILIES
        )
        for name, make in large_scenes.FAMILIES.items()
    },
}
"""Every scene that needs no data, and the two of heart_scale."""
