"""solve_lcp prototype."""
from typing import Any
import time
import numpy as np
from scipy import sparse
from namlcp.lcp import interior, pivoting
from namlcp.lcp.faces import NO_FACTOR, empty_ordering
from namlcp.lcp.matrix import NO_DATA, NO_DENSE, Columns, columns_of, diagonal, is_symmetric
from namlcp.lcp.pivoting import Iterate, Problem
from namlcp.status import Status

TOLF=0.01
def solve_box(A, q, lower, upper, z0=None, *, symmetric=True, eps_abs=0.0, eps_rel=1e-9, max_iter=2000, deadline=np.inf):
    n = q.size
    columns = columns_of(A, symmetric)
    d = np.empty(n)
    diagonal(columns, d)
    unit = d > 0.0
    d = 1.0 / np.sqrt(np.where(unit, d, 1.0))
    scaled = Columns(np.empty_like(columns.dense), np.empty_like(columns.data), columns.indices, columns.indptr)
    problem = Problem(scaled, symmetric, q * d, lower / d, upper / d, d, unit)
    it = Iterate(np.zeros((8, n)), np.zeros(n, np.int8), np.zeros(n, np.int8), np.zeros(7, np.int64), np.zeros(7), empty_ordering(n))
    if z0 is not None:
        it.vectors[0] = z0 / d
    it.number[6]=TOLF
    it.number[pivoting.EPS_ABS] = eps_abs
    it.number[pivoting.EPS_REL] = eps_rel
    outside = (not symmetric) and columns.dense.shape[0]==0 and n > 2000
    code, factor = pivoting.begin(columns, problem, it, NO_FACTOR, max_iter, outside)
    psteps=0
    log=[]
    while code in (pivoting.PATH, pivoting.RAY, pivoting.FACE):
        log.append((code,int(it.count[0]),float(it.number[pivoting.BEST]/it.number[pivoting.SIZE])))
        if code == pivoting.PATH:
            zc = it.vectors[pivoting.CENTRE].copy()
            w, wl, wu = it.vectors[[pivoting.W]][0], it.vectors[pivoting.WL], it.vectors[pivoting.WU]
            w = it.vectors[pivoting.W]
            interior.enter(problem, zc, w, wl, wu)
            state = np.where(lower == upper, -1, 0).astype(np.int8)
            first = interior.complementarity(problem.lower, problem.upper, zc, wl, wu, zc*0, zc*0, zc*0, 0.0)
            psteps, res = interior.follow(problem, it.ordering, state, zc, w, wl, wu, first, 1e-8*it.number[pivoting.SIZE], 60)
            log.append(("path", psteps, res/it.number[pivoting.SIZE]))
            pivoting.adopt(problem, it, zc)
        budget = max_iter - it.count[0]
        code, factor = pivoting.advance(problem, it, factor, budget, outside)
    z = d * it.vectors[pivoting.BEST_Z]
    return code, z, it, psteps, log
