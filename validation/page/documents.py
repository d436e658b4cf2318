"""The figures and tables of README.md and validation/README.md, from the CSV files.

A figure is followed by the name of its value (`claims.marks`). A table stands between
``<!-- table: NAME -->`` and ``<!-- end -->``. `python -m validation.page.documents`
writes both documents anew, with --check it only tells what differs; `report --full
--out validation` does it at its end.
"""

import re
import sys
from collections.abc import Callable
from pathlib import Path

from validation.applications import cvxpy_models, cvxpy_resolve, large_figures
from validation.claims import renewed, stale, summary, values
from validation.general import benchmark, stepping
from validation.harness import Row, cli, csv_files, tables
from validation.peers import classes, lcp, maros_meszaros, runs
from validation.repeated import sequences
from validation.stress import campaign_tally

DOCUMENTS = (cli.ROOT / "README.md", cli.ROOT / "validation" / "README.md")
BLOCK = re.compile(r"(<!-- table: (.+?) -->\n).*?(?=<!-- end -->)", re.DOTALL)


def of(
    file: str,
    table: Callable[[list[Row]], str],
    read: Callable[[Path], list[Row]] = csv_files.read,
) -> Callable[[Path], str]:
    """Return a table of the rows of one file in a folder of results."""
    return lambda results: table(read(results / file))


def taken(results: Path) -> str:
    """Return the table of who was measured when, from the headers of the files."""
    files: dict[tuple[str, ...], list[str]] = {}
    for file in sorted(results.glob("*.csv")):
        said = dict(
            line.split(": ", 1) for line in csv_files.header(file) if ": " in line
        )
        key = tuple(said.get(name, "") for name in ("commit", "date", "cpu", "load"))
        files.setdefault(key, []).append(file.stem)
    lines = ((*key, ", ".join(names)) for key, names in sorted(files.items()))
    return tables.markdown(("commit", "date", "machine", "load", "files"), lines)


TABLES: dict[str, Callable[[Path], str]] = {
    "taken": taken,
    "claims": summary,
    "sets": of("benchmark.csv", runs.markdown, runs.read_rows),
    "classes": of("classes.csv", classes.markdown, runs.read_rows),
    "Maros-Meszaros": of(
        "maros-meszaros.csv", maros_meszaros.markdown, maros_meszaros.read_results
    ),
    "sequences": of("sequences.csv", sequences.markdown),
    "campaign": of("campaign.csv", campaign_tally.of_bars, campaign_tally.counted),
    "campaign, all solvers": of(
        "campaign.csv", campaign_tally.of_solvers, campaign_tally.counted
    ),
    "CVXPY": of("cvxpy-models.csv", cvxpy_models.markdown),
    "CVXPY, again and again": of("cvxpy-resolve.csv", cvxpy_resolve.markdown),
    "other LCPs": of("general-lcps.csv", benchmark.markdown),
    "falling discs": of("time-stepping.csv", stepping.markdown),
    "large": of("large.csv", large_figures.markdown),
    "first solves": of("first-call.csv", lcp.markdown),
}
"""What the blocks of a document hold, by name."""


def written(text: str, results: Path = cli.RESULTS) -> str:
    """Return a document with the figures and tables of a folder of results."""

    def block(found: re.Match[str]) -> str:
        begin, name = found.groups()
        return f"{begin}\n{TABLES[name](results)}\n\n"

    return BLOCK.sub(block, renewed(text, values(results)))


def write() -> None:
    """Write the documents with what the results say now."""
    for document in DOCUMENTS:
        document.write_text(written(document.read_text()))


def faults(document: Path) -> list[str]:
    """Return what a document says that the results do not."""
    text = document.read_text()
    old, new = ([b.group() for b in BLOCK.finditer(t)] for t in (text, written(text)))
    differ = [a.splitlines()[0] for a, b in zip(old, new, strict=True) if a != b]
    return stale(text, values()) + differ


def main(arguments: list[str] | None = None) -> int:
    """Write the documents, or tell what differs."""
    parser = cli.parser(__doc__)
    parser.add_argument("--check", action="store_true", help="write nothing")
    args = parser.parse_args(arguments)
    found = [
        f"{each.relative_to(cli.ROOT)}: {fault}"
        for each in DOCUMENTS
        for fault in faults(each)
    ]
    print("\n".join(found))
    if not args.check:
        write()
    return int(args.check and bool(found))


if __name__ == "__main__":
    sys.exit(main())
