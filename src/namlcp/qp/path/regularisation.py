"""Proximal regularisation that follows the accuracy of the linear solves.

rho and delta stand on the diagonal of K~ with centres at the current point, so they
slow the steps but do not move the solution. They shrink with mu to 1e-7. From there the
linear algebra decides: inaccurate solves raise them, accurate ones lower what *binds*,
that is, holds the residual up. LP-like problems stay near 1e-7, where LDL' without
pivoting keeps its digits; huge multipliers and nearly dependent rows go to 1e-12.
"""

FLOOR = 1e-7  # mu leads down to here
LEAST = 1e-16
TOP = 1e-6  # largest value a raise can reach
POOR = 1e-5  # relative residual of a bad solve
GOOD = 1e-8
WAIT = 3  # iterations without lowering after a bad solve


class Regularisation:
    """The pair (rho, delta)."""

    def __init__(self) -> None:
        """Begin large: the first iterations shrink it."""
        self.rho, self.delta = 1e-6, 1e-4
        self.wait = 0

    def follow(self, mu_old: float, mu: float) -> None:
        """Multiply by 1 - |mu_old - mu|/mu_old, not below the floor."""
        factor = max(0.0, 1.0 - abs(mu_old - mu) / mu_old) if mu_old > 0.0 else 0.0
        if self.rho > FLOOR:
            self.rho = max(self.rho * factor, FLOOR)
        if self.delta > FLOOR:
            self.delta = max(self.delta * factor, FLOOR)

    def fade(self) -> None:
        """Without inequalities: ten times less after every step."""
        self.rho = max(0.1 * self.rho, LEAST)
        self.delta = max(0.1 * self.delta, LEAST)

    def strengthen(self) -> None:
        """Answer a bad solve."""
        self.rho = max(self.rho, min(10.0 * self.rho, TOP))
        self.delta = max(self.delta, min(10.0 * self.delta, TOP))
        self.wait = WAIT

    def adapt(self, error: float, rho_binds: bool, delta_binds: bool) -> None:
        """Draw the consequences of a step solved with this relative residual."""
        if not error <= POOR:
            self.strengthen()
        elif self.wait > 0:
            self.wait -= 1
        elif error < GOOD:
            if rho_binds:
                self.rho = max(0.1 * self.rho, LEAST)
            if delta_binds:
                self.delta = max(0.1 * self.delta, LEAST)
