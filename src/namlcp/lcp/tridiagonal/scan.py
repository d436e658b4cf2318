"""The free set of a tridiagonal M-matrix with lower bounds, found in one scan.

Unknowns begin at their lower bounds. From left to right, whoever has w_i < 0 is freed,
for good, since freeing others only pushes w_i down: Chandrasekaran's method (1970), in
O(n) for tridiagonal matrices as Cottle and Sacher showed (Appl. Math. Optim. 3 (1977)
321-340). Here what makes it so are the segments of free unknowns between bounded ones:
the first and the last one of a segment are, in changes from the beginning,

    x_first = alpha + p x_l + s x_r,    x_last = beta + t x_l + v x_r,

x_l and x_r being its neighbours, and the six numbers of two neighbouring segments give
those of their union. All are sums and products of numbers >= 0.
"""

from namlcp.compiled import part
from namlcp.lcp.tridiagonal.diagonals import ABOVE, BELOW, DIAGONAL

# Places of alpha and beta.
FIRST, LAST = 0, 3


@part
def join(one, two):
    """Return the segment of two neighbouring ones (their six numbers each)."""
    alpha1, p1, s1, beta1, t1, v1 = one
    alpha2, p2, s2, beta2, t2, v2 = two
    inverse = 1.0 / (1.0 - v1 * p2)
    last = inverse * (beta1 + v1 * alpha2)  # of one, for bounded neighbours
    first = inverse * (alpha2 + p2 * beta1)  # of two
    return (
        alpha1 + s1 * first,
        p1 + s1 * p2 * t1 * inverse,
        s1 * s2 * inverse,
        beta2 + t2 * last,
        t2 * t1 * inverse,
        v2 + t2 * v1 * s2 * inverse,
    )


@part
def segment(stack, k):
    """Return the six numbers of segment k."""
    return (
        stack[0, k],
        stack[1, k],
        stack[2, k],
        stack[3, k],
        stack[4, k],
        stack[5, k],
    )


@part
def scan(rows, slope, lower, upper, stack, spans, state):
    """Write the states of the solution: 0 for free unknowns, -1 for the others.

    Freeing the last unknown so far pushes up the segment that it joins, which may free
    the one before that, and so on. Bounds are lower ones, or l = u.

    Parameters
    ----------
    rows : (5, n) array
        A as in `Tridiagonal`.
    slope : (n,) array
        A z + q, with the unknowns without bounds solved for and the others at their
        bounds: from there all go up.
    lower, upper : (n,) array
        Bounds.
    stack : (6, (n + 1) // 2) array
        Work: the six numbers of each segment.
    spans : (2, (n + 1) // 2) int64 array
        Work: first and last unknown of each.
    state : (n,) int8 array
        On entry 0 for unknowns without bounds, -1 for the others; on return the states.
    """
    n = state.size
    top = -1
    for k in range(n):
        if lower[k] == upper[k]:
            continue
        w = slope[k]
        if top >= 0 and spans[1, top] == k - 1:
            w += rows[BELOW, k] * stack[LAST, top]
        if not (w < 0.0 or state[k] == 0):
            continue
        i = k
        while True:  # free i, which is k or stands before the segment on top
            state[i] = 0
            a = 1.0 / rows[DIAGONAL, i]
            x = -slope[i] * a
            p, s = -rows[BELOW, i] * a, -rows[ABOVE, i] * a
            piece = (x, p, s, x, p, s)
            first, last = i, i
            if i < k:
                piece = join(piece, segment(stack, top))
                last = spans[1, top]
                top -= 1
            if top >= 0 and spans[1, top] == i - 1:
                piece = join(segment(stack, top), piece)
                first = spans[0, top]
                top -= 1
            top += 1
            for r in range(6):
                stack[r, top] = piece[r]
            spans[0, top], spans[1, top] = first, last
            i = first - 1
            if i < 0 or lower[i] == upper[i]:
                break
            w = slope[i] + rows[ABOVE, i] * stack[FIRST, top]
            if top > 0 and spans[1, top - 1] == i - 1:
                w += rows[BELOW, i] * stack[LAST, top - 1]
            if not w < 0.0:
                break
