"""American puts: one tridiagonal LCP a time step, beside Brennan and Schwartz.

V_t + 1/2 sigma^2 V_xx + (r - q - 1/2 sigma^2) V_x - r V <= 0, V >= payoff, one of the
two with equality, x = ln S. Central differences on 4000 nodes (x - ln K from -WIDTH to
WIDTH, the strike midway between two nodes, where the payoff's kink costs least), 4000
steps of Crank and Nicolson, the first two of them as four implicit Euler steps of half
the length (Rannacher), which have the same matrix A = I + dt/2 L. The price at S by a
cubic spline.

Each step is timed as a whole `solve_lcp(prepared, q, payoff, z0=last)`, its q included,
and as a step of the method of Brennan and Schwartz (J. Finance 32 (1977) 449-462):
elimination from the right, substitution from the left with the payoff as a floor,
compiled, with the factors kept. The two take turns in blocks of steps, and processor
time is taken, so that other processes matter little; `ratio` is the median over blocks
of the ratio of times, `total` the ratio of the sums.
"""

from collections.abc import Iterator

import numpy as np

from validation.harness import Job, Row
from validation.harness.suite import Args, Suite
from validation.problems import american_puts

BLOCK = 10  # steps that one method takes before it is the other's turn


def timing(name: str, nodes: int, steps: int) -> Row:
    """Return the price and the times of one put."""
    put = american_puts.PUTS[name]
    grid = american_puts.grid_of(put, nodes, steps)
    kinds = american_puts.Package, american_puts.Kept
    for kind in kinds:
        kind(grid).run(2)  # compiled
    ours, kept = (kind(grid) for kind in kinds)
    times = []
    left = steps + american_puts.EULER_STEPS // 2
    while left > 0:
        block = min(BLOCK, left)
        times.append([march.run(block) for march in (ours, kept)])
        left -= block
    seconds = np.array(times)
    per_step = np.median(seconds[:-1], axis=0) / BLOCK
    price = ours.price(put.spot)
    return {
        "put": name,
        "nodes": nodes,
        "steps": steps,
        "price": price,
        "error": price - put.price,
        "from_brennan_schwartz": float(np.abs(ours.V - kept.V).max()),
        "worst_residual": ours.worst,
        "faces_a_step": float(np.mean(ours.faces)),
        "most_faces": max(ours.faces),
        "us_a_step": per_step[0] * 1e6,
        "us_kept": per_step[1] * 1e6,
        "ratio": float(np.median(seconds[:-1, 0] / seconds[:-1, 1])),
        "total": float(seconds[:, 0].sum() / seconds[:, 1].sum()),
    }


def timed(_: Job, name: str, size: int) -> Row:
    return timing(name, size, size)


def puts(args: Args) -> Iterator[Row]:
    for name in american_puts.PUTS:
        yield {"put": name, "nodes": 400 if args.quick else 4000}


SUITE = Suite(
    name="american-put",
    doc=__doc__,
    requests=puts,
    work=timed,
    columns=(
        "put nodes steps price error from_brennan_schwartz worst_residual faces_a_step "
        "most_faces us_a_step us_kept ratio total"
    ),
    keys="put nodes",
    shown="put:16 price error us_a_step us_kept ratio faces_a_step:12",
)
