"""What friction, games and diodes look like: forces in their cones, equilibria.

friction-scenes.svg
    A pile of discs, a wall of bricks and a pile of balls (seen from the side) after one
    time step: at each closed contact the impulse on the upper body, in its friction
    cone; and a block on a slope, its acceleration beside the known one.
games-and-diodes.svg
    All pairs of payoffs of bimatrix games, with the equilibrium that is found; and the
    voltages in a bridge of four diodes.

The games are those of the data folder with --data, else known and random ones.
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.collections import EllipseCollection, LineCollection, PolyCollection
from matplotlib.lines import Line2D

from namlcp import solve_lcp
from namlcp.scenes.friction import Scene, friction_lcp
from validation.harness import charts, cli
from validation.problems.general import circuits, games, piles

STICKS, SLIDES = charts.BLUE, charts.PURPLE
EDGE = 1e-6  # share of mu l that friction may lack where a contact counts as sliding
LONGEST = 1.1  # of a cone, in radii


def solved(scene: Scene) -> np.ndarray:
    """Return the impulses z of a scene."""
    return solve_lcp(*friction_lcp(scene)).z


def draw_forces(axes: Axes, scene: Scene, horizontal: int, vertical: int) -> str:
    """Draw the cones and the impulses of the closed contacts; return their counts.

    In the plane of two axes of space; the length goes with the root of the impulse.
    """
    normal, friction = scene.impulses(solved(scene))
    contacts, shown = scene.contacts, [horizontal, vertical]
    closed = normal > 1e-9 * normal.max()
    size = np.linalg.norm(friction, axis=1)
    slides = closed & (size >= (1.0 - EDGE) * contacts.mu * normal)
    length = LONGEST * np.sqrt(np.maximum(normal, 0.0) / normal.max())
    cones, lines, colours = [], [], []
    for c in np.flatnonzero(closed):
        point, n = contacts.point[c, shown], contacts.normal[c, shown]
        side = contacts.mu[c] * np.array([n[1], -n[0]])
        cones.append(point + length[c] * np.array([[0.0, 0.0], n + side, n - side]))
        force = n + friction[c, shown] / normal[c]
        lines.append([point, point + length[c] * force])
        colours.append(SLIDES if slides[c] else STICKS)
    axes.add_collection(PolyCollection(cones, color=colours, alpha=0.18, linewidth=0.0))
    axes.add_collection(LineCollection(lines, colors=colours, linewidths=1.3, zorder=3))
    axes.set_aspect("equal")
    axes.set(xticks=[], yticks=[])
    axes.grid(False)
    for side in ("left", "bottom"):
        axes.spines[side].set_visible(False)
    counts = np.sum(closed & ~slides), np.sum(slides), np.sum(~closed)
    return "{} stick, {} slide, {} open".format(*counts)


def draw_discs(axes: Axes, scene: Scene, shown: list[int], title: str) -> None:
    """Draw round bodies and what they do."""
    centre = scene.bodies.centre[:, shown]
    size = np.full(len(centre), 2.0)
    discs = EllipseCollection(
        size, size, 0.0 * size, units="xy", offsets=centre, edgecolor=charts.GREY,
        offset_transform=axes.transData, facecolor="none", linewidth=0.7,
    )  # fmt: skip
    axes.add_collection(discs)
    counts = draw_forces(axes, scene, *shown)
    low, high = centre.min(axis=0) - 1.2, centre.max(axis=0) + 1.4
    axes.plot((low[0], high[0]), (0.0, 0.0), color=charts.DARK, linewidth=1.0)
    axes.set(xlim=(low[0], high[0]), ylim=(-0.3, high[1]))
    axes.set_title(title)
    axes.set_xlabel(counts)


def draw_wall(axes: Axes, scene: Scene) -> None:
    """Draw bricks and what they do."""
    corner = np.array([[-1.0, -0.5], [1.0, -0.5], [1.0, 0.5], [-1.0, 0.5]])
    bricks = [centre[:2] + corner for centre in scene.bodies.centre]
    axes.add_collection(
        PolyCollection(bricks, facecolor="none", edgecolor=charts.GREY, linewidth=0.7)
    )
    counts = draw_forces(axes, scene, 0, 1)
    axes.autoscale_view()
    axes.set_title("wall of bricks, mu = 0.5")
    axes.set_xlabel(counts)


def draw_slope(axes: Axes) -> None:
    """Draw the acceleration of a block against the angle, for three mu."""
    degrees = np.linspace(0.0, 50.0, 26)
    fine = np.linspace(0.0, 50.0, 251)
    for mu, colour in zip(
        (0.2, 0.5, 0.8), (charts.GREEN, charts.BLUE, charts.PURPLE), strict=True
    ):
        known = [piles.acceleration(angle, mu) for angle in np.radians(fine)]
        axes.plot(fine, known, color=colour)
        found = []
        for angle in np.radians(degrees):
            scene = piles.block_on_slope(angle, mu)
            found.append(scene.velocity(solved(scene))[0, 0] / piles.STEP)
        axes.plot(degrees, found, "o", color=colour, markersize=3.5, fillstyle="none")
        charts.label(axes, f"mu = {mu}", (50.0, known[-1]), (4, 0), colour)
    axes.set(title="block on a slope", xlabel="angle [degrees]")
    axes.set_ylabel("acceleration / gravity")


def friction_scenes(file: Path) -> None:
    """Draw the scenes with friction."""
    figure, panels = plt.subplots(
        2, 2, figsize=(charts.WIDTH, 6.6), layout="constrained"
    )
    draw_discs(panels[0, 0], piles.pile_of_discs(6, 0.5), [0, 1], "discs, mu = 0.5")
    draw_wall(panels[0, 1], piles.wall_of_bricks(5, 0.5))
    balls = piles.pile_of_balls(4, 0.5, 8)
    draw_discs(panels[1, 0], balls, [0, 2], "balls in space, mu = 0.5, 8 directions")
    draw_slope(panels[1, 1])
    lines = [
        Line2D([], [], color=STICKS, label="sticks: the impulse is inside its cone"),
        Line2D([], [], color=SLIDES, label="slides: it is on the edge"),
        Line2D([], [], color=charts.DARK, marker="o", fillstyle="none", markersize=3.5,
               label="computed, on the known line"),
    ]  # fmt: skip
    figure.legend(handles=lines, loc="outside lower center", ncols=3)
    charts.save(figure, file)


def chosen_games(data: Path | None) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return payoffs by name."""
    if data is not None:
        return games.gambit(data)
    found = {
        name: (np.array(R), np.array(C)) for name, (R, C, _) in games.KNOWN.items()
    }
    for rows, columns, whole in ((4, 6, True), (8, 10, False), (60, 80, False)):
        name = f"{rows} x {columns}" + (", whole" if whole else "")
        found[name] = games.payoffs(rows, columns, 0, whole)
    return found


