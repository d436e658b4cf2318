"""How far to go towards the solution of a face system, for symmetric A.

A proximal step from the centre c seeks x = clip(s) where w = A x + q, s = c - w / rho.
For symmetric positive semidefinite A that is where the convex function

    phi(x) = 1/2 x'A x + rho/2 (|| s ||^2 - || s - clip(s) ||^2)

is least (an augmented Lagrangian, of the problem that has x for multipliers): its
gradient is A (x - clip(s)). On the face, the unknowns with s inside its bounds,
Newton's step solves the face system: block pivoting takes all of it, and may go round
in circles. With the step that is best along it, it does not, from wherever it starts.

Along the step x and s are linear, and so is phi' from one change of the face to the
next: phi' = -rho (s_1 - s_0)'(x - clip(s)).

References
----------
Li, Sun and Toh, SIAM J. Optim. 28 (2018) 433-458; Hermans, Themelis and Patrinos, Math.
Program. Comput. 14 (2022) 497-541 (the exact search).
"""

from namlcp.compiled import part

HALVINGS = 40


@part
def begin_at(centre, w, rho, x, s):
    """Begin the search at the centre, where w = A x + q; rho = 0 has none."""
    for i in range(x.size):
        x[i] = centre[i]
        s[i] = centre[i] - w[i] / rho


@part
def end_at(z, centre, w, rho, state, s_end):
    """Write s at the solution z of the face system.

    On the face s = z up to rounding, which w / rho would blow up.
    """
    for i in range(z.size):
        s_end[i] = z[i] if state[i] == 0 else centre[i] - w[i] / rho


@part
def slope(x, s, x_end, s_end, lower, upper, step):
    """Return phi' / rho at that step."""
    total = 0.0
    for i in range(x.size):
        d = s_end[i] - s[i]
        at = s[i] + step * d
        x_i = x[i] + step * (x_end[i] - x[i])
        total -= d * (x_i - min(max(at, lower[i]), upper[i]))
    return total


@part
def step_to(x, s, x_end, s_end, lower, upper):
    """Move x and s to the least phi on the way to x_end, s_end; return the step."""
    step = 1.0
    if slope(x, s, x_end, s_end, lower, upper, 1.0) > 0.0:
        below, above = 0.0, 1.0
        for _ in range(HALVINGS):
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
    """Write to goal the states that s tells; within tolerance they stay what they are.

    That is a tolerance of x for the unknowns that are free, of w for the others.
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
