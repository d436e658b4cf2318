"""What solutions look like: contact sets, an exercise boundary, forces between bodies.

contact-sets.png
    A membrane on the floor and on a ball, and the plastic zone of a bar under torsion:
    z in shades with level lines, and where a bound holds.
exercise-boundary.svg
    The spot price below which an American put is exercised, against the time left, and
    its value beside the payoff.
contact-forces.svg
    The impulses in a heap of discs, as lines between the centres as wide as they are
    large, and in a stack of boxes of growing mass, beside the weights above.

--quick: coarse grids.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.patches import Patch

from namlcp import solve_lcp
from validation.harness import charts, cli
from validation.problems import american_puts, contact_scenes, known_scenes

TOUCHING = 1e-7  # V - payoff up to which a put is exercised, in units of the strike


def contact_sets(file: Path, m: int) -> None:
    """Solve three problems on m x m nodes; draw where a bound holds."""
    figure, panels = plt.subplots(
        1, 3, figsize=(charts.WIDTH, 3.5), layout="constrained"
    )
    scenes = {
        "forced obstacle: membrane on the floor": known_scenes.obstacle(m),
        "ball obstacle: membrane on the ball": known_scenes.ball_obstacle(m + 2),
        "torsion, c = 5: plastic zone": known_scenes.torsion(m, m),
    }
    for axes, (title, problem) in zip(panels, scenes.items(), strict=True):
        sides = (-2.0, 2.0) if "ball" in title else (0.0, 1.0)
        draw_contact(axes, problem, m, sides)
        axes.set_title(title)
    figure.legend(
        handles=[Patch(color=charts.PURPLE, label="at a bound")],
        loc="outside lower center",
    )
    charts.save(figure, file)


def draw_contact(
    axes: Axes, lcp: known_scenes.BoxLCP, m: int, sides: tuple[float, float]
) -> None:
    """Draw z in shades with level lines, and over it where a bound holds."""
    z = solve_lcp(*lcp).z
    active = ((z <= lcp.lower) | (z >= lcp.upper)).reshape(m, m).T
    z = z.reshape(m, m).T
    shades = LinearSegmentedColormap.from_list("shades", ["white", charts.BLUE])
    place = {"origin": "lower", "extent": (*sides, *sides)}
    axes.imshow(z, cmap=shades, **place)
    axes.contour(z, 9, colors="white", linewidths=0.6, **place)
    shown = np.ma.masked_where(~active, active)
    axes.imshow(
        shown, cmap=ListedColormap([charts.PURPLE]), interpolation="nearest", **place
    )
    share = f"{int(np.sum(active)):,} of {m * m:,} nodes".replace(",", " ")
    axes.set_xlabel(share)
    axes.set(xticks=sides, yticks=sides)
    axes.grid(False)


def boundary_of(
    name: str, size: int
) -> tuple[np.ndarray, np.ndarray, american_puts.Package]:
    """March a put on a grid of size^2; return times left, boundary prices, the march.

    The boundary is the largest node below the strike at which V is the payoff.
    """
    put = american_puts.PUTS[name]
    march = american_puts.Package(american_puts.grid_of(put, size, size))
    S = np.exp(march.grid.x)
    times, prices = [], []
    for step in range(size):
        march.run(1)
        held = march.V - march.grid.payoff <= TOUCHING * put.strike
        exercised = np.flatnonzero(held & (put.strike > S))
        if exercised.size:
            times.append((step + 1) / size * put.years)
            prices.append(S[exercised[-1]])
    return np.array(times), np.array(prices), march


def exercise_boundary(file: Path, size: int) -> None:
    """Draw boundary and value of both puts."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 3.4), layout="constrained"
    )
    for (name, put), colour in zip(
        american_puts.PUTS.items(), (charts.BLUE, charts.PURPLE), strict=True
    ):
        times, prices, march = boundary_of(name, size)
        left.plot(times, prices / put.strike, color=colour, label=name)
        S = np.exp(march.grid.x)
        near = (S > 0.6 * put.strike) & (S < 1.5 * put.strike)
        spot = S[near] / put.strike
        right.plot(spot, march.V[near] / put.strike, color=colour, label=name)
        right.plot(prices[-1] / put.strike, 1.0 - prices[-1] / put.strike, "o",
                   color=colour)  # fmt: skip
    right.plot(
        spot, np.maximum(1.0 - spot, 0.0), ":", color=charts.DARK, label="payoff"
    )
    left.set(title="exercise below the line", xlabel="time left [years]")
    left.set_ylabel("S / K")
    right.set(title="value one year before the end", xlabel="S / K", ylabel="V / K")
    left.legend()
    right.legend()
    charts.save(figure, file)


