"""Discs that fall with friction for 300 steps: an LCP each, from the last one or not.

A row for every step: unknowns, method, Res over max |q_i|, processor time, energy and
deepest overlap. The scene: `namlcp.scenes.stepping`.
"""

from collections.abc import Iterator

from namlcp.scenes.stepping import FallingDiscs
from validation.harness import Job, Row
from validation.harness.suite import Args, Suite

COUNTS = (5, 10, 30, 60)
QUICK = (5, 10)
STEPS = 300
STARTS = ("last step", "nothing")


def work(job: Job, count: int, start: str) -> Row:
    warm_up = FallingDiscs(QUICK[0])
    for _ in range(STEPS):
        warm_up.step()
    job.ready()
    discs = FallingDiscs(count, warm=start == "last step")
    records = [discs.step()._asdict() for _ in range(STEPS)]
    return {"rows": [r | {"status": r["status"].value} for r in records]}


def requests(args: Args) -> Iterator[Row]:
    for count in QUICK if args.quick else COUNTS:
        for start in STARTS:
            yield {"discs": count, "start": start}


def conclude(rows: list[Row]) -> list[Row]:
    steps = rows[0].get("rows", [{"status": rows[0].get("status")}])
    return [rows[0] | {"step": k} | step for k, step in enumerate(steps)]


SUITE = Suite(
    name="time-stepping",
    doc=__doc__,
    requests=requests,
    work=work,
    conclude=conclude,
    columns="discs start step n status method residual seconds energy overlap",
    keys="discs start",
    limit=600.0,
)
