"""American puts: one tridiagonal LCP a time step, beside Brennan and Schwartz.

Usage::

    python validation/american_put.py [--quick] [--results DIR]

V_t + 1/2 sigma^2 V_xx + (r - q - 1/2 sigma^2) V_x - r V <= 0, V >= payoff, one of the
two with equality, x = ln S. Central differences on 4000 nodes (x - ln K from -WIDTH to
WIDTH, the strike midway between two nodes, where the payoff's kink costs least), 4000
steps of Crank and Nicolson, the first two of them as four implicit Euler steps of half
the length (Rannacher), which have the same matrix A = I + dt/2 L. The price at S by a
cubic spline.

timing
    Each step as a whole `solve_lcp(prepared, q, payoff, z0=last)`, its q included, and
    as a step of the method of Brennan and Schwartz (J. Finance 32 (1977) 449-462):
    elimination from the right, substitution from the left with the payoff as a floor,
    in numba, with the factors kept (`kept`, the faster one) or not. The two take turns
    in blocks of steps, and processor time is taken, so that other processes matter
    little; `ratio` is the median over blocks of the ratio of times, `total` the ratio
    of the sums.
convergence
    The price against nodes and steps, with the strike midway or on a node, with and
    without the Euler steps.
"""

import argparse
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit
from scipy.interpolate import CubicSpline

from benchmark import machine_lines, use_one_thread
from lcp import write_csv
from namlcp import Prepared, Status, solve_lcp

Row = dict[str, Any]
HERE = Path(__file__).parent
WIDTH = 1.5
EULER_STEPS = 4
BLOCK = 10
BOUND = 1e-5
SLOWER = 3.0


class Put(NamedTuple):
    """Spot, strike, rate, dividend yield, volatility, years and the known price."""

    spot: float
    strike: float
    rate: float
    dividend: float
    sigma: float
    years: float
    price: float


PUTS = {
    # Andersen, Lake and Offengenden, J. Computational Finance 20 (2016) 39-87
    "S = K = 100": Put(100.0, 100.0, 0.05, 0.05, 0.25, 1.0, 9.5694453),
    # known to five decimals
    "S = 36, K = 40": Put(36.0, 40.0, 0.06, 0.0, 0.2, 1.0, 4.48667),
}


class Grid(NamedTuple):
    """Nodes x, payoff, its value left of them; A = tridiag(below, diagonal, above)."""

    x: np.ndarray
    payoff: np.ndarray
    left: float
    below: float
    diagonal: float
    above: float