def draw_game(axes: Axes, name: str, R: np.ndarray, C: np.ndarray) -> None:
    """Draw all pairs of payoffs, and that of the equilibrium."""
    A, q = games.lcp(R, C)
    x, y = games.strategies(solve_lcp(A, q).z, len(R))
    axes.plot(R.ravel(), C.ravel(), "o", color=charts.GREY, markersize=2.0, zorder=1,
              alpha=0.6)  # fmt: skip
    axes.plot(x @ R @ y, x @ C @ y, "D", color=charts.PURPLE, markersize=5.0)
    axes.set_title(name, fontsize=7.5)
    axes.tick_params(labelsize=6.0)
    worst = games.regret(R, C, x, y) / max(np.ptp(R), np.ptp(C), 1.0)
    mixed = f"{np.count_nonzero(x > 1e-12)} + {np.count_nonzero(y > 1e-12)} strategies"
    axes.set_xlabel(mixed if worst < 1e-9 else "no equilibrium", fontsize=6.5)


def games_and_diodes(file: Path, chosen: dict) -> None:
    """Draw the games, and below them the diode bridge."""
    columns = min(7, len(chosen))
    lines = -(-len(chosen) // columns)
    figure = plt.figure(figsize=(charts.WIDTH, 1.5 * lines + 2.6), layout="constrained")
    upper, lower = figure.subfigures(2, 1, height_ratios=(1.5 * lines, 2.6))
    panels = upper.subplots(lines, columns, squeeze=False)
    for axes, (name, (R, C)) in zip(panels.flat, chosen.items(), strict=False):
        draw_game(axes, name, R, C)
    for axes in panels.flat[len(chosen) :]:
        axes.set_axis_off()
    upper.supylabel("payoff of the second player", fontsize=8.0)
    upper.suptitle("payoffs (grey) and the equilibrium found; across: first player",
                   fontsize=9.0)  # fmt: skip
    draw_bridge(lower.subplots())
    charts.save(figure, file)


def draw_bridge(axes: Axes) -> None:
    """Draw the voltages of the oscillator and of the resistor."""
    steps = 3000
    states, diodes = circuits.march(steps, lambda A, q: solve_lcp(A, q).z)
    time = 1e3 * circuits.STEP * np.arange(1, steps + 1)
    axes.plot(time, states[1:, 0], color=charts.GREY, label="capacitor")
    resistor = diodes[:, 0] + diodes[:, 1]
    axes.plot(time, resistor, color=charts.BLUE, label="resistor, behind the diodes")
    axes.set(xlabel="time [ms]", ylabel="voltage [V]", title="bridge of four diodes")
    axes.legend(loc="upper right", ncols=2)


def main(arguments: list[str] | None = None) -> int:
    """Draw all pictures."""
    parser = cli.parser(__doc__, "data", "figures")
    args = parser.parse_args(arguments)
    friction_scenes(args.figures / "friction-scenes.svg")
    games_and_diodes(args.figures / "games-and-diodes.svg", chosen_games(args.data))
    return 0


if __name__ == "__main__":
    sys.exit(cli.needs_data(main)())
