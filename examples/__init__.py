"""Examples of sequences of problems, each in a second or two, with a picture.

A module has `run`, which solves, prints what came out and returns a record, and `draw`,
which draws the record into a figure of matplotlib.
"""

from importlib.util import find_spec

from examples import discs, frontier, lasso, membrane, pendulum, tuning

EXAMPLES = {
    "mpc": ("a pendulum on a cart, controlled", pendulum),
    "frontier": ("an efficient frontier", frontier),
    "lasso": ("the path of the lasso", lasso),
    "discs": ("discs that fall, with friction", discs),
    "membrane": ("a membrane over a ball", membrane),
    "tuning": ("a penalty by its gradient", tuning),
}
"""By name: the title, and the module."""


def show_example(name: str, picture: str | None) -> int:
    """Run an example; draw it into the file `picture`; return 0 if all was solved."""
    title, module = EXAMPLES[name]
    if picture is not None and find_spec("matplotlib") is None:
        print("a picture needs matplotlib: pip install matplotlib")
        return 2
    print(f"{name}: {title}")
    record = module.run()
    if picture is None:
        print("(--picture FILE.png draws it)")
    else:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        module.draw(record, figure)
        figure.savefig(picture, dpi=120)
        print(f"drawn in {picture}")
    return 0 if record.solved else 1