def contact_forces(file: Path, contacts: int) -> None:
    """Draw the impulses in a heap of discs and in a stack of boxes."""
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(charts.WIDTH, 4.2), layout="constrained", width_ratios=(1.6, 1.0)
    )
    draw_heap(left, contacts)
    draw_stack(right, 12)
    charts.save(figure, file)


def draw_heap(axes: Axes, contacts: int) -> None:
    """Draw discs, shaded by mass, and the impulses between them."""
    bodies = contact_scenes.heap_of_discs(contacts, False, 100.0, 0)
    problem = contact_scenes.scene(*bodies[:4])
    z = solve_lcp(problem.A, problem.q).z
    N = bodies.N.tocsc()
    present = np.unique(N.indices // 2)
    size = np.full(present.size, 2.0)
    discs = EllipseCollection(
        size, size, np.zeros_like(size), units="xy", offsets=bodies.centre[present],
        offset_transform=axes.transData, cmap="Greys", edgecolor=charts.DARK,
        linewidth=0.4, array=np.log10(bodies.mass[::2][present]), clim=(-0.5, 4.0),
    )  # fmt: skip
    axes.add_collection(discs)
    lines = []
    for c in range(N.shape[1]):
        column = slice(N.indptr[c], N.indptr[c + 1])
        touched = np.unique(N.indices[column] // 2)
        ends = bodies.centre[touched]
        if touched.size == 1:  # a wall or the floor: to where it touches
            push = np.zeros(2)
            push[N.indices[column] % 2] = N.data[column]
            ends = np.vstack((ends, ends - push))
        lines.append(ends)
    widths = 5.0 * np.sqrt(z / z.max())
    forces = LineCollection(lines, linewidths=widths, colors=charts.PURPLE, zorder=3)
    axes.add_collection(forces)
    axes.set_aspect("equal")
    low, high = bodies.centre.min(axis=0) - 1.5, bodies.centre.max(axis=0) + 1.5
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.set(xticks=[], yticks=[])
    axes.grid(False)
    loose = int(np.sum(z == 0.0))
    axes.set_title(f"heap: {z.size} contacts, {loose} of them open")
    axes.set_xlabel("width: square root of the impulse; shade: mass, 1 to 100")


def draw_stack(axes: Axes, boxes: int) -> None:
    """Draw a stack, the impulse at each corner, and the weight it must carry."""
    problem = contact_scenes.stack(boxes)
    z = solve_lcp(problem.A, problem.q).z
    mass = np.geomspace(1.0, 1e4, boxes)
    weight = 0.5 * contact_scenes.STEP * mass[::-1].cumsum()[::-1]
    level = np.arange(boxes)
    axes.plot(weight, level, "o", color=charts.DARK, fillstyle="none", markersize=8.0,
              label="half the weight above")  # fmt: skip
    axes.plot(
        z[::2], level, "<", color=charts.PURPLE, markersize=4.0, label="left corner"
    )
    axes.plot(
        z[1::2], level, ">", color=charts.BLUE, markersize=4.0, label="right corner"
    )
    axes.set(xlabel="impulse [mass x velocity]", ylabel="under box", yticks=level[::2])
    axes.set_xlim(0.0, 1.15 * weight[0])
    axes.set_title("stack: masses 1 to 10 000 upwards")
    axes.legend(loc="center left")


def main(arguments: list[str] | None = None) -> int:
    """Draw all pictures."""
    parser = cli.parser(__doc__, "quick", "figures")
    args = parser.parse_args(arguments)
    contact_sets(args.figures / "contact-sets.png", 127 if args.quick else 511)
    exercise_boundary(
        args.figures / "exercise-boundary.svg", 200 if args.quick else 1000
    )
    contact_forces(args.figures / "contact-forces.svg", 150)
    return 0


if __name__ == "__main__":
    sys.exit(main())
