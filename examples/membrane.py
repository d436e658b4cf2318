"""A membrane is pulled down over a ball, and touches it somewhere.

    z >= ball,  A z + q >= 0,  and in each point one of the two is an equation,

A the five-point matrix of minus the Laplacian on the square (-1, 1)^2, q the load.
"""

from types import SimpleNamespace
from typing import Any

import numpy as np
import scipy.sparse as sp

from namlcp import Status, solve_lcp

LOAD, RADIUS, TOP = 1.0, 0.6, 0.3


def run(points: int = 200) -> SimpleNamespace:
    """Solve on a grid of points x points, and print where contact is."""
    step = 2.0 / (points + 1)
    line = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(points, points))
    one = sp.eye_array(points)
    A = sp.csr_array(sp.kron(line, one) + sp.kron(one, line)) / step**2
    x = np.linspace(-1.0, 1.0, points + 2)[1:-1]
    squares = RADIUS**2 - x[:, None] ** 2 - x**2
    ball = np.where(squares > 0.0, np.sqrt(np.maximum(squares, 0.0)), -np.inf)
    ball += TOP - RADIUS  # its top is at height TOP
    result = solve_lcp(A, np.full(points**2, LOAD), lower=ball.ravel())
    heights, pressure = (v.reshape(points, points) for v in (result.z, result.w))
    print(
        f"{points**2} unknowns, {result.iterations} cycles of {result.method}, "
        f"{1e3 * (result.setup_time + result.solve_time):.0f} milliseconds\n"
        f"contact on {np.mean(heights <= ball):.1%} of the square, "
        f"force {pressure.sum() * step**2:.3f}"
    )
    solved = result.status is Status.SOLVED
    return SimpleNamespace(heights=heights, ball=ball, solved=solved)


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw the height with the free boundary, and a cut through the middle."""
    above, cut = figure.subplots(1, 2)
    box = (-1.0, 1.0, -1.0, 1.0)
    image = above.imshow(record.heights, extent=box, origin="lower")
    touches = (record.heights <= record.ball).astype(float)
    above.contour(touches, [0.5], colors="white", extent=box)
    above.set(xticks=[-1, 0, 1], yticks=[-1, 0, 1], title="height")
    figure.colorbar(image, ax=above, shrink=0.7)
    middle = len(record.heights) // 2
    x = np.linspace(-1.0, 1.0, len(record.heights) + 2)[1:-1]
    cut.fill_between(x, -0.3, record.ball[middle], color="0.8", label="ball")
    cut.plot(x, record.heights[middle], label="membrane")
    cut.set(xlabel="x", title="cut at y = 0", ylim=(-0.3, None))
    cut.legend()
