"""The tolerances and limits of a solve, as compiled code reads them."""


class Settings:
    """eps_abs, eps_rel and max_iter as in `Options`, time_limit in seconds."""

    def __init__(self, eps_abs, eps_rel, max_iter, time_limit):
        self.eps_abs, self.eps_rel = eps_abs, eps_rel
        self.max_iter, self.time_limit = max_iter, time_limit
