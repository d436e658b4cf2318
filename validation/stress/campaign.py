"""Is anything wrong ever called solved? A seeded campaign over every kind of problem.

Problem i of a set of classes comes from (seed, i) alone (`problems.fuzzed`). The sets:
"every" kind of QP and LCP, "general" LCPs, "values", and those of `campaign_relations`.
What hangs or crashes costs that problem. The CSV counts outcomes for each class and
seed and lists the indices of what was not right; run again with the same file it goes
on where it stopped. `problem_of` asks one of them once more.

nam gets the arguments in all their representations, at its default settings, with
warnings as errors. Its peers get the convex QPs of "every" and of the first seed (those
with a definite P for quadprog), clean, through qpsolvers with EPS as absolute tolerance
and their default limits; theirs is a wrong "found" only beyond tenfold EPS, relative to
the size of the terms.
"""

import argparse
import itertools
import os
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

from validation.harness import Bench, Job, Row, cli, machine, tables
from validation.problems import infeasible_cases
from validation.problems.fuzzed import cases
from validation.stress import campaign_answers as answers
from validation.stress import campaign_judge as judge
from validation.stress import campaign_relations as relations

SOLVERS = ["nam", "osqp", "piqp", "proxqp", "clarabel", "daqp", "quadprog"]
SETS = (*cases.CYCLES, *relations.RELATIONS)
BATCH = 500  # problems between two writings of the CSV
LIMIT = 5.0  # [s] a problem; the children have GRACE more
EPS, LOOSE = 1e-6, 10.0  # of the peers; beyond LOOSE EPS "found" is wrong
KEY = "seed set solver class truth outcome".split()
COLUMNS = [*KEY, *"count seconds slowest cases first".split()]
LISTED = 40  # indices of a class and outcome in the CSV


class Part(NamedTuple):
    """What is run in one go: problems 0, 1, ... of a set and a seed, by one solver."""

    seed: int
    set: str
    solver: str


class Tally:
    """The counts of a campaign, kept in a CSV.

    A row has the indices of the first problems with an outcome that is not right. Those
    with the outcome "done" tell how many problems a solver has behind it, and in how
    many seconds with all that is around.
    """

    def __init__(self, path: Path, header: list[str]) -> None:
        self.path, self.header = path, header
        self.rows = {tuple(row[name] for name in KEY): row for row in read(path)}

    def row(self, *key: Any) -> Row:
        new = dict(zip(COLUMNS, (*key, 0, 0.0, 0.0, "", ""), strict=True))
        return self.rows.setdefault(key, new)

    def done(self, part: Part) -> Row:
        return self.row(*part, "", "", "done")

    def add(self, part: Part, index: int, found: Row) -> None:
        row = self.row(*part, found["class"], found["truth"], found["outcome"])
        if found["outcome"] != "right" and row["count"] < LISTED:
            row["cases"] = f"{row['cases']} {index}".strip()
            row["first"] = row["first"] or " ".join(found["why"].split())[:160]
        row["count"] += 1
        row["seconds"] = round(row["seconds"] + found["time"], 4)
        row["slowest"] = max(row["slowest"], round(found["time"], 4))

    def write(self) -> None:
        new = self.path.with_suffix(".part")
        tables.write(new, self.header, [self.rows[key] for key in sorted(self.rows)])
        os.replace(new, self.path)


def read(path: Path) -> Iterator[Row]:
    for row in tables.read(path):
        numbers = {name: int(row[name]) for name in ("seed", "count")}
        times = {name: float(row[name] or 0.0) for name in ("seconds", "slowest")}
        yield row | numbers | times


def truth_of(case: cases.Case) -> str:
    if case.truth != "ask":
        return case.truth
    problem = answers.qpsolvers_problem(case)
    feasible = infeasible_cases.is_feasible(problem)
    descends = infeasible_cases.is_unbounded(problem)
    if None in (feasible, descends):
        return "near"
    if feasible:
        return "unbounded" if descends else "solvable"
    return "both" if descends else "infeasible"


