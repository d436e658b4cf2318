"""The parts of the report, in their order: what a stopped run should have comes first.

Seconds are those of one quiet core, all kernels compiled and everything asked anew. A
later run on the same processor keeps rows of peers (`processes.keep_peers`), which
saves all of maros-peers and a quarter of an hour of the other parts.
"""

from typing import NamedTuple


class Part(NamedTuple):
    """A title, the commands, the figures they make, seconds that they take about.

    {data}, {results} and {figures} stand for folders, {quick} and {-quick} for what a
    quick run adds; `quick_seconds` is 0 where there is no quick version. `grown` are
    the CSV files with which stopped commands go on: a new run begins without them, but
    with what `processes.keep_peers` keeps, of solvers that are `settled` every row.
    """

    title: str
    commands: tuple[str, ...]
    figures: tuple[str, ...] = ()
    seconds: float = 60.0
    quick_seconds: float = 0.0
    grown: tuple[str, ...] = ()
    settled: tuple[str, ...] = ()


def part(
    title: str,
    seconds: float,
    commands: str,
    figures: str = "",
    quick: float = 0.0,
    grown: str = "",
    settled: str = "",
) -> Part:
    """Return a part whose commands stand one a line, and names in one line."""
    lines = [line.strip() for line in commands.splitlines() if line.strip()]
    names = (tuple(names.split()) for names in (figures, grown, settled))
    drawn, files, solvers = names
    return Part(title, tuple(lines), drawn, seconds, quick, files, solvers)


MAROS_PEERS = "clarabel osqp proxqp"
"""Half an hour for times that nothing is claimed of but that they are larger."""

