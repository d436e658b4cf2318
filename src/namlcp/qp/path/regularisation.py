"""Proximal regularisation that follows the accuracy of the linear solves.

rho and delta, on the diagonal of K~, belong to proximal terms around the current point:
they shorten the steps but do not move the solution. They fall with mu to FLOOR. From
there inaccurate solves raise them, and accurate solves lower the one that dominates its
residual.
"""

# Values at the start.
RHO, DELTA = 1e-6, 1e-4
# rho and delta fall with mu down to FLOOR; then accurate solves, or steps without
# inequalities, lower them down to LOWEST. A bad solve raises them tenfold, up to TOP.
FLOOR, LOWEST, TOP = 1e-7, 1e-16, 1e-6
# Relative residuals above which a solve is bad, and below which it is accurate.
POOR, ACCURATE = 1e-5, 1e-8
# Iterations without lowering after a bad solve.
WAIT = 3


class Regularisation:
    """The pair (rho, delta)."""

    def __init__(self) -> None:
        self.rho, self.delta = RHO, DELTA
        self.wait = 0

    def follow(self, mu_old: float, mu: float) -> None:
        """Multiply by 1 - |mu_old - mu|/mu_old, not below FLOOR."""
        factor = max(0.0, 1.0 - abs(mu_old - mu) / mu_old) if mu_old > 0.0 else 0.0
        if self.rho > FLOOR:
            self.rho = max(self.rho * factor, FLOOR)
        if self.delta > FLOOR:
            self.delta = max(self.delta * factor, FLOOR)

    def lower(self, rho: bool = True, delta: bool = True) -> None:
        """Divide rho, delta or both by ten."""
        if rho:
            self.rho = max(0.1 * self.rho, LOWEST)
        if delta:
            self.delta = max(0.1 * self.delta, LOWEST)

    def strengthen(self) -> None:
        """Raise both after a bad solve."""
        self.rho = max(self.rho, min(10.0 * self.rho, TOP))
        self.delta = max(self.delta, min(10.0 * self.delta, TOP))
        self.wait = WAIT

    def adapt(self, error: float, rho_dominates: bool, delta_dominates: bool) -> None:
        """Raise or lower after a step solved with this relative residual."""
        if not error <= POOR:
            self.strengthen()
        elif self.wait > 0:
            self.wait -= 1
        elif error < ACCURATE:
            self.lower(rho_dominates, delta_dominates)
