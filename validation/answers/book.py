"""The book of answers: a fixed list of problems, solved again after each change.

write
    Solve the list and store the rows, one CSV a suite, in --book.
check
    Solve the list and sort every difference from the stored rows:
    wrong: another objective than the residuals allow, a solution beside a proof, or a
    verdict of the campaign's judge; other: the same where the judge calls both right;
    worse: solved or proved before, not now; better: the reverse; failure: undecided in
    other words; point: another point of the same objective; way: another method or
    number of iterations; same.
    Returns 1 if anything is wrong or worse.

The rows of a run go to --run; what is there is not solved again. --quick takes every
tenth problem of a suite of those that took less than 0.1 s, in 90 seconds; the whole
list takes about 20 minutes on two cores.
"""

import collections
import math
import shutil
from concurrent.futures import ProcessPoolExecutor
from functools import cache, partial
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from validation.answers.suites import all_suites, row_of
from validation.harness import Row, cli, tables

COLUMNS = ("name", "status", "method", "verdict", "objective", "slack", "residual",
           "size", "mark", "iterations", "seconds")  # fmt: skip
BOOK = cli.RESULTS / "answers"
QUICK, SOON = 10, 0.1  # every so many problems, of those that took less [s]
DECIDED = {"solved", "primal_infeasible", "dual_infeasible", "unsolvable", "right"}
ROUNDING, SAME = 1e-11, 1e-5  # of objectives; of points with one objective
KINDS = ("wrong", "other", "worse", "better", "failure", "point", "way", "same")


suites = cache(all_suites)


def solved(data: Path | None, suite: str, name: str) -> Row:
    return row_of(suites(data)[suite], name)


def chosen(suite: str, names: list[str], book: Path, quick: bool) -> list[str]:
    if not quick:
        return names
    rows = tables.read(book / f"{suite}.csv")
    soon = {row["name"] for row in rows if float(row["seconds"]) < SOON}
    return [name for name in names if name in soon][::QUICK]


def run(args: Any) -> dict[str, list[Row]]:
    cli.begin()
    found: dict[str, list[Row]] = {}
    with ProcessPoolExecutor(args.jobs, get_context("spawn")) as pool:
        for suite, (names, _) in suites(args.data).items():
            if args.suites and suite not in args.suites:
                continue
            wanted = chosen(suite, names, args.book, args.quick)
            file = args.run / f"{suite}.csv"
            with tables.growing(file, [], COLUMNS, ("name",)) as rows:
                left = [name for name in wanted if (name,) not in rows.known]
                size = max(1, min(50, len(left) // (4 * args.jobs)))
                work = partial(solved, args.data, suite)
                for row in pool.map(work, left, chunksize=size):
                    rows.add(row)
                own = {row["name"]: row for row in rows.rows}
            found[suite] = [own[name] for name in wanted]
            print(f"{suite}: {len(wanted)} problems", flush=True)
    return found


def number(row: Row, column: str) -> float:
    return tables.number(row.get(column))


def difference(old: Row, new: Row) -> str:
    """Return one of KINDS."""
    kind = plain_difference(old, new)
    judged = new["verdict"] == "right" or "(both)" in new["method"]
    return "other" if kind == "wrong" and judged else kind


def plain_difference(old: Row, new: Row) -> str:
    before, now = old["status"] in DECIDED, new["status"] in DECIDED
    if new["verdict"] == "wrong" != old["verdict"]:
        return "wrong"
    if before != now:
        return "better" if now else "worse"
    if old["status"] != new["status"]:
        return "wrong" if before else "failure"
    if not before:
        return "same"
    far = abs(number(old, "objective") - number(new, "objective"))
    slack = number(old, "slack") + number(new, "slack")
    if far > slack + ROUNDING * (1.0 + abs(number(old, "objective"))):
        return "wrong"
    for column in ("size", "mark"):
        far = abs(number(old, column) - number(new, column))
        if far > SAME * (1.0 + abs(number(old, "size"))):
            return "point"
    ways = ("method", "iterations")
    return "way" if any(str(old[k]) != str(new[k]) for k in ways) else "same"


def compare(found: dict[str, list[Row]], book: Path) -> int:
    print(f"\n{'':<22}" + "".join(f"{kind:>9}" for kind in KINDS) + "  iterations")
    total: collections.Counter[str] = collections.Counter()
    listed = []
    for suite, rows in found.items():
        stored = {row["name"]: row for row in tables.read(book / f"{suite}.csv")}
        counts: collections.Counter[str] = collections.Counter()
        work = [0.0, 0.0]
        for new in rows:
            old = stored.get(new["name"])
            if old is None:
                continue
            new = {column: str(new.get(column, "")) for column in COLUMNS}
            kind = difference(old, new)
            counts[kind] += 1
            if kind == "same" or kind == "way":
                steps = number(old, "iterations"), number(new, "iterations")
                if not any(map(math.isnan, steps)):
                    work[0], work[1] = work[0] + steps[0], work[1] + steps[1]
            if kind in KINDS[:5]:
                listed.append((kind, suite, old, new))
        total += counts
        ratio = f"{work[1] / work[0]:>10.3f}" if work[0] > 0.0 else ""
        print(f"{suite:<22}" + "".join(f"{counts[k]:>9}" for k in KINDS) + ratio)
    print(f"{'all':<22}" + "".join(f"{total[k]:>9}" for k in KINDS) + "\n")
    for kind, suite, old, new in sorted(listed, key=lambda x: KINDS.index(x[0])):
        told = [
            ", ".join(f"{row[k]}" for k in COLUMNS[1:7] if row[k]) for row in (old, new)
        ]
        print(f"{kind}: {suite} {old['name']}: {told[0]} -> {told[1]}")
    return int(total["wrong"] + total["worse"] > 0)


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, "data", "quick")
    parser.add_argument("part", choices=("write", "check"))
    parser.add_argument("--book", type=Path, default=BOOK, help="the stored rows")
    run_help = "a folder for the rows of this run"
    parser.add_argument("--run", type=Path, required=True, help=run_help)
    parser.add_argument("--suites", nargs="+")
    parser.add_argument("--jobs", type=int, default=2)
    args = parser.parse_args(arguments)
    if args.part == "write" and args.quick:
        parser.error("--quick is for check: the book has the whole list")
    found = run(args)
    if args.part == "check":
        return compare(found, args.book)
    args.book.mkdir(parents=True, exist_ok=True)
    for suite in found:
        shutil.copy(args.run / f"{suite}.csv", args.book)
    return 0