def judged(case: cases.Case, answer: judge.Answer, own: bool) -> tuple[str, str, str]:
    """Return what is true, the outcome, and why it is not right."""
    if case.group in cases.MALFORMED:
        return "malformed", *judge.judge_malformed(answer, case.truth)
    if "P" not in case.arguments:
        told = case.problem, case.truth, answer, answers.NAM_LCP
        return case.truth, *judge.judge_lcp(*told)
    truth, qp = truth_of(case), answers.clean(case.problem)
    tolerance = judge.NAM if own else judge.Tolerance(EPS, EPS, LOOSE)
    return truth, *judge.judge_qp(qp, truth, answer, tolerance, own)


def examine(case: cases.Case, solver: str, limit: float) -> Row:
    own = solver == "nam"
    start = time.perf_counter()
    if own:
        answer, _ = answers.ask_nam(case)
    else:
        answer = answers.ask_peer(case, solver, EPS, limit)
    seconds = time.perf_counter() - start
    truth, outcome, why = judged(case, answer, own)
    return {"truth": truth, "outcome": outcome, "why": why, "time": seconds}


def problem_of(part: Part, i: int, limit: float) -> Row:
    if part.set in relations.RELATIONS:
        start = time.perf_counter()
        outcome, why = relations.examine(part.seed, i, part.set)
        found = {"truth": "related", "outcome": outcome, "why": why}
        return found | {"time": time.perf_counter() - start}
    return examine(cases.make(part.seed, i, part.set), part.solver, limit)


def work(job: Job, index: int) -> Row:
    job.ready()
    return problem_of(job.data, index, job.limit)


def asked(child: Bench, index: int) -> Row:
    row, name = child.ask(index), child.data.set
    if "outcome" not in row:
        words = row["status"]
        outcome = {"timeout": "hang", "crashed": "crash"}.get(words, "raised")
        row = {"truth": "", "outcome": outcome, "why": words, "time": child.limit}
    of = relations.class_of if name in relations.RELATIONS else cases.group_of
    return row | {"class": of(index, name)}


def run(args: argparse.Namespace) -> int:
    """Run what is not done; return 1 if an answer of nam is never to be given."""
    tally = Tally(args.csv, cli.begin(SOLVERS))  # more of them may come later
    solvers = machine.installed(args.solvers)
    for name, solver, seed in itertools.product(args.classes, solvers, args.seeds):
        if solver != "nam" and (name, seed) != ("every", args.seeds[0]):
            continue
        part = Part(seed, name, solver)
        run_part(part, tally, args)
        print(f"{part}: {tally.done(part)['count']} problems", flush=True)
    shown = "set class:30 truth solver outcome count first:60"
    rows = tally.rows.values()
    others = (row for row in rows if row["outcome"] not in ("right", "done"))
    tables.print_rows(others, shown)
    ours = (row["outcome"] for row in rows if row["solver"] == "nam")
    return int(not {"right", "refused", "done"}.issuperset(ours))


def run_part(part: Part, tally: Tally, args: argparse.Namespace) -> None:
    suited = cases.DEFINITE if part.solver == "quadprog" else cases.CONVEX
    done = tally.done(part)
    if done["count"] >= args.problems:
        return
    with ExitStack() as stack:
        child = Bench(work, part.solver, args.limit, part)
        stack.callback(child.stop)
        began = time.perf_counter()
        for i in range(done["count"], args.problems):
            if part.solver == "nam" or cases.kind_of(i, part.set) in suited:
                tally.add(part, i, asked(child, i))
            if (i + 1) % BATCH == 0 or i + 1 == args.problems:
                spent, began = time.perf_counter() - began, time.perf_counter()
                done |= {"count": i + 1, "seconds": round(done["seconds"] + spent, 3)}
                tally.write()


def main(arguments: list[str] | None = None) -> int:
    parser = cli.parser(__doc__, csv=..., limit=LIMIT)
    parser.add_argument("--solvers", nargs="+", default=["nam"], choices=SOLVERS)
    parser.add_argument("--seeds", type=int, nargs="+", default=[1])
    parser.add_argument("--classes", default=["every"], choices=SETS, nargs="+")
    help_ = "of each set and seed"
    parser.add_argument("--problems", type=int, default=100_000, help=help_)
    return run(parser.parse_args(arguments))
