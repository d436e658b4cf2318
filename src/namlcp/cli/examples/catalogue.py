"""The examples by name, and what running one means."""

import inspect
import sys
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any, NamedTuple

from namlcp.cli.examples import discs, frontier, lasso, membrane, pendulum, tuning


class Example(NamedTuple):
    """What is said of an example, and its functions."""

    title: str
    run: Callable[[], Any]
    draw: Callable[[Any, Any], None]


EXAMPLES = {
    "mpc": Example("a pendulum on a cart, controlled", pendulum.run, pendulum.draw),
    "frontier": Example("an efficient frontier", frontier.run, frontier.draw),
    "lasso": Example("the path of the lasso", lasso.run, lasso.draw),
    "discs": Example("discs that fall, with friction", discs.run, discs.draw),
    "membrane": Example("a membrane over a ball", membrane.run, membrane.draw),
    "tuning": Example("a penalty by its gradient", tuning.run, tuning.draw),
}


def source(name: str) -> str:
    """Return the code of an example."""
    return inspect.getsource(sys.modules[EXAMPLES[name].run.__module__])


def show_example(name: str, picture: str | None) -> int:
    """Run an example; draw it into the file `picture`; return 0 if all was solved."""
    example = EXAMPLES[name]
    if picture is not None and find_spec("matplotlib") is None:
        print("a picture needs matplotlib: pip install matplotlib")
        return 2
    print(f"{name}: {example.title}")
    record = example.run()
    if picture is None:
        print("(--picture FILE.png draws it)")
    else:
        from matplotlib.figure import Figure

        figure = Figure(figsize=(9.0, 6.0), layout="constrained")
        example.draw(record, figure)
        figure.savefig(picture, dpi=120)
        print(f"drawn in {picture}")
    return 0 if record.solved else 1
