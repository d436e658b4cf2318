"""The scenes on which solvers are compared, with what is known of each.

Known values come from the docstrings of `known_scenes`, which give their sources; a
value printed with k decimals is known to half a unit of the last. Where none is known
two independent solvers have to agree.
"""

import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from validation.problems import contact_scenes, data_sets, hertz, sweep_scenes
from validation.problems import known_scenes as known
from validation.problems.known_scenes import BoxLCP


class Known(NamedTuple):
    """A quantity, how it follows from (scene, z), its value, and how well it is known.

    `absolute` is half a unit of the last digit, or what the source states.
    """

    quantity: str
    of: Callable[[BoxLCP, np.ndarray], float]
    value: float
    absolute: float = 0.0
    source: str = "scenes.md"


class Scene(NamedTuple):
    """`unique`: z is; w is unique for every symmetric semidefinite A."""

    make: Callable[[], BoxLCP]
    known: tuple[Known, ...] = ()
    unique: bool = True


def objective(scene: BoxLCP, z: np.ndarray) -> float:
    return float(0.5 * z @ (scene.A @ z) + scene.q @ z)


def sides(scene: BoxLCP, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Tell who is at a bound, lower and upper: nearer to it than w is to 0."""
    w = scene.A @ z + scene.q
    return z - scene.lower <= w, scene.upper - z <= -w


def at_bounds(scene: BoxLCP, z: np.ndarray) -> float:
    return float(np.sum(np.logical_or(*sides(scene, z))))


def ball_error(_: BoxLCP, z: np.ndarray, m: int, worst: bool) -> float:
    error = np.abs(z - known.ball_solution(m)[1:-1, 1:-1].ravel())
    return float(error.max() if worst else error.sum() / m**2)


def dam_error(_: BoxLCP, z: np.ndarray) -> float:
    """Return the largest difference from the three printed rows of the dam."""
    printed = [
        [2.53716015237691, 0.0, 0.0],
        [18.148640609503, 6.78414305345868, 0.0],
        [47.2732592321996, 24.9879316043211, 7.91201621181146],
    ]
    return float(np.abs(z.reshape(3, 5)[:, ::-1].T[:3] - printed).max())


def control_cost(_: BoxLCP, z: np.ndarray) -> float:
    """Return the sum of x'Qx over x_0 to x_N and of u'Ru, by simulation."""
    x, total = np.array([10.0, 0.0]), 0.0
    for u in z:
        total += float(x @ ([1.0, 0.1] * x) + 0.01 * u * u)
        x = np.array([[1.0, 0.1], [0.0, 1.0]]) @ x + np.array([0.005, 0.1]) * u
    return total + float(x @ ([1.0, 0.1] * x))


def value(number: float, decimals: int) -> Known:
    return Known("objective", objective, number, 0.5 * 10.0**-decimals)


def ball(m: int, average: float, worst: float) -> Scene:
    """Return the ball obstacle with its errors, known to four digits."""
    errors = (("average error", False, average), ("largest error", True, worst))
    found = tuple(
        Known(name, partial(ball_error, m=m, worst=k), error, 4e-4 * error, "Bueler")
        for name, k, error in errors
    )
    return Scene(partial(known.ball_obstacle, m), found)


def of_data(data: Path) -> Iterator[tuple[str, Scene]]:
    if (data / "svm" / "heart_scale").exists():
        X, y = data_sets.heart_scale(data)
        counts = (
            Known("support vectors", lambda s, z: float(np.sum(~sides(s, z)[0])), 129),
            Known("at the bound", lambda s, z: float(np.sum(sides(s, z)[1])), 107),
        )
        rbf = partial(known.svm_rbf, X, y, 1.0 / 13.0)
        yield "SVM heart, RBF", Scene(rbf, (value(-101.1335996299, 10), *counts))
        linear = partial(known.svm_l2, X, y)
        yield "SVM heart, linear, L2", Scene(linear, (value(-121.13472444, 8),))
    file = data / "contact" / "index.json"
    for entry in json.loads(file.read_text()) if file.exists() else ():
        number = entry.get("frictionless_obj") or entry.get("obj")
        known_to = 1e-9 * (abs(number) + 1e-300)
        stored = Known("objective", objective, number, known_to, "index.json")
        make = partial(sweep_scenes.contact, data, entry["name"])
        yield f"contact {entry['name']}", Scene(make, (stored,), unique=False)


def scenes(data: Path | None) -> dict[str, Scene]:
    found = SCENES | (dict(of_data(data)) if data is not None else {})
    for name, scene in sweep_scenes.problem_classes().items():
        unique = "contact" not in name
        found[f"class: {name}"] = Scene(partial(BoxLCP, *scene), unique=unique)
    return found


SCENES: dict[str, Scene] = {
    "torsion 50 x 50": Scene(
        lambda: known.torsion(50, 50),
        (value(-0.4180876320, 10), Known("in contact", at_bounds, 752)),
    ),
    "torsion 50 x 100": Scene(
        lambda: known.torsion(50, 100), (value(-0.4182392134, 10),)
    ),
    "journal bearing 8 x 12, e = 0.1": Scene(
        lambda: known.journal_bearing(8, 12, 0.1), (value(-0.1834372196, 10),)
    ),
    "journal bearing 50 x 50, e = 0.99": Scene(
        lambda: known.journal_bearing(50, 50, 0.99), (value(-60.1509273215, 10),)
    ),
    "journal bearing 50 x 50, e = 0.1": Scene(
        lambda: known.journal_bearing(50, 50, 0.1), (value(-0.1804879950, 10),)
    ),
    "ball 17 x 17": ball(17, 2.707e-3, 1.428e-2),
    "ball 33 x 33": ball(33, 8.182e-4, 5.747e-3),
    "ball 129 x 129": ball(129, 3.334e-5, 2.154e-4),
    "forced obstacle 50 x 50": Scene(lambda: known.obstacle(50)),
    "forced obstacle 100 x 100": Scene(lambda: known.obstacle(100)),
    "dam 5 x 7": Scene(
        known.dam, (Known("largest difference", dam_error, 0.0, 1.5e-11),)
    ),
    "dam 33 x 49": Scene(lambda: known.dam(8)),
    "American put, one step": Scene(lambda: known.american_put(199, 200)),
    "Hertz contact 20 x 20": Scene(lambda: known.nonnegative(*hertz.half_space(20))),
    "heap, 200 contacts": Scene(lambda: contact_scenes.heap(200)),
    "full heap, 200 contacts": Scene(
        lambda: contact_scenes.heap(200, sideways=True), unique=False
    ),
    "brick wall, 200 contacts": Scene(
        lambda: contact_scenes.brick_wall(200), unique=False
    ),
    "wedge, 16 rows": Scene(
        lambda: known.nonnegative(*contact_scenes.disc_pile(16)), unique=False
    ),
    "full heap, 2000 contacts": Scene(
        lambda: contact_scenes.heap(2000, sideways=True), unique=False
    ),
    "input-bounded MPC": Scene(
        known.input_bounded_mpc,
        (
            Known("cost", control_cost, 2490.05936849, 5e-9),
            Known("at a bound", at_bounds, 69),
        ),
    ),
    **{
        f"family: {name}": Scene(partial(make, 900))
        for name, make in known.FAMILIES.items()
    },
}
