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
of the ratio of times.
"""

import time
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.sparse as sp
from numba import njit  # compiles the peer, a loop from node to node
from scipy.interpolate import CubicSpline

from namlcp import Prepared, Status, solve_lcp
from validation.harness import Job, Row
from validation.harness.suite import Suite

WIDTH = 1.5
EULER_STEPS = 4


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


def grid_of(put: Put, size: int) -> Grid:
    """Return the grid of so many nodes and time steps, the strike between two nodes."""
    dx = 2.0 * WIDTH / (size + 1)
    x = np.log(put.strike) + (np.arange(size) - size // 2 + 0.5) * dx
    diffusion = 0.5 * put.sigma**2 / dx**2
    drift = (put.rate - put.dividend - 0.5 * put.sigma**2) / (2.0 * dx)
    half = 0.5 * put.years / size
    payoff = np.maximum(put.strike - np.exp(x), 0.0)
    left = put.strike - np.exp(x[0] - dx)
    below, above = half * (drift - diffusion), -half * (diffusion + drift)
    diagonal = 1.0 + half * (2.0 * diffusion + put.rate)
    return Grid(x, payoff, left, below, diagonal, above)


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
    """Return V, the solution of A V + q >= 0, V >= payoff; q is overwritten."""
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
    return V


class March:
    """A put on its way through time; step(q, V) returns the next V."""

    def __init__(self, grid: Grid, step: Callable[..., np.ndarray]) -> None:
        self.grid, self.step, self.done = grid, step, 0
        self.V = grid.payoff.copy()
        self.q = np.empty_like(self.V)

    def run(self, steps: int) -> float:
        _, _, left, *A = self.grid
        start = time.thread_time()
        for _ in range(steps):
            right_side(self.V, *A, left, self.done < EULER_STEPS, self.q)
            self.V = self.step(self.q, self.V)
            self.done += 1
        return time.thread_time() - start

    def price(self, spot: float) -> float:
        x = self.grid.x
        k = int(np.searchsorted(x, np.log(spot)))
        near = slice(k - 8, k + 8)
        return float(CubicSpline(x[near], self.V[near])(np.log(spot)))


def kept(grid: Grid) -> March:
    factor = np.empty((3, grid.x.size))
    factorise(grid.below, grid.diagonal, grid.above, factor)
    return March(grid, partial(brennan_schwartz, factor, grid.payoff))


def package(grid: Grid) -> March:
    bands, n = [grid.below, grid.diagonal, grid.above], grid.x.size
    A = sp.diags_array(bands, offsets=[-1, 0, 1], shape=(n, n))
    matrix = Prepared(sp.csr_array(A))

    def step(q: np.ndarray, V: np.ndarray) -> np.ndarray:
        result = solve_lcp(matrix, q, grid.payoff, z0=V)
        if result.status is not Status.SOLVED:
            raise RuntimeError(result.status.value)
        return result.z

    return March(grid, step)


BLOCK = 10  # steps that one method takes before it is the other's turn


def timed(_: Job, name: str, size: int) -> Row:
    put = PUTS[name]
    grid = grid_of(put, size)
    for kind in (package, kept):
        kind(grid).run(2)  # compiled
    ours, other = package(grid), kept(grid)
    turns = range(size // BLOCK)
    seconds = np.array([[m.run(BLOCK) for m in (ours, other)] for _ in turns])
    ours.run(EULER_STEPS // 2)  # so many half steps more than whole ones
    price, per_step = ours.price(put.spot), np.median(seconds, axis=0) / BLOCK
    row = {"steps": size, "price": price, "error": price - put.price}
    row |= {"us_a_step": per_step[0] * 1e6, "us_kept": per_step[1] * 1e6}
    return row | {"ratio": float(np.median(seconds[:, 0] / seconds[:, 1]))}


SUITE = Suite(
    name="american-put",
    requests=lambda args: ({"put": name, "nodes": 4000} for name in PUTS), work=timed,
    columns="put nodes | steps price error us_a_step us_kept ratio",
)  # fmt: skip
