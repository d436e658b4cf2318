"""The free set of a tridiagonal M-matrix with lower bounds, found in one scan.

Unknowns begin at their lower bounds. From left to right, every unknown with w_i < 0 is
freed for good, since freeing others only lowers w_i: Chandrasekaran's method (1970), in
O(n) for tridiagonal matrices (Cottle and Sacher, Appl. Math. Optim. 3 (1977) 321-340).
Of every segment of free unknowns between bounded ones only the changes of its first and
last unknown from their initial values are stored, as functions of those of its left and
right neighbours x_l and x_r:

    x_first = alpha + p x_l + s x_r,    x_last = beta + t x_l + v x_r.

The six coefficients of two adjacent segments give those of their union. All are sums
and products of numbers >= 0.
"""

from namlcp.compiled import part
from namlcp.lcp.tridiagonal.diagonals import ABOVE, BELOW, DIAGONAL

# Positions of alpha and beta among the coefficients (alpha, p, s, beta, t, v).
FIRST, LAST = 0, 3


@part
def join(one, two):
    """Return the coefficients of the union of two adjacent segments."""
    alpha1, p1, s1, beta1, t1, v1 = one
    alpha2, p2, s2, beta2, t2, v2 = two
    inverse = 1.0 / (1.0 - v1 * p2)
    last = inverse * (beta1 + v1 * alpha2)  # x_last of `one` for x_l = x_r = 0
    first = inverse * (alpha2 + p2 * beta1)  # x_first of `two`, likewise
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
    """Return the coefficients of segment k."""
    return stack[0, k], stack[1, k], stack[2, k], stack[3, k], stack[4, k], stack[5, k]


@part
def scan(rows, slope, lower, upper, stack, spans, state):
    """Write the states of the solution: 0 for free unknowns, -1 for the others.

    Freeing an unknown raises the segment that it joins, which may make the unknown to
    the left of this segment free, and so on. Upper bounds are infinite, or l = u.

    On entry `state` is 0 for unknowns without bounds, -1 for the others. slope (n,) is
    A z + q where the former solve their rows and the latter are at their lower bounds.
    Work arrays: stack (6, m), m = (n + 1) // 2, gets the coefficients of each segment,
    spans (2, m) its first and last unknown.
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
        while True:  # free i, which is k or the left neighbour of the top segment
            state[i] = 0
            a = 1.0 / rows[DIAGONAL, i]
            x = -slope[i] * a
            p, s = -rows[BELOW, i] * a, -rows[ABOVE, i] * a
            joined = (x, p, s, x, p, s)
            first, last = i, i
            if i < k:
                joined = join(joined, segment(stack, top))
                last = spans[1, top]
                top -= 1
            if top >= 0 and spans[1, top] == i - 1:
                joined = join(segment(stack, top), joined)
                first = spans[0, top]
                top -= 1
            top += 1
            for r in range(6):
                stack[r, top] = joined[r]
            spans[0, top], spans[1, top] = first, last
            i = first - 1
            if i < 0 or lower[i] == upper[i]:
                break
            w = slope[i] + rows[ABOVE, i] * stack[FIRST, top]
            if top > 0 and spans[1, top - 1] == i - 1:
                w += rows[BELOW, i] * stack[LAST, top - 1]
            if not w < 0.0:
                break