def grid_of(put: Put, nodes: int, steps: int, shift: float = 0.5) -> Grid:
    """Return the grid; the strike stands `shift` cells left of a node."""
    dx = 2.0 * WIDTH / (nodes + 1)
    x = np.log(put.strike) + (np.arange(nodes) - nodes // 2 + shift) * dx
    diffusion = 0.5 * put.sigma**2 / dx**2
    drift = (put.rate - put.dividend - 0.5 * put.sigma**2) / (2.0 * dx)
    half = 0.5 * put.years / steps
    return Grid(
        x,
        np.maximum(put.strike - np.exp(x), 0.0),
        put.strike - np.exp(x[0] - dx),
        half * (drift - diffusion),
        1.0 + half * (2.0 * diffusion + put.rate),
        -half * (diffusion + drift),
    )


@njit(cache=True, nogil=True)
def right_side(V, below, diagonal, above, left, euler, q):
    """Write q = -V (Euler) or -(2 I - A) V, with V = left beyond the first node."""
    n = V.size
    if euler:
        for i in range(n):
            q[i] = -V[i]
    else:
        before, here = left, V[0]
        for i in range(n - 1):
            after = V[i + 1]
            q[i] = below * before + (diagonal - 2.0) * here + above * after
            before, here = here, after
        q[n - 1] = below * before + (diagonal - 2.0) * here
    q[0] += below * left


@njit(cache=True, nogil=True)
def factorise(below, diagonal, above, factor):
    """Write 1 / pivot, above / pivot of the next row, below / pivot: from the right."""
    coupling = 0.0
    for i in range(factor.shape[1] - 1, -1, -1):
        inverse = 1.0 / (diagonal - above * coupling)
        factor[0, i] = inverse
        if i > 0:
            factor[1, i - 1] = above * inverse
        factor[2, i] = coupling = below * inverse


@njit(cache=True, nogil=True)
def brennan_schwartz(factor, payoff, q, V):
    """Write V to the solution of A V + q >= 0, V >= payoff; q is overwritten."""
    n = V.size
    last = -q[n - 1]
    q[n - 1] = last
    for i in range(n - 2, -1, -1):
        last = -q[i] - factor[1, i] * last
        q[i] = last
    last = 0.0
    for i in range(n):
        last = q[i] * factor[0, i] - factor[2, i] * last
        if last < payoff[i]:
            last = payoff[i]
        V[i] = last


@njit(cache=True, nogil=True)
def brennan_schwartz_anew(below, diagonal, above, payoff, coupling, q, V):
    """Do what `brennan_schwartz` does, with the elimination as it goes."""
    n = V.size
    last, c = 0.0, 0.0
    for i in range(n - 1, -1, -1):
        inverse = 1.0 / (diagonal - above * c)
        last = (-q[i] - above * last) * inverse
        c = below * inverse
        q[i], coupling[i] = last, c
    last = 0.0
    for i in range(n):
        last = q[i] - coupling[i] * last
        if last < payoff[i]:
            last = payoff[i]
        V[i] = last


class March:
    """A put on its way through time; `run(k)` takes the next k steps."""

    def __init__(self, grid: Grid, euler_steps: int = EULER_STEPS):
        self.grid = grid
        self.V = grid.payoff.copy()
        self.q = np.empty_like(self.V)
        self.done = 0
        self.euler_steps = euler_steps

    def run(self, steps: int) -> float:
        """Take steps and return their time."""
        _, _, left, *A = self.grid
        start = time.thread_time()
        for _ in range(steps):
            right_side(self.V, *A, left, self.done < self.euler_steps, self.q)
            self.solve()
            self.done += 1
        return time.thread_time() - start

    def solve(self) -> None:
        """Write the solution of the LCP with q to V."""
        raise NotImplementedError

    def price(self, spot: float) -> float:
        """Return the value at a spot price."""
        x = self.grid.x
        k = int(np.searchsorted(x, np.log(spot)))
        near = slice(k - 8, k + 8)
        return float(CubicSpline(x[near], self.V[near])(np.log(spot)))


class Kept(March):
    """Brennan and Schwartz with the factors kept."""

    def __init__(self, grid: Grid, euler_steps: int = EULER_STEPS):
        super().__init__(grid, euler_steps)
        self.factor = np.empty((3, grid.x.size))
        factorise(grid.below, grid.diagonal, grid.above, self.factor)

    def solve(self) -> None:
        """Take the step."""
        brennan_schwartz(self.factor, self.grid.payoff, self.q, self.V)


class Anew(March):
    """Brennan and Schwartz with a new elimination in every step."""

    def __init__(self, grid: Grid, euler_steps: int = EULER_STEPS):
        super().__init__(grid, euler_steps)
        self.coupling = np.empty_like(self.V)

    def solve(self) -> None:
        """Take the step."""
        A = self.grid.below, self.grid.diagonal, self.grid.above
        brennan_schwartz_anew(*A, self.grid.payoff, self.coupling, self.q, self.V)


class Package(March):
    """`solve_lcp`; `faces` counts the factorisations of every step."""

    def __init__(self, grid: Grid, euler_steps: int = EULER_STEPS):
        super().__init__(grid, euler_steps)
        n = grid.x.size
        A = sp.diags_array(
            [grid.below, grid.diagonal, grid.above], offsets=[-1, 0, 1], shape=(n, n)
        )
        self.A = Prepared(sp.csr_array(A))
        self.faces: list[int] = []
        self.worst = 0.0

    def solve(self) -> None:
        """Take the step."""
        result = solve_lcp(self.A, self.q, self.grid.payoff, z0=self.V)
        if result.status is not Status.SOLVED:
            raise RuntimeError(f"step {self.done}: {result.status.value}")
        self.V = result.z
        self.faces.append(result.iterations)
        self.worst = max(self.worst, result.residual)


def timing(name: str, nodes: int, steps: int) -> Row:
    """Return the price and the times of one put."""
    put = PUTS[name]
    grid = grid_of(put, nodes, steps)
    for kind in (Package, Kept, Anew):
        kind(grid).run(2)  # compiled
    ours, kept, anew = Package(grid), Kept(grid), Anew(grid)
    times = []
    left = steps + EULER_STEPS // 2
    while left > 0:
        block = min(BLOCK, left)
        times.append([march.run(block) for march in (ours, kept, anew)])
        left -= block
    seconds = np.array(times)
    per_step = np.median(seconds[:-1], axis=0) / BLOCK
    best = seconds[:, 1:].sum(axis=0).argmin() + 1
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
        "us_anew": per_step[2] * 1e6,
        "ratio": float(np.median(seconds[:-1, 0] / seconds[:-1, best])),
        "total": float(seconds[:, 0].sum() / seconds[:, best].sum()),
    }


