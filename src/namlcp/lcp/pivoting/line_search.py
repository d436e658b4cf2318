"""Exact line search towards the solution of a free system, for symmetric A.

A proximal step from the point c seeks x = clip(s) where w = A x + q, s = c - w / rho.
For symmetric positive semidefinite A this x minimises the convex function

    phi(x) = 1/2 x'A x + rho/2 (|| s ||^2 - || s - clip(s) ||^2)

(an augmented Lagrangian of the problem that has x for multipliers), whose gradient is
A (x - clip(s)). Newton's step solves the free system of the unknowns with s inside its
bounds. Block pivoting takes the whole step and may cycle; with an exact line search
Newton's method converges from every start. Along the step x and s are linear, and phi'
= -rho (s_1 - s_0)'(x - clip(s)) is piecewise linear.

References
----------
Li, Sun and Toh, SIAM J. Optim. 28 (2018) 433-458; Hermans, Themelis and Patrinos, Math.
Program. Comput. 14 (2022) 497-541 (the exact search).
"""

from namlcp.compiled import part

BISECTIONS = 40
"""Bisections of [0, 1] for the zero of phi': the step has an error of 1e-12."""


@part
def end_at(z, centre, w, rho, state, s_end):
    """Write to s_end the value of s at the solution z of the free system.

    For free unknowns s = z but for rounding errors, which division by rho magnifies.
    """
    for i in range(z.size):
        s_end[i] = z[i] if state[i] == 0 else centre[i] - w[i] / rho


@part
def slope(x, s, x_end, s_end, lower, upper, step):
    """Return phi' / rho at x + step (x_end - x)."""
    total = 0.0
    for i in range(x.size):
        d = s_end[i] - s[i]
        at = s[i] + step * d
        x_i = x[i] + step * (x_end[i] - x[i])
        total -= d * (x_i - min(max(at, lower[i]), upper[i]))
    return total


@part
def step_to(x, s, x_end, s_end, lower, upper):
    """Move x and s to the minimiser of phi on the way to x_end; return the step."""
    step = 1.0
    if slope(x, s, x_end, s_end, lower, upper, 1.0) > 0.0:
        below, above = 0.0, 1.0
        for _ in range(BISECTIONS):
            step = 0.5 * (below + above)
            if slope(x, s, x_end, s_end, lower, upper, step) > 0.0:
                above = step
            else:
                below = step
    for i in range(x.size):
        x[i] += step * (x_end[i] - x[i])
        s[i] += step * (s_end[i] - s[i])
    return step


@part
def states_at(s, lower, upper, rho, tolerance, state, goal):
    """Write to goal the states of s; a violation within the tolerance changes none.

    The tolerance applies to s of free unknowns and to rho (s - bound) of the others.
    """
    for i in range(s.size):
        if lower[i] == upper[i]:
            continue
        slack = tolerance if state[i] == 0 else 0.0
        goal[i] = state[i]
        if s[i] < lower[i] - slack:
            goal[i] = -1
        elif s[i] > upper[i] + slack:
            goal[i] = 1
        elif state[i] < 0 and rho * (s[i] - lower[i]) > tolerance:
            goal[i] = 0
        elif state[i] > 0 and rho * (upper[i] - s[i]) > tolerance:
            goal[i] = 0
