"""The command line that the scripts of this room share: run, or plot."""

import argparse
from collections.abc import Callable
from pathlib import Path

from validation.harness import cli


def run_or_plot(
    parser: argparse.ArgumentParser,
    arguments: list[str] | None,
    stem: str,
    run: Callable[[argparse.Namespace], None],
) -> int:
    """Parse the arguments; run, or draw what is in --csv by figures.draw_<stem>."""
    parser.add_argument("what", choices=("run", "plot"))
    parser.add_argument("--figure", type=Path, default=cli.FIGURES / f"{stem}.svg")
    args = parser.parse_args(arguments)
    if args.what == "run":
        run(args)
    else:
        from validation.repeated import figures

        getattr(figures, f"draw_{stem}")(args.csv, args.figure)
    return 0