def convergence(name: str, sizes: tuple[int, ...]) -> list[Row]:
    """Return the prices of one put against nodes = steps, strike and start."""
    put = PUTS[name]
    rows = []
    for size in sizes:
        for shift in (0.5, 0.0):
            for euler_steps in (EULER_STEPS, 0):
                march = Kept(grid_of(put, size, size, shift), euler_steps)
                march.run(size + euler_steps // 2)
                price = march.price(put.spot)
                rows.append(
                    {
                        "put": name,
                        "nodes": size,
                        "steps": size,
                        "strike": "midway" if shift else "on a node",
                        "euler_steps": euler_steps,
                        "price": price,
                        "error": price - put.price,
                    }
                )
    return rows


def main(arguments: list[str] | None = None) -> int:
    """Print the tables and write them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the size")
    parser.add_argument("--results", type=Path, help="folder for the CSV files")
    args = parser.parse_args(arguments)
    use_one_thread()
    header = machine_lines([])
    print("\n".join(header))
    size = 400 if args.quick else 4000
    rows = [timing(name, size, size) for name in PUTS]
    for row in rows:
        print(
            f"{row['put']:<16}price {row['price']:.7f} (error {row['error']:+.1e}, "
            f"wanted {BOUND:.0e}), {row['us_a_step']:.1f} us a step, Brennan-Schwartz "
            f"{row['us_kept']:.1f} (factors anew {row['us_anew']:.1f}), ratio "
            f"{row['ratio']:.2f} (wanted {SLOWER:g}), {row['faces_a_step']:.2f} faces"
        )
    sizes = (100, 200, 400) if args.quick else (500, 1000, 2000, 4000, 8000)
    prices = [row for name in PUTS for row in convergence(name, sizes)]
    print(f"\n{'put':<16}{'nodes':>6}  {'strike':<10}{'Euler':>6}{'error':>11}")
    for row in prices:
        print(
            f"{row['put']:<16}{row['nodes']:>6}  {row['strike']:<10}"
            f"{row['euler_steps']:>6}{row['error']:>11.1e}"
        )
    folder = args.results or (None if args.quick else HERE / "results")
    if folder is not None:
        write_csv(folder / "american-put.csv", header, rows)
        write_csv(folder / "american-put-convergence.csv", header, prices)
    return 0


if __name__ == "__main__":
    sys.exit(main())
