"""Discs that fall into a box and come to rest: an LCP with Coulomb friction a step."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from examples.falling import FallingDiscs
from namlcp import Status

SHOWN = 4  # pictures of the discs, at as many steps


def run(count: int = 24, steps: int = 300) -> SimpleNamespace:
    """Let the discs fall, and print what is left of their energy."""
    discs = FallingDiscs(count)
    shown = np.linspace(0, steps - 1, SHOWN).astype(int)
    centres, records = [], []
    for k in range(steps):
        if k in shown:
            centres.append(discs.centre[:, :2].copy())
        records.append(discs.step())
    energies = np.array([record.energy for record in records])
    seconds = np.array([record.seconds for record in records])
    solved = all(record.status is Status.SOLVED for record in records)
    print(
        f"{count} discs, {steps} steps, up to {max(r.n for r in records)} unknowns\n"
        f"energy {energies[0]:.3g} J at first, {energies[-1]:.3g} J at the end; "
        f"largest overlap {max(r.overlap for r in records):.1e} m\n"
        f"{1e3 * np.median(seconds):.2f} milliseconds an LCP (median)"
    )
    return SimpleNamespace(
        discs=discs, centres=np.array(centres), shown=shown, energies=energies,
        seconds=seconds, solved=solved,
    )  # fmt: skip


def draw(record: SimpleNamespace, figure: Any) -> None:
    """Draw the discs at some steps, and the energy."""
    from matplotlib.collections import EllipseCollection

    grid = figure.add_gridspec(2, SHOWN, height_ratios=[2, 1])
    radius = record.discs.radius
    top = record.centres[..., 1].max() + radius.max()
    for k, centre in enumerate(record.centres):
        axes = figure.add_subplot(grid[0, k])
        drawn = EllipseCollection(
            2.0 * radius, 2.0 * radius, 0.0 * radius, units="xy", offsets=centre,
            offset_transform=axes.transData, facecolor="C0", edgecolor="white",
        )  # fmt: skip
        axes.add_collection(drawn)
        axes.set(xlim=(0.0, record.discs.width), ylim=(0.0, top), aspect="equal")
        axes.set(xticks=[], yticks=[], title=f"step {record.shown[k]}")
    axes = figure.add_subplot(grid[1, :])
    axes.plot(record.energies)
    axes.set(xlabel="step", ylabel="energy [J]", ylim=(0.0, None))