PARTS = {
    "maros-meszaros": part("The Maros-Meszaros collection", 300.0, """
        peers.maros_meszaros --data {data} --csv {results}/maros-meszaros.csv --go-on \
        --solvers nam piqp
    """, grown="maros-meszaros.csv", settled=MAROS_PEERS),
    "classes": part("The OSQP paper's classes", 235.0, """
        peers.classes --csv {results}/classes.csv --go-on
    """, grown="classes.csv"),
    "infeasible": part("Infeasible and unbounded QPs", 465.0, """
        peers.infeasible --data {data} --csv {results}/infeasible.csv --go-on
    """, grown="infeasible.csv"),
    "cvxpy": part("Models in CVXPY", 500.0, """
        applications.cvxpy_models --csv {results}/cvxpy-models.csv
        applications.cvxpy_resolve --csv {results}/cvxpy-resolve.csv
    """),
    "benchmark": part("MPC, contact and small QPs", 1100.0, """
        peers.benchmark --data {data} --csv {results}/benchmark.csv --go-on
    """, grown="benchmark.csv"),
    "repeated": part("Many QPs alike: sequences, small calls, batches", 1140.0, """
        repeated.sequences run {quick} --csv {results}/sequences.csv
        repeated.sequences plot --csv {results}/sequences.csv --figures {figures}
        repeated.latency run {quick} --csv {results}/latency.csv
        repeated.latency plot --csv {results}/latency.csv --figures {figures}
        repeated.batches run {quick} --csv {results}/batches.csv
        repeated.batches plot --csv {results}/batches.csv --figures {figures}
    """, "sequences.svg latency.svg batches.svg front-repeated.svg", 60.0),
    "general": part("LCPs that are neither P nor semidefinite", 555.0, """
        general.benchmark run {quick} --csv {results}/general-lcps.csv
        general.benchmark plot --csv {results}/general-lcps.csv --figures {figures}
        general.stepping run {quick} --csv {results}/time-stepping.csv
        general.stepping plot --csv {results}/time-stepping.csv --figures {figures}
    """, "general-lcps.svg time-stepping.png", 120.0, "general-lcps.csv"),
    "generalisation": part("Problems that nothing was tuned on", 360.0, """
        peers.generalisation families --csv {results}/generalisation-families.csv \
        --go-on --solvers nam piqp
        peers.generalisation changes --data {data} --csv {results}/generalisation.csv \
        --go-on --solvers nam
    """, grown="generalisation-families.csv generalisation.csv"),
    "derivatives": part("Derivatives against differences; other packages", 480.0, """
        derivatives.differences {quick} --csv {results}/derivatives.csv
        derivatives.packages {quick} --csv {results}/derivatives-peers.csv
        derivatives.closest {quick} --data {data} --csv {results}/closest.csv
    """),
    "lcp": part("LCPs beside PIQP and OSQP", 175.0, """
        peers.lcp contact --data {data} --csv {results}/contact.csv
        peers.lcp example1 --csv {results}/example1.csv
        peers.lcp first-call --csv {results}/first-call.csv
    """),
    "large": part("Large LCPs", 700.0, """
        applications.large --csv {results}/large.csv --go-on
        applications.large plot --csv {results}/large.csv --figures {figures}
    """, "large.svg", grown="large.csv"),
    "work-precision": part("Speed against accuracy", 1000.0, """
        peers.work_precision run {quick} --data {data} --go-on \
        --csv {results}/work-precision-problems.csv
        peers.work_precision plot --csv {results}/work-precision-problems.csv \
        --figures {figures}
    """, "front.svg", 200.0, "work-precision-problems.csv"),
    "oracles": part("Agreement with independent oracles", 600.0, """
        oracles.agreement {quick} --data {data} --csv {results}/oracles.csv
    """, quick=60.0),
    "hertz": part("Hertz contact without a matrix", 50.0, """
        applications.hertz --csv {results}/hertz.csv
    """),
    "put": part("American puts", 10.0, """
        applications.american_put --csv {results}/american-put.csv
    """),
    "paper": part("The paper's tables", 330.0, """
        paper.tables --results {results} --figures {figures}
        paper.tables large --results {results}
    """, "paper-tables.svg paper-methods.svg"),
    "stability": part("Where sweeps fail", 250.0, """
        paper.stability --results {results} --figures {figures}
    """, "stability-maps.png stability-units.png"),
    "parameters": part("Automatic parameters", 500.0, """
        paper.parameters --data {data} --results {results}
    """),
    "h_plus": part("Convergence theory", 115.0, """
        paper.h_plus --results {results}
    """),
    "maros-peers": part("Maros-Meszaros, the other solvers", 2200.0, """
        peers.maros_meszaros --data {data} --csv {results}/maros-meszaros.csv --go-on
    """, grown="maros-meszaros.csv", settled=MAROS_PEERS),
    "campaign": part("Fuzzed problems, and answers asked for in two ways", 1000.0, """
        stress.campaign run --csv {results}/campaign.csv --seeds 1 2 3
        stress.campaign run --csv {results}/campaign.csv --seeds 1 \
        --classes general sequences batches derivatives closest --problems 10000
    """, grown="campaign.csv"),
    "campaign-peers": part("Fuzzed problems, the other solvers", 545.0, """
        stress.campaign run --csv {results}/campaign.csv --seeds 1 \
        --solvers osqp piqp clarabel daqp quadprog
    """, grown="campaign.csv"),
}  # fmt: skip


def sized(part: Part, quick: bool) -> Part:
    """Return a part with {quick} and {-quick} written out."""
    option, suffix = ("--quick", "-quick") if quick else ("", "")
    return part._replace(
        commands=tuple(c.replace("{quick}", option) for c in part.commands),
        figures=tuple(f.replace("{-quick}", suffix) for f in part.figures),
        grown=tuple(f.replace("{-quick}", suffix) for f in part.grown),
        seconds=part.quick_seconds if quick else part.seconds,
    )


FULL = {name: sized(part, False) for name, part in PARTS.items()}
QUICK = {name: sized(part, True) for name, part in PARTS.items() if part.quick_seconds}
